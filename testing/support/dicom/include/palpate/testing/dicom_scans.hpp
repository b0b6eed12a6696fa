#pragma once

#include "palpate/testing/dicom_maker.hpp"

#include <Eigen/Core>

#include <array>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

// Whole scans of the kinds that the reader must know, each with what it needs
// and no more. Text values are as DICOM writes them ("1\\0\\0\\0\\1\\0").
namespace palpate::testing {

inline constexpr const char* us_image_class = "1.2.840.10008.5.1.4.1.1.6.1";
inline constexpr const char* us_cine_class = "1.2.840.10008.5.1.4.1.1.3.1";
inline constexpr const char* us_volume_class = "1.2.840.10008.5.1.4.1.1.6.2";
inline constexpr const char* mr_class = "1.2.840.10008.5.1.4.1.1.4";
inline constexpr const char* mr_enhanced_class = "1.2.840.10008.5.1.4.1.1.4.1";
inline constexpr const char* ct_class = "1.2.840.10008.5.1.4.1.1.2";

/// One region of an ultrasound picture (PS3.3 C.8.5.5).
struct UsRegion {
  double x = 0.05, y = 0.05;  ///< a pixel, in the units below
  int spatial_format = 1;     ///< 1 two-dimensional, 2 M-mode, 3 spectral
  int units = 3;              ///< 3 centimetres, 4 seconds
};
void add_region(DicomNode dataset, const UsRegion& region);

/// One slice of a classic series; extra tags are written as given.
struct ClassicSlice {
  std::string sop_class = mr_class, modality = "MR", series = "1", uid = "1";
  std::string position = "0\\0\\0", orientation = "1\\0\\0\\0\\1\\0", spacing = "1\\1";
  int columns = 4, rows = 3, bits = 16;
  std::vector<std::pair<Tag, std::string>> extra;
  PixelValue value = [](int i, int j, int) { return i + 10 * j; };
  void write(const std::filesystem::path& path) const;
};

/// A multi-frame object with functional groups.
struct EnhancedScan {
  std::string sop_class = us_volume_class, modality = "US";
  int columns = 4, rows = 3, slices = 2;
  std::vector<double> times_s{0.0};
  std::vector<std::string> data_types{""};  ///< for each a whole set of frames, where not empty
  std::vector<std::string> stacks{""};
  double row_spacing = 1.0, column_spacing = 1.0;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero(), step{0, 0, 1};
  std::array<double, 6> axes{1, 0, 0, 0, 1, 0};
  bool volume_planes = true, patient_planes = false;
  std::string geometry = "APEX", patient_source;  ///< (0020,9307), (0020,930C)
  bool offsets_in_seconds = true;                 ///< Temporal Position Time Offset, else the index alone
  std::vector<std::size_t> order;  ///< in which the frames are written; as they are where empty
  std::function<int(int i, int j, int slice, int time)> value = [](int i, int j, int k, int t) {
    return i + 4 * j + 16 * k + 64 * t;
  };
  void write(const std::filesystem::path& path) const;
};

/// Philips QLAB Cartesian: `volumes` frames of `slices` slices in raw bytes.
struct QlabScan {
  int columns = 4, rows = 3, slices = 2, volumes = 1;
  double x_cm = 0.05, y_cm = 0.06, z_cm = 0.07;
  std::uint8_t block = 0x10;
  bool cut = false;       ///< the last slice is missing
  bool implicit = false;  ///< no types are written
  std::function<int(int i, int j, int k, int t)> value = [](int i, int j, int k, int t) {
    return i + 4 * j + 16 * k + 64 * t;
  };
  void write(const std::filesystem::path& path) const;
};

/// Philips Affinity: slices as frames, spacings as private text.
void write_affinity(const std::filesystem::path& path, std::uint8_t block, const std::string& spacing,
                    int columns, int rows, int slices, const PixelValue& value);
/// Eigen Artemis; an empty aspect ratio or private spacing is left out.
void write_artemis(const std::filesystem::path& path, const std::string& aspect_ratio,
                   const std::string& private_spacing, int columns, int rows, int slices,
                   const PixelValue& value);
/// GE Vivid: private scan lines, with a readable picture beside them or not.
void write_movie_group(const std::filesystem::path& path, const std::string& kind, bool with_picture);

/// GE Kretz: voxels on rays of a fan that sweeps about an axis.
struct KretzScan {
  int radial = 64, beams = 48, planes = 40, volumes = 1;
  double first_mm = 20.0, step_mm = 0.5;    ///< along a ray
  double axis_mm = 8.0;                     ///< of the sweep, behind the fan's apex
  double half_fan = 0.5, half_sweep = 0.4;  ///< rad
  bool compressed = false;                  ///< without plain voxels
  /// The grey value at a Cartesian point in mm: lateral, elevation, depth.
  std::function<double(const Eigen::Vector3d&, int volume)> value;
  /// Where voxel (i, j, k) is, by the published description of the format.
  Eigen::Vector3d place(int i, int j, int k) const;
  std::string file_bytes() const;
  void write_raw(const std::filesystem::path& path) const;
  void write_dicom(const std::filesystem::path& path, std::uint8_t block = 0x11) const;
};

}  // namespace palpate::testing
