#include "engine.hpp"

#include "palpate/compute/kernel_library.hpp"

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>

namespace palpate::imaging::adaptive {
namespace {

using compute::Buffer;
using Margin = std::array<int, 3>;

/// Voxels of one launch: a request to stop is answered between two of them.
constexpr int voxels_at_once = 1 << 19;

int lanes_of(const compute::Device& device, int wanted) {
  if (wanted == 1 || wanted == 4 || wanted == 8 || wanted == 16) return wanted;
  const unsigned width = device.info().float_vector_width;
  return width >= 16 ? 16 : width >= 8 ? 8 : width >= 4 ? 4 : 1;
}

template <typename Value>
Buffer buffer_of(const compute::Device& device, const std::vector<Value>& values) {
  return Buffer::copy_of(device, values.data(), values.size() * sizeof(Value));
}

std::vector<float> floats(const Six& values) {
  std::vector<float> result;
  for (Eigen::Index n = 0; n < 6; ++n) result.push_back(static_cast<float>(values[n]));
  return result;
}

class OpenclEngine final : public Engine {
 public:
  OpenclEngine(const compute::Device& device, const Design& design, const Remap& remap, int lanes)
      : device_(device), design_(design), remap_(remap), lanes_(lanes_of(device, lanes)) {
    compute::KernelLibrary library(device);
    const std::vector<std::string> defines{"LANES=" + std::to_string(lanes_)};
    const auto build = [&](const char* kernel) {
      return library.build("adaptive_filter.cl", kernel, defines);
    };
    blur_ = build("blur");
    structure_ = build("structure");
    add_highpass_ = build("add_highpass");
    combine_ = build("combine");
    write_weights();
  }

  void run(const std::vector<float>& padded, const std::array<int, 3>& block, std::vector<float>& result,
           const core::Progress& progress) override {
    const char* const what = "Adaptive filter";
    progress.report(0.0, what);
    set_block(block);
    upload(padded);
    blur(input_, 0, level_, 0, quadrature_blur_, design_.quadrature_margin(), progress);
    estimate_tensor(progress.part(0.05, 0.5));
    for (int component = 0; component < 6; ++component) {
      blur(tensor_, component, tensor_, component, tensor_blur_, {0, 0, 0}, progress);
      progress.report(0.5 + 0.05 * (component + 1), what);
    }
    for (std::size_t n = 0; n < levels_.size(); ++n) {
      if (n == 0)
        level_.copy_from(input_,
                         static_cast<std::size_t>(field_) * sizeof(float));  // the first level is not blurred
      else
        blur(level_, 0, level_, 0, levels_[n].blur, design_.level_margin(n), progress);
      add_highpass(levels_[n], n == 0, progress);
      progress.report(0.8 + 0.15 * static_cast<double>(n + 1) / static_cast<double>(levels_.size()), what);
    }
    combine(progress);
    download(result);
    progress.report(1.0, what);
  }

 private:
  struct AxisWeights {
    Buffer weights;
    int radius = 0;
  };
  using BlurWeights = std::array<AxisWeights, 3>;
  struct LevelWeights {
    BlurWeights blur;
    Buffer weights;
  };

  int row_floats(int voxels) const { return (voxels + lanes_ - 1) / lanes_ * lanes_ + lanes_; }

  BlurWeights blur_weights(const Blur& kernels) const {
    BlurWeights result;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::vector<float> half;
      const int radius = radius_of(kernels[axis]);
      for (int n = 0; n <= radius; ++n)
        half.push_back(static_cast<float>(kernels[axis][static_cast<std::size_t>(radius + n)]));
      result[axis] = {buffer_of(device_, half), radius};
    }
    return result;
  }

  void write_weights() {
    quadrature_blur_ = blur_weights(design_.quadrature_blur);
    tensor_blur_ = blur_weights(design_.tensor_blur);
    std::vector<float> weights = floats(design_.even_centre);
    for (Eigen::Index tap = 0; tap < design_.even.rows(); ++tap)
      for (const auto* filters : {&design_.even, &design_.odd}) {
        const auto six = floats(filters->row(tap));
        weights.insert(weights.end(), six.begin(), six.end());
      }
    quadrature_weights_ = buffer_of(device_, weights);
    std::vector<float> duals;
    for (const auto& direction : directions())
      for (const double value : dual_tensor(direction)) duals.push_back(static_cast<float>(value));
    duals_ = buffer_of(device_, duals);
    for (const Level& level : design_.levels) {
      std::vector<float> values = floats(-2.0 * level.weights.colwise().sum());
      for (Eigen::Index tap = 0; tap < level.weights.rows(); ++tap) {
        const auto six = floats(level.weights.row(tap));
        values.insert(values.end(), six.begin(), six.end());
      }
      levels_.push_back({blur_weights(level.blur), buffer_of(device_, values)});
    }
  }

  void set_block(const std::array<int, 3>& block) {
    if (block == block_) return;
    block_ = block;
    const auto margin = design_.margin();
    for (std::size_t axis = 0; axis < 3; ++axis) padded_[axis] = block[axis] + 2 * margin[axis];
    row_ = row_floats(padded_[0]);
    plane_ = row_ * padded_[1];
    field_ = plane_ * padded_[2];
    const std::size_t bytes = static_cast<std::size_t>(field_) * sizeof(float);
    for (auto* field : {&input_, &level_, &scratch_, &scratch2_}) *field = room(*field, bytes);
    for (auto* six : {&tensor_, &highpass_}) *six = room(*six, 6 * bytes);
    quadrature_offsets_ = buffer_of(device_, offsets(design_.quadrature_taps, design_.step));
    highpass_offsets_ = buffer_of(device_, offsets(design_.highpass_taps, {1, 1, 1}));
  }
  /// The buffer that there is, where it is large enough.
  Buffer room(Buffer& held, std::size_t bytes) const {
    return held.bytes() >= bytes ? std::move(held) : Buffer::allocate(device_, bytes);
  }
  std::vector<std::int32_t> offsets(const std::vector<Tap>& taps, const Tap& step) const {
    std::vector<std::int32_t> result;
    for (const Tap& tap : taps)
      result.push_back(tap[0] * step[0] + tap[1] * step[1] * row_ + tap[2] * step[2] * plane_);
    if (result.empty()) result.push_back(0);
    return result;
  }

  void upload(const std::vector<float>& padded) {
    const auto rows = static_cast<std::size_t>(padded_[1]) * static_cast<std::size_t>(padded_[2]);
    staging_.assign(static_cast<std::size_t>(field_), 0.0F);
    for (std::size_t row = 0; row < rows; ++row)
      std::copy_n(padded.begin() + static_cast<std::ptrdiff_t>(row) * padded_[0], padded_[0],
                  staging_.begin() + static_cast<std::ptrdiff_t>(row) * row_);
    input_.write(staging_.data(), staging_.size() * sizeof(float));
  }
  void download(std::vector<float>& result) {
    result.clear();
    const auto margin = design_.margin();
    scratch_.read(staging_.data(), staging_.size() * sizeof(float));
    for (int k = 0; k < block_[2]; ++k)
      for (int j = 0; j < block_[1]; ++j) {
        const auto row = staging_.begin() + (margin[2] + k) * static_cast<std::ptrdiff_t>(plane_) +
                         (margin[1] + j) * static_cast<std::ptrdiff_t>(row_) + margin[0];
        result.insert(result.end(), row, row + block_[0]);
      }
  }

  /// Runs a kernel, whose own arguments are set from number 6 on, over the
  /// block and `margin` around it, some planes at a time.
  void launch(compute::Kernel& kernel, const Margin& margin, const core::Progress& progress) {
    const auto whole = design_.margin();
    const int groups = (block_[0] + 2 * margin[0] + lanes_ - 1) / lanes_;
    const int rows = block_[1] + 2 * margin[1];
    const int planes = block_[2] + 2 * margin[2];
    const int at_once = std::max(1, voxels_at_once / (groups * lanes_ * rows));
    for (int done = 0; done < planes; done += at_once) {
      const int count = std::min(at_once, planes - done);
      const int first =
          (whole[2] - margin[2] + done) * plane_ + (whole[1] - margin[1]) * row_ + whole[0] - margin[0];
      unsigned argument = 0;
      for (const int value : {first, row_, plane_, groups, rows, count})
        kernel.set(argument++, static_cast<std::int32_t>(value));
      kernel.run(static_cast<std::size_t>(groups) * static_cast<std::size_t>(rows) *
                 static_cast<std::size_t>(count));
      device_.finish();
      progress.cancel().check();
    }
  }
  template <typename... Values>
  static void set_own(compute::Kernel& kernel, const Values&... values) {
    unsigned argument = 6;
    (kernel.set(argument++, values), ...);
  }

  /// Of one component each; target may be source.
  void blur(const Buffer& source, int source_component, Buffer& target, int target_component,
            const BlurWeights& weights, const Margin& margin, const core::Progress& progress) {
    const std::array<const Buffer*, 3> from{&source, &scratch_, &scratch2_};
    const std::array<const Buffer*, 3> to{&scratch_, &scratch2_, &target};
    const std::array<std::int32_t, 3> strides{1, row_, plane_};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Margin around = margin;
      for (std::size_t later = axis + 1; later < 3; ++later) around[later] += weights[later].radius;
      set_own(blur_, *from[axis], std::int32_t{axis == 0 ? source_component * field_ : 0}, *to[axis],
              std::int32_t{axis == 2 ? target_component * field_ : 0}, weights[axis].weights,
              std::int32_t{weights[axis].radius}, strides[axis]);
      launch(blur_, around, progress);
    }
  }
  void estimate_tensor(const core::Progress& progress) {
    set_own(structure_, level_, tensor_, std::int32_t{field_}, quadrature_offsets_, quadrature_weights_,
            duals_, static_cast<std::int32_t>(design_.quadrature_taps.size()));
    launch(structure_, design_.tensor_margin(), progress);
    progress.report(1.0, "Adaptive filter");
  }
  void add_highpass(const LevelWeights& level, bool fresh, const core::Progress& progress) {
    set_own(add_highpass_, level_, highpass_, std::int32_t{field_}, highpass_offsets_, level.weights,
            static_cast<std::int32_t>(design_.highpass_taps.size()), std::int32_t{fresh ? 1 : 0});
    launch(add_highpass_, {0, 0, 0}, progress);
  }
  void combine(const core::Progress& progress) {
    set_own(combine_, input_, level_, tensor_, highpass_, std::int32_t{field_}, scratch_,
            static_cast<float>(remap_.contrast), static_cast<float>(remap_.floor), remap_.low, remap_.high);
    launch(combine_, {0, 0, 0}, progress);
  }

  compute::Device device_;
  Design design_;
  Remap remap_;
  int lanes_;
  compute::Kernel blur_, structure_, add_highpass_, combine_;
  Buffer input_, level_, scratch_, scratch2_;  ///< scratch_ takes the result at last
  Buffer tensor_, highpass_;                   ///< six fields each
  BlurWeights quadrature_blur_, tensor_blur_;
  Buffer quadrature_weights_, duals_, quadrature_offsets_, highpass_offsets_;
  std::vector<LevelWeights> levels_;
  std::vector<float> staging_;
  std::array<int, 3> block_{}, padded_{};
  int row_ = 0, plane_ = 0, field_ = 0;  ///< floats
};

}  // namespace

std::unique_ptr<Engine> make_opencl_engine(const compute::Device& device, const Design& design,
                                           const Remap& remap, int lanes) {
  return std::make_unique<OpenclEngine>(device, design, remap, lanes);
}

}  // namespace palpate::imaging::adaptive
