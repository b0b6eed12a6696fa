#pragma once

#include "palpate/imaging/filters.hpp"

#include <map>
#include <string>

namespace palpate::imaging {

/// Every parameter of the step by its full name, defaults filled in.
/// Throws Error(usage) for a step that no filter accepts.
std::map<std::string, double> complete_parameters(const FilterStep& step);

}  // namespace palpate::imaging
