#include "sandbox.hpp"

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <fcntl.h>
#include <fstream>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <vector>

namespace palpate::imaging::reading {
namespace {

#if defined(__x86_64__)
constexpr std::uint32_t native = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t native = AUDIT_ARCH_AARCH64;
#else
constexpr std::uint32_t native = 0;
#endif

constexpr std::uint32_t allow = SECCOMP_RET_ALLOW;
constexpr std::uint32_t refuse = SECCOMP_RET_ERRNO | EPERM;
/// For calls that the C library does in an older way where the kernel lacks them.
constexpr std::uint32_t unknown = SECCOMP_RET_ERRNO | ENOSYS;

/// A program of the kernel's packet filter, written call by call. Between two
/// calls the accumulator holds the call's number.
class Filter {
 public:
  Filter() {
    load(offsetof(seccomp_data, arch));
    jump(BPF_JEQ, native, 1, 0);
    end(refuse);
    load(offsetof(seccomp_data, nr));
#if defined(__x86_64__)
    constexpr std::uint32_t x32 = 0x40000000;  // the same calls under other numbers
    jump(BPF_JGE, x32, 0, 1);
    end(refuse);
#endif
  }
  void always(long call, std::uint32_t verdict = allow) {
    jump(BPF_JEQ, static_cast<std::uint32_t>(call), 0, 1);
    end(verdict);
  }
  /// Allowed where argument n is one of these.
  void where_equal(long call, int n, const std::vector<std::uint32_t>& values) {
    // Past: the load, two steps a value, the end.
    jump(BPF_JEQ, static_cast<std::uint32_t>(call), 0, static_cast<std::uint8_t>(2 * values.size() + 2));
    load_argument(n);
    for (const auto value : values) {
      jump(BPF_JEQ, value, 0, 1);
      end(allow);
    }
    end(refuse);
  }
  /// Allowed where argument n has none of these bits, or all of them.
  void where_bits(long call, int n, std::uint32_t bits, bool all) {
    jump(BPF_JEQ, static_cast<std::uint32_t>(call), 0, 4);
    load_argument(n);
    jump(BPF_JSET, bits, all ? 0 : 1, all ? 1 : 0);
    end(allow);
    end(refuse);
  }
  void where_at_most(long call, int n, std::uint32_t most) {
    jump(BPF_JEQ, static_cast<std::uint32_t>(call), 0, 4);
    load_argument(n);
    jump(BPF_JGT, most, 1, 0);
    end(allow);
    end(refuse);
  }
  /// Allowed where argument n, a pointer, is null.
  void where_null(long call, int n) {
    jump(BPF_JEQ, static_cast<std::uint32_t>(call), 0, 6);
    load_argument(n);
    jump(BPF_JEQ, 0, 0, 3);
    load(static_cast<std::uint32_t>(argument(n) + sizeof(std::uint32_t)));
    jump(BPF_JEQ, 0, 0, 1);
    end(allow);
    end(refuse);
  }
  const std::vector<sock_filter>& finish() {
    end(refuse);
    return steps_;
  }

 private:
  static std::size_t argument(int n) {
    return offsetof(seccomp_data, args) + sizeof(std::uint64_t) * static_cast<std::size_t>(n);
  }
  void load(std::uint32_t from) { steps_.push_back({BPF_LD | BPF_W | BPF_ABS, 0, 0, from}); }
  /// The lower half: both machines are little-endian, and what is checked are ints.
  void load_argument(int n) { load(static_cast<std::uint32_t>(argument(n))); }
  void jump(std::uint16_t how, std::uint32_t value, std::uint8_t if_so, std::uint8_t if_not) {
    steps_.push_back({static_cast<std::uint16_t>(BPF_JMP | how | BPF_K), if_so, if_not, value});
  }
  void end(std::uint32_t verdict) { steps_.push_back({BPF_RET | BPF_K, 0, 0, verdict}); }

  std::vector<sock_filter> steps_;
};

/// Calls that harm nobody else, the frequent ones first.
void allow_harmless(Filter& filter) {
  static constexpr std::array harmless {
    SYS_read, SYS_lseek, SYS_futex, SYS_mmap, SYS_munmap, SYS_brk, SYS_mprotect, SYS_madvise, SYS_mremap,
        SYS_close, SYS_fstat, SYS_newfstatat, SYS_pread64, SYS_readv, SYS_preadv, SYS_getdents64, SYS_statx,
        SYS_faccessat, SYS_faccessat2, SYS_readlinkat, SYS_getcwd, SYS_fadvise64, SYS_statfs, SYS_fstatfs,
        SYS_dup, SYS_exit, SYS_exit_group, SYS_sched_yield, SYS_sched_getaffinity, SYS_set_robust_list,
        SYS_get_robust_list, SYS_rseq, SYS_set_tid_address, SYS_gettid, SYS_getpid, SYS_getppid, SYS_getuid,
        SYS_geteuid, SYS_getgid, SYS_getegid, SYS_getrandom, SYS_uname, SYS_sysinfo, SYS_getcpu,
        SYS_getrusage, SYS_times, SYS_clock_gettime, SYS_clock_getres, SYS_gettimeofday, SYS_nanosleep,
        SYS_clock_nanosleep, SYS_ppoll, SYS_pselect6, SYS_membarrier, SYS_mincore, SYS_msync,
        SYS_rt_sigaction, SYS_rt_sigprocmask, SYS_rt_sigreturn, SYS_rt_sigpending, SYS_rt_sigtimedwait,
        SYS_sigaltstack, SYS_restart_syscall,
#if defined(__x86_64__)
        SYS_stat, SYS_lstat, SYS_access, SYS_readlink, SYS_getdents, SYS_poll, SYS_select, SYS_time,
        SYS_arch_prctl, SYS_getrlimit,
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
        // The sanitizers probe memory through a pipe of their own.
        SYS_pipe2,
#endif
  };
  for (const long call : harmless) filter.always(call);
}

void allow_with_conditions(Filter& filter) {
  constexpr std::uint32_t writing = O_WRONLY | O_RDWR | O_CREAT | O_TRUNC | O_APPEND;
  filter.where_bits(SYS_openat, 2, writing, false);
#if defined(__x86_64__)
  filter.where_bits(SYS_open, 1, writing, false);
#endif
  // What opening gives is for reading, so only descriptors of the parent's choice could be written to.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  constexpr std::uint32_t last_given = 1U << 20U;  // the sanitizers' own pipe has any number
#else
  constexpr std::uint32_t last_given = 5;
#endif
  for (const long call : {SYS_write, SYS_writev, SYS_pwrite64, SYS_ftruncate, SYS_fallocate})
    filter.where_at_most(call, 0, last_given);
  filter.where_equal(SYS_fcntl, 1, {F_GETFD, F_SETFD, F_GETFL, F_DUPFD, F_DUPFD_CLOEXEC});
  filter.where_equal(SYS_ioctl, 1, {TCGETS});  // whether it is a terminal
  filter.where_equal(SYS_prctl, 0, {PR_SET_NAME, PR_GET_NAME, PR_GET_DUMPABLE, PR_GET_SECCOMP});
  filter.where_null(SYS_prlimit64, 2);  // asking only
  // Signals to itself, as abort() does.
  filter.where_equal(SYS_tgkill, 0, {static_cast<std::uint32_t>(getpid())});
  // Threads, not processes. clone3 keeps its flags where a filter cannot look.
  filter.where_bits(SYS_clone, 0, CLONE_THREAD, true);
  filter.always(SYS_clone3, unknown);
  filter.always(SYS_openat2, unknown);
}

}  // namespace

void enter_sandbox() {
  if (native == 0 || prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return;
  Filter filter;
  allow_harmless(filter);
  allow_with_conditions(filter);
  std::vector<sock_filter> steps = filter.finish();
  const sock_fprog program{static_cast<unsigned short>(steps.size()), steps.data()};
  // Of all threads, should a library have started one. Where the kernel says no, sandbox_state() tells.
  syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, &program);
}

std::string sandbox_state() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (word == "Seccomp:" && status >> word) return word == "2" ? "seccomp" : "none";
  return "none";
}

}  // namespace palpate::imaging::reading
