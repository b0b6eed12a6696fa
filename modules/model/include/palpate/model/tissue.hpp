#pragma once

#include "palpate/core/geometry.hpp"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate::model {

/// Point masses, one per tissue voxel (thesis 3.1). All arrays have size().
struct PointCloud {
  std::vector<Eigen::Vector3f> positions_mm;            ///< LPS, relative to `center_mm`
  std::vector<std::array<std::int32_t, 3>> voxels;      ///< the source voxel (i, j, k)
  std::vector<float> intensities;                       ///< of the source voxel
  Eigen::Vector3d center_mm = Eigen::Vector3d::Zero();  ///< LPS of the volume's centre

  std::size_t size() const noexcept { return positions_mm.size(); }
  Eigen::Vector3d lps_mm(std::size_t point) const { return center_mm + positions_mm[point].cast<double>(); }
};

/// Undirected links; each pair once with first < second, sorted.
struct LinkGraph {
  std::vector<std::array<std::uint32_t, 2>> pairs;
  std::vector<float> rest_lengths_mm;

  std::size_t size() const noexcept { return pairs.size(); }
};

/// For every point its links, as a compressed list: the neighbours of point p
/// are neighbours[offsets[p] .. offsets[p+1]).
struct Adjacency {
  std::vector<std::uint32_t> offsets;
  std::vector<std::uint32_t> neighbours;
  std::vector<std::uint32_t> links;  ///< index into LinkGraph, parallel to neighbours
};
Adjacency adjacency_of(const LinkGraph& links, std::size_t point_count);

struct Tissue {
  PointCloud points;
  LinkGraph links;
  core::ImageGeometry geometry;                          ///< of the source volume
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Ones();  ///< between points: voxel spacing times stride
  int stride = 1;                                        ///< voxels between points
  bool on_lattice = true;  ///< every point has a voxel of its own, `stride` voxels from the next
  /// The first and the last voxel along each axis that could hold a point: the
  /// borders of the image or the crop.
  std::array<std::int32_t, 3> first_voxel{0, 0, 0};
  std::array<std::int32_t, 3> last_voxel{0, 0, 0};
};

/// `component[p]` numbers the connected component of point p, largest first.
struct Components {
  std::vector<std::uint32_t> component;
  std::vector<std::size_t> sizes;
};
Components components_of(const LinkGraph& links, std::size_t point_count);

struct TissueStatistics {
  std::size_t points = 0;
  std::size_t links = 0;
  int min_links_per_point = 0;
  double mean_links_per_point = 0.0;
  int max_links_per_point = 0;
  std::size_t components = 0;
  std::size_t largest_component = 0;
  std::size_t isolated = 0;
  Eigen::Vector3d bounds_min_mm = Eigen::Vector3d::Zero();  ///< LPS
  Eigen::Vector3d bounds_max_mm = Eigen::Vector3d::Zero();
  std::size_t bytes = 0;  ///< of points, links and the solver's device arrays
};
TissueStatistics statistics_of(const Tissue& tissue);

}  // namespace palpate::model
