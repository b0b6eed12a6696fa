#include "palpate/compute/cache_folder.hpp"

#include "palpate/core/checksum.hpp"

#include <atomic>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string_view>
#include <system_error>
#include <unistd.h>

namespace palpate::compute {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view mark = "palpate-cache-1 ";
constexpr std::size_t digits_of_sum = 64;
constexpr std::size_t header_size = mark.size() + digits_of_sum + 1;

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? std::string() : std::string(value);
}

/// A name that no other writer has, on this machine at this time.
fs::path beside(const fs::path& file) {
  static std::atomic<unsigned> count{0};
  return file.parent_path() /
         ("." + file.filename().string() + "." + std::to_string(getpid()) + "-" + std::to_string(count++));
}

}  // namespace

std::optional<fs::path> cache_folder() {
  if (const auto named = environment("PALPATE_CACHE_DIR"); !named.empty()) return fs::path(named);
  // The desktop's rule: a relative path there is to be ignored.
  if (const fs::path folder = environment("XDG_CACHE_HOME"); folder.is_absolute()) return folder / "palpate";
  if (const fs::path home = environment("HOME"); home.is_absolute()) return home / ".cache" / "palpate";
  return std::nullopt;
}

bool write_cached(const fs::path& file, const std::string& bytes) noexcept {
  try {
    fs::create_directories(file.parent_path());
    const fs::path aside = beside(file);
    std::error_code failure;
    {
      std::ofstream stream(aside, std::ios::binary | std::ios::trunc);
      stream << mark << core::sha256_of(bytes) << '\n' << bytes;
      stream.close();
      if (!stream) failure = std::make_error_code(std::errc::io_error);
    }
    if (!failure) fs::rename(aside, file, failure);
    std::error_code ignored;
    if (failure) fs::remove(aside, ignored);
    return !failure;
  } catch (...) {
    return false;  // a cache that cannot be written is slower, not wrong
  }
}

bool write_cached_once(const fs::path& file, const std::string& bytes) noexcept {
  try {
    fs::create_directories(file.parent_path());
    const fs::path aside = beside(file);
    if (!write_cached(aside, bytes)) return false;
    std::error_code failure;
    fs::create_hard_link(aside, file, failure);
    if (failure && !read_cached(file)) {  // damaged: whoever is first to put another there wins
      std::error_code ignored;
      fs::remove(file, ignored);
      fs::create_hard_link(aside, file, ignored);
    }
    std::error_code ignored;
    fs::remove(aside, ignored);
    return read_cached(file).has_value();
  } catch (...) {
    return false;
  }
}

std::optional<std::string> read_cached(const fs::path& file) noexcept {
  try {
    std::ifstream stream(file, std::ios::binary);
    if (!stream) return std::nullopt;
    const std::string all{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    if (all.size() < header_size || all.compare(0, mark.size(), mark) != 0 || all[header_size - 1] != '\n')
      return std::nullopt;
    std::string bytes = all.substr(header_size);
    if (all.compare(mark.size(), digits_of_sum, core::sha256_of(bytes)) != 0) return std::nullopt;
    return bytes;
  } catch (...) {
    return std::nullopt;
  }
}

}  // namespace palpate::compute
