#include "palpate/simulation/solver.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Geometry>

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

LinkHealth Solver::link_health() {
  const Energy now = energy();
  return {now.kinetic, now.potential, 0.0F};
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
