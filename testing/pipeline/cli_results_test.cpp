#include "cli_support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

using namespace palpate::testing;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
namespace fs = std::filesystem;

namespace {

Words with(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

const Words simulate_keys{"points",          "links",
                          "components",      "largest_component",
                          "steps",           "step_s",
                          "stable_step_s",   "seconds",
                          "wall_s",          "ms_per_step",
                          "realtime_factor", "max_displacement_mm",
                          "kinetic_energy",  "potential_energy",
                          "momentum",        "recoveries",
                          "diverged",        "integrator",
                          "layout",          "device",
                          "driver",          "recipe_sha256",
                          "layout_reason",   "anchors",
                          "substeps",        "stable_step_kind"};

}  // namespace

TEST(Cli, EverySubcommandHasHelpWithAnExample) {
  for (const char* command : {"devices", "info", "filter", "phantom", "model", "simulate", "render"}) {
    const auto result = cli({command, "--help"});
    EXPECT_EQ(result.exit_code, 0) << command;
    EXPECT_THAT(result.out, HasSubstr(std::string("Usage: palpate-cli ") + command));
    EXPECT_THAT(result.out, HasSubstr(std::string("palpate-cli ") + command + " "));
    EXPECT_THAT(result.out, HasSubstr("Example"));
    EXPECT_EQ(result.error, "");
  }
  EXPECT_THAT(cli({"--help"}).out, HasSubstr("simulate"));
  EXPECT_THAT(cli({"--version"}).out, ::testing::MatchesRegex("palpate-cli [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST(Cli, DevicesSaysWhichIsTakenAndWhy) {
  if (!opencl_present()) GTEST_SKIP() << "no OpenCL device";
  const auto object = cli_json({"devices"});
  int defaults = 0;
  for (const auto& device : object.at("devices")) {
    EXPECT_THAT(keys_of(device),
                IsSupersetOf({"name", "platform", "driver", "memory_bytes", "reason", "default"}));
    defaults += device.at("default").get<bool>() ? 1 : 0;
  }
  EXPECT_EQ(defaults, 1);
}

TEST(Cli, InfoListsWhatIsInAFolderAndWhatCannotBeRead) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "sub");
  fs::copy_file(sample(), folder / "sub/heart.mha");
  write_file(folder / "notes.mha", "this is no image\n");
  const auto object = cli_json({"info", folder.path().string()});
  ASSERT_EQ(object.at("inputs").size(), 2U);
  int read = 0;
  for (const auto& input : object.at("inputs")) {
    if (!input.at("ok").get<bool>()) {
      EXPECT_THAT(input.at("path").get<std::string>(), HasSubstr("notes.mha"));
      EXPECT_FALSE(input.at("error").at("code").get<std::string>().empty());
      EXPECT_FALSE(input.at("error").at("text").get<std::string>().empty());
      EXPECT_TRUE(input.at("volumes").empty());
      continue;
    }
    ++read;
    EXPECT_TRUE(input.at("error").is_null());
    const auto& volume = input.at("volumes").at(0);
    EXPECT_THAT(keys_of(volume),
                IsSupersetOf({"format", "modality", "sop_class", "series_uid", "frames", "frame_times_s",
                              "dims", "spacing_mm", "origin_mm", "direction", "components", "pixel_type",
                              "min", "max", "mean", "provenance", "warnings"}));
    EXPECT_EQ(volume.at("pixel_type"), "uint8");
    EXPECT_EQ(volume.at("direction").size(), 9U);
  }
  EXPECT_EQ(read, 1);
}

TEST(Cli, FilterKeepsTheGeometryAndCrops) {
  const TemporaryFolder folder;
  const std::string smooth = (folder / "smooth.nrrd").string();
  const auto object = cli_json({"filter", sample(), "-o", smooth, "--filter", "gaussian:sigma=2"});
  const auto before = cli_json({"info", sample()}).at("inputs").at(0).at("volumes").at(0);
  const auto after = cli_json({"info", smooth}).at("inputs").at(0).at("volumes").at(0);
  EXPECT_EQ(after.at("dims"), before.at("dims"));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(after.at("spacing_mm")[axis].get<double>(), before.at("spacing_mm")[axis].get<double>(),
                1e-9);
    EXPECT_NEAR(after.at("origin_mm")[axis].get<double>(), before.at("origin_mm")[axis].get<double>(), 1e-6);
  }
  // Smoothing takes the peaks away and keeps the mean, but for the border.
  EXPECT_LT(after.at("max").get<double>(), before.at("max").get<double>());
  EXPECT_NEAR(after.at("mean").get<double>(), before.at("mean").get<double>(),
              0.02 * before.at("mean").get<double>());
  EXPECT_EQ(object.at("pixel_type"), "float32");

  const std::string part = (folder / "part.mha").string();
  cli_json({"filter", sample(), "-o", part, "--crop", "4:10,0:7,2:10"});
  const auto cropped = cli_json({"info", part}).at("inputs").at(0).at("volumes").at(0);
  EXPECT_EQ(cropped.at("dims"), json::parse("[6, 7, 8]"));
  EXPECT_EQ(cropped.at("pixel_type"), "uint8");
  const double spacing = before.at("spacing_mm")[0].get<double>();
  EXPECT_NEAR(cropped.at("origin_mm")[0].get<double>(), before.at("origin_mm")[0].get<double>() + 4 * spacing,
              1e-6);
}

TEST(Cli, FilterListHasParametersWithRanges) {
  const auto object = cli_json({"filter", "--list"});
  Words names;
  for (const auto& filter : object.at("filters")) {
    names.push_back(filter.at("name"));
    for (const auto& parameter : filter.at("parameters")) EXPECT_LE(parameter.at("min"), parameter.at("max"));
  }
  EXPECT_THAT(names, IsSupersetOf({"median", "gaussian"}));
}

TEST(Cli, PhantomIsTheSameForTheSameSeed) {
  const TemporaryFolder folder;
  const auto path = [&](const char* name) { return (folder / name).string(); };
  cli_json({"phantom", "-o", path("a.mha"), "--size", "24", "--surface", path("a.stl"), "--labels",
            path("l.mha")});
  cli_json({"phantom", "-o", path("b.mha"), "--size", "24"});
  cli_json({"phantom", "-o", path("c.mha"), "--size", "24", "--seed", "2"});
  const auto volume = [&](const char* name) {
    return cli_json({"info", path(name)}).at("inputs").at(0).at("volumes").at(0);
  };
  EXPECT_EQ(volume("a.mha"), volume("b.mha"));
  EXPECT_NE(volume("a.mha").at("mean"), volume("c.mha").at("mean"));
  const auto dims = volume("a.mha").at("dims").get<std::vector<int>>();
  EXPECT_EQ(*std::max_element(dims.begin(), dims.end()), 24);
  EXPECT_LE(volume("l.mha").at("max").get<double>(), 3.0);
  EXPECT_GT(fs::file_size(path("a.stl")), 1000U);
}

TEST(Cli, ModelCountsAndItsEstimateIsExactInPoints) {
  const Words options = {"model", sample(), "--threshold", "80"};
  const auto built = cli_json(options);
  EXPECT_THAT(keys_of(built),
              IsSupersetOf({"points", "links", "links_per_point", "components", "largest_component",
                            "isolated", "bounds_mm", "stable_step_s", "bytes", "build_s"}));
  const double points = built.at("points").get<double>();
  EXPECT_GT(points, 1000);
  // Every link has two ends.
  EXPECT_NEAR(built.at("links_per_point").at("mean").get<double>(),
              2.0 * built.at("links").get<double>() / points, 1e-9);
  EXPECT_LE(built.at("links_per_point").at("max").get<int>(), 12);
  const auto estimate = cli_json(with(options, {"--estimate"}));
  EXPECT_EQ(estimate.at("points"), built.at("points"));
  // A sample of the same tissue: within a tenth.
  EXPECT_NEAR(estimate.at("links").get<double>(), built.at("links").get<double>(),
              0.1 * built.at("links").get<double>());

  const auto six = cli_json(with(options, {"--links", "six"}));
  EXPECT_EQ(six.at("points"), built.at("points"));
  EXPECT_LE(six.at("links_per_point").at("max").get<int>(), 6);
  const auto coarse = cli_json(with(options, {"--stride", "2"}));
  EXPECT_NEAR(coarse.at("points").get<double>(), points / 8.0, 0.15 * points / 8.0);
}

TEST(Cli, SimulateHasEveryKeyAndRestStaysAtRest) {
  if (!opencl_present()) GTEST_SKIP() << "no OpenCL device";
  const auto object = cli_json(with({"simulate"}, with(small_block(), {"--steps", "20"})));
  EXPECT_THAT(keys_of(object), IsSupersetOf(simulate_keys));
  EXPECT_EQ(object.at("steps"), 20);
  EXPECT_EQ(object.at("integrator"), "rk4");
  EXPECT_EQ(object.at("layout"), "lattice") << object.at("layout_reason");
  EXPECT_EQ(object.at("substeps"), 1);
  EXPECT_EQ(object.at("anchors"), 0);
  EXPECT_FALSE(object.at("diverged").get<bool>());
  EXPECT_EQ(object.at("recoveries"), 0);
  EXPECT_LE(object.at("step_s"), object.at("stable_step_s"));
  EXPECT_EQ(object.at("recipe_sha256").get<std::string>().size(), 64U);
  // The lattice keeps rest lengths in 16 bits, some 1e-5 mm from the true ones
  // each; soft modes gather that some tens of times. A voxel here has 1.2 mm.
  EXPECT_LT(object.at("max_displacement_mm").get<double>(), 1e-3);
}

TEST(Cli, AGestureMovesTissueByItsLength) {
  const TemporaryFolder folder;
  write_file(folder / "pull.json", pull_gesture(5.0, 0.2, 8.0));
  const auto object =
      cli_json({"simulate", sample(), "--threshold", "80", "--min-component", "100", "--stride", "2",
                "--device", "reference", "--gesture", (folder / "pull.json").string()});
  EXPECT_TRUE(object.at("warnings").empty()) << object.at("warnings");
  EXPECT_NEAR(object.at("seconds").get<double>(), 0.2, 1e-6)
      << "without --seconds, to the end of the gesture";
  // The held points moved by 5 mm; a free one beside them swings past by less than a tenth.
  EXPECT_NEAR(object.at("max_displacement_mm").get<double>(), 5.0, 0.5);
}

TEST(Cli, TheSameTwiceAndByItsRecipeIsTheSame) {
  const TemporaryFolder folder;
  write_file(folder / "pull.json", pull_gesture(2.0, 0.05, 8.0));
  const std::string recipe = (folder / "recipe.json").string();
  const Words run = {"--device", "reference", "--seconds",
                     "0.1",      "--gesture", (folder / "pull.json").string()};
  const Words first =
      with(with({"simulate"}, small_block()),
           with(run, {"--stiffness", "5000", "--filter", "median:radius=1", "--save-recipe", recipe}));
  const auto one = without_times(cli_json(first));
  EXPECT_TRUE(one.at("warnings").empty()) << one.at("warnings");
  EXPECT_GT(one.at("max_displacement_mm").get<double>(), 1.0);
  EXPECT_EQ(without_times(cli_json(first)), one);
  EXPECT_EQ(without_times(cli_json(with({"simulate", "--recipe", recipe}, run))), one);
  const auto other = cli_json(with({"simulate", "--recipe", recipe, "--stiffness", "6000"}, run));
  EXPECT_NE(other.at("recipe_sha256"), one.at("recipe_sha256")) << "an option goes before the recipe";
}

TEST(Cli, OpenClAndReferenceAgree) {
  if (!opencl_present()) GTEST_SKIP() << "no OpenCL device";
  const TemporaryFolder folder;
  write_file(folder / "pull.json", pull_gesture(2.0, 0.1, 8.0));
  const Words run = with(with({"simulate"}, small_block()),
                         {"--seconds", "0.2", "--gesture", (folder / "pull.json").string()});
  const auto device = cli_json(run);
  const auto reference = cli_json(with(run, {"--device", "reference"}));
  EXPECT_EQ(device.at("points"), reference.at("points"));
  EXPECT_EQ(device.at("steps"), reference.at("steps"));
  EXPECT_EQ(device.at("recipe_sha256"), reference.at("recipe_sha256"));
  EXPECT_GT(reference.at("max_displacement_mm").get<double>(), 1.0);
  // Float positions of up to 50 mm carry 4e-6 mm; some 40 steps and the
  // springs' pull on them leave a hundredth of a percent with room to spare.
  for (const char* key : {"max_displacement_mm", "kinetic_energy", "potential_energy"}) {
    const double exact = reference.at(key).get<double>();
    EXPECT_NEAR(device.at(key).get<double>(), exact, 1e-3 * std::abs(exact)) << key;
  }
}

TEST(Cli, SimulateWritesPointsAndSurface) {
  const TemporaryFolder folder;
  const auto points = folder / "points.vtp";
  const auto surface = folder / "surface.stl";
  cli_json({"simulate", sample(), "--threshold", "80", "--min-component", "100", "--stride", "2", "--device",
            "reference", "--steps", "2", "-o", points.string(), "--surface", surface.string()});
  EXPECT_GT(fs::file_size(points), 1000U);
  EXPECT_GT(fs::file_size(surface), 1000U);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 2) << "nothing else is left";
}

TEST(Cli, AMeshOfTheUsersSaysHowItsAxesWereTaken) {
  const TemporaryFolder folder;
  const std::string faces = "v 0 0 0\nv 10 0 0\nv 0 10 0\nf 1 2 3\n";
  write_file(folder / "plain.obj", faces);
  write_file(folder / "ras.obj", "# SPACE=RAS\n" + faces);
  const auto axes = [&](const char* name) {
    Words words{"simulate", sample(),  "--device", "reference", "--stride",
                "4",        "--steps", "0",        "--mesh",    (folder / name).string()};
    return cli_json(words).at("mesh_axes").get<std::string>();
  };
  EXPECT_EQ(axes("plain.obj"), "LPS, assumed");
  EXPECT_EQ(axes("ras.obj"), "RAS, stated by SPACE=RAS in the file");
}

TEST(Cli, ARunThatCannotBeBroughtBackEndsWithFive) {
  // Euler without damping has no stable step, so this one is taken as it is; and
  // twelve halvings of 1 s are 0.24 ms, ten times what tissue this stiff bears.
  const auto result =
      cli(with(with({"simulate"}, small_block()),
               {"--device", "reference", "--integrator", "euler", "--damping", "0", "--drag", "0",
                "--stiffness", "1e9", "--step", "1", "--steps", "5", "--gravity", "0,0,-9810", "--json"}));
  EXPECT_EQ(result.exit_code, 5) << result.error;
  EXPECT_TRUE(json::parse(result.out).at("diverged").get<bool>());
  EXPECT_NE(result.error, "");
}

TEST(Cli, ASpineScanBecomesTissueThatRuns) {
  PALPATE_TEST_SCAN(scan, "pluslib/SpinePhantomFreehandReconstructed.mha");
  if (!opencl_present()) GTEST_SKIP() << "no OpenCL device";
  const auto object = cli_json({"simulate", scan.string(), "--threshold", "60", "--steps", "3"});
  EXPECT_THAT(keys_of(object), IsSupersetOf(simulate_keys));
  EXPECT_GT(object.at("points").get<int>(), 100000);
  EXPECT_FALSE(object.at("diverged").get<bool>());
}
