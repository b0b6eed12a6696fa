#include "cli_support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>

using namespace palpate::testing;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

namespace {

/// Width and height of a PNG, from its first chunk.
std::array<std::uint32_t, 2> png_size(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<unsigned char, 24> head{};
  file.read(reinterpret_cast<char*>(head.data()), head.size());
  EXPECT_TRUE(file.good()) << path;
  EXPECT_EQ(head[1], 'P');
  const auto number = [&](std::size_t at) {
    return (std::uint32_t{head[at]} << 24U) | (std::uint32_t{head[at + 1]} << 16U) |
           (std::uint32_t{head[at + 2]} << 8U) | std::uint32_t{head[at + 3]};
  };
  return {number(16), number(20)};
}

/// No X server, no Wayland; nothing said on stderr.
ProgramResult render(const Words& arguments) {
  Words words = {"render", sample(), "--threshold", "80", "--stride", "2", "--min-component", "100"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return cli_with({"-u", "DISPLAY", "-u", "WAYLAND_DISPLAY"}, words);
}

}  // namespace

TEST(CliRender, DrawsEveryViewInTheExactSizeWithoutADisplay) {
  const TemporaryFolder folder;
  const struct {
    const char* view;
    const char* show;
    std::uint32_t width, height;
  } cases[] = {{"four-up", "surface", 801, 603}, {"side-by-side", "points", 640, 240},
               {"3d", "links", 333, 200},        {"axial", "surface", 256, 256},
               {"coronal", "surface", 101, 97},  {"sagittal", "surface", 64, 300}};
  for (const auto& one : cases) {
    const auto path = folder / (std::string(one.view) + ".png");
    const auto result = render({"-o", path.string(), "--view", one.view, "--show", one.show, "--size",
                                std::to_string(one.width) + "x" + std::to_string(one.height)});
    ASSERT_EQ(result.exit_code, 0) << one.view << "\n" << result.error;
    EXPECT_EQ(result.error, "") << "the environment's chatter stays off the screen";
    EXPECT_EQ(png_size(path), (std::array<std::uint32_t, 2>{one.width, one.height})) << one.view;
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 6) << "nothing else is left";
}

TEST(CliRender, APulledTissueIsAnotherPicture) {
  const TemporaryFolder folder;
  write_file(folder / "pull.json", pull_gesture(12.0, 0.2, 10.0));
  const auto rest = folder / "rest.png";
  const auto pulled = folder / "pulled.png";
  const Words common = {"--size", "320x240", "--view", "3d", "--background", "white"};
  Words one = {"-o", rest.string()};
  one.insert(one.end(), common.begin(), common.end());
  Words two = {"-o",       pulled.string(), "--gesture", (folder / "pull.json").string(),
               "--device", "reference",     "--json"};
  two.insert(two.end(), common.begin(), common.end());
  ASSERT_EQ(render(one).exit_code, 0);
  const auto result = render(two);
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const auto object = nlohmann::json::parse(result.out);
  EXPECT_EQ(object.at("size_px"), nlohmann::json::parse("[320, 240]"));
  EXPECT_GT(object.at("simulation").at("max_displacement_mm").get<double>(), 10.0);
  const auto bytes = [](const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return std::string((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  };
  EXPECT_NE(bytes(rest), bytes(pulled));
}
