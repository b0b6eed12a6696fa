// What it costs that files are parsed in another process.
#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <functional>
#include <vector>

namespace palpate::imaging {
namespace {

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// 32-bit voxels in slices of 512 x 512 that differ, so that no page is like another.
std::size_t write_scan(const std::filesystem::path& path, std::size_t bytes) {
  constexpr std::size_t side = 512;
  constexpr std::size_t slice = side * side;
  const std::size_t slices = std::max<std::size_t>(1, bytes / (slice * sizeof(float)));
  std::ofstream file(path, std::ios::binary);
  file << "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nElementSpacing "
          "= 1 1 1\n"
       << "DimSize = " << side << " " << side << " " << slices
       << "\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n";
  std::vector<float> voxels(slice);
  std::uint32_t number = 1;
  for (std::size_t k = 0; k < slices; ++k) {
    for (float& voxel : voxels) {
      number = 1664525U * number + 1013904223U;
      voxel = static_cast<float>(number >> 8);
    }
    file.write(reinterpret_cast<const char*>(voxels.data()),
               static_cast<std::streamsize>(slice * sizeof(float)));
  }
  file.close();
  if (!file)
    throw core::Error(
        core::ErrorKind::output, "not-written",
        path.string() + " cannot be written: is there room for " + std::to_string(bytes >> 20) + " MB?");
  return slices * slice * sizeof(float);
}

}  // namespace

HandoverTiming measure_handover(const std::filesystem::path& folder, std::size_t bytes,
                                const core::Progress& progress) {
  const auto path = folder / "handover.mha";
  HandoverTiming timing;
  timing.bytes = write_scan(path, bytes);
  constexpr std::size_t runs = 3;
  std::array<double, runs> here{};
  std::array<double, runs> there{};
  for (std::size_t n = 0; n < runs; ++n) {
    progress.report(static_cast<double>(n) / runs, "Reading in this process and in another");
    here[n] = seconds_of([&] { parse_unprotected(path, {}, {}); });
    there[n] = seconds_of([&] { read(path, {}, core::Progress({}, progress.cancel())); });
  }
  std::filesystem::remove(path);
  std::sort(here.begin(), here.end());
  std::sort(there.begin(), there.end());
  timing.read_s = here[runs / 2];
  timing.handover_s = there[runs / 2] - here[runs / 2];
  return timing;
}

}  // namespace palpate::imaging
