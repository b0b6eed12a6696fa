#include "nrrd_header.hpp"
#include "orientation.hpp"
#include "settle.hpp"
#include "text_header.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace palpate::imaging::reading {
namespace {

namespace fs = std::filesystem;
using core::Provenance;

/// The space that directions and origin are given in.
struct Space {
  int dimension = 0;                  ///< of its vectors, time included
  bool time = false;                  ///< their last number is time
  bool patient = false;               ///< its axes are the patient's
  double flip_x = 1.0, flip_y = 1.0;  ///< to LPS
};

Space space_of(const NrrdHeader& header, const fs::path& path) {
  Space space;
  std::string name = lower_case(header.at("space"));
  std::replace(name.begin(), name.end(), ' ', '-');
  if (name == "rast" || name == "last" || name == "lpst") name = name.substr(0, 3) + "-time";
  const auto time = name.rfind("-time");
  if (time != std::string::npos && time + 5 == name.size()) {
    space.time = true;
    name.resize(time);
  }
  static const std::map<std::string, std::pair<double, double>> flips{
      {"ras", {-1, -1}}, {"right-anterior-superior", {-1, -1}},
      {"las", {1, -1}},  {"left-anterior-superior", {1, -1}},
      {"lps", {1, 1}},   {"left-posterior-superior", {1, 1}}};
  const auto found = flips.find(name);
  if (found != flips.end()) {
    space.patient = true;
    space.flip_x = found->second.first;
    space.flip_y = found->second.second;
  }
  if (!name.empty()) space.dimension = space.time ? 4 : 3;
  const std::string stated = header.at("spacedimension");
  if (stated.empty()) return space;
  const auto dimension = whole_number(stated);
  if (!dimension || *dimension < 1 || *dimension > 4)
    fail("bad-header", path, "says space dimension: " + stated.substr(0, 40) + "; 1 to 4 are possible.");
  space.dimension = static_cast<int>(*dimension);
  return space;
}

/// What the axes of the file turned out to be.
struct Roles {
  std::vector<std::size_t> space;     ///< the axes that are i, j, k
  std::optional<std::size_t> frame;   ///< the one that is time or a list
  std::optional<std::size_t> values;  ///< the one that is a colour or a complex number
  GreyRule rule = GreyRule::only;
};

enum class Meaning { space, frame, colour, complex, vector, single, unknown, other };

Meaning meaning_of(const NrrdAxis& axis, bool directions, const Space& space) {
  if (directions && axis.direction) {
    // Along time alone, in a space that has it.
    const auto& vector = *axis.direction;
    const auto still = static_cast<std::size_t>(std::max(0, space.dimension - 1));
    const bool in_time = space.time && vector.size() == still + 1 &&
                         std::all_of(vector.begin(), vector.begin() + static_cast<std::ptrdiff_t>(still),
                                     [](double value) { return value == 0.0; });
    return in_time || axis.kind == "time" || axis.kind == "list" ? Meaning::frame : Meaning::space;
  }
  const std::string& kind = axis.kind;
  if (kind == "domain" || kind == "space")
    return directions ? Meaning::frame : Meaning::space;  // an axis outside of space that samples something
  if (kind == "time" || kind == "list") return Meaning::frame;
  if (kind == "rgb-color" || kind == "rgba-color" || kind == "3-color" || kind == "4-color")
    return Meaning::colour;
  if (kind == "complex") return Meaning::complex;
  if (kind == "vector" || kind == "3-vector" || kind == "4-vector") return Meaning::vector;
  if (kind == "scalar" || kind == "stub") return Meaning::single;
  if (kind.empty() || kind == "???" || kind == "none") return Meaning::unknown;
  return Meaning::other;
}

[[noreturn]] void fail_kind(const fs::path& path, const NrrdAxis& axis) {
  fail("unsupported", path,
       "holds " + std::to_string(axis.size) + " numbers in each voxel (kind " +
           (axis.kind.empty() ? "unknown" : axis.kind.substr(0, 40)) +
           "), which are no colour. Export a scan of grey or colour voxels.");
}

void take_frame_axis(const fs::path& path, const std::vector<NrrdAxis>& axes, std::size_t axis,
                     Roles& roles) {
  if (axes[axis].size == 1) return;
  if (roles.frame) fail("unsupported", path, "has two axes that are no space. Export one of them at a time.");
  roles.frame = axis;
}

Roles roles_of(const std::vector<NrrdAxis>& axes, const Space& space, VoxelType type, const fs::path& path) {
  const bool directions =
      std::any_of(axes.begin(), axes.end(), [](const auto& axis) { return axis.direction; });
  const bool spacings = std::any_of(axes.begin(), axes.end(), [](const auto& axis) { return axis.spacing; });
  const bool small_whole = type == VoxelType::uint8 || type == VoxelType::uint16;
  Roles roles;
  const auto take_values = [&](std::size_t axis, GreyRule rule) {
    if (axes[axis].size == 1) return;
    if (roles.values) fail_kind(path, axes[axis]);
    roles.values = axis;
    roles.rule = rule;
  };
  for (std::size_t n = 0; n < axes.size(); ++n) {
    const NrrdAxis& axis = axes[n];
    const bool three_or_four = axis.size == 3 || axis.size == 4;
    switch (meaning_of(axis, directions, space)) {
      case Meaning::space:
        roles.space.push_back(n);
        break;
      case Meaning::frame:
        take_frame_axis(path, axes, n, roles);
        break;
      case Meaning::colour:
        if (axis.size != 1 && !three_or_four) fail_kind(path, axis);
        take_values(n, GreyRule::luma);
        break;
      case Meaning::complex:
        if (axis.size != 1 && axis.size != 2) fail_kind(path, axis);
        take_values(n, GreyRule::magnitude);
        break;
      case Meaning::vector:  // as colour is often called
        if (axis.size != 1 && !(three_or_four && small_whole)) fail_kind(path, axis);
        take_values(n, GreyRule::luma);
        break;
      case Meaning::unknown:
        if (directions || (spacings && !axis.spacing)) {
          if (n == 0 && three_or_four && small_whole)
            take_values(n, GreyRule::luma);
          else
            take_frame_axis(path, axes, n, roles);
        } else {
          roles.space.push_back(n);
        }
        break;
      case Meaning::single:
      case Meaning::other:
        if (axis.size != 1) fail_kind(path, axis);
        break;
    }
  }
  // A fourth axis that is like the other three is time; axes of one entry are none.
  while (roles.space.size() > 3) {
    const std::size_t last = roles.space.back();
    roles.space.pop_back();
    take_frame_axis(path, axes, last, roles);
  }
  if (roles.space.empty()) fail("unsupported", path, "has no axis in space.");
  return roles;
}

void set_axes(const std::vector<NrrdAxis>& axes, const Roles& roles, RawImage& image) {
  constexpr std::array<Role, 3> in_space{Role::i, Role::j, Role::k};
  for (std::size_t n = 0; n < axes.size(); ++n) {
    Role role = Role::single;
    for (std::size_t s = 0; s < roles.space.size(); ++s)
      if (roles.space[s] == n) role = in_space[s];
    if (roles.frame == n) role = Role::frame;
    if (roles.values == n) role = Role::component;
    image.axes.push_back({axes[n].size, role});
  }
  image.rule = roles.rule;
}

struct Place {
  Eigen::Vector3d spacing = Eigen::Vector3d::Ones();
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();
  double unit_mm = 1.0;
};

/// The unit of length, of the space or of its axes.
void take_unit(const NrrdHeader& header, const std::vector<NrrdAxis>& axes, const Roles& roles, Place& place,
               core::VolumeInfo& info) {
  auto units = quoted_words(header.at("spaceunits"));
  if (units.empty())
    for (const std::size_t axis : roles.space)
      if (!axes[axis].unit.empty()) units.push_back(axes[axis].unit);
  if (units.size() > roles.space.size()) units.resize(roles.space.size());
  for (const auto& unit : units) {
    if (unit.empty() || unit == "???" || lower_case(unit) == "none") continue;
    const auto factor = millimetres_in(unit);
    if (!factor || (unit != units.front() && factor != millimetres_in(units.front()))) {
      warn(info, "unknown-unit",
           "Its unit of length, \"" + unit.substr(0, 20) +
               "\", is not known or not the same for all axes; mm was taken.");
      place.unit_mm = 1.0;
      return;
    }
    place.unit_mm = *factor;
  }
}

Eigen::Vector3d in_lps(const std::vector<double>& vector, const Space& space) {
  Eigen::Vector3d lps = Eigen::Vector3d::Zero();
  for (std::size_t n = 0; n < 3 && n < vector.size(); ++n) lps[static_cast<Eigen::Index>(n)] = vector[n];
  if (space.time && space.dimension < 4) lps[space.dimension - 1] = 0.0;
  lps[0] = lps[0] * space.flip_x + 0.0;
  lps[1] = lps[1] * space.flip_y + 0.0;
  return lps;
}

/// Directions of one or two axes, filled up to three.
void complete(Eigen::Matrix3d& direction, std::size_t axes) {
  if (axes < 2) direction.col(1) = direction.col(0).unitOrthogonal();
  if (axes < 3) {
    const Eigen::Vector3d normal = direction.col(0).cross(direction.col(1));
    if (normal.norm() > 0.0) direction.col(2) = normal.normalized();
  }
}

void take_directions(const NrrdHeader& header, const fs::path& path, const std::vector<NrrdAxis>& axes,
                     const Roles& roles, const Space& space, Place& place, core::VolumeInfo& info) {
  const auto placed = space.patient ? Provenance::stated : Provenance::assumed;
  const auto unit = place.unit_mm == 1.0 ? Provenance::stated : Provenance::derived;
  for (std::size_t n = 0; n < roles.space.size(); ++n) {
    const auto& vector = axes[roles.space[n]].direction;
    const auto column = static_cast<Eigen::Index>(n);
    if (!vector || static_cast<int>(vector->size()) != space.dimension)
      fail("bad-header", path, "has space directions that do not fit its space.");
    const Eigen::Vector3d lps = in_lps(*vector, space);
    const double length = lps.norm();
    if (!std::isfinite(length) || length == 0.0)
      fail("bad-header", path,
           "has an unusable space direction for axis " + std::to_string(roles.space[n]) + ": " +
               header.at("spacedirections").substr(0, 120) + ".");
    place.spacing[column] = length * place.unit_mm;
    place.direction.col(column) = lps / length;
    info.spacing_provenance[n] = unit;
  }
  complete(place.direction, roles.space.size());
  info.direction_provenance = placed;
}

void take_spacings(const std::vector<NrrdAxis>& axes, const Roles& roles, Place& place,
                   core::VolumeInfo& info, const fs::path& path) {
  for (std::size_t n = 0; n < roles.space.size(); ++n) {
    const NrrdAxis& axis = axes[roles.space[n]];
    const auto row = static_cast<Eigen::Index>(n);
    if (axis.spacing) {
      if (*axis.spacing == 0.0) fail("bad-header", path, "says that its voxels are 0 apart.");
      place.spacing[row] = std::abs(*axis.spacing) * place.unit_mm;
      info.spacing_provenance[n] = place.unit_mm == 1.0 ? Provenance::stated : Provenance::derived;
    } else if (axis.min && axis.max && *axis.max != *axis.min && (axis.cells || axis.size > 1)) {
      const double steps = static_cast<double>(axis.cells ? axis.size : axis.size - 1);
      place.spacing[row] = std::abs(*axis.max - *axis.min) / steps * place.unit_mm;
      info.spacing_provenance[n] = Provenance::derived;
    }
  }
}

void take_place(const NrrdHeader& header, const fs::path& path, const std::vector<NrrdAxis>& axes,
                const Roles& roles, const Space& space, Place& place, core::VolumeInfo& info) {
  take_unit(header, axes, roles, place, info);
  info.spacing_provenance.fill(Provenance::assumed);
  if (header.has("spacedirections"))
    take_directions(header, path, axes, roles, space, place, info);
  else
    take_spacings(axes, roles, place, info, path);
  // Without a named space the axes are taken as they are, and nobody said so.
  if (header.has("spaceorigin")) {
    const auto vectors = nrrd_vectors(header.at("spaceorigin"), path);
    if (vectors.size() != 1 || !vectors[0] || static_cast<int>(vectors[0]->size()) != space.dimension ||
        !in_lps(*vectors[0], space).allFinite())
      fail("bad-header", path,
           "has an unusable space origin (" + header.at("spaceorigin").substr(0, 80) + ").");
    place.origin = in_lps(*vectors[0], space) * place.unit_mm;
    info.origin_provenance = !space.patient         ? Provenance::assumed
                             : place.unit_mm == 1.0 ? Provenance::stated
                                                    : Provenance::derived;
  }
  // A tracked picture lies in its own pixels; where it was in space is said frame by frame.
  const auto seq = header.keys.lower_bound("Seq_Frame");
  const bool tracked = seq != header.keys.end() && seq->first.compare(0, 9, "Seq_Frame") == 0;
  if (!tracked || place.spacing != Eigen::Vector3d::Ones()) return;
  info.spacing_provenance.fill(Provenance::assumed);
  info.origin_provenance = info.direction_provenance = Provenance::absent;
}

/// The times that 3D Slicer keeps with a multi-volume.
std::vector<double> listed_times(const NrrdHeader& header) {
  const auto key = [&](const char* name) {
    const auto found = header.keys.find(name);
    return found == header.keys.end() ? std::string() : found->second;
  };
  const auto unit = seconds_in(key("MultiVolume.FrameIdentifyingDICOMTagUnits"));
  std::string labels = key("MultiVolume.FrameLabels");
  std::replace(labels.begin(), labels.end(), ',', ' ');
  std::vector<double> times;
  for (const auto& word : words_of(labels)) {
    const auto value = number(word);
    if (!value || !std::isfinite(*value) || !unit) return {};
    times.push_back((*value - (times.empty() ? *value : *number(words_of(labels).front()))) * *unit);
  }
  return times;
}

std::vector<double> tracked_times(const NrrdHeader& header, int frames) {
  std::map<long long, double> stamps;
  for (const auto& [name, text] : header.keys) {
    if (name.compare(0, 9, "Seq_Frame") != 0) continue;
    const auto line = name.find('_', 9);
    if (line == std::string::npos || name.substr(line) != "_Timestamp") continue;
    const auto frame = whole_number(name.substr(9, line - 9));
    const auto time = number(text);
    if (frame && time && std::isfinite(*time)) stamps[*frame] = *time;
  }
  std::vector<double> times;
  for (int frame = 0; frame < frames; ++frame) {
    if (stamps.count(frame) == 0) return {};
    times.push_back(stamps[frame] - stamps[0]);
  }
  return times;
}

void take_times(const NrrdHeader& header, const std::vector<NrrdAxis>& axes, const Roles& roles,
                const Space& space, core::VolumeInfo& info) {
  if (!roles.frame) return;
  const NrrdAxis& axis = axes[*roles.frame];
  auto times = tracked_times(header, info.frames);
  if (times.empty()) times = listed_times(header);
  if (static_cast<int>(times.size()) == info.frames) {
    info.frame_times_s = times;
    info.time_provenance = Provenance::stated;
    return;
  }
  double step = axis.spacing.value_or(0.0);
  if (space.time && axis.direction && static_cast<int>(axis.direction->size()) == space.dimension)
    step = std::abs(axis.direction->back());
  std::string unit = axis.unit;
  const auto space_units = quoted_words(header.at("spaceunits"));
  if (unit.empty() && space.time && static_cast<int>(space_units.size()) == space.dimension)
    unit = space_units.back();
  if (axis.kind == "list" && unit.empty() && step == 1.0) return;   // counted, not timed
  if (!unit.empty() && unit != "???" && !seconds_in(unit)) return;  // another quantity than time
  set_even_times(step * seconds_in(unit).value_or(1.0), info);
}

}  // namespace

Parsed parse_nrrd(const fs::path& path, const Context& context) {
  const NrrdHeader header = read_nrrd_header(path);
  const auto axes = nrrd_axes(header, path);
  RawImage image = nrrd_voxels(header, path, axes);
  const Space space = space_of(header, path);
  const Roles roles = roles_of(axes, space, image.type, path);
  set_axes(axes, roles, image);

  core::VolumeInfo info;
  info.format = "NRRD";
  info.frames = frames_of(path, image);
  Place place;
  take_place(header, path, axes, roles, space, place, info);
  take_times(header, axes, roles, space, info);
  if (orientation_given(context.options)) place.direction = axes_of(context.options.orientation);
  info.geometry = make_geometry(path, dims_of(image), place.spacing, place.origin, place.direction, info);
  return read_raw(path, image, std::move(info), context);
}

}  // namespace palpate::imaging::reading
