#include "palpate/core/error.hpp"

#include <utility>

namespace palpate::core {

Error::Error(ErrorKind kind, std::string code, const std::string& text, std::string details)
    : std::runtime_error(text), kind_(kind), code_(std::move(code)), details_(std::move(details)) {}

void throw_usage(const std::string& text) { throw Error(ErrorKind::usage, "usage", text); }

void throw_cancelled() {
  throw Error(ErrorKind::cancelled, "cancelled", "Stopped before it was done; nothing was changed.");
}

}  // namespace palpate::core
