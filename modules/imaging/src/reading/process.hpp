#pragma once

#include "palpate/core/error.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/imaging/reader.hpp"

#include <nlohmann/json.hpp>

#include <cstddef>
#include <filesystem>
#include <functional>
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

enum class ReaderTask {
  read,     ///< one volume: its voxels, shared
  scan,     ///< a glance at each DICOM header
  describe  ///< what would be opened, entry by entry, without its pixels
};

/// What a child is asked for.
struct ReaderRequest {
  ReaderTask task = ReaderTask::read;
  std::vector<std::filesystem::path> paths;
  std::filesystem::path shown;  ///< what errors name
  ReadOptions options;
  std::vector<std::size_t> entries;  ///< describe: how many of the paths belong to each entry, in order
  bool thumbnails = false;           ///< describe: one picture of each, too
};

struct ReaderReply {
  nlohmann::json result;
  Descriptor voxels;
};

/// Is given what a child says of one entry before it has done with all.
using TakeItem = std::function<void(const nlohmann::json& item)>;

/// Runs palpate-reader on the request and waits for it. Whatever becomes of
/// the child, it is gone when this returns. Throws as imaging::read says.
ReaderReply run_reader(const ReaderRequest& request, const core::Progress& progress,
                       const ReaderLimits& limits, const TakeItem& take_item = {});

/// The error that a child sent about what `shown` names. Throws nlohmann's
/// exceptions where it is none.
core::Error error_of(const nlohmann::json& error, const std::filesystem::path& shown);

}  // namespace palpate::imaging::reading
