#include "cli_support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

using namespace palpate::testing;
using nlohmann::json;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

// What tissue is made of and how it may move, by the options of model and simulate.
namespace {

Words with(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// A MetaImage of bytes; `value(i, j, k)` for voxels of 1 mm, the first at `origin`.
template <typename Value>
void write_bytes(const fs::path& path, std::array<int, 3> dims, const std::string& origin,
                 const Value& value) {
  std::ofstream file(path, std::ios::binary);
  file << "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nDimSize = "
       << dims[0] << ' ' << dims[1] << ' ' << dims[2] << "\nElementSpacing = 1 1 1\nOffset = " << origin
       << "\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
  for (int k = 0; k < dims[2]; ++k)
    for (int j = 0; j < dims[1]; ++j)
      for (int i = 0; i < dims[0]; ++i) file.put(static_cast<char>(value(i, j, k)));
  ASSERT_TRUE(file.good()) << path;
}

/// A scan of 10 x 10 x 10 voxels, brighter along i, and labels for it: 1 in
/// the lower half, 2 in the upper one but its last slice.
struct Scan {
  TemporaryFolder folder;
  std::string path(const char* name) const { return (folder / name).string(); }
  Scan() {
    write_bytes(folder / "scan.mha", {10, 10, 10}, "5 6 7", [](int i, int, int) { return 100 + 10 * i; });
    write_bytes(folder / "labels.mha", {10, 10, 10}, "5 6 7", [](int, int, int k) {
      return k < 5 ? 1 : k < 9 ? 2 : 0;
    });
  }
  json model(const Words& options) const { return cli_json(with({"model", path("scan.mha")}, options)); }
  json simulate(const Words& options) const {
    return cli_json(with({"simulate", path("scan.mha"), "--surface-mapping", "none", "--threshold", "50",
                          "--device", "reference"},
                         options));
  }
  /// Exit code and words.
  ProgramResult refused(const Words& command_and_options) const {
    Words words{command_and_options.front(), path("scan.mha")};
    words.insert(words.end(), command_and_options.begin() + 1, command_and_options.end());
    auto result = cli(words);
    EXPECT_EQ(result.signal, 0);
    EXPECT_EQ(result.out, "");
    return result;
  }
};

}  // namespace

TEST(CliTissue, AMaskSaysWhatTissueIs) {
  const Scan scan;
  const auto all = scan.model({"--mask", scan.path("labels.mha")});
  EXPECT_EQ(all.at("points"), 900);
  EXPECT_TRUE(all.at("threshold_low").is_null()) << "none was used";
  EXPECT_TRUE(all.at("on_lattice").get<bool>());
  EXPECT_EQ(scan.model({"--mask", scan.path("labels.mha:2")}).at("points"), 400);
  EXPECT_EQ(scan.model({"--mask", scan.path("labels.mha:0")}).at("points"), 100);
  // Voxels of 150 and more: half of the columns.
  const auto both = scan.model({"--mask", scan.path("labels.mha:1"), "--threshold", "150"});
  EXPECT_EQ(both.at("points"), 250);
  EXPECT_EQ(both.at("threshold_low"), 150.0);
  EXPECT_EQ(scan.model({"--mask", scan.path("labels.mha:1"), "--estimate"}).at("points"), 500);
}

TEST(CliTissue, AMasksLabelIsAfterTheLastColonUnlessAFileIsCalledSo) {
  const Scan scan;
  for (const char* name : {"a:b.mha", "c.mha:2", "d:7:x.mha"})
    fs::copy_file(scan.folder / "labels.mha", scan.folder / name);
  EXPECT_EQ(scan.model({"--mask", scan.path("a:b.mha")}).at("points"), 900);
  EXPECT_EQ(scan.model({"--mask", scan.path("a:b.mha:2")}).at("points"), 400);
  EXPECT_EQ(scan.model({"--mask", scan.path("d:7:x.mha:1")}).at("points"), 500);
  // No reader takes the ending .mha:2, and that is said of the file that is there.
  EXPECT_THAT(scan.refused({"model", "--mask", scan.path("c.mha:2")}).error, HasSubstr("c.mha:2 is no scan"));
  EXPECT_THAT(scan.refused({"model", "--mask", scan.path("e.mha:2x")}).error, HasSubstr("e.mha:2x"));
}

TEST(CliTissue, MasksThatDoNotFitAreRefusedWithTheReason) {
  const Scan scan;
  write_bytes(scan.folder / "elsewhere.mha", {4, 4, 4}, "500 0 0", [](int, int, int) { return 1; });
  write_bytes(scan.folder / "empty.mha", {10, 10, 10}, "5 6 7", [](int, int, int) { return 0; });
  write_file(scan.folder / "damaged.mha",
             "ObjectType = Image\nNDims = 3\nDimSize = 10 10 10\n"
             "ElementType = MET_UCHAR\nElementDataFile = LOCAL\nshort");
  write_file(scan.folder / "junk.mha", "no image");
  fs::create_directory(scan.folder / "nothing");
  const auto refusal = [&](const std::string& name, const char* says) {
    const auto result = scan.refused({"model", "--mask", scan.path(name.c_str())});
    EXPECT_EQ(result.exit_code, 3) << name;
    EXPECT_THAT(result.error, HasSubstr(says)) << name;
  };
  refusal("elsewhere.mha", "outside the scan");
  refusal("empty.mha", "marks no voxel");
  refusal("labels.mha:5", "label 5");
  refusal("damaged.mha", "damaged.mha");
  refusal("junk.mha", "junk.mha");
  refusal("nothing", "nothing");
  refusal("missing.mha", "missing.mha");
  refusal("missing.mha:3", "missing.mha");
}

TEST(CliTissue, AFolderCanBeAMask) {
  const Scan scan;
  fs::create_directory(scan.folder / "series");
  fs::copy_file(scan.folder / "labels.mha", scan.folder / "series/labels.mha");
  EXPECT_EQ(scan.model({"--mask", scan.path("series/labels.mha")}).at("points"), 900);
  EXPECT_EQ(scan.model({"--mask", scan.path("series")}).at("points"), 900);
  EXPECT_EQ(scan.model({"--mask", scan.path("series:2")}).at("points"), 400);
}

TEST(CliTissue, LatticeNeighboursAndBlueNoise) {
  const Scan scan;
  const Words all{"--threshold", "50"};
  // Pairs of a full box of 10^3, a step along one, two and three axes apart.
  const int six = 3 * 900;
  const int edges = 6 * 10 * 81;
  const int corners = 4 * 729;
  EXPECT_EQ(scan.model(with(all, {"--links", "six"})).at("links"), six);
  EXPECT_EQ(scan.model(with(all, {"--links", "lattice18"})).at("links"), six + edges);
  EXPECT_EQ(scan.model(with(all, {"--links", "lattice26"})).at("links"), six + edges + corners);
  const auto scattered = scan.model(with(all, {"--points", "blue-noise"}));
  EXPECT_EQ(scattered.at("points"), 1000);
  EXPECT_FALSE(scattered.at("on_lattice").get<bool>());
  EXPECT_EQ(scan.model(with(all, {"--points", "blue-noise", "--stride", "2"})).at("points"), 125);
  EXPECT_EQ(scan.model(with(all, {"--points", "blue-noise", "--estimate"})).at("points"), 1000);
  const auto refused = scan.refused({"model", "--points", "blue-noise", "--links", "lattice18"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.error, HasSubstr("--links"));
  EXPECT_THAT(refused.error, HasSubstr("nearest"));
}

TEST(CliTissue, AnchorsHoldTissueAgainstItsWeight) {
  const Scan scan;
  // 0.2 s of fall is 0.5 g t^2 = 196 mm. Tissue that hangs sags by far less:
  // at most the force of its weight over the springs, some mm.
  const Words fall{"--gravity", "0,0,-9810", "--seconds", "0.2"};
  const auto free = scan.simulate(fall);
  EXPECT_EQ(free.at("anchors"), 0);
  EXPECT_NEAR(free.at("max_displacement_mm").get<double>(), 0.5 * 9810 * 0.04, 10.0) << "drag takes little";
  const auto border = scan.simulate(with(fall, {"--anchor", "border"}));
  EXPECT_EQ(border.at("anchors"), 1000 - 512);
  EXPECT_LT(border.at("max_displacement_mm").get<double>(), 5.0);
  EXPECT_GT(border.at("max_displacement_mm").get<double>(), 0.01) << "the inside sags";
  write_bytes(scan.folder / "top.mha", {10, 10, 10}, "5 6 7", [](int, int, int k) { return k == 9 ? 1 : 0; });
  const auto top = scan.simulate(with(fall, {"--anchor", scan.path("top.mha")}));
  EXPECT_EQ(top.at("anchors"), 100);
  EXPECT_LT(top.at("max_displacement_mm").get<double>(), 150.0);
  const auto softness = [](const auto& run) {
    return run.at("warnings").dump().find("too-soft") != std::string::npos;
  };
  EXPECT_TRUE(softness(top)) << "sags by more than a third of itself";
  const Words stiffer{"--gravity", "0,0,-9810", "--stiffness", "100000", "--steps", "1"};
  EXPECT_FALSE(softness(scan.simulate(with(stiffer, {"--anchor", "border"})))) << "held all round";
  EXPECT_GT(top.at("max_displacement_mm").get<double>(), border.at("max_displacement_mm").get<double>());
  EXPECT_EQ(scan.simulate(with(fall, {"--anchor", "none"})).at("anchors"), 0);
}

TEST(CliTissue, AnchorsThatHoldNothingAreSaid) {
  const Scan scan;
  write_bytes(scan.folder / "elsewhere.mha", {4, 4, 4}, "500 0 0", [](int, int, int) { return 1; });
  const Words run{"simulate", "--device", "reference", "--threshold", "50", "--steps", "1", "--anchor"};
  auto result = scan.refused(with(run, {scan.path("elsewhere.mha")}));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.error, HasSubstr("elsewhere.mha"));
  result = scan.refused(with(run, {scan.path("missing.mha")}));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.error, HasSubstr("missing.mha"));
  result = scan.refused(with(run, {"boarder"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.error, HasSubstr("none, border"));
  const auto cropped = scan.simulate({"--mask", scan.path("labels.mha:2"), "--crop", "0:10,0:10,0:10",
                                      "--steps", "1", "--anchor", "border"});
  EXPECT_GT(cropped.at("anchors"), 0);
}

TEST(CliTissue, MassAndScalingChangeTheStepAndTheMotion) {
  const Scan scan;
  const auto plain = scan.simulate({"--steps", "1"});
  const auto heavy = scan.simulate({"--steps", "1", "--mass", "4"});
  // omega falls with the root of the mass; decay is not what limits here. Each
  // estimate lies between 0.90 and 1.00 of the true limit.
  EXPECT_NEAR(heavy.at("stable_step_s").get<double>() / plain.at("stable_step_s").get<double>(), 2.0, 0.22);
  const auto light_ends = scan.simulate({"--steps", "1", "--scale-by-intensity", "mass"});
  EXPECT_LT(light_ends.at("stable_step_s"), plain.at("stable_step_s"));
  const auto several = scan.simulate({"--steps", "1", "--scale-by-intensity", "stiffness,damping,drag,mass"});
  EXPECT_NE(several.at("recipe_sha256"), light_ends.at("recipe_sha256"));
  EXPECT_EQ(scan.simulate({"--steps", "1", "--scale-by-intensity", "none"}).at("recipe_sha256"),
            plain.at("recipe_sha256"));
}

TEST(CliTissue, ABeatMovesTissueAndIsOffByDefault) {
  const Scan scan;
  const auto still = scan.simulate({"--seconds", "0.2"});
  EXPECT_LT(still.at("max_displacement_mm").get<double>(), 1e-3);
  // In the middle of a beat of 0.4 s all links want 0.8 of their length, so the
  // corners, 7.8 mm from the middle, come in by up to 1.6 mm and swing past by
  // less than as much again.
  const auto beating = scan.simulate({"--seconds", "0.2", "--beat", "0.4:0.2"});
  EXPECT_GT(beating.at("max_displacement_mm").get<double>(), 0.5);
  EXPECT_LT(beating.at("max_displacement_mm").get<double>(), 3.2);
}

TEST(CliTissue, EveryIntegratorRuns) {
  const Scan scan;
  for (const char* name :
       {"euler", "symplectic-euler", "verlet", "velocity-verlet", "rk4", "implicit-euler"}) {
    const auto object =
        scan.simulate({"--stride", "2", "--steps", "10", "--integrator", name, "--gravity", "0,0,-100"});
    EXPECT_EQ(object.at("integrator"), name);
    EXPECT_FALSE(object.at("diverged").get<bool>()) << name;
    EXPECT_GT(object.at("max_displacement_mm").get<double>(), 0.0) << name;
    // The scheme without a limit takes the thesis' own step.
    EXPECT_EQ(object.at("stable_step_s").is_null(), std::string(name) == "implicit-euler") << name;
  }
}

TEST(CliTissue, AllOfItComesBackByTheRecipe) {
  const Scan scan;
  write_bytes(scan.folder / "top.mha", {10, 10, 10}, "5 6 7", [](int, int, int k) { return k == 8 ? 1 : 0; });
  const std::string recipe = scan.path("recipe.json");
  const Words run{"--gravity", "0,0,-500", "--seconds", "0.05"};
  const auto first = without_times(scan.simulate(with(
      run, {"--mask", scan.path("labels.mha:2"), "--anchor", scan.path("top.mha"), "--scale-by-intensity",
            "mass,stiffness", "--mass", "2", "--beat", "0.5:0.1", "--integrator", "velocity-verlet",
            "--links", "lattice18", "--layout", "explicit", "--save-recipe", recipe})));
  const Words by_recipe{"simulate", "--recipe", recipe, "--device", "reference", "--seconds", "0.05"};
  EXPECT_EQ(without_times(cli_json(by_recipe)), first);
  // Moved together, all is found; another mask is told and makes another run.
  fs::create_directory(scan.folder / "moved");
  for (const char* name : {"scan.mha", "labels.mha", "top.mha", "recipe.json"})
    fs::rename(scan.folder / name, scan.folder / "moved" / name);
  const Words moved{"simulate",
                    "--recipe",
                    scan.path("moved/recipe.json"),
                    scan.path("moved/scan.mha"),
                    "--device",
                    "reference",
                    "--seconds",
                    "0.05"};
  EXPECT_EQ(without_times(cli_json(moved)), first);
  write_bytes(scan.folder / "moved/labels.mha", {10, 10, 10}, "5 6 7", [](int, int, int k) {
    return k < 4 ? 1 : k < 9 ? 2 : 0;
  });
  const auto changed = cli_json(moved);
  EXPECT_EQ(changed.at("warnings").at(0).at("code"), "mask-changed");
  EXPECT_EQ(changed.at("points"), 500);
  EXPECT_NE(changed.at("recipe_sha256"), first.at("recipe_sha256"));
}

TEST(CliTissue, BothLayoutsMoveAlikeAndOneIsChosenWithAReason) {
  if (!opencl_present()) GTEST_SKIP() << "no OpenCL device";
  const Scan scan;
  const auto run = [&](const std::string& layout, const Words& more = {}) {
    return cli_json(
        with({"simulate", scan.path("scan.mha"), "--surface-mapping", "none", "--threshold", "50",
              "--gravity", "0,0,-500", "--anchor", "border", "--seconds", "0.1", "--layout", layout},
             more));
  };
  const auto lattice = run("lattice");
  const auto other = run("explicit");
  EXPECT_EQ(lattice.at("layout"), "lattice");
  EXPECT_EQ(other.at("layout"), "explicit");
  EXPECT_EQ(lattice.at("steps"), other.at("steps"));
  // Coordinates below 16 mm as floats, some twenty steps of springs that pull
  // the rounding back: a hundredth of a percent, with room to spare.
  for (const char* key : {"max_displacement_mm", "potential_energy"}) {
    const double exact = other.at(key).get<double>();
    EXPECT_NEAR(lattice.at(key).get<double>(), exact, 1e-3 * std::abs(exact)) << key;
  }
  EXPECT_FALSE(lattice.at("layout_reason").get<std::string>().empty());
  const auto chosen = run("auto").at("layout");
  EXPECT_TRUE(chosen == "lattice" || chosen == "explicit") << chosen;
  EXPECT_EQ(run("auto", {"--points", "blue-noise"}).at("layout"), "explicit");
  const auto refused = scan.refused({"simulate", "--threshold", "50", "--points", "blue-noise", "--layout",
                                     "lattice", "--surface-mapping", "none"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.error, HasSubstr("lattice"));
}
