#include "dicom_calibration.hpp"

#include "text_header.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>

namespace palpate::imaging::reading {
namespace {

using core::Provenance;
using PixelSize = std::array<double, 2>;

std::string shown(const PixelSize& size) {
  std::ostringstream text;
  text << size[0] << " x " << size[1] << " mm";
  return text.str();
}

bool same(const PixelSize& a, const PixelSize& b, double relative) {
  return std::abs(a[0] / b[0] - 1.0) <= relative && std::abs(a[1] / b[1] - 1.0) <= relative;
}

/// "row\column" distances as i and j; none where one is no size.
std::optional<PixelSize> spacing_in(const DicomItem& dataset, DicomTag tag) {
  const auto rows_columns = dataset.numbers(tag);
  if (rows_columns.size() != 2 || !is_voxel_size(rows_columns[0]) || !is_voxel_size(rows_columns[1]))
    return std::nullopt;
  return PixelSize{rows_columns[1], rows_columns[0]};
}

/// A region's pixel in mm; none for regions that are no place: spectra,
/// M-modes, curves, graphics, or axes in anything but centimetres.
std::optional<PixelSize> region_pixel(const DicomItem& region) {
  constexpr double centimetres = 3.0;
  constexpr double two_dimensional = 1.0;
  constexpr double mm_a_cm = 10.0;
  const auto is = [&](DicomTag tag, double wanted) {
    const auto found = region.number(tag);
    return found && *found == wanted;
  };
  if (region.has({0x0018, 0x6012}) && !is({0x0018, 0x6012}, two_dimensional)) return std::nullopt;
  if (!is({0x0018, 0x6024}, centimetres) || !is({0x0018, 0x6026}, centimetres)) return std::nullopt;
  const auto x = region.number({0x0018, 0x602C});
  const auto y = region.number({0x0018, 0x602E});
  if (!x || !y) return std::nullopt;
  // A negative step only says which way the region's axis points.
  const PixelSize size{std::abs(*x) * mm_a_cm, std::abs(*y) * mm_a_cm};
  if (!is_voxel_size(size[0]) || !is_voxel_size(size[1])) return std::nullopt;
  return size;
}

/// Every size that the regions give, each once.
std::vector<PixelSize> region_pixels(const DicomItem& dataset) {
  constexpr double one_scale = 1e-4;  // relative: scales come in many digits or are not the same
  std::vector<PixelSize> sizes;
  for (const auto& region : dataset.items({0x0018, 0x6011})) {
    const auto size = region_pixel(region);
    if (size && std::none_of(sizes.begin(), sizes.end(),
                             [&](const PixelSize& other) { return same(*size, other, one_scale); }))
      sizes.push_back(*size);
  }
  return sizes;
}

/// Increments from the frame before, as written or made of times from the start.
std::optional<std::vector<double>> vector_times_ms(const std::vector<double>& vector, CineTimes& times) {
  const auto negative = [](double value) { return value < 0.0; };
  if (std::any_of(vector.begin() + 1, vector.end(), negative)) {
    times.warnings.push_back(
        {"bad-frame-times", "The file's frame time vector runs backwards; it is not used."});
    return std::nullopt;
  }
  // Increments of a cine hardly change; ever growing ones are times from the
  // start that somebody put there, as steady as the steps between them.
  constexpr std::size_t enough = 4;
  const double first_step = vector.size() >= enough ? vector[2] - vector[1] : 0.0;
  bool cumulative = vector.size() >= enough && first_step > 0.0 && vector[0] < vector[1];
  for (std::size_t n = 1; n < vector.size() && cumulative; ++n)
    cumulative = std::abs(vector[n] - vector[n - 1] - first_step) < 0.25 * first_step;
  std::vector<double> ms(vector.size(), 0.0);
  for (std::size_t n = 1; n < vector.size(); ++n)
    ms[n] = cumulative ? vector[n] - vector[0] : ms[n - 1] + vector[n];
  if (cumulative)
    times.warnings.push_back({"cumulative-frame-times",
                              "The file's frame time vector grows steadily; it was taken for times from the "
                              "start, not for steps."});
  if (!(ms.back() > 0.0)) return std::nullopt;
  return ms;
}

}  // namespace

bool is_voxel_size(double mm) { return mm >= 1e-6 && mm <= 1e3; }

Calibration calibrate(const DicomItem& dataset) {
  Calibration result;
  const auto stated = spacing_in(dataset, {0x0028, 0x0030});
  const auto regions = region_pixels(dataset);
  if (regions.size() > 1) {
    std::string sizes;
    for (const auto& size : regions) sizes += (sizes.empty() ? "" : ", ") + shown(size);
    result.warnings.push_back({"several-regions", "The picture holds regions of different scale (pixels of " +
                                                      sizes + "); no size of a pixel holds for all of it."});
    return result;
  }
  if (regions.size() == 1) {
    result.pixel_mm = regions.front();
    result.provenance = Provenance::stated;
    constexpr double rounding = 0.01;  // relative
    if (stated && !same(*stated, regions.front(), rounding))
      result.warnings.push_back({"spacing-conflict", "The ultrasound region says pixels of " +
                                                         shown(regions.front()) + ", Pixel Spacing says " +
                                                         shown(*stated) + "; the region's were taken."});
    return result;
  }
  if (stated) {
    result.pixel_mm = stated;
    result.provenance = Provenance::stated;
    return result;
  }
  // At the detector or on the film: the magnification is not known.
  for (const DicomTag tag : {DicomTag{0x0018, 0x1164}, DicomTag{0x0018, 0x2010}}) {
    result.pixel_mm = spacing_in(dataset, tag);
    if (!result.pixel_mm) continue;
    result.provenance = Provenance::derived;
    return result;
  }
  return result;
}

CineTimes cine_times(const DicomItem& dataset, int frames) {
  CineTimes times;
  if (frames < 2) return times;
  const auto vector = dataset.numbers({0x0018, 0x1065});
  const bool whole = static_cast<int>(vector.size()) == frames;
  if (dataset.has({0x0018, 0x1065}) && !vector.empty() && !whole)
    times.warnings.push_back({"bad-frame-times", "The file's frame time vector has " +
                                                     std::to_string(vector.size()) + " entries for " +
                                                     std::to_string(frames) + " frames; it is not used."});
  const auto step_ms = dataset.number({0x0018, 0x1063});
  const bool even = step_ms && *step_ms > 0.0;
  constexpr double ms_a_s = 1000.0;
  // Which of the two holds, where both are there, the increment pointer says.
  const bool even_first = even && lower_case(dataset.text({0x0028, 0x0009})) == "(0018,1063)";
  if (whole && !even_first)
    if (const auto ms = vector_times_ms(vector, times)) {
      for (const double time : *ms) times.frame_times_s.push_back(time / ms_a_s);
      times.provenance = Provenance::stated;
      return times;
    }
  if (even) {
    for (int frame = 0; frame < frames; ++frame) times.frame_times_s.push_back(frame * *step_ms / ms_a_s);
    times.provenance = Provenance::stated;
    return times;
  }
  // A rate to show them at is as a rule the rate they were taken at; only as a rule.
  for (const DicomTag tag : {DicomTag{0x0018, 0x0040}, DicomTag{0x0008, 0x2144}}) {
    const auto rate_hz = dataset.number(tag);
    if (!rate_hz || !(*rate_hz > 0.0)) continue;
    for (int frame = 0; frame < frames; ++frame) times.frame_times_s.push_back(frame / *rate_hz);
    times.provenance = Provenance::derived;
    return times;
  }
  return times;
}

}  // namespace palpate::imaging::reading
