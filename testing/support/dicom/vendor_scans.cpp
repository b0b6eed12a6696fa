#include "palpate/testing/dicom_scans.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>

namespace palpate::testing {
namespace {

void equipment(DicomMaker& file, const std::string& manufacturer, const std::string& model) {
  file.top().text({0x0008, 0x0070}, manufacturer).text({0x0008, 0x1090}, model);
}

void grey_8_bit(DicomNode top, int columns, int rows) {
  top.us({0x0028, 0x0002}, {1})
      .text({0x0028, 0x0004}, "MONOCHROME2")
      .us({0x0028, 0x0010}, {static_cast<std::uint16_t>(rows)})
      .us({0x0028, 0x0011}, {static_cast<std::uint16_t>(columns)})
      .us({0x0028, 0x0100}, {8})
      .us({0x0028, 0x0101}, {8})
      .us({0x0028, 0x0102}, {7})
      .us({0x0028, 0x0103}, {0});
}

template <typename T>
std::string bytes_of(const T& value) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}

std::string kretz_item(std::uint16_t group, std::uint16_t element, const std::string& value) {
  return bytes_of(group) + bytes_of(element) + bytes_of(static_cast<std::uint32_t>(value.size())) + value;
}

/// Angles about a right angle, as the format counts them.
std::string angles(int count, double half) {
  std::string bytes;
  for (int n = 0; n < count; ++n)
    bytes += bytes_of(1.57079632679489662 - half + 2.0 * half * n / (count - 1));
  return bytes;
}

}  // namespace

void QlabScan::write(const std::filesystem::path& path) const {
  DicomMaker file("1.2.840.113543.6.6.1.3.10002", "US", "5", "1");
  equipment(file, "Philips Medical Systems", "iE33");
  DicomNode top = file.top();
  grey_8_bit(top, columns, rows);
  top.text({0x0028, 0x0008}, std::to_string(volumes)).text({0x0018, 0x1063}, "50");
  top.us({0x0018, 0x6024}, {3}).us({0x0018, 0x6026}, {3});
  top.fd({0x0018, 0x602C}, {x_cm}).fd({0x0018, 0x602E}, {y_cm});
  top.private_ul(0x3001, block, "Philips3D", 0x01, static_cast<std::uint32_t>(slices));
  top.private_ul(0x3001, block, "Philips3D", 0x02, 3);
  top.private_fd(0x3001, block, "Philips3D", 0x03, z_cm);
  std::string bytes;
  for (int t = 0; t < volumes; ++t)
    for (int k = 0; k < slices; ++k)
      for (int j = 0; j < rows; ++j)
        for (int i = 0; i < columns; ++i) bytes += static_cast<char>(value(i, j, k, t));
  if (cut) bytes.resize(bytes.size() - static_cast<std::size_t>(columns * rows));
  file.raw_pixels(bytes);
  file.save(path, implicit);
}

void write_affinity(const std::filesystem::path& path, std::uint8_t block, const std::string& spacing,
                    int columns, int rows, int slices, const PixelValue& value) {
  DicomMaker file(us_cine_class, "US", "6", "1");
  equipment(file, "Philips Medical Systems", "Affiniti 50G");
  // Another creator's block stands first: its numbers must not be taken.
  file.top().private_text(0x200D, 0x20, "Philips US Imaging DD 033", 0x03, "9\\9\\9");
  file.top().private_text(0x200D, block, "Philips US Imaging DD 036", 0x03, spacing);
  file.pixels(columns, rows, slices, 8, value);
  file.save(path);
}

void write_artemis(const std::filesystem::path& path, const std::string& aspect_ratio,
                   const std::string& private_spacing, int columns, int rows, int slices,
                   const PixelValue& value) {
  DicomMaker file(us_cine_class, "US", "6", "2");
  equipment(file, "Eigen", "Artemis");
  if (!aspect_ratio.empty()) file.top().text({0x0028, 0x0034}, aspect_ratio);
  if (!private_spacing.empty()) file.top().private_text(0x1129, 0x12, "Eigen, Inc", 0x16, private_spacing);
  file.pixels(columns, rows, slices, 8, value);
  file.save(path);
}

void write_movie_group(const std::filesystem::path& path, const std::string& kind, bool with_picture) {
  DicomMaker file(with_picture ? us_cine_class : us_image_class, "US", "8", "1");
  equipment(file, "GE Vingmed Ultrasound", "Vivid E95");
  const std::string creator = "GEMS_Ultrasound_MovieGroup_001";
  DicomNode group = file.top().private_item(0x7FE1, 0x10, creator, 0x01);
  group.private_text(0x7FE1, 0x10, creator, 0x02, kind);
  group.private_bytes(0x7FE1, 0x10, creator, 0x60, std::string(64, '\5'));
  if (with_picture) {
    file.top().text({0x0018, 0x1063}, "20");
    file.pixels(4, 3, 2, 8, [](int i, int j, int frame) { return i + 4 * j + 100 * frame; });
  }
  file.save(path);
}

Eigen::Vector3d KretzScan::place(int i, int j, int k) const {
  const double r = first_mm + step_mm * i;
  const double fan = half_fan * (2.0 * j / (beams - 1) - 1.0);
  const double sweep = half_sweep * (2.0 * k / (planes - 1) - 1.0);
  const double forward = r * std::cos(fan);
  return {r * std::sin(fan), -(forward - axis_mm) * std::sin(sweep),
          axis_mm * (1.0 - std::cos(sweep)) + forward * std::cos(sweep)};
}

std::string KretzScan::file_bytes() const {
  const auto size = [](int count) { return bytes_of(static_cast<std::uint16_t>(count)); };
  constexpr double m = 1e-3;
  std::string bytes = "KRETZFILE 1.0   ";
  bytes += kretz_item(0x0000, 0x0001, size(1));
  bytes += kretz_item(0xC000, 0x0001, size(radial));
  bytes += kretz_item(0xC000, 0x0002, size(beams));
  bytes += kretz_item(0xC000, 0x0003, size(planes));
  bytes += kretz_item(0xC100, 0x0001, bytes_of(step_mm * m));
  bytes += kretz_item(0xC200, 0x0001, bytes_of(first_mm / step_mm));
  bytes += kretz_item(0xC200, 0x0002, bytes_of(-axis_mm / step_mm));
  bytes += kretz_item(0xC300, 0x0002, angles(beams, half_fan));
  bytes += kretz_item(0xC300, 0x0001, angles(planes, half_sweep));
  std::string first;
  std::string all;
  for (int t = 0; t < volumes; ++t) {
    std::string voxels;
    for (int k = 0; k < planes; ++k)
      for (int j = 0; j < beams; ++j)
        for (int i = 0; i < radial; ++i)
          voxels += static_cast<char>(std::lround(std::clamp(value(place(i, j, k), t), 0.0, 255.0)));
    if (t == 0) first = voxels;
    all += voxels;
  }
  if (compressed) first.resize(first.size() / 7);
  bytes += kretz_item(0xD000, 0x0001, first);
  if (volumes > 1) bytes += kretz_item(0xD600, 0x0001, all);
  return bytes + kretz_item(0xFFFF, 0xFFFF, "");
}

void KretzScan::write_raw(const std::filesystem::path& path) const {
  std::ofstream(path, std::ios::binary) << file_bytes();
}

void KretzScan::write_dicom(const std::filesystem::path& path, std::uint8_t block) const {
  DicomMaker file(us_image_class, "US", "9", "1");
  equipment(file, "GE Healthcare Austria GmbH & Co OG", "Voluson E10");
  // The picture that such files also carry, which is a view and not the volume.
  file.pixels(4, 3, 0, 8, [](int i, int j, int) { return i + j; });
  std::string bytes = file_bytes();
  if (bytes.size() % 2 != 0) bytes += '\0';
  file.top().private_bytes(0x7FE1, block, "KRETZ_US", 0x01, bytes);
  file.save(path);
}

}  // namespace palpate::testing
