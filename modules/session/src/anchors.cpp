#include "palpate/session/anchors.hpp"

namespace palpate::session {

bool operator==(const AnchorDab& a, const AnchorDab& b) {
  return a.place_mm == b.place_mm && a.radius_mm == b.radius_mm && a.frees == b.frees;
}

std::vector<std::uint32_t> paint_anchors(const std::vector<std::uint32_t>& anchors,
                                         const model::PointCloud& points,
                                         const std::vector<AnchorDab>& dabs) {
  std::vector<std::uint8_t> fixed(points.size(), 0);
  for (const std::uint32_t point : anchors)
    if (point < fixed.size()) fixed[point] = 1;
  for (const AnchorDab& dab : dabs) {
    const Eigen::Vector3f place = (dab.place_mm - points.center_mm).cast<float>();
    const auto reach = static_cast<float>(dab.radius_mm * dab.radius_mm);
    for (std::size_t p = 0; p < fixed.size(); ++p)
      if ((points.positions_mm[p] - place).squaredNorm() <= reach) fixed[p] = dab.frees ? 0 : 1;
  }
  std::vector<std::uint32_t> painted;
  for (std::size_t p = 0; p < fixed.size(); ++p)
    if (fixed[p] != 0) painted.push_back(static_cast<std::uint32_t>(p));
  return painted;
}

}  // namespace palpate::session
