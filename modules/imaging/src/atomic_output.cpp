#include "atomic_output.hpp"

#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <system_error>
#include <unistd.h>

namespace palpate::imaging {
namespace {

namespace fs = std::filesystem;

std::string reason_of(int error_number) { return std::generic_category().message(error_number); }

/// A disk may say only here that it is full.
void sync_file(const fs::path& path, const fs::path& target) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) throw output_error(target, "write-failed", reason_of(errno));
  const int failed = ::fsync(file) == 0 ? 0 : errno;
  ::close(file);
  // Some file systems have nothing to sync; that is no loss.
  if (failed != 0 && failed != EINVAL && failed != ENOTSUP)
    throw output_error(target, "write-failed", reason_of(failed));
}

}  // namespace

core::Error output_error(const fs::path& path, const std::string& code, const std::string& reason) {
  return {core::ErrorKind::output, code, "Cannot write " + path.string() + ": " + reason + "."};
}

AtomicOutput::AtomicOutput(const fs::path& target) : target_(target) {
  std::error_code failed;
  if (fs::is_symlink(fs::symlink_status(target_, failed))) {
    target_ = fs::weakly_canonical(target_, failed);
    if (failed) throw output_error(target, "write-failed", failed.message());
  }
  const fs::path folder = target_.has_parent_path() ? target_.parent_path() : fs::path(".");
  const auto status = fs::status(folder, failed);
  if (!fs::exists(status))
    throw output_error(target, "no-such-folder", "the folder " + folder.string() + " does not exist");
  if (!fs::is_directory(status))
    throw output_error(target, "no-such-folder", folder.string() + " is not a folder");
  std::string pattern = (folder / ".palpate-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) {
    const int error_number = errno;
    throw output_error(
        target, "no-permission",
        "nothing can be made in the folder " + folder.string() + " (" + reason_of(error_number) + ")");
  }
  staging_ = pattern;
}

AtomicOutput::~AtomicOutput() {
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
}

void AtomicOutput::commit(const fs::path& staged_path, const fs::path& place) const {
  std::error_code failed;
  if (fs::is_directory(staged_path, failed)) {
    for (const auto& entry : fs::directory_iterator(staged_path, failed)) sync_file(entry.path(), target_);
  } else {
    sync_file(staged_path, target_);
  }
  if (failed) throw output_error(target_, "write-failed", failed.message());
  fs::rename(staged_path, place, failed);
  if (failed) throw output_error(target_, "write-failed", failed.message());
}

}  // namespace palpate::imaging
