#include "stated_geometry.hpp"

#include <QCoreApplication>

#include <algorithm>
#include <cmath>

namespace palpate::gui {
namespace {

// Towards rising L, P, S; and the other way.
const QString forward = QStringLiteral("LPS");
const QString backward = QStringLiteral("RAI");

int lps_axis(QChar letter) { return std::max(forward.indexOf(letter), backward.indexOf(letter)); }

Eigen::Matrix3d axes_of(const QString& word) {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
  for (int axis = 0; axis < 3; ++axis)
    axes(lps_axis(word.at(axis)), axis) = forward.contains(word.at(axis)) ? 1.0 : -1.0;
  return axes;
}

QString direction_word(QChar letter) {
  const auto word = [](const char* text) { return QCoreApplication::translate("Orientation", text); };
  switch (letter.toLatin1()) {
    case 'L':
      return word("left");
    case 'R':
      return word("right");
    case 'P':
      return word("back");
    case 'A':
      return word("front");
    case 'S':
      return word("head");
    default:
      return word("feet");
  }
}

void drop_spacing_warnings(core::VolumeInfo& info) {
  const auto about_spacing = [](const core::Warning& warning) {
    return warning.code == "assumed-spacing" || warning.code == "implausible-spacing";
  };
  info.warnings.erase(std::remove_if(info.warnings.begin(), info.warnings.end(), about_spacing),
                      info.warnings.end());
}

}  // namespace

bool is_orientation(const QString& word) {
  if (word.size() != 3) return false;
  std::array<bool, 3> named{};
  for (const QChar letter : word) {
    const int axis = lps_axis(letter);
    if (axis < 0) return false;
    named[static_cast<std::size_t>(axis)] = true;
  }
  return named[0] && named[1] && named[2];
}

core::VolumeInfo restated(const core::VolumeInfo& file,
                          const std::optional<std::array<double, 3>>& spacing_mm,
                          const std::string& orientation) {
  core::VolumeInfo info = file;
  const QString word = QString::fromStdString(orientation).toUpper();
  if (is_orientation(word)) {
    info.geometry = core::ImageGeometry(file.geometry.dims(), file.geometry.spacing_mm(),
                                        file.geometry.origin_mm(), axes_of(word));
    info.direction_provenance = core::Provenance::user;
    info.orientation = word.toStdString();
    info.patient_axes = true;
  }
  if (spacing_mm) {
    const auto& mm = *spacing_mm;
    info.geometry = core::ImageGeometry(info.geometry.dims(), {mm[0], mm[1], mm[2]},
                                        info.geometry.origin_mm(), info.geometry.direction());
    info.spacing_provenance.fill(core::Provenance::user);
    drop_spacing_warnings(info);
  }
  return info;
}

core::Volume laid_out(const core::Volume& volume, const core::ImageGeometry& geometry) {
  if (volume.empty() || volume.geometry() == geometry) return volume;
  return core::Volume(geometry, volume.shared_voxels());
}

QString describe_orientation(const QString& word) {
  if (!is_orientation(word)) return {};
  return QStringLiteral("i → %1, j → %2, k → %3")
      .arg(direction_word(word.at(0)), direction_word(word.at(1)), direction_word(word.at(2)));
}

QStringList orientations_to_offer(const core::VolumeInfo& file) {
  QStringList words;
  for (const auto& choice : file.orientation_choices) words << QString::fromStdString(choice);
  for (const char* common : {"LPS", "RAS", "LPI", "RPI", "RAI", "LAS", "RPS", "LAI", "PSR", "PIR", "PSL",
                             "PIL", "LIP", "RIP", "LSP", "RSA"})
    words << QString::fromLatin1(common);
  words.removeDuplicates();
  return words;
}

}  // namespace palpate::gui
