#pragma once

#include "palpate/compute/device.hpp"

#include <filesystem>
#include <optional>
#include <string>

namespace palpate::compute {

/// What was measured once on a device, and holds from then on: the same choice
/// in every run gives the same numbers in every run. A file a choice.
class TuningStore {
 public:
  explicit TuningStore(std::filesystem::path folder) : folder_(std::move(folder)) {}
  /// Below cache_folder(); none where there is no such folder, or where
  /// PALPATE_TUNING is "off".
  static std::optional<TuningStore> of_environment();

  /// None where nothing is known for this device, its driver and the key, or
  /// the file is damaged. `key` names what was chosen, and among what.
  std::optional<std::string> find(const DeviceInfo& device, const std::string& key) const noexcept;
  /// Remembers the first of all values that are given for a key, from whatever
  /// process, and returns that one. None where nothing can be written: the
  /// value would be another in the next run.
  std::optional<std::string> settle(const DeviceInfo& device, const std::string& key,
                                    const std::string& value) const noexcept;

 private:
  std::filesystem::path folder_;
};

}  // namespace palpate::compute
