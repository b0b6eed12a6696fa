#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"
#include "palpate/imaging/reader.hpp"

#include <array>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace palpate::imaging::reading {

/// Makes room for that many voxels: the heap, or memory shared with the parent.
using AllocateVoxels = std::function<std::shared_ptr<float>(std::size_t count)>;

/// What every parser is given.
struct Context {
  const ReadOptions& options;
  const core::Progress& progress;
  AllocateVoxels allocate;
  std::size_t memory_bytes;  ///< what may be used altogether
  /// Only the description is wanted: everything is checked and settled as ever,
  /// but no pixels are decoded and nothing is allocated. Parsed::voxels stays
  /// empty; min, max and mean stay 0.
  bool headers_only = false;
  /// To be called before a decoder that may end the process, with the file and
  /// a sentence that goes on from its name ("holds pixels that cannot be
  /// decoded: ..."). Should the process die then, this is reported, with code
  /// `unsupported`, in place of `reader-crashed`. Another call replaces it; an
  /// empty text takes it back once the decoder has returned.
  std::function<void(const std::filesystem::path&, const std::string& text)> about_to_risk =
      [](const std::filesystem::path&, const std::string&) {};
};

/// What a parser hands on: the voxels of frames [first_frame, first_frame + kept_frames).
struct Parsed {
  core::VolumeInfo info;
  std::shared_ptr<float> voxels;
  int first_frame = 0;
  int kept_frames = 0;
};

enum class Format { meta_image, nrrd, nifti, dicom, other };
/// By the ending, then by the first bytes.
Format format_of(const std::filesystem::path& path);
/// Whether the first bytes may be DICOM, with or without its preamble.
bool may_be_dicom(const std::filesystem::path& path);

Parsed parse_file(const std::filesystem::path& path, const Context& context);
Parsed parse_meta_image(const std::filesystem::path& path, const Context& context);
Parsed parse_nrrd(const std::filesystem::path& path, const Context& context);
Parsed parse_nifti(const std::filesystem::path& path, const Context& context);
/// One file, or the files of one series in any order.
Parsed parse_dicom(const std::vector<std::filesystem::path>& paths, const Context& context);

/// What a look at a DICOM file's header says, to group files into series.
struct DicomGlance {
  bool dicom = false;
  bool image = false;  ///< has rows and columns
  bool slice = false;  ///< one frame with a place and an orientation: may be part of a volume
  std::string series_uid, instance_uid, modality, size;
  bool localizer = false;        ///< by its image type
  std::array<double, 6> axes{};  ///< unit vectors of rising column and row number, of a slice
};
DicomGlance glance(const std::filesystem::path& path);

/// Throws Error(input, code) whose text is one sentence: the file's name,
/// then `text`, which goes on with a verb.
[[noreturn]] void fail(const std::string& code, const std::filesystem::path& path, const std::string& text,
                       const std::string& details = {});
/// The frames that `options` ask for, of those the file has. Throws Error(usage).
std::pair<int, int> frames_to_keep(const ReadOptions& options, int frames);
/// Throws Error(input, "too-large") where raw bytes and the grey voxels exceed the limit.
void check_memory(const std::filesystem::path& path, double raw_bytes, double voxels, const Context& context);
/// Minimum, maximum and mean of these frames.
void take_range(const std::vector<core::Volume>& frames, core::VolumeInfo& info);
void warn(core::VolumeInfo& info, const std::string& code, const std::string& text);

}  // namespace palpate::imaging::reading
