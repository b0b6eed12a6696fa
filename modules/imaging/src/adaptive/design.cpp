#include "design.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace palpate::imaging::adaptive {
namespace {

constexpr double pi = 3.14159265358979323846;

// Of the quadrature filters, in units of the scale s (the lowpass filter's
// standard deviation): where they are most sensitive, and how wide.
constexpr double centre_frequency_scales = 1.2;  ///< rho0 = 1.2 / s
constexpr double bandwidth_octaves = 2.0;        ///< B
constexpr double quadrature_blur_scales = 0.5;
constexpr double tap_distance_scales = 0.7;
constexpr int quadrature_radius = 3;
constexpr double judged_share = 0.7;  ///< of the Nyquist frequency, where the fit is judged

BlurKernel gaussian(double sigma_voxels) {
  // Under a fifth of a voxel the neighbours weigh less than 4e-6.
  if (sigma_voxels < 0.2) return {1.0};
  const int radius = static_cast<int>(std::ceil(3.0 * sigma_voxels));
  BlurKernel kernel;
  double sum = 0.0;
  for (int x = -radius; x <= radius; ++x) {
    kernel.push_back(std::exp(-0.5 * x * x / (sigma_voxels * sigma_voxels)));
    sum += kernel.back();
  }
  for (double& weight : kernel) weight /= sum;
  return kernel;
}

double response(const BlurKernel& kernel, double radians_per_voxel) {
  const int radius = radius_of(kernel);
  double sum = 0.0;
  for (int x = -radius; x <= radius; ++x)
    sum += kernel[static_cast<std::size_t>(x + radius)] * std::cos(radians_per_voxel * x);
  return sum;
}

/// What a fit knows of the grid.
struct Grid {
  Eigen::Vector3d spacing_mm;
  std::array<bool, 3> flat;

  Blur blur(double sigma_mm) const {
    Blur result;
    for (std::size_t axis = 0; axis < 3; ++axis)
      result[axis] = flat[axis] ? BlurKernel{1.0} : gaussian(sigma_mm / spacing_mm[static_cast<int>(axis)]);
    return result;
  }
  double response(const Blur& kernels, const Eigen::Vector3d& frequency) const {
    double product = 1.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto n = static_cast<Eigen::Index>(axis);
      product *= adaptive::response(kernels[axis], frequency[n] * spacing_mm[n]);
    }
    return product;
  }
  /// Half of a lattice of frequencies (rad/mm) around zero up to the limit along each axis.
  std::vector<Eigen::Vector3d> frequencies(int half_count, const Eigen::Vector3d& limit) const {
    std::array<int, 3> n{};
    for (std::size_t axis = 0; axis < 3; ++axis) n[axis] = flat[axis] ? 0 : half_count;
    std::vector<Eigen::Vector3d> result;
    for (int c = 0; c <= n[2]; ++c)
      for (int b = -n[1]; b <= n[1]; ++b)
        for (int a = -n[0]; a <= n[0]; ++a)
          if (c > 0 || b > 0 || (b == 0 && a >= 0))
            result.emplace_back(Eigen::Vector3d(a, b, c).cwiseProduct(limit) / half_count);
    return result;
  }
  Eigen::Vector3d nyquist() const { return pi * spacing_mm.cwiseInverse(); }
  bool is_judged(const Eigen::Vector3d& frequency) const {
    return frequency.cwiseAbs().cwiseQuotient(nyquist()).maxCoeff() <= judged_share + 1e-9;
  }
  /// The half of a block of taps that comes after its centre.
  std::vector<Tap> half_taps(int radius) const {
    std::array<int, 3> r{};
    for (std::size_t axis = 0; axis < 3; ++axis) r[axis] = flat[axis] ? 0 : radius;
    std::vector<Tap> taps;
    for (int c = 0; c <= r[2]; ++c)
      for (int b = -r[1]; b <= r[1]; ++b)
        for (int a = -r[0]; a <= r[0]; ++a)
          if (c > 0 || b > 0 || (b == 0 && a > 0)) taps.push_back({a, b, c});
    return taps;
  }
};

/// Least squares with a trace of damping, so that taps which the data does
/// not settle (they cancel each other) stay small.
Eigen::MatrixXd solved(const Eigen::MatrixXd& responses, const Eigen::MatrixXd& ideal) {
  Eigen::MatrixXd normal = responses.transpose() * responses;
  normal.diagonal().array() += 1e-7 * normal.trace() / static_cast<double>(normal.rows());
  return normal.ldlt().solve(responses.transpose() * ideal);
}

/// Root of the missed share of energy over the judged frequencies.
double missed(const Eigen::MatrixXd& got, const Eigen::MatrixXd& ideal, const std::vector<bool>& judged) {
  double wrong = 0.0;
  double all = 0.0;
  for (Eigen::Index row = 0; row < got.rows(); ++row)
    if (judged[static_cast<std::size_t>(row)]) {
      wrong += (got.row(row) - ideal.row(row)).squaredNorm();
      all += ideal.row(row).squaredNorm();
    }
  return all > 0.0 ? std::sqrt(wrong / all) : 0.0;
}

/// Pictures have about as much energy in every octave; the more a frequency
/// carries, the better the fit must be there. Zero is met nearly exactly.
double spectral_weight(double relative_frequency, double exponent) {
  return relative_frequency > 0.0 ? std::pow(relative_frequency + 0.2, -exponent) : 50.0;
}

/// The blur and the places of the taps; fit_quadrature() weighs them.
void place_quadrature(const Grid& grid, double scale_mm, Design& result) {
  result.quadrature_blur = grid.blur(quadrature_blur_scales * scale_mm);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double steps = tap_distance_scales * scale_mm / grid.spacing_mm[static_cast<int>(axis)];
    result.step[axis] = std::max(1, static_cast<int>(std::lround(steps)));
  }
  result.quadrature_taps = grid.half_taps(quadrature_radius);
}

void fit_quadrature(const Grid& grid, double scale_mm, Design& result) {
  const double rho0 = centre_frequency_scales / scale_mm;
  const double blur_mm = quadrature_blur_scales * scale_mm;
  const auto& taps = result.quadrature_taps;
  // Beyond 3.5 standard deviations the blur lets 0.2 % through: nothing to fit.
  const Eigen::Vector3d limit = grid.nyquist().cwiseMin(3.5 / blur_mm);
  const auto frequencies = grid.frequencies(8, limit);
  const auto rows = static_cast<Eigen::Index>(frequencies.size());
  const auto count = static_cast<Eigen::Index>(taps.size());
  Eigen::MatrixXd cosines(rows, count + 1);
  Eigen::MatrixXd sines(rows, count);
  Eigen::MatrixXd ideal_even(rows, 6);
  Eigen::MatrixXd ideal_odd(rows, 6);
  std::vector<bool> judged;
  const Eigen::Vector3d step_mm =
      grid.spacing_mm.cwiseProduct(Eigen::Vector3d(result.step[0], result.step[1], result.step[2]));
  for (Eigen::Index row = 0; row < rows; ++row) {
    const Eigen::Vector3d& frequency = frequencies[static_cast<std::size_t>(row)];
    const double rho = frequency.norm();
    const double weight = spectral_weight(rho / rho0, 0.5);
    const double passed = weight * grid.response(result.quadrature_blur, frequency);
    for (Eigen::Index n = 0; n < count; ++n) {
      const Tap& tap = taps[static_cast<std::size_t>(n)];
      const double phase = frequency.dot(step_mm.cwiseProduct(Eigen::Vector3d(tap[0], tap[1], tap[2])));
      cosines(row, n) = 2.0 * passed * std::cos(phase);
      sines(row, n) = 2.0 * passed * std::sin(phase);
    }
    cosines(row, count) = passed;
    const double octaves = rho > 0.0 ? std::log(rho / rho0) : 0.0;
    const double radial =
        rho > 0.0
            ? std::exp(-4.0 * octaves * octaves / (bandwidth_octaves * bandwidth_octaves * std::log(2.0)))
            : 0.0;
    for (std::size_t k = 0; k < 6; ++k) {
      const double along = rho > 0.0 ? frequency.dot(directions()[k]) / rho : 0.0;
      ideal_even(row, static_cast<Eigen::Index>(k)) = weight * radial * along * along;
      ideal_odd(row, static_cast<Eigen::Index>(k)) = weight * radial * along * std::abs(along);
    }
    judged.push_back(grid.is_judged(frequency));
  }
  const Eigen::MatrixXd even = solved(cosines, ideal_even);
  const Eigen::MatrixXd odd = solved(sines, ideal_odd);
  result.fit.quadrature_even = missed(cosines * even, ideal_even, judged);
  result.fit.quadrature_odd = missed(sines * odd, ideal_odd, judged);
  result.even = even.topRows(count);
  result.odd = odd;
  // The centre makes up for the rest: a constant has no structure.
  result.even_centre = -2.0 * result.even.colwise().sum();
}

/// Blurred copies of the volume, each twice as wide as the one before.
void place_highpass(const Grid& grid, double scale_mm, double finest_mm, Design& result) {
  std::vector<double> sigmas_mm;
  for (double sigma = scale_mm; sigma > 0.4 * finest_mm; sigma /= 2.0) sigmas_mm.push_back(sigma);
  sigmas_mm.push_back(0.0);
  std::reverse(sigmas_mm.begin(), sigmas_mm.end());
  result.highpass_taps = grid.half_taps(1);
  result.levels.resize(sigmas_mm.size());
  for (std::size_t n = 0; n < sigmas_mm.size(); ++n) {
    const double before = n == 0 ? 0.0 : sigmas_mm[n - 1];
    result.levels[n].blur = grid.blur(std::sqrt(sigmas_mm[n] * sigmas_mm[n] - before * before));
  }
}

/// u_i u_j (1 - exp(-rho^2 s^2 / 2)) out of second differences of the copies.
void fit_highpass(const Grid& grid, double scale_mm, Design& result) {
  const auto& taps = result.highpass_taps;
  const auto count = static_cast<Eigen::Index>(taps.size());
  const auto frequencies = grid.frequencies(8, grid.nyquist());
  const auto rows = static_cast<Eigen::Index>(frequencies.size());
  const auto levels = static_cast<Eigen::Index>(result.levels.size());
  Eigen::MatrixXd responses(rows, count * levels);
  Eigen::MatrixXd ideal(rows, 6);
  std::vector<bool> judged;
  constexpr std::array<std::array<int, 2>, 6> axes{{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
  for (Eigen::Index row = 0; row < rows; ++row) {
    const Eigen::Vector3d& frequency = frequencies[static_cast<std::size_t>(row)];
    const double rho = frequency.norm();
    const double weight = spectral_weight(rho * scale_mm, 1.0);
    double passed = weight;
    for (Eigen::Index level = 0; level < levels; ++level) {
      passed *= grid.response(result.levels[static_cast<std::size_t>(level)].blur, frequency);
      for (Eigen::Index n = 0; n < count; ++n) {
        const Tap& tap = taps[static_cast<std::size_t>(n)];
        const double phase =
            frequency.dot(grid.spacing_mm.cwiseProduct(Eigen::Vector3d(tap[0], tap[1], tap[2])));
        responses(row, level * count + n) = 2.0 * passed * (std::cos(phase) - 1.0);
      }
    }
    const double high = 1.0 - std::exp(-0.5 * rho * rho * scale_mm * scale_mm);
    for (std::size_t k = 0; k < 6; ++k)
      ideal(row, static_cast<Eigen::Index>(k)) =
          rho > 0.0 ? weight * high * frequency[axes[k][0]] * frequency[axes[k][1]] / (rho * rho) : 0.0;
    judged.push_back(grid.is_judged(frequency));
  }
  const Eigen::MatrixXd weights = solved(responses, ideal);
  result.fit.highpass = missed(responses * weights, ideal, judged);
  for (Eigen::Index level = 0; level < levels; ++level)
    result.levels[static_cast<std::size_t>(level)].weights = weights.middleRows(level * count, count);
}

void check(double value, AdaptiveLimits limits, const char* what) {
  if (std::isfinite(value) && value >= limits.low && value <= limits.high) return;
  core::throw_usage(std::string("The adaptive filter's ") + what + " is " + std::to_string(value) +
                    "; it must be from " + std::to_string(limits.low) + " to " + std::to_string(limits.high) +
                    ".");
}

std::array<int, 3> radii(const Blur& blur) {
  return {radius_of(blur[0]), radius_of(blur[1]), radius_of(blur[2])};
}

}  // namespace

const std::array<Eigen::Vector3d, 6>& directions() {
  static const std::array<Eigen::Vector3d, 6> six = [] {
    const double a = 2.0;
    const double b = 1.0 + std::sqrt(5.0);
    const double c = 1.0 / std::sqrt(10.0 + 2.0 * std::sqrt(5.0));
    using V = Eigen::Vector3d;
    return std::array<V, 6>{V(0, a, b) * c,  V(0, -a, b) * c, V(a, b, 0) * c,
                            V(-a, b, 0) * c, V(b, 0, a) * c,  V(b, 0, -a) * c};
  }();
  return six;
}

std::array<double, 6> dual_tensor(const Eigen::Vector3d& n) {
  return {1.25 * n.x() * n.x() - 0.25, 1.25 * n.y() * n.y() - 0.25, 1.25 * n.z() * n.z() - 0.25,
          1.25 * n.x() * n.y(),        1.25 * n.x() * n.z(),        1.25 * n.y() * n.z()};
}

std::array<int, 3> Design::tensor_margin() const { return radii(tensor_blur); }

std::array<int, 3> Design::quadrature_margin() const {
  auto margin = tensor_margin();
  for (std::size_t axis = 0; axis < 3; ++axis)
    margin[axis] += flat[axis] ? 0 : quadrature_radius * step[axis];
  return margin;
}

std::array<int, 3> Design::level_margin(std::size_t level) const {
  std::array<int, 3> margin{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    margin[axis] = flat[axis] ? 0 : 1;
    for (std::size_t n = level + 1; n < levels.size(); ++n) margin[axis] += radius_of(levels[n].blur[axis]);
  }
  return margin;
}

std::array<int, 3> Design::margin() const {
  auto margin = quadrature_margin();
  const auto highpass = level_margin(0);
  for (std::size_t axis = 0; axis < 3; ++axis)
    margin[axis] = std::max(margin[axis] + radius_of(quadrature_blur[axis]), highpass[axis]);
  return margin;
}

Design layout(const core::ImageGeometry& geometry, const AdaptiveParameters& parameters) {
  check(parameters.contrast_percent, adaptive_contrast_percent, "contrast_percent");
  check(parameters.scale_voxels, adaptive_scale_voxels, "scale_voxels");
  check(parameters.neighbourhood_scales, adaptive_neighbourhood_scales, "neighbourhood_scales");
  check(parameters.passes, adaptive_passes, "passes");
  Design result;
  double finest_mm = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result.flat[axis] = geometry.dims()[axis] == 1;
    const double spacing = geometry.spacing_mm()[static_cast<int>(axis)];
    if (!result.flat[axis]) finest_mm = finest_mm == 0.0 ? spacing : std::min(finest_mm, spacing);
  }
  if (finest_mm == 0.0) finest_mm = geometry.spacing_mm().minCoeff();
  result.scale_mm = parameters.scale_voxels * finest_mm;
  const Grid grid{geometry.spacing_mm(), result.flat};
  place_quadrature(grid, result.scale_mm, result);
  result.tensor_blur = grid.blur(parameters.neighbourhood_scales * result.scale_mm);
  place_highpass(grid, result.scale_mm, finest_mm, result);
  return result;
}

Design design(const core::ImageGeometry& geometry, const AdaptiveParameters& parameters) {
  Design result = layout(geometry, parameters);
  const Grid grid{geometry.spacing_mm(), result.flat};
  fit_quadrature(grid, result.scale_mm, result);
  fit_highpass(grid, result.scale_mm, result);
  // A step along n gives |q_k| = (n.n_k)^2 A and so T = A n nT with
  // A = 1/pi times the integral of the radial part over ln rho.
  result.step_response = bandwidth_octaves / 2.0 * std::sqrt(std::log(2.0) / pi);
  return result;
}

}  // namespace palpate::imaging::adaptive
