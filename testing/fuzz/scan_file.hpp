#pragma once

#include "reading/parsed.hpp"

#include "palpate/core/error.hpp"

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <string>
#include <unistd.h>

namespace palpate::fuzzing {

/// A folder with files that headers can name: d.raw, s0 and s1.
inline const std::filesystem::path& folder() {
  static const std::filesystem::path place = [] {
    const auto path = std::filesystem::temp_directory_path() / ("palpate-fuzz-" + std::to_string(getpid()));
    std::filesystem::create_directories(path);
    for (const char* name : {"d.raw", "s0", "s1"})
      std::ofstream(path / name, std::ios::binary) << std::string(64, 'v');
    static const std::filesystem::path made = path;
    std::atexit([] {
      std::error_code error;
      std::filesystem::remove_all(made, error);
    });
    return path;
  }();
  return place;
}

using Parser = imaging::reading::Parsed (*)(const std::filesystem::path&, const imaging::reading::Context&);

/// Parses the bytes behind the first as a file; the first chooses the options.
/// A refusal is an answer; so is a volume, if its numbers are usable.
inline int parse(const std::uint8_t* data, std::size_t size, const char* name, Parser parser) {
  if (size == 0) return 0;
  const std::filesystem::path path = folder() / name;
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(data + 1), static_cast<std::streamsize>(size - 1));
  imaging::ReadOptions options;
  options.allow_truncated = (data[0] & 1) != 0;
  if ((data[0] & 2) != 0) options.frame = data[0] >> 5;
  if ((data[0] & 4) != 0) options.orientation = "RAS";
  const core::Progress progress;
  const auto on_heap = [](std::size_t count) {
    return std::shared_ptr<float>(new float[count], std::default_delete<float[]>());
  };
  constexpr std::size_t memory_bytes = std::size_t{4} << 20;
  imaging::reading::Context context{options, progress, on_heap, memory_bytes};
  context.headers_only = (data[0] & 8) != 0;
  try {
    const auto parsed = parser(path, context);
    const std::size_t count =
        parsed.info.geometry.voxel_count() * static_cast<std::size_t>(parsed.kept_frames);
    if (!parsed.info.geometry.ijk_to_lps_mm().allFinite()) std::abort();
    if (!context.headers_only)
      for (std::size_t n = 0; n < count; ++n)
        if (!std::isfinite(parsed.voxels.get()[n])) std::abort();
    if (!parsed.info.frame_times_s.empty() &&
        parsed.info.frame_times_s.size() != static_cast<std::size_t>(parsed.info.frames))
      std::abort();
  } catch (const core::Error& error) {
    if (error.kind() == core::ErrorKind::internal) std::abort();
  }
  return 0;
}

}  // namespace palpate::fuzzing
