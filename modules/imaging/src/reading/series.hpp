#pragma once

#include "palpate/core/error.hpp"
#include "palpate/core/picture.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/imaging/reader.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace palpate::imaging::reading {

/// The DICOM files that are read together: the slices of one series in one
/// folder that lie in one direction, or a single file that stands for itself.
/// Where a series holds several such stacks, `uid` ends in "#1", "#2", ...
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

/// What is read together, and the path that stands for it.
struct Entry {
  std::vector<std::filesystem::path> files;
  std::filesystem::path shown;
  bool dicom = false;
  bool image = true;                ///< not so: DICOM without pictures
  std::string uid, modality, size;  ///< by a glance; DICOM only
};
/// The series (only those of this name, where there is one), then the other files.
std::vector<Entry> entries_of(const Survey& survey, const std::string& series_uid);

/// Whether `wanted` means this series: none is named, it is the one, or a part of it.
bool names_series(const std::string& wanted, const std::string& uid);
/// The name by which the part of a series is found again, in place of its series' UID.
void name_part(const std::string& uid, core::VolumeInfo& info);

/// What an entry would open as.
struct Description {
  std::optional<core::VolumeInfo> info;
  core::Picture thumbnail;           ///< empty where it was not wanted or cannot be made
  std::optional<core::Error> error;  ///< why it will not open, as far as can be told
};
/// Looks at the headers of the entries, and at one picture of each where
/// `thumbnails`, in child processes. One that ends its child costs only itself.
/// Throws Error(cancelled), Error(input, "reader-missing").
std::vector<Description> describe(const std::vector<Entry>& entries, const ReadOptions& options,
                                  bool thumbnails, const core::Progress& progress,
                                  const ReaderLimits& limits);

/// What `read` would take: the files of the one series that the folder holds
/// or that the options name, and what is to be said of the others.
struct FoundScan {
  Entry entry;
  std::vector<core::Warning> warnings;
};
/// Throws as read().
FoundScan find_scan(const std::filesystem::path& path, const ReadOptions& options,
                    const core::Progress& progress, const ReaderLimits& limits);
/// Throws where the series is not the one that the options name.
void check_series(const core::VolumeInfo& info, const std::filesystem::path& path,
                  const ReadOptions& options);

/// Reads these files as one volume; errors name `shown`.
core::VolumeSequence read_paths(const std::vector<std::filesystem::path>& paths,
                                const std::filesystem::path& shown, const ReadOptions& options,
                                const core::Progress& progress, const ReaderLimits& limits);

}  // namespace palpate::imaging::reading
