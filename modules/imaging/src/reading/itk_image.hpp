#pragma once

#include "grey.hpp"
#include "settle.hpp"

#include <string>

namespace palpate::imaging::reading {

/// ITK's own words without its pointers and file names.
std::string plain_words(const std::string& itk_text);

}  // namespace palpate::imaging::reading
