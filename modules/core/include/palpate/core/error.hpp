#pragma once

#include <stdexcept>
#include <string>

namespace palpate::core {

/// What went wrong, as the command line's exit code says it (docs/cli.md).
enum class ErrorKind {
  internal = 1,    ///< a defect of this program
  usage = 2,       ///< an option or a parameter outside what it accepts
  input = 3,       ///< a file that cannot be read or is not supported
  device = 4,      ///< no usable OpenCL device, or a kernel does not build
  diverged = 5,    ///< the simulation left the finite numbers and could not be brought back
  output = 6,      ///< a file that cannot be written
  cancelled = 130  ///< the user stopped it
};

/// The one error family. `what()` says what happened, where, and what to do,
/// in words for the user; `code()` is a stable slug such as "truncated" for
/// JSON and tests; `details()` may hold a log or numbers and can be empty.
class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, std::string code, const std::string& text, std::string details = {});

  ErrorKind kind() const noexcept { return kind_; }
  const std::string& code() const noexcept { return code_; }
  const std::string& details() const noexcept { return details_; }
  int exit_code() const noexcept { return static_cast<int>(kind_); }

 private:
  ErrorKind kind_;
  std::string code_;
  std::string details_;
};

[[noreturn]] void throw_usage(const std::string& text);
[[noreturn]] void throw_cancelled();

}  // namespace palpate::core
