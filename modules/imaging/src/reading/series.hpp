#pragma once

#include "palpate/core/error.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/imaging/reader.hpp"

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace palpate::imaging::reading {

/// The DICOM files that are read together: the slices of one series in one
/// folder, or a single file that stands for itself.
struct Series {
  std::string uid, modality, size;
  bool image = false;
  std::vector<std::filesystem::path> files;
};

struct Survey {
  std::vector<Series> series;
  std::vector<std::filesystem::path> others;                          ///< everything that is no DICOM
  std::vector<std::pair<std::filesystem::path, core::Error>> broken;  ///< whose header alone ends the reader
  std::vector<std::filesystem::path> missing;
};

/// Walks files and folders and groups what is DICOM. Headers are looked at in
/// child processes; a file that ends one is found by halving and set apart.
Survey look_through(const std::vector<std::filesystem::path>& paths, const core::Progress& progress,
                    const ReaderLimits& limits);

/// Reads these files as one volume; errors name `shown`.
core::VolumeSequence read_paths(const std::vector<std::filesystem::path>& paths,
                                const std::filesystem::path& shown, const ReadOptions& options,
                                const core::Progress& progress, const ReaderLimits& limits);

}  // namespace palpate::imaging::reading
