#pragma once

#include "frame_source.hpp"
#include "workbench.hpp"

namespace palpate::gui {

/// What a reading job hands over.
struct Workbench::OpenedScan {
  session::InputSettings input;
  core::VolumeInfo info;  ///< as the file says
  core::Volume volume;    ///< frame input.frame
  FrameSource frames;
};

/// Of the file alone: spacing and orientation of the user are laid over it.
imaging::ReadOptions file_options(const session::InputSettings& input);

}  // namespace palpate::gui
