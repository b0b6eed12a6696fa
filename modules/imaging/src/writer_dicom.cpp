#include "palpate/core/atomic_output.hpp"
#include "palpate/core/error.hpp"
#include "palpate/imaging/writer.hpp"

#include <gdcmDataSet.h>
#include <gdcmFile.h>
#include <gdcmTag.h>
#include <gdcmVR.h>
#include <gdcmWriter.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

// The SOP class is MR Image Storage, in research mode, although the modality
// says ultrasound: it is a class of single slices whose Image Plane module
// (position, orientation, spacing) every reader takes. The Ultrasound Image
// class has no such module, and Secondary Capture, which would say more
// honestly that the volume is synthetic, loses its geometry in GDCM 3.0, so
// in each program built on it. The image type, the sequence and the
// description say that no scanner made it.

namespace palpate::imaging {
namespace {

namespace fs = std::filesystem;
using core::AtomicOutput;
using core::output_error;

constexpr const char* mr_image_class = "1.2.840.10008.5.1.4.1.1.4";

/// 128 bits of the content, by FNV-1a's scheme with a final mixing.
class ContentHash {
 public:
  void add(const void* data, std::size_t bytes) {
    const auto* const octets = static_cast<const unsigned char*>(data);
    for (std::size_t n = 0; n < bytes; ++n) {
      low_ = (low_ ^ octets[n]) * 0x100000001B3ULL;
      high_ = (high_ ^ octets[n]) * 0x9E3779B97F4A7C15ULL;
      high_ ^= high_ >> 29U;
    }
  }
  /// A UID of the 2.25 root: the decimal of a UUID (version 8, made of content).
  std::string uid(std::uint64_t member) const {
    std::uint64_t high = mixed(high_ + 0x9E3779B97F4A7C15ULL * (member + 1));
    std::uint64_t low = mixed(low_ ^ mixed(member + 0x632BE59BD9B4E019ULL));
    high = (high & ~0xF000ULL) | 0x8000ULL;
    low = (low & ~(0xC0ULL << 56U)) | (0x80ULL << 56U);
    return "2.25." + decimal(high, low);
  }

 private:
  static std::uint64_t mixed(std::uint64_t x) {
    x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
    x = (x ^ (x >> 27U)) * 0x94D049BB133111EBULL;
    return x ^ (x >> 31U);
  }
  static std::string decimal(std::uint64_t high, std::uint64_t low) {
    std::array<std::uint64_t, 4> limbs{high >> 32U, high & 0xFFFFFFFFU, low >> 32U, low & 0xFFFFFFFFU};
    std::string digits;
    while (std::any_of(limbs.begin(), limbs.end(), [](std::uint64_t limb) { return limb != 0; })) {
      std::uint64_t rest = 0;
      for (auto& limb : limbs) {
        const std::uint64_t value = (rest << 32U) | limb;
        limb = value / 10;
        rest = value % 10;
      }
      digits.push_back(static_cast<char>('0' + rest));
    }
    std::reverse(digits.begin(), digits.end());
    return digits;
  }
  std::uint64_t low_ = 0xCBF29CE484222325ULL;
  std::uint64_t high_ = 0x6C62272E07BB0142ULL;
};

/// A decimal string has at most 16 characters.
std::string decimal_string(double value) {
  std::array<char, 64> text{};
  if (value == 0.0) value = 0.0;  // no "-0"
  const auto shortest = std::to_chars(text.data(), text.data() + text.size(), value);
  std::string best(text.data(), shortest.ptr);
  for (int digits = 15; best.size() > 16 && digits > 0; --digits) {
    const auto end =
        std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, digits).ptr;
    best.assign(text.data(), end);
  }
  return best;
}

template <typename Values>
std::string decimal_strings(const Values& values) {
  std::string text;
  for (Eigen::Index n = 0; n < values.size(); ++n) text += (n == 0 ? "" : "\\") + decimal_string(values[n]);
  return text;
}

class Attributes {
 public:
  explicit Attributes(gdcm::DataSet& set) : set_(set) {}
  void text(std::uint16_t group, std::uint16_t element, gdcm::VR::VRType vr, std::string value) {
    if (value.size() % 2 != 0) value += vr == gdcm::VR::UI ? '\0' : ' ';
    bytes(group, element, vr, value.data(), value.size());
  }
  void number(std::uint16_t group, std::uint16_t element, int value) {
    const std::array<char, 2> octets{static_cast<char>(value & 0xFF), static_cast<char>((value >> 8) & 0xFF)};
    bytes(group, element, gdcm::VR::US, octets.data(), octets.size());
  }
  void bytes(std::uint16_t group, std::uint16_t element, gdcm::VR::VRType vr, const char* data,
             std::size_t size) {
    gdcm::DataElement attribute{gdcm::Tag(group, element)};
    attribute.SetVR(vr);
    attribute.SetByteValue(data, static_cast<std::uint32_t>(size));
    set_.Replace(attribute);
  }

 private:
  gdcm::DataSet& set_;
};

/// How values become 16-bit numbers: as they are where they are whole and
/// fit, so nothing is lost, otherwise spread over the volume's range.
struct Storage {
  bool rescaled = false;
  double slope = 1.0;
  double intercept = 0.0;
};

Storage storage_for(const core::Volume& volume) {
  const bool fits = std::all_of(volume.data(), volume.data() + volume.size(), [](float value) {
    return value >= 0.0F && value <= 65535.0F && value == std::floor(value);
  });
  if (fits) return {};
  const double span = static_cast<double>(volume.range().max) - static_cast<double>(volume.range().min);
  return {true, span > 0.0 ? span / 65535.0 : 1.0, volume.range().min};
}

std::vector<char> stored_slice(const core::Volume& volume, const Storage& storage, int k) {
  const auto count = static_cast<std::size_t>(volume.dims()[0]) * static_cast<std::size_t>(volume.dims()[1]);
  const float* const first = volume.data() + volume.geometry().index(0, 0, k);
  std::vector<char> stored;
  stored.reserve(2 * count);
  for (std::size_t n = 0; n < count; ++n) {
    const double number = (static_cast<double>(first[n]) - storage.intercept) / storage.slope;
    const auto value = static_cast<unsigned>(std::clamp(std::floor(number + 0.5), 0.0, 65535.0));
    stored.push_back(static_cast<char>(value & 0xFFU));
    stored.push_back(static_cast<char>(value >> 8U));
  }
  return stored;
}

void add_identity(Attributes& set, const ContentHash& hash, int k) {
  using gdcm::VR;
  set.text(0x0008, 0x0005, VR::CS, "ISO_IR 192");
  set.text(0x0008, 0x0008, VR::CS, "DERIVED\\SECONDARY\\OTHER");
  set.text(0x0008, 0x0016, VR::UI, mr_image_class);
  set.text(0x0008, 0x0018, VR::UI, hash.uid(3 + static_cast<std::uint64_t>(k)));
  set.text(0x0008, 0x0020, VR::DA, "");
  set.text(0x0008, 0x0030, VR::TM, "");
  set.text(0x0008, 0x0050, VR::SH, "");
  set.text(0x0008, 0x0060, VR::CS, "US");
  set.text(0x0008, 0x0070, VR::LO, "Palpate");
  set.text(0x0008, 0x0090, VR::PN, "");
  set.text(0x0008, 0x103E, VR::LO, "Synthetic volume");
  set.text(0x0010, 0x0010, VR::PN, "PHANTOM^LEFT VENTRICLE");
  set.text(0x0010, 0x0020, VR::LO, "PHANTOM");
  set.text(0x0010, 0x0030, VR::DA, "");
  set.text(0x0010, 0x0040, VR::CS, "O");
  set.text(0x0018, 0x0020, VR::CS, "RM");
  set.text(0x0018, 0x0021, VR::CS, "NONE");
  set.text(0x0018, 0x0022, VR::CS, "");
  set.text(0x0018, 0x0023, VR::CS, "3D");
  set.text(0x0018, 0x0080, VR::DS, "");
  set.text(0x0018, 0x0081, VR::DS, "");
  set.text(0x0018, 0x0091, VR::IS, "");
  set.text(0x0020, 0x000D, VR::UI, hash.uid(0));
  set.text(0x0020, 0x000E, VR::UI, hash.uid(1));
  set.text(0x0020, 0x0010, VR::SH, "1");
  set.text(0x0020, 0x0011, VR::IS, "1");
  set.text(0x0020, 0x0013, VR::IS, std::to_string(k + 1));
  set.text(0x0020, 0x0020, VR::CS, "");
  set.text(0x0020, 0x0052, VR::UI, hash.uid(2));
  set.text(0x0020, 0x1040, VR::LO, "");
  set.text(0x0028, 0x0301, VR::CS, "NO");
}

void add_plane(Attributes& set, const core::ImageGeometry& geometry, int k) {
  using gdcm::VR;
  const Eigen::Vector3d position = geometry.to_lps_mm({0.0, 0.0, static_cast<double>(k)});
  Eigen::Matrix<double, 6, 1> orientation;
  orientation << geometry.direction().col(0), geometry.direction().col(1);
  const Eigen::Vector3d spacing = geometry.spacing_mm();
  set.text(0x0018, 0x0050, VR::DS, decimal_string(spacing[2]));
  set.text(0x0018, 0x0088, VR::DS, decimal_string(spacing[2]));
  set.text(0x0020, 0x0032, VR::DS, decimal_strings(position));
  set.text(0x0020, 0x0037, VR::DS, decimal_strings(orientation));
  // Between rows first, then between columns.
  set.text(0x0028, 0x0030, VR::DS, decimal_string(spacing[1]) + "\\" + decimal_string(spacing[0]));
}

void add_pixels(Attributes& set, const core::Volume& volume, const Storage& storage, int k) {
  using gdcm::VR;
  set.number(0x0028, 0x0002, 1);
  set.text(0x0028, 0x0004, VR::CS, "MONOCHROME2");
  set.number(0x0028, 0x0010, volume.dims()[1]);
  set.number(0x0028, 0x0011, volume.dims()[0]);
  set.number(0x0028, 0x0100, 16);
  set.number(0x0028, 0x0101, 16);
  set.number(0x0028, 0x0102, 15);
  set.number(0x0028, 0x0103, 0);
  const auto low = static_cast<double>(volume.range().min);
  const auto high = static_cast<double>(volume.range().max);
  set.text(0x0028, 0x1050, VR::DS, decimal_string((low + high) / 2.0));
  set.text(0x0028, 0x1051, VR::DS, decimal_string(std::max(high - low, 1.0)));
  if (storage.rescaled) {
    set.text(0x0028, 0x1052, VR::DS, decimal_string(storage.intercept));
    set.text(0x0028, 0x1053, VR::DS, decimal_string(storage.slope));
    set.text(0x0028, 0x1054, VR::LO, "US");
  }
  const auto stored = stored_slice(volume, storage, k);
  set.bytes(0x7FE0, 0x0010, VR::OW, stored.data(), stored.size());
}

void write_slice(const fs::path& path, const fs::path& target, const core::Volume& volume,
                 const Storage& storage, const ContentHash& hash, int k) {
  gdcm::Writer writer;
  gdcm::File& file = writer.GetFile();
  file.GetHeader().SetDataSetTransferSyntax(gdcm::TransferSyntax::ExplicitVRLittleEndian);
  Attributes set(file.GetDataSet());
  add_identity(set, hash, k);
  add_plane(set, volume.geometry(), k);
  add_pixels(set, volume, storage, k);
  // Through memory: GDCM ends the program on some failures of a file.
  std::ostringstream memory;
  writer.SetStream(memory);
  if (!writer.Write())
    throw core::Error(core::ErrorKind::internal, "dicom-failed",
                      "The DICOM library refused to write a slice.");
  const std::string bytes = memory.str();
  std::ofstream stream(path, std::ios::binary);
  stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  if (!stream) throw output_error(target, "write-failed", "the disk took only a part of it; it may be full");
}

}  // namespace

void write_dicom_series(const fs::path& folder, const core::Volume& volume, const core::Progress& progress) {
  if (volume.empty())
    throw core::Error(core::ErrorKind::internal, "no-volume",
                      "A DICOM series was asked for without a volume.");
  const auto& dims = volume.dims();
  if (dims[0] > 65535 || dims[1] > 65535)
    throw output_error(folder, "too-large", "a DICOM picture has at most 65535 rows and columns");
  const std::string what = "Writing " + folder.filename().string();
  progress.report(0.0, what);

  ContentHash hash;
  hash.add(volume.data(), volume.size() * sizeof(float));
  hash.add(dims.data(), sizeof dims);
  hash.add(volume.geometry().ijk_to_lps_mm().data(), 16 * sizeof(double));

  fs::path target = folder;
  if (!target.has_filename()) target = target.parent_path();  // "series/" is "series"
  const AtomicOutput output(target);
  std::error_code failed;
  if (fs::exists(output.target(), failed) &&
      !(fs::is_directory(output.target(), failed) && fs::is_empty(output.target(), failed)))
    throw output_error(folder, "exists", "something is there already; name a new or an empty folder");
  fs::create_directory(output.staged(), failed);
  if (failed) throw output_error(folder, "write-failed", failed.message());
  const Storage storage = storage_for(volume);
  for (int k = 0; k < dims[2]; ++k) {
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "slice-%04d.dcm", k + 1);
    write_slice(output.staged() / name.data(), output.target(), volume, storage, hash, k);
    progress.report(static_cast<double>(k + 1) / dims[2], what);
  }
  output.commit(output.staged(), output.target());
}

}  // namespace palpate::imaging
