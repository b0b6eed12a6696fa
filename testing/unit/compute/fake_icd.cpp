// An OpenCL driver that does what a broken one does, as FAKE_ICD says:
// "abort at load", "abort", "hang", "crash" or "exit" when its platforms are
// asked for, or "none": it has no platforms.
#include <csignal>
#include <cstdlib>
#include <string>
#include <unistd.h>

namespace {

const std::string wish = FAKE_ICD;

struct AtLoad {
  AtLoad() {
    if (wish == "abort at load") std::abort();
  }
} const at_load;

int asked() {
  if (wish == "abort") std::abort();
  if (wish == "crash") raise(SIGSEGV);
  if (wish == "exit") _exit(7);
  while (wish == "hang") pause();
  return -1001;  // CL_PLATFORM_NOT_FOUND_KHR
}

}  // namespace

extern "C" {
int clIcdGetPlatformIDsKHR(unsigned, void**, unsigned*) { return asked(); }
int clGetPlatformIDs(unsigned, void**, unsigned*) { return asked(); }
int clGetPlatformInfo(void*, unsigned, std::size_t, void*, std::size_t*) { return asked(); }
void* clGetExtensionFunctionAddress(const char* name) {
  return std::string(name) == "clIcdGetPlatformIDsKHR" ? reinterpret_cast<void*>(&clIcdGetPlatformIDsKHR)
                                                       : nullptr;
}
}
