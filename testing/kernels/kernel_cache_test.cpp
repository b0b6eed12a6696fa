// Kernels come from the disk where that is right, and from their source in
// every other case.
#include "kernel_cache.hpp"

#include "device_test.hpp"

#include "palpate/compute/cache_folder.hpp"
#include "palpate/compute/kernel_library.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

namespace compute = palpate::compute;
namespace fs = std::filesystem;
using palpate::testing::TemporaryFolder;

namespace {

class KernelsOnDisk : public palpate::testing::DeviceTest {
 protected:
  void SetUp() override {
    DeviceTest::SetUp();
    if (IsSkipped()) return;
    setenv("PALPATE_CACHE_DIR", (folder_ / "cache").c_str(), 1);
    setenv("PALPATE_KERNEL_DIR", folder_.path().c_str(), 1);
    unsetenv("PALPATE_KERNEL_CACHE");
    std::ofstream(folder_ / "answer.cl")
        << "__kernel void answer(__global uint* restrict values) { values[get_global_id(0)] = ANSWER; }\n";
  }
  void TearDown() override {
    unsetenv("PALPATE_KERNEL_DIR");
    setenv("PALPATE_KERNEL_CACHE", "off", 1);
  }

  /// Builds, runs and lets go of the kernel.
  static std::uint32_t answer(const compute::Device& device, const std::string& define) {
    compute::KernelLibrary library(device);
    compute::Kernel kernel = library.build("answer.cl", "answer", {define});
    compute::Buffer buffer = compute::Buffer::allocate(device, 64 * sizeof(std::uint32_t));
    kernel.set_all(buffer);
    kernel.run(64);
    std::uint32_t value = 0;
    buffer.read(&value, sizeof(value));
    return value;
  }
  std::uint32_t answer(const std::string& define) const { return answer(device(), define); }
  std::vector<fs::path> files() const {
    std::vector<fs::path> found;
    const fs::path kernels = folder_ / "cache/kernels";
    if (fs::exists(kernels))
      for (const auto& entry : fs::directory_iterator(kernels)) found.push_back(entry.path());
    return found;
  }
  /// The one file that is not among `before`.
  fs::path new_file(const std::vector<fs::path>& before) const {
    for (const auto& file : files())
      if (std::find(before.begin(), before.end(), file) == before.end()) return file;
    return {};
  }
  TemporaryFolder folder_;
};

}  // namespace

TEST_F(KernelsOnDisk, AreKeptAndTakenFromThere) {
  EXPECT_EQ(answer("ANSWER=41"), 41U);
  ASSERT_EQ(files().size(), 1U);
  const auto before = files();
  EXPECT_EQ(answer("ANSWER=42"), 42U) << "other options are another program";
  ASSERT_EQ(files().size(), 2U);
  // What is on the disk is what runs: the binary of 42 under the name of 41 says so.
  fs::copy_file(new_file(before), before.front(), fs::copy_options::overwrite_existing);
  EXPECT_EQ(answer("ANSWER=41"), 42U);
  EXPECT_EQ(files().size(), 2U);
}

TEST_F(KernelsOnDisk, AreNotAskedForWhereItIsTurnedOff) {
  setenv("PALPATE_KERNEL_CACHE", "off", 1);
  EXPECT_EQ(answer("ANSWER=7"), 7U);
  EXPECT_TRUE(files().empty());
}

TEST_F(KernelsOnDisk, ChangeWithTheSource) {
  EXPECT_EQ(answer("ANSWER=7"), 7U);
  std::ofstream(folder_ / "answer.cl")
      << "__kernel void answer(__global uint* restrict values) { values[get_global_id(0)] = ANSWER + 1; }\n";
  EXPECT_EQ(answer("ANSWER=7"), 8U);
  EXPECT_EQ(files().size(), 2U);
}

TEST_F(KernelsOnDisk, ThatAreDamagedAreBuiltAnewAndReplaced) {
  EXPECT_EQ(answer("ANSWER=7"), 7U);
  ASSERT_EQ(files().size(), 1U);
  const fs::path file = files().front();
  const auto good = compute::read_cached(file);
  ASSERT_TRUE(good);
  // The mark, the checksum, the head, the middle and the tail of the binary.
  const auto size = static_cast<std::streamoff>(fs::file_size(file));
  for (const std::streamoff place :
       {std::streamoff{3}, std::streamoff{40}, std::streamoff{85}, size / 2, size - 1}) {
    {
      std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out);
      stream.seekg(place);
      const auto old = static_cast<char>(stream.get());
      stream.seekp(place);
      stream.put(static_cast<char>(old ^ 0x55));
    }
    ASSERT_FALSE(compute::read_cached(file)) << place;
    EXPECT_EQ(answer("ANSWER=7"), 7U) << place;
    EXPECT_TRUE(compute::read_cached(file)) << "not replaced after damage at " << place;
  }
  for (const auto length : {std::uintmax_t{0}, std::uintmax_t{50}, fs::file_size(file) / 2}) {
    fs::resize_file(file, length);
    EXPECT_EQ(answer("ANSWER=7"), 7U) << length;
    EXPECT_TRUE(compute::read_cached(file)) << "not replaced after " << length << " bytes";
  }
}

TEST_F(KernelsOnDisk, ThatTheDriverRefusesAreBuiltAnewAndReplaced) {
  EXPECT_EQ(answer("ANSWER=7"), 7U);
  ASSERT_EQ(files().size(), 1U);
  const fs::path file = files().front();
  for (const std::string& nonsense : {std::string("nonsense"), std::string(5000, 'n'), std::string()}) {
    ASSERT_TRUE(compute::write_cached(file, nonsense));
    EXPECT_EQ(answer("ANSWER=7"), 7U);
    EXPECT_NE(compute::read_cached(file), nonsense);
  }
  // A program of the right kind without the kernel that is wanted.
  const auto before = files();
  std::ofstream(folder_ / "other.cl") << "__kernel void other(__global uint* values) { values[0] = 1; }\n";
  { compute::KernelLibrary(device()).build("other.cl", "other"); }
  fs::copy_file(new_file(before), file, fs::copy_options::overwrite_existing);
  EXPECT_EQ(answer("ANSWER=7"), 7U);
}

TEST_F(KernelsOnDisk, WithoutAFolderToWriteToAreBuiltEachTime) {
  std::ofstream(folder_ / "cache") << "a file where the folder should be";
  EXPECT_EQ(answer("ANSWER=7"), 7U);
  EXPECT_EQ(answer("ANSWER=7"), 7U);
}

TEST_F(KernelsOnDisk, ServeSeveralAtOnce) {
  constexpr int users = 4;
  std::vector<std::thread> threads;
  std::vector<std::uint32_t> answers(users, 0);
  for (std::size_t n = 0; n < users; ++n)
    threads.emplace_back([&answers, n] {
      const compute::Device own = compute::open_device("");
      for (int round = 0; round < 3; ++round) answers[n] = answer(own, "ANSWER=9");
    });
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(answers, std::vector<std::uint32_t>(users, 9U));
  ASSERT_EQ(files().size(), 1U) << "one whole file, nothing left aside";
  EXPECT_TRUE(compute::read_cached(files().front()));
}
