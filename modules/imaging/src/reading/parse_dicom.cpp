#include "dicom_header.hpp"
#include "itk_image.hpp"

#include "palpate/core/error.hpp"

#include <Eigen/Geometry>
#include <itkGDCMImageIO.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

namespace palpate::imaging::reading {
namespace {

using core::Provenance;

/// One frame of one file and the place that it takes in the result.
struct Slice {
  std::size_t file = 0;
  int file_frame = 0;
  DicomPlane plane;
  double along_mm = 0.0;  ///< of its position, along the normal
  int frame = 0, k = 0;
};

struct Assembly {
  std::vector<Slice> slices;
  std::array<int, 3> dims{1, 1, 1};
  int frames = 1;
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Ones();
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();
};

void check_alike(const std::vector<DicomHeader>& headers, const std::vector<Slice>& slices) {
  const DicomHeader& first = headers.front();
  constexpr double same_direction = 0.9998;  // a cosine: within about one degree
  for (const auto& header : headers) {
    if (header.rows != first.rows || header.columns != first.columns)
      fail("no-volume", header.path.parent_path(),
           "has slices of different sizes (" + header.path.filename().string() + " is " +
               std::to_string(header.columns) + " x " + std::to_string(header.rows) +
               "); they are no volume. Open one slice, or choose another series.");
    if (header.spacing_mm[0] && first.spacing_mm[0] &&
        (std::abs(*header.spacing_mm[0] / *first.spacing_mm[0] - 1.0) > 1e-3 ||
         std::abs(*header.spacing_mm[1] / *first.spacing_mm[1] - 1.0) > 1e-3))
      fail("no-volume", header.path.parent_path(),
           "has slices with pixels of different sizes; they are no volume.");
  }
  for (const auto& slice : slices)
    if (slice.plane.row.dot(slices.front().plane.row) < same_direction ||
        slice.plane.column.dot(slices.front().plane.column) < same_direction)
      fail("no-volume", headers[slice.file].path.parent_path(),
           "has slices that lie in different directions, as those of a localizer do; they are no volume. "
           "Open one "
           "slice, or "
           "choose another series.");
}

/// Gives every slice its k and frame: equal places are different times.
void number_slices(const std::vector<DicomHeader>& headers, Assembly& assembly, core::VolumeInfo& info) {
  auto& slices = assembly.slices;
  const Eigen::Vector3d normal = slices.front().plane.row.cross(slices.front().plane.column);
  for (auto& slice : slices) slice.along_mm = slice.plane.position.dot(normal);
  std::stable_sort(slices.begin(), slices.end(),
                   [](const Slice& a, const Slice& b) { return a.along_mm < b.along_mm; });
  constexpr double same_place_mm = 0.01;  // a tenth of the thinnest slice in use
  std::vector<std::vector<Slice>> places;
  for (const auto& slice : slices) {
    if (places.empty() || slice.along_mm - places.back().front().along_mm > same_place_mm)
      places.emplace_back();
    places.back().push_back(slice);
  }
  std::size_t fewest = slices.size();
  std::size_t most = 0;
  for (auto& place : places) {
    std::stable_sort(place.begin(), place.end(), [&](const Slice& a, const Slice& b) {
      if (a.plane.time_s && b.plane.time_s && *a.plane.time_s != *b.plane.time_s)
        return *a.plane.time_s < *b.plane.time_s;
      if (headers[a.file].instance != headers[b.file].instance)
        return headers[a.file].instance < headers[b.file].instance;
      return a.file_frame < b.file_frame;
    });
    fewest = std::min(fewest, place.size());
    most = std::max(most, place.size());
  }
  if (fewest != most)
    warn(info, "duplicate-slices",
         "Some places hold more slices than others; only those times that are whole were taken.");
  // A single file's slices keep its order where that only runs backwards.
  const bool backwards = headers.size() == 1 && places.size() > 1 &&
                         places.front().front().file_frame > places.back().front().file_frame;
  if (backwards) std::reverse(places.begin(), places.end());
  slices.clear();
  for (std::size_t k = 0; k < places.size(); ++k)
    for (std::size_t frame = 0; frame < fewest; ++frame) {
      slices.push_back(places[k][frame]);
      slices.back().k = static_cast<int>(k);
      slices.back().frame = static_cast<int>(frame);
    }
  assembly.dims[2] = static_cast<int>(places.size());
  assembly.frames = static_cast<int>(fewest);
}

/// The third axis and its spacing from the places of the slices.
void lay_third_axis(Assembly& assembly, core::VolumeInfo& info) {
  std::vector<Slice> column;
  for (const auto& slice : assembly.slices)
    if (slice.frame == 0) column.push_back(slice);
  const DicomPlane& plane = column.front().plane;
  Eigen::Vector3d normal = plane.row.cross(plane.column);
  assembly.origin_mm = plane.position;
  const auto steps = static_cast<double>(column.size() - 1);
  const Eigen::Vector3d step = (column.back().plane.position - plane.position) / steps;
  if (step.dot(normal) < 0.0) normal = -normal;
  double narrowest = 1e300;
  double widest = 0.0;
  double worst = 0.0;
  for (std::size_t k = 1; k < column.size(); ++k) {
    const double gap = std::abs(column[k].along_mm - column[k - 1].along_mm);
    narrowest = std::min(narrowest, gap);
    widest = std::max(widest, gap);
    worst =
        std::max(worst, (plane.position + step * static_cast<double>(k) - column[k].plane.position).norm());
  }
  const double mean_gap = std::abs(step.dot(normal));
  if (widest - narrowest > 0.01 * mean_gap && worst > 0.02) {
    std::ostringstream text;
    text << "The slices are " << narrowest << " to " << widest << " mm apart; they are shown as if evenly "
         << mean_gap << " mm, which puts some of them up to " << worst << " mm beside their place.";
    warn(info, "uneven-slices", text.str());
  }
  const double tilt_degrees =
      std::acos(std::min(1.0, mean_gap / step.norm())) * 180.0 / 3.14159265358979323846;
  constexpr double rounding_degrees = 0.1;  // of positions written with a few digits
  const bool tilted = tilt_degrees > rounding_degrees;
  if (tilted) {
    std::ostringstream text;
    text << "The slices are shifted against each other by " << tilt_degrees
         << " degrees (a tilted gantry); the voxels are placed on the slanted axis that the positions give.";
    warn(info, "gantry-tilt", text.str());
  }
  assembly.direction.col(2) = tilted ? Eigen::Vector3d(step.normalized()) : normal;
  assembly.spacing_mm[2] = tilted ? step.norm() : mean_gap;
  info.spacing_provenance[2] = Provenance::derived;
}

void take_slice_times(Assembly& assembly, core::VolumeInfo& info) {
  std::vector<double> times(static_cast<std::size_t>(assembly.frames));
  for (const auto& slice : assembly.slices) {
    if (!slice.plane.time_s) return;
    if (slice.k == 0) times[static_cast<std::size_t>(slice.frame)] = *slice.plane.time_s;
  }
  if (assembly.frames < 2) return;
  const double first = times.front();
  for (double& time : times) time -= first;
  info.frame_times_s = times;
  info.time_provenance = Provenance::stated;
}

/// Puts the frames of all files into one grid.
Assembly assemble(const std::vector<DicomHeader>& headers, core::VolumeInfo& info) {
  const DicomHeader& first = headers.front();
  Assembly assembly;
  assembly.dims = {first.columns, first.rows, 1};
  const bool placed = headers.size() > 1 || first.meaning == FrameMeaning::placed;
  for (std::size_t file = 0; file < headers.size(); ++file) {
    const DicomHeader& header = headers[file];
    if (headers.size() > 1 && (header.frames != 1 || header.planes.size() != 1))
      fail("no-volume", header.path.parent_path(),
           "does not say where each picture lies; its files are no volume. Open one of the files.");
    for (int frame = 0; frame < header.frames; ++frame) {
      Slice slice;
      slice.file = file;
      slice.file_frame = slice.frame = frame;
      if (header.planes.size() == static_cast<std::size_t>(header.frames))
        slice.plane = header.planes[static_cast<std::size_t>(frame)];
      assembly.slices.push_back(slice);
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (first.spacing_mm[axis])
      assembly.spacing_mm[static_cast<Eigen::Index>(axis)] = *first.spacing_mm[axis];
  const auto across = first.spacing_mm[2] ? Provenance::stated : Provenance::assumed;
  info.spacing_provenance = {first.spacing_provenance, first.spacing_provenance, across};
  if (!first.planes.empty()) {
    const DicomPlane& plane = first.planes.front();
    assembly.origin_mm = plane.position;
    assembly.direction << plane.row, plane.column, plane.row.cross(plane.column);
    info.origin_provenance = info.direction_provenance = Provenance::stated;
  }
  if (placed) {
    check_alike(headers, assembly.slices);
    number_slices(headers, assembly, info);
    take_slice_times(assembly, info);
    if (assembly.dims[2] > 1) lay_third_axis(assembly, info);
  } else if (first.meaning == FrameMeaning::unplaced_slices && first.frames > 1) {
    assembly.dims[2] = first.frames;
    for (auto& slice : assembly.slices) std::swap(slice.k, slice.frame);
    warn(
        info, "assumed-slices",
        "The file does not say how its frames lie to each other; they were taken for slices in their order.");
  } else {
    assembly.frames = first.frames;
    info.frame_times_s = first.frame_times_s;
    info.time_provenance = first.time_provenance;
    if (first.frames > 1) {
      assembly.spacing_mm[2] = 1.0;
      info.spacing_provenance[2] = Provenance::assumed;
    }
  }
  return assembly;
}

double raw_bytes_of(const DicomHeader& header) {
  return static_cast<double>(header.rows) * header.columns * header.frames * header.samples *
         std::max(1, header.bits) / 8.0;
}

void check_pixels(const DicomHeader& header, const Context& context, core::VolumeInfo& info) {
  if (header.rows < 1 || header.columns < 1)
    fail("no-image", header.path,
         "holds no picture by its header (SOP class " +
             (header.sop_class.empty() ? "unknown" : header.sop_class) +
             "). Choose the file or series that holds the scan.");
  if (!header.has_pixels) fail("no-image", header.path, "has a header but no pixels. Export the scan again.");
  if (header.pixel_bytes && static_cast<double>(*header.pixel_bytes) < raw_bytes_of(header)) {
    if (!context.options.allow_truncated)
      fail("truncated", header.path,
           "holds " + std::to_string(*header.pixel_bytes) + " bytes of pixels where its header speaks of " +
               std::to_string(static_cast<long long>(raw_bytes_of(header))) +
               ". It was cut off: copy or export it again.");
    warn(info, "truncated", "A file was cut off; the pixels that are missing are black.");
  }
  // Read, decoded and converted copies exist side by side for a moment.
  check_memory(header.path, 2.0 * raw_bytes_of(header),
               static_cast<double>(header.rows) * header.columns * header.frames, context);
}

/// GDCM swaps 32-bit big-endian pixels as if they were pairs of 16 bits; this
/// puts the pairs into their order.
void swap_halves(std::vector<char>& raw) {
  for (std::size_t n = 0; n + 4 <= raw.size(); n += 4) {
    std::swap(raw[n], raw[n + 2]);
    std::swap(raw[n + 1], raw[n + 3]);
  }
}

/// Decodes one file and puts its frames where they belong.
void load(const DicomHeader& header, const std::vector<Slice>& slices, std::size_t file,
          const Assembly& assembly, int first, int kept, float* voxels, core::VolumeInfo& info) {
  const auto io = itk::GDCMImageIO::New();
  io->SetFileName(header.path.string());
  io->ReadImageInformation();
  const std::size_t components = io->GetNumberOfComponents();
  const auto type = io->GetComponentType();
  const std::size_t plane =
      static_cast<std::size_t>(assembly.dims[0]) * static_cast<std::size_t>(assembly.dims[1]);
  const std::size_t voxel_bytes = components * component_bytes(type);
  if (io->GetDimensions(0) != static_cast<itk::SizeValueType>(header.columns) ||
      io->GetDimensions(1) != static_cast<itk::SizeValueType>(header.rows) || voxel_bytes == 0 ||
      (components != 1 && components != 3 && components != 4) ||
      static_cast<std::size_t>(io->GetImageSizeInBytes()) !=
          plane * static_cast<std::size_t>(header.frames) * voxel_bytes)
    fail("unsupported", header.path, "decodes to another size than its header says. Export it uncompressed.");
  itk::ImageIORegion region(io->GetNumberOfDimensions());
  for (unsigned axis = 0; axis < io->GetNumberOfDimensions(); ++axis)
    region.SetSize(axis, io->GetDimensions(axis));
  io->SetIORegion(region);
  std::vector<char> raw(static_cast<std::size_t>(io->GetImageSizeInBytes()));
  io->Read(raw.data());
  if (header.big_endian && header.bits == 32) swap_halves(raw);
  info.components = static_cast<int>(components);
  for (const auto& slice : slices) {
    if (slice.file != file || slice.frame < first || slice.frame >= first + kept) continue;
    const std::size_t place =
        static_cast<std::size_t>(slice.frame - first) * static_cast<std::size_t>(assembly.dims[2]) +
        static_cast<std::size_t>(slice.k);
    to_grey(raw.data() + static_cast<std::size_t>(slice.file_frame) * plane * voxel_bytes, type, components,
            components == 1 ? Mix::grey : Mix::colour, 0, plane, voxels + place * plane);
  }
}

std::string stored_type(const DicomHeader& header) {
  const int bits = header.bits <= 8 ? 8 : header.bits <= 16 ? 16 : header.bits <= 32 ? 32 : 64;
  return (header.is_signed ? "int" : "uint") + std::to_string(bits);
}

}  // namespace

Parsed parse_dicom(const std::vector<std::filesystem::path>& paths, const Context& context) {
  Parsed parsed;
  core::VolumeInfo& info = parsed.info;
  std::vector<DicomHeader> headers;
  for (std::size_t n = 0; n < paths.size(); ++n) {
    context.progress.report(0.2 * static_cast<double>(n) / static_cast<double>(paths.size()),
                            "Reading headers");
    headers.push_back(read_dicom_header(paths[n]));
    check_pixels(headers.back(), context, info);
  }
  const DicomHeader& first_header = headers.front();
  info.format = "DICOM";
  info.modality = first_header.modality;
  info.sop_class = first_header.sop_class;
  info.series_uid = first_header.series_uid;
  info.pixel_type = stored_type(first_header);
  info.warnings.insert(info.warnings.end(), first_header.warnings.begin(), first_header.warnings.end());
  const Assembly assembly = assemble(headers, info);
  info.frames = assembly.frames;
  info.geometry = make_geometry(first_header.path, assembly.dims, assembly.spacing_mm, assembly.origin_mm,
                                assembly.direction, info);
  if (first_header.inverted)
    warn(info, "inverted-display",
         "The file asks to be shown with low values bright (MONOCHROME1); the values are kept as stored.");
  if (first_header.transducer_axes) {
    // The volume's own system stands for the patient's until somebody says otherwise.
    info.orientation_choices = {"LPS", "RAS", "LPI", "RPI"};
    warn(info, "transducer-axes", "The axes are those of the probe; how the patient lay is not known.");
  }

  const auto [first, kept] = frames_to_keep(context.options, assembly.frames);
  parsed.first_frame = first;
  parsed.kept_frames = kept;
  if (context.headers_only) {
    info.components = first_header.samples;
    settle_geometry(context.options, info);
    return parsed;
  }
  const std::size_t count = info.geometry.voxel_count() * static_cast<std::size_t>(kept);
  check_memory(first_header.path, 2.0 * raw_bytes_of(first_header), static_cast<double>(count), context);
  parsed.voxels = context.allocate(count);
  for (std::size_t file = 0; file < headers.size(); ++file) {
    context.progress.report(0.2 + 0.7 * static_cast<double>(file) / static_cast<double>(headers.size()),
                            "Decoding pixels");
    try {
      load(headers[file], assembly.slices, file, assembly, first, kept, parsed.voxels.get(), info);
    } catch (const itk::ExceptionObject& error) {
      fail("unsupported", headers[file].path,
           "holds pixels that cannot be decoded (SOP class " + headers[file].sop_class +
               ", transfer syntax " + headers[file].transfer_syntax +
               "). Export it uncompressed, or as MetaImage or NRRD.",
           plain_words(error.GetDescription()));
    }
  }
  if (info.components > 1)
    warn(info, "colour-to-grey", "Colour was turned to grey by Rec. 601 luma: 0.299 R + 0.587 G + 0.114 B.");
  make_finite(first_header.path, parsed.voxels.get(), count, info);
  settle_geometry(context.options, info);
  return parsed;
}

}  // namespace palpate::imaging::reading
