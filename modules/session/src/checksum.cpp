#include "checksum.hpp"

#include "palpate/core/error.hpp"
#include "palpate/session/recipe.hpp"
#include "palpate/session/session_file.hpp"

#include <algorithm>
#include <fstream>
#include <system_error>
#include <vector>

namespace palpate::session {
namespace fs = std::filesystem;
using core::Error;
using core::ErrorKind;

namespace {

[[noreturn]] void throw_unreadable(const fs::path& path, const std::string& why) {
  throw Error(ErrorKind::input, "not-found",
              "The checksum of " + path.string() + " cannot be made: " + why +
                  ". Check the name and that you may read it.");
}

void add_file(Sha256& sum, const fs::path& path, const core::Progress& progress) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw_unreadable(path, "it cannot be opened");
  std::vector<char> block(1U << 18U);
  while (file) {
    progress.cancel().check();
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    sum.add(block.data(), static_cast<std::size_t>(file.gcount()));
  }
  if (file.bad()) throw_unreadable(path, "reading it failed");
}

/// A session that is saved beside its series does not change the series.
bool is_session(const fs::path& path) {
  const std::string name = path.filename().string();
  const std::string ending = session_ending;
  return name.size() > ending.size() && name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
}

/// Regular files below the folder but sessions, in an order that is the same everywhere.
std::vector<fs::path> sorted_files(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  const auto options = fs::directory_options::skip_permission_denied;
  for (fs::recursive_directory_iterator entry(folder, options, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_regular_file(ignored) && !is_session(entry->path())) files.push_back(entry->path());
  }
  if (error) throw_unreadable(folder, error.message());
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

std::string file_sha256(const fs::path& path, const core::Progress& progress) {
  std::error_code error;
  const auto status = fs::status(path, error);
  if (!fs::exists(status)) throw_unreadable(path, "there is no such file or folder");
  Sha256 sum;
  if (!fs::is_directory(status)) {
    add_file(sum, path, progress);
    return sum.hex();
  }
  const auto files = sorted_files(path);
  for (std::size_t n = 0; n < files.size(); ++n) {
    progress.report(static_cast<double>(n) / static_cast<double>(files.size()), "Checksum");
    // The name with its closing zero keeps a name and the bytes after it apart.
    const std::string name = files[n].lexically_relative(path).generic_string();
    sum.add(name.c_str(), name.size() + 1);
    sum.add(sha256_of_file(files[n], progress));
  }
  return sum.hex();
}

std::string sha256_of_file(const fs::path& path, const core::Progress& progress) {
  Sha256 sum;
  add_file(sum, path, progress);
  return sum.hex();
}

}  // namespace palpate::session
