#include "palpate/compute/tuning_store.hpp"

#include "drivers.hpp"

#include "palpate/compute/cache_folder.hpp"
#include "palpate/core/checksum.hpp"

#include <cstdlib>
#include <cstring>
#include <system_error>

namespace palpate::compute {

namespace fs = std::filesystem;

namespace {

/// All that a choice depends on, for people to read in the file, too.
std::string subject(const DeviceInfo& device, const std::string& key) {
  return "tuning 1\n" + device.name + "\n" + device.platform + "\n" + device.driver + "\n" +
         driver_environment() + key + "\n= ";
}

fs::path file_of(const fs::path& folder, const std::string& subject) {
  return folder / (core::sha256_of(subject).substr(0, 32) + ".txt");
}

std::optional<std::string> value_in(const fs::path& file, const std::string& subject) {
  const auto text = read_cached(file);
  if (!text || text->compare(0, subject.size(), subject) != 0) return std::nullopt;
  return text->substr(subject.size());
}

}  // namespace

std::optional<TuningStore> TuningStore::of_environment() {
  const char* wish = std::getenv("PALPATE_TUNING");
  if (wish != nullptr && std::strcmp(wish, "off") == 0) return std::nullopt;
  const auto folder = cache_folder();
  if (!folder) return std::nullopt;
  return TuningStore(*folder / "tuning");
}

std::optional<std::string> TuningStore::find(const DeviceInfo& device,
                                             const std::string& key) const noexcept {
  try {
    const std::string what = subject(device, key);
    return value_in(file_of(folder_, what), what);
  } catch (...) {
    return std::nullopt;
  }
}

std::optional<std::string> TuningStore::settle(const DeviceInfo& device, const std::string& key,
                                               const std::string& value) const noexcept {
  try {
    const std::string what = subject(device, key);
    const fs::path file = file_of(folder_, what);
    if (auto known = value_in(file, what)) return known;
    write_cached_once(file, what + value);
    return value_in(file, what);
  } catch (...) {
    return std::nullopt;
  }
}

}  // namespace palpate::compute
