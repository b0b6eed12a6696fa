// What a folder offers to choose from.
#include "reading/parsed.hpp"
#include "reading/series.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"

#include <algorithm>

namespace palpate::imaging {
namespace {

using namespace reading;

/// A header file that has its voxels beside it stands for both.
bool belongs_to_another(const std::filesystem::path& path) {
  const std::string name = path.filename().string();
  for (const std::string end : {".img", ".img.gz"}) {
    if (name.size() <= end.size() || name.compare(name.size() - end.size(), end.size(), end) != 0) continue;
    std::error_code error;
    return std::filesystem::exists(path.parent_path() / (name.substr(0, name.size() - end.size()) + ".hdr"),
                                   error);
  }
  return false;
}

SeriesSummary summary_of(const Entry& entry) {
  SeriesSummary summary;
  summary.path = entry.shown;
  summary.files = entry.files.size();
  summary.info.series_uid = entry.uid;
  summary.info.modality = entry.modality;
  if (entry.dicom) summary.info.format = "DICOM";
  return summary;
}

}  // namespace

std::vector<SeriesSummary> list_series(const std::filesystem::path& folder, const core::Progress& progress,
                                       const ReaderLimits& limits) {
  std::error_code error;
  if (!std::filesystem::exists(folder, error)) fail("not-found", folder, "does not exist. Check the name.");
  const Survey survey = look_through({folder}, progress.part(0.0, 0.5), limits);
  std::vector<Entry> entries;
  for (auto& entry : entries_of(survey, {})) {
    const bool scan = entry.dicom || format_of(entry.files.front()) != Format::other;
    if (scan && entry.image && !belongs_to_another(entry.files.front())) entries.push_back(std::move(entry));
  }
  std::vector<Description> descriptions = describe(entries, {}, true, progress.part(0.5, 1.0), limits);
  std::vector<SeriesSummary> summaries;
  for (std::size_t n = 0; n < entries.size(); ++n) {
    SeriesSummary summary = summary_of(entries[n]);
    Description& description = descriptions[n];
    if (description.info) summary.info = std::move(*description.info);
    summary.thumbnail = std::move(description.thumbnail);
    if (description.error) {
      summary.error_code = description.error->code();
      summary.error_text = description.error->what();
    }
    summaries.push_back(std::move(summary));
  }
  for (const auto& [path, broken] : survey.broken) {
    SeriesSummary summary;
    summary.path = path;
    summary.files = 1;
    summary.error_code = broken.code();
    summary.error_text = broken.what();
    summaries.push_back(std::move(summary));
  }
  std::stable_sort(summaries.begin(), summaries.end(),
                   [](const SeriesSummary& a, const SeriesSummary& b) { return a.path < b.path; });
  progress.report(1.0, "Listed");
  return summaries;
}

}  // namespace palpate::imaging
