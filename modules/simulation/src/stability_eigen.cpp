#include "stability_eigen.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace palpate::simulation {

namespace {

constexpr int fewest_passes = 12;
constexpr int most_passes = 150;
constexpr int look_back = 5;
/// The largest shortfall seen on 50 random models and lattices was 1.9 %.
constexpr double margin = 0.025;

using Vector = std::vector<float>;

/// Uniform in [-1, 1), the same on every machine.
float noise_of(std::size_t index) {
  std::uint64_t z = (static_cast<std::uint64_t>(index) + 1U) * 0x9e3779b97f4a7c15U;
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
  z ^= z >> 31U;
  return static_cast<float>(z >> 40U) / 8388608.0F - 1.0F;
}

/// The vectors of the iteration: the best so far, its residual, the last
/// direction, and what the matrix makes of each.
struct Basis {
  explicit Basis(std::size_t size) : x(size), r(size), p(size), ax(size), ar(size), ap(size) {}
  Vector x, r, p, ax, ar, ap;
};

/// Gram matrices of the basis: the plain one, and that of the matrix.
struct Grams {
  Eigen::Matrix3d plain = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
};

Grams grams_of(const Basis& b, const Slices& slices) {
  std::array<Grams, Slices::count> parts;
  slices.run([&](std::size_t slice) {
    constexpr std::size_t block = 512;  // sums in float over a block, in double over the blocks
    std::array<double, 12> sums{};
    for (std::size_t from = 3 * slices.begin(slice); from < 3 * slices.end(slice); from += block) {
      const std::size_t to = std::min(from + block, 3 * slices.end(slice));
      std::array<float, 12> s{};
      for (std::size_t n = from; n < to; ++n) {
        const float x = b.x[n], r = b.r[n], p = b.p[n];
        s[0] += x * x, s[1] += x * r, s[2] += x * p, s[3] += r * r, s[4] += r * p, s[5] += p * p;
        s[6] += x * b.ax[n], s[7] += r * b.ax[n], s[8] += p * b.ax[n];
        s[9] += r * b.ar[n], s[10] += p * b.ar[n], s[11] += p * b.ap[n];
      }
      for (std::size_t n = 0; n < s.size(); ++n) sums[n] += static_cast<double>(s[n]);
    }
    parts[slice].plain << sums[0], sums[1], sums[2], sums[1], sums[3], sums[4], sums[2], sums[4], sums[5];
    parts[slice].matrix << sums[6], sums[7], sums[8], sums[7], sums[9], sums[10], sums[8], sums[10], sums[11];
  });
  Grams all;
  for (const auto& part : parts) {
    all.plain += part.plain;
    all.matrix += part.matrix;
  }
  return all;
}

struct Best {
  double value = 0.0;
  Eigen::Vector3d weights = Eigen::Vector3d::UnitX();
};
/// The largest Rayleigh quotient in the span of the basis; what depends on the
/// others but for rounding is left out.
Best best_of(const Grams& grams) {
  Eigen::Vector3d scale = Eigen::Vector3d::Zero();
  for (int n = 0; n < 3; ++n)
    if (grams.plain(n, n) > 0.0) scale[n] = 1.0 / std::sqrt(grams.plain(n, n));
  const Eigen::Matrix3d plain = scale.asDiagonal() * grams.plain * scale.asDiagonal();
  const Eigen::Matrix3d matrix = scale.asDiagonal() * grams.matrix * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> spans(plain);
  // Directions of the span that are more than rounding of float sums.
  std::vector<Eigen::Vector3d> kept;
  for (int n = 0; n < 3; ++n)
    if (spans.eigenvalues()[n] > 1e-5)
      kept.emplace_back(spans.eigenvectors().col(n) / std::sqrt(spans.eigenvalues()[n]));
  Eigen::MatrixXd to_basis(3, static_cast<Eigen::Index>(kept.size()));
  for (std::size_t n = 0; n < kept.size(); ++n) to_basis.col(static_cast<Eigen::Index>(n)) = kept[n];
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solved(to_basis.transpose() * matrix * to_basis);
  const Eigen::Index last = solved.eigenvalues().size() - 1;
  return {solved.eigenvalues()[last], scale.asDiagonal() * (to_basis * solved.eigenvectors().col(last))};
}

/// x and p become the best of the span and its new part, r the residual.
double step_to(const Best& best, Basis& b, const Slices& slices) {
  const auto cx = static_cast<float>(best.weights[0]);
  const auto cr = static_cast<float>(best.weights[1]);
  const auto cp = static_cast<float>(best.weights[2]);
  const auto value = static_cast<float>(best.value);
  std::array<double, Slices::count> residual{};
  slices.run([&](std::size_t slice) {
    double sum = 0.0;
    for (std::size_t n = 3 * slices.begin(slice); n < 3 * slices.end(slice); ++n) {
      b.p[n] = cr * b.r[n] + cp * b.p[n];
      b.ap[n] = cr * b.ar[n] + cp * b.ap[n];
      b.x[n] = cx * b.x[n] + b.p[n];
      b.ax[n] = cx * b.ax[n] + b.ap[n];
      b.r[n] = b.ax[n] - value * b.x[n];
      sum += static_cast<double>(b.r[n]) * static_cast<double>(b.r[n]);
    }
    residual[slice] = sum;
  });
  double sum = 0.0;
  for (const double part : residual) sum += part;
  return std::sqrt(sum);
}

void set_start(Basis& b, const Vector& weights, const Vector* mode, const Slices& slices) {
  const bool is_warm = mode != nullptr && mode->size() == b.x.size();
  // A tenth of noise beside the old vector finds what has come up elsewhere.
  const float noise = is_warm ? 0.1F / std::sqrt(static_cast<float>(b.x.size())) : 1.0F;
  slices.run([&](std::size_t slice) {
    for (std::size_t point = slices.begin(slice); point < slices.end(slice); ++point)
      for (std::size_t n = 3 * point; n < 3 * point + 3; ++n)
        b.x[n] = noise * weights[point] * noise_of(n) + (is_warm ? (*mode)[n] : 0.0F);
  });
}

std::size_t largest_point(const Vector& x) {
  std::size_t point = 0;
  float largest = -1.0F;
  for (std::size_t n = 0; n < x.size(); n += 3) {
    const float size = x[n] * x[n] + x[n + 1] * x[n + 1] + x[n + 2] * x[n + 2];
    if (size > largest) {
      largest = size;
      point = n / 3;
    }
  }
  return point;
}

}  // namespace

LinkOperator::LinkOperator(const StabilityField& field, const Slices& slices, Kind kind)
    : slices_(slices), pairs_(field.links().pairs), points_(field.points()), along_(pairs_.size()) {
  const bool by_stiffness = kind == Kind::stiffness;
  std::vector<float> across(by_stiffness ? pairs_.size() : 0, 0.0F);
  std::array<bool, Slices::count> stretched{};
  const double per_mass = field.equal_masses() && points_ > 0 ? 1.0 / field.mass(0) : 1.0;
  slices.run([&](std::size_t slice) {
    for (std::size_t n = slices.links_begin(slice); n < slices.links_end(slice); ++n) {
      const auto link = field.link(n);
      // k n n^T + across (I - n n^T) = (k - across) n n^T + across I
      const double acts = (by_stiffness ? link.stiffness - link.across : link.damping) * per_mass;
      along_[n] = (std::sqrt(acts) * link.direction).cast<float>();
      if (by_stiffness) across[n] = static_cast<float>(link.across * per_mass);
      stretched[slice] = stretched[slice] || link.across > 1e-5 * link.stiffness;
      if (pairs_[n][1] >= slices.end(slice)) crossing_[slice].push_back(static_cast<std::uint32_t>(n));
    }
  });
  if (by_stiffness && std::find(stretched.begin(), stretched.end(), true) != stretched.end())
    across_ = std::move(across);
  if (!field.equal_masses()) scale_.resize(points_);
  if (!by_stiffness) diagonal_.resize(points_);
  for (std::size_t n = 0; n < scale_.size(); ++n)
    scale_[n] = static_cast<float>(1.0 / std::sqrt(field.mass(n)));
  for (std::size_t n = 0; n < diagonal_.size(); ++n) diagonal_[n] = static_cast<float>(field.drag(n));
}

/// What the link adds at its first point; its second gets the opposite.
/// Plain: at rest, and masses are equal.
template <bool plain>
inline Eigen::Vector3f LinkOperator::pull_of(std::size_t link, const float* x) const {
  const auto [a, b] = pairs_[link];
  const Eigen::Map<const Eigen::Vector3f> first(x + 3 * static_cast<std::size_t>(a));
  const Eigen::Map<const Eigen::Vector3f> second(x + 3 * static_cast<std::size_t>(b));
  const Eigen::Vector3f& n = along_[link];
  if constexpr (plain) {
    return n * n.dot(first - second);
  } else {
    const Eigen::Vector3f apart = scale_.empty() ? Eigen::Vector3f(first - second)
                                                 : Eigen::Vector3f(scale_[a] * first - scale_[b] * second);
    if (across_.empty()) return n * n.dot(apart);
    return n * n.dot(apart) + across_[link] * apart;
  }
}

template <bool plain>
void LinkOperator::apply_slice(std::size_t slice, const float* x, float* y) const {
  const std::size_t end = slices_.end(slice);
  for (std::size_t point = slices_.begin(slice); point < end; ++point) {
    const float diagonal = diagonal_.empty() ? 0.0F : diagonal_[point];
    for (std::size_t n = 3 * point; n < 3 * point + 3; ++n) y[n] = diagonal * x[n];
  }
  for (std::size_t link = slices_.links_begin(slice); link < slices_.links_end(slice); ++link) {
    const auto [a, b] = pairs_[link];
    const Eigen::Vector3f pull = pull_of<plain>(link, x);
    const bool is_scaled = !plain && !scale_.empty();
    Eigen::Map<Eigen::Vector3f>(y + 3 * static_cast<std::size_t>(a)) += (is_scaled ? scale_[a] : 1.0F) * pull;
    if (b < end)
      Eigen::Map<Eigen::Vector3f>(y + 3 * static_cast<std::size_t>(b)) -=
          (is_scaled ? scale_[b] : 1.0F) * pull;
  }
}

void LinkOperator::apply(const float* x, float* y) const {
  if (across_.empty() && scale_.empty())
    slices_.run([&](std::size_t slice) { apply_slice<true>(slice, x, y); });
  else
    slices_.run([&](std::size_t slice) { apply_slice<false>(slice, x, y); });
  for (const auto& list : crossing_)
    for (const std::uint32_t link : list) {
      const std::uint32_t b = pairs_[link][1];
      const float scale = scale_.empty() ? 1.0F : scale_[b];
      Eigen::Map<Eigen::Vector3f>(y + 3 * static_cast<std::size_t>(b)) -= scale * pull_of<false>(link, x);
    }
}

TopEigenvalue largest_eigenvalue(const LinkOperator& matrix, const Slices& slices,
                                 const std::vector<float>& start, std::vector<float>* mode,
                                 const core::Progress& progress) {
  Basis b(matrix.size());
  set_start(b, start, mode, slices);
  TopEigenvalue top;
  matrix.apply(b.x.data(), b.ax.data());
  top.passes = 1;
  // The first step is to the start itself: it is made a unit vector.
  Best best = best_of(grams_of(b, slices));
  double residual = step_to(best, b, slices);
  std::vector<double> values{best.value};
  double promise = best.value;
  while (top.passes < most_passes) {
    progress.report(static_cast<double>(top.passes) / most_passes, "Largest stable step");
    if (!(residual > 1e-4 * best.value)) {
      promise = residual;
      break;
    }
    matrix.apply(b.r.data(), b.ar.data());
    ++top.passes;
    best = best_of(grams_of(b, slices));
    residual = step_to(best, b, slices);
    values.push_back(best.value);
    if (top.passes < fewest_passes) continue;
    // Where values lie densely the rest falls as 1/n^2: it is n/2 times the last growth.
    const double growth = (best.value - values[values.size() - 1 - look_back]) / look_back;
    promise = 0.5 * growth * top.passes;
    if (promise < 0.006 * best.value) break;
  }
  top.value = best.value + std::max(margin * best.value, 2.0 * promise);
  top.point = largest_point(b.x);
  if (mode != nullptr) *mode = std::move(b.x);
  return top;
}

}  // namespace palpate::simulation
