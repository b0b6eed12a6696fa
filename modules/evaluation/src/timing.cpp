#include "cases.hpp"
#include "cube.hpp"

#include "palpate/core/error.hpp"
#include "palpate/simulation/published.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>

// Figures 7 and 8: what 1000 steps take, against points and against links, in
// this program's layouts and in the one that the thesis published.
namespace palpate::evaluation {
namespace {

using simulation::LayoutChoice;
constexpr double step_s = 0.001;
constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

enum class Way { lattice, explicit_links, published };
constexpr std::array<Way, 3> ways{Way::lattice, Way::explicit_links, Way::published};
std::string name_of(Way way) {
  return way == Way::lattice ? "lattice" : way == Way::explicit_links ? "explicit" : "published";
}

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// In a slow swing, so that nothing is zero or too small to count.
simulation::State swinging(const model::Tissue& tissue) {
  simulation::State state;
  state.positions_mm = tissue.points.positions_mm;
  for (const auto& x : state.positions_mm)
    state.velocities_mm_per_s.emplace_back(10.0F * std::sin(0.2F * x.y()), 8.0F * std::cos(0.15F * x.z()),
                                           5.0F * std::sin(0.1F * x.x()));
  return state;
}

/// Does so many steps and waits for them.
using Steps = std::function<void(int)>;

Steps prepare(Way way, const compute::Device& device, const std::shared_ptr<const model::Tissue>& tissue) {
  const simulation::Parameters parameters;
  if (way == Way::published) {
    auto published = std::make_shared<simulation::PublishedSimulation>(device, *tissue, parameters);
    published->set_state(swinging(*tissue));
    return [published, device](int count) {
      published->step(count, step_s);
      device.finish();
    };
  }
  simulation::OpenclOptions options;
  options.layout = way == Way::lattice ? LayoutChoice::lattice : LayoutChoice::explicit_links;
  std::shared_ptr<simulation::Solver> solver =
      simulation::make_opencl_solver(device, tissue, parameters, options);
  solver->set_state(swinging(*tissue));
  return [solver, device](int count) {
    solver->step(count, step_s);
    device.finish();
  };
}

/// Seconds for 1000 steps, a value a way: medians of runs in turn, so that
/// other work on the machine falls on all alike.
std::array<double, ways.size()> thousand_steps_s(const Setup& setup,
                                                 const std::shared_ptr<const model::Tissue>& tissue,
                                                 const core::CancelToken& cancel) {
  const double run_s = setup.quick ? 0.02 : 0.15;
  const int rounds = setup.quick ? 3 : 5;
  struct Racer {
    Steps steps;
    int count = 1;
    std::vector<double> times;
  };
  std::vector<Racer> racers;
  for (const Way way : ways) {
    Racer racer{prepare(way, *setup.device, tissue), 1, {}};
    racer.steps(2);
    const double once = seconds_of([&] { racer.steps(4); }) / 4.0;
    racer.count = std::clamp(static_cast<int>(run_s / once), 4, 1000);
    racers.push_back(std::move(racer));
  }
  for (int round = 0; round < rounds; ++round)
    for (auto& racer : racers) {
      cancel.check();
      racer.times.push_back(seconds_of([&] { racer.steps(racer.count); }) / racer.count * 1000.0);
    }
  std::array<double, ways.size()> medians{};
  for (std::size_t n = 0; n < racers.size(); ++n) medians[n] = median(racers[n].times);
  return medians;
}

std::shared_ptr<const model::Tissue> cube_with(int side, int links) {
  CubeModel model;
  model.side = side;
  model.max_links = links;
  return make_cube(model);
}

}  // namespace

Result time_by_points(const Setup& setup, const core::Progress& progress) {
  Result result;
  result.name = "time-by-points";
  const std::vector<int> sides =
      setup.quick ? std::vector<int>{8, 12} : std::vector<int>{10, 16, 22, 28, 34, 40, 46};
  const std::vector<int> links = setup.quick ? std::vector<int>{6, 12} : std::vector<int>{6, 12, 18, 24};
  Table table{result.name, {{"points", "", {}}}};
  for (const Way way : ways)
    for (const int n : links) table.columns.push_back({name_of(way) + " n=" + std::to_string(n), "s", {}});
  std::size_t done = 0;
  for (const int side : sides) {
    table.columns[0].values.push_back(std::pow(side, 3.0));
    for (std::size_t n = 0; n < links.size(); ++n) {
      progress.report(static_cast<double>(done++) / static_cast<double>(sides.size() * links.size()),
                      "Timing " + std::to_string(side * side * side) + " points");
      const auto times = thousand_steps_s(setup, cube_with(side, links[n]), progress.cancel());
      for (std::size_t way = 0; way < ways.size(); ++way)
        table.columns[1 + way * links.size() + n].values.push_back(times[way]);
    }
  }
  const auto& points = table.columns[0].values;
  for (std::size_t way = 0; way < ways.size(); ++way) {
    const std::string name = name_of(ways[way]);
    Plot plot{way == 0 ? result.name : result.name + "-" + name,
              "1000 steps of RK4, " + name + " layout",
              {"Points", false, {}},
              {"Time (s)", false, {}},
              {}};
    for (std::size_t n = 0; n < links.size(); ++n)
      plot.series.push_back({"n = " + std::to_string(links[n]),
                             points,
                             table.columns[1 + way * links.size() + n].values,
                             true,
                             true,
                             false,
                             {}});
    result.plots.push_back(std::move(plot));
  }
  Plot all{result.name + "-layouts",
           "1000 steps of RK4, 12 nearest",
           {"Points", true, {}},
           {"Time (s)", true, {}},
           {}};
  for (std::size_t way = 0; way < ways.size(); ++way) {
    const std::string name = name_of(ways[way]);
    const auto& times = table.column(name + " n=12").values;
    all.series.push_back({name, points, times, true, true, false, {}});
    result.findings.push_back(
        {"growth-" + name, "slope of log time over log points, larger half, n = 12, " + name,
         log_slope({points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2) - 1, points.end()},
                   {times.begin() + static_cast<std::ptrdiff_t>(points.size() / 2) - 1, times.end()}),
         ""});
    result.findings.push_back(
        {"largest-" + name, "1000 steps of the largest cube, n = 12, " + name, times.back(), "s"});
  }
  result.findings.push_back({"largest-points", "points of the largest cube", points.back(), ""});
  result.plots.push_back(std::move(all));
  result.tables.push_back(std::move(table));
  return result;
}

Result time_by_links(const Setup& setup, const core::Progress& progress) {
  Result result;
  result.name = "time-by-links";
  const int side = setup.quick ? 10 : 30;
  std::vector<int> links;
  for (int n = setup.quick ? 6 : 2; n <= (setup.quick ? 12 : 32); n += setup.quick ? 6 : 2)
    links.push_back(n);
  Table table{result.name, {{"links asked for", "", {}}, {"links a point", "", {}}}};
  for (const Way way : ways) table.columns.push_back({name_of(way), "s", {}});
  for (std::size_t n = 0; n < links.size(); ++n) {
    progress.report(static_cast<double>(n) / static_cast<double>(links.size()),
                    "Timing " + std::to_string(links[n]) + " links");
    const auto tissue = cube_with(side, links[n]);
    const auto times = thousand_steps_s(setup, tissue, progress.cancel());
    table.columns[0].values.push_back(links[n]);
    table.columns[1].values.push_back(mean_links(*tissue));
    for (std::size_t way = 0; way < ways.size(); ++way) table.columns[2 + way].values.push_back(times[way]);
  }
  Plot plot{result.name,
            "1000 steps of RK4, " + std::to_string(side * side * side) + " points",
            {"Nearest points asked for, n", false, {}},
            {"Time (s)", true, {}},
            {}};
  for (std::size_t way = 0; way < ways.size(); ++way) {
    const std::string name = name_of(ways[way]);
    const auto& times = table.columns[2 + way].values;
    plot.series.push_back({name, table.columns[0].values, times, true, true, false, {}});
    result.findings.push_back({"growth-" + name, "time at most links over time at fewest, " + name,
                               times.back() / times.front(), ""});
  }
  result.findings.push_back({"links-ratio", "links a point at most over at fewest",
                             table.columns[1].values.back() / table.columns[1].values.front(), ""});
  result.plots.push_back(std::move(plot));
  result.tables.push_back(std::move(table));
  return result;
}

}  // namespace palpate::evaluation
