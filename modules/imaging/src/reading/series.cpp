#include "series.hpp"

#include "parsed.hpp"
#include "process.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <map>

namespace palpate::imaging::reading {
namespace {

namespace fs = std::filesystem;

/// The files of a folder and its folders, in the order of their names. Links
/// to folders are not followed: they may lead in a circle.
void walk(const fs::path& folder, std::vector<fs::path>& files, const core::Progress& progress) {
  progress.cancel().check();
  std::vector<fs::path> here;
  std::error_code error;
  for (fs::directory_iterator entry(folder, fs::directory_options::skip_permission_denied, error), end;
       !error && entry != end; entry.increment(error))
    here.push_back(entry->path());
  std::sort(here.begin(), here.end());
  for (const auto& path : here) {
    const auto status = fs::status(path, error);
    if (fs::is_directory(status)) {
      if (!fs::is_symlink(path, error)) walk(path, files, progress);
    } else if (fs::is_regular_file(status)) {
      files.push_back(path);
    }
  }
}

using Files = std::vector<fs::path>;

/// Between the UID of a series and the number of its part; no UID holds it.
constexpr char part_mark = '#';

/// Looks at files [from, to) in one child; where that dies, at each half in its own.
void scan(const Files& files, std::size_t from, std::size_t to, std::vector<DicomGlance>& seen,
          Survey& survey, const core::Progress& progress, const ReaderLimits& limits) {
  try {
    const Files part(files.begin() + static_cast<std::ptrdiff_t>(from),
                     files.begin() + static_cast<std::ptrdiff_t>(to));
    ReaderRequest request;
    request.task = ReaderTask::scan;
    request.paths = part;
    request.shown = part.front();
    const ReaderReply reply = run_reader(request, core::Progress({}, progress.cancel()), limits);
    const auto& list = reply.result.at("files");
    if (list.size() != part.size())
      fail("reader-crashed", part.front(), "was not opened: the reader's answer makes no sense.");
    for (std::size_t n = 0; n < part.size(); ++n) {
      DicomGlance& glance = seen[from + n];
      glance.dicom = list[n].at("dicom").get<bool>();
      glance.image = list[n].at("image").get<bool>();
      glance.slice = list[n].at("slice").get<bool>();
      glance.series_uid = list[n].at("series_uid").get<std::string>().substr(0, 100);
      glance.instance_uid = list[n].at("instance_uid").get<std::string>().substr(0, 100);
      glance.modality = list[n].at("modality").get<std::string>().substr(0, 20);
      glance.size = list[n].at("size").get<std::string>().substr(0, 100);
      glance.localizer = list[n].at("localizer").get<bool>();
      glance.axes = list[n].at("axes").get<std::array<double, 6>>();
    }
  } catch (const core::Error& error) {
    if (error.kind() == core::ErrorKind::cancelled || error.code() == "reader-missing") throw;
    if (to - from == 1) {
      survey.broken.emplace_back(files[from], error);
      return;
    }
    const std::size_t middle = from + (to - from) / 2;
    scan(files, from, middle, seen, survey, progress, limits);
    scan(files, middle, to, seen, survey, progress, limits);
  } catch (const nlohmann::json::exception& error) {
    fail("reader-crashed", files[from], "was not opened: the reader's answer makes no sense.", error.what());
  }
}

bool same_bytes(const fs::path& a, const fs::path& b) {
  std::error_code error;
  if (fs::file_size(a, error) != fs::file_size(b, error) || error) return false;
  std::ifstream first(a, std::ios::binary);
  std::ifstream second(b, std::ios::binary);
  return first && second &&
         std::equal(std::istreambuf_iterator<char>(first), std::istreambuf_iterator<char>(),
                    std::istreambuf_iterator<char>(second));
}

bool in_one_stack(const DicomGlance& a, const DicomGlance& b) {
  constexpr double same_direction = 0.9998;  // a cosine: within about one degree
  for (std::size_t from : {0U, 3U})
    if (a.axes[from] * b.axes[from] + a.axes[from + 1] * b.axes[from + 1] +
            a.axes[from + 2] * b.axes[from + 2] <
        same_direction)
      return false;
  return a.size == b.size;
}

/// Parts the series whose slices lie in several directions, or are of several
/// sizes, into one for each: "UID#1", "UID#2". Localizers and pictures that
/// lie singly stay together, to be refused as what they are.
void part_stacks(const std::map<fs::path, const DicomGlance*>& seen, Survey& survey) {
  std::vector<Series> parted;
  for (auto& series : survey.series) {
    std::vector<Series> stacks;
    bool localizer = false;
    for (const auto& file : series.files) {
      const DicomGlance& glance = *seen.at(file);
      localizer = localizer || glance.localizer;
      const auto stack = std::find_if(stacks.begin(), stacks.end(), [&](const Series& s) {
        return in_one_stack(*seen.at(s.files.front()), glance);
      });
      if (stack != stacks.end())
        stack->files.push_back(file);
      else
        stacks.push_back({series.uid, glance.modality, glance.size, glance.image, {file}});
    }
    const bool any_volume =
        std::any_of(stacks.begin(), stacks.end(), [](const Series& s) { return s.files.size() > 1; });
    if (stacks.size() < 2 || localizer || !any_volume) {
      parted.push_back(std::move(series));
      continue;
    }
    for (std::size_t n = 0; n < stacks.size(); ++n) {
      stacks[n].uid += part_mark + std::to_string(n + 1);
      parted.push_back(std::move(stacks[n]));
    }
  }
  survey.series = std::move(parted);
}

void group(const Files& files, const std::vector<DicomGlance>& seen, Survey& survey) {
  std::map<std::pair<fs::path, std::string>, std::size_t> slices_of;
  std::map<std::pair<fs::path, std::string>, std::size_t> instances;  // the first file of each
  for (std::size_t n = 0; n < files.size(); ++n) {
    const DicomGlance& glance = seen[n];
    const bool broken = std::any_of(survey.broken.begin(), survey.broken.end(),
                                    [&](const auto& b) { return b.first == files[n]; });
    if (broken) continue;
    if (!glance.dicom) {
      survey.others.push_back(files[n]);
      continue;
    }
    // A second file of the same instance is another version of it, not another
    // slice; a plain copy goes with its series, which leaves it out and says so.
    const auto [first, fresh] = instances.try_emplace({files[n].parent_path(), glance.instance_uid}, n);
    const bool version =
        !glance.instance_uid.empty() && !fresh && !same_bytes(files[first->second], files[n]);
    if (glance.slice && !version && !glance.series_uid.empty()) {
      const auto [place, added] =
          slices_of.try_emplace({files[n].parent_path(), glance.series_uid}, survey.series.size());
      if (!added) {
        survey.series[place->second].files.push_back(files[n]);
        continue;
      }
    }
    survey.series.push_back({glance.series_uid, glance.modality, glance.size, glance.image, {files[n]}});
  }
  std::map<fs::path, const DicomGlance*> seen_by_path;
  for (std::size_t n = 0; n < files.size(); ++n) seen_by_path[files[n]] = &seen[n];
  part_stacks(seen_by_path, survey);
}

}  // namespace

Survey look_through(const std::vector<fs::path>& paths, const core::Progress& progress,
                    const ReaderLimits& limits) {
  Survey survey;
  Files candidates;
  for (const auto& path : paths) {
    std::error_code error;
    const auto status = fs::status(path, error);
    Files files;
    if (fs::is_directory(status))
      walk(path, files, progress);
    else if (fs::is_regular_file(status))
      files.push_back(path);
    else
      survey.missing.push_back(path);
    for (const auto& file : files)
      (format_of(file) == Format::dicom ? candidates : survey.others).push_back(file);
  }
  std::vector<DicomGlance> seen(candidates.size());
  constexpr std::size_t at_once = 256;  // a report of progress a child
  for (std::size_t from = 0; from < candidates.size(); from += at_once) {
    progress.report(static_cast<double>(from) / static_cast<double>(candidates.size()), "Looking for series");
    scan(candidates, from, std::min(candidates.size(), from + at_once), seen, survey, progress, limits);
  }
  group(candidates, seen, survey);
  return survey;
}

bool names_series(const std::string& wanted, const std::string& uid) {
  return wanted.empty() || uid == wanted || uid.compare(0, wanted.size() + 1, wanted + part_mark) == 0;
}

void name_part(const std::string& uid, core::VolumeInfo& info) {
  if (uid.find(part_mark) != std::string::npos) info.series_uid = uid;
}

std::vector<Entry> entries_of(const Survey& survey, const std::string& series_uid) {
  std::vector<Entry> entries;
  for (const auto& series : survey.series)
    if (names_series(series_uid, series.uid))
      entries.push_back({series.files,
                         series.files.size() == 1 ? series.files.front() : series.files.front().parent_path(),
                         true, series.image, series.uid, series.modality, series.size});
  for (const auto& path : survey.others) entries.push_back({{path}, path, false, true, {}, {}, {}});
  return entries;
}

}  // namespace palpate::imaging::reading
