#include "point_grid.hpp"

#include "palpate/core/error.hpp"
#include "palpate/surface/binding.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <exception>
#include <limits>
#include <mutex>
#include <optional>
#include <thread>

namespace palpate::surface {
namespace {

using Eigen::Vector3d;
using Corners = std::array<std::uint32_t, 3>;

/// Weights of the point of triangle abc that lies closest to `place`: inside,
/// on an edge, or a corner (regions after Ericson, Real-Time Collision
/// Detection, 5.1.5).
Vector3d closest_weights(const Vector3d& place, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d ab = b - a;
  const Vector3d ac = c - a;
  const double a1 = ab.dot(place - a);
  const double a2 = ac.dot(place - a);
  if (a1 <= 0.0 && a2 <= 0.0) return {1, 0, 0};
  const double b1 = ab.dot(place - b);
  const double b2 = ac.dot(place - b);
  if (b1 >= 0.0 && b2 <= b1) return {0, 1, 0};
  const double area_c = a1 * b2 - b1 * a2;
  if (area_c <= 0.0 && a1 >= 0.0 && b1 <= 0.0) return {1.0 - a1 / (a1 - b1), a1 / (a1 - b1), 0};
  const double c1 = ab.dot(place - c);
  const double c2 = ac.dot(place - c);
  if (c2 >= 0.0 && c1 <= c2) return {0, 0, 1};
  const double area_b = c1 * a2 - a1 * c2;
  if (area_b <= 0.0 && a2 >= 0.0 && c2 <= 0.0) return {1.0 - a2 / (a2 - c2), 0, a2 / (a2 - c2)};
  const double area_a = b1 * c2 - c1 * b2;
  if (area_a <= 0.0 && b2 - b1 >= 0.0 && c1 - c2 >= 0.0) {
    const double w = (b2 - b1) / ((b2 - b1) + (c1 - c2));
    return {0, 1.0 - w, w};
  }
  const double sum = area_a + area_b + area_c;
  const double w_b = area_b / sum;
  const double w_c = area_c / sum;
  return {1.0 - w_b - w_c, w_b, w_c};
}

/// Area over the longest edge squared: 0.43 for equal sides, 0 in line.
double shape_of(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const double longest = std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()});
  return longest > 0.0 ? 0.5 * (b - a).cross(c - a).norm() / longest : 0.0;
}

/// How far the search for a triangle goes before it takes what there is.
struct Search {
  std::size_t nearest;
  double least_shape;
};
// A right triangle with equal legs has 0.25; one of a lattice with slices four times as far apart 0.12.
constexpr std::array<Search, 3> searches{{{10, 0.1}, {20, 0.05}, {32, 0.01}}};
constexpr double least_shape_of_all = 1e-3;

class Binder {
 public:
  Binder(const core::TriangleMesh& mesh, const model::Tissue& tissue)
      : mesh_(mesh),
        tissue_(tissue),
        positions_(tissue.points.positions_mm),
        adjacency_(model::adjacency_of(tissue.links, tissue.points.size())),
        grid_(positions_),
        normals_(mesh.normals.size() == mesh.vertices_mm.size() ? mesh.normals : core::vertex_normals(mesh)),
        scale_squared_(tissue.spacing_mm.squaredNorm() / 3.0) {
    component_ = model::components_of(tissue.links, positions_.size()).component;
    find_widest();
    // Points without links still span triangles, if no linked piece does.
    if (std::none_of(widest_.begin(), widest_.end(),
                     [](const auto& corners) { return corners.has_value(); })) {
      component_.assign(positions_.size(), 0);
      find_widest();
    }
    usable_.resize(positions_.size());
    bool any = false;
    for (std::size_t point = 0; point < usable_.size(); ++point) {
      usable_[point] = widest_[component_[point]].has_value();
      any |= usable_[point];
    }
    if (!any)
      throw core::Error(
          core::ErrorKind::input, "no-triangle",
          "The tissue has " + std::to_string(positions_.size()) +
              " points and no three of one piece that are not in line, so no surface can follow it. "
              "Widen the threshold or lower the stride.");
  }

  void bind_vertex(std::size_t vertex, SurfaceBinding& binding) const {
    const Vector3d place = mesh_.vertices_mm[vertex].cast<double>() - tissue_.points.center_mm;
    Corners corners = choose(place);
    start_at_squarest(corners);
    Vector3d weights = closest_weights(place, at(corners[0]), at(corners[1]), at(corners[2])).cwiseMax(0.0);
    weights /= weights.sum();
    if (!wound_outwards(corners, weights, normals_[vertex].cast<double>())) {
      std::swap(corners[1], corners[2]);
      std::swap(weights[1], weights[2]);
    }
    Eigen::Vector3f stored = weights.cast<float>();
    stored[0] = std::max(0.0F, 1.0F - stored[1] - stored[2]);
    // The offset is taken with the stored weights, so that it makes up for their rounding.
    const Vector3d reference = at(corners[0]) +
                               static_cast<double>(stored[1]) * (at(corners[1]) - at(corners[0])) +
                               static_cast<double>(stored[2]) * (at(corners[2]) - at(corners[0]));
    const Eigen::Matrix3d basis = triangle_basis(at(corners[0]), at(corners[1]), at(corners[2]));
    binding.points[vertex] = corners;
    binding.weights[vertex] = stored;
    binding.offsets_tnb_mm[vertex] = (basis.transpose() * (place - reference)).cast<float>();
    binding.normals_tnb[vertex] = (basis.transpose() * normals_[vertex].cast<double>()).cast<float>();
  }

 private:
  Vector3d at(std::uint32_t point) const { return positions_[point].cast<double>(); }

  /// For each component a triangle as wide as it gets in three sweeps: from
  /// its first point to the one farthest off to the one farthest from that line.
  void find_widest() {
    const std::size_t count =
        component_.empty() ? 0 : std::size_t{*std::max_element(component_.begin(), component_.end())} + 1;
    constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
    std::vector<Corners> corners(count, Corners{none, none, none});
    const auto sweep = [&](std::size_t corner, auto measure) {
      std::vector<double> best(count, 0.0);
      for (std::uint32_t point = 0; point < positions_.size(); ++point) {
        auto& found = corners[component_[point]];
        const double value = measure(found, point);
        if (value > best[component_[point]]) {
          best[component_[point]] = value;
          found[corner] = point;
        }
      }
    };
    for (std::uint32_t point = 0; point < positions_.size(); ++point)
      if (corners[component_[point]][0] == none) corners[component_[point]][0] = point;
    sweep(1, [&](const Corners& found, std::uint32_t point) {
      return (at(point) - at(found[0])).squaredNorm();
    });
    sweep(2, [&](const Corners& found, std::uint32_t point) {
      if (found[1] == none) return 0.0;
      return (at(found[1]) - at(found[0])).cross(at(point) - at(found[0])).squaredNorm();
    });
    widest_.assign(count, std::nullopt);
    for (std::size_t n = 0; n < count; ++n)
      if (corners[n][2] != none &&
          shape_of(at(corners[n][0]), at(corners[n][1]), at(corners[n][2])) > least_shape_of_all)
        widest_[n] = corners[n];
  }

  bool linked(std::uint32_t a, std::uint32_t b) const {
    const auto first = adjacency_.neighbours.begin() + adjacency_.offsets[a];
    const auto last = adjacency_.neighbours.begin() + adjacency_.offsets[a + 1];
    return std::find(first, last, b) != last;
  }

  Corners choose(const Vector3d& place) const {
    std::vector<PointGrid::Found> near;
    for (const Search& search : searches) {
      grid_.nearest(place, search.nearest, usable_, near);
      if (const auto best = best_of(place, near, search.least_shape)) return *best;
      if (near.size() < search.nearest) break;  // there are no more points
    }
    return *widest_[component_[near.front().point]];
  }

  /// The cheapest triangle among `near`: close to the place, its corners close
  /// by, and held together by links, so that it does not span a gap.
  std::optional<Corners> best_of(const Vector3d& place, const std::vector<PointGrid::Found>& near,
                                 double least_shape) const {
    constexpr double corner_share = 0.1;      // of the corners' distances against the triangle's
    constexpr double apart_price = 4.0;       // in squared spacings, where fewer than two sides are links
    constexpr double open_side_price = 0.05;  // where one side is none
    const std::size_t count = near.size();
    std::vector<bool> joined(count * count);
    for (std::size_t a = 0; a < count; ++a)
      for (std::size_t b = a + 1; b < count; ++b)
        joined[a * count + b] = linked(near[a].point, near[b].point);
    double best = std::numeric_limits<double>::infinity();
    std::optional<Corners> chosen;
    for (std::size_t a = 0; a < count; ++a)
      for (std::size_t b = a + 1; b < count; ++b) {
        if (component_[near[a].point] != component_[near[b].point]) continue;
        for (std::size_t c = b + 1; c < count; ++c) {
          if (component_[near[a].point] != component_[near[c].point]) continue;
          const int sides = static_cast<int>(joined[a * count + b]) +
                            static_cast<int>(joined[a * count + c]) + static_cast<int>(joined[b * count + c]);
          double cost = corner_share / 3.0 * (near[a].squared_mm + near[b].squared_mm + near[c].squared_mm);
          if (sides < 3) cost += scale_squared_ * (sides < 2 ? apart_price : open_side_price);
          if (cost >= best) continue;
          const Vector3d pa = at(near[a].point);
          const Vector3d pb = at(near[b].point);
          const Vector3d pc = at(near[c].point);
          if (shape_of(pa, pb, pc) < least_shape) continue;
          const Vector3d weights = closest_weights(place, pa, pb, pc);
          cost += (weights[0] * pa + weights[1] * pb + weights[2] * pc - place).squaredNorm();
          if (cost >= best) continue;
          best = cost;
          chosen = Corners{near[a].point, near[b].point, near[c].point};
        }
      }
    return chosen;
  }

  /// p1 where the angle is widest among those of the three closest to a right
  /// angle, so that T and Bt stay far from one line.
  void start_at_squarest(Corners& corners) const {
    double best = std::numeric_limits<double>::infinity();
    std::size_t first = 0;
    for (std::size_t n = 0; n < 3; ++n) {
      const Vector3d one = (at(corners[(n + 1) % 3]) - at(corners[n])).normalized();
      const Vector3d two = (at(corners[(n + 2) % 3]) - at(corners[n])).normalized();
      const double cosine = std::abs(one.dot(two));
      if (cosine < best) {
        best = cosine;
        first = n;
      }
    }
    std::rotate(corners.begin(), corners.begin() + static_cast<std::ptrdiff_t>(first), corners.end());
  }

  /// The normalised sum of unit vectors from the point's neighbours to it (paper, equation 3).
  Vector3d approximate_normal(std::uint32_t point) const {
    Vector3d sum = Vector3d::Zero();
    for (auto n = adjacency_.offsets[point]; n < adjacency_.offsets[point + 1]; ++n)
      sum += (at(point) - at(adjacency_.neighbours[n])).normalized();
    return sum.norm() > 1e-6 ? Vector3d(sum.normalized()) : Vector3d::Zero();
  }

  /// N goes with the points' normals; where they say nothing, with the vertex's.
  bool wound_outwards(const Corners& corners, const Vector3d& weights, const Vector3d& vertex_normal) const {
    const Vector3d normal =
        (at(corners[1]) - at(corners[0])).cross(at(corners[2]) - at(corners[0])).normalized();
    Vector3d outwards = Vector3d::Zero();
    for (std::size_t n = 0; n < 3; ++n)
      outwards += weights[static_cast<Eigen::Index>(n)] * approximate_normal(corners[n]);
    constexpr double poor = 0.1;  // cosine below which the points' normals do not decide
    const double along = normal.dot(outwards);
    return std::abs(along) > poor ? along > 0.0 : normal.dot(vertex_normal) >= 0.0;
  }

  const core::TriangleMesh& mesh_;
  const model::Tissue& tissue_;
  const std::vector<Eigen::Vector3f>& positions_;
  model::Adjacency adjacency_;
  PointGrid grid_;
  std::vector<Eigen::Vector3f> normals_;
  double scale_squared_;
  std::vector<std::uint32_t> component_;
  std::vector<std::optional<Corners>> widest_;
  std::vector<bool> usable_;
};

/// Calls work(index) for all indices from several threads; reports from this one.
template <typename Work>
void for_all(std::size_t count, const core::Progress& progress, Work work) {
  constexpr std::size_t block = 256;
  std::atomic<std::size_t> next{0};
  std::atomic<bool> stop{false};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto run = [&](bool reports) {
    try {
      while (!stop.load(std::memory_order_relaxed)) {
        const std::size_t begin = next.fetch_add(block);
        if (begin >= count) return;
        for (std::size_t n = begin; n < std::min(count, begin + block); ++n) work(n);
        if (reports)
          progress.report(static_cast<double>(begin) / static_cast<double>(count), "Binding the surface");
      }
    } catch (...) {
      const std::lock_guard<std::mutex> lock(failure_mutex);
      failure = std::current_exception();
      stop = true;
    }
  };
  std::vector<std::thread> helpers;
  const unsigned threads = std::max(1U, std::thread::hardware_concurrency());
  for (unsigned n = 1; n < threads && n * block < count; ++n) helpers.emplace_back(run, false);
  run(true);
  for (auto& helper : helpers) helper.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace

SurfaceBinding bind(const core::TriangleMesh& mesh, const model::Tissue& tissue,
                    const core::Progress& progress) {
  progress.report(0.0, "Binding the surface");
  const Binder binder(mesh, tissue);
  SurfaceBinding binding;
  const std::size_t count = mesh.vertices_mm.size();
  binding.points.resize(count);
  binding.weights.resize(count);
  binding.offsets_tnb_mm.resize(count);
  binding.normals_tnb.resize(count);
  for_all(count, progress.part(0.3, 1.0), [&](std::size_t vertex) { binder.bind_vertex(vertex, binding); });
  progress.report(1.0, "Surface bound");
  return binding;
}

}  // namespace palpate::surface
