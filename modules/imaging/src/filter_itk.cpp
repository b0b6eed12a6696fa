#include "filter_registry.hpp"

#include "palpate/core/error.hpp"

#include <itkCommand.h>
#include <itkGaussianOperator.h>
#include <itkImage.h>
#include <itkImportImageFilter.h>
#include <itkMedianImageFilter.h>
#include <itkNeighborhoodOperatorImageFilter.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <sstream>
#include <utility>

namespace palpate::imaging {
namespace {

using Image = itk::Image<float, 3>;

/// Carries a filter's progress out and a request to stop in. What the
/// caller's own report throws must not pass through ITK's threads, so it is
/// kept and thrown again once ITK has stopped.
class Watcher : public itk::Command {
 public:
  using Self = Watcher;
  using Pointer = itk::SmartPointer<Self>;
  itkFactorylessNewMacro(Self);

  void watch(core::Progress progress, std::string what) {
    progress_ = std::move(progress);
    what_ = std::move(what);
  }
  void Execute(const itk::Object*, const itk::EventObject&) override {}
  void Execute(itk::Object* caller, const itk::EventObject&) override {
    auto* const process = dynamic_cast<itk::ProcessObject*>(caller);
    if (process == nullptr || caught_) return;
    try {
      furthest_ = std::max(furthest_, static_cast<double>(process->GetProgress()));
      progress_.report(furthest_, what_);
    } catch (...) {
      caught_ = std::current_exception();
      process->SetAbortGenerateData(true);
    }
  }
  void rethrow_caught() const {
    if (caught_) std::rethrow_exception(caught_);
  }

 private:
  core::Progress progress_;
  std::string what_;
  double furthest_ = 0.0;
  std::exception_ptr caught_;
};

/// Runs one filter to its end, or leaves as Error(cancelled).
void run(itk::ProcessObject& process, const core::Progress& progress, const std::string& what) {
  progress.report(0.0, what);
  const auto watcher = Watcher::New();
  watcher->watch(progress, what);
  const auto tag = process.AddObserver(itk::ProgressEvent(), watcher);
  try {
    process.Update();
  } catch (const itk::ProcessAborted&) {
    watcher->rethrow_caught();
    core::throw_cancelled();
  } catch (const itk::ExceptionObject& error) {
    watcher->rethrow_caught();
    throw core::Error(core::ErrorKind::internal, "filter-failed",
                      what + " failed: " + error.GetDescription());
  } catch (const std::bad_alloc&) {
    throw core::Error(core::ErrorKind::internal, "out-of-memory",
                      what + " needs more memory than there is; crop the volume or close other programs.");
  }
  process.RemoveObserver(tag);
  watcher->rethrow_caught();
  progress.report(1.0, what);
}

/// The voxels as ITK sees them, not copied: identity direction and no origin,
/// so that only the spacing takes part and no odd direction can be refused.
itk::ImportImageFilter<float, 3>::Pointer import(const core::Volume& volume) {
  auto importer = itk::ImportImageFilter<float, 3>::New();
  Image::SizeType size;
  Image::SpacingType spacing;
  for (unsigned axis = 0; axis < 3; ++axis) {
    size[axis] = static_cast<itk::SizeValueType>(volume.dims()[axis]);
    spacing[axis] = volume.geometry().spacing_mm()[axis];
  }
  importer->SetRegion(Image::RegionType(size));
  importer->SetSpacing(spacing);
  // ITK only reads it: no filter here runs in place.
  importer->SetImportPointer(const_cast<float*>(volume.data()), volume.size(), false);
  return importer;
}

/// The filtered voxels with the volume's own geometry; ITK's memory is kept, not copied.
core::Volume export_with(const core::ImageGeometry& geometry, Image::Pointer image) {
  const float* const voxels = image->GetBufferPointer();
  const std::shared_ptr<const float> shared(voxels, [image](const float*) mutable { image = nullptr; });
  return {geometry, shared};
}

core::Volume median(const core::Volume& volume, int radius_voxels, const core::Progress& progress) {
  const auto importer = import(volume);
  using Filter = itk::MedianImageFilter<Image, Image>;
  const auto filter = Filter::New();
  Filter::InputSizeType radius;
  // Across an axis of one voxel the border repeats that voxel, which changes
  // no median but costs (2r+1) times the work.
  for (unsigned axis = 0; axis < 3; ++axis)
    radius[axis] = volume.dims()[axis] == 1 ? 0 : static_cast<itk::SizeValueType>(radius_voxels);
  filter->SetRadius(radius);
  filter->SetInput(importer->GetOutput());
  run(*filter, progress, "Median filter");
  const Image::Pointer output = filter->GetOutput();
  output->DisconnectPipeline();
  return export_with(volume.geometry(), output);
}

/// A width that takes a million passes is a spacing in another unit, not a wish.
void check_width(double sigma_mm, double sigma_voxels, double spacing_mm) {
  constexpr double widest_voxels = 100.0;
  if (sigma_voxels <= widest_voxels) return;
  std::ostringstream text;
  text << "A Gaussian of sigma_mm=" << sigma_mm << " would be " << sigma_voxels
       << " voxels wide in this scan, whose voxels are " << spacing_mm << " mm apart; up to " << widest_voxels
       << " can be done. Take a sigma_mm of at most " << widest_voxels * spacing_mm
       << ", or give the spacing if the file's is not in mm.";
  core::throw_usage(text.str());
}

struct Pass {
  unsigned axis;
  double variance_voxels;
};
/// Beyond a variance of some 100 ITK's Bessel functions no longer sum to one
/// (at 400 the variance comes out 1.3 % too large). Variances add, so a wide
/// kernel is a narrow one applied several times.
std::vector<Pass> passes_of(const core::ImageGeometry& geometry, double sigma_mm) {
  constexpr double largest_variance_voxels = 64.0;
  std::vector<Pass> passes;
  for (unsigned axis = 0; axis < 3; ++axis) {
    if (geometry.dims()[axis] == 1) continue;
    const double sigma_voxels = sigma_mm / geometry.spacing_mm()[axis];
    check_width(sigma_mm, sigma_voxels, geometry.spacing_mm()[axis]);
    const double variance = sigma_voxels * sigma_voxels;
    const auto count = static_cast<std::size_t>(std::max(1.0, std::ceil(variance / largest_variance_voxels)));
    passes.insert(passes.end(), count, Pass{axis, variance / static_cast<double>(count)});
  }
  return passes;
}

itk::GaussianOperator<double, 3> kernel_of(const Pass& pass) {
  itk::GaussianOperator<double, 3> kernel;
  kernel.SetDirection(pass.axis);
  kernel.SetVariance(pass.variance_voxels);
  kernel.SetMaximumError(1e-4);       // weight left off at the kernel's ends, before it is normalised
  kernel.SetMaximumKernelWidth(513);  // never reached under the variance above
  kernel.CreateDirectional();
  return kernel;
}

/// The discrete Gaussian (the kernel of diffusion on a grid), an axis after
/// the other. Not ITK's recursive one: that refuses axes under four voxels,
/// so a 2-D picture, and overshoots at edges. Not DiscreteGaussianImageFilter
/// either: it streams in chunks and its progress runs backwards.
core::Volume gaussian(const core::Volume& volume, double sigma_mm, const core::Progress& progress) {
  const auto passes = passes_of(volume.geometry(), sigma_mm);
  if (passes.empty()) return volume;

  const auto importer = import(volume);
  Image::Pointer image = importer->GetOutput();
  for (std::size_t n = 0; n < passes.size(); ++n) {
    const auto filter = itk::NeighborhoodOperatorImageFilter<Image, Image, double>::New();
    filter->SetOperator(kernel_of(passes[n]));
    filter->SetInput(image);
    const auto total = static_cast<double>(passes.size());
    run(*filter, progress.part(static_cast<double>(n) / total, static_cast<double>(n + 1) / total),
        "Gaussian filter");
    image = filter->GetOutput();
    image->DisconnectPipeline();
  }
  return export_with(volume.geometry(), image);
}

/// The same kernels as gaussian(), for their width.
std::array<int, 3> gaussian_reach(const core::ImageGeometry& geometry, const FilterParameters& parameters) {
  std::array<int, 3> reach{0, 0, 0};
  for (const Pass& pass : passes_of(geometry, parameters.at("sigma_mm")))
    reach[pass.axis] += static_cast<int>(kernel_of(pass).GetRadius(pass.axis));
  return reach;
}

}  // namespace

FilterEntry median_entry() {
  return {
      {"median",
       "Median",
       "Takes the middle value of a block of voxels: removes specks, keeps edges.",
       {{"radius_voxels", "Radius of the block", 1.0, 1.0, 8.0, true, "voxels"}}},
      [](const FilterCall& call) { return median(call.volume, call.whole("radius_voxels"), call.progress); },
      [](const core::ImageGeometry&, const FilterParameters& parameters) {
        const int radius = static_cast<int>(parameters.at("radius_voxels"));
        return std::array<int, 3>{radius, radius, radius};
      },
      {},
      8.0};
}

FilterEntry gaussian_entry() {
  return {
      {"gaussian",
       "Gaussian",
       "Averages with a bell-shaped weight: smooths everything, edges too.",
       {{"sigma_mm", "Width (standard deviation)", 1.0, 0.01, 20.0, false, "mm"}}},
      [](const FilterCall& call) { return gaussian(call.volume, call.parameter("sigma_mm"), call.progress); },
      gaussian_reach,
      {},
      12.0};
}

}  // namespace palpate::imaging
