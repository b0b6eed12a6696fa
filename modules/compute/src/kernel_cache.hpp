#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace palpate::compute {

struct DeviceInfo;

/// Built kernels on disk. Everything about it may fail and only costs time.
class KernelCache {
 public:
  static constexpr std::uintmax_t usual_most_bytes = std::uintmax_t{128} << 20;

  explicit KernelCache(std::filesystem::path folder, std::uintmax_t most_bytes = usual_most_bytes)
      : folder_(std::move(folder)), most_bytes_(most_bytes) {}
  /// Below cache_folder(); none where there is no such folder, or where
  /// PALPATE_KERNEL_CACHE is "off".
  static std::optional<KernelCache> of_environment();
  /// All that a binary depends on: the source with its includes, the options,
  /// device, driver, platform, and the driver's variables.
  static std::string key(const std::string& source, const std::string& options, const DeviceInfo& device);

  /// The binary, whole, or none. One that was found counts as new.
  std::optional<std::string> find(const std::string& key) const noexcept;
  /// Then removes the oldest until all of them fit.
  void store(const std::string& key, const std::string& binary) const noexcept;
  void remove(const std::string& key) const noexcept;

 private:
  std::filesystem::path file(const std::string& key) const { return folder_ / (key + ".bin"); }
  void trim() const;

  std::filesystem::path folder_;
  std::uintmax_t most_bytes_;
};

}  // namespace palpate::compute
