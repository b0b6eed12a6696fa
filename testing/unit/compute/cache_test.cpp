#include "kernel_cache.hpp"

#include "palpate/compute/cache_folder.hpp"
#include "palpate/compute/device.hpp"
#include "palpate/core/checksum.hpp"
#include "palpate/testing/support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>
#include <thread>

namespace compute = palpate::compute;
namespace fs = std::filesystem;
using compute::KernelCache;
using palpate::testing::TemporaryFolder;

namespace {

std::string bytes_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

void write_bytes(const fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary | std::ios::trunc) << bytes;
}

std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename().string());
  return names;
}

/// Sets variables of the environment and puts them back.
class Environment {
 public:
  void set(const char* name, const char* value) {
    const char* old = std::getenv(name);
    before_.emplace_back(name, old == nullptr ? std::nullopt : std::optional<std::string>(old));
    if (value == nullptr)
      unsetenv(name);
    else
      setenv(name, value, 1);
  }
  ~Environment() {
    for (auto entry = before_.rbegin(); entry != before_.rend(); ++entry) {
      if (entry->second)
        setenv(entry->first.c_str(), entry->second->c_str(), 1);
      else
        unsetenv(entry->first.c_str());
    }
  }

 private:
  std::vector<std::pair<std::string, std::optional<std::string>>> before_;
};

compute::DeviceInfo some_device() {
  compute::DeviceInfo info;
  info.name = "processor";
  info.platform = "platform";
  info.driver = "3.1";
  return info;
}

}  // namespace

TEST(Checksum, IsThatOfTheStandard) {
  // FIPS 180-4 examples: the empty text, "abc", and a message of two blocks.
  EXPECT_EQ(palpate::core::sha256_of(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(palpate::core::sha256_of("abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(palpate::core::sha256_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

TEST(CacheFolder, IsNamedByTheEnvironmentInOrder) {
  Environment environment;
  environment.set("PALPATE_CACHE_DIR", nullptr);
  environment.set("XDG_CACHE_HOME", nullptr);
  environment.set("HOME", "/home/someone");
  EXPECT_EQ(compute::cache_folder(), fs::path("/home/someone/.cache/palpate"));
  environment.set("XDG_CACHE_HOME", "relative/is/ignored");
  EXPECT_EQ(compute::cache_folder(), fs::path("/home/someone/.cache/palpate"));
  environment.set("XDG_CACHE_HOME", "/caches");
  EXPECT_EQ(compute::cache_folder(), fs::path("/caches/palpate"));
  environment.set("PALPATE_CACHE_DIR", "/elsewhere");
  EXPECT_EQ(compute::cache_folder(), fs::path("/elsewhere"));
  environment.set("PALPATE_CACHE_DIR", nullptr);
  environment.set("XDG_CACHE_HOME", nullptr);
  environment.set("HOME", nullptr);
  EXPECT_FALSE(compute::cache_folder());
}

TEST(CachedFile, GivesBackWhatWasWrittenAndNothingElse) {
  const TemporaryFolder folder;
  const fs::path file = folder / "deep/er/file";
  EXPECT_FALSE(compute::read_cached(file));
  std::string binary;
  for (int n = 0; n < 1000; ++n) binary.push_back(static_cast<char>(n % 256));
  for (const std::string& bytes : {std::string(), std::string("x"), binary}) {
    EXPECT_TRUE(compute::write_cached(file, bytes));
    EXPECT_EQ(compute::read_cached(file), bytes);
  }
  EXPECT_THAT(names_in(file.parent_path()), ::testing::ElementsAre("file")) << "nothing is left aside";
}

TEST(CachedFile, WithAnyByteChangedOrAnyTailCutOffIsNotThere) {
  const TemporaryFolder folder;
  const fs::path file = folder / "file";
  ASSERT_TRUE(compute::write_cached(file, "some bytes of a binary"));
  const std::string whole = bytes_of(file);
  for (std::size_t n = 0; n < whole.size(); ++n) {
    std::string damaged = whole;
    damaged[n] = static_cast<char>(damaged[n] ^ 0x10);
    write_bytes(file, damaged);
    EXPECT_FALSE(compute::read_cached(file)) << "byte " << n;
    write_bytes(file, whole.substr(0, n));
    EXPECT_FALSE(compute::read_cached(file)) << "cut at " << n;
  }
  write_bytes(file, whole + "x");
  EXPECT_FALSE(compute::read_cached(file)) << "longer";
  write_bytes(file, whole);
  EXPECT_TRUE(compute::read_cached(file));
}

TEST(CachedFile, ThatCannotBeWrittenIsNoError) {
  const TemporaryFolder folder;
  write_bytes(folder / "file", "in the way");
  EXPECT_FALSE(compute::write_cached(folder / "file" / "inside", "bytes"));
  EXPECT_FALSE(compute::write_cached("/proc/nowhere/file", "bytes"));
  // A disk that is full: every write to it says so.
  EXPECT_FALSE(compute::write_cached("/dev/full/file", "bytes"));
  // A folder stands where the file should be: the rename fails, nothing is left aside.
  fs::create_directories(folder / "taken" / "inner");
  EXPECT_FALSE(compute::write_cached(folder / "taken", "bytes"));
  EXPECT_THAT(names_in(folder.path()), ::testing::UnorderedElementsAre("file", "taken"));
}

TEST(CachedFile, OfManyWritersAtOnceIsOneOfThemWhole) {
  const TemporaryFolder folder;
  const fs::path file = folder / "file";
  std::vector<std::thread> writers;
  std::set<std::string> written;
  for (char c = 'a'; c < 'e'; ++c) written.insert(std::string(20000, c));
  for (const auto& bytes : written)
    writers.emplace_back([&file, &bytes] {
      for (int n = 0; n < 30; ++n) compute::write_cached(file, bytes);
    });
  int odd = 0;
  for (int n = 0; n < 100; ++n) {
    const auto found = compute::read_cached(file);
    if (found && written.count(*found) == 0) ++odd;
  }
  for (auto& writer : writers) writer.join();
  EXPECT_EQ(odd, 0);
  ASSERT_TRUE(compute::read_cached(file));
  EXPECT_EQ(written.count(*compute::read_cached(file)), 1U);
  EXPECT_THAT(names_in(folder.path()), ::testing::ElementsAre("file"));
}

TEST(CachedFile, WrittenOnceIsWhatTheFirstWroteUnlessThatIsDamaged) {
  const TemporaryFolder folder;
  const fs::path file = folder / "file";
  std::vector<std::thread> writers;
  for (char c = 'a'; c < 'e'; ++c)
    writers.emplace_back([&file, c] { compute::write_cached_once(file, std::string(2000, c)); });
  for (auto& writer : writers) writer.join();
  const auto first = compute::read_cached(file);
  ASSERT_TRUE(first);
  EXPECT_TRUE(compute::write_cached_once(file, "later"));
  EXPECT_EQ(compute::read_cached(file), first);
  std::ofstream(file, std::ios::binary | std::ios::app) << "x";
  EXPECT_TRUE(compute::write_cached_once(file, "anew"));
  EXPECT_EQ(compute::read_cached(file), "anew");
  EXPECT_THAT(names_in(folder.path()), ::testing::ElementsAre("file"));
}

TEST(KernelCacheKey, ChangesWithAllThatABinaryDependsOn) {
  const auto device = some_device();
  std::set<std::string> keys;
  keys.insert(KernelCache::key("source", "options", device));
  keys.insert(KernelCache::key("sourceo", "ptions", device));
  keys.insert(KernelCache::key("source ", "options", device));
  keys.insert(KernelCache::key("source", "options -D A", device));
  for (auto member :
       {&compute::DeviceInfo::name, &compute::DeviceInfo::platform, &compute::DeviceInfo::driver}) {
    auto other = device;
    other.*member += "2";
    keys.insert(KernelCache::key("source", "options", other));
  }
  Environment environment;
  environment.set("POCL_KERNELLIB_NAME", "another");
  keys.insert(KernelCache::key("source", "options", device));
  EXPECT_EQ(keys.size(), 8U);
  environment.set("POCL_KERNELLIB_NAME", std::getenv("POCL_KERNELLIB_NAME"));
  EXPECT_EQ(keys.count(KernelCache::key("source", "options", device)), 1U) << "the same each time";
}

TEST(KernelCache, RemovesTheOldestWhereAllDoNotFit) {
  const TemporaryFolder folder;
  // A file is its bytes and 81 of mark and checksum: three of them fit.
  const KernelCache cache(folder / "kernels", 3300);
  const std::string binary(1000, 'x');
  const auto aged = [&](const std::string& key, int hours) {
    fs::last_write_time(folder / "kernels" / (key + ".bin"),
                        fs::file_time_type::clock::now() - std::chrono::hours(hours));
  };
  for (const char* key : {"a", "b", "c"}) cache.store(key, binary);
  aged("a", 5);
  aged("b", 4);
  aged("c", 3);
  EXPECT_TRUE(cache.find("a")) << "now it is the newest";
  cache.store("d", binary);
  EXPECT_TRUE(cache.find("a"));
  EXPECT_FALSE(cache.find("b"));
  EXPECT_TRUE(cache.find("c"));
  EXPECT_TRUE(cache.find("d"));
  cache.store("huge", std::string(5000, 'x'));
  EXPECT_FALSE(cache.find("huge"));
  cache.remove("d");
  EXPECT_FALSE(cache.find("d"));
}
