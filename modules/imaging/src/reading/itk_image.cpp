#include "itk_image.hpp"

#include "orientation.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <regex>
#include <sstream>

namespace palpate::imaging::reading {
namespace {

struct Shape {
  std::array<int, 3> dims{1, 1, 1};
  int frames = 1;
  std::size_t components = 1;
};

Shape shape_of(itk::ImageIOBase& io, const std::filesystem::path& path, const Layout& layout) {
  Shape shape;
  const unsigned axes = io.GetNumberOfDimensions();
  std::array<int, 4> sizes{1, 1, 1, 1};
  for (unsigned axis = 0; axis < axes; ++axis) {
    const auto size = io.GetDimensions(axis);
    if (size < 1 || size > static_cast<itk::SizeValueType>(std::numeric_limits<int>::max()))
      fail("bad-header", path,
           "has " + std::to_string(size) + " voxels along axis " + std::to_string(axis) +
               "; at least one is needed. Export the scan again.");
    if (axis < 4)
      sizes[axis] = static_cast<int>(size);
    else if (size != 1)
      fail("unsupported", path, "has more than four axes. Export three of space and one of time.");
  }
  shape.components = io.GetNumberOfComponents();
  shape.dims = {sizes[0], sizes[1], sizes[2]};
  shape.frames = sizes[3];
  if (layout.k_is_time) {
    shape.frames = sizes[2] * sizes[3];
    shape.dims[2] = 1;
  }
  if (layout.components_are_frames) {
    if (shape.frames > 1)
      fail("unsupported", path, "has two axes that are no space. Export one of them at a time.");
    shape.frames = static_cast<int>(shape.components);
  }
  return shape;
}

Mix mix_of(itk::ImageIOBase& io, const std::filesystem::path& path, const Layout& layout,
           std::size_t components) {
  if (layout.components_are_frames) return Mix::pick;
  if (components == 1) return Mix::grey;
  if (io.GetPixelType() == itk::IOPixelEnum::COMPLEX && components == 2) return Mix::magnitude;
  if (layout.colour && (components == 3 || components == 4)) return Mix::colour;
  fail("unsupported", path,
       "holds " + std::to_string(components) +
           " numbers in each voxel, which are no colour. Export a scan of grey or colour voxels.");
}

void take_times(const Layout& layout, core::VolumeInfo& info) {
  if (static_cast<int>(layout.frame_times_s.size()) == info.frames) {
    info.frame_times_s = layout.frame_times_s;
  } else if (layout.frame_spacing_s > 0.0 && info.frames > 1) {
    for (int frame = 0; frame < info.frames; ++frame)
      info.frame_times_s.push_back(frame * layout.frame_spacing_s);
  }
  info.time_provenance = info.frame_times_s.empty() ? core::Provenance::absent : core::Provenance::stated;
}

}  // namespace

Parsed read_through(itk::ImageIOBase& io, const std::filesystem::path& path, core::VolumeInfo info,
                    const Layout& layout, const Context& context) {
  Parsed parsed;
  try {
    io.SetFileName(path.string());
    io.ReadImageInformation();
    const Shape shape = shape_of(io, path, layout);
    const Mix mix = mix_of(io, path, layout, shape.components);
    const std::size_t bytes = component_bytes(io.GetComponentType());
    if (bytes == 0) fail("unsupported", path, "holds voxels of a kind that cannot be turned to grey.");
    info.pixel_type = pixel_type_name(io.GetComponentType());
    info.components = layout.components_are_frames ? 1 : static_cast<int>(shape.components);
    info.frames = shape.frames;
    take_times(layout, info);

    Eigen::Vector3d spacing = Eigen::Vector3d::Ones();
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();
    Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();
    const unsigned axes = std::min(io.GetNumberOfDimensions(), 3U);
    for (unsigned axis = 0; axis < axes; ++axis) {
      if (axis == 2 && layout.k_is_time) break;
      spacing[axis] = io.GetSpacing(axis);
      origin[axis] = io.GetOrigin(axis);
      const auto column = io.GetDirection(axis);
      for (unsigned row = 0; row < axes; ++row) direction(row, axis) = column[row];
    }
    if (layout.k_is_time && axes == 3) origin[2] = io.GetOrigin(2);
    info.geometry = make_geometry(path, shape.dims, spacing, origin, direction, info);

    const auto [first, kept] = frames_to_keep(context.options, shape.frames);
    if (mix == Mix::colour)
      warn(info, "colour-to-grey",
           "Colour was turned to grey by Rec. 601 luma: 0.299 R + 0.587 G + 0.114 B.");
    parsed.first_frame = first;
    parsed.kept_frames = kept;
    if (context.headers_only) {
      settle_geometry(context.options, info);
      parsed.info = std::move(info);
      return parsed;
    }
    const std::size_t frame_voxels = info.geometry.voxel_count();
    const auto all_voxels = static_cast<double>(frame_voxels) * shape.frames;
    const double raw_bytes = all_voxels * static_cast<double>(bytes) *
                             static_cast<double>(layout.components_are_frames ? 1 : shape.components);
    check_memory(path, raw_bytes, static_cast<double>(frame_voxels) * kept, context);

    context.progress.report(0.2, "Reading voxels");
    itk::ImageIORegion region(io.GetNumberOfDimensions());
    for (unsigned axis = 0; axis < io.GetNumberOfDimensions(); ++axis)
      region.SetSize(axis, io.GetDimensions(axis));
    io.SetIORegion(region);
    // Zeroed, so that what a truncated file lacks is black and not old memory.
    std::vector<char> raw(static_cast<std::size_t>(io.GetImageSizeInBytes()));
    io.Read(raw.data());

    context.progress.report(0.7, "Turning voxels to grey");
    parsed.voxels = context.allocate(frame_voxels * static_cast<std::size_t>(kept));
    for (int n = 0; n < kept; ++n) {
      const auto frame = static_cast<std::size_t>(first + n);
      const std::size_t offset = mix == Mix::pick ? 0 : frame * frame_voxels * shape.components * bytes;
      to_grey(raw.data() + offset, io.GetComponentType(), shape.components, mix, frame, frame_voxels,
              parsed.voxels.get() + static_cast<std::size_t>(n) * frame_voxels);
    }
    make_finite(path, parsed.voxels.get(), frame_voxels * static_cast<std::size_t>(kept), info);
  } catch (const itk::ProcessAborted&) {
    core::throw_cancelled();
  } catch (const itk::ExceptionObject& error) {
    fail("bad-header", path, "is damaged or of a kind that cannot be read. Export the scan again.",
         plain_words(error.GetDescription()));
  }
  settle_geometry(context.options, info);
  parsed.info = std::move(info);
  return parsed;
}

core::ImageGeometry make_geometry(const std::filesystem::path& path, std::array<int, 3> dims,
                                  Eigen::Vector3d spacing_mm, const Eigen::Vector3d& origin_mm,
                                  Eigen::Matrix3d direction, core::VolumeInfo& info) {
  constexpr double header_digits = 1e-3;  // headers carry as few as four digits of a cosine
  for (int axis = 0; axis < 3; ++axis) {
    const double length = direction.col(axis).norm();
    if (!std::isfinite(length) || length == 0.0)
      fail("bad-header", path, "has an unusable direction matrix.");
    if (std::abs(length - 1.0) > header_digits)
      warn(info, "repaired-direction",
           "Direction " + std::to_string(axis) +
               " is no unit vector; it was scaled to one, the spacing was kept.");
    direction.col(axis) = (direction.col(axis) / length).array() + 0.0;  // no negative zeros
  }
  const Eigen::Matrix3d skew = direction.transpose() * direction - Eigen::Matrix3d::Identity();
  const bool told = std::any_of(info.warnings.begin(), info.warnings.end(),
                                [](const core::Warning& warning) { return warning.code == "gantry-tilt"; });
  if (!told && skew.cwiseAbs().maxCoeff() > header_digits)
    warn(info, "sheared-axes",
         "The image axes are not at right angles; the voxels are placed as the file says.");
  try {
    return core::ImageGeometry(dims, spacing_mm, origin_mm, direction);
  } catch (const core::Error& error) {
    fail("bad-header", path, error.what());
  }
}

void settle_geometry(const ReadOptions& options, core::VolumeInfo& info) {
  settle_orientation(options, info);
  const core::ImageGeometry& read = info.geometry;
  if (options.spacing_mm) {
    const auto& user = *options.spacing_mm;
    const core::ImageGeometry stated(read.dims(), Eigen::Vector3d(user[0], user[1], user[2]),
                                     read.origin_mm(), read.direction());
    info.geometry = stated;
    info.spacing_provenance.fill(core::Provenance::user);
    return;
  }
  bool assumed = false;
  double largest = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto provenance = info.spacing_provenance[axis];
    const bool made_up = provenance == core::Provenance::assumed || provenance == core::Provenance::absent;
    // The spacing across a single slice matters to nobody.
    if (made_up && (axis < 2 || read.dims()[2] > 1)) assumed = true;
    if (read.dims()[axis] > 1)
      largest = std::max(largest, read.dims()[axis] * read.spacing_mm()[static_cast<Eigen::Index>(axis)]);
  }
  if (assumed) {
    warn(info, "assumed-spacing",
         "The file does not say how large a voxel is; 1 mm was assumed. Lengths are in voxels until a "
         "spacing is "
         "given.");
  } else if (largest > 0.0 && (largest < 5.0 || largest > 3000.0)) {
    std::ostringstream text;
    text << "The image is " << largest
         << " mm long by its header, which no patient is; the unit may not be mm.";
    warn(info, "implausible-spacing", text.str());
  }
}

std::string plain_words(const std::string& itk_text) {
  static const std::regex noise(R"((itk::|ITK )?ERROR: |\w+\(0x[0-9a-f]+\): |\(0x[0-9a-f]+\))");
  std::string text = std::regex_replace(itk_text, noise, "");
  if (text.size() > 500) text.resize(500);
  return text;
}

}  // namespace palpate::imaging::reading
