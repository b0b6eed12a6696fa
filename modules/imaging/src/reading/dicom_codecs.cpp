#include "dicom_codecs.hpp"

#include "dicom_codec_gdcm.hpp"

#include <algorithm>
#include <array>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdatset.h>
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmjpeg/djcparam.h>
#include <dcmtk/dcmjpeg/djdijg12.h>
#include <dcmtk/dcmjpeg/djdijg16.h>
#include <dcmtk/dcmjpeg/djdijg8.h>
#include <dcmtk/dcmjpls/djdecode.h>
#include <map>
#include <memory>

namespace palpate::imaging::reading {
namespace {

using Bytes = std::vector<std::uint8_t>;

int big_word(const Bytes& bytes, std::size_t at) { return bytes[at] << 8 | bytes[at + 1]; }

std::uint32_t little_long(const Bytes& bytes, std::size_t at) {
  return std::uint32_t{bytes[at]} | std::uint32_t{bytes[at + 1]} << 8 | std::uint32_t{bytes[at + 2]} << 16 |
         std::uint32_t{bytes[at + 3]} << 24;
}

void size_frame(CodedFrame& frame) {
  frame.bytes.assign(static_cast<std::size_t>(frame.columns) * static_cast<std::size_t>(frame.rows) *
                         static_cast<std::size_t>(frame.samples) *
                         static_cast<std::size_t>(frame.sample_bytes),
                     0);
}

void take_frame_start(const Bytes& stream, std::size_t at, int length, JpegStart& start) {
  start.precision = stream[at];
  start.rows = big_word(stream, at + 1);
  start.columns = big_word(stream, at + 3);
  start.components = stream[at + 5];
  std::string names;
  int first = 0;
  for (int n = 0; n < start.components && 8 + 3 * n + 2 < length; ++n) {
    const auto component = at + 6 + 3 * static_cast<std::size_t>(n);
    names.push_back(static_cast<char>(stream[component]));
    if (n == 0) first = stream[component + 1];
    if (n > 0 && stream[component + 1] != first) start.subsampled = true;
  }
  if (start.colour != StreamColour::not_said || start.components != 3) return;
  if (names == "RGB") {
    start.colour = StreamColour::rgb;
    start.colour_reason = "its components are called R, G and B";
  } else if (start.subsampled) {
    start.colour = StreamColour::ybr;
    start.colour_reason = "its colour has fewer samples than its brightness";
  }
}

/// DCMTK reads whole numbers of 8, 12 or 16 bits with a library each.
std::unique_ptr<DJDecoder> jpeg_decoder(int precision, const DJCodecParameter& parameters) {
  if (precision <= 8) return std::make_unique<DJDecompressIJG8Bit>(parameters, OFFalse);
  if (precision <= 12) return std::make_unique<DJDecompressIJG12Bit>(parameters, OFFalse);
  return std::make_unique<DJDecompressIJG16Bit>(parameters, OFFalse);
}

/// Tries the JPEG library for `precision` bits.
OFCondition run_jpeg(const Bytes& stream, int precision, bool is_signed, CodedFrame& frame) {
  // Components come out as they are in the stream; colour is settled later.
  const DJCodecParameter parameters(ECC_lossyYCbCr, EDC_never, EUC_never, EPC_colorByPixel, OFTrue, OFTrue);
  const auto decoder = jpeg_decoder(precision, parameters);
  OFCondition result = decoder->init();
  frame.sample_bytes = decoder->bytesPerSample();
  size_frame(frame);
  Bytes input = stream;
  if (result.good())
    result = decoder->decode(input.data(), static_cast<Uint32>(input.size()), frame.bytes.data(),
                             static_cast<Uint32>(frame.bytes.size()), is_signed ? OFTrue : OFFalse);
  return result;
}

CodingOutcome decode_jpeg(const Bytes& stream, const FrameShape& shape, const JpegStart& start,
                          const std::function<void()>& risk, CodedFrame& frame, std::string& reason) {
  frame.columns = start.columns;
  frame.rows = start.rows;
  frame.samples = start.components;
  frame.colour = start.colour;
  frame.colour_reason = start.colour_reason;
  OFCondition result = run_jpeg(stream, start.precision, shape.is_signed, frame);
  if (result.good()) return CodingOutcome::done;
  if (result == EJ_Suspension) return CodingOutcome::damaged;
  reason = result.text();
  CodedFrame other = frame;
  risk();
  if (!decode_by_gdcm(FrameCoding::jpeg, stream, shape, start.precision, other))
    return CodingOutcome::damaged;
  frame = std::move(other);
  return CodingOutcome::done;
}

CodingOutcome decode_jpeg_ls(const Bytes& stream, const JpegStart& start, CodedFrame& frame,
                             std::string& reason) {
  frame.columns = start.columns;
  frame.rows = start.rows;
  frame.samples = start.components;
  frame.sample_bytes = start.precision <= 8 ? 1 : 2;
  size_frame(frame);
  DJLSDecoderRegistration::registerCodecs(EJLSUC_never, EJLSPC_colorByPixel);
  DcmDataset dataset;
  const auto number = [&](const DcmTagKey& tag, int value) {
    dataset.putAndInsertUint16(tag, static_cast<Uint16>(value));
  };
  number(DCM_SamplesPerPixel, start.components);
  number(DCM_Rows, start.rows);
  number(DCM_Columns, start.columns);
  number(DCM_BitsAllocated, 8 * frame.sample_bytes);
  number(DCM_BitsStored, start.precision);
  number(DCM_HighBit, start.precision - 1);
  number(DCM_PixelRepresentation, 0);
  number(DCM_PlanarConfiguration, 0);
  dataset.putAndInsertString(DCM_PhotometricInterpretation, start.components == 1 ? "MONOCHROME2" : "RGB");
  auto sequence = std::make_unique<DcmPixelSequence>(DCM_PixelSequenceTag);
  auto table = std::make_unique<DcmPixelItem>(DCM_PixelItemTag);
  auto item = std::make_unique<DcmPixelItem>(DCM_PixelItemTag);
  Bytes even = stream;
  if (even.size() % 2 != 0) even.push_back(0);
  item->putUint8Array(even.data(), static_cast<unsigned long>(even.size()));
  sequence->insert(table.release());
  sequence->insert(item.release());
  auto pixels = std::make_unique<DcmPixelData>(DCM_PixelData);
  DcmPixelData& data = *pixels;
  data.putOriginalRepresentation(EXS_JPEGLSLossless, nullptr, sequence.release());
  if (dataset.insert(pixels.get()).good()) static_cast<void>(pixels.release());
  Uint32 fragment = 1;
  OFString colour;
  const std::size_t size = frame.bytes.size();
  frame.bytes.resize(size + size % 2);
  const OFCondition result = data.getUncompressedFrame(&dataset, 0, fragment, frame.bytes.data(),
                                                       static_cast<Uint32>(frame.bytes.size()), colour);
  frame.bytes.resize(size);
  if (result.good()) return CodingOutcome::done;
  reason = result.text();
  // Whole by its looks, so it is the decoder that does not know this form.
  const std::size_t last = stream.size() - (stream.back() == 0 ? 1 : 0);
  const bool ended = stream[last - 2] == 0xFF && stream[last - 1] == 0xD9;
  return ended ? CodingOutcome::refused : CodingOutcome::damaged;
}

/// Undoes the run lengths of one segment (PS3.5, annex G.3); false where it ends too soon.
bool unpack_runs(const Bytes& stream, std::size_t from, std::size_t to, Bytes& segment, std::size_t count) {
  segment.clear();
  segment.reserve(count);
  while (segment.size() < count && from < to) {
    const int control = static_cast<std::int8_t>(stream[from++]);
    if (control >= 0) {
      const std::size_t length = std::min(static_cast<std::size_t>(control) + 1, to - from);
      segment.insert(segment.end(), stream.begin() + static_cast<std::ptrdiff_t>(from),
                     stream.begin() + static_cast<std::ptrdiff_t>(from + length));
      from += length;
    } else if (control != -128 && from < to) {
      segment.insert(segment.end(), static_cast<std::size_t>(1 - control), stream[from++]);
    }
  }
  const bool whole = segment.size() >= count;
  segment.resize(count, 0);
  return whole;
}

CodingOutcome decode_rle(const Bytes& stream, const FrameShape& shape, CodedFrame& frame) {
  constexpr std::size_t header = 64;
  const std::size_t pixels = static_cast<std::size_t>(shape.columns) * static_cast<std::size_t>(shape.rows);
  frame.columns = shape.columns;
  frame.rows = shape.rows;
  frame.samples = shape.samples;
  frame.sample_bytes = std::max(1, shape.bits_allocated / 8);
  size_frame(frame);
  if (stream.size() < header) return CodingOutcome::damaged;
  const auto segments = static_cast<std::size_t>(little_long(stream, 0));
  const auto sample_bytes = static_cast<std::size_t>(frame.sample_bytes);
  const std::size_t wanted = static_cast<std::size_t>(shape.samples) * sample_bytes;
  if (segments != wanted || wanted > 15) return CodingOutcome::damaged;
  bool whole = true;
  Bytes segment;
  for (std::size_t n = 0; n < segments; ++n) {
    const std::size_t from = little_long(stream, 4 + 4 * n);
    std::size_t to = n + 1 < segments ? little_long(stream, 8 + 4 * n) : stream.size();
    to = std::min(to, stream.size());
    if (from < header || from > to) {
      whole = false;
      continue;
    }
    const bool bits = shape.bits_allocated == 1;
    if (bits) {
      // In eighths where they were packed, as a byte a pixel otherwise.
      frame.packed_bits = !unpack_runs(stream, from, to, segment, pixels);
      if (frame.packed_bits) whole = unpack_runs(stream, from, to, segment, (pixels + 7) / 8) && whole;
      frame.bytes = segment;
      continue;
    }
    whole = unpack_runs(stream, from, to, segment, pixels) && whole;
    // The highest byte of a sample comes first.
    const std::size_t place = n / sample_bytes * sample_bytes + (sample_bytes - 1 - n % sample_bytes);
    for (std::size_t pixel = 0; pixel < pixels; ++pixel) frame.bytes[pixel * wanted + place] = segment[pixel];
  }
  return whole ? CodingOutcome::done : CodingOutcome::damaged;
}

/// What SIZ and COD of a JPEG 2000 codestream say.
struct J2kStart {
  int columns = 0, rows = 0, components = 0, precision = 0;
  bool transformed = false;
};

std::optional<J2kStart> j2k_start(const Bytes& stream) {
  static constexpr std::array<std::uint8_t, 4> begin{0xFF, 0x4F, 0xFF, 0x51};
  const auto found = std::search(stream.begin(), stream.end(), begin.begin(), begin.end());
  auto at = static_cast<std::size_t>(found - stream.begin()) + 2;
  if (at + 42 > stream.size()) return std::nullopt;
  J2kStart start;
  const auto big_long = [&](std::size_t n) {
    return static_cast<std::uint32_t>(big_word(stream, n)) << 16 |
           static_cast<std::uint32_t>(big_word(stream, n + 2));
  };
  const std::uint32_t width = big_long(at + 6) - big_long(at + 14);
  const std::uint32_t height = big_long(at + 10) - big_long(at + 18);
  if (width > 65535 || height > 65535) return std::nullopt;
  start.columns = static_cast<int>(width);
  start.rows = static_cast<int>(height);
  start.components = big_word(stream, at + 38);
  start.precision = (stream[at + 40] & 0x7F) + 1;
  while (at + 10 <= stream.size() && stream[at] == 0xFF && stream[at + 1] != 0x90) {
    if (stream[at + 1] == 0x52) start.transformed = stream[at + 8] == 1;
    at += 2 + static_cast<std::size_t>(big_word(stream, at + 2));
  }
  return start;
}

CodingOutcome decode_jpeg_2000(const Bytes& stream, const FrameShape& shape,
                               const std::function<void()>& risk, CodedFrame& frame, std::string& reason) {
  const auto start = j2k_start(stream);
  if (!start) return CodingOutcome::damaged;
  frame.columns = start->columns;
  frame.rows = start->rows;
  frame.samples = start->components;
  frame.sample_bytes = start->precision <= 8 ? 1 : start->precision <= 16 ? 2 : 4;
  if (frame.columns > shape.columns || frame.rows > shape.rows ||
      (frame.samples != 1 && frame.samples != 3)) {
    reason = "its stream is larger than its header says";
    return CodingOutcome::refused;
  }
  size_frame(frame);
  if (start->components == 3) {
    frame.colour = start->transformed ? StreamColour::rgb : StreamColour::not_said;
    frame.colour_reason = "its stream holds a colour transform of its own";
  }
  risk();
  return decode_by_gdcm(FrameCoding::jpeg_2000, stream, shape, start->precision, frame)
             ? CodingOutcome::done
             : CodingOutcome::damaged;
}

}  // namespace

SyntaxForm syntax_form(const std::string& transfer_syntax) {
  const std::string root = "1.2.840.10008.1.2";
  static const std::map<std::string, SyntaxForm> known{
      {".4.50", {FrameCoding::jpeg, "JPEG baseline"}},
      {".4.51", {FrameCoding::jpeg, "JPEG extended"}},
      {".4.52", {FrameCoding::jpeg, "JPEG extended"}},
      {".4.53", {FrameCoding::jpeg, "JPEG spectral selection"}},
      {".4.55", {FrameCoding::jpeg, "JPEG progressive"}},
      {".4.57", {FrameCoding::jpeg, "JPEG lossless"}},
      {".4.70", {FrameCoding::jpeg, "JPEG lossless"}},
      {".4.80", {FrameCoding::jpeg_ls, "JPEG-LS lossless"}},
      {".4.81", {FrameCoding::jpeg_ls, "JPEG-LS near-lossless"}},
      {".4.90", {FrameCoding::jpeg_2000, "JPEG 2000 lossless"}},
      {".4.91", {FrameCoding::jpeg_2000, "JPEG 2000"}},
      {".4.92", {FrameCoding::jpeg_2000, "JPEG 2000 multi-component lossless"}},
      {".4.93", {FrameCoding::jpeg_2000, "JPEG 2000 multi-component"}},
      {".4.94", {FrameCoding::unsupported, "JPIP, pixels on a server"}},
      {".4.95", {FrameCoding::unsupported, "JPIP, pixels on a server"}},
      {".4.100", {FrameCoding::unsupported, "MPEG-2 video"}},
      {".4.101", {FrameCoding::unsupported, "MPEG-2 video"}},
      {".4.110", {FrameCoding::unsupported, "JPEG XL"}},
      {".4.111", {FrameCoding::unsupported, "JPEG XL"}},
      {".4.112", {FrameCoding::unsupported, "JPEG XL"}},
      {".4.201", {FrameCoding::unsupported, "High-Throughput JPEG 2000"}},
      {".4.202", {FrameCoding::unsupported, "High-Throughput JPEG 2000"}},
      {".4.203", {FrameCoding::unsupported, "High-Throughput JPEG 2000"}},
      {".4.204", {FrameCoding::unsupported, "JPIP, pixels on a server"}},
      {".4.205", {FrameCoding::unsupported, "JPIP, pixels on a server"}},
      {".5", {FrameCoding::rle, "RLE"}}};
  if (transfer_syntax.compare(0, root.size(), root) != 0) return {FrameCoding::native, {}};
  const std::string rest = transfer_syntax.substr(root.size());
  const auto found = known.find(rest);
  if (found != known.end()) return found->second;
  for (int n = 102; n <= 108; ++n)
    if (rest.compare(0, 6, ".4." + std::to_string(n)) == 0)
      return {FrameCoding::unsupported, n < 107 ? "MPEG-4 video" : "HEVC video"};
  return {FrameCoding::native, {}};
}

FrameCoding coding_of_stream(const std::vector<std::uint8_t>& start) {
  if (start.size() < 4) return FrameCoding::native;
  if (start[0] == 0xFF && start[1] == 0x4F && start[2] == 0xFF && start[3] == 0x51)
    return FrameCoding::jpeg_2000;
  if (start[0] != 0xFF || start[1] != 0xD8 || start[2] != 0xFF) return FrameCoding::native;
  const JpegStart jpeg = jpeg_start(start);
  constexpr int jpeg_ls = 0xF7 - 0xC0;
  return jpeg.process == jpeg_ls ? FrameCoding::jpeg_ls : FrameCoding::jpeg;
}

JpegStart jpeg_start(const std::vector<std::uint8_t>& stream) {
  JpegStart start;
  bool jfif = false;
  std::size_t at = 2;
  while (at + 4 <= stream.size()) {
    if (stream[at] != 0xFF) return start;
    const int marker = stream[at + 1];
    if (marker == 0xFF) {
      ++at;
      continue;
    }
    const int length = big_word(stream, at + 2);
    const std::size_t value = at + 4;
    if (length < 2 || at + 2 + static_cast<std::size_t>(length) > stream.size()) return start;
    const auto has = [&](const char* word, int count) {
      return length >= count + 2 &&
             std::equal(word, word + count, stream.begin() + static_cast<std::ptrdiff_t>(value));
    };
    if (marker == 0xE0 && has("JFIF", 4)) jfif = true;
    if (marker == 0xEE && has("Adobe", 5) && length >= 14) {
      start.colour = stream[value + 11] == 0 ? StreamColour::rgb : StreamColour::ybr;
      start.colour_reason = "an Adobe marker says so";
    }
    const bool frame_start =
        (marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC) ||
        marker == 0xF7;
    if (frame_start && length >= 8) {
      start.process = marker - 0xC0;
      constexpr int lossless = 3;
      if (start.colour == StreamColour::not_said && jfif && start.process != lossless && marker != 0xF7) {
        start.colour = StreamColour::ybr;
        start.colour_reason = "it is a JFIF stream";
      }
      take_frame_start(stream, value, length, start);
      return start;
    }
    if (marker == 0xDA) return start;
    at += 2 + static_cast<std::size_t>(length);
  }
  return start;
}

CodingOutcome decode_frame(FrameCoding coding, const std::vector<std::uint8_t>& stream,
                           const FrameShape& shape, const std::function<void()>& risk, CodedFrame& frame,
                           std::string& reason) {
  if (coding == FrameCoding::rle) return decode_rle(stream, shape, frame);
  if (coding == FrameCoding::jpeg_2000) return decode_jpeg_2000(stream, shape, risk, frame, reason);
  if (coding != FrameCoding::jpeg && coding != FrameCoding::jpeg_ls) return CodingOutcome::refused;
  const JpegStart start = jpeg_start(stream);
  if (start.process < 0 || start.precision < 2 || start.precision > 16) return CodingOutcome::damaged;
  if (start.columns < 1 || start.rows < 1 || start.columns > shape.columns || start.rows > shape.rows ||
      (start.components != 1 && start.components != 3)) {
    reason = "its stream is larger than its header says";
    return CodingOutcome::refused;
  }
  constexpr int jpeg_ls = 0xF7 - 0xC0;
  return start.process == jpeg_ls ? decode_jpeg_ls(stream, start, frame, reason)
                                  : decode_jpeg(stream, shape, start, risk, frame, reason);
}

}  // namespace palpate::imaging::reading
