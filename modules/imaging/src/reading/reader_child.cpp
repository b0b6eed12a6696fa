// The child's side: runs in palpate-reader only.
#include "info_json.hpp"
#include "parsed.hpp"
#include "process.hpp"
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

struct Request {
  ReadOptions options;
  std::vector<std::filesystem::path> paths;
};

Request take_request() {
  std::string bytes;
  std::array<char, 65536> block{};
  for (;;) {
    const ssize_t count = ::read(request_fd, block.data(), block.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    bytes.append(block.data(), static_cast<std::size_t>(count));
  }
  Request request;
  const auto line_end = bytes.find('\n');
  const auto json = nlohmann::json::parse(bytes.substr(0, line_end));
  request.options.series_uid = json.at("series_uid").get<std::string>();
  request.options.allow_truncated = json.at("allow_truncated").get<bool>();
  request.options.orientation = json.at("orientation").get<std::string>();
  request.options.frame_count = json.at("frame_count").get<int>();
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

void do_read(const Request& request, std::size_t memory_bytes) {
  const core::Progress progress = progress_to_parent();
  const Context context{request.options, progress, shared_voxels, memory_bytes};
  const Parsed parsed = request.paths.size() == 1 ? parse_file(request.paths.front(), context)
                                                  : parse_dicom(request.paths, context);
  send({{"result",
         {{"volume", to_json(parsed.info)},
          {"first_frame", parsed.first_frame},
          {"kept_frames", parsed.kept_frames}}}});
}

void do_scan(const Request& request) {
  nlohmann::json files = nlohmann::json::array();
  for (const auto& path : request.paths) {
    const DicomGlance seen = glance(path);
    files.push_back({{"dicom", seen.dicom},
                     {"image", seen.image},
                     {"slice", seen.slice},
                     {"series_uid", seen.series_uid},
                     {"instance_uid", seen.instance_uid},
                     {"modality", seen.modality},
                     {"size", seen.size}});
  }
  send({{"result", {{"files", files}}}});
}

}  // namespace
}  // namespace reading

core::VolumeSequence parse_unprotected(const std::filesystem::path& path, const ReadOptions& options,
                                       const core::Progress& progress) {
  const reading::AllocateVoxels on_heap = [](std::size_t count) {
    const auto owner = std::make_shared<std::vector<float>>(count);
    return std::shared_ptr<float>(owner, owner->data());
  };
  reading::Parsed parsed =
      reading::parse_file(path, {options, progress, on_heap, ReaderLimits{}.memory_bytes});
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
  if (!memory || !cpu_s || !parent || *memory < 1 || *cpu_s < 1 ||
      (words[1] != "--read" && words[1] != "--scan")) {
    std::cerr << "palpate-reader is started by Palpate to read files; it is of no use by itself.\n";
    return usage;
  }
  // It ends with the thread that waits for it, and leaves no picture of its memory.
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != static_cast<pid_t>(*parent)) return usage;
  prctl(PR_SET_DUMPABLE, 0);
  take_limits(static_cast<std::size_t>(*memory), *cpu_s);
  std::set_new_handler(out_of_memory);
  try {
    const Request request = take_request();
    if (words[1] == "--scan")
      do_scan(request);
    else
      do_read(request, static_cast<std::size_t>(*memory));
  } catch (const core::Error& error) {
    send({{"error", {{"code", error.code()}, {"text", error.what()}, {"details", error.details()}}}});
  } catch (const std::bad_alloc&) {
    out_of_memory();
  } catch (const std::exception& error) {
    send({{"error",
           {{"code", "unsupported"},
            {"text", "The file cannot be read. Export the scan again, or as MetaImage or NRRD."},
            {"details", error.what()}}}});
  }
  // The libraries' own clean-up is one more place to crash in.
  std::_Exit(0);
}

}  // namespace palpate::imaging
