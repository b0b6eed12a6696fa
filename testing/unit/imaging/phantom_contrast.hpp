#pragma once

#include "palpate/imaging/phantom.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

// How well wall and cavity of the speckled phantom can be told apart, and how
// wide the border between them is. All of it rests on the phantom's labels and
// its true surface, nothing on a filter.
namespace palpate::testing {

class PhantomContrast {
 public:
  PhantomContrast(int size, std::uint64_t seed) {
    imaging::PhantomParameters parameters;
    parameters.size = size;
    parameters.seed = seed;
    phantom_ = imaging::make_phantom(parameters);
    find_border();
    find_regions();
  }
  const core::Volume& speckled() const { return phantom_.frames.front(); }
  std::size_t border_places() const { return places_.size(); }

  /// |mean wall - mean cavity| over the root of the mean of their variances,
  /// over voxels whose neighbours within two voxels all bear their label.
  double contrast_to_noise(const core::Volume& volume) const {
    const auto [wall_mean, wall_variance] = statistics(volume, wall_);
    const auto [cavity_mean, cavity_variance] = statistics(volume, cavity_);
    return std::abs(wall_mean - cavity_mean) / std::sqrt(0.5 * (wall_variance + cavity_variance));
  }

  /// Millimetres over which grey climbs from 10 to 90 % of the way between
  /// cavity and wall (their means 2 to 4 mm from the border), in the profile
  /// across the border averaged over the true inner surface by its area.
  double edge_width_mm(const core::Volume& volume) const {
    const std::vector<double> profile = mean_profile(volume);
    const double wall = mean(profile, -4.0, -2.0);
    const double cavity = mean(profile, 2.0, 4.0);
    const auto level = [&](double share) { return cavity + share * (wall - cavity); };
    std::size_t middle = profile.size() / 2;
    while (profile[middle] > level(0.5)) ++middle;
    while (profile[middle - 1] <= level(0.5)) --middle;
    std::size_t low = middle;
    while (profile[low] > level(0.1)) ++low;
    std::size_t high = middle;
    while (profile[high] < level(0.9)) --high;
    const auto place = [&](std::size_t before, double at) {  // between before and before + 1
      return static_cast<double>(before) + (profile[before] - at) / (profile[before] - profile[before + 1]);
    };
    return step_mm * (place(low - 1, level(0.1)) - place(high, level(0.9)));
  }

 private:
  static constexpr double step_mm = 0.05;
  static constexpr double reach_mm = 6.0;

  int label(const Eigen::Vector3d& lps_mm) const {
    const auto& geometry = phantom_.labels.geometry();
    const Eigen::Vector3i ijk = geometry.to_ijk(lps_mm).array().round().matrix().cast<int>();
    if (!geometry.contains(ijk.x(), ijk.y(), ijk.z())) return -1;
    return static_cast<int>(phantom_.labels.at(ijk.x(), ijk.y(), ijk.z()));
  }

  /// Vertices of the true surface with wall behind and cavity before them.
  void find_border() {
    const auto& mesh = phantom_.surface;
    std::vector<double> areas(mesh.vertices_mm.size(), 0.0);
    for (const auto& triangle : mesh.triangles) {
      const Eigen::Vector3f a = mesh.vertices_mm[triangle[0]];
      const Eigen::Vector3f cross =
          (mesh.vertices_mm[triangle[1]] - a).cross(mesh.vertices_mm[triangle[2]] - a);
      for (const auto vertex : triangle) areas[vertex] += static_cast<double>(cross.norm()) / 6.0;
    }
    for (std::size_t n = 0; n < areas.size(); ++n) {
      const Eigen::Vector3d place = mesh.vertices_mm[n].cast<double>();
      const Eigen::Vector3d normal = mesh.normals[n].cast<double>();
      bool clear = true;
      for (double distance = 1.0; distance <= 4.0; distance += 0.5)
        clear = clear &&
                label(place + distance * normal) == static_cast<int>(imaging::PhantomLabel::cavity) &&
                label(place - distance * normal) == static_cast<int>(imaging::PhantomLabel::wall);
      if (!clear) continue;
      places_.push_back(place);
      normals_.push_back(normal);
      areas_.push_back(areas[n]);
    }
  }

  void find_regions() {
    const auto& geometry = phantom_.labels.geometry();
    const auto alike = [&](int i, int j, int k, int label) {
      for (int c = -2; c <= 2; ++c)
        for (int b = -2; b <= 2; ++b)
          for (int a = -2; a <= 2; ++a)
            if (a * a + b * b + c * c <= 4 &&
                (!geometry.contains(i + a, j + b, k + c) ||
                 static_cast<int>(phantom_.labels.at(i + a, j + b, k + c)) != label))
              return false;
      return true;
    };
    for (std::size_t n = 0; n < phantom_.labels.size(); ++n) {
      const auto [i, j, k] = geometry.ijk_of(n);
      const int label = static_cast<int>(phantom_.labels.data()[n]);
      const bool is_wall = label == static_cast<int>(imaging::PhantomLabel::wall);
      if (!is_wall && label != static_cast<int>(imaging::PhantomLabel::cavity)) continue;
      if (alike(i, j, k, label)) (is_wall ? wall_ : cavity_).push_back(n);
    }
  }

  static std::pair<double, double> statistics(const core::Volume& volume,
                                              const std::vector<std::size_t>& voxels) {
    const auto count = static_cast<double>(voxels.size());
    double mean = 0.0;
    for (const std::size_t n : voxels) mean += static_cast<double>(volume.data()[n]) / count;
    double variance = 0.0;
    for (const std::size_t n : voxels) {
      const double apart = static_cast<double>(volume.data()[n]) - mean;
      variance += apart * apart / count;
    }
    return {mean, variance};
  }

  std::vector<double> mean_profile(const core::Volume& volume) const {
    double area = 0.0;
    for (const double one : areas_) area += one;
    std::vector<double> profile;
    const int steps = static_cast<int>(reach_mm / step_mm);
    for (int step = -steps; step <= steps; ++step) {
      double sum = 0.0;
      for (std::size_t n = 0; n < places_.size(); ++n)
        sum += areas_[n] * static_cast<double>(volume.sample(
                               phantom_.labels.geometry().to_ijk(places_[n] + step * step_mm * normals_[n])));
      profile.push_back(sum / area);
    }
    return profile;
  }
  static double mean(const std::vector<double>& profile, double from_mm, double to_mm) {
    const auto index = [&](double at) {
      return static_cast<std::size_t>(std::lround((at + reach_mm) / step_mm));
    };
    double sum = 0.0;
    for (std::size_t n = index(from_mm); n <= index(to_mm); ++n) sum += profile[n];
    return sum / static_cast<double>(index(to_mm) - index(from_mm) + 1);
  }

  imaging::Phantom phantom_;
  std::vector<Eigen::Vector3d> places_, normals_;
  std::vector<double> areas_;
  std::vector<std::size_t> wall_, cavity_;
};

}  // namespace palpate::testing
