#include "tuning.hpp"

#include "device_test.hpp"

#include "palpate/compute/tuning_store.hpp"
#include "palpate/testing/cube_tissue.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <vector>

namespace compute = palpate::compute;
namespace fs = std::filesystem;
namespace simulation = palpate::simulation;

namespace {

/// With a folder to remember in; the other tests have tuning turned off.
class Tuning : public palpate::testing::DeviceTest {
 protected:
  void SetUp() override {
    DeviceTest::SetUp();
    if (IsSkipped()) return;
    unsetenv("PALPATE_TUNING");
    setenv("PALPATE_CACHE_DIR", (folder_ / "cache").c_str(), 1);
  }
  void TearDown() override { setenv("PALPATE_TUNING", "off", 1); }

  simulation::MakeTrial counting() {
    return [this](std::shared_ptr<const palpate::model::Tissue> tissue, unsigned width) {
      tried_.push_back(width);
      // The reference is quick to make and runs everywhere; which is best is the clock's.
      return simulation::make_reference_solver(std::move(tissue), {});
    };
  }
  palpate::testing::TemporaryFolder folder_;
  std::vector<unsigned> tried_;
};

}  // namespace

TEST_F(Tuning, MeasuresOnceAndThenHolds) {
  const unsigned first = simulation::tuned_points_per_item(device(), "key", counting());
  ASSERT_FALSE(tried_.empty());
  EXPECT_NE(std::find(tried_.begin(), tried_.end(), first), tried_.end()) << "one of those that were tried";
  const auto trials = tried_.size();
  for (int n = 0; n < 3; ++n)
    EXPECT_EQ(simulation::tuned_points_per_item(device(), "key", counting()), first);
  EXPECT_EQ(tried_.size(), trials) << "nothing is measured twice";
  simulation::tuned_points_per_item(device(), "another key", counting());
  EXPECT_GT(tried_.size(), trials);
}

TEST_F(Tuning, LeavesTheRuleWhereItIsOffOrCannotRemember) {
  setenv("PALPATE_TUNING", "off", 1);
  EXPECT_EQ(simulation::tuned_points_per_item(device(), "key", counting()), 0U);
  unsetenv("PALPATE_TUNING");
  std::ofstream(folder_ / "cache") << "a file where the folder should be";
  EXPECT_EQ(simulation::tuned_points_per_item(device(), "key", counting()), 0U);
  EXPECT_TRUE(tried_.empty()) << "a choice by the clock that is forgotten would make two runs differ";
}

TEST_F(Tuning, LeavesTheRuleWhereNoTrialRuns) {
  const simulation::MakeTrial failing = [this](std::shared_ptr<const palpate::model::Tissue>,
                                               unsigned width) -> std::unique_ptr<simulation::Solver> {
    tried_.push_back(width);
    throw palpate::core::Error(palpate::core::ErrorKind::device, "kernel-build", "no");
  };
  EXPECT_EQ(simulation::tuned_points_per_item(device(), "key", failing), 0U);
  const auto trials = tried_.size();
  EXPECT_GT(trials, 0U);
  EXPECT_EQ(simulation::tuned_points_per_item(device(), "key", failing), 0U);
  EXPECT_EQ(tried_.size(), trials) << "that is remembered too";
}

TEST_F(Tuning, GivesTheSameBitsInTwoRunsOfASolver) {
  const auto tissue = palpate::testing::cube_tissue(5);
  simulation::State from{0.0, tissue->points.positions_mm, {}};
  from.velocities_mm_per_s.assign(from.positions_mm.size(), Eigen::Vector3f(1.0F, 2.0F, 3.0F));
  from.positions_mm.front() += Eigen::Vector3f(0.2F, 0.0F, 0.1F);
  const auto run = [&] {
    simulation::OpenclOptions options;
    options.layout = simulation::LayoutChoice::explicit_links;
    const auto solver = simulation::make_opencl_solver(device(), tissue, {}, options);
    solver->set_state(from);
    solver->step(20, 0.001);
    return solver->state().positions_mm;
  };
  const auto first = run();
  EXPECT_EQ(first, run());
  EXPECT_FALSE(fs::is_empty(folder_ / "cache/tuning"));
}

TEST(TuningStore, KeepsTheFirstValueByDeviceDriverAndKey) {
  const palpate::testing::TemporaryFolder folder;
  const compute::TuningStore store(folder / "tuning");
  compute::DeviceInfo device;
  device.name = "device";
  device.driver = "1.0";
  EXPECT_FALSE(store.find(device, "key"));
  EXPECT_EQ(store.settle(device, "key", "8"), "8");
  EXPECT_EQ(store.settle(device, "key", "16"), "8") << "the first holds";
  EXPECT_EQ(store.find(device, "key"), "8");
  EXPECT_FALSE(store.find(device, "other key"));
  auto newer = device;
  newer.driver = "1.1";
  EXPECT_FALSE(store.find(newer, "key"));
  auto other = device;
  other.name = "other";
  EXPECT_FALSE(store.find(other, "key"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "tuning"), fs::directory_iterator()), 1)
      << "nothing is left aside";
}

TEST(TuningStore, IgnoresADamagedFileAndWritesItAnew) {
  const palpate::testing::TemporaryFolder folder;
  const compute::TuningStore store(folder / "tuning");
  const compute::DeviceInfo device;
  ASSERT_EQ(store.settle(device, "key", "8"), "8");
  const fs::path file = fs::directory_iterator(folder / "tuning")->path();
  fs::resize_file(file, fs::file_size(file) - 1);
  EXPECT_FALSE(store.find(device, "key"));
  EXPECT_EQ(store.settle(device, "key", "16"), "16");
  EXPECT_EQ(store.find(device, "key"), "16");
}

TEST(TuningStore, WithoutAFolderRemembersNothing) {
  const palpate::testing::TemporaryFolder folder;
  std::ofstream(folder / "tuning") << "a file where the folder should be";
  const compute::TuningStore store(folder / "tuning");
  EXPECT_FALSE(store.settle({}, "key", "8"));
  EXPECT_FALSE(store.find({}, "key"));
}
