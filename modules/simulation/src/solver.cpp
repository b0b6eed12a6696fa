#include "palpate/simulation/solver.hpp"

#include <Eigen/Geometry>

#include <numeric>

namespace palpate::simulation {

Solver::Solver(std::shared_ptr<const model::Tissue> tissue) : tissue_(std::move(tissue)) {
  if (!tissue_) return;
  Eigen::AlignedBox3f box;
  for (const auto& position : tissue_->points.positions_mm) box.extend(position);
  if (!box.isEmpty()) extent_mm_ = static_cast<double>(box.diagonal().norm());
  const auto& lengths = tissue_->links.rest_lengths_mm;
  if (!lengths.empty())
    link_length_mm_ =
        std::accumulate(lengths.begin(), lengths.end(), 0.0) / static_cast<double>(lengths.size());
}

Energy Solver::energy() const {
  const State now = state();
  const Parameters& p = parameters();
  Energy energy;
  for (std::size_t n = 0; n < now.positions_mm.size(); ++n) {
    const Eigen::Vector3d velocity = now.velocities_mm_per_s[n].cast<double>();
    energy.kinetic += 0.5 * velocity.squaredNorm();
    energy.momentum += velocity;
    energy.potential -= p.gravity_mm_per_s2.dot(now.positions_mm[n].cast<double>());
  }
  const model::LinkGraph& links = tissue().links;
  for (std::size_t n = 0; n < links.size(); ++n) {
    const auto [a, b] = links.pairs[n];
    const double length = (now.positions_mm[b] - now.positions_mm[a]).cast<double>().norm();
    const double extension = length - static_cast<double>(links.rest_lengths_mm[n]);
    energy.potential += 0.5 * p.stiffness_per_s2 * extension * extension;
  }
  return energy;
}

}  // namespace palpate::simulation
