#pragma once

#include "palpate/core/progress.hpp"

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <string>
#include <thread>
#include <vector>

namespace palpate::model {

inline unsigned core_count() { return std::max(1U, std::thread::hardware_concurrency()); }

/// Calls work(begin, end) for chunks that cover [0, count), on `threads`
/// threads of which the caller is one. Chunks are the unit of cancelling, so
/// keep one to a few milliseconds. Only the caller reports, so that a progress
/// callback needs no lock. The first exception of any thread is thrown here.
template <typename Work>
void parallel_for(std::size_t count, std::size_t chunk, unsigned threads, const core::Progress& progress,
                  const std::string& what, const Work& work) {
  std::atomic<std::size_t> next{0};
  std::atomic<bool> stop{false};
  const auto take_one = [&] {
    const std::size_t begin = next.fetch_add(chunk, std::memory_order_relaxed);
    if (begin >= count || stop.load(std::memory_order_relaxed) || progress.cancel().cancelled()) return false;
    work(begin, std::min(count, begin + chunk));
    return true;
  };

  const std::size_t chunks = (count + chunk - 1) / chunk;
  const std::size_t helpers = std::min<std::size_t>(threads, chunks);
  std::vector<std::exception_ptr> failures(helpers > 1 ? helpers - 1 : 0);
  std::vector<std::thread> team;
  team.reserve(failures.size());
  std::exception_ptr failure;
  try {
    for (std::exception_ptr& slot : failures)
      team.emplace_back([&take_one, &stop, &slot] {
        try {
          while (take_one()) {
          }
        } catch (...) {
          slot = std::current_exception();
          stop = true;
        }
      });
    do {
      progress.report(static_cast<double>(std::min(count, next.load())) /
                          static_cast<double>(std::max<std::size_t>(count, 1)),
                      what);
    } while (take_one());
  } catch (...) {
    failure = std::current_exception();
    stop = true;
  }
  for (std::thread& member : team) member.join();
  if (failure) std::rethrow_exception(failure);
  for (const std::exception_ptr& slot : failures)
    if (slot) std::rethrow_exception(slot);
  progress.report(1.0, what);
}

}  // namespace palpate::model
