#pragma once

#include "palpate/compute/device.hpp"
#include "palpate/core/error.hpp"

#include <gtest/gtest.h>

#include <optional>

namespace palpate::testing {

/// A test that needs an OpenCL device: the one that PALPATE_DEVICE names, or
/// the default. Skipped with the reason where there is none.
class DeviceTest : public ::testing::Test {
 protected:
  void SetUp() override {
    try {
      device_ = compute::open_device("");
    } catch (const core::Error& error) {
      GTEST_SKIP() << "no OpenCL device: " << error.what();
    }
  }
  const compute::Device& device() const { return *device_; }

 private:
  std::optional<compute::Device> device_;
};

}  // namespace palpate::testing
