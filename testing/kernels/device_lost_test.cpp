// A device that stops in mid-run: said as what it is, and the last state that
// was shown goes on elsewhere. The loss is made by PALPATE_FAIL_AFTER_LAUNCHES.
#include "tissue_for_tests.hpp"

#include "palpate/compute/device.hpp"
#include "palpate/core/error.hpp"
#include "palpate/session/simulation_driver.hpp"
#include "palpate/simulation/solver.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <optional>

namespace compute = palpate::compute;
namespace session = palpate::session;
namespace simulation = palpate::simulation;
using palpate::testing::cube_tissue;
using ::testing::HasSubstr;

namespace {

/// More than building and warming a solver up takes, fewer than a run.
constexpr const char* launches = "600";

class LostDevice : public ::testing::Test {
 protected:
  void SetUp() override {
    try {
      compute::open_device("");
    } catch (const palpate::core::Error& error) {
      GTEST_SKIP() << "no OpenCL device: " << error.what();
    }
    setenv("PALPATE_FAIL_AFTER_LAUNCHES", launches, 1);
  }
  void TearDown() override { unsetenv("PALPATE_FAIL_AFTER_LAUNCHES"); }
};

/// What a driver says, waited for without sleeping.
struct Heard {
  std::mutex mutex;
  std::condition_variable changed;
  std::optional<session::DriverEvent> failed;
  bool frame = false;

  void tell(const session::DriverEvent& event) {
    const std::lock_guard<std::mutex> lock(mutex);
    if (event.kind == session::DriverEvent::Kind::failed) failed = event;
    changed.notify_all();
  }
  void notify() {
    const std::lock_guard<std::mutex> lock(mutex);
    frame = true;
    changed.notify_all();
  }
  template <typename Done>
  bool wait(Done done) {
    std::unique_lock<std::mutex> lock(mutex);
    return changed.wait_for(lock, std::chrono::seconds(60), done);
  }
};

}  // namespace

TEST_F(LostDevice, IsToldFromOtherErrorsAndTheLastStateGoesOnWithTheReference) {
  const auto built = cube_tissue(6);
  const compute::Device device = compute::open_device("");
  const auto solver = simulation::make_opencl_solver(device, built.tissue, {});
  simulation::State last = solver->state();
  last.velocities_mm_per_s.assign(last.positions_mm.size(), Eigen::Vector3f(1.0F, 0.0F, 0.0F));
  solver->set_state(last);
  std::optional<palpate::core::Error> lost;
  for (int batch = 0; batch < 1000 && !lost; ++batch) {
    try {
      solver->step(1, 0.001);
      last = solver->state();
    } catch (const palpate::core::Error& error) {
      lost = error;
    }
  }
  ASSERT_TRUE(lost) << "the device was not lost";
  EXPECT_EQ(lost->code(), "device-lost");
  EXPECT_EQ(lost->exit_code(), 4);
  EXPECT_THAT(lost->what(), HasSubstr(device.info().name));
  EXPECT_THAT(lost->what(), HasSubstr("reference"));
  EXPECT_THAT(lost->details(), HasSubstr("CL_DEVICE_NOT_AVAILABLE"));
  EXPECT_THROW(solver->state(), palpate::core::Error) << "what it held is gone";
  EXPECT_GT(last.time_s, 0.0);
  const auto elsewhere = simulation::make_reference_solver(built.tissue, {});
  elsewhere->set_state(last);
  elsewhere->step(1, 0.001);
  EXPECT_DOUBLE_EQ(elsewhere->time_s(), last.time_s + 0.001);
}

TEST_F(LostDevice, LeavesTheWindowItsLastFrameToGoOnFrom) {
  session::DriverSetup setup;
  setup.tissue = cube_tissue(6);
  Heard heard;
  std::optional<session::Frame> last;
  {
    session::SimulationDriver driver(
        setup, [&heard] { heard.notify(); }, [&heard](const auto& event) { heard.tell(event); });
    driver.play();
    bool over = false;
    while (!over) {
      ASSERT_TRUE(heard.wait([&heard] { return heard.frame || heard.failed.has_value(); }));
      {
        const std::lock_guard<std::mutex> lock(heard.mutex);
        heard.frame = false;
        over = heard.failed.has_value();
      }
      if (auto taken = driver.take_frame()) last = std::move(taken);
    }
  }
  EXPECT_EQ(heard.failed->code, "device-lost");
  ASSERT_TRUE(last);
  ASSERT_TRUE(last->positions_mm);
  ASSERT_EQ(last->positions_mm->size(), setup.tissue.tissue->points.size());

  setup.device = "reference";
  setup.start.emplace();
  setup.start->time_s = last->time_s;
  setup.start->positions_mm = *last->positions_mm;
  setup.start->velocities_mm_per_s.assign(last->positions_mm->size(), Eigen::Vector3f::Zero());
  Heard later;
  session::SimulationDriver driver(
      setup, [&later] { later.notify(); }, [&later](const auto& event) { later.tell(event); });
  ASSERT_TRUE(later.wait([&later] { return later.frame || later.failed.has_value(); }));
  EXPECT_FALSE(later.failed) << later.failed->text;
  const auto first = driver.take_frame();
  ASSERT_TRUE(first);
  EXPECT_DOUBLE_EQ(first->time_s, last->time_s);
}
