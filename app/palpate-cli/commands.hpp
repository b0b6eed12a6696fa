#pragma once

#include "palpate/core/progress.hpp"

#include <string>
#include <vector>

namespace palpate::cli {

class Console;
class OptionSet;

/// What every subcommand accepts.
struct CommonOptions {
  bool json = false;
  bool progress = false;
  std::string device;
};
void add_common(OptionSet& options, CommonOptions& common);

/// What a subcommand is called with. Each returns the exit code or throws Error.
struct Call {
  const std::vector<std::string>& arguments;
  Console& console;
  bool help = false;  ///< print the help and return
};
/// Prints the help where it is asked for, and true; else parses and false.
bool parse_or_help(const OptionSet& options, const Call& call);

int run_devices(const Call& call);
int run_info(const Call& call);
int run_filter(const Call& call);
int run_phantom(const Call& call);
int run_model(const Call& call);
int run_simulate(const Call& call);
int run_render(const Call& call);
int run_bench(const Call& call);
int run_experiment(const Call& call);

}  // namespace palpate::cli
