#include "device_test.hpp"

#include "palpate/compute/buffer.hpp"
#include "palpate/compute/kernel_library.hpp"
#include "palpate/testing/support.hpp"

#include <gmock/gmock.h>

#include <array>
#include <cstdlib>
#include <fstream>
#include <numeric>
#include <vector>

namespace compute = palpate::compute;
namespace core = palpate::core;
using palpate::testing::TemporaryFolder;

namespace {

/// PALPATE_KERNEL_DIR for as long as it lives.
class KernelFolder {
 public:
  KernelFolder() { setenv("PALPATE_KERNEL_DIR", folder_.path().c_str(), 1); }
  ~KernelFolder() { unsetenv("PALPATE_KERNEL_DIR"); }
  KernelFolder(const KernelFolder&) = delete;
  KernelFolder& operator=(const KernelFolder&) = delete;
  void write(const std::string& file, const std::string& text) const {
    std::ofstream(folder_ / file) << text;
  }

 private:
  TemporaryFolder folder_;
};

class Compute : public palpate::testing::DeviceTest {};

constexpr auto scale_source = R"(
__kernel void scale(__global const float* source, __global float* target, const float factor, const int add,
                    const uint count, const float4 four) {
  const uint n = get_global_id(0);
  if (n < count) target[n] = factor * source[n] + (float)add + four.y * FACTOR;
})";

}  // namespace

TEST_F(Compute, BuffersGoThereAndBack) {
  std::vector<float> values(1001);
  std::iota(values.begin(), values.end(), 1.0F);
  const std::size_t bytes = values.size() * sizeof(float);
  auto first = compute::Buffer::copy_of(device(), values.data(), bytes);
  EXPECT_EQ(first.bytes(), bytes);
  auto second = compute::Buffer::allocate(device(), bytes);
  second.copy_from(first, bytes);
  std::vector<float> back(values.size());
  second.read(back.data(), bytes);
  EXPECT_EQ(back, values);

  const float other = -5.0F;
  second.write(&other, sizeof(other), 8);
  second.read(back.data(), 12);
  EXPECT_EQ(back[2], -5.0F);
  EXPECT_EQ(back[1], 2.0F);

  float seen = 0.0F;
  second.visit([&](const void* data) { seen = static_cast<const float*>(data)[1000]; });
  EXPECT_EQ(seen, 1001.0F);

  second.fill_zero();
  second.read(back.data(), bytes);
  EXPECT_EQ(back, std::vector<float>(values.size(), 0.0F));

  compute::Buffer moved = std::move(first);
  moved.read(back.data(), bytes);
  EXPECT_EQ(back, values);
  EXPECT_EQ(compute::Buffer::allocate(device(), 0).bytes(), 0U);
}

TEST_F(Compute, LeavingABufferIsRefused) {
  auto buffer = compute::Buffer::allocate(device(), 16);
  std::array<char, 32> room{};
  EXPECT_THROW(buffer.read(room.data(), 17), core::Error);
  EXPECT_THROW(buffer.read(room.data(), 8, 9), core::Error);
  EXPECT_THROW(buffer.write(room.data(), 32), core::Error);
}

TEST_F(Compute, AFailingCallIsNamedWithItsCodeAndSize) {
  const std::size_t bytes = std::size_t{1} << 50;
  try {
    compute::Buffer::allocate(device(), bytes);
    FAIL() << "no device has a buffer of " << bytes << " bytes";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.exit_code(), 4);
    EXPECT_THAT(error.what(),
                ::testing::AllOf(::testing::HasSubstr("clCreateBuffer"), ::testing::HasSubstr("CL_"),
                                 ::testing::HasSubstr(std::to_string(bytes))));
  }
}

TEST_F(Compute, AKernelWritesIntoHostMemory) {
  const KernelFolder folder;
  folder.write("scale.cl", scale_source);
  compute::KernelLibrary library(device());
  auto kernel = library.build("scale.cl", "scale", {"FACTOR=2.0f"});
  alignas(64) std::array<float, 100> source{};
  alignas(64) std::array<float, 100> target{};
  std::iota(source.begin(), source.end(), 0.0F);
  const auto from = compute::Buffer::copy_of(device(), source.data(), sizeof(source));
  const auto to = compute::Buffer::over_host_memory(device(), target.data(), sizeof(target));
  const std::array<float, 4> four{9.0F, 0.25F, 9.0F, 9.0F};
  kernel.set_all(from, to, 3.0F, std::int32_t{-1}, std::uint32_t{99}, four);
  kernel.run(99);
  to.sync_to_host();
  EXPECT_EQ(target[0], -0.5F);
  EXPECT_EQ(target[98], 293.5F);
  EXPECT_EQ(target[99], 0.0F);  // outside the count that the kernel guards
}

TEST_F(Compute, AKernelOfTheFolderTakesPrecedenceAndDefinesMatter) {
  EXPECT_THROW(compute::KernelLibrary::source("scale.cl"), core::Error);
  const KernelFolder folder;
  folder.write("scale.cl", scale_source);
  EXPECT_EQ(compute::KernelLibrary::source("scale.cl"), scale_source);
  EXPECT_THAT(compute::KernelLibrary::source("health.cl"), ::testing::HasSubstr("__kernel void health"));
  compute::KernelLibrary library(device());
  std::array<float, 2> results{};
  const auto target = compute::Buffer::allocate(device(), sizeof(float));
  for (std::size_t n = 0; n < 2; ++n) {
    auto kernel = library.build("scale.cl", "scale", {"FACTOR=" + std::to_string(n + 1) + ".0f"});
    kernel.set_all(target, target, 0.0F, std::int32_t{0}, std::uint32_t{1}, std::array<float, 4>{0, 1, 0, 0});
    kernel.run(1);
    target.read(&results[n], sizeof(float));
  }
  EXPECT_EQ(results[0], 1.0F);
  EXPECT_EQ(results[1], 2.0F);
}

TEST_F(Compute, ABrokenKernelShowsTheCompilersLog) {
  const KernelFolder folder;
  folder.write("broken.cl", "__kernel void broken(__global float* a) {\n  a[0] = undeclared_thing;\n}\n");
  compute::KernelLibrary library(device());
  try {
    library.build("broken.cl", "broken", {"LINKS_PER_POINT=12"});
    FAIL() << "the kernel does not compile";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.exit_code(), 4);
    EXPECT_EQ(error.code(), "kernel-build");
    EXPECT_THAT(error.what(), ::testing::AllOf(::testing::HasSubstr("broken.cl"),
                                               ::testing::HasSubstr("undeclared_thing")));
    EXPECT_THAT(error.details(), ::testing::AllOf(::testing::HasSubstr("undeclared_thing"),
                                                  ::testing::HasSubstr("LINKS_PER_POINT=12")));
  }
}

TEST_F(Compute, AnUnknownKernelNameIsNamed) {
  compute::KernelLibrary library(device());
  try {
    library.build("health.cl", "no_such_kernel", {"GROUP_SIZE=64"});
    FAIL() << "there is no such kernel";
  } catch (const core::Error& error) {
    EXPECT_THAT(error.what(), ::testing::AllOf(::testing::HasSubstr("clCreateKernel"),
                                               ::testing::HasSubstr("no_such_kernel")));
  }
}
