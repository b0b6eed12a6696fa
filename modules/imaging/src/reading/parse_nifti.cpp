#include "inflate.hpp"
#include "itk_image.hpp"
#include "text_header.hpp"

#include <itkNiftiImageIO.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>

namespace palpate::imaging::reading {
namespace {

using core::Provenance;

constexpr std::size_t header_bytes = 348;

/// The fields of a NIfTI-1 header that are checked before the library sees them.
class NiftiHeader {
 public:
  NiftiHeader(std::string bytes, const std::filesystem::path& path) : bytes_(std::move(bytes)) {
    if (bytes_.size() < header_bytes)
      fail("truncated", path, "is shorter than a NIfTI header. Copy or export it again.");
    const auto size = value<std::int32_t>(0);
    if (size == static_cast<std::int32_t>(header_bytes)) return;
    swapped_ = true;
    if (value<std::int32_t>(0) == static_cast<std::int32_t>(header_bytes)) return;
    if (size == 540 || value<std::int32_t>(0) == 540)
      fail("unsupported", path, "is a NIfTI-2 file, which cannot be read. Convert it to NIfTI-1 or NRRD.");
    fail("bad-header", path, "does not begin like a NIfTI file.");
  }
  template <typename T>
  T value(std::size_t at) const {
    std::array<char, sizeof(T)> raw{};
    std::memcpy(raw.data(), bytes_.data() + at, sizeof(T));
    if (swapped_) std::reverse(raw.begin(), raw.end());
    T result;
    std::memcpy(&result, raw.data(), sizeof(T));
    return result;
  }
  int dim(std::size_t n) const { return value<std::int16_t>(40 + 2 * n); }
  int datatype() const { return value<std::int16_t>(70); }
  int bits() const { return value<std::int16_t>(72); }
  double pixdim(std::size_t n) const { return static_cast<double>(value<float>(76 + 4 * n)); }
  double voxels_at() const { return static_cast<double>(value<float>(108)); }
  int units() const { return static_cast<unsigned char>(bytes_[123]); }
  bool placed() const { return value<std::int16_t>(252) > 0 || value<std::int16_t>(254) > 0; }
  bool two_files() const { return std::memcmp(bytes_.data() + 344, "ni1", 4) == 0; }
  bool single_file() const { return std::memcmp(bytes_.data() + 344, "n+1", 4) == 0; }

 private:
  std::string bytes_;
  bool swapped_ = false;
};

bool is_gzip(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<char, 2> start{};
  file.read(start.data(), 2);
  return file && start[0] == '\x1F' && start[1] == '\x8B';
}

std::string start_of(const std::filesystem::path& path, bool gzip) {
  if (gzip) return inflate_and_count(path, 0, 0, 4096, header_bytes).start;
  std::ifstream file(path, std::ios::binary);
  if (!file) fail("not-found", path, "cannot be opened. Check that it is there and may be read.");
  std::string bytes(header_bytes, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  return bytes;
}

/// Sizes, type and spacing; returns the bytes of all voxels.
double check_header(const NiftiHeader& header, const std::filesystem::path& path) {
  const int axes = header.dim(0);
  if (axes < 1 || axes > 7)
    fail("bad-header", path, "says that it has " + std::to_string(axes) + " axes; 1 to 7 are possible.");
  double voxels = 1.0;
  for (int axis = 1; axis <= axes; ++axis) {
    const int size = header.dim(static_cast<std::size_t>(axis));
    if (size < 1)
      fail("bad-header", path,
           "says that axis " + std::to_string(axis) + " has " + std::to_string(size) +
               " voxels. Export the scan again.");
    voxels *= size;
    const double spacing = header.pixdim(static_cast<std::size_t>(axis));
    if (axis <= 3 && !(std::isfinite(spacing) && spacing != 0.0))
      fail("bad-header", path,
           "says that voxels are " + std::to_string(spacing) + " apart along axis " + std::to_string(axis) +
               ".");
  }
  static constexpr std::array<std::array<int, 2>, 13> types{{{2, 8},
                                                             {4, 16},
                                                             {8, 32},
                                                             {16, 32},
                                                             {32, 64},
                                                             {64, 64},
                                                             {128, 24},
                                                             {256, 8},
                                                             {512, 16},
                                                             {768, 32},
                                                             {1024, 64},
                                                             {1280, 64},
                                                             {2304, 32}}};
  const auto type =
      std::find_if(types.begin(), types.end(), [&](const auto& t) { return t[0] == header.datatype(); });
  if (type == types.end())
    fail("unsupported", path,
         "has voxels of NIfTI type " + std::to_string(header.datatype()) + ", which cannot be read.");
  if ((*type)[1] != header.bits())
    fail("bad-header", path,
         "says that a voxel has " + std::to_string(header.bits()) + " bits where its type has " +
             std::to_string((*type)[1]) + ".");
  return voxels * (*type)[1] / 8.0;
}

std::filesystem::path voxel_file(const std::filesystem::path& path, const NiftiHeader& header) {
  if (!header.two_files()) return path;
  std::filesystem::path image = path;
  if (image.extension() == ".hdr") image.replace_extension(".img");
  if (std::filesystem::exists(image)) return image;
  if (std::filesystem::exists(image.string() + ".gz")) return image.string() + ".gz";
  fail(
      "not-found", path,
      "needs its voxels from " + image.filename().string() + ", which is missing. Put both into one folder.");
}

double time_unit_s(int units) {
  switch (units & 0x38) {
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

}  // namespace

Parsed parse_nifti(const std::filesystem::path& path, const Context& context) {
  std::filesystem::path header_path = path;
  const std::string name = path.filename().string();
  if (path.extension() == ".img") header_path.replace_extension(".hdr");
  if (name.size() > 7 && name.compare(name.size() - 7, 7, ".img.gz") == 0)
    header_path = path.parent_path() / (name.substr(0, name.size() - 7) + ".hdr");
  if (!std::filesystem::exists(header_path))
    fail("not-found", path,
         "belongs to a header file " + header_path.filename().string() + ", which is missing.");
  const NiftiHeader header(start_of(header_path, is_gzip(header_path)), path);
  if (!header.single_file() && !header.two_files())
    fail("unsupported", path, "is an Analyze file or a damaged NIfTI file. Export NIfTI-1 (.nii).");
  const double needed = check_header(header, path);
  check_memory(path, needed, 0.0, context);

  core::VolumeInfo info;
  info.format = "NIfTI";
  const auto data = voxel_file(header_path, header);
  const double offset = header.voxels_at();
  if (!std::isfinite(offset) || offset < 0.0 || offset > 1e9 || (header.single_file() && offset < 348.0))
    fail("bad-header", path,
         "says that its voxels begin at byte " + std::to_string(offset) + ". Export the scan again.");
  const auto total = static_cast<std::uint64_t>(offset + needed);
  const double bytes = is_gzip(data) ? static_cast<double>(inflate_and_count(data, 0, 0, total).bytes)
                                     : static_cast<double>(std::filesystem::file_size(data));
  if (bytes < offset + needed) {
    if (!context.options.allow_truncated)
      fail("truncated", path,
           "holds " + std::to_string(static_cast<long long>(std::max(0.0, bytes - offset))) +
               " bytes of voxels where its header speaks of " +
               std::to_string(static_cast<long long>(needed)) + ". It was cut off: copy or export it again.");
    warn(info, "truncated", "The file was cut off; the voxels that are missing are black.");
  }
  const bool flat = header.dim(0) < 3 || header.dim(3) == 1;
  info.spacing_provenance = {Provenance::stated, Provenance::stated,
                             header.dim(0) < 3 ? Provenance::assumed : Provenance::stated};
  if (flat && !(header.pixdim(3) > 0.0)) info.spacing_provenance[2] = Provenance::assumed;
  info.origin_provenance = info.direction_provenance =
      header.placed() ? Provenance::stated : Provenance::absent;
  Layout layout;
  if (header.dim(0) >= 4 && header.dim(4) > 1) {
    const double unit_s = time_unit_s(header.units());
    const double step = header.pixdim(4);
    if (unit_s > 0.0 && std::isfinite(step) && step > 0.0) layout.frame_spacing_s = step * unit_s;
    if (layout.frame_spacing_s > 60.0)
      warn(info, "implausible-time",
           "By its header a frame lasts " + std::to_string(static_cast<long long>(layout.frame_spacing_s)) +
               " s; the file may mean milliseconds.");
  }
  if (header.datatype() != 128 && header.datatype() != 2304) layout.colour = false;
  const auto io = itk::NiftiImageIO::New();
  return read_through(*io, path, std::move(info), layout, context);
}

}  // namespace palpate::imaging::reading
