#pragma once

#include <string>

namespace palpate::imaging::reading {

/// Takes away for good what this process and its threads need no more once
/// they are to parse a file of which nothing is known: network, starting
/// programs, other processes, and every way to write but to descriptors 0 to 5,
/// which its parent chose. Opening files for reading, memory and threads stay.
/// What is forbidden fails with EPERM. Where the kernel has no seccomp it
/// stays as it is.
void enter_sandbox();

/// "seccomp" or "none", as the kernel says of this process.
std::string sandbox_state();

}  // namespace palpate::imaging::reading
