#include "dicom_fragments.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::imaging::reading {
namespace {

/// Runs from the numbers of their first fragments.
std::vector<FragmentRun> runs_from(const std::vector<std::size_t>& firsts, std::size_t fragments) {
  std::vector<FragmentRun> runs;
  for (std::size_t n = 0; n < firsts.size(); ++n) {
    const std::size_t end = n + 1 < firsts.size() ? firsts[n + 1] : fragments;
    runs.push_back({firsts[n], end - firsts[n]});
  }
  return runs;
}

/// The fragments that the offsets point to; empty where they are no table of so many frames.
std::vector<std::size_t> firsts_by_table(const std::vector<std::uint64_t>& offsets,
                                         const std::vector<DicomPixelPlace::Piece>& fragments,
                                         std::size_t frames) {
  std::vector<std::size_t> firsts;
  if (offsets.size() != frames || offsets.front() != 0) return firsts;
  const std::uint64_t base = fragments.front().offset;
  std::size_t fragment = 0;
  for (const std::uint64_t offset : offsets) {
    while (fragment < fragments.size() && fragments[fragment].offset - base < offset) ++fragment;
    if (fragment == fragments.size() || fragments[fragment].offset - base != offset ||
        (!firsts.empty() && fragment == firsts.back()))
      return {};
    firsts.push_back(fragment);
  }
  return firsts;
}

bool begins_stream(const DicomFile& file, const DicomPixelPlace::Piece& fragment, FrameCoding coding) {
  const auto start = file.read(fragment.offset, 4);
  if (start.size() < 4) return false;
  if (coding == FrameCoding::jpeg_2000)
    return (start[0] == 0xFF && start[1] == 0x4F && start[2] == 0xFF && start[3] == 0x51) ||
           (start[0] == 0 && start[1] == 0 && start[2] == 0 && start[3] == 12);
  if (coding == FrameCoding::rle) return start[0] <= 15 && start[1] == 0 && start[2] == 0 && start[3] == 0;
  return start[0] == 0xFF && start[1] == 0xD8 && start[2] == 0xFF;
}

}  // namespace

std::vector<FragmentRun> fragments_of_frames(const DicomFile& file, int frames, FrameCoding coding) {
  const auto& fragments = file.pixels().fragments;
  const auto wanted = static_cast<std::size_t>(frames);
  std::vector<FragmentRun> runs(wanted);
  if (fragments.empty()) return runs;
  if (fragments.size() == wanted) {
    for (std::size_t n = 0; n < wanted; ++n) runs[n] = {n, 1};
    return runs;
  }
  if (fragments.size() > wanted) {
    auto firsts = firsts_by_table(file.pixels().offsets, fragments, wanted);
    if (firsts.empty()) {
      std::vector<std::uint64_t> offsets;
      for (const double offset : file.dataset().numbers({0x7FE0, 0x0001}))
        offsets.push_back(offset > 0.0 ? static_cast<std::uint64_t>(offset) : 0);
      if (!offsets.empty()) firsts = firsts_by_table(offsets, fragments, wanted);
    }
    if (!firsts.empty()) return runs_from(firsts, fragments.size());
  }
  std::vector<std::size_t> firsts;
  for (std::size_t n = 0; n < fragments.size(); ++n)
    if (begins_stream(file, fragments[n], coding)) firsts.push_back(n);
  if (firsts.empty() || firsts.front() != 0) firsts.insert(firsts.begin(), 0);
  const auto found = runs_from(firsts, fragments.size());
  std::copy_n(found.begin(), std::min(found.size(), wanted), runs.begin());
  return runs;
}

FrameStream read_fragments(const DicomFile& file, const FragmentRun& run) {
  FrameStream stream;
  for (std::size_t n = run.first; n < run.first + run.count; ++n) {
    const auto& piece = file.pixels().fragments[n];
    const auto bytes = file.read(piece.offset, static_cast<std::size_t>(piece.present));
    stream.whole = stream.whole && bytes.size() == piece.length;
    stream.bytes.insert(stream.bytes.end(), bytes.begin(), bytes.end());
  }
  return stream;
}

}  // namespace palpate::imaging::reading
