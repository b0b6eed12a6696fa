#include "orientation.hpp"

#include "text_header.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <array>
#include <cctype>

namespace palpate::imaging::reading {
namespace {

// Towards rising L, P, S; and the other way.
constexpr std::array<char, 3> forward{'L', 'P', 'S'};
constexpr std::array<char, 3> backward{'R', 'A', 'I'};

}  // namespace

std::string orientation_of(const core::ImageGeometry& geometry) {
  std::string word(3, '?');
  for (int lps = 0; lps < 3; ++lps) {
    const int axis = geometry.axis_closest_to(lps);
    const bool rising = geometry.direction()(lps, axis) >= 0.0;
    word[static_cast<std::size_t>(axis)] =
        rising ? forward[static_cast<std::size_t>(lps)] : backward[static_cast<std::size_t>(lps)];
  }
  return word;
}

Eigen::Matrix3d axes_of(const std::string& orientation) {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
  std::array<bool, 3> named{};
  bool sound = orientation.size() == 3;
  for (std::size_t axis = 0; sound && axis < 3; ++axis) {
    const char letter = static_cast<char>(std::toupper(static_cast<unsigned char>(orientation[axis])));
    for (std::size_t lps = 0; lps < 3; ++lps) {
      if (letter != forward[lps] && letter != backward[lps]) continue;
      named[lps] = true;
      axes(static_cast<Eigen::Index>(lps), static_cast<Eigen::Index>(axis)) =
          letter == forward[lps] ? 1.0 : -1.0;
    }
  }
  if (!sound || !std::all_of(named.begin(), named.end(), [](bool is) { return is; }))
    core::throw_usage("\"" + orientation +
                      "\" is no orientation; it must be \"file\", or say where i, j and k point to, with one "
                      "letter each of L or R, P or A, S or I, such as LPS or RAS.");
  return axes;
}

void settle_orientation(const ReadOptions& options, core::VolumeInfo& info) {
  if (!options.orientation.empty() && lower_case(options.orientation) != "file") {
    const core::ImageGeometry& from = info.geometry;
    info.geometry =
        core::ImageGeometry(from.dims(), from.spacing_mm(), from.origin_mm(), axes_of(options.orientation));
    info.direction_provenance = core::Provenance::user;
  }
  info.orientation = orientation_of(info.geometry);
  const auto from = info.direction_provenance;
  const bool said = from == core::Provenance::stated || from == core::Provenance::private_tag ||
                    from == core::Provenance::derived;
  info.patient_axes = from == core::Provenance::user || (said && info.orientation_choices.empty());
}

}  // namespace palpate::imaging::reading
