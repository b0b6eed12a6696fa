#include "palpate/simulation/solver.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Geometry>

#include <cmath>
#include <numeric>

namespace palpate::simulation {

std::string to_string(LayoutChoice choice) {
  return choice == LayoutChoice::lattice          ? "lattice"
         : choice == LayoutChoice::explicit_links ? "explicit"
                                                  : "auto";
}

LayoutChoice layout_of(const std::string& name) {
  for (const auto choice : {LayoutChoice::automatic, LayoutChoice::lattice, LayoutChoice::explicit_links})
    if (name == to_string(choice)) return choice;
  core::throw_usage("There is no layout \"" + name + "\"; there are auto, lattice and explicit.");
}

Solver::Solver(std::shared_ptr<const model::Tissue> tissue, Material material)
    : tissue_(std::move(tissue)), material_(std::move(material)) {
  if (!tissue_) return;
  check(material_, tissue_->points.size());
  link_alive_.assign(tissue_->links.size(), 1);
  Eigen::AlignedBox3f box;
  for (const auto& position : tissue_->points.positions_mm) box.extend(position);
  if (!box.isEmpty()) extent_mm_ = static_cast<double>(box.diagonal().norm());
  const auto& lengths = tissue_->links.rest_lengths_mm;
  if (!lengths.empty())
    link_length_mm_ =
        std::accumulate(lengths.begin(), lengths.end(), 0.0) / static_cast<double>(lengths.size());
}

void Solver::set_anchors(const std::vector<std::uint32_t>& points) {
  Material changed = material_;
  changed.anchors = points;
  check(changed, tissue_->points.size());
  material_ = std::move(changed);
}

void Solver::set_links_alive(const std::vector<std::uint32_t>& links, bool alive) {
  for (const std::uint32_t link : links)
    if (link >= link_alive_.size())
      throw core::Error(core::ErrorKind::internal, "no-link",
                        "Link " + std::to_string(link) + " is not one of the " +
                            std::to_string(link_alive_.size()) + " links.");
  for (const std::uint32_t link : links) link_alive_[link] = alive ? 1 : 0;
}

std::vector<float> Solver::freedom() const {
  std::vector<float> freedom(tissue_->points.size(), 1.0F);
  for (const std::uint32_t point : material_.anchors) freedom[point] = 0.0F;
  return freedom;
}

LinkHealth Solver::link_health() {
  const Energy now = energy();
  const State at = state();
  const std::vector<float> free = freedom();
  double fastest = 0.0;
  for_living_links([&](std::size_t link, std::uint32_t a, std::uint32_t b) {
    if (free[a] != 1.0F || free[b] != 1.0F) return;
    const Eigen::Vector3d apart = (at.positions_mm[b] - at.positions_mm[a]).cast<double>();
    const Eigen::Vector3d speed = (at.velocities_mm_per_s[b] - at.velocities_mm_per_s[a]).cast<double>();
    const double length = apart.norm();
    if (length == 0.0) return;
    const double rate = std::abs(apart.dot(speed)) / (length * rest_length(link));
    if (!(rate <= fastest)) fastest = rate;  // NaN stays
  });
  return {now.kinetic, now.potential, static_cast<float>(fastest)};
}

Energy Solver::energy() const {
  const State now = state();
  const Parameters& p = parameters();
  const auto factor = [&](bool scaled, std::size_t n) {
    return scaled && !material_.factors.empty() ? static_cast<double>(material_.factors[n]) : 1.0;
  };
  Energy energy;
  for (std::size_t n = 0; n < now.positions_mm.size(); ++n) {
    const double mass = p.mass * factor(material_.scales_mass, n);
    const Eigen::Vector3d velocity = now.velocities_mm_per_s[n].cast<double>();
    energy.kinetic += 0.5 * mass * velocity.squaredNorm();
    energy.momentum += mass * velocity;
    energy.potential -= mass * p.gravity_mm_per_s2.dot(now.positions_mm[n].cast<double>());
  }
  const double rest_scale = rest_scale_at(p, now.time_s);
  for_living_links([&](std::size_t link, std::uint32_t a, std::uint32_t b) {
    const bool scaled = material_.scales_stiffness;
    const double stiffness = 0.5 * p.stiffness_per_s2 * (factor(scaled, a) + factor(scaled, b));
    const double length = (now.positions_mm[b] - now.positions_mm[a]).cast<double>().norm();
    const double extension = length - rest_scale * rest_length(link);
    energy.potential += 0.5 * stiffness * extension * extension;
  });
  return energy;
}

}  // namespace palpate::simulation
