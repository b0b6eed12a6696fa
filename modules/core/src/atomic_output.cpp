#include "palpate/core/atomic_output.hpp"

#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <system_error>
#include <unistd.h>

namespace palpate::core {
namespace {

namespace fs = std::filesystem;

std::string reason_of(int error_number) { return std::generic_category().message(error_number); }

/// Closes at the end of the scope; close() says whether the bytes arrived.
class OpenFile {
 public:
  OpenFile(const fs::path& path, int flags) : number_(::open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
  ~OpenFile() {
    if (number_ >= 0) ::close(number_);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  bool is_open() const noexcept { return number_ >= 0; }
  int number() const noexcept { return number_; }
  /// 0 or errno.
  int close() noexcept {
    const int closed = ::close(number_) == 0 ? 0 : errno;
    number_ = -1;
    return closed;
  }

 private:
  int number_;
};

/// 0 or errno. A disk may say only here that it is full; some file systems,
/// devices and pipes have nothing to sync, and that is no loss.
int sync(int file) {
  const int failed = ::fsync(file) == 0 ? 0 : errno;
  return failed == EINVAL || failed == ENOTSUP ? 0 : failed;
}

void sync_file(const fs::path& path, const fs::path& target) {
  const OpenFile file(path, O_RDONLY);
  const int failed = file.is_open() ? sync(file.number()) : errno;
  if (failed != 0) throw output_error(target, "write-failed", reason_of(failed));
}

/// 0 or errno.
int write_all(int file, const char* bytes, std::size_t count) {
  while (count > 0) {
    const ssize_t wrote = ::write(file, bytes, count);
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote <= 0) return wrote < 0 ? errno : EIO;
    bytes += wrote;
    count -= static_cast<std::size_t>(wrote);
  }
  return 0;
}

void write_bytes(const fs::path& path, int flags, const fs::path& target, const void* bytes,
                 std::size_t count) {
  OpenFile file(path, O_WRONLY | flags);
  int failed = file.is_open() ? 0 : errno;
  // A pipe was opened without waiting for its reader; its writes may wait.
  if (failed == 0 && (flags & O_NONBLOCK) != 0 && ::fcntl(file.number(), F_SETFL, 0) != 0) failed = errno;
  if (failed == 0) failed = write_all(file.number(), static_cast<const char*>(bytes), count);
  if (file.is_open()) {
    const int closed = file.close();
    if (failed == 0) failed = closed;
  }
  if (failed != 0) throw output_error(target, "write-failed", reason_of(failed));
}

}  // namespace

Error output_error(const fs::path& path, const std::string& code, const std::string& reason) {
  return {ErrorKind::output, code,
          "Cannot write " + path.string() + ": " + reason +
              ". Choose another place or free some room; nothing half-written is left."};
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

void write_file(const fs::path& path, const void* bytes, std::size_t count) {
  std::error_code ignored;
  const auto existing = fs::status(path, ignored);
  if (path.filename().empty() || fs::is_directory(existing))
    throw output_error(path, "is-a-folder", "it is a folder, not the name of a file");
  if (fs::exists(existing) && !fs::is_regular_file(existing)) {
    write_bytes(path, O_NONBLOCK, path, bytes, count);
    return;
  }
  const AtomicOutput output(path);
  write_bytes(output.staged(), O_CREAT | O_EXCL, path, bytes, count);
  output.commit(output.staged(), output.target());
}

void write_file(const fs::path& path, const std::string& bytes) {
  write_file(path, bytes.data(), bytes.size());
}

}  // namespace palpate::core
