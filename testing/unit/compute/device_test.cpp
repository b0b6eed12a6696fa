#include "palpate/compute/device.hpp"

#include "palpate/compute/kernel_library.hpp"
#include "palpate/core/error.hpp"
#include "palpate/testing/support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

namespace compute = palpate::compute;
using palpate::testing::run_program;
using palpate::testing::TemporaryFolder;

namespace {

palpate::testing::ProgramResult probe_with(const std::vector<std::string>& environment,
                                           const std::vector<std::string>& arguments = {}) {
  std::vector<std::string> words = environment;
  words.push_back((palpate::testing::program_folder() / "device_probe").string());
  words.insert(words.end(), arguments.begin(), arguments.end());
  return run_program("/usr/bin/env", words);
}

}  // namespace

TEST(Devices, WithoutADriverTheListIsEmptyAndOpeningSaysWhatToInstall) {
  const TemporaryFolder empty;
  const auto result = probe_with({"OCL_ICD_VENDORS=" + empty.path().string() + "/"});
  EXPECT_EQ(result.signal, 0);
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.out, ::testing::HasSubstr("devices 0"));
  EXPECT_THAT(result.error, ::testing::HasSubstr("pocl-opencl-icd"));
}

TEST(Devices, ABrokenDriverIsNoDevice) {
  const TemporaryFolder folder;
  std::filesystem::create_symlink("/nowhere/libbroken.so", folder / "libbroken.so");
  const auto result = probe_with({"OCL_ICD_VENDORS=" + (folder / "libbroken.so").string()});
  EXPECT_EQ(result.signal, 0);
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.out, ::testing::HasSubstr("devices 0"));
}

TEST(Devices, ExactlyOneUsableDeviceIsTheDefaultAndEachHasAReason) {
  const auto devices = compute::list_devices();
  const bool any_usable = std::any_of(devices.begin(), devices.end(), [](const auto& d) { return d.usable; });
  if (!any_usable) GTEST_SKIP() << "no usable OpenCL device here";
  int defaults = 0;
  for (std::size_t n = 0; n < devices.size(); ++n) {
    EXPECT_EQ(devices[n].index, static_cast<int>(n));
    EXPECT_FALSE(devices[n].name.empty());
    EXPECT_FALSE(devices[n].reason.empty());
    EXPECT_GE(devices[n].float_vector_width, 1U);
    if (devices[n].type == compute::DeviceType::gpu) {
      EXPECT_EQ(devices[n].float_vector_width, 1U);
    }
    if (devices[n].is_default) {
      EXPECT_TRUE(devices[n].usable);
      ++defaults;
    }
  }
  EXPECT_EQ(defaults, 1);
}

TEST(Devices, SelectedByIndexNameAndEnvironment) {
  const auto devices = compute::list_devices();
  const auto chosen =
      std::find_if(devices.begin(), devices.end(), [](const auto& d) { return d.is_default; });
  if (chosen == devices.end()) GTEST_SKIP() << "no usable OpenCL device here";
  const std::string opened = "opened " + std::to_string(chosen->index);
  const std::string index = std::to_string(chosen->index);
  std::string shouted = chosen->name;
  std::transform(shouted.begin(), shouted.end(), shouted.begin(),
                 [](unsigned char c) { return std::toupper(c); });
  EXPECT_THAT(probe_with({"-u", "PALPATE_DEVICE"}).out, ::testing::HasSubstr(opened));
  EXPECT_THAT(probe_with({}, {index}).out, ::testing::HasSubstr(opened));
  EXPECT_THAT(probe_with({}, {shouted}).out, ::testing::HasSubstr(opened));
  EXPECT_THAT(probe_with({"PALPATE_DEVICE=" + index}).out, ::testing::HasSubstr(opened));
  // The caller's word comes before the environment's.
  EXPECT_THAT(probe_with({"PALPATE_DEVICE=no such thing"}, {index}).out, ::testing::HasSubstr(opened));
  const auto unknown = probe_with({"PALPATE_DEVICE=no such thing"});
  EXPECT_EQ(unknown.exit_code, 4);
  EXPECT_THAT(unknown.error,
              ::testing::AllOf(::testing::HasSubstr("no such thing"), ::testing::HasSubstr(chosen->name)));
  EXPECT_EQ(probe_with({}, {"99"}).exit_code, 4);
}

TEST(Devices, TheReferenceIsAskedForByName) {
  EXPECT_TRUE(compute::is_reference_selector("reference"));
  EXPECT_TRUE(compute::is_reference_selector("Reference"));
  EXPECT_FALSE(compute::is_reference_selector("0"));
  EXPECT_FALSE(compute::is_reference_selector("pocl"));
}

TEST(Devices, AnUnknownKernelFileIsADefectOfTheProgram) {
  try {
    compute::KernelLibrary::source("nowhere.cl");
    FAIL() << "there is no such kernel";
  } catch (const palpate::core::Error& error) {
    EXPECT_EQ(error.exit_code(), 1);
    EXPECT_THAT(error.what(), ::testing::HasSubstr("nowhere.cl"));
  }
  EXPECT_THAT(compute::KernelLibrary::source("explicit.cl"), ::testing::HasSubstr("__kernel void stage"));
}
