#include "cube.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::evaluation {
namespace {

constexpr float tissue_value = 100.0F;

/// Between `from` and `to`, counted in layers from the lowest.
std::vector<std::uint32_t> slab(const model::Tissue& tissue, double from, double to) {
  const auto& geometry = tissue.geometry;
  std::vector<std::uint32_t> points;
  for (std::size_t n = 0; n < tissue.points.size(); ++n) {
    const double layer = geometry.to_ijk(tissue.points.lps_mm(n)).z() + 0.5;
    if (layer >= from && layer < to) points.push_back(static_cast<std::uint32_t>(n));
  }
  return points;
}

}  // namespace

std::shared_ptr<const model::Tissue> make_cube(const CubeModel& cube) {
  const auto count = static_cast<std::size_t>(cube.side) * static_cast<std::size_t>(cube.side) *
                     static_cast<std::size_t>(cube.side);
  const core::Volume volume(core::ImageGeometry({cube.side, cube.side, cube.side}, Eigen::Vector3d::Ones(),
                                                Eigen::Vector3d::Zero()),
                            std::vector<float>(count, tissue_value));
  model::TissueParameters parameters;
  parameters.threshold_low = tissue_value / 2.0;
  parameters.noise = cube.noise;
  parameters.links = cube.links;
  parameters.max_links = cube.max_links;
  parameters.points = cube.points;
  parameters.seed = cube.seed;
  return std::make_shared<const model::Tissue>(model::generate(volume, parameters));
}

std::vector<std::uint32_t> lowest_layer(const model::Tissue& tissue) { return slab(tissue, -1.0, 1.0); }

std::vector<std::uint32_t> highest_layer(const model::Tissue& tissue) {
  const double layers = tissue.geometry.dims()[2];
  return slab(tissue, layers - 1.0, layers + 1.0);
}

std::unique_ptr<simulation::Solver> make_solver(const Setup& setup,
                                                const std::shared_ptr<const model::Tissue>& tissue,
                                                const simulation::Parameters& parameters,
                                                const simulation::Material& material,
                                                simulation::LayoutChoice layout) {
  if (!setup.device) return simulation::make_reference_solver(tissue, parameters, material);
  simulation::OpenclOptions options;
  options.layout = layout;
  return simulation::make_opencl_solver(*setup.device, tissue, parameters, options, material);
}

void reset(simulation::Solver& solver, const model::Tissue& tissue) {
  solver.hold({});
  solver.set_grab_velocity(Eigen::Vector3d::Zero());
  simulation::State rest;
  rest.positions_mm = tissue.points.positions_mm;
  rest.velocities_mm_per_s.assign(rest.positions_mm.size(), Eigen::Vector3f::Zero());
  solver.set_state(rest);
}

void push(simulation::Solver& solver, const std::vector<std::uint32_t>& points,
          const Eigen::Vector3d& acceleration_mm_per_s2, double step_s) {
  constexpr double alpha = 1e-4;
  std::vector<simulation::HeldPoint> held;
  held.reserve(points.size());
  for (const std::uint32_t point : points) held.push_back({point, static_cast<float>(alpha)});
  solver.hold(held);
  solver.set_grab_velocity(acceleration_mm_per_s2 * (step_s / alpha));
}

double mean_links(const model::Tissue& tissue) {
  return 2.0 * static_cast<double>(tissue.links.size()) / static_cast<double>(tissue.points.size());
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

double log_slope(const std::vector<double>& x, const std::vector<double>& y) {
  double mean_x = 0.0;
  double mean_y = 0.0;
  const auto count = static_cast<double>(x.size());
  for (std::size_t n = 0; n < x.size(); ++n) {
    mean_x += std::log(x[n]) / count;
    mean_y += std::log(y[n]) / count;
  }
  double xy = 0.0;
  double xx = 0.0;
  for (std::size_t n = 0; n < x.size(); ++n) {
    const double dx = std::log(x[n]) - mean_x;
    xy += dx * (std::log(y[n]) - mean_y);
    xx += dx * dx;
  }
  return xy / xx;
}

}  // namespace palpate::evaluation
