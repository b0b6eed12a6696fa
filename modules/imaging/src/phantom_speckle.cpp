#include "phantom_speckle.hpp"

#include <cmath>

namespace palpate::imaging {
namespace {

constexpr double pulse_mm = 1.1;               ///< between nodes along the beam
constexpr double beam_tangent = 0.034;         ///< between nodes across it
constexpr double mean_root_envelope = 1.0778;  ///< 2^(1/4) Gamma(5/4): of the root of a Rayleigh variable

/// Weights of the quadratic B-spline on three nodes, scaled so that the sum
/// of unit-variance noise keeps unit variance wherever it is taken.
struct Weights {
  explicit Weights(double place) {
    const double nearest = std::floor(place + 0.5);
    const double t = place - nearest;
    first = static_cast<long>(nearest) - 1;
    const double a = 0.5 * (0.5 - t) * (0.5 - t);
    const double c = 0.5 * (0.5 + t) * (0.5 + t);
    const double b = 1.0 - a - c;
    const double scale = 1.0 / std::sqrt(a * a + b * b + c * c);
    weight = {a * scale, b * scale, c * scale};
  }
  long first;
  std::array<double, 3> weight{};
};

/// Nearly normal, mean 0 and variance 1, from 32 bits: two uniform 16-bit numbers added.
float noise(std::uint64_t bits) {
  const auto sum = static_cast<double>((bits & 0xFFFFU) + ((bits >> 16U) & 0xFFFFU));
  constexpr double root_of_six = 2.449489742783178;
  return static_cast<float>((sum / 65535.0 - 1.0) * root_of_six);
}

}  // namespace

std::uint64_t hashed(std::uint64_t seed, std::uint64_t counter) {
  std::uint64_t x = (seed + 1) * 0xD1342543DE82EF95ULL + counter * 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31U);
}

Speckle::Speckle(std::uint64_t seed)
    : nodes_(static_cast<std::size_t>(axial_nodes) * lateral_nodes * lateral_nodes) {
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    const std::uint64_t bits = hashed(seed, n);
    nodes_[n] = {noise(bits & 0xFFFFFFFFU), noise(bits >> 32U)};
  }
}

double Speckle::at(const Eigen::Vector3d& from_probe, std::uint64_t shift) const {
  const Weights axial(from_probe.norm() / pulse_mm + static_cast<double>(shift % 89 * 17));
  const Weights lateral(from_probe.x() / from_probe.y() / beam_tangent +
                        static_cast<double>(shift % 83 * 29));
  const Weights elevational(from_probe.z() / from_probe.y() / beam_tangent +
                            static_cast<double>(shift % 79 * 11));
  // Both counts are powers of two: the field repeats where nobody sees it.
  const auto wrapped = [](long node, int count) {
    return static_cast<std::size_t>(static_cast<unsigned long>(node) & static_cast<unsigned long>(count - 1));
  };
  double real = 0.0;
  double imaginary = 0.0;
  for (std::size_t e = 0; e < 3; ++e)
    for (std::size_t l = 0; l < 3; ++l) {
      const std::size_t row =
          (wrapped(elevational.first + static_cast<long>(e), lateral_nodes) * lateral_nodes +
           wrapped(lateral.first + static_cast<long>(l), lateral_nodes)) *
          axial_nodes;
      const double across = elevational.weight[e] * lateral.weight[l];
      for (std::size_t a = 0; a < 3; ++a) {
        const auto& node = nodes_[row + wrapped(axial.first + static_cast<long>(a), axial_nodes)];
        const double weight = across * axial.weight[a];
        real += weight * static_cast<double>(node[0]);
        imaginary += weight * static_cast<double>(node[1]);
      }
    }
  return std::sqrt(std::sqrt(real * real + imaginary * imaginary)) / mean_root_envelope;
}

}  // namespace palpate::imaging
