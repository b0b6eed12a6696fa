#pragma once

#include "reading/dicom_pixels.hpp"

#include "palpate/core/error.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/imaging/reader.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dctk.h>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

namespace palpate::testing {

using Bytes = std::vector<std::uint8_t>;

template <typename T>
Bytes little_endian(const std::vector<T>& values) {
  Bytes bytes(values.size() * sizeof(T));
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

/// An ultrasound picture that DCMTK writes.
class MadeDicom {
 public:
  MadeDicom(int columns, int rows, int bits_allocated, int bits_stored, int samples = 1,
            const std::string& photometric = "MONOCHROME2") {
    text(DCM_SOPClassUID, UID_UltrasoundMultiframeImageStorage);
    text(DCM_SOPInstanceUID, "1.2.276.0.7230010.3.1.4.1");
    text(DCM_Modality, "US");
    number(DCM_SamplesPerPixel, samples);
    text(DCM_PhotometricInterpretation, photometric);
    if (samples > 1) number(DCM_PlanarConfiguration, 0);
    number(DCM_Rows, rows);
    number(DCM_Columns, columns);
    number(DCM_BitsAllocated, bits_allocated);
    number(DCM_BitsStored, bits_stored);
    number(DCM_HighBit, bits_stored - 1);
    number(DCM_PixelRepresentation, 0);
  }
  DcmDataset& set() { return *file_.getDataset(); }
  MadeDicom& text(const DcmTag& tag, const std::string& value) {
    set().putAndInsertString(tag, value.c_str());
    return *this;
  }
  MadeDicom& number(const DcmTag& tag, int value) {
    set().putAndInsertUint16(tag, static_cast<Uint16>(value));
    return *this;
  }
  MadeDicom& numbers(const DcmTag& tag, const std::vector<std::uint16_t>& values) {
    set().putAndInsertUint16Array(tag, values.data(), static_cast<unsigned long>(values.size()));
    return *this;
  }
  MadeDicom& bytes(const DcmTag& tag, Bytes values) {
    if (values.size() % 2 != 0) values.push_back(0);
    set().putAndInsertUint8Array(tag, values.data(), static_cast<unsigned long>(values.size()));
    return *this;
  }
  /// Uncompressed 8-bit pixels as OB, 16-bit ones as OW.
  MadeDicom& pixels8(const Bytes& values) { return bytes(DcmTag(DCM_PixelData, EVR_OB), values); }
  MadeDicom& pixels16(const std::vector<std::uint16_t>& values) {
    return numbers(DcmTag(DCM_PixelData, EVR_OW), values);
  }
  /// Compressed pixels, item by item, the offset table first.
  MadeDicom& fragments(E_TransferSyntax syntax, const std::vector<Bytes>& items,
                       const std::vector<std::uint32_t>& offsets = {}) {
    auto* sequence = new DcmPixelSequence(DCM_PixelSequenceTag);
    const auto add = [&](Bytes item) {
      if (item.size() % 2 != 0) item.push_back(0);
      auto* piece = new DcmPixelItem(DCM_PixelItemTag);
      if (!item.empty()) piece->putUint8Array(item.data(), static_cast<unsigned long>(item.size()));
      sequence->insert(piece);
    };
    add(little_endian(offsets));
    for (const auto& item : items) add(item);
    auto* data = new DcmPixelData(DCM_PixelData);
    data->putOriginalRepresentation(syntax, nullptr, sequence);
    set().insert(data, OFTrue);
    return *this;
  }
  std::filesystem::path write(const std::filesystem::path& path,
                              E_TransferSyntax syntax = EXS_LittleEndianExplicit) {
    const OFCondition result =
        file_.saveFile(path.c_str(), syntax, EET_ExplicitLength, EGL_recalcGL, EPD_withoutPadding);
    if (result.bad()) throw std::runtime_error(std::string("DCMTK: ") + result.text());
    return path;
  }

 private:
  DcmFileFormat file_;
};

/// A frame as the decoder gives it, and the codes of its warnings.
struct DecodedPixels {
  std::vector<float> grey;
  std::vector<std::string> warnings;
  imaging::reading::DicomPixelForm form;
  bool warned(const std::string& code) const {
    return std::find(warnings.begin(), warnings.end(), code) != warnings.end();
  }
};

inline DecodedPixels decode(const std::filesystem::path& path, int frame = 0, bool allow_truncated = false) {
  imaging::ReadOptions options;
  options.allow_truncated = allow_truncated;
  const core::Progress progress;
  constexpr std::size_t memory = std::size_t{1} << 30;
  const imaging::reading::Context context{options, progress, {}, memory};
  const imaging::reading::DicomFile file(path);
  imaging::reading::DicomPixels pixels(file, context);
  DecodedPixels result;
  result.form = pixels.form();
  result.grey.resize(static_cast<std::size_t>(result.form.rows) *
                     static_cast<std::size_t>(result.form.columns));
  pixels.decode(frame, result.grey.data());
  for (const auto& warning : pixels.warnings()) result.warnings.push_back(warning.code);
  return result;
}

/// The code of the error that decoding ends with; "" where there is none.
inline std::string refusal(const std::filesystem::path& path, std::string* text = nullptr) {
  try {
    decode(path);
  } catch (const core::Error& error) {
    if (text != nullptr) *text = error.what();
    return error.code();
  }
  return {};
}

}  // namespace palpate::testing
