#pragma once

#include "palpate/core/volume.hpp"
#include "palpate/session/recipe.hpp"

#include <QString>
#include <QStringList>

#include <array>
#include <optional>

namespace palpate::gui {

/// What the file says, with the spacing and the orientation that the user
/// stated in its place: the same as reading the file again with them, without
/// reading it.
core::VolumeInfo restated(const core::VolumeInfo& as_the_file_says,
                          const std::optional<std::array<double, 3>>& spacing_mm,
                          const std::string& orientation);
/// The same voxels elsewhere.
core::Volume laid_out(const core::Volume& volume, const core::ImageGeometry& geometry);

/// Three letters that name each of the patient's axes once: "LPS", "RAS".
bool is_orientation(const QString& word);
/// "i → left, j → back, k → head".
QString describe_orientation(const QString& word);
/// The words to offer: those in use for such files first, then the common ones.
QStringList orientations_to_offer(const core::VolumeInfo& as_the_file_says);

}  // namespace palpate::gui
