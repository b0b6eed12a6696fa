#pragma once

#include "reader_files.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <zlib.h>

namespace palpate::testing {

/// The code of the error that reading ends with, or "none".
inline std::string error_code(const std::filesystem::path& path, const imaging::ReadOptions& options = {}) {
  try {
    imaging::read(path, options);
  } catch (const core::Error& error) {
    EXPECT_NE(std::string(error.what()).find(path.filename().string()), std::string::npos) << error.what();
    return error.code();
  }
  return "none";
}

/// What the error says.
inline std::string error_text(const std::filesystem::path& path, const imaging::ReadOptions& options = {}) {
  try {
    imaging::read(path, options);
  } catch (const core::Error& error) {
    return error.what();
  }
  return {};
}

/// The text of a warning, or none.
inline std::string warning_text(const core::VolumeInfo& info, const std::string& code) {
  for (const auto& warning : info.warnings)
    if (warning.code == code) return warning.text;
  return {};
}
inline bool warned(const core::VolumeSequence& sequence, const std::string& code) {
  return !warning_text(sequence.info, code).empty();
}

/// The voxels of one frame, for comparisons.
inline std::vector<float> voxels_of(const core::VolumeSequence& sequence, std::size_t frame = 0) {
  const core::Volume& volume = sequence.frames.at(frame);
  return {volume.data(), volume.data() + volume.size()};
}

/// 0, 1, 2, ... as bytes.
inline std::string counted_bytes(std::size_t count, int first = 0) {
  std::string bytes;
  for (std::size_t n = 0; n < count; ++n) bytes.push_back(static_cast<char>(first + static_cast<int>(n)));
  return bytes;
}
inline std::vector<float> counted(std::size_t count, float first = 0.0F) {
  std::vector<float> values;
  for (std::size_t n = 0; n < count; ++n) values.push_back(first + static_cast<float>(n));
  return values;
}

/// As a zlib stream, or a gzip member.
inline std::string packed(const std::string& bytes, bool gzip) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, gzip ? 31 : 15, 8, Z_DEFAULT_STRATEGY),
            Z_OK);
  std::string out(bytes.size() + 1000, '\0');
  std::string in = bytes;
  stream.next_in = reinterpret_cast<Bytef*>(in.data());
  stream.avail_in = static_cast<uInt>(in.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

/// The numbers with their bytes turned around.
template <typename T>
std::string big_endian_bytes(const std::vector<T>& values) {
  std::string bytes = bytes_of(values);
  for (std::size_t n = 0; n < bytes.size(); n += sizeof(T))
    std::reverse(bytes.begin() + static_cast<std::ptrdiff_t>(n),
                 bytes.begin() + static_cast<std::ptrdiff_t>(n + sizeof(T)));
  return bytes;
}

}  // namespace palpate::testing
