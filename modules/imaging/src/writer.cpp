#include "palpate/imaging/writer.hpp"

#include "writer_enhanced_us.hpp"

#include "palpate/core/atomic_output.hpp"
#include "palpate/core/error.hpp"

#include <itkMacro.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <string>
#include <utility>
#include <zlib.h>

namespace palpate::imaging {
namespace {

namespace fs = std::filesystem;
using core::AtomicOutput;
using core::output_error;

constexpr std::array<const char*, 6> endings{".mha", ".mhd", ".nrrd", ".nii.gz", ".nii", ".dcm"};

std::string ending_of(const fs::path& path) {
  std::string name = path.filename().string();
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
  for (const std::string ending : endings)
    if (name.size() > ending.size() && name.compare(name.size() - ending.size(), ending.size(), ending) == 0)
      return ending;
  core::throw_usage("Cannot tell the format of " + path.string() +
                    " by its ending; it must be .mha, .mhd, .nrrd, .nii, .nii.gz or .dcm.");
}

itk::ImageIOBase::Pointer io_for(const std::string& ending) {
  if (ending == ".mha" || ending == ".mhd") {
    const auto io = itk::MetaImageIO::New();
    io->SetDoublePrecision(17);  // the geometry comes back bit for bit
    return io.GetPointer();
  }
  if (ending == ".nrrd") return itk::NrrdImageIO::New().GetPointer();
  return itk::NiftiImageIO::New().GetPointer();
}

/// The voxels of all frames, one after the other, as the file holds them.
struct Pixels {
  itk::ImageIOBase::IOComponentType type;
  const char* data;
  std::size_t bytes;
  std::vector<std::uint8_t> whole;  ///< owns the data of uint8
  std::vector<float> joined;        ///< owns the data of several frames
};

std::uint8_t rounded(float value) {
  return static_cast<std::uint8_t>(std::clamp(std::floor(value + 0.5F), 0.0F, 255.0F));
}

Pixels pixels_of(const std::vector<core::Volume>& frames, const std::string& pixel_type) {
  Pixels pixels{};
  const std::size_t count = frames.front().size() * frames.size();
  if (pixel_type == "uint8") {
    pixels.whole.reserve(count);
    for (const auto& frame : frames)
      std::transform(frame.data(), frame.data() + frame.size(), std::back_inserter(pixels.whole), rounded);
    pixels.type = itk::ImageIOBase::UCHAR;
    pixels.data = reinterpret_cast<const char*>(pixels.whole.data());
    pixels.bytes = count;
    return pixels;
  }
  pixels.type = itk::ImageIOBase::FLOAT;
  pixels.bytes = count * sizeof(float);
  if (frames.size() == 1) {
    pixels.data = reinterpret_cast<const char*>(frames.front().data());
    return pixels;
  }
  pixels.joined.reserve(count);
  for (const auto& frame : frames)
    pixels.joined.insert(pixels.joined.end(), frame.data(), frame.data() + frame.size());
  pixels.data = reinterpret_cast<const char*>(pixels.joined.data());
  return pixels;
}

void describe(itk::ImageIOBase& io, const core::ImageGeometry& geometry, std::size_t frames,
              double frame_spacing_s, itk::ImageIOBase::IOComponentType type) {
  const unsigned dimensions = frames > 1 ? 4 : 3;
  io.SetNumberOfDimensions(dimensions);
  itk::ImageIORegion region(dimensions);
  for (unsigned axis = 0; axis < dimensions; ++axis) {
    std::vector<double> direction(dimensions, 0.0);
    if (axis < 3) {
      const auto size = static_cast<std::size_t>(geometry.dims()[axis]);
      io.SetDimensions(axis, size);
      region.SetSize(axis, size);
      io.SetSpacing(axis, geometry.spacing_mm()[axis]);
      io.SetOrigin(axis, geometry.origin_mm()[axis]);
      for (int row = 0; row < 3; ++row)
        direction[static_cast<std::size_t>(row)] = geometry.direction()(row, axis);
    } else {
      io.SetDimensions(axis, frames);
      region.SetSize(axis, frames);
      io.SetSpacing(axis, frame_spacing_s > 0.0 ? frame_spacing_s : 1.0);
      io.SetOrigin(axis, 0.0);
      direction[axis] = 1.0;
    }
    region.SetIndex(axis, 0);
    io.SetDirection(axis, direction);
  }
  io.SetIORegion(region);
  io.SetPixelType(itk::CommonEnums::IOPixel::SCALAR);
  io.SetComponentType(type);
  io.SetNumberOfComponents(1);
}

/// MetaIO and the NIfTI library do not say when a write came up short, so the
/// staged file is read back. A header that was itself cut off is not parsed.
bool came_out_whole(const fs::path& staged, const std::string& ending, const Pixels& pixels) {
  if (ending == ".mha" || ending == ".mhd") {
    std::ifstream file(staged, std::ios::binary);
    std::string head(4096, '\0');
    file.read(head.data(), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(file.gcount()));
    const auto last = head.find("ElementDataFile = ");
    if (last == std::string::npos || head.find('\n', last) == std::string::npos) return false;
  }
  const auto io = io_for(ending);
  io->SetFileName(staged.string());
  io->ReadImageInformation();
  if (static_cast<std::size_t>(io->GetImageSizeInBytes()) != pixels.bytes) return false;
  itk::ImageIORegion region(io->GetNumberOfDimensions());
  for (unsigned axis = 0; axis < io->GetNumberOfDimensions(); ++axis)
    region.SetSize(axis, io->GetDimensions(axis));
  io->SetIORegion(region);
  std::vector<char> back(pixels.bytes);
  io->Read(back.data());
  return std::memcmp(back.data(), pixels.data, pixels.bytes) == 0;
}

/// ITK writes four axes as space, without saying of which kind; then nobody
/// can tell the patient's axes, nor that the fourth is time.
void say_time_in_nrrd(const fs::path& staged, bool timed) {
  std::ifstream in(staged, std::ios::binary);
  std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  in.close();
  const std::string unsaid = "space dimension: 4\n";
  const auto at = text.find(unsaid);
  if (at == std::string::npos || at > text.find("\n\n")) return;
  text.replace(at, unsaid.size(),
               std::string("space: left-posterior-superior-time\nspace units: \"mm\" \"mm\" \"mm\" ") +
                   (timed ? "\"s\"\n" : "\"frame\"\n"));
  std::ofstream(staged, std::ios::binary | std::ios::trunc)
      .write(text.data(), static_cast<std::streamsize>(text.size()));
}

/// ITK leaves out the unit of time, "xyzt_units" of the header: here mm and s.
void say_time_in_nifti(const fs::path& staged, bool zipped) {
  constexpr std::size_t units_at = 123;
  constexpr char mm_and_s = 2 | 8;
  if (!zipped) {
    std::fstream file(staged, std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(units_at);
    file.put(mm_and_s);
    return;
  }
  const fs::path again = fs::path(staged).replace_extension(".again");
  const auto close = [](gzFile file) { gzclose(file); };
  const std::unique_ptr<gzFile_s, decltype(close)> in(gzopen(staged.c_str(), "rb"), close);
  std::unique_ptr<gzFile_s, decltype(close)> out(gzopen(again.c_str(), "wb6"), close);
  if (!in || !out) return;
  std::vector<char> block(std::size_t{1} << 20U);
  bool first = true;
  for (int count = 0; (count = gzread(in.get(), block.data(), static_cast<unsigned>(block.size()))) > 0;) {
    if (first && static_cast<std::size_t>(count) > units_at) block[units_at] = mm_and_s;
    first = false;
    if (gzwrite(out.get(), block.data(), static_cast<unsigned>(count)) != count) return;
  }
  out.reset();
  fs::rename(again, staged);
}

void write_staged(const AtomicOutput& output, const fs::path& staged, const std::string& ending,
                  const std::vector<core::Volume>& frames, double frame_spacing_s,
                  const WriteOptions& options) {
  const Pixels pixels = pixels_of(frames, options.pixel_type);
  bool whole = false;
  try {
    const auto io = io_for(ending);
    io->SetFileName(staged.string());
    describe(*io, frames.front().geometry(), frames.size(), frame_spacing_s, pixels.type);
    io->SetUseCompression(options.compress);
    io->WriteImageInformation();
    io->Write(pixels.data);
    const bool timed = frame_spacing_s > 0.0;
    if (frames.size() > 1 && ending == ".nrrd") say_time_in_nrrd(staged, timed);
    if (frames.size() > 1 && timed && ending.compare(0, 4, ".nii") == 0)
      say_time_in_nifti(staged, ending == ".nii.gz");
    whole = came_out_whole(staged, ending, pixels);
  } catch (const itk::ExceptionObject&) {  // its words name addresses and staged files
  }
  if (whole) return;
  throw output_error(
      output.target(), "write-failed",
      "the disk took only a part of it; it may be full, or there is a limit on the size of files");
}

void check(const std::vector<core::Volume>& frames, double frame_spacing_s, const WriteOptions& options) {
  if (options.pixel_type != "float32" && options.pixel_type != "uint8")
    core::throw_usage("Cannot write the pixel type \"" + options.pixel_type +
                      "\"; there are float32 and uint8.");
  if (!std::isfinite(frame_spacing_s) || frame_spacing_s < 0.0)
    core::throw_usage("The time between frames must be a number of seconds, zero or more.");
  const auto& times = options.frame_times_s;
  const bool rising =
      std::adjacent_find(times.begin(), times.end(), std::greater_equal<>()) == times.end() &&
      std::all_of(times.begin(), times.end(), [](double time) { return std::isfinite(time); });
  if (!times.empty() && (times.size() != frames.size() || !rising))
    core::throw_usage(
        "The frames' times must be as many as the frames, in seconds, each later than the last.");
  const auto differs = [&](const core::Volume& frame) {
    return frame.empty() || !(frame.geometry() == frames.front().geometry());
  };
  if (frames.empty() || std::any_of(frames.begin(), frames.end(), differs))
    throw core::Error(
        core::ErrorKind::internal, "frames-differ",
        "Frames can be written into one file only when there are some and all have the same geometry.");
}

/// One a frame, counted from the first, or none where nothing is known.
std::vector<double> times_of(std::size_t frames, double frame_spacing_s, const WriteOptions& options) {
  std::vector<double> times;
  if (frames < 2) return times;
  for (std::size_t n = 0; n < frames; ++n) {
    if (!options.frame_times_s.empty())
      times.push_back(options.frame_times_s[n] - options.frame_times_s.front());
    else if (frame_spacing_s > 0.0)
      times.push_back(frame_spacing_s * static_cast<double>(n));
  }
  return times;
}

}  // namespace

void write(const fs::path& path, const std::vector<core::Volume>& frames, double frame_spacing_s,
           const WriteOptions& options, const core::Progress& progress) {
  const std::string ending = ending_of(path);
  check(frames, frame_spacing_s, options);
  const std::string what = "Writing " + path.filename().string();
  progress.report(0.0, what);
  const AtomicOutput output(path);
  std::error_code ignored;
  const auto existing = fs::status(output.target(), ignored);
  if (fs::is_directory(existing)) throw output_error(path, "is-a-folder", "there is a folder of that name");
  if (fs::exists(existing) && !fs::is_regular_file(existing))
    throw output_error(path, "not-a-file", "what is there is not an ordinary file");

  // ITK knows its formats by endings in small letters only.
  std::string name = output.target().filename().string();
  name.replace(name.size() - ending.size(), ending.size(), ending);
  const fs::path staged = output.staged(name);
  const auto times = times_of(frames.size(), frame_spacing_s, options);
  if (ending == ".dcm")
    write_enhanced_us_volume(staged, output.target(), frames, times, options, progress);
  else
    write_staged(output, staged, ending, frames,
                 times.empty() ? 0.0 : times.back() / static_cast<double>(times.size() - 1), options);
  progress.report(1.0, what);  // the last place to stop: from here it is put in place whole
  // The header goes last: while it is not there, nobody looks for its data.
  if (ending == ".mhd")
    for (const char* data_ending : {".raw", ".zraw"}) {
      const fs::path data = fs::path(staged).replace_extension(data_ending);
      if (fs::exists(data, ignored)) output.commit(data, output.target().parent_path() / data.filename());
    }
  output.commit(staged, output.target());
}

}  // namespace palpate::imaging
