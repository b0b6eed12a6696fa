#include "raw_image.hpp"

#include "settle.hpp"
#include "text_header.hpp"

#include <algorithm>
#include <cmath>
#include <system_error>

namespace palpate::imaging::reading {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t chunk_bytes = std::size_t{1} << 20;
constexpr bool this_machine_is_big_endian = __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__;

/// What the files hold, against what the header speaks of.
struct Shortage {
  double there = 0.0, needed = 0.0;
  bool damaged = false;
};

[[noreturn]] void fail_truncated(const fs::path& path, const Shortage& shortage) {
  if (shortage.damaged && shortage.there >= shortage.needed)
    fail("truncated", path, "holds packed voxels that are damaged. Copy or export it again.");
  fail("truncated", path,
       "holds " + whole_text(shortage.there) + " bytes of voxels where its header speaks of " +
           whole_text(shortage.needed) + ". It was cut off or damaged: copy or export it again.");
}

void warn_truncated(core::VolumeInfo& info, const Shortage& shortage) {
  warn(info, "truncated",
       "The file was cut off or damaged: " + whole_text(std::max(0.0, shortage.needed - shortage.there)) +
           " of " + whole_text(shortage.needed) + " bytes of voxels are missing and black.");
}

/// Sizes and strides by role, in numbers.
struct Shape {
  std::array<int, 3> dims{1, 1, 1};
  std::size_t frames = 1, components = 1;
  Strides strides;
  std::size_t frame_stride = 0;
  std::size_t frame_numbers = 1;  ///< in one frame
  bool frames_apart = true;       ///< a frame lies in one piece
  bool in_order = true;           ///< and its voxels one after the other
};

Shape shape_of(const RawImage& image) {
  Shape shape;
  std::size_t stride = 1;
  int last_role = -1;
  for (const FileAxis& axis : image.axes) {
    if (axis.size == 1) continue;
    const auto size = static_cast<std::size_t>(axis.size);
    const auto role = static_cast<int>(axis.role);
    // In order: components, then i, j, k.
    const int rank = axis.role == Role::component ? 0 : axis.role == Role::frame ? 9 : 1 + role;
    if (rank < last_role) {
      if (last_role == 9) shape.frames_apart = false;
      shape.in_order = false;
    }
    last_role = std::max(last_role, rank);
    if (axis.role == Role::component) {
      shape.components = size;
      shape.strides.component = stride;
    } else if (axis.role == Role::frame) {
      shape.frames = size;
      shape.frame_stride = stride;
    } else {
      shape.dims[static_cast<std::size_t>(role)] = static_cast<int>(axis.size);
      shape.strides.axis[static_cast<std::size_t>(role)] = stride;
    }
    if (axis.role != Role::frame) shape.frame_numbers *= size;
    stride *= size;
  }
  return shape;
}

/// The bytes of all files as one row; what is missing comes as zeros and is counted.
class AllBytes {
 public:
  AllBytes(const fs::path& path, const RawImage& image, std::uint64_t share)
      : path_(path), image_(image), share_(share) {}

  void read(char* to, std::uint64_t count) {
    take(
        count,
        [&](VoxelSource& source, std::uint64_t part) {
          const std::size_t got = source.read(to, static_cast<std::size_t>(part));
          to += got;
          return static_cast<std::uint64_t>(got);
        },
        [&](std::uint64_t lost) {
          std::fill_n(to, lost, '\0');
          to += lost;
        });
  }
  void skip(std::uint64_t count) {
    take(
        count, [](VoxelSource& source, std::uint64_t part) { return source.skip(part); },
        [](std::uint64_t) {});
  }
  /// One byte more than there should be, so that a packed stream's end is checked too.
  void look_behind() {
    char c = 0;
    if (source_ && left_ == 0) surplus_ = surplus_ || source_->read(&c, 1) == 1;
    if (source_) sound_ = sound_ && source_->sound();
  }
  double missing() const { return static_cast<double>(missing_); }
  bool sound() const { return sound_; }
  bool surplus() const { return surplus_; }

 private:
  template <typename Take, typename Lose>
  void take(std::uint64_t count, const Take& some, const Lose& lose) {
    while (count > 0) {
      if (left_ == 0 && !open_next()) {
        missing_ += count;
        return lose(count);
      }
      const std::uint64_t part = std::min(count, left_);
      const std::uint64_t got = some(*source_, part);
      left_ -= got;
      count -= got;
      if (got == part) continue;
      if (got > 0) continue;  // a source may give less at a time
      sound_ = sound_ && source_->sound();
      const std::uint64_t lost = std::min(count, left_);
      missing_ += lost;
      left_ -= lost;
      count -= lost;
      lose(lost);
    }
  }
  bool open_next() {
    if (next_ > 0) look_behind();
    if (next_ == image_.files.size()) return false;
    source_ = open_source(path_, image_.files[next_], image_.encoding, image_.type);
    if (image_.skipped_bytes > 0) source_->skip(image_.skipped_bytes);
    left_ = share_;
    ++next_;
    return true;
  }

  const fs::path& path_;
  const RawImage& image_;
  std::uint64_t share_, left_ = 0, missing_ = 0;
  std::size_t next_ = 0;
  std::unique_ptr<VoxelSource> source_;
  bool sound_ = true, surplus_ = false;
};

std::uint64_t bytes_behind(const VoxelFile& file) {
  std::error_code error;
  const std::uint64_t size = fs::file_size(file.path, error);
  const std::uint64_t behind = error || size < file.offset ? 0 : size - file.offset;
  return file.length == 0 ? behind : std::min(behind, file.length);
}

/// How many bytes can come out of that many in the file at most.
double most_that_unpacks(Encoding encoding, double bytes) {
  constexpr double deflate_at_best = 1032.0;
  switch (encoding) {
    case Encoding::deflate:
      return deflate_at_best * bytes;
    case Encoding::text:
      return sizeof(double) * (bytes + 1.0) / 2.0;
    case Encoding::hex:
      return bytes / 2.0;
    case Encoding::bzip2:  // 45 bytes can hold a block of 900,000, which its first stage has shrunk 51-fold
      return 1e6 * (bytes + 1.0);
    case Encoding::raw:
      break;
  }
  return bytes;
}

/// Before anything is opened or allocated.
void check_sizes(const fs::path& path, const RawImage& image, double share, double surplus_of_note,
                 const Context& context, core::VolumeInfo& info) {
  Shortage shortage;
  double most_behind = 0.0;
  shortage.needed = share * static_cast<double>(image.files.size());
  for (const VoxelFile& file : image.files) {
    const auto bytes = static_cast<double>(bytes_behind(file));
    const double there = most_that_unpacks(image.encoding, bytes) - static_cast<double>(image.skipped_bytes);
    shortage.there += std::clamp(there, 0.0, share);
    if (image.encoding == Encoding::raw) most_behind = std::max(most_behind, there - share);
    if (image.encoding == Encoding::raw && image.files_must_fit && there > share)
      fail("bad-header", path,
           "speaks of " + whole_text(share) + " bytes of voxels in each of its files, but " +
               file.path.filename().string() + " holds " + whole_text(there) +
               ". One of them belongs to another scan or the sizes are wrong.");
  }
  if (shortage.there < shortage.needed) {
    if (!context.options.allow_truncated || image.encoding != Encoding::raw) {
      if (!context.options.allow_truncated) fail_truncated(path, shortage);
    } else {
      warn_truncated(info, shortage);
    }
  }
  if (most_behind >= surplus_of_note)
    warn(info, "extra-data",
         whole_text(most_behind) + " bytes behind the voxels were not read; the header speaks of fewer.");
}

class Reading {
 public:
  Reading(const fs::path& path, const RawImage& image, const Shape& shape, VoxelType type,
          std::uint64_t share, const Context& context)
      : image_(image), shape_(shape), type_(type), context_(context), bytes_(path, image, share) {}

  void frames(int first, int kept, float* grey) {
    const std::size_t number_bytes = bytes_of(type_);
    const std::size_t frame_voxels = voxels();
    total_ = static_cast<double>(frame_voxels) * kept;
    if (!shape_.frames_apart) {
      std::vector<char> all(shape_.frame_numbers * shape_.frames * number_bytes);
      take(all);
      for (int n = 0; n < kept; ++n)
        strided(all.data() + static_cast<std::size_t>(first + n) * shape_.frame_stride * number_bytes,
                grey + static_cast<std::size_t>(n) * frame_voxels);
      return;
    }
    bytes_.skip(static_cast<std::uint64_t>(first) * shape_.frame_numbers * number_bytes);
    if (shape_.in_order) return in_order(frame_voxels * static_cast<std::size_t>(kept), grey);
    std::vector<char> one(shape_.frame_numbers * number_bytes);
    for (int n = 0; n < kept; ++n) {
      take(one);
      strided(one.data(), grey + static_cast<std::size_t>(n) * frame_voxels);
    }
  }
  /// What lies behind the frames that were asked for, where that should be known.
  void the_rest(std::uint64_t bytes) {
    bytes_.skip(bytes);
    bytes_.look_behind();
  }
  void look_behind() { bytes_.look_behind(); }
  const AllBytes& bytes() const { return bytes_; }

 private:
  std::size_t voxels() const { return shape_.frame_numbers / shape_.components; }
  void take(std::vector<char>& bytes) {
    std::size_t done = 0;
    while (done < bytes.size()) {
      const std::size_t part = std::min(bytes.size() - done, 16 * chunk_bytes);
      bytes_.read(bytes.data() + done, part);
      done += part;
    }
    swap_if_needed(bytes.data(), bytes.size() / bytes_of(type_));
  }
  void in_order(std::size_t count, float* grey) {
    const std::size_t voxel_bytes = shape_.components * bytes_of(type_);
    const std::size_t at_once = std::max<std::size_t>(1, chunk_bytes / voxel_bytes);
    std::vector<char> chunk(std::min(count, at_once) * voxel_bytes);
    for (std::size_t done = 0; done < count;) {
      const std::size_t part = std::min(at_once, count - done);
      bytes_.read(chunk.data(), part * voxel_bytes);
      swap_if_needed(chunk.data(), part * shape_.components);
      to_grey(type_, image_.rule, chunk.data(), shape_.components, part, grey + done);
      done += part;
      if (done / at_once % 16 == 0) report(static_cast<double>(done));
    }
  }
  void strided(const char* raw, float* grey) {
    to_grey(type_, image_.rule, raw, shape_.strides, shape_.dims, grey);
    done_ += static_cast<double>(voxels());
    report(done_);
  }
  void swap_if_needed(char* raw, std::size_t count) const {
    if (image_.big_endian != this_machine_is_big_endian && image_.encoding != Encoding::text)
      swap_bytes(type_, raw, count);
  }
  void report(double voxels) const {
    context_.progress.report(0.1 + 0.8 * voxels / std::max(1.0, total_), "Reading voxels");
  }

  const RawImage& image_;
  const Shape& shape_;
  VoxelType type_;
  const Context& context_;
  AllBytes bytes_;
  double total_ = 0.0, done_ = 0.0;
};

void rescale(const RawImage& image, float* grey, std::size_t count) {
  if (image.rule != GreyRule::only || (image.slope == 1.0 && image.intercept == 0.0)) return;
  constexpr double largest = 3.4e38;
  for (std::size_t n = 0; n < count; ++n)
    if (std::isfinite(grey[n]))
      grey[n] = static_cast<float>(
          std::clamp(image.slope * static_cast<double>(grey[n]) + image.intercept, -largest, largest));
}

}  // namespace

std::array<int, 3> dims_of(const RawImage& image) { return shape_of(image).dims; }

int frames_of(const fs::path& path, const RawImage& image) {
  constexpr std::size_t most_frames = 1000000;
  const std::size_t frames = shape_of(image).frames;
  if (frames > most_frames)
    fail("too-large", path, "holds " + std::to_string(frames) + " frames, more than can be shown.");
  return static_cast<int>(frames);
}

double bytes_of_voxels(const RawImage& image) {
  double bytes = static_cast<double>(bytes_of(image.type));
  for (const FileAxis& axis : image.axes) bytes *= static_cast<double>(axis.size);
  return bytes;
}

Parsed read_raw(const fs::path& path, const RawImage& image, core::VolumeInfo info, const Context& context) {
  const VoxelType type = image.encoding == Encoding::text ? VoxelType::float64 : image.type;
  double numbers = 1.0;
  for (const FileAxis& axis : image.axes) numbers *= static_cast<double>(axis.size);
  const double share =
      numbers * static_cast<double>(bytes_of(type)) / static_cast<double>(image.files.size());
  double frame_bytes = static_cast<double>(bytes_of(type));
  for (const FileAxis& axis : image.axes)
    if (axis.role != Role::frame) frame_bytes *= static_cast<double>(axis.size);
  // What a text says takes other bytes than numbers do; everything else adds up or does not.
  check_sizes(path, image, share, frame_bytes, context, info);

  double voxels = 1.0;
  double frames = 1.0;
  for (const FileAxis& axis : image.axes) {
    if (axis.role == Role::frame) frames *= static_cast<double>(axis.size);
    if (axis.role == Role::i || axis.role == Role::j || axis.role == Role::k)
      voxels *= static_cast<double>(axis.size);
  }
  const auto [first, kept] = frames_to_keep(context.options, frames_of(path, image));
  info.pixel_type = name_of(image.type);
  if (image.rule == GreyRule::luma) warn_of_colour(info);
  Parsed parsed;
  parsed.first_frame = first;
  parsed.kept_frames = kept;
  for (const FileAxis& axis : image.axes)
    if (axis.role == Role::component) info.components = static_cast<int>(axis.size);
  if (context.headers_only) {
    settle_geometry(context.options, info);
    parsed.info = std::move(info);
    return parsed;
  }
  check_memory(path, chunk_bytes, voxels * kept, context);
  const Shape shape = shape_of(image);
  const double kept_raw = !shape.frames_apart ? frame_bytes * frames : shape.in_order ? 0.0 : frame_bytes;
  check_memory(path, kept_raw, voxels * kept, context);

  context.progress.report(0.1, "Reading voxels");
  const std::size_t count = (shape.frame_numbers / shape.components) * static_cast<std::size_t>(kept);
  parsed.voxels = context.allocate(count);
  Reading reading(path, image, shape, type, static_cast<std::uint64_t>(share), context);
  reading.frames(first, kept, parsed.voxels.get());
  // Whoever reads from the first frame on learns whether the last is there too;
  // a later one is not made to wait for that.
  const bool to_the_end = first + kept == static_cast<int>(frames);
  if (image.encoding != Encoding::raw && shape.frames_apart && !to_the_end && first == 0)
    reading.the_rest(static_cast<std::uint64_t>((frames - kept) * frame_bytes));
  else if (image.encoding != Encoding::raw && (to_the_end || !shape.frames_apart))
    reading.look_behind();

  const AllBytes& bytes = reading.bytes();
  if (image.encoding != Encoding::raw && (bytes.missing() > 0.0 || !bytes.sound())) {
    const double needed = numbers * static_cast<double>(bytes_of(type));
    const Shortage shortage{needed - bytes.missing(), needed, !bytes.sound()};
    if (!context.options.allow_truncated) fail_truncated(path, shortage);
    warn_truncated(info, shortage);
  }
  if (bytes.surplus())
    warn(info, "extra-data",
         "More voxels are packed in the file than its header speaks of; they were not read.");
  context.progress.report(0.95, "Checking voxels");
  rescale(image, parsed.voxels.get(), count);
  make_finite(path, parsed.voxels.get(), count, info);
  settle_geometry(context.options, info);
  parsed.info = std::move(info);
  return parsed;
}

}  // namespace palpate::imaging::reading
