#include "cli_support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

using namespace palpate::testing;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

namespace {

struct Csv {
  Words header;
  std::vector<std::vector<double>> rows;
};

Csv read_csv(const fs::path& path) {
  std::ifstream file(path);
  Csv csv;
  std::string line;
  std::getline(file, line);
  std::istringstream names(line);
  for (std::string name; std::getline(names, name, ',');) csv.header.push_back(name);
  while (std::getline(file, line)) {
    csv.rows.emplace_back();
    std::istringstream fields(line);
    for (std::string field; std::getline(fields, field, ',');)
      csv.rows.back().push_back(field.empty() ? std::nan("") : std::stod(field));
  }
  return csv;
}

/// The size that a PNG says it has.
std::array<int, 2> png_size(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<unsigned char, 24> head{};
  file.read(reinterpret_cast<char*>(head.data()), head.size());
  if (!file || head[0] != 0x89 || head[1] != 'P') return {0, 0};
  const auto number = [&](std::size_t at) {
    return head[at] << 24 | head[at + 1] << 16 | head[at + 2] << 8 | head[at + 3];
  };
  return {number(16), number(20)};
}

std::set<std::string> files_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename().string());
  return names;
}

const Words names{"integrator-euler", "integrator-verlet",   "integrator-rk4", "recovery-links",
                  "recovery-noise",   "time-by-points",      "time-by-links",  "noise",
                  "stiffness",        "stability-stiffness", "stability-links"};

}  // namespace

TEST(CliExperiment, ListsWhatItHas) {
  const auto object = cli_json({"experiment", "list"});
  Words listed;
  for (const auto& one : object["experiments"]) listed.push_back(one["name"]);
  EXPECT_EQ(listed, names);
  const auto text = cli({"experiment", "list"});
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_THAT(text.out, HasSubstr("figure 13"));
}

TEST(CliExperiment, WritesNumbersAndPictures) {
  const TemporaryFolder folder;
  const fs::path out = folder / "new/figures";
  const auto object = cli_json({"experiment", "integrator-rk4", "-o", out.string()});
  EXPECT_EQ(object["device"], "reference") << "nothing else is needed for this one";
  const auto& one = object["experiments"][0];
  EXPECT_EQ(one["name"], "integrator-rk4");
  EXPECT_EQ(one["figure"], "figure 3");
  std::set<std::string> said;
  for (const auto& file : one["files"]) said.insert(file);
  EXPECT_EQ(files_in(out), said) << "and nothing else";
  EXPECT_EQ(said, (std::set<std::string>{"integrator-rk4.csv", "integrator-rk4.png",
                                         "integrator-rk4-error.csv", "integrator-rk4-error.png"}));
  EXPECT_EQ(png_size(out / "integrator-rk4.png"), (std::array<int, 2>{1200, 800}));
  const Csv csv = read_csv(out / "integrator-rk4.csv");
  EXPECT_EQ(csv.header, (Words{"step (s)", "time (s)", "exact (mm)", "rk4 (mm)"}));
  ASSERT_EQ(csv.rows.size(), 4001U + 401U + 41U + 11U);
  // e^(-1.5) (5 cos w + 7.5/w sin w), w^2 = 42.75, and four steps of 0.4 s by hand;
  // ten digits are written, and the state is in single precision.
  EXPECT_NEAR(csv.rows.at(1000).at(2), 1.1441304804480696, 1e-9);
  EXPECT_NEAR(csv.rows.at(1000).at(3), 1.1441304804480696, 3e-7);
  EXPECT_NEAR(csv.rows.at(4001 + 401 + 41 + 4).at(3), 0.06009880395776035, 3e-7);
  EXPECT_NEAR(one["findings"]["order-rk4"]["value"].get<double>(), 4.0, 0.1);
}

TEST(CliExperiment, FindsThatTheThresholdFallsWithTheSquareOfTheStep) {
  const TemporaryFolder folder;
  const auto object = cli_json({"experiment", "stability-stiffness", "--quick", "--device", "reference", "-o",
                                folder.path().string()});
  const Csv csv = read_csv(folder / "stability-stiffness.csv");
  ASSERT_EQ(csv.header.at(0), "step (s)");
  ASSERT_EQ(csv.header.at(1), "measured (s^-2)");
  ASSERT_EQ(csv.rows.size(), 3U);
  // 1/h^2, within what a run of 2 s leaves undecided: a few percent at the largest step.
  const double slope = std::log(csv.rows[2][1] / csv.rows[0][1]) / std::log(csv.rows[2][0] / csv.rows[0][0]);
  EXPECT_NEAR(slope, -2.0, 0.1);
  const auto& findings = object["experiments"][0]["findings"];
  for (const char* name : {"predicted-by-converged", "predicted-by-bound"}) {
    const double ratio = findings[name]["value"];
    EXPECT_GT(ratio, 0.65) << name;
    EXPECT_LE(ratio, 1.0) << name;
  }
}

TEST(CliExperiment, DrawsTheCubesToo) {
  const TemporaryFolder folder;
  cli_json({"experiment", "stiffness", "--quick", "--device", "reference", "-o", folder.path().string()});
  EXPECT_EQ(files_in(folder.path()),
            (std::set<std::string>{"stiffness.csv", "stiffness.png", "stiffness-cubes.png"}));
  EXPECT_NE(png_size(folder / "stiffness-cubes.png"), (std::array<int, 2>{0, 0}));
}

TEST(CliExperiment, TimesLayoutsOnADevice) {
  if (!opencl_present()) GTEST_SKIP() << "no OpenCL device";
  const TemporaryFolder folder;
  const auto object = cli_json({"experiment", "time-by-links", "--quick", "-o", folder.path().string()});
  EXPECT_NE(object["device"], "reference");
  const Csv csv = read_csv(folder / "time-by-links.csv");
  EXPECT_EQ(csv.header,
            (Words{"links asked for", "links a point", "lattice (s)", "explicit (s)", "published (s)"}));
  ASSERT_EQ(csv.rows.size(), 2U);
  for (const auto& row : csv.rows)
    for (const double value : row) EXPECT_GT(value, 0.0);
}

TEST(CliExperiment, RefusesWhatItCannotDo) {
  const TemporaryFolder folder;
  const auto unknown = cli({"experiment", "figure-12", "-o", folder.path().string()});
  EXPECT_EQ(unknown.exit_code, 2);
  for (const auto& name : names) EXPECT_THAT(unknown.error, HasSubstr(name));
  EXPECT_EQ(cli({"experiment"}).exit_code, 2);
  EXPECT_EQ(cli({"experiment", "list", "noise"}).exit_code, 2);
  const auto nowhere = cli({"experiment", "noise"});
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_THAT(nowhere.error, HasSubstr("-o DIR"));
  const auto reference =
      cli({"experiment", "time-by-links", "--device", "reference", "-o", folder.path().string()});
  EXPECT_EQ(reference.exit_code, 2);
  EXPECT_THAT(reference.error, HasSubstr("--device"));
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(CliExperiment, LeavesNothingWhereItCannotWrite) {
  const TemporaryFolder folder;
  write_file(folder / "file", "mine");
  for (const auto& place :
       {(folder / "file").string(), (folder / "file/below").string(), std::string("/proc/figures")}) {
    const auto result = cli({"experiment", "integrator-rk4", "-o", place});
    EXPECT_EQ(result.exit_code, 6) << place << result.error;
    EXPECT_THAT(result.error, HasSubstr(place));
  }
  EXPECT_EQ(files_in(folder.path()), (std::set<std::string>{"file"}));
  // A picture that cannot be put in its place takes the numbers with it.
  fs::create_directories(folder / "out/integrator-rk4.png");
  const auto blocked = cli({"experiment", "integrator-rk4", "-o", (folder / "out").string()});
  EXPECT_EQ(blocked.exit_code, 6) << blocked.error;
  EXPECT_EQ(files_in(folder / "out"), (std::set<std::string>{"integrator-rk4.png"}));
}
