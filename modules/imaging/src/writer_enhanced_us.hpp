#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"
#include "palpate/imaging/writer.hpp"

#include <filesystem>
#include <vector>

namespace palpate::imaging {

/// One file of Enhanced US Volume Storage (PS3.3 A.59) at `staged`; `target`
/// is what messages name. `frame_times_s` has one time a frame or none.
void write_enhanced_us_volume(const std::filesystem::path& staged, const std::filesystem::path& target,
                              const std::vector<core::Volume>& frames,
                              const std::vector<double>& frame_times_s, const WriteOptions& options,
                              const core::Progress& progress);

}  // namespace palpate::imaging
