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
#include <map>
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
  void* memory = mmap(nullptr, bytes, PROT_READ, MAP_SHARED, voxels.number(), 0);
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
  const ReaderReply reply =
      run_reader(ReaderTask::read, paths, shown, options, progress.part(0.0, 0.9), limits);
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

std::string listing(const std::vector<Series>& all) {
  std::string text;
  for (std::size_t n = 0; n < all.size() && n < 20; ++n)
    text += "\n  " + all[n].uid + " (" + (all[n].modality.empty() ? "?" : all[n].modality) + ", " +
            std::to_string(all[n].files.size()) + (all[n].files.size() == 1 ? " file, " : " files, ") +
            all[n].size + ")";
  if (all.size() > 20) text += "\n  and " + std::to_string(all.size() - 20) + " more";
  return text;
}

core::VolumeSequence read_folder(const std::filesystem::path& folder, const ReadOptions& options,
                                 const core::Progress& progress, const ReaderLimits& limits) {
  Survey survey = look_through({folder}, progress.part(0.0, 0.3), limits);
  std::vector<Series> wanted;
  for (auto& series : survey.series)
    if (series.image && (options.series_uid.empty() || series.uid == options.series_uid))
      wanted.push_back(std::move(series));
  if (wanted.empty()) {
    if (!options.series_uid.empty())
      fail("not-found", folder,
           "holds no series " + options.series_uid + ". List what there is with: palpate-cli info " +
               folder.string());
    std::vector<std::filesystem::path> scans;
    for (const auto& path : survey.others)
      if (const Format format = format_of(path); format != Format::other && format != Format::dicom)
        scans.push_back(path);
    if (scans.size() == 1) return read_paths(scans, scans.front(), options, progress.part(0.3, 1.0), limits);
    if (scans.empty()) fail("no-image", folder, "holds no scan that can be read.");
    fail("several-series", folder,
         "holds " + std::to_string(scans.size()) + " scans. Open one of the files.");
  }
  if (wanted.size() > 1) {
    const bool same = std::all_of(wanted.begin(), wanted.end(),
                                  [&](const Series& s) { return s.uid == wanted.front().uid; });
    if (same)
      fail("no-volume", folder,
           "holds " + std::to_string(wanted.size()) +
               " pictures that belong to one series but are no volume together. Open one of the files.");
    fail("several-series", folder,
         "holds " + std::to_string(wanted.size()) + " series. Choose one by --series:" + listing(wanted));
  }
  core::VolumeSequence sequence =
      read_paths(wanted.front().files, folder, options, progress.part(0.3, 1.0), limits);
  if (!survey.broken.empty())
    warn(sequence.info, "unreadable-files",
         std::to_string(survey.broken.size()) + " files of the folder could not be read and were left out, " +
             survey.broken.front().first.filename().string() + " among them.");
  return sequence;
}

}  // namespace
}  // namespace reading

core::VolumeSequence read(const std::filesystem::path& path, const ReadOptions& options,
                          const core::Progress& progress, const ReaderLimits& limits) {
  using namespace reading;
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) fail("not-found", path, "does not exist. Check the name.");
  if (std::filesystem::is_directory(status)) return read_folder(path, options, progress, limits);
  if (!std::filesystem::is_regular_file(status)) fail("unsupported", path, "is neither a file nor a folder.");
  core::VolumeSequence sequence = read_paths({path}, path, options, progress, limits);
  if (!options.series_uid.empty() && sequence.info.series_uid != options.series_uid)
    fail("not-found", path,
         (sequence.info.series_uid.empty() ? std::string("belongs to no series, so not to ")
                                           : "belongs to series " + sequence.info.series_uid + ", not ") +
             options.series_uid + ".");
  return sequence;
}

std::vector<InputReport> inspect(const std::vector<std::filesystem::path>& paths, const ReadOptions& options,
                                 const core::Progress& progress, const ReaderLimits& limits) {
  using namespace reading;
  const Survey survey = look_through(paths, progress.part(0.0, 0.3), limits);
  std::vector<InputReport> reports;
  const std::size_t total = survey.series.size() + survey.others.size();
  const auto inspect_one = [&](const std::vector<std::filesystem::path>& files,
                               const std::filesystem::path& shown) {
    const double done = total == 0 ? 1.0 : static_cast<double>(reports.size()) / static_cast<double>(total);
    progress.report(0.3 + 0.7 * std::min(1.0, done), "Reading " + shown.filename().string());
    InputReport report;
    report.path = shown;
    try {
      const core::Progress silent({}, progress.cancel());
      report.volumes.push_back(read_paths(files, shown, options, silent, limits).info);
      report.ok = true;
    } catch (const core::Error& error) {
      if (error.kind() == core::ErrorKind::cancelled || error.code() == "reader-missing") throw;
      report.error_code = error.code();
      report.error_text = error.what();
    }
    reports.push_back(std::move(report));
  };
  for (const auto& series : survey.series)
    if (options.series_uid.empty() || series.uid == options.series_uid)
      inspect_one(series.files,
                  series.files.size() == 1 ? series.files.front() : series.files.front().parent_path());
  for (const auto& path : survey.others) inspect_one({path}, path);
  for (const auto& [path, error] : survey.broken)
    reports.push_back({path, false, error.code(), error.what(), {}});
  for (const auto& path : survey.missing)
    reports.push_back({path, false, "not-found", path.string() + " does not exist. Check the name.", {}});
  std::stable_sort(reports.begin(), reports.end(),
                   [](const InputReport& a, const InputReport& b) { return a.path < b.path; });
  return reports;
}

}  // namespace palpate::imaging
