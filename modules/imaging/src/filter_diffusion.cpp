#include "filter_registry.hpp"
#include "parallel_parts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <sstream>
#include <utility>

// The two anisotropic diffusions and the curvature flow, with the differences
// of ITK's functions of these names (a test compares them). Not ITK's filters:
// those take the conductance anew from the whole image in each step, so that no
// slice can be had without the rest, only warn of a step that is not stable,
// and look for a request to stop once a step.

namespace palpate::imaging {
namespace {

/// The 27 values around a voxel; (0,0,0) is the voxel.
struct Stencil {
  std::array<double, 27> values;
  static constexpr std::array<int, 3> strides{1, 3, 9};
  double at(int axis, int a) const { return values[static_cast<std::size_t>(13 + a * strides[axis])]; }
  double at(int axis, int a, int other, int b) const {
    return values[static_cast<std::size_t>(13 + a * strides[axis] + b * strides[other])];
  }
};

/// First differences around a voxel, per mm.
struct Differences {
  std::array<double, 3> forward, backward, central;
  std::array<double, 3> squared_forward,
      squared_backward;  ///< of the gradient, at the faces half a voxel away
};

using Vector = std::array<double, 3>;

Differences differences_of(const Stencil& u, const Vector& per_mm) {
  Differences d{};
  for (int i = 0; i < 3; ++i) {
    d.forward[i] = (u.at(i, 1) - u.at(i, 0)) * per_mm[i];
    d.backward[i] = (u.at(i, 0) - u.at(i, -1)) * per_mm[i];
    d.central[i] = 0.5 * (u.at(i, 1) - u.at(i, -1)) * per_mm[i];
  }
  for (int i = 0; i < 3; ++i) {
    d.squared_forward[i] = d.forward[i] * d.forward[i];
    d.squared_backward[i] = d.backward[i] * d.backward[i];
    for (int j = 0; j < 3; ++j) {
      if (j == i) continue;
      const double ahead = 0.5 * (u.at(i, 1, j, 1) - u.at(i, 1, j, -1)) * per_mm[j];
      const double behind = 0.5 * (u.at(i, -1, j, 1) - u.at(i, -1, j, -1)) * per_mm[j];
      d.squared_forward[i] += 0.25 * (d.central[j] + ahead) * (d.central[j] + ahead);
      d.squared_backward[i] += 0.25 * (d.central[j] + behind) * (d.central[j] + behind);
    }
  }
  return d;
}

/// div(c grad u) with c = exp(-|grad u|^2 / (2 K)), in flux form: what leaves
/// a voxel through a face enters the next one.
double gradient_rate(const Stencil& u, const Vector& per_mm, double exponent) {
  const Differences d = differences_of(u, per_mm);
  double rate = 0.0;
  for (int i = 0; i < 3; ++i)
    rate += d.forward[i] * std::exp(d.squared_forward[i] * exponent) -
            d.backward[i] * std::exp(d.squared_backward[i] * exponent);
  return rate;
}

/// |grad u| div(c grad u / |grad u|), the modified curvature, upwind.
double curvature_rate(const Stencil& u, const Vector& per_mm, double exponent) {
  constexpr double least = 1e-10;  // keeps the unit normal finite where u is flat
  const Differences d = differences_of(u, per_mm);
  double speed = 0.0;
  for (int i = 0; i < 3; ++i)
    speed +=
        d.forward[i] / std::sqrt(least + d.squared_forward[i]) * std::exp(d.squared_forward[i] * exponent) -
        d.backward[i] / std::sqrt(least + d.squared_backward[i]) * std::exp(d.squared_backward[i] * exponent);
  double squared = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double in = speed > 0.0 ? std::min(d.backward[i], 0.0) : std::max(d.backward[i], 0.0);
    const double out = speed > 0.0 ? std::max(d.forward[i], 0.0) : std::min(d.forward[i], 0.0);
    squared += in * in + out * out;
  }
  return std::sqrt(squared) * speed;
}

/// Mean curvature times |grad u|: each surface of one value moves towards its
/// centre of curvature, a ball of radius r by 2/r.
double flow_rate(const Stencil& u, const Vector& per_mm, double) {
  Vector first{};
  Vector second{};
  double squared = 0.0;
  for (int i = 0; i < 3; ++i) {
    first[i] = 0.5 * (u.at(i, 1) - u.at(i, -1)) * per_mm[i];
    second[i] = (u.at(i, 1) - 2.0 * u.at(i, 0) + u.at(i, -1)) * per_mm[i] * per_mm[i];
    squared += first[i] * first[i];
  }
  if (squared < 1e-18) return 0.0;  // no direction to curve in
  double rate = 0.0;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    rate += (second[j] + second[k]) * first[i] * first[i];
    const double cross = 0.25 *
                         (u.at(i, 1, j, 1) - u.at(i, 1, j, -1) - u.at(i, -1, j, 1) + u.at(i, -1, j, -1)) *
                         per_mm[i] * per_mm[j];
    rate -= 2.0 * first[i] * first[j] * cross;
  }
  return rate / squared;
}

/// Fills the stencils along one row.
class Row {
 public:
  Row(const float* voxels, const core::ImageGeometry& geometry, int j, int k) : width_(geometry.dims()[0]) {
    for (int dk = -1; dk <= 1; ++dk)
      for (int dj = -1; dj <= 1; ++dj)
        rows_[static_cast<std::size_t>((dk + 1) * 3 + dj + 1)] =
            voxels + geometry.index(0, std::clamp(j + dj, 0, geometry.dims()[1] - 1),
                                    std::clamp(k + dk, 0, geometry.dims()[2] - 1));
  }
  Stencil at(int i) const {
    Stencil stencil{};
    const int before = std::max(i - 1, 0);
    const int after = std::min(i + 1, width_ - 1);
    for (std::size_t n = 0; n < 9; ++n) {
      stencil.values[3 * n] = rows_[n][before];
      stencil.values[3 * n + 1] = rows_[n][i];
      stencil.values[3 * n + 2] = rows_[n][after];
    }
    return stencil;
  }

 private:
  int width_;
  std::array<const float*, 9> rows_{};
};

Vector per_mm_of(const core::ImageGeometry& geometry) {
  return {1.0 / geometry.spacing_mm()[0], 1.0 / geometry.spacing_mm()[1], 1.0 / geometry.spacing_mm()[2]};
}

/// Mean squared gradient, per mm^2: the edge that a conductance of 1 stands
/// for. A few million voxels tell it; of more, each n-th row is taken.
std::vector<double> measure_gradient(const core::Volume& volume, const FilterParameters&,
                                     const core::Progress& progress) {
  constexpr std::size_t enough_voxels = std::size_t{4} << 20;
  const auto& dims = volume.dims();
  const auto per_mm = per_mm_of(volume.geometry());
  const int stride = static_cast<int>(volume.size() / enough_voxels) + 1;
  double sum = 0.0;
  std::size_t count = 0;
  for (int row = 0; row < dims[1] * dims[2]; row += stride) {
    if (row % 1024 < stride)
      progress.report(static_cast<double>(row) / (dims[1] * dims[2]), "Measuring edges");
    const Row stencils(volume.data(), volume.geometry(), row % dims[1], row / dims[1]);
    for (int i = 0; i < dims[0]; ++i, ++count) {
      const Stencil u = stencils.at(i);
      for (int axis = 0; axis < 3; ++axis) {
        const double slope = 0.5 * (u.at(axis, 1) - u.at(axis, -1)) * per_mm[static_cast<std::size_t>(axis)];
        sum += slope * slope;
      }
    }
  }
  return {sum / static_cast<double>(count)};
}

using Rate = double (*)(const Stencil&, const Vector&, double);

struct Flow {
  Rate rate;
  double largest_step;
  double exponent;       ///< of the conductance, times a squared gradient
  bool keep_in_between;  ///< hold each voxel between its neighbours' values
};

/// The step that is taken: the largest stable one where 0 or too much is asked for.
double checked_step(const FilterCall& call, const FilterDescription& filter, double largest) {
  const double asked = call.parameter("time_step");
  if (asked == 0.0) return largest;
  if (asked <= largest) return asked;
  std::ostringstream text;
  text << filter.title << ": a time step of " << asked << " is not stable with voxels of this size; "
       << largest << ", the largest that is, was taken.";
  call.warnings.push_back({"time-step-clamped", text.str()});
  return largest;
}

core::Volume diffuse(const FilterCall& call, const FilterDescription& filter, const Flow& flow) {
  const auto& geometry = call.volume.geometry();
  const auto per_mm = per_mm_of(geometry);
  const double step = checked_step(call, filter, flow.largest_step);
  const int iterations = call.whole("iterations");
  std::vector<float> present;
  std::vector<float> next(call.volume.size());
  for (int n = 0; n < iterations; ++n) {
    const float* const from = n == 0 ? call.volume.data() : present.data();
    const auto part =
        call.progress.part(static_cast<double>(n) / iterations, static_cast<double>(n + 1) / iterations);
    for_each_row(geometry, part, filter.title, [&](int j, int k) {
      const Row row(from, geometry, j, k);
      float* const out = next.data() + geometry.index(0, j, k);
      for (int i = 0; i < geometry.dims()[0]; ++i) {
        const Stencil u = row.at(i);
        double value = u.at(0, 0) + step * flow.rate(u, per_mm, flow.exponent);
        if (flow.keep_in_between) {
          const auto [low, high] = std::minmax_element(u.values.begin(), u.values.end());
          value = std::clamp(value, *low, *high);
        }
        out[i] = static_cast<float>(value);
      }
    });
    if (n == 0 && iterations > 1) present.resize(call.volume.size());
    std::swap(present, next);
  }
  return {geometry, std::move(present)};
}

/// A step spreads a value by a variance of at most 2/16 voxels^2; beyond six
/// times the width nothing arrives that counts.
std::array<int, 3> diffusion_reach(const core::ImageGeometry& geometry, const FilterParameters& parameters) {
  const double iterations = parameters.at("iterations");
  const int reach =
      static_cast<int>(std::min(iterations, std::ceil(6.0 * std::sqrt(iterations / 8.0)) + 2.0));
  std::array<int, 3> all{};
  for (std::size_t axis = 0; axis < 3; ++axis) all[axis] = geometry.dims()[axis] == 1 ? 0 : reach;
  return all;
}

const FilterParameter& iterations_parameter() {
  static const FilterParameter parameter{"iterations", "Number of steps", 5.0, 1.0, 100.0, true, ""};
  return parameter;
}

FilterEntry conductance_entry(const std::string& name, const std::string& title, const std::string& text,
                              Rate rate, bool keep_in_between) {
  FilterEntry entry;
  entry.description = {
      name,
      title,
      text,
      {iterations_parameter(),
       {"conductance", "Edges to keep, in mean slopes", 1.0, 0.1, 10.0, false, ""},
       {"time_step", "Step length (0: largest stable)", 0.0, 0.0, 10.0, false, ""}}};
  entry.apply = [=, filter = entry.description](const FilterCall& call) {
    const double conductance = call.parameter("conductance");
    const double edge = 2.0 * call.measured.front() * conductance * conductance;
    if (!(edge > 0.0)) return call.volume;  // no slope anywhere
    return diffuse(call, filter,
                   {rate, smallest_spacing_mm(call.volume.geometry()) / 16.0, -1.0 / edge, keep_in_between});
  };
  entry.reach = diffusion_reach;
  entry.measure = measure_gradient;
  entry.bytes_per_voxel = 8.0;
  return entry;
}

}  // namespace

FilterEntry gradient_diffusion_entry() {
  return conductance_entry(
      "gradient-diffusion", "Gradient diffusion",
      "Lets brightness flow where the slope is small: smooths within tissue, keeps walls.", gradient_rate,
      false);
}

FilterEntry curvature_diffusion_entry() {
  return conductance_entry(
      "curvature-diffusion", "Curvature diffusion",
      "Smooths along surfaces and hardly across them: gentler to thin walls than gradient diffusion.",
      curvature_rate, true);
}

FilterEntry curvature_flow_entry() {
  FilterEntry entry;
  entry.description = {
      "curvature-flow",
      "Curvature flow",
      "Rounds off what is strongly curved: removes small bumps, contrast stays.",
      {iterations_parameter(),
       {"time_step", "Step length (0: largest stable)", 0.0, 0.0, 10.0, false, "mm\u00b2"}}};
  entry.apply = [filter = entry.description](const FilterCall& call) {
    const double spacing_mm = smallest_spacing_mm(call.volume.geometry());
    return diffuse(call, filter, {flow_rate, spacing_mm * spacing_mm / 16.0, 0.0, true});
  };
  entry.reach = diffusion_reach;
  entry.bytes_per_voxel = 8.0;
  return entry;
}

}  // namespace palpate::imaging
