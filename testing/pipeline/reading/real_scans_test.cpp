// Real scans: what real_scans.txt says of each, and a verdict for every file.
#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

namespace {

using palpate::core::Provenance;
using palpate::core::VolumeInfo;
using palpate::imaging::inspect;

std::vector<std::string> parts_of(const std::string& text, const std::string& between) {
  std::vector<std::string> parts;
  std::size_t from = 0;
  for (std::size_t to = text.find(between); to != std::string::npos; to = text.find(between, from)) {
    parts.push_back(text.substr(from, to - from));
    from = to + between.size();
  }
  parts.push_back(text.substr(from));
  return parts;
}

std::vector<double> numbers_of(const std::string& text) {
  std::istringstream words(text);
  std::vector<double> values;
  for (double value = 0.0; words >> value;) values.push_back(value);
  return values;
}

/// A line of real_scans.txt.
struct Row {
  std::string path;
  std::vector<std::string> outcomes, dims, frames;
  std::string spacing;
  std::vector<std::string> origins, directions;
  std::string times, range;
  double grey_levels = 0.0;  ///< that the voxels may be off
  std::string evidence;
};

std::vector<Row> table() {
  std::ifstream file(PALPATE_SCAN_TABLE);
  std::vector<Row> rows;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    const auto cells = parts_of(line, " | ");
    if (cells.size() != 11) throw std::runtime_error("a line of another length: " + line);
    const auto either = [](const std::string& cell) { return parts_of(cell, " or "); };
    rows.push_back({cells[0], either(cells[1]), either(cells[2]), either(cells[3]), cells[4],
                    either(cells[5]), either(cells[6]), cells[7], cells[8], std::stod(cells[9]), cells[10]});
  }
  return rows;
}

bool is_checked(const std::string& cell) { return cell != "-"; }

/// Numbers against a cell in which a dash stands for one that is not checked.
template <typename Values>
bool agree(const std::string& cell, const Values& values, double tolerance, double relative) {
  std::istringstream words(cell);
  std::size_t n = 0;
  for (std::string word; words >> word; ++n) {
    const auto value = static_cast<double>(values[static_cast<int>(n)]);
    if (word != "-" && std::abs(std::stod(word) - value) > tolerance + relative * std::abs(value))
      return false;
  }
  return n > 0;
}

template <typename Values>
bool agree_with_one(const std::vector<std::string>& cells, const Values& values, double tolerance,
                    double relative = 0.0) {
  return std::any_of(cells.begin(), cells.end(), [&](const std::string& cell) {
    return !is_checked(cell) || agree(cell, values, tolerance, relative);
  });
}

std::string shown(const Eigen::MatrixXd& matrix) {
  std::ostringstream text;
  text << matrix;
  return text.str();
}

void check_geometry(const Row& row, const VolumeInfo& info) {
  const auto& geometry = info.geometry;
  const auto& dims = geometry.dims();
  EXPECT_TRUE(agree_with_one(row.dims, dims, 0.0)) << dims[0] << " " << dims[1] << " " << dims[2];
  EXPECT_TRUE(std::any_of(row.frames.begin(), row.frames.end(), [&](const std::string& cell) {
    return !is_checked(cell) || std::stoi(cell) == info.frames;
  })) << info.frames;
  if (row.spacing == "assumed") {
    EXPECT_EQ(info.spacing_provenance[0], Provenance::assumed);
    EXPECT_EQ(geometry.spacing_mm()[0], 1.0);
  } else if (is_checked(row.spacing)) {
    // Headers carry six digits, and derived steps a difference of two such numbers.
    EXPECT_TRUE(agree(row.spacing, geometry.spacing_mm(), 0.0, 1e-5)) << geometry.spacing_mm().transpose();
    EXPECT_NE(info.spacing_provenance[0], Provenance::assumed);
  }
  EXPECT_TRUE(agree_with_one(row.origins, geometry.origin_mm(), 1e-4, 1e-6))
      << geometry.origin_mm().transpose();
  const Eigen::Matrix3d rows = geometry.direction().transpose();  // Eigen counts down the columns
  EXPECT_TRUE(
      agree_with_one(row.directions, Eigen::Map<const Eigen::Matrix<double, 9, 1>>(rows.data()), 1e-5))
      << shown(geometry.direction());
}

void check_times(const Row& row, const VolumeInfo& info) {
  if (!is_checked(row.times)) return;
  if (row.times == "none") {
    EXPECT_EQ(info.time_provenance, Provenance::absent);
    return;
  }
  ASSERT_EQ(static_cast<int>(info.frame_times_s.size()), info.frames);
  auto expected = numbers_of(row.times.substr(row.times.find(' ')));
  if (row.times.compare(0, 4, "step") == 0) {
    const double step = expected.at(0);
    expected.clear();
    for (int frame = 0; frame < info.frames; ++frame) expected.push_back(step * frame);
  }
  ASSERT_EQ(expected.size(), info.frame_times_s.size());
  for (std::size_t frame = 0; frame < expected.size(); ++frame)
    EXPECT_NEAR(info.frame_times_s[frame], expected[frame], 1e-6 + 1e-8 * expected[frame]) << frame;
}

void check_row(const Row& row, const std::filesystem::path& path) {
  palpate::imaging::ReaderLimits limits;
  limits.memory_bytes = std::size_t{2} << 30;
  limits.time_s = 60.0;
  std::string outcome = "ok";
  std::string text;
  VolumeInfo info;
  try {
    info = palpate::imaging::read(path, {}, {}, limits).info;
  } catch (const palpate::core::Error& error) {
    outcome = error.code();
    text = error.what();
  }
  EXPECT_NE(std::find(row.outcomes.begin(), row.outcomes.end(), outcome), row.outcomes.end())
      << outcome << ": " << text << "\nknown from: " << row.evidence;
  if (outcome != "ok") return;
  check_geometry(row, info);
  check_times(row, info);
  if (!is_checked(row.range)) return;
  // Voxels are 32-bit floats: seven digits, and sums of them in the mean.
  const std::array<double, 3> range{info.min, info.max, info.mean};
  const auto expected = numbers_of(row.range);
  ASSERT_EQ(expected.size(), 3U);
  for (std::size_t n = 0; n < 3; ++n)
    EXPECT_NEAR(range[n], expected[n],
                (n == 2 ? 0.1 : 1.0) * row.grey_levels + 1e-6 * std::abs(expected[n]) + 1e-5);
}

class RealScans : public ::testing::TestWithParam<std::string> {};

TEST_P(RealScans, AreWhatTheirEvidenceSays) {
  PALPATE_TEST_SCAN(index, "INDEX.md");
  std::size_t rows = 0;
  for (const Row& row : table()) {
    if (row.path.substr(0, row.path.find('/')) != GetParam()) continue;
    SCOPED_TRACE(row.path + "\nknown from: " + row.evidence);
    check_row(row, index.parent_path() / row.path);
    ++rows;
  }
  EXPECT_GT(rows, 0U);
}

INSTANTIATE_TEST_SUITE_P(Data, RealScans,
                         ::testing::Values("INDEX.md", "constructed", "dwv", "fodicom", "mesh", "nibabel",
                                           "orthanc", "pluslib", "pydicom", "pydicom-data", "series",
                                           "sofa"));

TEST(RealScansTable, HasARowForEveryFile) {
  PALPATE_TEST_SCAN(index, "INDEX.md");
  std::set<std::string> known;
  for (const Row& row : table()) known.insert(row.path);
  for (const auto& entry : std::filesystem::recursive_directory_iterator(index.parent_path())) {
    if (!entry.is_regular_file()) continue;
    const auto path = entry.path().lexically_relative(index.parent_path());
    EXPECT_TRUE(known.count(path.string()) == 1 || known.count(path.parent_path().string()) == 1) << path;
  }
}

TEST(RealScansTable, EveryFileEndsWithAVerdictOfTheFolder) {
  PALPATE_TEST_SCAN(index, "INDEX.md");
  palpate::imaging::ReaderLimits limits;
  limits.memory_bytes = std::size_t{2} << 30;
  limits.time_s = 60.0;
  const auto reports =
      inspect({index.parent_path() / "nibabel", index.parent_path() / "constructed"}, {}, {}, limits);
  EXPECT_EQ(reports.size(), 29U);
  for (const auto& report : reports) {
    EXPECT_TRUE(report.ok || (!report.error_code.empty() &&
                              report.error_text.find(report.path.filename().string()) != std::string::npos))
        << report.path << ": " << report.error_text;
    if (!report.ok) continue;
    const VolumeInfo& info = report.volumes.at(0);
    EXPECT_TRUE(std::isfinite(info.min) && std::isfinite(info.max) && info.min <= info.mean &&
                info.mean <= info.max)
        << report.path;
  }
}

}  // namespace
