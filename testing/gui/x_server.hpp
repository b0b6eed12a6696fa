#pragma once

#include <sys/types.h>

namespace palpate::testing {

/// A virtual X server on a display number of its own, ended with the test. So
/// tests may run side by side, and none meets a screen that somebody uses.
class XServer {
 public:
  XServer();
  ~XServer();
  XServer(const XServer&) = delete;
  XServer& operator=(const XServer&) = delete;
  bool running() const { return running_; }

 private:
  pid_t child_ = -1;
  bool running_ = false;
};

}  // namespace palpate::testing
