#include "window_fixture.hpp"

#include <QLabel>
#include <QPushButton>

#include <cstdlib>

namespace palpate::testing {
namespace {

// The ICD loader reads its folder once, so these tests have a program of their own.
class NoDevice : public WindowTest {
 protected:
  static void SetUpTestSuite() {
    static const TemporaryFolder empty;
    setenv("OCL_ICD_VENDORS", empty.path().c_str(), 1);
    unsetenv("PALPATE_DEVICE");
  }
};

TEST_F(NoDevice, IsSaidAndTheReferenceIsOffered) {
  make_window();
  open_sample();
  workbench().build_tissue();
  ASSERT_TRUE(wait_for([this] { return find<QFrame>("messageBar").isVisible(); }));
  EXPECT_TRUE(workbench().has_tissue()) << "the tissue needs no device";
  EXPECT_FALSE(find<QLabel>("messageText").text().isEmpty());
  ASSERT_TRUE(find<QPushButton>("messageOffer").isVisible());
  click("messageOffer");
  ASSERT_TRUE(
      wait_for([this] { return workbench().simulation_ready() && workbench().last_frame().has_value(); }));
  EXPECT_FALSE(find<QFrame>("messageBar").isVisible());
  workbench().step_once();
  ASSERT_TRUE(wait_for([this] { return workbench().last_frame()->time_s > 0.0; }));
}

}  // namespace
}  // namespace palpate::testing
