#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"
#include "palpate/imaging/reader.hpp"

#include <cstddef>
#include <filesystem>
#include <memory>

namespace palpate::imaging {

/// The frames of a 4-D scan, read when they are asked for and kept while a
/// memory budget lasts; the longest unused goes first. What somebody still
/// holds lives on with them. Safe from any thread; a frame that two ask for at
/// once is read once.
class FrameStore {
 public:
  /// Reads the first frame that `options` name (0 where none). Throws as read().
  FrameStore(std::filesystem::path path, ReadOptions options, std::size_t budget_bytes,
             const core::Progress& progress = {}, ReaderLimits limits = {});
  ~FrameStore();
  FrameStore(const FrameStore&) = delete;
  FrameStore& operator=(const FrameStore&) = delete;

  /// As the file says it of all frames; min, max and mean are those of the first that was read.
  const core::VolumeInfo& info() const;
  /// Frame k, from the memory or from the file; from the file it reads some
  /// that follow along, as far as half the budget and 256 MB allow. Throws as
  /// read(), and Error(input, "changed") where the file is no more what it was.
  core::Volume frame(int k, const core::Progress& progress = {});
  /// Whether frame(k) would return at once.
  bool holds(int k) const;
  std::size_t held_bytes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace palpate::imaging
