#pragma once

#include "palpate/core/geometry.hpp"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace palpate::core {

/// Finite voxels only.
struct IntensityRange {
  float min = 0.0F;
  float max = 0.0F;
  double mean = 0.0;
};

/// One frame of grey voxels, 32-bit float (docs/adr/0002), i fastest.
/// A value: copies share the voxels, which are never written after they were
/// made. Non-finite input is replaced by the reader before it comes here.
class Volume {
 public:
  Volume() = default;
  /// Throws Error(internal) when the sizes disagree.
  Volume(ImageGeometry geometry, std::vector<float> voxels);
  /// For memory that somebody else owns (a mapping); `voxels` keeps it alive.
  Volume(ImageGeometry geometry, std::shared_ptr<const float> voxels);

  bool empty() const noexcept { return voxels_ == nullptr; }
  const ImageGeometry& geometry() const noexcept { return geometry_; }
  const std::array<int, 3>& dims() const noexcept { return geometry_.dims(); }
  std::size_t size() const noexcept { return empty() ? 0 : geometry_.voxel_count(); }
  const float* data() const noexcept { return voxels_.get(); }
  const std::shared_ptr<const float>& shared_voxels() const noexcept { return voxels_; }
  float at(int i, int j, int k) const noexcept { return voxels_.get()[geometry_.index(i, j, k)]; }
  /// Trilinear, clamped to the box of voxel centres.
  float sample(const Eigen::Vector3d& ijk) const;
  const IntensityRange& range() const noexcept { return range_; }

 private:
  ImageGeometry geometry_;
  std::shared_ptr<const float> voxels_;
  IntensityRange range_;
};

/// Where a piece of geometry came from (docs/cli.md).
enum class Provenance { stated, private_tag, derived, assumed, user, absent };
/// "stated", "private", "derived", "assumed", "user", "absent".
std::string to_string(Provenance provenance);
/// Throws Error(input) for another word.
Provenance provenance_from(const std::string& word);

struct Warning {
  std::string code;  ///< a slug such as "assumed-spacing"
  std::string text;  ///< for people
};

/// What a file says of its volume. The numbers min, max, mean are after
/// modality rescale, over finite voxels of all components turned to grey.
struct VolumeInfo {
  std::string format;       ///< "MetaImage", "NRRD", "NIfTI", "DICOM"
  std::string modality;     ///< DICOM (0008,0060); empty elsewhere
  std::string sop_class;    ///< DICOM UID; empty elsewhere
  std::string series_uid;   ///< DICOM UID; empty elsewhere
  std::string description;  ///< DICOM series description; empty elsewhere. Never drawn into a picture
  std::string date;         ///< of the acquisition, "2012-02-15"; empty where unknown
  std::string scanner;      ///< manufacturer and model, "Philips EPIQ 7C"; empty where unknown
  ImageGeometry geometry;
  int frames = 1;
  std::vector<double> frame_times_s;  ///< one per frame, or empty where unknown
  int components = 1;                 ///< in the file; voxels here are always grey
  std::string pixel_type;             ///< of the file: "uint8", "int16", "float32", ...
  double min = 0.0, max = 0.0, mean = 0.0;
  std::array<Provenance, 3> spacing_provenance{Provenance::assumed, Provenance::assumed, Provenance::assumed};
  Provenance origin_provenance = Provenance::absent;
  Provenance direction_provenance = Provenance::absent;
  Provenance time_provenance = Provenance::absent;
  /// The axes are known in the patient: letters A/P/L/R/S/I may be shown.
  bool patient_axes = false;
  /// Where i, j and k point to, the nearest of the patient's directions each:
  /// "LPS", "RAS", ... (the same letters that ReadOptions::orientation takes).
  std::string orientation = "LPS";
  /// Where the file leaves it open: what is known to be in use for such files,
  /// the one that was taken first. Empty where the file is clear.
  std::vector<std::string> orientation_choices;
  std::vector<Warning> warnings;

  bool spacing_is_assumed() const noexcept;
};

/// What a reader hands on: the file's description and its frames, all with the
/// geometry of `info`. `frames` holds those that were asked for.
struct VolumeSequence {
  VolumeInfo info;
  std::vector<Volume> frames;
  int first_frame = 0;  ///< the number in the file of frames[0]
};

}  // namespace palpate::core
