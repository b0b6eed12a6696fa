#include "voxel_source.hpp"

#include "parsed.hpp"
#include "text_header.hpp"

#include <algorithm>
#include <array>
#include <bzlib.h>
#include <cctype>
#include <cstring>
#include <fstream>
#include <zlib.h>

namespace palpate::imaging::reading {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t block_bytes = std::size_t{1} << 18;

/// The bytes between two places of a file, as they are.
class PlainBytes : public VoxelSource {
 public:
  PlainBytes(const fs::path& header, const VoxelFile& file) : stream_(file.path, std::ios::binary) {
    if (!stream_)
      fail("not-found", header,
           "needs " + file.path.filename().string() + ", which cannot be opened. Check that it may be read.");
    std::error_code error;
    const std::uint64_t size = fs::file_size(file.path, error);
    left_ = error || size < file.offset ? 0 : size - file.offset;
    if (file.length != 0) left_ = std::min(left_, file.length);
    stream_.seekg(static_cast<std::streamoff>(file.offset));
  }
  std::size_t read(char* to, std::size_t count) override {
    stream_.read(to, static_cast<std::streamsize>(std::min<std::uint64_t>(count, left_)));
    const auto got = static_cast<std::size_t>(stream_.gcount());
    left_ -= got;
    return got;
  }
  std::uint64_t skip(std::uint64_t count) override {
    const std::uint64_t passed = std::min(count, left_);
    stream_.seekg(static_cast<std::streamoff>(passed), std::ios::cur);
    left_ -= passed;
    return passed;
  }

 private:
  std::ifstream stream_;
  std::uint64_t left_ = 0;
};

/// zlib or gzip; members of gzip that follow one another belong together.
class Inflating : public VoxelSource {
 public:
  Inflating(const fs::path& header, const VoxelFile& file) : packed_(header, file), in_(block_bytes) {
    constexpr int zlib_or_gzip = 15 + 32;
    usable_ = inflateInit2(&stream_, zlib_or_gzip) == Z_OK;
    initialised_ = usable_;
  }
  ~Inflating() override {
    if (initialised_) inflateEnd(&stream_);
  }
  Inflating(const Inflating&) = delete;
  Inflating& operator=(const Inflating&) = delete;
  bool sound() const override { return sound_; }
  std::size_t read(char* to, std::size_t count) override {
    std::size_t made = 0;
    while (usable_ && made < count) {
      if (!fill()) {
        // Cut off in the middle of a stream, or properly at its end.
        sound_ = sound_ && ended_;
        usable_ = false;
        break;
      }
      if (ended_ && !begin_next_member()) break;
      stream_.next_out = reinterpret_cast<Bytef*>(to + made);
      stream_.avail_out = static_cast<uInt>(std::min<std::size_t>(count - made, block_bytes));
      const uInt room = stream_.avail_out;
      const int status = inflate(&stream_, Z_NO_FLUSH);
      made += room - stream_.avail_out;
      ended_ = status == Z_STREAM_END;
      if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR) {
        sound_ = false;
        usable_ = false;
      }
    }
    return made;
  }

 private:
  bool fill() {
    if (stream_.avail_in > 0) return true;
    stream_.avail_in = static_cast<uInt>(packed_.read(in_.data(), in_.size()));
    stream_.next_in = reinterpret_cast<Bytef*>(in_.data());
    return stream_.avail_in > 0;
  }
  /// What follows the end of a stream is another member only where it begins like one.
  bool begin_next_member() {
    if (*stream_.next_in == 0x1F && inflateReset(&stream_) == Z_OK) {
      ended_ = false;
      return true;
    }
    usable_ = false;
    return false;
  }

  PlainBytes packed_;
  std::vector<char> in_;
  z_stream stream_{};
  bool initialised_ = false, usable_ = false, ended_ = false, sound_ = true;
};

class Unzipping2 : public VoxelSource {
 public:
  Unzipping2(const fs::path& header, const VoxelFile& file) : packed_(header, file), in_(block_bytes) {
    begin();
  }
  ~Unzipping2() override { end(); }
  Unzipping2(const Unzipping2&) = delete;
  Unzipping2& operator=(const Unzipping2&) = delete;
  bool sound() const override { return sound_; }
  std::size_t read(char* to, std::size_t count) override {
    std::size_t made = 0;
    while (usable_ && made < count) {
      if (stream_.avail_in == 0) {
        stream_.avail_in = static_cast<unsigned>(packed_.read(in_.data(), in_.size()));
        stream_.next_in = in_.data();
        if (stream_.avail_in == 0) {
          sound_ = sound_ && ended_;
          usable_ = false;
          break;
        }
      }
      if (ended_) {  // another stream may follow
        const unsigned left = stream_.avail_in;
        char* const next = stream_.next_in;
        end();
        begin();
        stream_.avail_in = left;
        stream_.next_in = next;
      }
      stream_.next_out = to + made;
      stream_.avail_out = static_cast<unsigned>(std::min<std::size_t>(count - made, block_bytes));
      const unsigned room = stream_.avail_out;
      const int status = BZ2_bzDecompress(&stream_);
      made += room - stream_.avail_out;
      ended_ = status == BZ_STREAM_END;
      if (status != BZ_OK && status != BZ_STREAM_END) {
        sound_ = false;
        usable_ = false;
      }
    }
    return made;
  }

 private:
  void begin() {
    stream_ = bz_stream{};
    ended_ = false;
    initialised_ = usable_ = BZ2_bzDecompressInit(&stream_, 0, 0) == BZ_OK;
  }
  void end() {
    if (initialised_) BZ2_bzDecompressEnd(&stream_);
    initialised_ = false;
  }

  PlainBytes packed_;
  std::vector<char> in_;
  bz_stream stream_{};
  bool initialised_ = false, usable_ = false, ended_ = false, sound_ = true;
};

/// Characters of a text, a block at a time.
class Characters {
 public:
  Characters(const fs::path& header, const VoxelFile& file) : bytes_(header, file), block_(block_bytes) {}
  /// The next, or -1 at the end.
  int next() {
    if (at_ == size_) {
      size_ = bytes_.read(block_.data(), block_.size());
      at_ = 0;
      if (size_ == 0) return -1;
    }
    return static_cast<unsigned char>(block_[at_++]);
  }

 private:
  PlainBytes bytes_;
  std::vector<char> block_;
  std::size_t at_ = 0, size_ = 0;
};

/// Numbers as text, with blanks or commas between them.
class Numbers : public VoxelSource {
 public:
  Numbers(fs::path header, const VoxelFile& file, VoxelType type)
      : header_(std::move(header)), type_(type), characters_(header_, file) {}
  std::size_t read(char* to, std::size_t count) override {
    std::size_t made = 0;
    for (; made + sizeof(double) <= count && take_word(); made += sizeof(double)) {
      const auto value = number(word_);
      if (!value || !holds(type_, *value))
        fail("bad-header", header_,
             "holds \"" + word_.substr(0, 20) + "\" among its voxels, which is no number of type " +
                 name_of(type_) + ".");
      std::memcpy(to + made, &*value, sizeof(double));
    }
    return made;
  }

 private:
  bool take_word() {
    constexpr std::size_t longest_number = 400;
    const auto between = [](int c) { return c == ',' || std::isspace(c) != 0; };
    int c = characters_.next();
    while (c >= 0 && between(c)) c = characters_.next();
    word_.clear();
    for (; c >= 0 && !between(c); c = characters_.next())
      if (word_.size() < longest_number) word_.push_back(static_cast<char>(c));
    return !word_.empty();
  }

  fs::path header_;
  VoxelType type_;
  Characters characters_;
  std::string word_;
};

/// Two hexadecimal digits a byte, with blanks anywhere.
class HexDigits : public VoxelSource {
 public:
  HexDigits(fs::path header, const VoxelFile& file)
      : header_(std::move(header)), characters_(header_, file) {}
  std::size_t read(char* to, std::size_t count) override {
    for (std::size_t made = 0; made < count; ++made) {
      const int high = digit();
      const int low = high < 0 ? -1 : digit();
      if (low < 0) return made;
      to[made] = static_cast<char>(16 * high + low);
    }
    return count;
  }

 private:
  int digit() {
    int c = characters_.next();
    while (c >= 0 && std::isspace(c) != 0) c = characters_.next();
    if (c < 0) return -1;
    if (std::isxdigit(c) == 0)
      fail("bad-header", header_, "holds something else than hexadecimal digits where its voxels should be.");
    return std::isdigit(c) != 0 ? c - '0' : std::tolower(c) - 'a' + 10;
  }

  fs::path header_;
  Characters characters_;
};

}  // namespace

std::uint64_t VoxelSource::skip(std::uint64_t count) {
  std::vector<char> block(block_bytes);
  std::uint64_t passed = 0;
  while (passed < count) {
    const std::size_t got =
        read(block.data(), static_cast<std::size_t>(std::min<std::uint64_t>(block.size(), count - passed)));
    if (got == 0) break;
    passed += got;
  }
  return passed;
}

std::unique_ptr<VoxelSource> open_source(const fs::path& header, const VoxelFile& file, Encoding encoding,
                                         VoxelType type) {
  switch (encoding) {
    case Encoding::deflate:
      return std::make_unique<Inflating>(header, file);
    case Encoding::bzip2:
      return std::make_unique<Unzipping2>(header, file);
    case Encoding::text:
      return std::make_unique<Numbers>(header, file, type);
    case Encoding::hex:
      return std::make_unique<HexDigits>(header, file);
    case Encoding::raw:
      break;
  }
  return std::make_unique<PlainBytes>(header, file);
}

}  // namespace palpate::imaging::reading
