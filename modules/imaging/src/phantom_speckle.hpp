#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::imaging {

/// A word that depends on the counter and the seed alone.
std::uint64_t hashed(std::uint64_t seed, std::uint64_t counter);

/// The texture of coherent ultrasound: complex white noise on a grid in the
/// probe's coordinates, blurred by the pulse along the beam and by the
/// beam's width across it (wider with depth, since the grid is in tangents of
/// angles). The envelope of such a field is Rayleigh distributed.
class Speckle {
 public:
  explicit Speckle(std::uint64_t seed);
  /// Brightness with mean 1 at a place seen from the probe (y > 0 is depth),
  /// in mm: the square root of the envelope, as a display compresses it
  /// (standard deviation 0.28). Fields of another `shift` are unrelated.
  double at(const Eigen::Vector3d& from_probe, std::uint64_t shift) const;

 private:
  static constexpr int axial_nodes = 128;
  static constexpr int lateral_nodes = 64;
  std::vector<std::array<float, 2>> nodes_;
};

}  // namespace palpate::imaging
