#pragma once

#include "console.hpp"

#include "palpate/compute/device.hpp"
#include "palpate/core/progress.hpp"

#include <cstddef>
#include <string>
#include <vector>

namespace palpate::cli {

/// One row of `cases`: this program's engine and the published layout, run in
/// turn on the same tissue, device and step. Medians.
struct EngineFigure {
  std::string name;
  std::size_t points = 0;
  std::size_t links = 0;  ///< undirected
  std::string integrator;
  std::string layout;
  int runs = 0;                     ///< of each, that count
  int repeated_runs = 0;            ///< taken again, since the processors shared no cache meanwhile
  int disturbed_runs = 0;           ///< of those that count, where that never ended
  double core_round_trip_ns = 0.0;  ///< the longest in the runs that count; 0: unknown
  double ms_per_step = 0.0;
  double baseline_ms_per_step = 0.0;  ///< RK4, whatever the integrator here
  double speedup = 0.0;               ///< of a step where both are RK4, else of link evaluations a second
  double max_difference_mm = 0.0;
  std::string compared_with;            ///< what max_difference_mm is to
  double link_evaluations_per_s = 0.0;  ///< both directions of a link counted
  double baseline_link_evaluations_per_s = 0.0;
  double bytes_per_step = 0.0;  ///< 0: unknown
  double bandwidth_fraction = 0.0;
  double realtime_factor = 0.0;  ///< at the thesis' step of 0.006 s
  double build_s = 0.0;          ///< points, links, layout, upload, kernels
  double device_bytes_per_point = 0.0;
  double baseline_bytes_per_point = 0.0;
};

const std::vector<std::string>& engine_cases();
/// Throws Error(device), Error(cancelled).
EngineFigure measure_engine(const std::string& name, const compute::Device& device, double triad_gb_s,
                            bool quick, const core::Progress& progress);
Json to_json(const EngineFigure& figure);
std::string to_text(const EngineFigure& figure);

}  // namespace palpate::cli
