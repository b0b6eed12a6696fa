// The parent's side: what a child sends is checked, then handed on.
#include "palpate/imaging/reader.hpp"

#include "info_json.hpp"
#include "parsed.hpp"
#include "process.hpp"
#include "series.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cmath>
#include <fcntl.h>
#include <iomanip>
#include <sstream>
#include <stdexcept>
#include <sys/mman.h>
#include <sys/stat.h>

namespace palpate::imaging {
namespace reading {
namespace {

/// Maps the child's voxels for good: sealed first, so that nobody can take
/// the memory away or change it any more.
std::shared_ptr<const float> map_voxels(const Descriptor& voxels, double needed_bytes) {
  struct stat found {};
  if (fcntl(voxels.number(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE) != 0 ||
      fstat(voxels.number(), &found) != 0)
    throw std::invalid_argument("voxels that are still written");
  if (static_cast<double>(found.st_size) < needed_bytes)
    throw std::invalid_argument("fewer voxels than it speaks of");
  const auto bytes = static_cast<std::size_t>(needed_bytes);
  // All pages are looked at next; one by one they cost more than together.
  void* memory = mmap(nullptr, bytes, PROT_READ, MAP_SHARED | MAP_POPULATE, voxels.number(), 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  return {static_cast<const float*>(memory), [memory, bytes](const float*) { munmap(memory, bytes); }};
}

core::VolumeSequence accept(const ReaderReply& reply, const ReadOptions& options) {
  core::VolumeSequence sequence;
  sequence.info = info_from_json(reply.result.at("volume"));
  const auto first = reply.result.at("first_frame").get<long long>();
  const auto kept = reply.result.at("kept_frames").get<long long>();
  const auto [wanted_first, wanted_kept] = frames_to_keep(options, sequence.info.frames);
  if (first != wanted_first || kept != wanted_kept)
    throw std::invalid_argument("other frames than were asked for");
  const core::ImageGeometry& geometry = sequence.info.geometry;
  double bytes = static_cast<double>(kept) * sizeof(float);
  for (const int size : geometry.dims()) bytes *= size;
  const auto voxels = map_voxels(reply.voxels, bytes);
  const std::size_t count = geometry.voxel_count() * static_cast<std::size_t>(kept);
  if (!std::all_of(voxels.get(), voxels.get() + count, [](float value) { return std::isfinite(value); }))
    throw std::invalid_argument("voxels that are no numbers");
  sequence.first_frame = static_cast<int>(first);
  for (std::size_t n = 0; n < static_cast<std::size_t>(kept); ++n)
    sequence.frames.emplace_back(
        geometry, std::shared_ptr<const float>(voxels, voxels.get() + n * geometry.voxel_count()));
  take_range(sequence.frames, sequence.info);
  return sequence;
}

}  // namespace

void take_range(const std::vector<core::Volume>& frames, core::VolumeInfo& info) {
  double sum = 0.0;
  for (std::size_t n = 0; n < frames.size(); ++n) {
    const auto& range = frames[n].range();
    info.min = n == 0 ? static_cast<double>(range.min) : std::min(info.min, static_cast<double>(range.min));
    info.max = n == 0 ? static_cast<double>(range.max) : std::max(info.max, static_cast<double>(range.max));
    sum += range.mean;
  }
  if (!frames.empty()) info.mean = sum / static_cast<double>(frames.size());
}

core::VolumeSequence read_paths(const std::vector<std::filesystem::path>& paths,
                                const std::filesystem::path& shown, const ReadOptions& options,
                                const core::Progress& progress, const ReaderLimits& limits) {
  ReaderRequest request;
  request.paths = paths;
  request.shown = shown;
  request.options = options;
  const ReaderReply reply = run_reader(request, progress.part(0.0, 0.9), limits);
  try {
    core::VolumeSequence sequence = accept(reply, options);
    progress.report(1.0, "Read");
    return sequence;
  } catch (const nlohmann::json::exception& error) {
    fail("reader-crashed", shown, "was not opened: the reader's answer makes no sense.", error.what());
  } catch (const std::invalid_argument& error) {
    fail("reader-crashed", shown, "was not opened: the reader's answer makes no sense.", error.what());
  } catch (const core::Error& error) {
    if (error.kind() != core::ErrorKind::input) throw;
    fail("reader-crashed", shown, "was not opened: the reader's answer makes no sense.", error.what());
  } catch (const std::bad_alloc&) {
    fail("reader-memory", shown, "needs more memory than there is. Read a single frame of it.");
  }
}

namespace {

/// "128 x 96 x 24, 0.5 x 0.5 x 1 mm, 2012-02-15"
std::string short_form(const core::VolumeInfo& info) {
  const auto& dims = info.geometry.dims();
  const auto& spacing = info.geometry.spacing_mm();
  std::ostringstream text;
  text << std::setprecision(4) << dims[0] << " x " << dims[1];
  if (dims[2] > 1) text << " x " << dims[2];
  if (info.frames > 1) text << ", " << info.frames << " frames";
  if (info.spacing_is_assumed()) {
    text << ", spacing unknown";
  } else {
    text << ", " << spacing[0] << " x " << spacing[1];
    if (dims[2] > 1) text << " x " << spacing[2];
    text << " mm";
  }
  if (!info.date.empty()) text << ", " << info.date;
  return text.str();
}

/// What there is to choose from, a line each.
std::string listing(const std::vector<Entry>& all, const core::Progress& progress,
                    const ReaderLimits& limits) {
  constexpr std::size_t most = 20;
  const std::vector<Entry> some(all.begin(),
                                all.begin() + static_cast<std::ptrdiff_t>(std::min(most, all.size())));
  const auto told = describe(some, {}, false, progress, limits);
  std::ostringstream text;
  for (std::size_t n = 0; n < some.size(); ++n) {
    const Entry& entry = some[n];
    const auto count = entry.files.size();
    text << "\n  " << (entry.uid.empty() ? entry.shown.filename().string() : entry.uid) << " (";
    if (!entry.uid.empty())
      text << (entry.modality.empty() ? "?" : entry.modality) << ", " << count
           << (count == 1 ? " file" : " files") << ", ";
    if (told[n].info && !told[n].error)
      text << short_form(*told[n].info);
    else
      text << entry.size << (entry.size.empty() ? "" : ", ") << "not readable";
    text << ")";
  }
  if (all.size() > most) text << "\n  and " << all.size() - most << " more";
  return text.str();
}

FoundScan find_in_folder(const std::filesystem::path& folder, const ReadOptions& options,
                         const core::Progress& progress, const ReaderLimits& limits) {
  const Survey survey = look_through({folder}, progress.part(0.0, 0.7), limits);
  std::vector<Entry> wanted;
  std::vector<Entry> others;
  for (auto& entry : entries_of(survey, options.series_uid)) {
    const Format format = entry.dicom ? Format::dicom : format_of(entry.files.front());
    if (entry.dicom && entry.image)
      wanted.push_back(std::move(entry));
    else if (format != Format::dicom && format != Format::other)
      others.push_back(std::move(entry));
  }
  if (wanted.empty() && !options.series_uid.empty())
    fail("not-found", folder,
         "holds no series " + options.series_uid + ". List what there is with: palpate-cli info " +
             folder.string());
  if (wanted.empty()) wanted = std::move(others);
  if (wanted.empty()) fail("no-image", folder, "holds no scan that can be read.");
  if (wanted.size() > 1) {
    const std::string& uid = wanted.front().uid;
    const bool same = !uid.empty() && std::all_of(wanted.begin(), wanted.end(),
                                                  [&](const Entry& entry) { return entry.uid == uid; });
    if (same)
      fail("no-volume", folder,
           "holds " + std::to_string(wanted.size()) +
               " pictures that belong to one series but are no volume together. Open one of the files.");
    const std::string choices = listing(wanted, progress.part(0.7, 1.0), limits);
    if (uid.empty())
      fail("several-series", folder,
           "holds " + std::to_string(wanted.size()) + " scans. Open one of the files:" + choices);
    fail("several-series", folder,
         "holds " + std::to_string(wanted.size()) + " series. Choose one by --series UID:" + choices);
  }
  FoundScan found;
  found.entry = std::move(wanted.front());
  if (found.entry.files.size() > 1) found.entry.shown = folder;
  if (!survey.broken.empty() && !found.entry.uid.empty())
    found.warnings.push_back(
        {"unreadable-files", std::to_string(survey.broken.size()) +
                                 " files of the folder could not be read and were left out, " +
                                 survey.broken.front().first.filename().string() + " among them."});
  return found;
}

/// Values of several readings of one scan, each of `weight` frames.
struct RangeSum {
  double min = 0.0, max = 0.0, sum = 0.0;
  int frames = 0;
  void add(const core::VolumeInfo& info, int weight) {
    min = frames == 0 ? info.min : std::min(min, info.min);
    max = frames == 0 ? info.max : std::max(max, info.max);
    sum += info.mean * weight;
    frames += weight;
  }
};

/// The description and range of all frames, some frames at a time where all
/// together are too many.
core::VolumeInfo inspect_whole(const Entry& entry, const ReadOptions& options, const core::Progress& progress,
                               const ReaderLimits& limits) {
  constexpr double at_once_bytes = 512.0 * 1024 * 1024;
  const auto read_all = [&] { return read_paths(entry.files, entry.shown, options, progress, limits).info; };
  if (options.frame) return read_all();
  std::error_code error;
  double file_bytes = 0.0;
  for (const auto& file : entry.files)
    file_bytes += static_cast<double>(std::filesystem::file_size(file, error));
  constexpr double small_file_bytes = 16.0 * 1024 * 1024;  // not worth a look ahead, whatever is in it
  if (error || file_bytes < small_file_bytes) {
    try {
      return read_all();
    } catch (const core::Error& failure) {
      if (failure.code() != "too-large" && failure.code() != "reader-memory") throw;
    }
  }
  const auto described = describe({entry}, options, false, core::Progress({}, progress.cancel()), limits);
  if (!described.front().info || described.front().info->frames == 1) return read_all();
  core::VolumeInfo info = *described.front().info;
  const double frame_bytes = static_cast<double>(info.geometry.voxel_count()) * sizeof(float);
  const double block = std::min(at_once_bytes, static_cast<double>(limits.memory_bytes) / 4.0) / frame_bytes;
  ReadOptions some = options;
  some.frame_count = std::clamp(static_cast<int>(std::min(block, 1e6)), 1, info.frames);
  if (some.frame_count == info.frames) return read_all();
  RangeSum range;
  while (range.frames < info.frames) {
    some.frame = range.frames;
    const core::VolumeSequence part =
        read_paths(entry.files, entry.shown, some, core::Progress({}, progress.cancel()), limits);
    if (part.frames.empty() || part.info.frames != info.frames) return read_all();
    info.warnings = part.info.warnings;
    range.add(part.info, static_cast<int>(part.frames.size()));
  }
  info.min = range.min;
  info.max = range.max;
  info.mean = range.sum / range.frames;
  return info;
}

}  // namespace

FoundScan find_scan(const std::filesystem::path& path, const ReadOptions& options,
                    const core::Progress& progress, const ReaderLimits& limits) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) fail("not-found", path, "does not exist. Check the name.");
  if (std::filesystem::is_directory(status)) return find_in_folder(path, options, progress, limits);
  if (!std::filesystem::is_regular_file(status)) fail("unsupported", path, "is neither a file nor a folder.");
  FoundScan found;
  found.entry.files = {path};
  found.entry.shown = path;
  return found;
}

void check_series(const core::VolumeInfo& info, const std::filesystem::path& path,
                  const ReadOptions& options) {
  if (names_series(options.series_uid, info.series_uid)) return;
  fail("not-found", path,
       (info.series_uid.empty() ? std::string("belongs to no series, so not to ")
                                : "belongs to series " + info.series_uid + ", not ") +
           options.series_uid + ".");
}

}  // namespace reading

core::VolumeSequence read(const std::filesystem::path& path, const ReadOptions& options,
                          const core::Progress& progress, const ReaderLimits& limits) {
  using namespace reading;
  const bool folder = std::filesystem::is_directory(path);
  const FoundScan found = find_scan(path, options, progress.part(0.0, folder ? 0.3 : 0.0), limits);
  core::VolumeSequence sequence = read_paths(found.entry.files, found.entry.shown, options,
                                             progress.part(folder ? 0.3 : 0.0, 1.0), limits);
  name_part(found.entry.uid, sequence.info);
  check_series(sequence.info, path, options);
  sequence.info.warnings.insert(sequence.info.warnings.end(), found.warnings.begin(), found.warnings.end());
  return sequence;
}

namespace {

using namespace reading;

InputReport report_of(const std::filesystem::path& path, const core::Error& error) {
  InputReport report;
  report.path = path;
  report.error_code = error.code();
  report.error_text = error.what();
  return report;
}

InputReport report_of(const std::filesystem::path& path, core::VolumeInfo info) {
  InputReport report;
  report.path = path;
  report.ok = true;
  report.volumes.push_back(std::move(info));
  return report;
}

void add_unseen(const Survey& survey, std::vector<InputReport>& reports) {
  for (const auto& [path, error] : survey.broken) reports.push_back(report_of(path, error));
  for (const auto& path : survey.missing)
    reports.push_back(report_of(path, core::Error(core::ErrorKind::input, "not-found",
                                                  path.string() + " does not exist. Check the name.")));
  std::stable_sort(reports.begin(), reports.end(),
                   [](const InputReport& a, const InputReport& b) { return a.path < b.path; });
}

}  // namespace

std::vector<InputReport> inspect(const std::vector<std::filesystem::path>& paths, const ReadOptions& options,
                                 const core::Progress& progress, const ReaderLimits& limits) {
  const Survey survey = look_through(paths, progress.part(0.0, 0.3), limits);
  const std::vector<Entry> entries = entries_of(survey, options.series_uid);
  std::vector<InputReport> reports;
  for (const auto& entry : entries) {
    const double done = static_cast<double>(reports.size()) / static_cast<double>(entries.size());
    progress.report(0.3 + 0.7 * done, "Reading " + entry.shown.filename().string());
    try {
      const core::Progress silent({}, progress.cancel());
      core::VolumeInfo info = inspect_whole(entry, options, silent, limits);
      name_part(entry.uid, info);
      reports.push_back(report_of(entry.shown, std::move(info)));
    } catch (const core::Error& error) {
      if (error.kind() == core::ErrorKind::cancelled || error.code() == "reader-missing") throw;
      reports.push_back(report_of(entry.shown, error));
    }
  }
  add_unseen(survey, reports);
  return reports;
}

std::vector<InputReport> inspect_headers(const std::vector<std::filesystem::path>& paths,
                                         const ReadOptions& options, const core::Progress& progress,
                                         const ReaderLimits& limits) {
  const Survey survey = look_through(paths, progress.part(0.0, 0.5), limits);
  const std::vector<Entry> entries = entries_of(survey, options.series_uid);
  auto descriptions = describe(entries, options, false, progress.part(0.5, 1.0), limits);
  std::vector<InputReport> reports;
  for (std::size_t n = 0; n < entries.size(); ++n)
    reports.push_back(descriptions[n].error ? report_of(entries[n].shown, *descriptions[n].error)
                                            : report_of(entries[n].shown, std::move(*descriptions[n].info)));
  add_unseen(survey, reports);
  return reports;
}

}  // namespace palpate::imaging
