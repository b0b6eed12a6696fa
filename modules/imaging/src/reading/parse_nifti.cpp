#include "nifti_header.hpp"
#include "orientation.hpp"
#include "raw_image.hpp"
#include "settle.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <optional>
#include <sstream>

namespace palpate::imaging::reading {
namespace {

namespace fs = std::filesystem;
using core::Provenance;
using Affine = Eigen::Matrix<double, 3, 4>;

bool is_gzip(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<char, 2> start{};
  file.read(start.data(), 2);
  return file && start[0] == '\x1F' && start[1] == '\x8B';
}

std::string start_of(const fs::path& path) {
  constexpr std::size_t longest_header = 540;
  std::string bytes(longest_header, '\0');
  const auto source =
      open_source(path, {path}, is_gzip(path) ? Encoding::deflate : Encoding::raw, VoxelType::uint8);
  std::size_t got = 0;
  while (got < bytes.size()) {
    const std::size_t more = source->read(bytes.data() + got, bytes.size() - got);
    if (more == 0) break;
    got += more;
  }
  bytes.resize(got);
  return bytes;
}

/// "a/heart.hdr", "a/heart.img.gz" -> "a/heart".
fs::path stem_of(fs::path path) {
  if (path.extension() == ".gz") path.replace_extension();
  return path.replace_extension();
}

fs::path existing(const fs::path& stem, const std::string& ending) {
  for (const std::string packed : {"", ".gz"}) {
    const fs::path path = stem.string() + ending + packed;
    std::error_code error;
    if (fs::is_regular_file(path, error)) return path;
  }
  return {};
}

fs::path header_file(const fs::path& path) {
  const fs::path unpacked = path.extension() == ".gz" ? path.stem() : path.filename();
  if (unpacked.extension() != ".img") return path;
  const fs::path header = existing(stem_of(path), ".hdr");
  if (header.empty())
    fail("not-found", path,
         "belongs to a header file " + stem_of(path).filename().string() + ".hdr, which is missing.");
  return header;
}

fs::path voxel_file(const fs::path& path, const fs::path& header_path, const NiftiHeader& header) {
  if (header.single_file) return header_path;
  const fs::path image = existing(stem_of(header_path), ".img");
  if (!image.empty()) return image;
  fail("not-found", path,
       "needs its voxels from " + stem_of(header_path).filename().string() +
           ".img, which is missing. Put both into one folder.");
}

void set_type(const NiftiHeader& header, const fs::path& path, RawImage& image) {
  struct Type {
    int code, bits;
    VoxelType type;
    long long components;
    GreyRule rule;
  };
  static constexpr std::array<Type, 14> types{{{2, 8, VoxelType::uint8, 1, GreyRule::only},
                                               {4, 16, VoxelType::int16, 1, GreyRule::only},
                                               {8, 32, VoxelType::int32, 1, GreyRule::only},
                                               {16, 32, VoxelType::float32, 1, GreyRule::only},
                                               {32, 64, VoxelType::float32, 2, GreyRule::magnitude},
                                               {64, 64, VoxelType::float64, 1, GreyRule::only},
                                               {128, 24, VoxelType::uint8, 3, GreyRule::luma},
                                               {256, 8, VoxelType::int8, 1, GreyRule::only},
                                               {512, 16, VoxelType::uint16, 1, GreyRule::only},
                                               {768, 32, VoxelType::uint32, 1, GreyRule::only},
                                               {1024, 64, VoxelType::int64, 1, GreyRule::only},
                                               {1280, 64, VoxelType::uint64, 1, GreyRule::only},
                                               {1792, 128, VoxelType::float64, 2, GreyRule::magnitude},
                                               {2304, 32, VoxelType::uint8, 4, GreyRule::luma}}};
  const auto type =
      std::find_if(types.begin(), types.end(), [&](const Type& t) { return t.code == header.datatype; });
  if (type == types.end())
    fail("unsupported", path,
         "has voxels of NIfTI type " + std::to_string(header.datatype) + ", which cannot be read.");
  if (type->bits != header.bitpix)
    fail("bad-header", path,
         "says that a voxel has " + std::to_string(header.bitpix) + " bits where its type has " +
             std::to_string(type->bits) + ".");
  image.type = type->type;
  image.rule = type->rule;
  if (type->components > 1) image.axes.push_back({type->components, Role::component});
}

void set_axes(const NiftiHeader& header, const fs::path& path, RawImage& image) {
  const long long axes = header.dim[0];
  if (axes < 1 || axes > 7)
    fail("bad-header", path, "says that it has " + std::to_string(axes) + " axes; 1 to 7 are possible.");
  constexpr std::array<Role, 4> roles{Role::i, Role::j, Role::k, Role::frame};
  constexpr int rgb_intent = 2003;
  constexpr int rgba_intent = 2004;
  for (long long axis = 1; axis <= axes; ++axis) {
    const long long size = header.dim[static_cast<std::size_t>(axis)];
    if (size < 1 || size > (1LL << 31) - 1)
      fail("bad-header", path,
           "says that axis " + std::to_string(axis) + " has " + std::to_string(size) +
               " voxels. Export the scan again.");
    Role role = axis <= 4 ? roles[static_cast<std::size_t>(axis - 1)] : Role::single;
    if (axis > 4 && size > 1) {
      const bool colour = axis == 5 && image.rule == GreyRule::only &&
                          ((header.intent_code == rgb_intent && size == 3) ||
                           (header.intent_code == rgba_intent && size == 4));
      if (!colour)
        fail("unsupported", path,
             "has more axes than three of space and one of time (axis " + std::to_string(axis) + " has " +
                 std::to_string(size) + " entries). Export a scan of grey or colour voxels.");
      role = Role::component;
      image.rule = GreyRule::luma;
    }
    image.axes.push_back({size, role});
  }
}

void set_scaling(const NiftiHeader& header, RawImage& image) {
  // A slope of 0, or one that is no number, means that the voxels are as stored.
  if (!std::isfinite(header.scl_slope) || header.scl_slope == 0.0) return;
  image.slope = header.scl_slope;
  if (std::isfinite(header.scl_inter)) image.intercept = header.scl_inter;
}

void set_file(const NiftiHeader& header, const fs::path& path, const fs::path& data, RawImage& image) {
  const double offset = header.vox_offset;
  const double least = !header.single_file ? 0.0 : header.version == 1 ? 348.0 : 540.0;
  if (!std::isfinite(offset) || offset < least || offset > 1e9 || offset != std::floor(offset))
    fail("bad-header", path,
         "says that its voxels begin at byte " + std::to_string(offset) + ". Export the scan again.");
  image.big_endian = header.big_endian;
  image.files.push_back({data});
  if (is_gzip(data)) {
    image.encoding = Encoding::deflate;
    image.skipped_bytes = static_cast<std::uint64_t>(offset);
  } else {
    image.files.front().offset = static_cast<std::uint64_t>(offset);
  }
}

/// Millimetres in the unit of length; 1 and a warning where it is not said.
double length_unit_mm(const NiftiHeader& header, core::VolumeInfo& info) {
  switch (header.xyzt_units & 0x07) {
    case 1:
      return 1000.0;
    case 2:
      return 1.0;
    case 3:
      return 1e-3;
    default:
      warn(info, "unknown-unit",
           "The header does not say its unit of length; mm was taken, as NIfTI files mean it.");
      return 1.0;
  }
}

double time_unit_s(const NiftiHeader& header) {
  switch (header.xyzt_units & 0x38) {
    case 8:
      return 1.0;
    case 16:
      return 1e-3;
    case 24:
      return 1e-6;
    default:
      return 0.0;
  }
}

std::string text_of(const Affine& matrix) {
  std::ostringstream text;
  text.precision(6);
  for (int row = 0; row < 3; ++row) {
    text << (row == 0 ? "" : "; ");
    for (int column = 0; column < 4; ++column) text << (column == 0 ? "" : " ") << matrix(row, column);
  }
  return text.str();
}

enum class Shape { straight, skewed, unusable };
Shape shape_of(const Affine& matrix) {
  if (!matrix.allFinite()) return Shape::unusable;
  Eigen::Matrix3d axes = matrix.leftCols<3>();
  for (int axis = 0; axis < 3; ++axis) {
    const double length = axes.col(axis).norm();
    if (!(length > 0.0) || !std::isfinite(length)) return Shape::unusable;
    axes.col(axis) /= length;
  }
  if (std::abs(axes.determinant()) < 1e-3) return Shape::unusable;
  const Eigen::Matrix3d skew = axes.transpose() * axes - Eigen::Matrix3d::Identity();
  return skew.cwiseAbs().maxCoeff() > 1e-3 ? Shape::skewed : Shape::straight;
}

/// Whether both put every voxel of the scan at the same place, to a tenth of a voxel.
bool same_place(const Affine& a, const Affine& b, const std::array<int, 3>& dims) {
  double furthest = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    Eigen::Vector4d ijk(0.0, 0.0, 0.0, 1.0);
    for (int axis = 0; axis < 3; ++axis)
      if ((corner >> axis & 1) != 0) ijk[axis] = dims[static_cast<std::size_t>(axis)] - 1;
    furthest = std::max(furthest, ((a - b) * ijk).norm());
  }
  return furthest <= 0.1 * a.leftCols<3>().colwise().norm().minCoeff();
}

/// Which of the two placements of a NIfTI header holds. The sform is the more
/// exact, but where the qform says the scanner's space and the sform another
/// (a template's, say), millimetres are the scanner's.
std::optional<Affine> placement_of(const NiftiHeader& header, const fs::path& path, const Affine& qform,
                                   const std::array<int, 3>& dims, bool axes_given, core::VolumeInfo& info) {
  constexpr int scanner = 1;
  const bool has_qform = header.qform_code > 0 && shape_of(qform) == Shape::straight;
  if (header.sform_code <= 0) {
    if (has_qform) return qform;
    if (header.qform_code > 0 && !axes_given)
      fail("bad-header", path, "has an unusable qform (" + text_of(qform) + "). Export the scan again.");
    return std::nullopt;
  }
  const Shape shape = shape_of(header.srow);
  const std::string numbers = text_of(header.srow);
  if (shape == Shape::straight) {
    if (!has_qform || same_place(header.srow, qform, dims)) return header.srow;
    const bool take_sform = header.sform_code == scanner || header.qform_code != scanner;
    warn(info, "two-placements",
         "The header places the scan twice, and not alike: sform (code " + std::to_string(header.sform_code) +
             ") " + numbers + "; qform (code " + std::to_string(header.qform_code) + ") " + text_of(qform) +
             ". The " + (take_sform ? "sform" : "qform") + " was taken.");
    return take_sform ? header.srow : qform;
  }
  if (has_qform) {
    warn(info, "repaired-direction",
         std::string("The sform of the header is ") + (shape == Shape::skewed ? "sheared" : "singular") +
             " (" + numbers + "); the qform was taken in its place (" + text_of(qform) + ").");
    return qform;
  }
  if (shape == Shape::skewed) return header.srow;  // made straight, or refused, with all others
  if (axes_given) return std::nullopt;
  fail("bad-header", path,
       "has a singular sform (" + numbers +
           ") and no other placement. Nothing was guessed: say where its axes point with --orientation, for "
           "instance RAS.");
}

void take_place(const NiftiHeader& header, const fs::path& path, const RawImage& image,
                const Context& context, core::VolumeInfo& info) {
  const std::array<int, 3> dims = dims_of(image);
  const bool axes_given = orientation_given(context.options);
  Eigen::Vector3d pixdim = Eigen::Vector3d::Ones();
  info.spacing_provenance.fill(Provenance::assumed);
  std::array<bool, 3> usable{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double size = header.pixdim[axis + 1];
    usable[axis] = std::isfinite(size) && size != 0.0 && static_cast<long long>(axis) < header.dim[0];
    if (usable[axis]) pixdim[static_cast<Eigen::Index>(axis)] = std::abs(size);
  }
  const double unit_mm = length_unit_mm(header, info);
  const bool mm_stated = (header.xyzt_units & 0x07) == 2;
  const auto said = mm_stated ? Provenance::stated : Provenance::derived;
  const auto placement = placement_of(header, path, qform_of(header, pixdim), dims, axes_given, info);
  Eigen::Vector3d spacing = pixdim;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (usable[axis]) info.spacing_provenance[axis] = said;
  if (placement) {
    for (int axis = 0; axis < 3; ++axis) {
      spacing[axis] = placement->col(axis).norm();
      direction.col(axis) = placement->col(axis) / spacing[axis];
      const bool counts = axis < header.dim[0];
      info.spacing_provenance[static_cast<std::size_t>(axis)] = counts ? said : Provenance::assumed;
      if (!counts) spacing[axis] = 1.0;
    }
    origin = placement->col(3);
    info.origin_provenance = said;
    info.direction_provenance = Provenance::stated;
    // Right, anterior, superior in the file; left, posterior, superior here.
    direction.topRows<2>() *= -1.0;
    origin.head<2>() *= -1.0;
  }
  for (int axis = 0; axis < 3; ++axis)
    if (info.spacing_provenance[static_cast<std::size_t>(axis)] != Provenance::assumed)
      spacing[axis] *= unit_mm;
  origin *= unit_mm;
  if (!origin.allFinite()) fail("bad-header", path, "says that it lies at no place in space.");
  if (axes_given) direction = axes_of(context.options.orientation);
  info.geometry = make_geometry(path, dims, spacing, origin.array() + 0.0, direction, info);
}

}  // namespace

Parsed parse_nifti(const fs::path& path, const Context& context) {
  const fs::path header_path = header_file(path);
  std::error_code error;
  if (!fs::is_regular_file(header_path, error))
    fail("not-found", path, "cannot be opened. Check that it is there and may be read.");
  const NiftiHeader header = nifti_header_of(start_of(header_path), path);
  RawImage image;
  set_type(header, path, image);
  set_axes(header, path, image);
  set_scaling(header, image);
  set_file(header, path, voxel_file(path, header_path, header), image);

  core::VolumeInfo info;
  info.format = "NIfTI";
  info.frames = frames_of(path, image);
  take_place(header, path, image, context, info);
  const double unit_s = time_unit_s(header);
  if (unit_s > 0.0) set_even_times(header.pixdim[4] * unit_s, info);
  return read_raw(path, image, std::move(info), context);
}

}  // namespace palpate::imaging::reading
