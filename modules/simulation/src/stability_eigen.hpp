#pragma once

#include "stability_links.hpp"

#include "palpate/core/progress.hpp"

#include <cstddef>
#include <vector>

namespace palpate::simulation {

/// M^-1/2 K M^-1/2 (or C in place of K) of the links of a field, applied to a
/// vector of three numbers a point without being assembled.
class LinkOperator {
 public:
  enum class Kind { stiffness, damping };
  LinkOperator(const StabilityField& field, const Slices& slices, Kind kind);
  std::size_t size() const noexcept { return 3 * points_; }
  /// y = A x.
  void apply(const float* x, float* y) const;

 private:
  template <bool plain>
  void apply_slice(std::size_t slice, const float* x, float* y) const;
  template <bool plain>
  Eigen::Vector3f pull_of(std::size_t link, const float* x) const;

  const Slices& slices_;
  const std::vector<std::array<std::uint32_t, 2>>& pairs_;
  std::size_t points_;
  std::vector<Eigen::Vector3f> along_;  ///< the direction times the root of what acts along it
  std::vector<float> across_;           ///< empty at rest
  std::vector<float> scale_;            ///< 1/sqrt(m), one a point; empty where they are equal
  std::vector<float> diagonal_;         ///< drag, of the damping
  std::array<std::vector<std::uint32_t>, Slices::count> crossing_;
};

struct TopEigenvalue {
  double value = 0.0;     ///< with a margin of 2.5 %: above the true one, by no more than that
  std::size_t point = 0;  ///< where its vector is largest
  int passes = 0;         ///< over the links
};
/// The largest eigenvalue by locally optimal conjugate gradients (the best
/// vector in the span of the last one, its residual and the last direction).
/// Every Rayleigh quotient is below the true value; the iteration ends when
/// what its growth still promises is under 0.6 %, and what is returned lies above
/// the last by 2.5 %, or by twice that promise. `start`: a weight for each point,
/// larger where the vector is expected. `mode`: the vector of an earlier call,
/// or empty; replaced.
TopEigenvalue largest_eigenvalue(const LinkOperator& matrix, const Slices& slices,
                                 const std::vector<float>& start, std::vector<float>* mode,
                                 const core::Progress& progress);

}  // namespace palpate::simulation
