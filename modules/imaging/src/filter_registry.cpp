#include "filter_registry.hpp"

namespace palpate::imaging {

const std::vector<FilterEntry>& filter_entries() {
  static const std::vector<FilterEntry> all{
      median_entry(),
      gaussian_entry(),
  };
  return all;
}

const std::vector<FilterDescription>& filters() {
  static const std::vector<FilterDescription> all = [] {
    std::vector<FilterDescription> descriptions;
    for (const auto& entry : filter_entries()) descriptions.push_back(entry.description);
    return descriptions;
  }();
  return all;
}

}  // namespace palpate::imaging
