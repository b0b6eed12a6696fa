#pragma once

#include "dicom_codecs.hpp"
#include "dicom_file.hpp"
#include "dicom_pixels.hpp"

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

namespace palpate::imaging::reading {

/// What the samples of a frame are, once header and stream agree.
enum class PixelColour { grey, palette, rgb, ybr_full, ybr_partial };

/// Entries of a palette for R, G and B, in the range of the pixels that index it.
struct Palette {
  int first = 0;  ///< stored value of the first entry
  std::array<std::vector<float>, 3> entries;
  bool empty() const { return entries[0].empty() || entries[1].empty() || entries[2].empty(); }
};
/// Throws Error(input, "bad-header") where the file says no palette that makes sense.
Palette read_palette(const DicomFile& file, const DicomPixelForm& form);

/// Modality LUT, or slope and intercept: what makes stored numbers meaningful.
struct ModalityRescale {
  double slope = 1.0, intercept = 0.0;
  int table_first = 0;
  std::vector<double> table;  ///< in place of slope and intercept
};
/// Of one frame: its own functional group, the shared one or the whole file's.
ModalityRescale read_rescale(const DicomFile& file, const DicomPixelForm& form,
                             const std::vector<DicomItem>& frame_groups, int frame);

/// Rec. 601 luma; of three equal numbers exactly that number.
double luma(double red, double green, double blue);

/// Stored samples to grey. `halved` is the packing of YBR_FULL_422: two
/// brightnesses and one colour for two pixels.
struct GreyRule {
  DicomPixelForm form;
  PixelColour colour = PixelColour::grey;
  bool halved = false;
  Palette palette;
  ModalityRescale rescale;
  /// Stored numbers that stand for no picture, both included (first > second: none).
  std::pair<std::int64_t, std::int64_t> padding{1, 0};
};
/// Returns whether padding was found.
bool make_grey(const CodedFrame& frame, const GreyRule& rule, float* grey);

}  // namespace palpate::imaging::reading
