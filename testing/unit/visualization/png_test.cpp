#include "palpate/core/error.hpp"
#include "palpate/testing/support.hpp"
#include "palpate/visualization/picture.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

using namespace palpate;
using namespace palpate::visualization;
using palpate::testing::TemporaryFolder;

namespace {

core::Picture small_picture() {
  return {3, 2, {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 9, 8, 7, 0, 255, 255, 255, 128, 1, 2, 3, 4}};
}

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void expect_refused(const std::filesystem::path& path) {
  try {
    save_png(path, small_picture());
    FAIL() << path << " was written";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.kind(), core::ErrorKind::output);
    EXPECT_NE(std::string(error.what()).find(path.string()), std::string::npos) << error.what();
  }
}

std::size_t files_in(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

}  // namespace

TEST(SavePng, WritesASignatureAndTheSize) {
  const TemporaryFolder folder;
  save_png(folder / "a.png", small_picture());
  const std::string bytes = bytes_of(folder / "a.png");
  ASSERT_GT(bytes.size(), 26U);
  EXPECT_EQ(bytes.substr(0, 8), "\x89PNG\r\n\x1a\n");
  EXPECT_EQ(bytes.substr(16, 8), std::string("\0\0\0\3\0\0\0\2", 8));  // width, height, big-endian
  EXPECT_EQ(bytes[24], 8);                                             // bits
  EXPECT_EQ(bytes[25], 6);                                             // RGBA
  EXPECT_EQ(files_in(folder.path()), 1U);
}

TEST(SavePng, ReplacesAnOlderPicture) {
  const TemporaryFolder folder;
  std::ofstream(folder / "a.png") << "older";
  save_png(folder / "a.png", small_picture());
  EXPECT_NE(bytes_of(folder / "a.png").substr(0, 5), "older");
  EXPECT_EQ(files_in(folder.path()), 1U);
}

TEST(SavePng, NamesThePlaceThatCannotBeWritten) {
  const TemporaryFolder folder;
  expect_refused(folder / "missing" / "a.png");
  expect_refused(folder.path());
  std::ofstream(folder / "file") << "x";
  expect_refused(folder / "file" / "a.png");
  EXPECT_EQ(files_in(folder.path()), 1U);
}

TEST(SavePng, SaysThatTheDiskIsFull) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  expect_refused("/dev/full");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST(SavePng, RefusesAPictureWithoutPixels) {
  const TemporaryFolder folder;
  EXPECT_THROW(save_png(folder / "a.png", {}), core::Error);
  EXPECT_EQ(files_in(folder.path()), 0U);
}
