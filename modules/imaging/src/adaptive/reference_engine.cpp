#include "../parallel_parts.hpp"
#include "engine.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace palpate::imaging::adaptive {
namespace {

using Row = Eigen::Map<Eigen::ArrayXd>;
using ConstRow = Eigen::Map<const Eigen::ArrayXd>;

class ReferenceEngine final : public Engine {
 public:
  ReferenceEngine(const Design& design, const Remap& remap) : design_(design), remap_(remap) {
    for (std::size_t k = 0; k < 6; ++k) duals_[k] = dual_tensor(directions()[k]);
  }

  void run(const std::vector<float>& padded, const std::array<int, 3>& block, std::vector<float>& result,
           const core::Progress& progress) override {
    stop_ = core::Progress({}, progress.cancel());
    block_ = block;
    const auto margin = design_.margin();
    for (std::size_t axis = 0; axis < 3; ++axis) dims_[axis] = block[axis] + 2 * margin[axis];
    const std::size_t size = padded.size();
    scratch_.assign(size, 0.0);
    scratch2_.assign(size, 0.0);
    input_.assign(padded.begin(), padded.end());
    for (auto* six : {&tensor_, &highpass_})
      for (auto& component : *six) component.assign(size, 0.0);
    progress.report(0.0, what_);
    std::vector<double> level(size);
    blur(input_, level, design_.quadrature_blur, design_.quadrature_margin());
    estimate_tensor(level, progress.part(0.05, 0.6));
    for (auto& component : tensor_) blur(component, component, design_.tensor_blur, {0, 0, 0});
    progress.report(0.8, what_);
    level = input_;
    for (std::size_t n = 0; n < design_.levels.size(); ++n) {
      blur(level, level, design_.levels[n].blur, design_.level_margin(n));
      add_highpass(level, design_.levels[n]);
    }
    progress.report(0.95, what_);
    combine(level, result);
    progress.report(1.0, what_);
  }

 private:
  using Field = std::vector<double>;
  using Margin = std::array<int, 3>;

  /// Where the row of the region `margin` around the block begins.
  std::size_t row_begin(const Margin& margin, int j, int k) const {
    const auto whole = design_.margin();
    const auto at = [&](std::size_t axis, int n) {
      return static_cast<std::size_t>(whole[axis] - margin[axis] + n);
    };
    const auto row = static_cast<std::size_t>(dims_[0]);
    return (at(2, k) * static_cast<std::size_t>(dims_[1]) + at(1, j)) * row + at(0, 0);
  }
  std::ptrdiff_t stride(std::size_t axis) const {
    std::ptrdiff_t result = 1;
    for (std::size_t n = 0; n < axis; ++n) result *= dims_[n];
    return result;
  }
  std::ptrdiff_t offset(const Tap& tap, const Tap& step) const {
    std::ptrdiff_t result = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) result += stride(axis) * tap[axis] * step[axis];
    return result;
  }
  template <typename Work>  // work(first voxel of the row, its length)
  void for_rows(const Margin& margin, const core::Progress& progress, const Work& work) const {
    const int rows = block_[1] + 2 * margin[1];
    const auto each = [&](int n) {
      const int j = n % rows;
      const int k = n / rows;
      work(row_begin(margin, j, k), static_cast<Eigen::Index>(block_[0] + 2 * margin[0]));
    };
    for_each_part(rows * (block_[2] + 2 * margin[2]), progress, what_, each);
  }

  void blur_axis(const Field& from, Field& to, const BlurKernel& kernel, std::size_t axis,
                 const Margin& margin) const {
    const int radius = radius_of(kernel);
    for_rows(margin, stop_, [&](std::size_t begin, Eigen::Index length) {
      Row sum(to.data() + begin, length);
      const double* const centre = from.data() + begin;
      sum = kernel[static_cast<std::size_t>(radius)] * ConstRow(centre, length);
      for (int x = 1; x <= radius; ++x)
        sum += kernel[static_cast<std::size_t>(radius + x)] *
               (ConstRow(centre + x * stride(axis), length) + ConstRow(centre - x * stride(axis), length));
    });
  }
  /// `to` may be `from`. Right on the block and `margin` around it.
  void blur(const Field& from, Field& to, const Blur& kernels, const Margin& margin) {
    const int across_k = margin[2] + radius_of(kernels[2]);
    blur_axis(from, scratch_, kernels[0], 0, {margin[0], margin[1] + radius_of(kernels[1]), across_k});
    blur_axis(scratch_, scratch2_, kernels[1], 1, {margin[0], margin[1], across_k});
    blur_axis(scratch2_, to, kernels[2], 2, margin);
  }

  void estimate_tensor(const Field& blurred, const core::Progress& progress) {
    std::vector<std::ptrdiff_t> offsets;
    for (const Tap& tap : design_.quadrature_taps) offsets.push_back(offset(tap, design_.step));
    for_rows(design_.tensor_margin(), progress, [&](std::size_t begin, Eigen::Index length) {
      using Block = Eigen::Array<double, Eigen::Dynamic, 6>;
      const double* const centre = blurred.data() + begin;
      Block even(length, 6);
      Block odd = Block::Zero(length, 6);
      for (Eigen::Index k = 0; k < 6; ++k) even.col(k) = design_.even_centre[k] * ConstRow(centre, length);
      Eigen::ArrayXd sum(length);
      Eigen::ArrayXd difference(length);
      for (std::size_t n = 0; n < offsets.size(); ++n) {
        const ConstRow after(centre + offsets[n], length);
        const ConstRow before(centre - offsets[n], length);
        sum = after + before;
        difference = after - before;
        const auto tap = static_cast<Eigen::Index>(n);
        for (Eigen::Index k = 0; k < 6; ++k) {
          even.col(k) += design_.even(tap, k) * sum;
          odd.col(k) += design_.odd(tap, k) * difference;
        }
      }
      const Block magnitude = (even.square() + odd.square()).sqrt();
      for (std::size_t c = 0; c < 6; ++c) {
        Row component(tensor_[c].data() + begin, length);
        component.setZero();
        for (std::size_t k = 0; k < 6; ++k)
          component += duals_[k][c] * magnitude.col(static_cast<Eigen::Index>(k));
      }
    });
  }

  void add_highpass(const Field& level, const Level& weights) {
    const Six centre_weights = -2.0 * weights.weights.colwise().sum();
    std::vector<std::ptrdiff_t> offsets;
    for (const Tap& tap : design_.highpass_taps) offsets.push_back(offset(tap, {1, 1, 1}));
    for_rows({0, 0, 0}, stop_, [&](std::size_t begin, Eigen::Index length) {
      const double* const centre = level.data() + begin;
      Eigen::ArrayXd sum(length);
      for (Eigen::Index c = 0; c < 6; ++c)
        Row(highpass_[static_cast<std::size_t>(c)].data() + begin, length) +=
            centre_weights[c] * ConstRow(centre, length);
      for (std::size_t n = 0; n < offsets.size(); ++n) {
        sum = ConstRow(centre + offsets[n], length) + ConstRow(centre - offsets[n], length);
        for (Eigen::Index c = 0; c < 6; ++c)
          Row(highpass_[static_cast<std::size_t>(c)].data() + begin, length) +=
              weights.weights(static_cast<Eigen::Index>(n), c) * sum;
      }
    });
  }

  Eigen::Matrix3d control_tensor(const Eigen::Matrix3d& tensor, double brightness) const {
    constexpr double tiny = 1e-30;
    const double size = tensor.diagonal().cwiseAbs().sum() + tiny;
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.compute(tensor / size);
    const Eigen::Vector3d lambda = solver.eigenvalues().cwiseMax(0.0);  // ascending
    const auto mu = [](double smaller, double larger) {
      const double r = smaller / (larger + tiny);
      return r * r / (r * r + (1.0 - r) * (1.0 - r));
    };
    const double x = lambda[2] * size / (remap_.contrast * (std::abs(brightness) + remap_.floor) + tiny);
    const double first = x * x / (x * x + 1.0);
    const double second = first * mu(lambda[1], lambda[2]);
    const double third = second * mu(lambda[0], lambda[1]);
    const auto& e = solver.eigenvectors();
    return first * e.col(2) * e.col(2).transpose() + second * e.col(1) * e.col(1).transpose() +
           third * e.col(0) * e.col(0).transpose();
  }

  void combine(const Field& lowpass, std::vector<float>& result) const {
    result.resize(static_cast<std::size_t>(block_[0]) * static_cast<std::size_t>(block_[1]) *
                  static_cast<std::size_t>(block_[2]));
    const auto row_length = static_cast<std::size_t>(block_[0]);
    for_each_part(block_[1] * block_[2], stop_, what_, [&](int n) {
      const std::size_t begin = row_begin({0, 0, 0}, n % block_[1], n / block_[1]);
      float* const row = result.data() + static_cast<std::size_t>(n) * row_length;
      for (std::size_t i = 0; i < row_length; ++i) row[i] = combined(begin + i, lowpass[begin + i]);
    });
  }
  float combined(std::size_t at, double lowpass) const {
    const auto& t = tensor_;
    const auto& hp = highpass_;
    Eigen::Matrix3d tensor;
    tensor << t[0][at], t[3][at], t[4][at], t[3][at], t[1][at], t[5][at], t[4][at], t[5][at], t[2][at];
    const Eigen::Matrix3d c = control_tensor(tensor, lowpass);
    const double sum = input_[at] + (c(0, 0) - 1.0) * hp[0][at] + (c(1, 1) - 1.0) * hp[1][at] +
                       (c(2, 2) - 1.0) * hp[2][at] +
                       2.0 * (c(0, 1) * hp[3][at] + c(0, 2) * hp[4][at] + c(1, 2) * hp[5][at]);
    return std::clamp(static_cast<float>(sum), remap_.low, remap_.high);
  }

  static constexpr const char* what_ = "Adaptive filter";
  Design design_;
  Remap remap_;
  std::array<std::array<double, 6>, 6> duals_{};
  core::Progress stop_;  ///< tells nobody, but stops
  std::array<int, 3> block_{};
  std::array<int, 3> dims_{};
  Field input_, scratch_, scratch2_;
  std::array<Field, 6> tensor_, highpass_;
};

}  // namespace

std::unique_ptr<Engine> make_reference_engine(const Design& design, const Remap& remap) {
  return std::make_unique<ReferenceEngine>(design, remap);
}

}  // namespace palpate::imaging::adaptive
