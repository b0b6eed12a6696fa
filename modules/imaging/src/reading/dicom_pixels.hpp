#pragma once

#include "dicom_file.hpp"
#include "parsed.hpp"

#include <memory>
#include <string>
#include <vector>

namespace palpate::imaging::reading {

/// What a file says of its pixels.
struct DicomPixelForm {
  int rows = 0, columns = 0, frames = 1, samples = 1;
  int bits_allocated = 0, bits_stored = 0, high_bit = 0;
  bool is_signed = false;
  bool planar = false;      ///< R, G and B each by itself (planar configuration 1)
  std::string photometric;  ///< "MONOCHROME2", "RGB", ...
  int components = 1;       ///< of a pixel as it is shown: 3 of a palette
  std::string pixel_type;   ///< as VolumeInfo::pixel_type
};

/// Rows, columns and so on, checked: throws Error(input): "no-image" without
/// them or without pixels, "bad-header" where they cannot be.
DicomPixelForm dicom_pixel_form(const DicomFile& file);

/// Turns frames of one file to 32-bit grey, one at a time: only what is needed
/// for a frame is read and kept. Modality rescale is done, dose scaling is not;
/// MONOCHROME1 keeps its values; colour becomes Rec. 601 luma of its RGB.
class DicomPixels {
 public:
  /// Checks all that can be told without decoding. `file` and `context` have to
  /// outlive this. Throws as dicom_pixel_form(), and "too-large", "unsupported"
  /// for a transfer syntax that nothing here decodes, "truncated" where pixels
  /// are missing and the options do not allow it.
  DicomPixels(const DicomFile& file, const Context& context);
  ~DicomPixels();
  DicomPixels(const DicomPixels&) = delete;
  DicomPixels& operator=(const DicomPixels&) = delete;

  const DicomPixelForm& form() const;
  /// Writes rows × columns values. Throws Error(input): "truncated" where data
  /// are missing or damaged and the options do not allow it (else the part that
  /// is missing is 0), "unsupported" where no decoder takes the frame.
  void decode(int frame, float* grey);
  /// What is to be said of the pixels, each once: some only after decode().
  const std::vector<core::Warning>& warnings() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace palpate::imaging::reading
