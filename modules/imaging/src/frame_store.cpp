#include "palpate/imaging/frame_store.hpp"

#include "reading/parsed.hpp"
#include "reading/series.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <list>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

namespace palpate::imaging {
namespace {

/// Frames that were read together and share one piece of memory.
struct Block {
  int first = 0;
  std::vector<core::Volume> frames;
  std::size_t bytes = 0;
  bool has(int k) const { return k >= first && k < first + static_cast<int>(frames.size()); }
};

/// A reading on its way, in a thread of its own: it outlives whoever asked
/// first, and stops once nobody waits for it any more.
struct Job {
  int first = 0, count = 0;
  int waiting = 0;
  bool done = false;
  core::CancelToken cancel;
  std::optional<core::Error> error;
  std::vector<core::Volume> frames;  ///< for those who wait, whatever the budget drops meanwhile
  double fraction = 0.0;
  std::string what;
  std::thread thread;
  bool has(int k) const { return k >= first && k < first + count; }
};

}  // namespace

struct FrameStore::State {
  reading::FoundScan found;
  ReadOptions options;
  ReaderLimits limits;
  std::size_t budget_bytes = 0;
  core::VolumeInfo info;

  mutable std::mutex mutex;
  std::condition_variable changed;
  std::list<Block> blocks;  ///< the last used first
  std::list<Job> jobs;

  std::size_t frame_bytes() const { return info.geometry.voxel_count() * sizeof(float); }
  std::size_t held_bytes() const {
    std::size_t bytes = 0;
    for (const auto& block : blocks) bytes += block.bytes;
    return bytes;
  }
  bool holds(int k) const {
    return std::any_of(blocks.begin(), blocks.end(), [&](const Block& block) { return block.has(k); });
  }
  Job* job_of(int k) {
    for (auto& job : jobs)
      if (job.has(k) && !job.done && !job.cancel.cancelled()) return &job;
    return nullptr;
  }
  /// The frame, its block now the last used; empty where it is not here.
  core::Volume take(int k) {
    const auto block =
        std::find_if(blocks.begin(), blocks.end(), [&](const Block& one) { return one.has(k); });
    if (block == blocks.end()) return {};
    blocks.splice(blocks.begin(), blocks, block);
    return blocks.front().frames[static_cast<std::size_t>(k - blocks.front().first)];
  }
  /// Drops the longest unused until that much more fits.
  void make_room(std::size_t bytes) {
    while (!blocks.empty() && held_bytes() + bytes > budget_bytes) blocks.pop_back();
  }
  void keep(core::VolumeSequence sequence) {
    Block block;
    block.first = sequence.first_frame;
    block.frames = std::move(sequence.frames);
    block.bytes = block.frames.size() * frame_bytes();
    make_room(block.bytes);
    blocks.push_front(std::move(block));
  }
  /// How many frames from k on are worth one reading.
  int count_from(int k) {
    // More would keep whoever waits for the first of them waiting.
    constexpr std::size_t most_bytes = std::size_t{256} << 20;
    const std::size_t fit = std::max<std::size_t>(
        1, std::min(budget_bytes / 2, most_bytes) / std::max<std::size_t>(1, frame_bytes()));
    int end = k + static_cast<int>(std::min<std::size_t>(fit, static_cast<std::size_t>(info.frames - k)));
    for (int next = k + 1; next < end; ++next)
      if (holds(next) || job_of(next) != nullptr) end = next;
    return end - k;
  }
  core::VolumeSequence read_frames(int first, int count, const core::Progress& progress) const {
    ReadOptions some = options;
    some.frame = first;
    some.frame_count = count;
    return reading::read_paths(found.entry.files, found.entry.shown, some, progress, limits);
  }
  void check_same(const core::VolumeSequence& sequence) const {
    if (sequence.info.frames == info.frames && sequence.info.geometry == info.geometry) return;
    reading::fail("changed", found.entry.shown, "was changed while it was open. Open it again.");
  }
  void run(Job& job);
  Job& start(int k);
  void finish_jobs();
};

/// The thread of a job. Nothing leaves it but by the job and the blocks.
void FrameStore::State::run(Job& job) {
  const auto note = [&](double fraction, const std::string& what) {
    const std::lock_guard<std::mutex> lock(mutex);
    job.fraction = fraction;
    job.what = what;
  };
  std::optional<core::Error> error;
  core::VolumeSequence sequence;
  try {
    sequence = read_frames(job.first, job.count, core::Progress(note, job.cancel));
    check_same(sequence);
  } catch (const core::Error& failure) {
    error = failure;
  } catch (const std::exception& failure) {
    error = core::Error(core::ErrorKind::internal, "internal", failure.what());
  }
  const std::lock_guard<std::mutex> lock(mutex);
  if (error) {
    job.error = std::move(error);
  } else {
    job.frames = sequence.frames;
    keep(std::move(sequence));
  }
  job.done = true;
  changed.notify_all();
}

/// With the mutex held.
Job& FrameStore::State::start(int k) {
  finish_jobs();
  jobs.emplace_back();
  Job& job = jobs.back();
  job.first = k;
  job.count = 1;
  job.count = count_from(k);
  make_room(static_cast<std::size_t>(job.count) * frame_bytes());
  try {
    job.thread = std::thread([this, &job] { run(job); });
  } catch (const std::system_error& error) {
    jobs.pop_back();
    throw core::Error(core::ErrorKind::internal, "no-thread", "The frame cannot be read now; try again.",
                      error.what());
  }
  return job;
}

/// Forgets jobs that nobody needs any more. With the mutex held: a job that is
/// done has let go of it for good.
void FrameStore::State::finish_jobs() {
  for (auto job = jobs.begin(); job != jobs.end();) {
    if (job->done && job->waiting == 0) {
      job->thread.join();
      job = jobs.erase(job);
    } else {
      ++job;
    }
  }
}

FrameStore::FrameStore(std::filesystem::path path, ReadOptions options, std::size_t budget_bytes,
                       const core::Progress& progress, ReaderLimits limits)
    : state_(std::make_unique<State>()) {
  State& state = *state_;
  state.options = std::move(options);
  state.budget_bytes = budget_bytes;
  state.limits = limits;
  state.found = reading::find_scan(path, state.options, progress.part(0.0, 0.3), limits);
  const int first = state.options.frame.value_or(0);
  core::VolumeSequence sequence = state.read_frames(first, 1, progress.part(0.3, 1.0));
  reading::name_part(state.found.entry.uid, sequence.info);
  reading::check_series(sequence.info, path, state.options);
  state.info = sequence.info;
  state.info.warnings.insert(state.info.warnings.end(), state.found.warnings.begin(),
                             state.found.warnings.end());
  state.keep(std::move(sequence));
}

FrameStore::~FrameStore() {
  for (auto& job : state_->jobs) job.cancel.cancel();
  for (auto& job : state_->jobs) job.thread.join();
}

const core::VolumeInfo& FrameStore::info() const { return state_->info; }

core::Volume FrameStore::frame(int k, const core::Progress& progress) {
  State& state = *state_;
  if (k < 0 || k >= state.info.frames)
    core::throw_usage("There is no frame " + std::to_string(k) + "; the scan has " +
                      std::to_string(state.info.frames) + ", counted from 0.");
  std::unique_lock<std::mutex> lock(state.mutex);
  if (core::Volume held = state.take(k); !held.empty()) return held;
  Job* running = state.job_of(k);
  Job& job = running != nullptr ? *running : state.start(k);
  ++job.waiting;
  const auto leave = [&] {
    if (--job.waiting > 0) return;
    job.frames.clear();
    if (!job.done) job.cancel.cancel();
  };
  while (!job.done) {
    constexpr std::chrono::milliseconds pause(20);  // how late a cancellation may be seen
    state.changed.wait_for(lock, pause);
    const double fraction = job.fraction;
    const std::string what = job.what;
    lock.unlock();
    try {
      if (what.empty())
        progress.cancel().check();
      else
        progress.report(fraction, what);
    } catch (...) {
      lock.lock();
      leave();
      throw;
    }
    lock.lock();
  }
  core::Volume frame;
  const std::optional<core::Error> error = job.error;
  if (!error) frame = job.frames[static_cast<std::size_t>(k - job.first)];
  leave();
  if (error) throw core::Error(*error);
  return frame;
}

bool FrameStore::holds(int k) const {
  const std::lock_guard<std::mutex> lock(state_->mutex);
  return state_->holds(k);
}

std::size_t FrameStore::held_bytes() const {
  const std::lock_guard<std::mutex> lock(state_->mutex);
  return state_->held_bytes();
}

}  // namespace palpate::imaging
