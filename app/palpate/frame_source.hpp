#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"

#include <QString>

#include <cstddef>
#include <filesystem>
#include <functional>

namespace palpate::gui {

/// Frame k of a scan, as the file says; from any thread, throws as imaging::read.
using FrameSource = std::function<core::Volume(int frame, const core::Progress&)>;

/// A quarter of the machine's memory, at most 4 GB.
std::size_t standard_frame_budget();
/// As the system names files.
std::filesystem::path native_path(const QString& path);

}  // namespace palpate::gui
