#include "palpate/simulation/stability.hpp"

#include "cases.hpp"
#include "cube.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

// Figures 12 and 13. A cube of 10 x 10 x 10 points runs 2 s with RK4 while a
// static force pulls its highest layer; where a point gets faster than people
// would believe, the run is said to have exploded (thesis 4.3).
namespace palpate::evaluation {
namespace {

constexpr double run_s = 2.0;
/// Twenty times what the force gives a free point in 2 s.
constexpr double too_fast_mm_per_s = 4000.0;
const Eigen::Vector3d force_mm_per_s2(100.0, 0.0, 0.0);
constexpr double thesis_stiffness_per_s2 = 10000.0;
constexpr int thesis_links = 8;
/// Of a threshold stiffness: where the search for it ends.
constexpr double precision = 0.01;

/// A cube and its solver, run again and again from rest.
class TestRun {
 public:
  TestRun(const Setup& setup, int max_links, int side)
      : tissue_(cube(max_links, side)),
        solver_(make_solver(setup, tissue_, parameters_of(thesis_stiffness_per_s2))),
        pulled_(highest_layer(*tissue_)) {}

  bool explodes(double stiffness_per_s2, double step_s, const core::Progress& progress) {
    solver_->set_parameters(parameters_of(stiffness_per_s2));
    reset(*solver_, *tissue_);
    push(*solver_, pulled_, force_mm_per_s2, step_s);
    int left = static_cast<int>(std::lround(run_s / step_s));
    while (left > 0) {
      progress.cancel().check();
      const int now = std::min(left, 25);
      solver_->step(now, step_s);
      left -= now;
      const auto health = solver_->health();
      if (!health.finite || !(static_cast<double>(health.max_speed_mm_per_s) < too_fast_mm_per_s))
        return true;
    }
    return false;
  }

  double limit_s(double stiffness_per_s2, bool converged) const {
    const auto parameters = parameters_of(stiffness_per_s2);
    return (converged ? simulation::estimated_stable_step(*tissue_, parameters)
                      : simulation::stable_step(*tissue_, parameters))
        .step_s;
  }
  double links_per_point() const { return mean_links(*tissue_); }

 private:
  static std::shared_ptr<const model::Tissue> cube(int max_links, int side) {
    CubeModel model;
    model.side = side;
    model.max_links = max_links;
    return make_cube(model);
  }
  static simulation::Parameters parameters_of(double stiffness_per_s2) {
    simulation::Parameters parameters;
    parameters.stiffness_per_s2 = stiffness_per_s2;
    return parameters;
  }

  std::shared_ptr<const model::Tissue> tissue_;
  std::unique_ptr<simulation::Solver> solver_;
  std::vector<std::uint32_t> pulled_;
};

/// The stiffness where `is_too_much` turns true, from `start` up: doubled as
/// long as it is not, then halved in between.
double threshold(double start, const std::function<bool(double)>& is_too_much) {
  double good = start;
  double bad = start;
  for (int n = 0; n < 40 && !is_too_much(bad); ++n) {
    good = bad;
    bad *= 2.0;
  }
  while (bad > good * (1.0 + precision)) {
    const double middle = std::sqrt(good * bad);
    (is_too_much(middle) ? bad : good) = middle;
  }
  return std::sqrt(good * bad);
}

/// The median of a over b.
double median_ratio(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> ratios;
  for (std::size_t n = 0; n < a.size(); ++n)
    if (std::isfinite(a[n] / b[n])) ratios.push_back(a[n] / b[n]);
  return ratios.empty() ? std::numeric_limits<double>::quiet_NaN() : median(ratios);
}

/// The whole number from `low` to `high` where `is_too_much` turns true; none
/// where it never does.
double first_number(int low, int high, const std::function<bool(int)>& is_too_much) {
  int good = low - 1;
  int bad = low;
  while (!is_too_much(bad)) {
    good = bad;
    if (bad == high) return std::numeric_limits<double>::quiet_NaN();
    bad = std::min(high, 2 * bad);
  }
  while (bad > good + 1) {
    const int middle = (good + bad) / 2;
    (is_too_much(middle) ? bad : good) = middle;
  }
  return bad;
}

std::vector<double> steps_of(bool quick, const std::vector<double>& full, const std::vector<double>& few) {
  return quick ? few : full;
}

}  // namespace

Result stability_stiffness(const Setup& setup, const core::Progress& progress) {
  Result result;
  result.name = "stability-stiffness";
  const int side = setup.quick ? 6 : 10;
  TestRun run(setup, thesis_links, side);
  // From the largest down: the threshold only grows, and the search begins at the last one.
  const auto steps = steps_of(setup.quick,
                              {0.02, 0.0175, 0.015, 0.0125, 0.01, 0.008, 0.006, 0.005, 0.004, 0.003, 0.0025,
                               0.002, 0.0015, 0.00125, 0.001, 0.0008},
                              {0.02, 0.01, 0.005});
  Column measured{"measured", "s^-2", {}}, bound{"bound", "s^-2", {}}, converged{"converged", "s^-2", {}};
  double start = 100.0;
  for (std::size_t n = 0; n < steps.size(); ++n) {
    const auto part = progress.part(static_cast<double>(n) / static_cast<double>(steps.size()),
                                    static_cast<double>(n + 1) / static_cast<double>(steps.size()));
    part.report(0.0,
                "Looking for the stiffness that explodes at a step of " + std::to_string(steps[n]) + " s");
    const double h = steps[n];
    measured.values.push_back(threshold(start, [&](double k) { return run.explodes(k, h, part); }));
    bound.values.push_back(threshold(1.0, [&](double k) { return run.limit_s(k, false) < h; }));
    converged.values.push_back(threshold(1.0, [&](double k) { return run.limit_s(k, true) < h; }));
    start = measured.values.back();
  }
  const double slope = log_slope(steps, measured.values);
  result.findings = {
      {"slope", "slope of log threshold over log step; 1/h^2 gives -2", slope, ""},
      {"product", "threshold times step squared, median",
       [&] {
         std::vector<double> products;
         for (std::size_t n = 0; n < steps.size(); ++n)
           products.push_back(measured.values[n] * steps[n] * steps[n]);
         return median(products);
       }(),
       ""},
      {"at-smallest-step", "threshold at the smallest step", measured.values.back(), "s^-2"},
      {"predicted-by-converged", "step predicted by the converged estimate over the measured one, median",
       std::sqrt(median_ratio(converged.values, measured.values)), ""},
      {"predicted-by-bound", "step predicted by the per-point bound over the measured one, median",
       std::sqrt(median_ratio(bound.values, measured.values)), ""},
      {"links-per-point", "links per point, mean", run.links_per_point(), ""}};
  result.tables.push_back({result.name, {{"step", "s", steps}, measured, bound, converged}});
  const Axis step_axis{"Time step (s)", false, {{0.0, 0.021}}};
  const Axis log_step_axis{"Time step (s)", true, {}};
  const std::vector<Series> series{
      {"measured", steps, measured.values, true, true, false, 0},
      {"predicted, converged", steps, converged.values, true, false, true, 1},
      {"predicted, per-point bound", steps, bound.values, true, false, false, 2}};
  const Axis stiffness_axis{"Spring constant k (s⁻²)", false, {}};
  const Axis log_stiffness_axis{"Spring constant k (s⁻²)", true, {}};
  const std::string title = "Stiffness at which the run explodes";
  result.plots.push_back({result.name, title, log_step_axis, log_stiffness_axis, series});
  result.plots.push_back({result.name + "-linear", title, step_axis, stiffness_axis, series});
  return result;
}

Result stability_links(const Setup& setup, const core::Progress& progress) {
  Result result;
  result.name = "stability-links";
  const int side = setup.quick ? 6 : 10;
  const int most = setup.quick ? 40 : 64;
  const auto steps = steps_of(setup.quick,
                              {0.0036, 0.004, 0.0045, 0.005, 0.0055, 0.006, 0.0065, 0.007, 0.0075, 0.008,
                               0.0085, 0.009, 0.01, 0.011, 0.012},
                              {0.007, 0.0085, 0.01});
  std::map<int, TestRun> runs;
  const auto with = [&](int links) -> TestRun& {
    return runs.try_emplace(links, setup, links, side).first->second;
  };
  constexpr double k = thesis_stiffness_per_s2;
  constexpr int fewest = 3;
  Column measured{"measured", "", {}}, bound{"bound", "", {}}, converged{"converged", "", {}},
      mean{"mean links there", "", {}};
  for (std::size_t n = 0; n < steps.size(); ++n) {
    const auto part = progress.part(static_cast<double>(n) / static_cast<double>(steps.size()),
                                    static_cast<double>(n + 1) / static_cast<double>(steps.size()));
    part.report(0.0, "Looking for the links that explode at a step of " + std::to_string(steps[n]) + " s");
    const double h = steps[n];
    const auto first = [&](const std::function<bool(TestRun&)>& is_too_much) {
      return first_number(fewest, most, [&](int links) {
        part.cancel().check();
        return is_too_much(with(links));
      });
    };
    measured.values.push_back(first([&](TestRun& run) { return run.explodes(k, h, part); }));
    bound.values.push_back(first([&](TestRun& run) { return run.limit_s(k, false) < h; }));
    converged.values.push_back(first([&](TestRun& run) { return run.limit_s(k, true) < h; }));
    const double links = measured.values.back();
    mean.values.push_back(std::isnan(links) ? links : with(static_cast<int>(links)).links_per_point());
  }
  result.findings = {
      {"predicted-by-converged", "number predicted by the converged estimate over the measured one, median",
       median_ratio(converged.values, measured.values), ""},
      {"predicted-by-bound", "number predicted by the per-point bound over the measured one, median",
       median_ratio(bound.values, measured.values), ""}};
  result.tables.push_back({result.name, {{"step", "s", steps}, measured, mean, bound, converged}});
  result.plots.push_back({result.name,
                          "Links at which the run explodes, k = 10 000",
                          {"Time step (s)", false, {}},
                          {"Nearest points asked for, n", false, {}},
                          {{"measured", steps, measured.values, true, true, false, 0},
                           {"predicted, converged", steps, converged.values, true, false, true, 1},
                           {"predicted, per-point bound", steps, bound.values, true, false, false, 2}}});
  return result;
}

}  // namespace palpate::evaluation
