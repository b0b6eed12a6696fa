#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/imaging/reader.hpp"

#include <nlohmann/json.hpp>

#include <filesystem>
#include <utility>
#include <vector>

namespace palpate::imaging::reading {

/// Where the child finds what its parent handed over.
constexpr int request_fd = 3;  ///< a line of JSON, then paths, each ended by a zero byte
constexpr int message_fd = 4;  ///< a line of JSON a message
constexpr int voxels_fd = 5;   ///< shared memory, empty until the child sizes it

/// A file descriptor that is closed once.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int number) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() { reset(); }
  int number() const noexcept { return number_; }
  void reset();

 private:
  int number_ = -1;
};

enum class ReaderTask { read, scan };

struct ReaderReply {
  nlohmann::json result;
  Descriptor voxels;
};

/// Runs palpate-reader on the paths and waits for it; `shown` is the path that
/// errors name. Whatever becomes of the child, it is gone when this returns.
/// Throws as imaging::read says.
ReaderReply run_reader(ReaderTask task, const std::vector<std::filesystem::path>& paths,
                       const std::filesystem::path& shown, const ReadOptions& options,
                       const core::Progress& progress, const ReaderLimits& limits);

}  // namespace palpate::imaging::reading
