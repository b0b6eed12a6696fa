// The child's side: runs in palpate-reader only.
#include "info_json.hpp"
#include "parsed.hpp"
#include "process.hpp"
#include "sandbox.hpp"
#include "small_picture.hpp"
#include "text_header.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <new>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

namespace palpate::imaging {
namespace reading {
namespace {

void send_bytes(const char* bytes, std::size_t count) {
  while (count > 0) {
    const ssize_t done = write(message_fd, bytes, count);
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) _exit(1);  // nobody listens any more
    bytes += done;
    count -= static_cast<std::size_t>(done);
  }
}

void send(const nlohmann::json& message) {
  const std::string line = message.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace) + "\n";
  send_bytes(line.data(), line.size());
}

/// Libraries turn a failed allocation into all kinds of errors; it is told here, first.
[[noreturn]] void out_of_memory() {
  static constexpr char line[] = "{\"error\":{\"code\":\"reader-memory\",\"text\":\"\"}}\n";
  send_bytes(line, sizeof(line) - 1);
  _exit(1);
}

void limit(int resource, rlim_t most) {
  rlimit now{};
  if (getrlimit(static_cast<__rlimit_resource>(resource), &now) != 0) return;
  if (now.rlim_max != RLIM_INFINITY) most = std::min(most, now.rlim_max);
  now.rlim_cur = most;
  now.rlim_max = most;
  setrlimit(static_cast<__rlimit_resource>(resource), &now);
}

void take_limits(std::size_t memory_bytes, long long cpu_s) {
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, static_cast<rlim_t>(cpu_s));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  limit(RLIMIT_AS, memory_bytes);  // sanitizers map terabytes of their own
#else
  static_cast<void>(memory_bytes);
#endif
}

ReaderRequest take_request(ReaderTask task) {
  std::string bytes;
  std::array<char, 65536> block{};
  for (;;) {
    const ssize_t count = ::read(request_fd, block.data(), block.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    bytes.append(block.data(), static_cast<std::size_t>(count));
  }
  ReaderRequest request;
  request.task = task;
  const auto line_end = bytes.find('\n');
  const auto json = nlohmann::json::parse(bytes.substr(0, line_end));
  request.options.series_uid = json.at("series_uid").get<std::string>();
  request.options.allow_truncated = json.at("allow_truncated").get<bool>();
  request.options.orientation = json.at("orientation").get<std::string>();
  request.options.frame_count = json.at("frame_count").get<int>();
  request.entries = json.at("entries").get<std::vector<std::size_t>>();
  request.thumbnails = json.at("thumbnails").get<bool>();
  if (json.contains("grid_spacing_mm"))
    request.options.grid_spacing_mm = json.at("grid_spacing_mm").get<double>();
  if (json.contains("frame")) request.options.frame = json.at("frame").get<int>();
  if (json.contains("spacing_mm"))
    request.options.spacing_mm = json.at("spacing_mm").get<std::array<double, 3>>();
  for (std::size_t from = line_end + 1; from < bytes.size();) {
    const std::size_t to = bytes.find('\0', from);
    request.paths.emplace_back(bytes.substr(from, to - from));
    from = to + 1;
  }
  return request;
}

std::optional<ReaderTask> task_of(const std::string& word) {
  if (word == "--read") return ReaderTask::read;
  if (word == "--scan") return ReaderTask::scan;
  if (word == "--describe") return ReaderTask::describe;
  return std::nullopt;
}

std::shared_ptr<float> shared_voxels(std::size_t count) {
  const std::size_t bytes = count * sizeof(float);
  if (ftruncate(voxels_fd, static_cast<off_t>(bytes)) != 0) throw std::bad_alloc();
  void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, voxels_fd, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  return {static_cast<float*>(memory), [bytes](float* voxels) { munmap(voxels, bytes); }};
}

core::Progress progress_to_parent() {
  return core::Progress(
      [](double fraction, const std::string& what) {
        send({{"progress", fraction}, {"what", what}});
      },
      {});
}

/// Tells the parent what to say should the process die from here on.
void tell_risk(const std::filesystem::path& path, const std::string& text) {
  send({{"risk", text.empty() ? std::string() : path.string() + " " + text}});
}

nlohmann::json error_json(const core::Error& error) {
  return {{"code", error.code()}, {"text", error.what()}, {"details", error.details()}};
}

/// What a library throws is told in words of this program.
core::Error unexpected(const std::filesystem::path& path, const std::exception& error) {
  return {core::ErrorKind::input, "unsupported",
          path.string() + " cannot be read. Export the scan again, or as MetaImage or NRRD.", error.what()};
}

Parsed parse(const std::vector<std::filesystem::path>& paths, const Context& context) {
  return paths.size() == 1 ? parse_file(paths.front(), context) : parse_dicom(paths, context);
}

void do_read(const ReaderRequest& request, std::size_t memory_bytes) {
  const core::Progress progress = progress_to_parent();
  const Context context{request.options, progress, shared_voxels, memory_bytes, false, tell_risk};
  const Parsed parsed = parse(request.paths, context);
  send({{"result",
         {{"volume", to_json(parsed.info)},
          {"first_frame", parsed.first_frame},
          {"kept_frames", parsed.kept_frames}}}});
}

std::shared_ptr<float> own_voxels(std::size_t count) {
  const auto owner = std::make_shared<std::vector<float>>(count);
  return {owner, owner->data()};
}

/// A picture of the entry's middle, as an item of its own: decoding it may end the process.
void send_thumbnail(const std::vector<std::filesystem::path>& paths, int frames, const ReaderRequest& request,
                    std::size_t memory_bytes) {
  ReadOptions options = request.options;
  options.frame = paths.size() == 1 ? frames / 2 : 0;
  // A finer grid of a scan in polar coordinates would be made for nothing.
  constexpr double coarse_mm = 1.0;
  if (!options.grid_spacing_mm) options.grid_spacing_mm = coarse_mm;
  const core::Progress silent;
  const Context context{options, silent, own_voxels, memory_bytes, false, tell_risk};
  try {
    const Parsed parsed = parse({paths[paths.size() / 2]}, context);
    const SmallPicture picture = small_picture(parsed.voxels.get(), parsed.info.geometry);
    send({{"item",
           {{"width", picture.width_px}, {"height", picture.height_px}, {"grey", hex_of(picture.grey)}}}});
  } catch (const core::Error& error) {
    send({{"item", {{"picture_error", error_json(error)}}}});
  } catch (const std::exception& error) {
    if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr) throw;
    send({{"item", {{"picture_error", error_json(unexpected(paths.front(), error))}}}});
  }
  tell_risk({}, {});
}

void do_describe(const ReaderRequest& request, std::size_t memory_bytes) {
  const core::Progress silent;
  const Context context{request.options, silent, own_voxels, memory_bytes, true, tell_risk};
  std::size_t from = 0;
  for (const std::size_t count : request.entries) {
    const std::vector<std::filesystem::path> paths(
        request.paths.begin() + static_cast<std::ptrdiff_t>(from),
        request.paths.begin() + static_cast<std::ptrdiff_t>(from + count));
    from += count;
    int frames = 0;
    try {
      const core::VolumeInfo info = parse(paths, context).info;
      frames = info.frames;
      send({{"item", {{"volume", to_json(info)}}}});
    } catch (const core::Error& error) {
      send({{"item", {{"error", error_json(error)}}}});
    } catch (const std::exception& error) {
      if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr) throw;
      send({{"item", {{"error", error_json(unexpected(paths.front(), error))}}}});
    }
    tell_risk({}, {});
    if (frames > 0 && request.thumbnails) send_thumbnail(paths, frames, request, memory_bytes);
  }
  send({{"result", {{"sandbox", sandbox_state()}}}});
}

void do_scan(const ReaderRequest& request) {
  nlohmann::json files = nlohmann::json::array();
  for (const auto& path : request.paths) {
    const DicomGlance seen = glance(path);
    files.push_back({{"dicom", seen.dicom},
                     {"image", seen.image},
                     {"slice", seen.slice},
                     {"series_uid", seen.series_uid},
                     {"instance_uid", seen.instance_uid},
                     {"modality", seen.modality},
                     {"size", seen.size},
                     {"localizer", seen.localizer},
                     {"axes", seen.axes}});
  }
  send({{"result", {{"files", files}}}});
}

}  // namespace
}  // namespace reading

core::VolumeSequence parse_unprotected(const std::filesystem::path& path, const ReadOptions& options,
                                       const core::Progress& progress) {
  reading::Parsed parsed =
      reading::parse_file(path, {options, progress, reading::own_voxels, ReaderLimits{}.memory_bytes});
  core::VolumeSequence sequence;
  sequence.first_frame = parsed.first_frame;
  const std::size_t frame_voxels = parsed.info.geometry.voxel_count();
  for (int n = 0; n < parsed.kept_frames; ++n)
    sequence.frames.emplace_back(
        parsed.info.geometry,
        std::shared_ptr<const float>(parsed.voxels,
                                     parsed.voxels.get() + static_cast<std::size_t>(n) * frame_voxels));
  reading::take_range(sequence.frames, parsed.info);
  sequence.info = std::move(parsed.info);
  return sequence;
}

int reader_main(int argc, char** argv) {
  using namespace reading;
  constexpr int usage = 2;
  const std::vector<std::string> words(argv, argv + argc);
  const auto memory = words.size() == 5 ? whole_number(words[2]) : std::nullopt;
  const auto cpu_s = words.size() == 5 ? whole_number(words[3]) : std::nullopt;
  const auto parent = words.size() == 5 ? whole_number(words[4]) : std::nullopt;
  const auto task = words.size() == 5 ? task_of(words[1]) : std::nullopt;
  if (!task || !memory || !cpu_s || !parent || *memory < 1 || *cpu_s < 1) {
    std::cerr << "palpate-reader is started by Palpate to read files; it is of no use by itself.\n";
    return usage;
  }
  // It ends with the thread that waits for it, and leaves no picture of its memory.
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != static_cast<pid_t>(*parent)) return usage;
  prctl(PR_SET_DUMPABLE, 0);
  take_limits(static_cast<std::size_t>(*memory), *cpu_s);
  enter_sandbox();
  std::set_new_handler(out_of_memory);
  try {
    const ReaderRequest request = take_request(*task);
    if (*task == ReaderTask::scan)
      do_scan(request);
    else if (*task == ReaderTask::describe)
      do_describe(request, static_cast<std::size_t>(*memory));
    else
      do_read(request, static_cast<std::size_t>(*memory));
  } catch (const core::Error& error) {
    send({{"error", error_json(error)}});
  } catch (const std::bad_alloc&) {
    out_of_memory();
  } catch (const std::exception& error) {
    send({{"error", error_json(unexpected("The file", error))}});
  }
  // The libraries' own clean-up is one more place to crash in.
  std::_Exit(0);
}

}  // namespace palpate::imaging
