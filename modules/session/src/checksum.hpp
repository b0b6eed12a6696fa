#pragma once

#include "palpate/core/checksum.hpp"
#include "palpate/core/progress.hpp"

#include <filesystem>
#include <string>

namespace palpate::session {

using core::Sha256;
using core::sha256_of;
std::string sha256_of_file(const std::filesystem::path& path, const core::Progress& progress);

}  // namespace palpate::session
