#include "palpate/core/error.hpp"
#include "palpate/session/recipe.hpp"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <string>
#include <unistd.h>

namespace palpate::session {
namespace {

/// A file beside the target that is removed unless it was renamed over it.
class FileBeside {
 public:
  explicit FileBeside(const std::filesystem::path& target) : target_(target) {
    // Not mkstemp: a result has the rights that the user's mask gives, not private ones.
    for (int n = 0; descriptor_ < 0 && n < 100; ++n) {
      path_ = target.string() + ".part-" + std::to_string(getpid()) + "-" + std::to_string(n);
      descriptor_ = open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
      if (descriptor_ < 0 && errno != EEXIST) break;
    }
    if (descriptor_ < 0) fail();
  }
  ~FileBeside() {
    if (descriptor_ >= 0) close(descriptor_);
    if (!renamed_) unlink(path_.c_str());
  }
  FileBeside(const FileBeside&) = delete;
  FileBeside& operator=(const FileBeside&) = delete;

  void write(const std::string& text) {
    std::size_t done = 0;
    while (done < text.size()) {
      const ssize_t count = ::write(descriptor_, text.data() + done, text.size() - done);
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) discard();
      done += static_cast<std::size_t>(count);
    }
  }
  void rename_over_target() {
    const int closed = close(descriptor_);
    descriptor_ = -1;
    if (closed != 0 || rename(path_.c_str(), target_.c_str()) != 0) discard();
    renamed_ = true;
  }

 private:
  [[noreturn]] void fail() const {
    throw core::Error(core::ErrorKind::output, "cannot-write",
                      "Cannot write " + target_.string() + ": " + std::strerror(errno) +
                          ". Choose another place or free some room; nothing was left half-written.");
  }
  [[noreturn]] void discard() {
    const int reason = errno;
    if (descriptor_ >= 0) close(descriptor_);
    descriptor_ = -1;
    unlink(path_.c_str());
    errno = reason;
    fail();
  }

  std::filesystem::path target_;
  std::string path_;
  int descriptor_ = -1;
  bool renamed_ = false;
};

}  // namespace

void write_text_file(const std::filesystem::path& path, const std::string& text) {
  FileBeside file(path);
  file.write(text);
  file.rename_over_target();
}

}  // namespace palpate::session
