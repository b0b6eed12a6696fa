#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace palpate::imaging::reading {

/// How the bytes of a frame are coded.
enum class FrameCoding { native, rle, jpeg, jpeg_ls, jpeg_2000, unsupported };
/// `name` is for people: "JPEG baseline", "High-Throughput JPEG 2000".
struct SyntaxForm {
  FrameCoding coding = FrameCoding::native;
  std::string name;
};
SyntaxForm syntax_form(const std::string& transfer_syntax);
/// By the first bytes of a stream; native where they tell nothing.
FrameCoding coding_of_stream(const std::vector<std::uint8_t>& start);

/// What the components of a stream are by what it says itself.
enum class StreamColour { not_said, rgb, ybr };

/// Samples of one frame, little-endian, in 1, 2 or 4 bytes each.
struct CodedFrame {
  int columns = 0, rows = 0, samples = 1;
  int sample_bytes = 1;
  bool planar = false;
  bool packed_bits = false;  ///< eight pixels a byte, the lowest bit first
  StreamColour colour = StreamColour::not_said;
  std::string colour_reason;  ///< why `colour`: "a JFIF marker"
  bool damaged = false;       ///< part of it could not be decoded and is 0
  std::vector<std::uint8_t> bytes;
};

/// What the header says of a frame, for streams that do not.
struct FrameShape {
  int columns = 0, rows = 0, samples = 1;
  int bits_allocated = 8, bits_stored = 8;
  bool is_signed = false;
};

enum class CodingOutcome { done, damaged, refused };

/// Decodes one frame. `frame` has the size that the stream says, at most
/// that of `shape`. `risk` is called before a decoder that may end the
/// process. `damaged`: the stream breaks off or makes no sense; what came out
/// of it is in `frame`. `refused`: nothing here takes it; `reason` says why.
CodingOutcome decode_frame(FrameCoding coding, const std::vector<std::uint8_t>& stream,
                           const FrameShape& shape, const std::function<void()>& risk, CodedFrame& frame,
                           std::string& reason);

/// What a JPEG or JPEG-LS stream says of itself before its first scan.
struct JpegStart {
  int process = -1;  ///< n of SOFn; 0xF7 - 0xC0 of JPEG-LS; -1 where none was found
  int precision = 0, rows = 0, columns = 0, components = 0;
  bool subsampled = false;
  StreamColour colour = StreamColour::not_said;
  std::string colour_reason;
};
JpegStart jpeg_start(const std::vector<std::uint8_t>& stream);

}  // namespace palpate::imaging::reading
