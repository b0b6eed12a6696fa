#include "dicom_pixels.hpp"

#include "dicom_codecs.hpp"
#include "dicom_fragments.hpp"
#include "dicom_grey.hpp"
#include "text_header.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace palpate::imaging::reading {
namespace {

using Kind = DicomPixelPlace::Kind;

constexpr const char* padding_text =
    "Places outside of the picture hold a padding value; it is kept as stored.";

int whole_at(const DicomItem& data, std::uint16_t element, int otherwise) {
  const auto value = data.number({0x0028, element});
  return value && *value >= 0.0 && *value <= 65535.0 ? static_cast<int>(*value) : otherwise;
}

int frames_of(const DicomFile& file) {
  const std::string text = file.dataset().text({0x0028, 0x0008});
  if (text.empty()) return 1;
  const auto count = whole_number(text);
  if (!count || *count < 1 || *count > 1000000)
    fail("bad-header", file.path(),
         "says \"" + text.substr(0, 20) + "\" where its number of frames should be. Export the scan again.");
  return static_cast<int>(*count);
}

std::string sop_class_of(const DicomFile& file) {
  const std::string sop_class = file.dataset().text({0x0008, 0x0016});
  return sop_class.empty() ? "unknown" : sop_class;
}

void settle_bits(const DicomFile& file, DicomPixelForm& form) {
  const Kind kind = file.pixels().kind;
  if (kind == Kind::floats || kind == Kind::doubles) {
    form.bits_allocated = form.bits_stored = kind == Kind::floats ? 32 : 64;
    form.high_bit = form.bits_stored - 1;
    form.is_signed = true;
    form.pixel_type = kind == Kind::floats ? "float32" : "float64";
    return;
  }
  const int bits = form.bits_allocated;
  if (bits != 1 && bits != 8 && bits != 16 && bits != 32 && bits != 64)
    fail("unsupported", file.path(),
         "has pixels of " + std::to_string(bits) + " bits, which are not read. Export it with 8 or 16 bits.");
  if (form.bits_stored < 1 || form.bits_stored > bits) form.bits_stored = bits;
  if (form.high_bit >= bits || form.high_bit < form.bits_stored - 1) form.high_bit = form.bits_stored - 1;
  form.pixel_type = (form.is_signed ? "int" : "uint") + std::to_string(std::max(8, bits));
}

}  // namespace

DicomPixelForm dicom_pixel_form(const DicomFile& file) {
  const DicomItem data = file.dataset();
  DicomPixelForm form;
  form.rows = whole_at(data, 0x0010, 0);
  form.columns = whole_at(data, 0x0011, 0);
  if (form.rows < 1 || form.columns < 1)
    fail("no-image", file.path(),
         "holds no picture by its header (SOP class " + sop_class_of(file) +
             "). Choose the file or series that holds the scan.");
  if (file.pixels().kind == Kind::none)
    fail("no-image", file.path(), "has a header but no pixels. Export the scan again.");
  form.frames = frames_of(file);
  form.samples = std::max(1, whole_at(data, 0x0002, 1));
  form.bits_allocated = whole_at(data, 0x0100, 0);
  if (form.bits_allocated == 0) form.bits_allocated = whole_at(data, 0x0101, 0) > 8 ? 16 : 8;
  form.bits_stored = whole_at(data, 0x0101, form.bits_allocated);
  form.high_bit = whole_at(data, 0x0102, form.bits_stored - 1);
  form.is_signed = whole_at(data, 0x0103, 0) == 1;
  form.planar = form.samples > 1 && whole_at(data, 0x0006, 0) == 1;
  form.photometric = data.text({0x0028, 0x0004});
  if (form.photometric.empty()) form.photometric = form.samples == 3 ? "RGB" : "MONOCHROME2";
  form.components = form.photometric == "PALETTE COLOR" ? 3 : form.samples;
  settle_bits(file, form);
  if (form.samples != 1 && form.samples != 3)
    fail("unsupported", file.path(),
         "has " + std::to_string(form.samples) + " numbers for each pixel (" + form.photometric +
             "), which is not read. Export it as grey or RGB.");
  return form;
}

struct DicomPixels::State {
  const DicomFile& file;
  const Context& context;
  GreyRule rule;
  SyntaxForm syntax;
  bool encapsulated = false;
  std::vector<FragmentRun> runs;
  std::vector<DicomItem> frame_groups;
  std::vector<std::uint8_t> inflated;  ///< all pixels of a deflated file
  std::vector<core::Warning> warnings;

  State(const DicomFile& of, const Context& with) : file(of), context(with) {}

  const DicomPixelForm& form() const { return rule.form; }
  std::size_t pixels() const {
    return static_cast<std::size_t>(form().rows) * static_cast<std::size_t>(form().columns);
  }
  std::uint64_t frame_bits() const {
    const auto samples = static_cast<std::uint64_t>(rule.halved ? 2 : form().samples);
    return std::uint64_t{pixels()} * samples * static_cast<std::uint64_t>(form().bits_allocated);
  }
  void warn_once(const std::string& code, const std::string& text) {
    for (const auto& warning : warnings)
      if (warning.code == code && warning.text == text) return;
    warnings.push_back({code, text});
  }

  void settle_colour();
  void settle_coding();
  void check_native();
  void check_fragments();
  std::vector<std::uint8_t> value_bytes(std::uint64_t from, std::size_t count);
  CodedFrame native_frame(int frame);
  CodedFrame coded_frame(int frame);
  void take_stream_colour(const CodedFrame& frame, GreyRule& frame_rule);
  void report_damage(int frame, const std::string& why);
  bool fill(const CodedFrame& frame, const GreyRule& frame_rule, float* grey);
  void copy_reals(const CodedFrame& frame, float* grey) const;
};

void DicomPixels::State::settle_colour() {
  DicomPixelForm& form = rule.form;
  const std::string& says = form.photometric;
  if (says == "PALETTE COLOR" && form.samples == 1) {
    rule.colour = PixelColour::palette;
    rule.palette = read_palette(file, form);
  } else if (form.samples == 3) {
    if (says.compare(0, 8, "YBR_FULL") == 0)
      rule.colour = PixelColour::ybr_full;
    else if (says.compare(0, 11, "YBR_PARTIAL") == 0)
      rule.colour = PixelColour::ybr_partial;
    else if (says == "HSV")
      fail("unsupported", file.path(), "has colours as HSV, which are not read. Export it as RGB or grey.");
    else
      rule.colour = PixelColour::rgb;
    form.is_signed = false;
  } else if (file.dataset().has({0x0028, 0x1101}) && form.samples == 1) {
    warn_once("supplemental-palette",
              "Some values stand for colours of a palette of their own; all values are kept as stored.");
  }
  if (rule.colour == PixelColour::grey) {
    const auto padding = file.dataset().number({0x0028, 0x0120});
    const auto limit = file.dataset().number({0x0028, 0x0121});
    if (padding) {
      const auto sign = [&](double value) {
        const auto whole = static_cast<std::int64_t>(std::clamp(value, -4e9, 4e9));
        return form.is_signed ? std::int64_t{static_cast<std::int16_t>(whole)}
                              : std::int64_t{static_cast<std::uint16_t>(whole)};
      };
      rule.padding = std::minmax(sign(*padding), sign(limit.value_or(*padding)));
    }
  }
}

void DicomPixels::State::settle_coding() {
  const DicomPixelPlace& place = file.pixels();
  syntax = syntax_form(file.transfer_syntax());
  encapsulated = place.encapsulated;
  if (syntax.coding == FrameCoding::unsupported)
    fail("unsupported", file.path(),
         "holds pixels compressed as " + syntax.name + " (transfer syntax " + file.transfer_syntax() +
             "), which is not read. Export it uncompressed, or as JPEG, JPEG-LS, JPEG 2000 or RLE.");
  if (!encapsulated) {
    syntax.coding = FrameCoding::native;
    return;
  }
  const auto start = place.fragments.empty() ? std::vector<std::uint8_t>{}
                                             : file.read(place.fragments.front().offset, 65536);
  const FrameCoding seen = coding_of_stream(start);
  if (seen != FrameCoding::native && syntax.coding != seen) {
    syntax.coding = seen;
    syntax.name = seen == FrameCoding::jpeg ? "JPEG" : seen == FrameCoding::jpeg_ls ? "JPEG-LS" : "JPEG 2000";
    warn_once(
        "other-compression",
        "The pixels are compressed otherwise than the header says; they were read as " + syntax.name + ".");
  }
  if (syntax.coding == FrameCoding::native)
    fail("unsupported", file.path(),
         "holds compressed pixels in a form that is not known (transfer syntax " + file.transfer_syntax() +
             "). Export it uncompressed.");
}

void DicomPixels::State::check_native() {
  const DicomPixelForm& form = rule.form;
  const DicomPixelPlace& place = file.pixels();
  const auto frames = static_cast<std::uint64_t>(form.frames);
  if (form.samples == 3 && form.photometric.size() > 4 && !form.planar && form.columns % 2 == 0 &&
      form.photometric.compare(form.photometric.size() - 4, 4, "_422") == 0) {
    // Some programs unpack the colour and leave the header as it was.
    const std::uint64_t unpacked = (frame_bits() * frames + 7) / 8;
    rule.halved = place.value.length < unpacked;
  }
  const std::uint64_t needed = (frame_bits() * frames + 7) / 8;
  if (place.value.present < needed) {
    if (!context.options.allow_truncated)
      fail("truncated", file.path(),
           "holds " + std::to_string(place.value.present) + " bytes of pixels where its header speaks of " +
               std::to_string(needed) + ". It was cut off: copy or export it again.");
    warn_once("truncated", "A file was cut off; the pixels that are missing are black.");
  }
}

void DicomPixels::State::check_fragments() {
  const DicomPixelPlace& place = file.pixels();
  runs = fragments_of_frames(file, form().frames, syntax.coding);
  const auto missing =
      std::count_if(runs.begin(), runs.end(), [](const auto& run) { return run.count == 0; });
  const bool cut = std::any_of(place.fragments.begin(), place.fragments.end(),
                               [](const auto& piece) { return piece.present < piece.length; });
  if (missing == 0 && !cut) {
    if (!place.complete)
      warn_once("missing-end", "The file ends without the mark that should end its pixels; they are whole.");
    return;
  }
  if (!context.options.allow_truncated)
    fail("truncated", file.path(),
         (missing > 0 ? "holds the pixels of " + std::to_string(form().frames - missing) +
                            " frames where its header speaks of " + std::to_string(form().frames)
                      : "ends within its pixels") +
             ". It was cut off: copy or export it again.");
  warn_once("truncated", "A file was cut off; the pixels that are missing are black.");
}

DicomPixels::DicomPixels(const DicomFile& file, const Context& context)
    : state_(std::make_unique<State>(file, context)) {
  State& state = *state_;
  state.rule.form = dicom_pixel_form(file);
  state.settle_coding();
  state.settle_colour();
  if (state.encapsulated)
    state.check_fragments();
  else
    state.check_native();
  const double raw = static_cast<double>(state.frame_bits()) / 8.0;
  const double whole = file.deflated() ? raw * state.form().frames : 0.0;
  check_memory(file.path(), 3.0 * raw + whole, static_cast<double>(state.pixels()), context);
  state.frame_groups = file.dataset().items({0x5200, 0x9230});
  if (!DicomFile::dictionary_loaded())
    state.warn_once(
        "no-data-dictionary",
        "DCMTK's data dictionary is missing (dicom.dic of its package): tags were read by guesses.");
  if (file.mended()) state.warn_once("damaged-header", "Parts of the header are damaged and were left out.");
}

DicomPixels::~DicomPixels() = default;
const DicomPixelForm& DicomPixels::form() const { return state_->form(); }
const std::vector<core::Warning>& DicomPixels::warnings() const { return state_->warnings; }

std::vector<std::uint8_t> DicomPixels::State::value_bytes(std::uint64_t from, std::size_t count) {
  const auto& value = file.pixels().value;
  const std::uint64_t there = from < value.present ? value.present - from : 0;
  const auto wanted = static_cast<std::size_t>(std::min<std::uint64_t>(count, there));
  if (!file.deflated())
    return wanted == 0 ? std::vector<std::uint8_t>{} : file.read(value.offset + from, wanted);
  if (inflated.empty()) {
    const std::uint64_t all = (frame_bits() * static_cast<std::uint64_t>(form().frames) + 7) / 8;
    inflated = file.read(value.offset, static_cast<std::size_t>(std::min(all, value.present)));
  }
  const std::size_t first = std::min(static_cast<std::size_t>(from), inflated.size());
  const std::size_t last = std::min(first + wanted, inflated.size());
  return {inflated.begin() + static_cast<std::ptrdiff_t>(first),
          inflated.begin() + static_cast<std::ptrdiff_t>(last)};
}

CodedFrame DicomPixels::State::native_frame(int frame) {
  CodedFrame coded;
  coded.columns = form().columns;
  coded.rows = form().rows;
  coded.samples = form().samples;
  coded.planar = form().planar;
  coded.sample_bytes = std::max(1, form().bits_allocated / 8);
  coded.packed_bits = form().bits_allocated == 1;
  const std::uint64_t first_bit = frame_bits() * static_cast<std::uint64_t>(frame);
  const auto count = static_cast<std::size_t>((frame_bits() + 7) / 8);
  const bool swap_words = file.big_endian() && coded.sample_bytes == 1 && file.pixels().words;
  // Words are swapped as pairs, and bits go on across the frames.
  const std::uint64_t first_byte = first_bit / 8 / 2 * 2;
  const auto skipped = static_cast<std::size_t>(first_bit / 8 - first_byte);
  coded.bytes = value_bytes(first_byte, count + 3);
  coded.damaged = coded.bytes.size() < count + skipped;
  coded.bytes.resize(count + 3 + 1, 0);
  if (swap_words)
    for (std::size_t n = 0; n + 1 < coded.bytes.size(); n += 2) std::swap(coded.bytes[n], coded.bytes[n + 1]);
  coded.bytes.erase(coded.bytes.begin(), coded.bytes.begin() + static_cast<std::ptrdiff_t>(skipped));
  const auto shift = static_cast<unsigned>(first_bit % 8);
  if (shift != 0)
    for (std::size_t n = 0; n < count; ++n)
      coded.bytes[n] = static_cast<std::uint8_t>(coded.bytes[n] >> shift | coded.bytes[n + 1] << (8 - shift));
  coded.bytes.resize(count);
  const auto width = static_cast<std::size_t>(coded.sample_bytes);
  if (file.big_endian() && width > 1)
    for (std::size_t n = 0; n + width <= count; n += width)
      std::reverse(coded.bytes.begin() + static_cast<std::ptrdiff_t>(n),
                   coded.bytes.begin() + static_cast<std::ptrdiff_t>(n + width));
  return coded;
}

void DicomPixels::State::report_damage(int frame, const std::string& why) {
  if (!context.options.allow_truncated)
    fail("truncated", file.path(),
         "holds a picture that is damaged or cut off (frame " + std::to_string(frame) +
             ", counted from 0). Copy or export it again.",
         why);
  warn_once("truncated", "Pictures are damaged or cut off; the pixels that are missing are black.");
}

CodedFrame DicomPixels::State::coded_frame(int frame) {
  const FragmentRun& run = runs[static_cast<std::size_t>(frame)];
  const FrameStream stream = read_fragments(file, run);
  FrameShape shape;
  shape.columns = form().columns;
  shape.rows = form().rows;
  shape.samples = form().samples;
  shape.bits_allocated = form().bits_allocated;
  shape.bits_stored = form().bits_stored;
  shape.is_signed = form().is_signed;
  CodedFrame coded;
  std::string reason;
  const std::string cannot = "holds pixels that cannot be decoded (" + syntax.name + ", SOP class " +
                             sop_class_of(file) + "). Export it uncompressed, or as MetaImage or NRRD.";
  bool risked = false;
  const auto risk = [&] {
    risked = true;
    context.about_to_risk(file.path(), cannot);
  };
  CodingOutcome outcome = CodingOutcome::damaged;
  if (run.count > 0) outcome = decode_frame(syntax.coding, stream.bytes, shape, risk, coded, reason);
  if (risked) context.about_to_risk(file.path(), {});
  if (outcome == CodingOutcome::refused) fail("unsupported", file.path(), cannot, reason);
  coded.damaged = outcome == CodingOutcome::damaged || !stream.whole;
  if (coded.damaged) report_damage(frame, reason);
  if (coded.bytes.empty()) {
    coded.columns = shape.columns;
    coded.rows = shape.rows;
    coded.samples = shape.samples;
    coded.sample_bytes = 1;
    coded.bytes.assign(pixels() * static_cast<std::size_t>(shape.samples), 0);
  }
  return coded;
}

/// The stream knows better than the header what its components are.
void DicomPixels::State::take_stream_colour(const CodedFrame& frame, GreyRule& frame_rule) {
  const std::string& says = form().photometric;
  if (frame.samples != form().samples)
    warn_once("colour-space", "The header says " + says + ", but the pixels are compressed as " +
                                  (frame.samples == 1 ? "grey" : "colour") + "; they were read so.");
  if (frame.samples == 1) {
    if (frame_rule.colour != PixelColour::palette) frame_rule.colour = PixelColour::grey;
    return;
  }
  const bool transformed = says == "YBR_ICT" || says == "YBR_RCT";
  const bool header_ybr = says.compare(0, 4, "YBR_") == 0 && !transformed;
  if (form().samples == 1) frame_rule.colour = PixelColour::rgb;
  if (frame.colour == StreamColour::rgb) frame_rule.colour = PixelColour::rgb;
  if (frame.colour == StreamColour::ybr && frame_rule.colour != PixelColour::ybr_partial)
    frame_rule.colour = PixelColour::ybr_full;
  const bool is_ybr = frame_rule.colour != PixelColour::rgb;
  if (frame.colour == StreamColour::not_said || is_ybr == header_ybr) return;
  warn_once("colour-space", "The header says " + says + ", but the compressed pixels are " +
                                (is_ybr ? "YCbCr" : "RGB") + " (" + frame.colour_reason +
                                "); they were read so.");
}

/// Frames at the edge of a mosaic may be smaller than the others.
bool DicomPixels::State::fill(const CodedFrame& frame, const GreyRule& frame_rule, float* grey) {
  if (frame.columns == form().columns && frame.rows == form().rows) return make_grey(frame, frame_rule, grey);
  warn_once("smaller-frames",
            "Some frames are smaller than the header says; they lie at the upper left, the rest is black.");
  const auto columns = static_cast<std::size_t>(frame.columns);
  const auto rows = static_cast<std::size_t>(frame.rows);
  std::vector<float> part(columns * rows);
  const bool padding = make_grey(frame, frame_rule, part.data());
  std::fill_n(grey, pixels(), 0.0F);
  for (std::size_t row = 0; row < rows; ++row)
    std::copy_n(part.data() + row * columns, columns, grey + row * static_cast<std::size_t>(form().columns));
  return padding;
}

void DicomPixels::State::copy_reals(const CodedFrame& frame, float* grey) const {
  for (std::size_t n = 0; n < pixels(); ++n) {
    double value = 0.0;
    if (frame.sample_bytes == 4) {
      float real = 0.0F;
      std::memcpy(&real, frame.bytes.data() + 4 * n, sizeof(real));
      value = static_cast<double>(real);
    } else {
      std::memcpy(&value, frame.bytes.data() + 8 * n, sizeof(value));
    }
    grey[n] = static_cast<float>(value * rule.rescale.slope + rule.rescale.intercept);
  }
}

void DicomPixels::decode(int frame, float* grey) {
  State& state = *state_;
  state.rule.rescale = read_rescale(state.file, state.form(), state.frame_groups, frame);
  if (!state.encapsulated) {
    const CodedFrame native = state.native_frame(frame);
    if (state.file.pixels().kind != Kind::whole_numbers) return state.copy_reals(native, grey);
    if (make_grey(native, state.rule, grey)) state.warn_once("pixel-padding", padding_text);
    return;
  }
  const CodedFrame coded = state.coded_frame(frame);
  GreyRule rule = state.rule;
  state.take_stream_colour(coded, rule);
  if (coded.sample_bytes * 8 <= rule.form.high_bit && rule.form.high_bit + 1 > rule.form.bits_stored)
    rule.form.high_bit = rule.form.bits_stored - 1;  // the stream holds no more than the stored bits
  if (state.fill(coded, rule, grey)) state.warn_once("pixel-padding", padding_text);
}

}  // namespace palpate::imaging::reading
