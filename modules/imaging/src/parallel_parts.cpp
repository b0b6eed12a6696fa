#include "parallel_parts.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace palpate::imaging {

void for_each_part(int count, const core::Progress& progress, const std::string& what,
                   const std::function<void(int)>& work) {
  progress.report(0.0, what);
  std::atomic<int> next{0};
  std::atomic<bool> stop{false};
  std::mutex mutex;
  std::exception_ptr caught;
  const auto keep = [&] {
    const std::lock_guard lock(mutex);
    if (!caught) caught = std::current_exception();
    stop = true;
  };
  const auto run = [&](bool reports) {
    try {
      for (int part = next++; part < count && !stop && !progress.cancel().cancelled(); part = next++) {
        work(part);
        if (reports) progress.report(static_cast<double>(part) / count, what);
      }
    } catch (...) {
      keep();
    }
  };
  std::vector<std::thread> helpers;
  const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  for (int n = 1; n < std::min(cores, count); ++n) {
    try {
      helpers.emplace_back(run, false);
    } catch (const std::system_error&) {
      break;  // no more threads to be had: those that there are do it
    }
  }
  run(true);
  for (auto& helper : helpers) helper.join();
  if (caught) std::rethrow_exception(caught);
  progress.report(1.0, what);
}

void for_each_row(const core::ImageGeometry& geometry, const core::Progress& progress,
                  const std::string& what, const std::function<void(int j, int k)>& work) {
  constexpr int rows_of_a_part = 8;
  const int rows = geometry.dims()[1] * geometry.dims()[2];
  for_each_part((rows + rows_of_a_part - 1) / rows_of_a_part, progress, what, [&](int part) {
    const int end = std::min(rows, (part + 1) * rows_of_a_part);
    for (int row = part * rows_of_a_part; row < end; ++row)
      work(row % geometry.dims()[1], row / geometry.dims()[1]);
  });
}

}  // namespace palpate::imaging
