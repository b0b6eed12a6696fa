#include "drivers.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string_view>
#include <system_error>
#include <unistd.h>

// POSIX leaves its declaration to the program.
extern char** environ;  // NOLINT(readability-redundant-declaration)

namespace palpate::compute {

namespace fs = std::filesystem;

namespace {

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? std::string() : std::string(value);
}

bool is_icd(const fs::path& path) { return path.extension() == ".icd"; }

/// The first line, as the loader reads it.
DriverFile from_icd(const fs::path& path) {
  DriverFile file{path.string(), {}};
  std::ifstream stream(path);
  std::getline(stream, file.library);
  return file;
}

std::vector<DriverFile> in_folder(const fs::path& folder) {
  std::vector<DriverFile> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (is_icd(entry->path())) files.push_back(from_icd(entry->path()));
  std::sort(files.begin(), files.end(), [](const auto& a, const auto& b) { return a.label < b.label; });
  return files;
}

std::string stamp(const fs::path& path) {
  std::error_code error;
  const auto size = fs::file_size(path, error);
  if (error) return "missing";
  const auto time = fs::last_write_time(path, error);
  return std::to_string(size) + " " +
         (error ? std::string("?") : std::to_string(time.time_since_epoch().count()));
}

/// Where dlopen would most likely find it. What this misses (a library below a
/// folder of /etc/ld.so.conf) still shows in the linker's cache.
fs::path library_place(const std::string& library) {
  if (library.find('/') != std::string::npos) return library;
  std::istringstream named(variable("LD_LIBRARY_PATH"));
  std::vector<fs::path> folders;
  for (std::string folder; std::getline(named, folder, ':');) folders.emplace_back(folder);
  for (const char* folder :
       {"/lib/x86_64-linux-gnu", "/usr/lib/x86_64-linux-gnu", "/lib/aarch64-linux-gnu",
        "/usr/lib/aarch64-linux-gnu", "/lib64", "/usr/lib64", "/lib", "/usr/lib", "/usr/local/lib"})
    folders.emplace_back(folder);
  std::error_code ignored;
  for (const auto& folder : folders)
    if (fs::exists(folder / library, ignored)) return folder / library;
  return library;
}

/// Variables that begin with one of `prefixes`, sorted; what drivers only write to is left out.
template <std::size_t count>
std::string variables(const std::array<std::string_view, count>& prefixes) {
  static constexpr std::array<std::string_view, 5> irrelevant{
      "POCL_CACHE_DIR=", "POCL_KERNEL_CACHE=", "POCL_DEBUG=", "POCL_TRACING",
      "POCL_LEAVE_KERNEL_COMPILER_TEMP_FILES="};
  const auto starts = [](std::string_view entry) {
    return [entry](std::string_view prefix) { return entry.substr(0, prefix.size()) == prefix; };
  };
  std::vector<std::string> lines;
  for (char** entry = environ; entry != nullptr && *entry != nullptr; ++entry)
    if (std::any_of(prefixes.begin(), prefixes.end(), starts(*entry)) &&
        std::none_of(irrelevant.begin(), irrelevant.end(), starts(*entry)))
      lines.emplace_back(*entry);
  std::sort(lines.begin(), lines.end());
  std::string text;
  for (const auto& line : lines) text += line + "\n";
  return text;
}

}  // namespace

std::vector<DriverFile> driver_files() {
  const std::string wished = variable("OCL_ICD_VENDORS");
  const std::string instead = variable("OPENCL_VENDOR_PATH");
  const fs::path usual = instead.empty() ? fs::path("/etc/OpenCL/vendors") : fs::path(instead);
  std::vector<DriverFile> files;
  std::error_code error;
  if (wished.empty()) {
    files = in_folder(usual);
  } else if (fs::is_directory(wished, error)) {
    files = in_folder(wished);
  } else if (is_icd(wished)) {
    const bool plain = wished.find('/') == std::string::npos;
    files.push_back(from_icd(plain && fs::exists(usual / wished, error) ? usual / wished : fs::path(wished)));
  } else {
    files.push_back({wished, wished});
  }
  std::istringstream more(variable("OCL_ICD_FILENAMES"));
  for (std::string library; std::getline(more, library, ':');)
    if (!library.empty()) files.push_back({library, library});
  return files;
}

std::string driver_environment() {
  static constexpr std::array<std::string_view, 1> prefixes{"POCL_"};
  return variables(prefixes);
}

std::string driver_fingerprint(const std::vector<DriverFile>& files) {
  static constexpr std::array<std::string_view, 13> prefixes{
      "OCL_ICD_", "OPENCL_", "POCL_", "CUDA_", "ROCR_",   "HIP_",        "GPU_",
      "RUSTICL_", "ZE_",     "LD_",   "MESA_", "ONEAPI_", "LIBOCLGRIND_"};
  std::string text = "probe 1\n";
  for (const auto& file : files) {
    const fs::path place = library_place(file.library);
    text += file.label + " = " + file.library + " at " + place.string() + ": " + stamp(place) + "\n";
  }
  // Rewritten whenever a library is installed, a compiler that a driver uses included.
  text += "linker " + stamp("/etc/ld.so.cache") + "\n";
  return text + variables(prefixes);
}

}  // namespace palpate::compute
