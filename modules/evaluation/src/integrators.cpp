#include "cases.hpp"
#include "cube.hpp"

#include <array>
#include <cmath>
#include <limits>

// Figures 1 to 3: x'' + 3 x' + 45 x = 0, x(0) = 5, x'(0) = 0, by the reference
// solver in double: two points on a line, the first an anchor, the link at
// rest where the second is at x = 0.
namespace palpate::evaluation {
namespace {

using simulation::Integrator;

constexpr double damping = 3.0;
constexpr double stiffness = 45.0;
constexpr double start_mm = 5.0;
constexpr double shown_s = 4.0;
constexpr std::array<double, 4> thesis_steps_s{0.001, 0.01, 0.1, 0.4};
/// The solver hands its state on in single precision. Here x passes zero for
/// the first time, where its rounding is far below the errors that the orders
/// are made of.
constexpr double order_time_s = 0.2747;
constexpr double rounding_mm = 1e-9;

double exact_mm(double t) {
  const double decay = damping / 2.0;
  const double omega = std::sqrt(stiffness - decay * decay);
  return start_mm * std::exp(-decay * t) * (std::cos(omega * t) + decay / omega * std::sin(omega * t));
}

std::unique_ptr<simulation::Solver> oscillator(Integrator integrator) {
  constexpr float rest_mm = 16.0F;
  auto tissue = std::make_shared<model::Tissue>();
  tissue->points.positions_mm = {{-rest_mm, 0.0F, 0.0F}, {static_cast<float>(start_mm), 0.0F, 0.0F}};
  tissue->points.voxels = {{0, 0, 0}, {1, 0, 0}};
  tissue->points.intensities = {1.0F, 1.0F};
  tissue->links.pairs = {{0, 1}};
  tissue->links.rest_lengths_mm = {rest_mm};
  tissue->on_lattice = false;
  simulation::Parameters parameters;
  parameters.stiffness_per_s2 = stiffness;
  parameters.damping_per_s = damping;
  parameters.drag_per_s = 0.0;
  parameters.integrator = integrator;
  simulation::Material material;
  material.anchors = {0};
  return simulation::make_reference_solver(tissue, parameters, material);
}

double place_mm(const simulation::Solver& solver) {
  return static_cast<double>(solver.state().positions_mm[1].x());
}

struct Method {
  Integrator integrator;
  std::string name;   ///< of its columns
  std::string title;  ///< in legends
};

struct Course {
  std::vector<double> t, x;
};

Course course(Integrator integrator, double step_s) {
  const auto solver = oscillator(integrator);
  Course course{{0.0}, {start_mm}};
  const auto steps = static_cast<int>(std::lround(shown_s / step_s));
  for (int n = 1; n <= steps; ++n) {
    solver->step(1, step_s);
    course.t.push_back(n * step_s);
    course.x.push_back(place_mm(*solver));
  }
  return course;
}

double error_mm(Integrator integrator, int steps) {
  const auto solver = oscillator(integrator);
  solver->step(steps, order_time_s / steps);
  return std::abs(place_mm(*solver) - exact_mm(order_time_s));
}

std::string step_text(double step_s) {
  const std::string text = std::to_string(step_s);
  return text.substr(0, text.find_last_not_of('0') + 1);
}

void add_courses(Result& result, const std::vector<Method>& methods, const std::string& title) {
  Table table{result.name, {{"step", "s", {}}, {"time", "s", {}}, {"exact", "mm", {}}}};
  for (const auto& method : methods) table.columns.push_back({method.name, "mm", {}});
  Plot plot{result.name, title, {"Time (s)", false, {{0.0, shown_s}}}, {"x (mm)", false, {{-6.0, 8.0}}}, {}};
  for (const double step_s : thesis_steps_s) {
    std::vector<Course> courses;
    for (const auto& method : methods) courses.push_back(course(method.integrator, step_s));
    for (std::size_t n = 0; n < courses.front().t.size(); ++n) {
      const double t = courses.front().t[n];
      table.columns[0].values.push_back(step_s);
      table.columns[1].values.push_back(t);
      table.columns[2].values.push_back(exact_mm(t));
      for (std::size_t m = 0; m < methods.size(); ++m) table.columns[3 + m].values.push_back(courses[m].x[n]);
    }
    const bool coarse = step_s >= 0.1;
    plot.series.push_back({"h = " + step_text(step_s) + " s",
                           courses.front().t,
                           courses.front().x,
                           true,
                           coarse,
                           step_s == 0.001,
                           {}});
  }
  Series exact{"exact", {}, {}, true, false, false, 0};
  for (int n = 0; n <= 800; ++n) {
    exact.x.push_back(n * shown_s / 800.0);
    exact.y.push_back(exact_mm(exact.x.back()));
  }
  for (std::size_t n = 0; n < plot.series.size(); ++n) plot.series[n].color = static_cast<int>(n) + 1;
  plot.series.insert(plot.series.begin(), exact);
  result.tables.push_back(std::move(table));
  result.plots.push_back(std::move(plot));
}

/// The order is what halving the step from 0.0098 s makes of the error.
void add_orders(Result& result, const std::vector<Method>& methods, const core::Progress& progress) {
  Table table{result.name + "-error", {{"step", "s", {}}}};
  Plot plot{table.name,
            "Error where x first passes zero",
            {"Time step (s)", true, {}},
            {"Error of x (mm)", true, {}},
            {}};
  const std::array<int, 6> counts{7, 14, 28, 56, 112, 224};
  for (const int steps : counts) table.columns[0].values.push_back(order_time_s / steps);
  for (const auto& method : methods) {
    Column column{method.name, "mm", {}};
    for (const int steps : counts) {
      progress.report(0.5, result.name);
      const double error = error_mm(method.integrator, steps);
      column.values.push_back(
          std::isfinite(error) && error < 10.0 * start_mm ? error : std::numeric_limits<double>::quiet_NaN());
    }
    const double order = std::log2(error_mm(method.integrator, 28) / error_mm(method.integrator, 56));
    result.findings.push_back({"order-" + method.name, "measured order of " + method.title, order, ""});
    plot.series.push_back({method.title, table.columns[0].values, column.values, true, true, false, {}});
    table.columns.push_back(std::move(column));
  }
  result.tables.push_back(std::move(table));
  result.plots.push_back(std::move(plot));
}

/// Where a step of the thesis leaves the spring swinging more than it began.
void add_explosions(Result& result, const Method& method) {
  for (const double step_s : thesis_steps_s) {
    const Course c = course(method.integrator, step_s);
    double late = 0.0;
    for (std::size_t n = c.t.size() * 3 / 4; n < c.t.size(); ++n) late = std::max(late, std::abs(c.x[n]));
    result.findings.push_back(
        {"late-" + method.name + "-" + step_text(step_s),
         "largest x in the last second, " + method.title + ", h = " + step_text(step_s) + " s", late, "mm"});
  }
}

Result integrators(const std::string& name, const std::vector<Method>& methods, const std::string& title,
                   const core::Progress& progress) {
  Result result;
  result.name = name;
  add_courses(result, methods, title);
  add_orders(result, methods, progress);
  add_explosions(result, methods.front());
  return result;
}

}  // namespace

Result integrator_euler(const Setup& /*setup*/, const core::Progress& progress) {
  return integrators("integrator-euler",
                     {{Integrator::euler, "euler", "Euler"},
                      {Integrator::symplectic_euler, "symplectic-euler", "symplectic Euler"}},
                     "Euler's method", progress);
}

Result integrator_verlet(const Setup& /*setup*/, const core::Progress& progress) {
  return integrators("integrator-verlet",
                     {{Integrator::verlet, "verlet", "Verlet, position form"},
                      {Integrator::velocity_verlet, "velocity-verlet", "velocity Verlet"}},
                     "Verlet's method, position form", progress);
}

Result integrator_rk4(const Setup& /*setup*/, const core::Progress& progress) {
  return integrators("integrator-rk4", {{Integrator::rk4, "rk4", "RK4"}}, "Fourth-order Runge-Kutta",
                     progress);
}

}  // namespace palpate::evaluation
