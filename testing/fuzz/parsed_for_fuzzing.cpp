// What the parsers call of parsed.cpp, which would bring DICOM with it.
#include "reading/parsed.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>

namespace palpate::imaging::reading {

void fail(const std::string& code, const std::filesystem::path& path, const std::string& text,
          const std::string& details) {
  throw core::Error(core::ErrorKind::input, code, path.string() + " " + text, details);
}

std::pair<int, int> frames_to_keep(const ReadOptions& options, int frames) {
  if (!options.frame) return {0, frames};
  if (*options.frame < 0 || *options.frame >= frames) core::throw_usage("no such frame");
  return {*options.frame, std::clamp(options.frame_count, 1, frames - *options.frame)};
}

void check_memory(const std::filesystem::path& path, double raw_bytes, double voxels,
                  const Context& context) {
  if (raw_bytes + voxels * sizeof(float) > static_cast<double>(context.memory_bytes))
    fail("too-large", path, "would take too much memory.");
}

void warn(core::VolumeInfo& info, const std::string& code, const std::string& text) {
  info.warnings.push_back({code, text});
}

}  // namespace palpate::imaging::reading
