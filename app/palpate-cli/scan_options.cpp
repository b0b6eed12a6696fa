#include "scan_options.hpp"

#include "values.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <system_error>
#include <utility>

namespace palpate::cli {
namespace {

model::CropBox parse_crop(const std::string& text) {
  const auto ranges = split(text, ',');
  if (ranges.size() != 3)
    core::throw_usage("three voxel ranges I0:I1,J0:J1,K0:K1 are needed, not \"" + text + "\".");
  model::CropBox box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto ends = split(ranges[axis], ':');
    if (ends.size() != 2) core::throw_usage("a range is FIRST:END, not \"" + ranges[axis] + "\".");
    constexpr int most = std::numeric_limits<int>::max();
    box.begin[axis] = static_cast<int>(parse_whole(ends[0], 0, most));
    box.end[axis] = static_cast<int>(parse_whole(ends[1], 0, most));
    if (box.begin[axis] >= box.end[axis])
      core::throw_usage("the range \"" + ranges[axis] +
                        "\" is empty; its end must lie beyond its first voxel.");
  }
  return box;
}

/// In capitals; empty for "file".
std::string parse_orientation(const std::string& text) {
  std::string word = text;
  for (char& letter : word) letter = static_cast<char>(std::toupper(static_cast<unsigned char>(letter)));
  if (word == "FILE") return {};
  const auto times = [&](const char* pair) {
    return std::count_if(word.begin(), word.end(),
                         [&](char letter) { return letter == pair[0] || letter == pair[1]; });
  };
  if (word.size() != 3 || times("LR") != 1 || times("PA") != 1 || times("SI") != 1)
    core::throw_usage(
        "\"file\" is needed, or where i, j and k point to, by one letter each of L or R, P or A, S or I, "
        "such as LPS or RAS, not \"" +
        text + "\".");
  return word;
}

void parse_threshold(const std::string& text, model::TissueParameters& tissue) {
  constexpr double most = 1e12;
  const auto ends = split(text, ':');
  if (ends.size() > 2) core::throw_usage("LOW or LOW:HIGH is needed, not \"" + text + "\".");
  const double low = parse_number(ends[0], -most, most);
  tissue.threshold_low = low;
  tissue.threshold_high = std::numeric_limits<double>::infinity();
  if (ends.size() == 1) return;
  tissue.threshold_high = parse_number(ends[1], -most, most);
  if (tissue.threshold_high < low)
    core::throw_usage("the upper threshold lies below the lower one in \"" + text + "\".");
}

/// FILE, or FILE:LABEL where no file is called all of that.
session::MaskSettings parse_mask(const std::string& text) {
  if (text.empty()) core::throw_usage("FILE or FILE:LABEL is needed; an empty name is not accepted.");
  session::MaskSettings mask;
  mask.path = text;
  std::error_code ignored;
  const auto colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0 || std::filesystem::exists(text, ignored)) return mask;
  const std::string label = text.substr(colon + 1);
  const std::string digits = label.rfind('-', 0) == 0 ? label.substr(1) : label;
  if (digits.empty() || digits.find_first_not_of("0123456789") != std::string::npos) return mask;
  constexpr int most = 1000000000;
  mask.label = static_cast<int>(parse_whole(label, -most, most));
  mask.path = text.substr(0, colon);
  return mask;
}

const std::vector<std::string> link_words{"six", "nearest", "lattice18", "lattice26"};

}  // namespace

void add_reading_options(OptionSet& options, ScanOptions& scan) {
  auto& input = scan.recipe.input;
  options.section("Scan");
  options.text("--series", "UID", "the series to take where a folder holds several", input.series_uid);
  options.value("--frame", "K", "the frame to take, counted from 0 (default 0)",
                [&](const std::string& text) {
                  input.frame = static_cast<int>(parse_whole(text, 0, 1000000));
                  scan.frame_given = true;
                });
  options.value("--spacing", "X,Y,Z", "voxel spacing in mm, instead of what the file says",
                [&](const std::string& text) { input.spacing_mm = parse_three(text, 1e-6, 1e6); });
  options.flag("--allow-truncated", "read a file that ends too early; what is missing is zero",
               input.allow_truncated);
  options.value(
      "--orientation", "NAME",
      "where i, j and k point to, such as LPS or RAS, instead of what the file says (default: file)",
      [&](const std::string& text) { input.orientation = parse_orientation(text); });
  options.value(
      "--grid-spacing", "MM",
      "voxels of the grid that a scan in polar coordinates is turned into (default: its finest)",
      [&](const std::string& text) { input.grid_spacing_mm = parse_number(text, 0.01, 100.0, "mm"); });
}

void add_scan_options(OptionSet& options, ScanOptions& scan) {
  add_reading_options(options, scan);
  options.value("--filter", "NAME[:key=value,...]", "a filter; repeat it for a chain (see filter --list)",
                [&](const std::string& text) {
                  if (!std::exchange(scan.filters_given, true)) scan.recipe.filters.clear();
                  scan.recipe.filters.push_back(imaging::parse_filter(text));
                });
  options.value("--crop", "I0:I1,J0:J1,K0:K1", "only these voxels; the ends are not included",
                [&](const std::string& text) { scan.recipe.tissue.crop = parse_crop(text); });
}

void add_tissue_options(OptionSet& options, ScanOptions& scan) {
  auto& tissue = scan.recipe.tissue;
  options.section("Tissue");
  options.value("--threshold", "LOW[:HIGH]",
                "voxels that are tissue (default: Otsu's threshold and above, or all of the mask)",
                [&](const std::string& text) { parse_threshold(text, tissue); });
  options.value("--mask", "FILE[:LABEL]",
                "a label image: tissue is where it has this label, or any but 0; with --threshold, both",
                [&](const std::string& text) { scan.recipe.mask = parse_mask(text); });
  options.value("--points", "lattice|blue-noise",
                "a point a voxel, or as many spread evenly without a lattice (default lattice)",
                [&](const std::string& text) {
                  const auto word = parse_choice(text, {"lattice", "blue-noise"});
                  tissue.points =
                      word == "lattice" ? model::PointRule::lattice : model::PointRule::blue_noise;
                });
  options.value(
      "--stride", "N", "every N-th voxel along each axis (default 1)",
      [&](const std::string& text) { tissue.stride = static_cast<int>(parse_whole(text, 1, 1024)); });
  options.value("--noise", "A", "random shift of each point, in parts of the spacing, 0 to 0.5 (default 0.1)",
                [&](const std::string& text) { tissue.noise = parse_number(text, 0.0, 0.5); });
  options.value("--seed", "S", "of the random shift (default 1)",
                [&](const std::string& text) { tissue.seed = parse_seed(text); });
  options.value("--links", "six|nearest|lattice18|lattice26",
                "mutual nearest points, or the 6, 18 or 26 neighbours on the lattice (default nearest)",
                [&](const std::string& text) {
                  const auto word = parse_choice(text, link_words);
                  const auto place = std::find(link_words.begin(), link_words.end(), word);
                  tissue.links = static_cast<model::LinkRule>(place - link_words.begin());
                });
  options.value(
      "--max-links", "N", "nearest points that count for --links nearest, 1 to 64 (default 12)",
      [&](const std::string& text) { tissue.max_links = static_cast<int>(parse_whole(text, 1, 64)); });
  options.value("--min-component", "N", "pieces with fewer points are dropped (default 1)",
                [&](const std::string& text) {
                  tissue.min_component =
                      static_cast<std::size_t>(parse_whole(text, 0, std::int64_t{1} << 40));
                });
}

void take_path(ScanOptions& scan, const std::string& command) {
  if (!scan.paths.empty()) scan.recipe.input.path = scan.paths.front();
  if (scan.recipe.input.path.empty())
    core::throw_usage(command + " needs a scan: a file or a folder. See palpate-cli " + command + " --help.");
  const auto& tissue = scan.recipe.tissue;
  if (tissue.points == model::PointRule::blue_noise && tissue.links != model::LinkRule::nearest)
    core::throw_usage(
        "--links: points without a lattice (--points blue-noise) are linked by nearest only, not by " +
        link_words[static_cast<std::size_t>(tissue.links)] + ".");
}

imaging::ReadOptions read_options(const ScanOptions& scan) {
  const auto& input = scan.recipe.input;
  imaging::ReadOptions options;
  options.series_uid = input.series_uid;
  if (scan.frame_given) options.frame = input.frame;
  options.spacing_mm = input.spacing_mm;
  options.orientation = input.orientation;
  options.grid_spacing_mm = input.grid_spacing_mm;
  options.allow_truncated = input.allow_truncated;
  return options;
}

Prepared prepare_volume(ScanOptions& scan, Console& console, const core::Progress& progress) {
  auto& input = scan.recipe.input;
  Prepared prepared;
  auto sequence = session::read_input(input, progress.part(0.0, 0.6));
  // After reading, so that a missing file is told in the reader's words.
  const auto sum = session::file_sha256(input.path, progress.part(0.6, 0.7));
  if (!input.sha256.empty() && input.sha256 != sum)
    console.warn(
        "input-changed",
        input.path.string() + " is not the file that the recipe was made with: its checksum differs.");
  input.sha256 = sum;
  prepared.info = std::move(sequence.info);
  console.warn(prepared.info.warnings);
  auto filtered = session::filter_volume(sequence.frames.front(), scan.recipe.filters, scan.filter_options,
                                         progress.part(0.7, 1.0));
  console.warn(filtered.warnings);
  prepared.filtered = std::move(filtered.volume);
  return prepared;
}

Prepared prepare_tissue(ScanOptions& scan, Console& console, const core::Progress& progress) {
  Prepared prepared = prepare_volume(scan, console, progress.part(0.0, 0.5));
  prepared.tissue = session::build_tissue(prepared.filtered, scan.recipe, progress.part(0.5, 0.97));
  console.warn(prepared.tissue.warnings);
  // After reading, so that a missing file is told in the reader's words.
  console.warn(session::note_label_checksums(scan.recipe, progress.part(0.97, 1.0)));
  return prepared;
}

void prepare_surface(Prepared& prepared, const ScanOptions& scan, bool needed, Console& console,
                     const core::Progress& progress) {
  try {
    prepared.surface = session::build_surface(prepared.filtered, prepared.tissue, scan.recipe, progress);
  } catch (const core::Error& error) {
    if (needed || error.kind() != core::ErrorKind::input) throw;
    console.warn(error.code(), std::string("Shown without a surface. ") + error.what());
  }
}

Json list_of(const Eigen::Vector3d& vector) {
  return Json::array({number(vector.x()), number(vector.y()), number(vector.z())});
}

}  // namespace palpate::cli
