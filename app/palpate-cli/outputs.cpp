#include "outputs.hpp"

#include "values.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cctype>
#include <system_error>
#include <unistd.h>

namespace palpate::cli {
namespace fs = std::filesystem;
namespace {

bool ends_with_any(const fs::path& path, const std::vector<std::string>& endings) {
  std::string name = path.filename().string();
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
  return std::any_of(endings.begin(), endings.end(), [&](const std::string& ending) {
    return name.size() > ending.size() &&
           name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
  });
}

[[noreturn]] void cannot_write(const fs::path& path, const std::string& why) {
  throw core::Error(core::ErrorKind::output, "cannot-write",
                    "Cannot write " + path.string() + ": " + why + ". Choose another place.");
}

}  // namespace

void check_output(const std::string& option, const fs::path& path, const std::vector<std::string>& endings,
                  const std::vector<std::string>& later) {
  const std::string accepted = join(endings, ", ");
  if (ends_with_any(path, later))
    core::throw_usage(option + ": this version does not write " + path.extension().string() +
                      " yet; it writes " + accepted + ".");
  if (!ends_with_any(path, endings))
    core::throw_usage(option + ": the name must end with one of " + accepted + ", not \"" +
                      path.filename().string() + "\".");
  std::error_code ignored;
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  if (!fs::exists(folder, ignored)) cannot_write(path, "there is no folder " + folder.string());
  if (!fs::is_directory(folder, ignored)) cannot_write(path, folder.string() + " is not a folder");
  if (access(folder.c_str(), W_OK | X_OK) != 0) cannot_write(path, "the folder may not be written to");
  if (fs::is_directory(path, ignored)) cannot_write(path, "a folder of that name is there");
}

void check_apart(const std::vector<std::pair<std::string, fs::path>>& outputs) {
  std::vector<std::pair<std::string, fs::path>> seen;
  for (const auto& [option, path] : outputs) {
    if (path.empty()) continue;
    std::error_code ignored;
    const fs::path place = fs::weakly_canonical(path, ignored);
    for (const auto& [other, its_place] : seen)
      if (place == its_place)
        core::throw_usage(option + ": " + path.string() + " is what " + other +
                          " writes already. Give each its own name.");
    seen.emplace_back(option, place);
  }
}

}  // namespace palpate::cli
