#pragma once

#include "palpate/core/error.hpp"
#include "palpate/core/picture.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace palpate::imaging {

struct ReadOptions {
  std::string series_uid;                           ///< where a folder holds several series
  std::optional<int> frame;                         ///< the first to hand on; all where absent
  int frame_count = 1;                              ///< how many from `frame` on, as far as there are
  std::optional<std::array<double, 3>> spacing_mm;  ///< the user states it: provenance `user`
  /// Where i, j and k point to, three of the letters L R P A S I that name each
  /// axis once ("RAS"; case does not matter); empty or "file": as the file says.
  /// Spacing and origin stay; provenance `user`.
  std::string orientation;
  /// Of the grid that a volume in polar coordinates is converted to; the finest
  /// resolution in the file, within the memory that may be used, where absent.
  std::optional<double> grid_spacing_mm;
  bool allow_truncated = false;
};

/// Limits that the reader process runs under.
struct ReaderLimits {
  std::size_t memory_bytes = std::size_t{6} << 30;
  double time_s = 120.0;
};

/// Reads MetaImage (.mha, .mhd), NRRD, NIfTI or DICOM, a file or a folder.
/// The file is parsed in a child process (palpate-reader, found beside this
/// program or by PALPATE_READER); the voxels come back through shared memory
/// as 32-bit grey (colour by Rec. 601 luma). Times count from the first frame;
/// min, max and mean are those of the frames that are handed on. Safe from any
/// thread; several at once are fine.
/// Throws Error(input) with a code: "not-found", "unsupported", "truncated",
/// "bad-header", "too-large", "no-image", "several-series", "no-volume",
/// "reader-crashed", "reader-timeout", "reader-memory", "reader-missing",
/// or Error(cancelled): the child is then killed.
core::VolumeSequence read(const std::filesystem::path& path, const ReadOptions& options = {},
                          const core::Progress& progress = {}, const ReaderLimits& limits = {});

/// One series or one other file, as `palpate-cli info` lists it.
struct InputReport {
  std::filesystem::path path;
  bool ok = false;
  std::string error_code, error_text;  ///< where !ok
  std::vector<core::VolumeInfo> volumes;
};
/// Walks files and folders; one report per series and per other file,
/// unreadable ones included. Pixels are read, for min, max and mean.
std::vector<InputReport> inspect(const std::vector<std::filesystem::path>& paths,
                                 const ReadOptions& options = {}, const core::Progress& progress = {},
                                 const ReaderLimits& limits = {});
/// The same by the headers alone, in seconds where there are thousands of
/// files: no pixels are decoded, min, max and mean are 0.
std::vector<InputReport> inspect_headers(const std::vector<std::filesystem::path>& paths,
                                         const ReadOptions& options = {}, const core::Progress& progress = {},
                                         const ReaderLimits& limits = {});

/// What a folder offers to choose from, told without decoding more than one
/// picture of each series.
struct SeriesSummary {
  std::filesystem::path path;  ///< as read() takes it together with info.series_uid
  std::size_t files = 0;
  core::VolumeInfo info;    ///< min, max and mean are 0: pixels are not read
  core::Picture thumbnail;  ///< grey as RGB, at most 128 pixels a side; empty where it cannot be decoded
  std::string error_code, error_text;  ///< where it can be told now that it will not open as a volume
};
/// One entry per series and per other scan in the folder, in the order of their
/// paths; files that are no scan are left out. A broken one never stops it.
/// Throws Error(input, "not-found"), Error(cancelled).
std::vector<SeriesSummary> list_series(const std::filesystem::path& folder,
                                       const core::Progress& progress = {}, const ReaderLimits& limits = {});

/// What keeps the reader process from doing anything but reading: "seccomp",
/// or "none" where the kernel has nothing of the kind. Throws Error(input, "reader-missing").
std::string reader_sandbox();

/// The VOLUME object of docs/cli.md as one line of JSON.
std::string volume_info_json(const core::VolumeInfo& info);

/// What the child does: parses without any protection. For palpate-reader only.
core::VolumeSequence parse_unprotected(const std::filesystem::path& path, const ReadOptions& options,
                                       const core::Progress& progress);
/// What it costs that files are parsed in a process of its own.
struct HandoverTiming {
  double read_s = 0.0;      ///< parsed in this process
  double handover_s = 0.0;  ///< how much longer read() takes
  std::size_t bytes = 0;    ///< of voxels
};
/// Writes a scan of about so many bytes into the folder, reads it both ways in
/// turn three times, removes it, and gives the medians. Throws Error(output).
HandoverTiming measure_handover(const std::filesystem::path& folder, std::size_t bytes,
                                const core::Progress& progress = {});
/// main() of palpate-reader.
int reader_main(int argc, char** argv);

}  // namespace palpate::imaging
