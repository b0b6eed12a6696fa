// Reading by the command line: what is in a folder, which series, how it lies.
#include "cli_support.hpp"
#include "reader_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace {

using namespace palpate::testing;
using ::testing::HasSubstr;

/// Two series of slices 2 mm apart, and one scan of another kind.
class CliImaging : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const std::string series : {"1.2.3", "1.2.4"})
      for (int n = 0; n < 3; ++n) {
        SmallImage image;
        image.sop = "1.2.840.10008.5.1.4.1.1.4";
        image.modality = "MR";
        image.series = series;
        image.instance = std::to_string(n + 1);
        image.position = "0\\0\\" + std::to_string(2 * n);
        image.orientation = "1\\0\\0\\0\\1\\0";
        image.spacing = "0.5\\0.25";
        image.write(folder_ / (series + "-" + std::to_string(n) + ".dcm"));
      }
  }
  nlohmann::json only_volume(const Words& arguments) {
    return cli_json(arguments).at("inputs").at(0).at("volumes").at(0);
  }
  std::string folder() const { return folder_.path().string(); }

  TemporaryFolder folder_;
};

TEST_F(CliImaging, HeadersOnlyTellsEverythingButTheValues) {
  write_mha(folder_ / "cube.mha", "2 3 4", "MET_UCHAR", std::string(24, 'a'), "ElementSpacing = 1 2 3\n");
  const auto object = cli_json({"info", "--headers-only", folder()});
  EXPECT_THAT(object.at("sandbox").get<std::string>(), ::testing::AnyOf("seccomp", "none"));
  ASSERT_EQ(object.at("inputs").size(), 3U);
  const auto whole = cli_json({"info", folder()});
  for (std::size_t n = 0; n < 3; ++n) {
    auto told = object.at("inputs").at(n);
    auto read = whole.at("inputs").at(n);
    for (const char* key : {"min", "max", "mean"}) {
      EXPECT_TRUE(told.at("volumes").at(0).at(key).is_null());
      EXPECT_TRUE(read.at("volumes").at(0).at(key).is_number());
      told.at("volumes").at(0).erase(key);
      read.at("volumes").at(0).erase(key);
    }
    EXPECT_EQ(told, read);
  }
  for (const char* key :
       {"description", "date", "scanner", "patient_axes", "orientation", "orientation_choices"})
    EXPECT_TRUE(whole.at("inputs").at(0).at("volumes").at(0).contains(key)) << key;
  const auto text = cli({"info", "--headers-only", folder()});
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_THAT(text.out, HasSubstr("--series 1.2.3"));
  EXPECT_THAT(text.out, HasSubstr("--series 1.2.4"));
  EXPECT_THAT(text.out, HasSubstr("0.25 x 0.5 x 2 mm"));
  EXPECT_THAT(text.out, HasSubstr("cube.mha"));
}

TEST_F(CliImaging, SeveralSeriesAreListedToChooseFrom) {
  const auto refused = cli({"model", folder()});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.error, HasSubstr("1.2.3 (MR, 3 files, 4 x 2 x 3, 0.25 x 0.5 x 2 mm)"));
  EXPECT_THAT(refused.error, HasSubstr("1.2.4 (MR, 3 files"));
  EXPECT_THAT(refused.error, HasSubstr("--series"));
  const auto volume = only_volume({"info", folder(), "--series", "1.2.4"});
  EXPECT_EQ(volume.at("series_uid"), "1.2.4");
  EXPECT_EQ(volume.at("dims"), nlohmann::json::parse("[4,2,3]"));
}

TEST_F(CliImaging, TheUserSaysHowItLies) {
  const auto file = only_volume({"info", sample()});
  EXPECT_EQ(only_volume({"info", sample(), "--orientation", "file"}), file);
  const auto turned = only_volume({"info", sample(), "--orientation", "ras"});
  EXPECT_EQ(turned.at("orientation"), "RAS");
  EXPECT_EQ(turned.at("direction"), nlohmann::json::parse("[-1.0,0,0,0,-1.0,0,0,0,1.0]"));
  EXPECT_EQ(turned.at("provenance").at("direction"), "user");
  EXPECT_EQ(turned.at("spacing_mm"), file.at("spacing_mm"));
  EXPECT_EQ(turned.at("patient_axes"), true);
  // Only scans in polar coordinates have a grid to be chosen.
  EXPECT_EQ(only_volume({"info", sample(), "--grid-spacing", "2.5"}), file);
}

TEST_F(CliImaging, OrientationAndGridAreCheckedBeforeReading) {
  const auto expect_refused = [](Words words, const std::string& option, const std::string& value) {
    words.insert(words.end(), {"nowhere.mha", option, value});
    const auto refused = cli(words);
    EXPECT_EQ(refused.exit_code, 2) << words[0] << " " << value;
    EXPECT_THAT(refused.error, HasSubstr(option));
    EXPECT_THAT(refused.error, HasSubstr(option == "--orientation" ? "LPS or RAS" : "mm"));
  };
  for (const std::string value : {"LLS", "LPSA", "LP", "", "XYZ"})
    expect_refused({"info"}, "--orientation", value);
  for (const std::string value : {"0", "-1", "nan", "1mm"}) expect_refused({"info"}, "--grid-spacing", value);
  for (const Words& command :
       {Words{"model"}, Words{"filter", "-o", "x.mha"}, Words{"simulate"}, Words{"render", "-o", "x.png"}}) {
    expect_refused(command, "--orientation", "up");
    expect_refused(command, "--grid-spacing", "0");
  }
}

TEST_F(CliImaging, AnAssumedSpacingIsNotWrittenInSilence) {
  write_mha(folder_ / "bare.mha", "2 3 4", "MET_UCHAR", std::string(24, 'a'), "");
  const std::string bare = (folder_ / "bare.mha").string();
  const std::string out = (folder_ / "out.nrrd").string();
  const auto warned = [](const nlohmann::json& object) {
    return object.at("warnings").dump().find("assumed-spacing-written") != std::string::npos;
  };
  EXPECT_TRUE(warned(cli_json({"filter", bare, "-o", out})));
  EXPECT_FALSE(warned(cli_json({"filter", bare, "-o", out, "--spacing", "1,1,2"})));
}

TEST_F(CliImaging, TheRangeIsThatOfAllFrames) {
  std::string voxels;
  for (char k = 1; k <= 5; ++k) voxels += std::string(8, k);
  write_mha(folder_ / "beat.mha", "2 2 2 5", "MET_UCHAR", voxels, "ElementSpacing = 1 1 1 0.5\n");
  const auto volume = only_volume({"info", (folder_ / "beat.mha").string()});
  EXPECT_EQ(volume.at("frames"), 5);
  EXPECT_EQ(volume.at("frame_times_s"), nlohmann::json::parse("[0,0.5,1.0,1.5,2.0]"));
  EXPECT_EQ(volume.at("min"), 1.0);
  EXPECT_EQ(volume.at("max"), 5.0);
  EXPECT_EQ(volume.at("mean"), 3.0);
}

}  // namespace
