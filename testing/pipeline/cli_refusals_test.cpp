#include "cli_support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

using namespace palpate::testing;
using nlohmann::json;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

namespace {

struct Refusal {
  Words arguments;
  const char* says;  ///< what the message must name
};

/// Gives what was said.
std::string expect_refused(const Refusal& refusal, int exit_code) {
  std::string line;
  for (const auto& word : refusal.arguments) line += " " + word;
  const auto result = cli(refusal.arguments);
  EXPECT_EQ(result.exit_code, exit_code) << line << "\n" << result.error;
  EXPECT_EQ(result.signal, 0) << line;
  EXPECT_THAT(result.error, HasSubstr(refusal.says)) << line;
  EXPECT_EQ(result.out, "") << line;
  return result.error;
}

}  // namespace

TEST(CliRefuses, WhatItDoesNotKnowAndNamesWhatItAccepts) {
  const std::string s = sample();
  const Refusal cases[] = {
      {{}, "a command is needed"},
      {{"paint"}, "simulate"},
      {{"devices", "--colour"}, "--device"},
      {{"devices", "here"}, "one too many"},
      {{"info"}, "info needs"},
      {{"model"}, "model needs"},
      {{"model", s, s}, "one too many"},
      {{"model", s, "--stride"}, "--stride needs a value"},
      {{"model", s, "--estimate=yes"}, "takes no value"},
      {{"model", s, "--stride", "0"}, "--stride: a whole number from 1"},
      {{"model", s, "--stride", "2x"}, "\"2x\""},
      {{"model", s, "--stride", "1.5"}, "--stride"},
      {{"model", s, "--noise", "nan"}, "--noise"},
      {{"model", s, "--noise", "0.6"}, "0 to 0.5"},
      {{"model", s, "--noise", " 0.1"}, "--noise"},
      {{"model", s, "--seed", "-1"}, "--seed"},
      {{"model", s, "--links", "eight"}, "six, nearest, lattice18, lattice26"},
      {{"model", s, "--points", "random"}, "lattice, blue-noise"},
      {{"model", s, "--points", "blue-noise", "--links", "six"}, "--links"},
      {{"model", s, "--mask", ""}, "FILE:LABEL"},
      {{"model", s, "--mask", "m.mha:99999999999"}, "--mask"},
      {{"model", s, "--max-links", "65"}, "1 to 64"},
      {{"model", s, "--max-links", "99999999999999999999"}, "--max-links"},
      {{"model", s, "--threshold", "60:"}, "--threshold"},
      {{"model", s, "--threshold", "60:50"}, "below the lower"},
      {{"model", s, "--threshold", "1:2:3"}, "LOW:HIGH"},
      {{"model", s, "--threshold", "inf"}, "--threshold"},
      {{"model", s, "--crop", "0:10,0:10"}, "--crop"},
      {{"model", s, "--crop", "0:10,0:10,5:5"}, "empty"},
      {{"model", s, "--crop", "0:10,0:10,-1:5"}, "--crop"},
      {{"model", s, "--spacing", "1,1"}, "X,Y,Z"},
      {{"model", s, "--spacing", "1,0,1"}, "--spacing"},
      {{"model", s, "--frame", "-1"}, "--frame"},
      {{"model", s, "--filter", "sharpen"}, "median"},
      {{"model", s, "--filter", "median:radius=x"}, "--filter"},
      {{"model", s, "-o", "points.txt"}, ".vtp"},
      {{"model", s, "--estimate", "-o", "points.vtp"}, "--estimate"},
      {{"filter", s}, "-o OUT"},
      {{"filter", s, "-o", "out.png"}, ".nrrd"},
      {{"filter", s, "-o", "out.mha", "--crop", "900:910,0:5,0:5"}, "--crop"},
      {{"phantom"}, "-o OUT.mha"},
      {{"phantom", "-o", "x.mha", "--size", "8"}, "16 to 512"},
      {{"phantom", "-o", "x.mha", "--frames", "65"}, "1 to 64"},
      {{"simulate", s, "--stiffness", "-1"}, "--stiffness"},
      {{"simulate", s, "--damping", "1e7"}, "--damping"},
      {{"simulate", s, "--drag", ""}, "--drag"},
      {{"simulate", s, "--gravity", "0,0,x"}, "--gravity"},
      {{"simulate", s, "--step", "0"}, "auto"},
      {{"simulate", s, "--step", "2"}, "--step"},
      {{"simulate", s, "--steps", "-3"}, "--steps"},
      {{"simulate", s, "--steps", "3", "--seconds", "1"}, "--seconds"},
      {{"simulate", s, "--integrator", "magic"}, "symplectic-euler, verlet, velocity-verlet, rk4"},
      {{"simulate", s, "--layout", "tree"}, "auto, lattice, explicit"},
      {{"simulate", s, "--mass", "0"}, "0.001 to 1000"},
      {{"simulate", s, "--anchor", "top"}, "none, border"},
      {{"simulate", s, "--scale-by-intensity", "colour"}, "stiffness, damping, drag, mass, none"},
      {{"simulate", s, "--scale-by-intensity", "mass,"}, "--scale-by-intensity"},
      {{"simulate", s, "--scale-by-intensity", "none,mass"}, "alone"},
      {{"simulate", s, "--beat", "0.8"}, "PERIOD:AMPLITUDE"},
      {{"simulate", s, "--beat", "0.01:0.1"}, "0.05 to 60"},
      {{"simulate", s, "--beat", "0.8:5"}, "0 to 0.5"},
      {{"simulate", s, "--surface-mapping", "glue"}, "triangle"},
      {{"simulate", s, "--surface-mapping", "none", "--surface", "x.stl"}, "--surface"},
      {{"simulate", s, "--surface", "x.txt"}, ".stl"},
      {{"render", s}, "-o OUT.png"},
      {{"render", s, "-o", "x.jpg"}, ".png"},
      {{"render", s, "-o", "x.png", "--size", "10x10"}, "16 to 8192"},
      {{"render", s, "-o", "x.png", "--size", "9000x100"}, "16 to 8192"},
      {{"render", s, "-o", "x.png", "--size", "640"}, "WIDTHxHEIGHT"},
      {{"render", s, "-o", "x.png", "--view", "front"}, "four-up"},
      {{"render", s, "-o", "x.png", "--show", "voxels"}, "links"},
      {{"render", s, "-o", "x.png", "--color-by", "mood"}, "intensity"},
      {{"render", s, "-o", "x.png", "--background", "pinkish"}, "#RRGGBB"},
  };
  for (const auto& one : cases) expect_refused(one, 2);
}

TEST(CliRefuses, WhatALaterVersionBrings) {
  const std::string s = sample();
  const Refusal cases[] = {
      {{"simulate", s, "--displacement", "x.mha"}, "--displacement"},
      {{"simulate", s, "--surface-mapping", "triangle-curved"}, "triangle-curved"},
      {{"simulate", s, "--surface-mapping", "one-to-one"}, "one-to-one"},
      {{"render", s, "-o", "x.png", "--color-by", "strain"}, "strain"},
      {{"render", s, "-o", "x.png", "--color-by", "displacement"}, "displacement"},
  };
  for (const auto& one : cases) EXPECT_THAT(expect_refused(one, 2), HasSubstr("yet"));
}

TEST(CliRefuses, GesturesAndRecipesWithThePlace) {
  const TemporaryFolder folder;
  const auto path = [&](const char* name) { return (folder / name).string(); };
  write_file(folder / "wrong.json", R"({"version":1,"steps":[{"tool":"move","path":[{"t_s":0}]}]})");
  write_file(folder / "cut.json", R"({"version":1,"steps":[{"tool":"cut","path":[]}]})");
  write_file(folder / "pull.json", pull_gesture(1.0, 0.5, 5.0));
  write_file(folder / "recipe.json", R"({"version":1,"tissue":{"stride":0}})");
  expect_refused({{"simulate", sample(), "--gesture", path("wrong.json")}, "steps[0].path[0]"}, 2);
  expect_refused({{"simulate", sample(), "--gesture", path("cut.json")}, "steps[0]"}, 2);
  expect_refused({{"simulate", sample(), "--stride", "4", "--device", "reference", "--gesture",
                   path("pull.json"), "--seconds", "0.4"},
                  "steps[0].path[1]"},
                 2);
  expect_refused({{"simulate", "--recipe", path("recipe.json")}, "tissue.stride"}, 2);
}

TEST(CliRefuses, InputsThatCannotBeRead) {
  const TemporaryFolder folder;
  write_file(folder / "junk.mha", "no image");
  fs::create_directory(folder / "empty");
  const std::string junk = (folder / "junk.mha").string();
  const std::string none = (folder / "none.mha").string();
  const std::string empty = (folder / "empty").string();
  const std::string device = "--device=reference";
  for (const std::string& path : {junk, none, empty}) {
    expect_refused({{"model", path}, path.c_str()}, 3);
    expect_refused({{"simulate", path, device}, path.c_str()}, 3);
    expect_refused({{"filter", path, "-o", (folder / "out.mha").string()}, path.c_str()}, 3);
    EXPECT_EQ(cli({"info", path}).exit_code, 3) << path;
  }
  expect_refused({{"model", sample(), "--threshold", "1000"}, "255"}, 3);
  expect_refused({{"simulate", "--recipe", none}, none.c_str()}, 3);
  expect_refused({{"simulate", sample(), device, "--gesture", none}, none.c_str()}, 3);
  expect_refused(
      {{"simulate", sample(), device, "--stride", "4", "--steps", "1", "--mesh", junk}, junk.c_str()}, 3);
}

TEST(CliRefuses, DevicesThatAreNotThere) {
  const Words no_driver = {"OCL_ICD_VENDORS=/nonexistent-empty-folder", "-u", "PALPATE_DEVICE"};
  // env takes -u before the assignments.
  const Words environment = {no_driver[1], no_driver[2], no_driver[0]};
  const Words run = {"simulate", sample(), "--stride", "4", "--threshold", "80", "--steps", "2"};
  const auto none = cli_with(environment, run);
  EXPECT_EQ(none.exit_code, 4) << none.error;
  EXPECT_THAT(none.error, HasSubstr("OpenCL"));
  EXPECT_EQ(cli_with(environment, {"devices"}).exit_code, 4);
  Words reference = run;
  reference.insert(reference.end(), {"--device", "reference"});
  EXPECT_EQ(cli_with(environment, reference).exit_code, 0) << "the reference needs none";

  // A filter has its twin on the host; that it is the slow one is said.
  const TemporaryFolder folder;
  const Words filter = {"filter",   sample(),   "--crop", "0:24,0:24,0:24",
                        "--filter", "adaptive", "-o",     (folder / "out.mha").string()};
  const auto twin = cli_with(environment, filter);
  EXPECT_EQ(twin.exit_code, 0) << twin.error;
  EXPECT_THAT(twin.error, HasSubstr("no OpenCL device"));

  Words unknown = run;
  unknown.insert(unknown.end(), {"--device", "no-such-device-anywhere"});
  const auto named = cli(unknown);
  EXPECT_EQ(named.exit_code, 4) << named.error;
}

TEST(CliRefuses, OutputsThatCannotBeWrittenBeforeTheLongWork) {
  const TemporaryFolder folder;
  const auto in_no_folder = [&](const char* name) { return (folder / "none" / name).string(); };
  fs::create_directory(folder / "taken.vtp");
  const std::string s = sample();
  const std::string device = "--device=reference";
  expect_refused({{"filter", s, "-o", in_no_folder("a.mha")}, "a.mha"}, 6);
  expect_refused({{"phantom", "-o", in_no_folder("a.mha")}, "a.mha"}, 6);
  expect_refused(
      {{"phantom", "-o", (folder / "a.mha").string(), "--surface", in_no_folder("a.stl")}, "a.stl"}, 6);
  expect_refused({{"model", s, "-o", in_no_folder("a.vtp")}, "a.vtp"}, 6);
  expect_refused({{"model", s, "-o", (folder / "taken.vtp").string()}, "taken.vtp"}, 6);
  expect_refused({{"simulate", s, device, "--surface", in_no_folder("a.stl")}, "a.stl"}, 6);
  expect_refused({{"simulate", s, device, "--save-recipe", in_no_folder("a.json")}, "a.json"}, 6);
  expect_refused({{"render", s, "-o", in_no_folder("a.png")}, "a.png"}, 6);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1) << "nothing is left";
}

TEST(CliRefuses, TwoOutputsOfOneName) {
  const TemporaryFolder folder;
  const std::string same = (folder / "a.vtp").string();
  const std::string around = (folder / "." / "a.vtp").string();
  expect_refused({{"simulate", sample(), "-o", same, "--surface", around}, "--surface"}, 2);
  const std::string volume = (folder / "a.mha").string();
  expect_refused({{"phantom", "--size", "16", "-o", volume, "--labels", volume}, "--labels"}, 2);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(CliRefuses, WhatIsNoScanInOneSentence) {
  const TemporaryFolder folder;
  write_file(folder / "notes", "no image");
  const std::string notes = (folder / "notes").string();
  EXPECT_EQ(cli({"model", notes}).error, "palpate-cli: " + notes +
                                             " is no scan that can be read. Export the scan as MetaImage "
                                             "(.mha, .mhd), NRRD, NIfTI or DICOM.\n");
  const std::string none = (folder / "none").string();
  EXPECT_EQ(cli({"model", none}).error, "palpate-cli: " + none + " does not exist. Check the name.\n");
  EXPECT_EQ(cli({"model", sample(), "--series", "1.2.3"}).error,
            "palpate-cli: " + sample() + " belongs to no series, so not to 1.2.3.\n");
  const auto above = cli({"model", sample(), "--threshold", "1000"}).error;
  EXPECT_THAT(above, HasSubstr("No voxel lies at 1000 or above"));
  // A parser's own words are of no use to people.
  expect_refused({{"simulate", sample(), "--gesture", notes}, "line 1: is not valid JSON"}, 2);
  EXPECT_EQ(cli({"simulate", sample(), "--gesture", notes}).error.find("exception"), std::string::npos);
}

TEST(CliRefuses, WithJsonAsOneObjectToo) {
  const auto result = cli({"model", sample() + ".none", "--json"});
  EXPECT_EQ(result.exit_code, 3);
  const auto object = json::parse(result.out);
  EXPECT_FALSE(object.at("error").at("code").get<std::string>().empty());
  EXPECT_THAT(object.at("error").at("text").get<std::string>(), HasSubstr(".none"));
}
