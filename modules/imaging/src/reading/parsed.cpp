#include "parsed.hpp"

#include "text_header.hpp"
#include "vendor/kretz.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <fstream>

namespace palpate::imaging::reading {
namespace {

std::string lower(std::string word) {
  std::transform(word.begin(), word.end(), word.begin(), [](unsigned char c) { return std::tolower(c); });
  return word;
}

bool ends_with(const std::string& word, const std::string& end) {
  return word.size() >= end.size() && word.compare(word.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

Format format_of(const std::filesystem::path& path) {
  const std::string name = lower(path.filename().string());
  for (const char* end : {".mha", ".mhd"})
    if (ends_with(name, end)) return Format::meta_image;
  for (const char* end : {".nrrd", ".nhdr"})
    if (ends_with(name, end)) return Format::nrrd;
  for (const char* end : {".nii", ".nii.gz", ".hdr", ".img", ".img.gz"})
    if (ends_with(name, end)) return Format::nifti;
  for (const char* end : {".dcm", ".dicom", ".ima"})
    if (ends_with(name, end)) return Format::dicom;
  return may_be_dicom(path) ? Format::dicom : Format::other;
}

bool may_be_dicom(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<char, 132> start{};
  file.read(start.data(), start.size());
  const auto count = static_cast<std::size_t>(file.gcount());
  if (count >= 132 && std::memcmp(start.data() + 128, "DICM", 4) == 0) return true;
  if (count < 8) return false;
  // Without a preamble a file begins with a low tag of group 0002 or 0008, in either byte order.
  const auto byte = [&](std::size_t n) { return static_cast<unsigned char>(start[n]); };
  const bool little = (byte(0) == 2 || byte(0) == 8) && byte(1) == 0 && byte(3) == 0;
  const bool big = byte(0) == 0 && (byte(1) == 2 || byte(1) == 8) && byte(2) == 0;
  return little || big;
}

Parsed parse_file(const std::filesystem::path& path, const Context& context) {
  switch (format_of(path)) {
    case Format::meta_image:
      return parse_meta_image(path, context);
    case Format::nrrd:
      return parse_nrrd(path, context);
    case Format::nifti:
      return parse_nifti(path, context);
    case Format::dicom:
      return parse_dicom({path}, context);
    case Format::other:
      if (is_kretz_file(path)) return parse_kretz_file(path, context);
      break;
  }
  const std::string ending = lower(path.extension().string());
  if (ending == ".raw" || ending == ".zraw")
    fail("unsupported", path,
         "holds voxels without a header. Open the .mhd or .nhdr file that belongs to it.");
  for (const char* mesh : {".stl", ".ply", ".obj", ".off", ".vtp", ".vtk"})
    if (ending == mesh) fail("unsupported", path, "is a surface, not a scan. Give it as the mesh of a scan.");
  fail("unsupported", path,
       "is no scan that can be read. Export the scan as MetaImage (.mha, .mhd), NRRD, NIfTI or DICOM.");
}

void fail(const std::string& code, const std::filesystem::path& path, const std::string& text,
          const std::string& details) {
  throw core::Error(core::ErrorKind::input, code, path.string() + " " + text, details);
}

std::pair<int, int> frames_to_keep(const ReadOptions& options, int frames) {
  if (!options.frame) return {0, frames};
  if (*options.frame < 0 || *options.frame >= frames)
    core::throw_usage("There is no frame " + std::to_string(*options.frame) + "; the scan has " +
                      std::to_string(frames) + ", counted from 0.");
  return {*options.frame, std::clamp(options.frame_count, 1, frames - *options.frame)};
}

void check_memory(const std::filesystem::path& path, double raw_bytes, double voxels,
                  const Context& context) {
  // What the libraries themselves take is set aside.
  constexpr double own_bytes = 64.0 * 1024 * 1024;
  const double needed = raw_bytes + voxels * sizeof(float) + own_bytes;
  if (needed <= static_cast<double>(context.memory_bytes)) return;
  const auto mega = [](double bytes) { return whole_text(bytes / (1024 * 1024)) + " MB"; };
  fail("too-large", path,
       "would take " + mega(needed) + " of memory to read, over the limit of " +
           mega(static_cast<double>(context.memory_bytes)) +
           ". Read a single frame, or export a smaller part of the scan.");
}

void warn(core::VolumeInfo& info, const std::string& code, const std::string& text) {
  info.warnings.push_back({code, text});
}

}  // namespace palpate::imaging::reading
