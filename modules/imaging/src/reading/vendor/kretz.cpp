// GE Kretz volumes: tagged items behind a line of text, voxels along rays.
#include "kretz.hpp"

#include "../orientation.hpp"
#include "../settle.hpp"
#include "scan_conversion.hpp"
#include "vendor.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <optional>
#include <sstream>
#include <utility>

namespace palpate::imaging::reading {
namespace {

using core::Provenance;

constexpr char first_line[] = "KRETZFILE 1.0   ";
constexpr std::size_t line_bytes = sizeof(first_line) - 1;
constexpr const char* creator = "KRETZ_US";
constexpr std::uint16_t creator_group = 0x7FE1;

/// Bytes of an item, little-endian.
struct Span {
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;

  template <typename T>
  std::vector<T> values() const {
    std::vector<T> all(size / sizeof(T));
    if (!all.empty()) std::memcpy(all.data(), data, all.size() * sizeof(T));
    return all;
  }
  double real() const {
    const auto all = values<double>();
    return all.empty() || !std::isfinite(all.front()) ? 0.0 : all.front();
  }
  int count() const {
    const auto all = values<std::uint16_t>();
    return all.empty() ? 0 : all.front();
  }
};

struct KretzData {
  std::array<int, 3> dims{};  ///< radius, fan, sweep
  double step_m = 0.0, first_steps = 0.0, axis_steps = 0.0, cartesian_mm = 0.0;
  std::vector<double> fan, sweep;
  Span voxels, sequence;
  std::string machine;
};

void take(std::uint16_t group, std::uint16_t element, const Span& value, KretzData& data) {
  const auto is = [&](std::uint16_t g, std::uint16_t e) { return group == g && element == e; };
  for (std::uint16_t axis = 0; axis < 3; ++axis)
    if (is(0xC000, static_cast<std::uint16_t>(axis + 1))) data.dims[axis] = value.count();
  if (is(0xC100, 0x0001)) data.step_m = value.real();
  if (is(0xC200, 0x0001)) data.first_steps = value.real();
  if (is(0xC200, 0x0002)) data.axis_steps = -value.real();
  if (is(0xC300, 0x0001)) data.sweep = value.values<double>();
  if (is(0xC300, 0x0002)) data.fan = value.values<double>();
  if (is(0x0010, 0x0022)) data.cartesian_mm = value.real();
  if (is(0x0130, 0x0001)) data.machine = {reinterpret_cast<const char*>(value.data), value.size};
  if (is(0xD000, 0x0001)) data.voxels = value;
  if (is(0xD600, 0x0001)) data.sequence = value;
}

KretzData items_of(const std::filesystem::path& path, const std::vector<std::uint8_t>& bytes) {
  if (bytes.size() < line_bytes || std::memcmp(bytes.data(), first_line, line_bytes) != 0)
    fail("unsupported", path,
         "holds no Kretz volume of version 1.0, which is the only one that can be read. Export it as "
         "Cartesian DICOM, or save it from 4D View without compression.");
  KretzData data;
  for (std::size_t at = line_bytes; at + 8 <= bytes.size();) {
    std::uint16_t group = 0;
    std::uint16_t element = 0;
    std::uint32_t length = 0;
    std::memcpy(&group, &bytes[at], 2);
    std::memcpy(&element, &bytes[at + 2], 2);
    std::memcpy(&length, &bytes[at + 4], 4);
    at += 8;
    if (group == 0xFFFF) break;
    if (length > bytes.size() - at)
      fail("truncated", path,
           "ends within an item of its Kretz volume, which should have " + std::to_string(length) +
               " bytes where " + std::to_string(bytes.size() - at) + " are left. Copy or export it again.");
    take(group, element, {bytes.data() + at, length}, data);
    at += length;
  }
  while (!data.machine.empty() && (data.machine.back() == '\0' || data.machine.back() == ' '))
    data.machine.pop_back();
  return data;
}

std::size_t voxels_of(const KretzData& data) {
  return static_cast<std::size_t>(data.dims[0]) * static_cast<std::size_t>(data.dims[1]) *
         static_cast<std::size_t>(data.dims[2]);
}

void check_voxels(const std::filesystem::path& path, const KretzData& data) {
  const std::size_t count = voxels_of(data);
  if (count == 0)
    fail("unsupported", path, "holds a Kretz volume without its dimensions (C000). Export it again.");
  if (data.voxels.size == count) return;
  std::ostringstream text;
  text << "holds a Kretz volume of " << data.dims[0] << " x " << data.dims[1] << " x " << data.dims[2]
       << " voxels, but " << data.voxels.size
       << " bytes of them: it is compressed or of more than 8 bits, which cannot be read. Save it from 4D "
          "View "
          "with wavelet compression set to none, or export it as Cartesian DICOM.";
  fail("unsupported", path, text.str());
}

/// Angles count from the side; straight ahead is a right angle.
std::vector<double> from_ahead(const std::vector<double>& angles) {
  constexpr double right_angle = 1.57079632679489662;
  std::vector<double> result;
  for (const double angle : angles) result.push_back(angle - right_angle);
  return result;
}

bool is_fan(const std::vector<double>& angles) {
  constexpr double half_turn = 3.1415926535897932;
  if (angles.size() < 2) return false;
  const bool rises = angles.back() > angles.front();
  for (std::size_t n = 0; n < angles.size(); ++n) {
    if (!std::isfinite(angles[n]) || std::abs(angles[n]) > half_turn) return false;
    if (n > 0 && (rises ? angles[n] <= angles[n - 1] : angles[n] >= angles[n - 1])) return false;
  }
  return true;
}

SweptFan fan_of(const std::filesystem::path& path, const KretzData& data) {
  SweptFan fan;
  constexpr double mm_a_m = 1000.0;
  fan.step_mm = data.step_m * mm_a_m;
  fan.first_mm = data.first_steps * fan.step_mm;
  fan.axis_mm = data.axis_steps * fan.step_mm;
  fan.radial = data.dims[0];
  fan.fan = from_ahead(data.fan);
  fan.sweep = from_ahead(data.sweep);
  const bool sizes = fan.fan.size() == static_cast<std::size_t>(data.dims[1]) &&
                     fan.sweep.size() == static_cast<std::size_t>(data.dims[2]);
  constexpr double longest_mm = 1000.0;
  const double last_mm = fan.first_mm + fan.step_mm * (fan.radial - 1);
  if (!sizes || !is_fan(fan.fan) || !is_fan(fan.sweep) || fan.radial < 2 || !(fan.step_mm > 1e-4) ||
      !(fan.first_mm >= 0.0) || !(last_mm < longest_mm) || !(std::abs(fan.axis_mm) < longest_mm)) {
    std::ostringstream text;
    text << "holds a Kretz volume whose beams make no fan (" << data.dims[1] << " and " << data.dims[2]
         << " angles said, " << fan.fan.size() << " and " << fan.sweep.size() << " given; steps of "
         << fan.step_mm << " mm from " << fan.first_mm << " mm, swept about " << fan.axis_mm
         << " mm). Nothing was guessed. Export it as Cartesian DICOM.";
    fail("unsupported", path, text.str());
  }
  return fan;
}

/// The user's spacing, or the step along the beams where a grid of it fits a
/// sixteenth of the memory: whoever works on it holds several copies.
core::ImageGeometry choose_grid(const SweptFan& fan, const Context& context) {
  if (context.options.grid_spacing_mm) {
    const double wished = *context.options.grid_spacing_mm;
    if (!(wished >= 0.01) || !(wished <= 100.0))
      core::throw_usage("The grid spacing must be from 0.01 to 100 mm.");
    return cartesian_grid(fan, wished);
  }
  const auto box = fan.bounds();
  const double volume = (box[1] - box[0]).prod();
  const double most_voxels = static_cast<double>(context.memory_bytes) / 16.0 / sizeof(float);
  return cartesian_grid(fan, std::max(fan.step_mm, std::cbrt(volume / most_voxels)));
}

void settle(const std::string& kind, const Context& context, core::VolumeInfo& info) {
  info.orientation_choices = {"RAS", "LPS", "LPI", "RPI"};
  info.direction_provenance = Provenance::assumed;
  info.geometry = core::ImageGeometry(info.geometry.dims(), info.geometry.spacing_mm(),
                                      info.geometry.origin_mm(), axes_of(info.orientation_choices.front()));
  say_orientation(kind, context.options, info);
}

Parsed parse_kretz(const std::filesystem::path& path, const std::vector<std::uint8_t>& bytes,
                   core::VolumeInfo info, const Context& context) {
  const KretzData data = items_of(path, bytes);
  check_voxels(path, data);
  const std::size_t count = voxels_of(data);
  info.pixel_type = "uint8";
  info.components = 1;
  if (info.scanner.empty()) info.scanner = data.machine;
  // A sequence is whole volumes one after another.
  const bool sequence = data.sequence.size > count && data.sequence.size % count == 0;
  const std::uint8_t* voxels = sequence ? data.sequence.data : data.voxels.data;
  info.frames = sequence ? static_cast<int>(data.sequence.size / count) : 1;
  const bool polar = !data.fan.empty() || !data.sweep.empty();
  SweptFan fan;
  if (polar) {
    fan = fan_of(path, data);
    info.geometry = choose_grid(fan, context);
    info.spacing_provenance.fill(Provenance::derived);
    info.origin_provenance = Provenance::derived;
    std::ostringstream text;
    text << data.dims[1] << " x " << data.dims[2] << " beams of " << data.dims[0] << " points " << fan.step_mm
         << " mm apart were converted to a grid of " << info.geometry.spacing_mm()[0]
         << " mm by linear interpolation; outside the beams it is 0. --grid-spacing chooses another.";
    warn(info, "scan-converted", text.str());
  } else {
    const bool size =
        std::isfinite(data.cartesian_mm) && data.cartesian_mm > 1e-3 && data.cartesian_mm < 10.0;
    info.geometry = core::ImageGeometry(data.dims, Eigen::Vector3d::Constant(size ? data.cartesian_mm : 1.0),
                                        Eigen::Vector3d::Zero());
    info.spacing_provenance.fill(size ? Provenance::private_tag : Provenance::assumed);
  }
  settle("A Kretz volume", context, info);
  Parsed parsed;
  std::tie(parsed.first_frame, parsed.kept_frames) = frames_to_keep(context.options, info.frames);
  const std::size_t grid = info.geometry.voxel_count();
  const std::size_t kept = grid * static_cast<std::size_t>(parsed.kept_frames);
  check_memory(path, static_cast<double>(bytes.size()), static_cast<double>(kept), context);
  if (!context.headers_only) {
    parsed.voxels = context.allocate(kept);
    for (int n = 0; n < parsed.kept_frames; ++n) {
      const std::uint8_t* from = voxels + count * static_cast<std::size_t>(parsed.first_frame + n);
      float* to = parsed.voxels.get() + grid * static_cast<std::size_t>(n);
      const core::Progress part =
          context.progress.part(0.1 + 0.9 * n / parsed.kept_frames, 0.1 + 0.9 * (n + 1) / parsed.kept_frames);
      // The conversion works in the probe's axes; where they point does not matter to it.
      if (polar)
        scan_convert(
            fan, from,
            core::ImageGeometry(info.geometry.dims(), info.geometry.spacing_mm(), info.geometry.origin_mm()),
            to, part);
      else
        std::copy(from, from + count, to);
    }
  }
  // The box's first corner in the axes that were taken.
  info.geometry =
      core::ImageGeometry(info.geometry.dims(), info.geometry.spacing_mm(),
                          info.geometry.direction() * info.geometry.origin_mm(), info.geometry.direction());
  settle_geometry(context.options, info);
  parsed.info = std::move(info);
  return parsed;
}

}  // namespace

bool is_kretz_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string start(line_bytes, '\0');
  file.read(start.data(), static_cast<std::streamsize>(start.size()));
  return file && start == first_line;
}

bool holds_kretz(const DicomFile& file) {
  return file.dataset().private_tag(creator_group, creator, 0x01).has_value();
}

Parsed parse_kretz_file(const std::filesystem::path& path, const Context& context) {
  const auto size = static_cast<double>(std::filesystem::file_size(path));
  check_memory(path, size, 0.0, context);
  context.progress.report(0.0, "Reading the file");
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
  std::ifstream file(path, std::ios::binary);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  core::VolumeInfo info;
  info.format = "Kretz";
  info.modality = "US";
  return parse_kretz(path, bytes, std::move(info), context);
}

Parsed parse_kretz_in(const DicomFile& file, core::VolumeInfo info, const Context& context) {
  const auto tag = file.dataset().private_tag(creator_group, creator, 0x01);
  check_memory(file.path(), static_cast<double>(std::filesystem::file_size(file.path())), 0.0, context);
  return parse_kretz(file.path(), tag ? file.dataset().bytes(*tag) : std::vector<std::uint8_t>{},
                     std::move(info), context);
}

}  // namespace palpate::imaging::reading
