#include "palpate/imaging/adaptive.hpp"

#include "engine.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

namespace palpate::imaging {
namespace {

/// Fields of a block that an engine holds at once.
constexpr double fields_held = 22.0;
/// What counts as dark, in shares of the scan's grey range.
constexpr double dark_share = 0.02;

/// The device to work on; none for the CPU twin.
std::optional<compute::Device> device_for(const std::string& selector) {
  if (compute::is_reference_selector(selector) || adaptive_lacks_device(selector)) return std::nullopt;
  return compute::open_device(selector);
}

struct Blocks {
  std::array<int, 3> size{};  ///< of one block without margins; the last ones are smaller
  std::array<int, 3> count{};
  int total() const { return count[0] * count[1] * count[2]; }
};

Blocks blocks_of(const std::array<int, 3>& dims, const std::array<int, 3>& margin, double largest_voxels) {
  Blocks blocks{dims, {1, 1, 1}};
  const auto padded = [&](std::size_t axis) { return blocks.size[axis] + 2 * margin[axis]; };
  while (1.0 * padded(0) * padded(1) * padded(2) > largest_voxels) {
    // The longest is split; rows along i stay whole as long as they are not much longer.
    std::size_t longest = 0;
    for (const std::size_t axis : {1U, 2U})
      if (blocks.size[axis] * 2 > blocks.size[longest] || blocks.size[axis] > blocks.size[longest])
        longest = axis;
    if (blocks.size[longest] <= 16) longest = 0;
    if (blocks.size[longest] <= 16) break;
    ++blocks.count[longest];
    blocks.size[longest] = (dims[longest] + blocks.count[longest] - 1) / blocks.count[longest];
  }
  for (std::size_t axis = 0; axis < 3; ++axis)
    blocks.count[axis] = (dims[axis] + blocks.size[axis] - 1) / blocks.size[axis];
  return blocks;
}

/// A box of the volume with margins; beyond the border the outermost voxels go on.
void gather(const float* voxels, const std::array<int, 3>& dims, const std::array<int, 3>& begin,
            const std::array<int, 3>& size, const std::array<int, 3>& margin, double scale,
            std::vector<float>& padded) {
  std::array<std::vector<std::size_t>, 3> source;
  std::size_t stride = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (int n = -margin[axis]; n < size[axis] + margin[axis]; ++n)
      source[axis].push_back(static_cast<std::size_t>(std::clamp(begin[axis] + n, 0, dims[axis] - 1)) *
                             stride);
    stride *= static_cast<std::size_t>(dims[axis]);
  }
  padded.resize(source[0].size() * source[1].size() * source[2].size());
  auto target = padded.begin();
  for (const std::size_t k : source[2])
    for (const std::size_t j : source[1])
      for (const std::size_t i : source[0]) *target++ = static_cast<float>(scale * voxels[k + j + i]);
}

void scatter(const std::vector<float>& block, const std::array<int, 3>& dims, const std::array<int, 3>& begin,
             const std::array<int, 3>& size, double scale, std::vector<float>& voxels) {
  auto source = block.begin();
  for (int k = 0; k < size[2]; ++k)
    for (int j = 0; j < size[1]; ++j) {
      const auto row = (static_cast<std::size_t>(begin[2] + k) * static_cast<std::size_t>(dims[1]) +
                        static_cast<std::size_t>(begin[1] + j)) *
                           static_cast<std::size_t>(dims[0]) +
                       static_cast<std::size_t>(begin[0]);
      for (int i = 0; i < size[0]; ++i)
        voxels[row + static_cast<std::size_t>(i)] = static_cast<float>(scale * *source++);
    }
}

void run_pass(const float* voxels, const std::array<int, 3>& dims, const std::array<int, 3>& margin,
              const Blocks& blocks, double scale, adaptive::Engine& engine, std::vector<float>& result,
              const core::Progress& progress) {
  std::vector<float> padded;
  std::vector<float> filtered;
  int done = 0;
  for (int c = 0; c < blocks.count[2]; ++c)
    for (int b = 0; b < blocks.count[1]; ++b)
      for (int a = 0; a < blocks.count[0]; ++a) {
        const std::array<int, 3> begin{a * blocks.size[0], b * blocks.size[1], c * blocks.size[2]};
        std::array<int, 3> size{};
        for (std::size_t axis = 0; axis < 3; ++axis)
          size[axis] = std::min(blocks.size[axis], dims[axis] - begin[axis]);
        gather(voxels, dims, begin, size, margin, scale, padded);
        const double total = blocks.total();
        engine.run(padded, size, filtered, progress.part(done / total, (done + 1) / total));
        scatter(filtered, dims, begin, size, 1.0 / scale, result);
        ++done;
      }
}

}  // namespace

AdaptiveFit adaptive_fit(const core::ImageGeometry& geometry, const AdaptiveParameters& parameters) {
  return adaptive::design(geometry, parameters).fit;
}

std::array<int, 3> adaptive_reach(const core::ImageGeometry& geometry, const AdaptiveParameters& parameters) {
  auto reach = adaptive::layout(geometry, parameters).margin();
  for (int& voxels : reach) voxels *= parameters.passes;
  return reach;
}

core::Volume adaptive_filter(const core::Volume& volume, const AdaptiveParameters& parameters,
                             const core::IntensityRange& scan, const std::string& device,
                             const core::Progress& progress) {
  adaptive::Work work;
  work.device = device_for(device);
  // Doubles take twice the memory.
  if (!work.device) work.largest_block_voxels /= 2.0;
  return adaptive::run(volume, parameters, scan, work, progress);
}

core::Volume adaptive::run(const core::Volume& volume, const AdaptiveParameters& parameters,
                           const core::IntensityRange& scan, const Work& work,
                           const core::Progress& progress) {
  progress.report(0.0, "Adaptive filter");
  const Design kernels = design(volume.geometry(), parameters);
  // Grey is taken to about one, by a power of two, which rounds nothing: no
  // square of a response then leaves the floats.
  const float largest = std::max(std::abs(scan.min), std::abs(scan.max));
  const double scale = largest > 0.0F ? std::ldexp(1.0, -std::ilogb(largest)) : 1.0;
  Remap remap;
  remap.contrast = kernels.step_response * parameters.contrast_percent / 100.0;
  remap.low = static_cast<float>(scale * scan.min);
  remap.high = static_cast<float>(scale * scan.max);
  remap.floor = dark_share * (static_cast<double>(remap.high) - remap.low);
  const auto engine = work.device ? make_opencl_engine(*work.device, kernels, remap, work.lanes)
                                  : make_reference_engine(kernels, remap);
  double block_voxels = work.largest_block_voxels;
  if (work.device)
    block_voxels = std::min(block_voxels, static_cast<double>(work.device->info().memory_bytes) /
                                              (2.0 * fields_held * sizeof(float)));
  const auto margin = kernels.margin();
  const Blocks blocks = blocks_of(volume.dims(), margin, block_voxels);
  std::vector<float> input;
  std::vector<float> output(volume.size());
  for (int pass = 0; pass < parameters.passes; ++pass) {
    const double passes = parameters.passes;
    run_pass(pass == 0 ? volume.data() : input.data(), volume.dims(), margin, blocks, scale, *engine, output,
             progress.part(pass / passes, (pass + 1) / passes));
    if (pass + 1 < parameters.passes) {
      input.resize(output.size());
      input.swap(output);
    }
  }
  progress.report(1.0, "Adaptive filter");
  return {volume.geometry(), std::move(output)};
}

bool adaptive_lacks_device(const std::string& selector) {
  const char* const wish = std::getenv("PALPATE_DEVICE");
  if (!selector.empty() || (wish != nullptr && *wish != '\0')) return false;
  const auto devices = compute::list_devices();
  return std::none_of(devices.begin(), devices.end(), [](const auto& device) { return device.usable; });
}

}  // namespace palpate::imaging
