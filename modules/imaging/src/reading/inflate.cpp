#include "inflate.hpp"

#include <algorithm>
#include <fstream>
#include <vector>
#include <zlib.h>

namespace palpate::imaging::reading {

Inflated inflate_and_count(const std::filesystem::path& path, std::uint64_t offset, std::uint64_t length,
                           std::uint64_t enough, std::size_t keep) {
  Inflated result;
  std::ifstream file(path, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(offset));
  std::uint64_t left = length == 0 ? UINT64_MAX : length;
  std::vector<unsigned char> in(1 << 18);
  std::vector<unsigned char> out(1 << 18);
  z_stream stream{};
  constexpr int zlib_or_gzip = 15 + 32;
  if (inflateInit2(&stream, zlib_or_gzip) != Z_OK) return result;
  int status = Z_OK;
  while (status != Z_STREAM_END && result.bytes <= enough) {
    if (stream.avail_in == 0) {
      file.read(reinterpret_cast<char*>(in.data()),
                static_cast<std::streamsize>(std::min<std::uint64_t>(in.size(), left)));
      stream.avail_in = static_cast<uInt>(file.gcount());
      stream.next_in = in.data();
      left -= static_cast<std::uint64_t>(file.gcount());
      if (stream.avail_in == 0) break;
    }
    stream.next_out = out.data();
    stream.avail_out = static_cast<uInt>(out.size());
    status = inflate(&stream, Z_NO_FLUSH);
    if (status != Z_OK && status != Z_STREAM_END) break;
    const std::size_t made = out.size() - stream.avail_out;
    if (result.start.size() < keep)
      result.start.append(reinterpret_cast<const char*>(out.data()),
                          std::min(made, keep - result.start.size()));
    result.bytes += made;
    // A gzip file may consist of several members, one behind the other.
    if (status == Z_STREAM_END && stream.avail_in > 0 && *stream.next_in == 0x1F &&
        inflateReset(&stream) == Z_OK)
      status = Z_OK;
  }
  result.whole = status == Z_STREAM_END;
  inflateEnd(&stream);
  return result;
}

}  // namespace palpate::imaging::reading
