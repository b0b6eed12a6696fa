#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace palpate::compute {

/// Where a child finds the pipe that it reports to.
constexpr int report_fd = 3;

/// How a child ended and what it reported.
struct ChildEnd {
  bool started = false;
  bool timed_out = false;
  int signal = 0;     ///< that ended it; 0: it ended itself
  int exit_code = 0;  ///< where no signal did
  std::string report;
};

/// Runs a program until it ends or its time is over, when it is killed with
/// all that it started. Its own output is dropped; what it writes to report_fd
/// is kept. `environment` holds values that replace this process'.
ChildEnd run_child(const std::filesystem::path& program, const std::vector<std::string>& arguments,
                   const std::vector<std::pair<std::string, std::string>>& environment, double time_limit_s);

}  // namespace palpate::compute
