#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace palpate::testing {

inline void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

template <typename T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

/// A MetaImage whose voxels follow its header; `extra` are lines of it.
inline void write_mha(const std::filesystem::path& path, const std::string& dims, const std::string& type,
                      const std::string& voxels, const std::string& extra = {}) {
  const auto axes = 1 + std::count(dims.begin(), dims.end(), ' ');
  write_bytes(path, "ObjectType = Image\nNDims = " + std::to_string(axes) +
                        "\nBinaryData = True\nBinaryDataByteOrderMSB = False\n" + extra + "DimSize = " +
                        dims + "\nElementType = " + type + "\nElementDataFile = LOCAL\n" + voxels);
}

/// A NIfTI-1 header for a single file; little-endian, as the machines of the tests are.
class NiftiBytes {
 public:
  NiftiBytes(const std::vector<std::int16_t>& dims, std::int16_t type, std::int16_t bits)
      : bytes_(352, '\0') {
    put<std::int32_t>(0, 348);
    put<std::int16_t>(40, static_cast<std::int16_t>(dims.size()));
    for (std::size_t n = 0; n < 7; ++n)
      put<std::int16_t>(42 + 2 * n, n < dims.size() ? dims[n] : std::int16_t{1});
    put<std::int16_t>(70, type);
    put<std::int16_t>(72, bits);
    for (std::size_t n = 0; n < 8; ++n) put<float>(76 + 4 * n, 1.0F);
    put<float>(108, 352.0F);
    bytes_[123] = 2 + 16;  // mm and ms
    std::memcpy(bytes_.data() + 344, "n+1", 4);
  }
  template <typename T>
  NiftiBytes& put(std::size_t at, T value) {
    std::memcpy(bytes_.data() + at, &value, sizeof(T));
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// A DICOM file in explicit little-endian, element by element.
class DicomBytes {
 public:
  DicomBytes() {
    text(0x0002, 0x0010, "UI", "1.2.840.10008.1.2.1");
    meta_end_ = bytes_.size();
  }
  DicomBytes& text(std::uint16_t group, std::uint16_t element, const std::string& vr, std::string value) {
    if (value.size() % 2 != 0) value.push_back(vr == "UI" ? '\0' : ' ');
    return raw(group, element, vr, value);
  }
  DicomBytes& number(std::uint16_t group, std::uint16_t element, std::uint16_t value) {
    return raw(group, element, "US", bytes_of(std::vector<std::uint16_t>{value}));
  }
  DicomBytes& raw(std::uint16_t group, std::uint16_t element, const std::string& vr,
                  const std::string& value) {
    bytes_ += bytes_of(std::vector<std::uint16_t>{group, element}) + vr;
    if (vr == "OB" || vr == "OW" || vr == "SQ")
      bytes_ += std::string(2, '\0') +
                bytes_of(std::vector<std::uint32_t>{static_cast<std::uint32_t>(value.size())});
    else
      bytes_ += bytes_of(std::vector<std::uint16_t>{static_cast<std::uint16_t>(value.size())});
    bytes_ += value;
    return *this;
  }
  /// The elements alone, as an item of a sequence holds them.
  static std::string item(const DicomBytes& content) {
    const std::string inner = content.bytes_.substr(content.meta_end_);
    return bytes_of(std::vector<std::uint16_t>{0xFFFE, 0xE000}) +
           bytes_of(std::vector<std::uint32_t>{static_cast<std::uint32_t>(inner.size())}) + inner;
  }
  void write(const std::filesystem::path& path) const {
    write_bytes(path, std::string(128, '\0') + "DICM" + bytes_);
  }

 private:
  std::string bytes_;
  std::size_t meta_end_ = 0;
};

/// The start of an 8-bit grey image of 4 x 2 pixels; elements must rise.
struct SmallImage {
  std::string sop = "1.2.840.10008.5.1.4.1.1.6.1", modality = "US", series = "1.2.3", instance = "1",
              position, orientation;
  std::string frames, frame_time, spacing, regions;
  std::string pixels = std::string("\0\1\2\3\4\5\6\7", 8);
  void write(const std::filesystem::path& path) const {
    DicomBytes file;
    file.text(0x0008, 0x0016, "UI", sop)
        .text(0x0008, 0x0018, "UI", series + "." + instance)
        .text(0x0008, 0x0060, "CS", modality);
    if (!frame_time.empty()) file.text(0x0018, 0x1063, "DS", frame_time);
    if (!regions.empty()) file.raw(0x0018, 0x6011, "SQ", regions);
    file.text(0x0020, 0x000D, "UI", "1.2")
        .text(0x0020, 0x000E, "UI", series)
        .text(0x0020, 0x0013, "IS", instance);
    if (!position.empty()) file.text(0x0020, 0x0032, "DS", position).text(0x0020, 0x0037, "DS", orientation);
    file.number(0x0028, 0x0002, 1).text(0x0028, 0x0004, "CS", "MONOCHROME2");
    if (!frames.empty()) file.text(0x0028, 0x0008, "IS", frames);
    file.number(0x0028, 0x0010, 2).number(0x0028, 0x0011, 4);
    if (!spacing.empty()) file.text(0x0028, 0x0030, "DS", spacing);
    file.number(0x0028, 0x0100, 8)
        .number(0x0028, 0x0101, 8)
        .number(0x0028, 0x0102, 7)
        .number(0x0028, 0x0103, 0);
    file.raw(0x7FE0, 0x0010, "OB", pixels);
    file.write(path);
  }
  /// An item of (0018,6011) with square pixels of that many cm.
  static std::string region(double delta_cm) {
    DicomBytes content;
    content.number(0x0018, 0x6012, 1).number(0x0018, 0x6024, 3).number(0x0018, 0x6026, 3);
    content.raw(0x0018, 0x602C, "FD", bytes_of(std::vector<double>{delta_cm}));
    content.raw(0x0018, 0x602E, "FD", bytes_of(std::vector<double>{delta_cm}));
    return DicomBytes::item(content);
  }
};

}  // namespace palpate::testing
