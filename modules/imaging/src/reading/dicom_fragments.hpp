#pragma once

#include "dicom_codecs.hpp"
#include "dicom_file.hpp"

#include <vector>

namespace palpate::imaging::reading {

/// The fragments [first, first + count) that one frame is in; none where it is missing.
struct FragmentRun {
  std::size_t first = 0, count = 0;
};

/// Which fragments belong to which frame. Their number decides where it can,
/// then the offset tables where they make sense, then where streams begin.
std::vector<FragmentRun> fragments_of_frames(const DicomFile& file, int frames, FrameCoding coding);

/// The bytes of these fragments one behind the other, and whether all are there.
struct FrameStream {
  std::vector<std::uint8_t> bytes;
  bool whole = true;
};
FrameStream read_fragments(const DicomFile& file, const FragmentRun& run);

}  // namespace palpate::imaging::reading
