#include "checksum.hpp"

#include "palpate/core/atomic_output.hpp"
#include "palpate/core/error.hpp"
#include "palpate/session/recipe.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

using palpate::core::write_file;
using palpate::session::file_sha256;
using palpate::session::sha256_of;
using palpate::testing::TemporaryFolder;

// The vectors of FIPS 180-2, appendix B.
TEST(Checksum, KnownVectors) {
  EXPECT_EQ(sha256_of(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256_of(std::string(1000000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Checksum, AFileIsItsBytes) {
  const TemporaryFolder folder;
  write_file(folder / "million", std::string(1000000, 'a'));
  EXPECT_EQ(file_sha256(folder / "million"),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Checksum, AFolderIsItsNamesAndContentsWhateverTheOrder) {
  const TemporaryFolder one;
  write_file(one / "a", "first");
  write_file(one / "b", "second");
  const TemporaryFolder two;
  write_file(two / "b", "second");
  write_file(two / "a", "first");
  EXPECT_EQ(file_sha256(one.path()), file_sha256(two.path()));

  const auto before = file_sha256(two.path());
  std::filesystem::rename(two / "b", two / "c");
  EXPECT_NE(file_sha256(two.path()), before) << "a name counts";
  std::filesystem::rename(two / "c", two / "b");
  write_file(two / "b", "Second");
  EXPECT_NE(file_sha256(two.path()), before) << "a byte counts";
}

TEST(Checksum, AMissingFileIsAnInputError) {
  const TemporaryFolder folder;
  try {
    file_sha256(folder / "none");
    FAIL() << "no error";
  } catch (const palpate::core::Error& error) {
    EXPECT_EQ(error.kind(), palpate::core::ErrorKind::input);
    EXPECT_NE(std::string(error.what()).find((folder / "none").string()), std::string::npos);
  }
}
