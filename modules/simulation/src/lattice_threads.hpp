#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <future>
#include <thread>
#include <vector>

namespace palpate::simulation {

/// Calls work(begin, end) for chunks that cover [0, count), on all cores; the
/// caller is one of them. The first exception is thrown here.
template <typename Work>
void in_parallel(std::size_t count, std::size_t chunk, const Work& work) {
  std::atomic<std::size_t> next{0};
  const auto take_all = [&] {
    for (std::size_t begin = next.fetch_add(chunk); begin < count; begin = next.fetch_add(chunk))
      work(begin, std::min(count, begin + chunk));
  };
  const std::size_t chunks = (count + chunk - 1) / chunk;
  const std::size_t cores = std::max(1U, std::thread::hardware_concurrency());
  std::vector<std::future<void>> team;
  for (std::size_t n = 1; n < std::min(cores, chunks); ++n)
    team.push_back(std::async(std::launch::async, take_all));
  take_all();
  for (auto& member : team) member.get();
}

}  // namespace palpate::simulation
