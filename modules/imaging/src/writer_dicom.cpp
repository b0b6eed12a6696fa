#include "dicom_values.hpp"

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

std::vector<char> stored_slice(const core::Volume& volume, const StoredGreys& storage, int k) {
  const auto count = static_cast<std::size_t>(volume.dims()[0]) * static_cast<std::size_t>(volume.dims()[1]);
  const float* const first = volume.data() + volume.geometry().index(0, 0, k);
  std::vector<char> stored;
  stored.reserve(2 * count);
  for (std::size_t n = 0; n < count; ++n) {
    const unsigned value = storage.number_of(first[n]);
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

void add_pixels(Attributes& set, const core::Volume& volume, const StoredGreys& storage, int k) {
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
                 const StoredGreys& storage, const ContentHash& hash, int k) {
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
  StoredGreys storage = stored_greys({volume});
  storage.bits = 16;
  for (int k = 0; k < dims[2]; ++k) {
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "slice-%04d.dcm", k + 1);
    write_slice(output.staged() / name.data(), output.target(), volume, storage, hash, k);
    progress.report(static_cast<double>(k + 1) / dims[2], what);
  }
  output.commit(output.staged(), output.target());
}

}  // namespace palpate::imaging
