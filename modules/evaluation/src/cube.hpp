#pragma once

#include "palpate/evaluation/experiment.hpp"
#include "palpate/model/generate.hpp"
#include "palpate/simulation/solver.hpp"

#include <cstdint>
#include <memory>
#include <vector>

// What the experiments share: a cube of tissue, its faces, a force on a part.
namespace palpate::evaluation {

struct CubeModel {
  int side = 10;  ///< points along an edge, 1 mm apart
  double noise = 0.1;
  model::LinkRule links = model::LinkRule::nearest;
  int max_links = 12;
  model::PointRule points = model::PointRule::lattice;
  std::uint64_t seed = 1;
};
/// By model::generate, from a volume that is tissue everywhere.
std::shared_ptr<const model::Tissue> make_cube(const CubeModel& cube);

/// Points at rest in the lowest or the highest layer, 1 mm thick.
std::vector<std::uint32_t> lowest_layer(const model::Tissue& tissue);
std::vector<std::uint32_t> highest_layer(const model::Tissue& tissue);

/// The solver that the setup asks for.
std::unique_ptr<simulation::Solver> make_solver(
    const Setup& setup, const std::shared_ptr<const model::Tissue>& tissue,
    const simulation::Parameters& parameters, const simulation::Material& material = {},
    simulation::LayoutChoice layout = simulation::LayoutChoice::automatic);

/// Back to rest, nothing held.
void reset(simulation::Solver& solver, const model::Tissue& tissue);

/// A static force on some points for steps of step_s: a grip that slips.
/// Points held with a tiny alpha by a hand of velocity a h / alpha gain a h
/// in velocity each step, as a force a per unit mass gives; what is left of
/// the grip is a drag of alpha / h on them.
void push(simulation::Solver& solver, const std::vector<std::uint32_t>& points,
          const Eigen::Vector3d& acceleration_mm_per_s2, double step_s);

double mean_links(const model::Tissue& tissue);
double median(std::vector<double> values);
/// The slope of log y over log x by least squares.
double log_slope(const std::vector<double>& x, const std::vector<double>& y);

}  // namespace palpate::evaluation
