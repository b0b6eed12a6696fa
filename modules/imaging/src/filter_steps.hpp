#pragma once

#include "filter_registry.hpp"

namespace palpate::imaging {

/// A step with everything that it needs to run.
struct PreparedStep {
  const FilterEntry* entry;
  FilterParameters parameters;
};
/// Throws Error(usage) for a step that no filter accepts.
PreparedStep prepare(const FilterStep& step);

}  // namespace palpate::imaging
