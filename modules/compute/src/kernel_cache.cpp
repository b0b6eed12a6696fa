#include "kernel_cache.hpp"

#include "drivers.hpp"

#include "palpate/compute/cache_folder.hpp"
#include "palpate/compute/device.hpp"
#include "palpate/core/checksum.hpp"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <vector>

namespace palpate::compute {

namespace fs = std::filesystem;

std::optional<KernelCache> KernelCache::of_environment() {
  const char* wish = std::getenv("PALPATE_KERNEL_CACHE");
  if (wish != nullptr && std::strcmp(wish, "off") == 0) return std::nullopt;
  const auto folder = cache_folder();
  if (!folder) return std::nullopt;
  return KernelCache(*folder / "kernels");
}

std::string KernelCache::key(const std::string& source, const std::string& options,
                             const DeviceInfo& device) {
  core::Sha256 sum;
  // Each with its length, so that no two lists of parts run together alike.
  for (const std::string& part : {std::string("kernels 1"), source, options, device.name, device.platform,
                                  device.driver, driver_environment()})
    sum.add(std::to_string(part.size()) + ":" + part);
  return sum.hex();
}

std::optional<std::string> KernelCache::find(const std::string& key) const noexcept {
  try {
    auto binary = read_cached(file(key));
    std::error_code ignored;
    if (binary) fs::last_write_time(file(key), fs::file_time_type::clock::now(), ignored);
    return binary;
  } catch (...) {
    return std::nullopt;
  }
}

void KernelCache::store(const std::string& key, const std::string& binary) const noexcept {
  try {
    if (binary.size() <= most_bytes_ && write_cached(file(key), binary)) trim();
  } catch (...) {
    return;  // slower next time, not wrong
  }
}

void KernelCache::remove(const std::string& key) const noexcept {
  try {
    std::error_code ignored;
    fs::remove(file(key), ignored);
  } catch (...) {
    return;
  }
}

void KernelCache::trim() const {
  struct Entry {
    fs::path path;
    fs::file_time_type time;
    std::uintmax_t bytes;
  };
  std::vector<Entry> entries;
  std::uintmax_t total = 0;
  std::error_code error;
  const auto now = fs::file_time_type::clock::now();
  for (fs::directory_iterator entry(folder_, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code gone;  // another process trims, too
    const auto bytes = entry->file_size(gone);
    const auto time = gone ? now : entry->last_write_time(gone);
    if (gone) continue;
    // What a writer that was ended left aside.
    if (entry->path().extension() != ".bin") {
      if (now - time > std::chrono::hours(1)) fs::remove(entry->path(), gone);
      continue;
    }
    entries.push_back({entry->path(), time, bytes});
    total += bytes;
  }
  std::sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) { return a.time < b.time; });
  for (const auto& entry : entries) {
    if (total <= most_bytes_) return;
    std::error_code ignored;
    fs::remove(entry.path, ignored);
    total -= entry.bytes;
  }
}

}  // namespace palpate::compute
