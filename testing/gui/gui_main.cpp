#include "theme.hpp"
#include "x_server.hpp"

#include "palpate/testing/support.hpp"

#include <QApplication>
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <memory>

// Each program has its own X server, home and kernel cache; nothing is left.
int main(int argc, char** argv) {
  bool listing = false;
  for (int n = 1; n < argc; ++n) listing = listing || std::strcmp(argv[n], "--gtest_list_tests") == 0;
  ::testing::InitGoogleTest(&argc, argv);
  if (listing) return RUN_ALL_TESTS();

  const palpate::testing::TemporaryFolder home;
  setenv("POCL_CACHE_DIR", home.path().c_str(), 0);
  setenv("PALPATE_CACHE_DIR", home.path().c_str(), 0);
  for (const char* part : {"PALPATE_PROBE", "PALPATE_KERNEL_CACHE", "PALPATE_TUNING"}) setenv(part, "off", 0);
  setenv("XDG_CONFIG_HOME", home.path().c_str(), 1);
  setenv("XDG_RUNTIME_DIR", home.path().c_str(), 0);
  setenv("QT_QPA_PLATFORM", "xcb", 1);
  setenv("QT_ACCESSIBILITY", "0", 1);
  unsetenv("QT_SCALE_FACTOR");
  const palpate::testing::XServer server;
  if (!server.running()) {
    // Said once, by a failing program: the window cannot be tested here.
    std::fprintf(stderr, "Xvfb does not start; scripts/install-packages installs it\n");
    return 1;
  }
  palpate::gui::prepare_application();
  QApplication application(argc, argv);
  QApplication::setApplicationVersion(QStringLiteral("test"));
  QApplication::setQuitOnLastWindowClosed(false);
  palpate::gui::apply_theme(application);
  return RUN_ALL_TESTS();
}
