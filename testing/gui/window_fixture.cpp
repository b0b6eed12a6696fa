#include "window_fixture.hpp"

#include "palpate/imaging/phantom.hpp"
#include "palpate/imaging/writer.hpp"

#include <QAbstractButton>
#include <QElapsedTimer>

#include <cmath>
#include <random>

namespace palpate::testing {

bool wait_for(const std::function<bool()>& reached, int limit_ms) {
  QElapsedTimer clock;
  clock.start();
  while (!reached()) {
    if (clock.elapsed() > limit_ms) return false;
    // Returns as soon as something happened; the timer only bounds the wait.
    QTimer::singleShot(20, qApp, [] {});
    QCoreApplication::processEvents(QEventLoop::WaitForMoreEvents);
  }
  return true;
}

imaging::WriteOptions as_bytes(bool compress) {
  imaging::WriteOptions options;
  options.pixel_type = "uint8";
  options.compress = compress;
  return options;
}

WindowTest::WindowTest() {
  imaging::PhantomParameters parameters;
  parameters.size = sample_size;
  const auto file = folder_ / "sample heart.mha";
  imaging::write(file, imaging::make_phantom(parameters).frames, 0.0, as_bytes());
  sample_path_ = QString::fromStdString(file.string());
}

WindowTest::~WindowTest() { close_window(); }

void WindowTest::make_window(const QString& device) {
  gui::WindowOptions options;
  options.settings_file = QString::fromStdString((folder_ / "settings.ini").string());
  options.sample_file = sample_path_;
  options.device = device;
  window_ = std::make_unique<gui::MainWindow>(options);
  window_->resize(1280, 800);
  window_->show();
  ASSERT_TRUE(QTest::qWaitForWindowExposed(window_.get()));
  // There is no window manager that would give it the keys.
  window_->activateWindow();
  ASSERT_TRUE(QTest::qWaitForWindowActive(window_.get()));
}

void WindowTest::close_window() {
  if (!window_) return;
  window_->close();
  window_.reset();
}

QString WindowTest::noise_volume(const char* name, int size) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> value(0.0F, 255.0F);
  const core::ImageGeometry geometry({size, size, size}, {0.5, 0.5, 0.5}, {0.0, 0.0, 0.0});
  std::vector<float> voxels(geometry.voxel_count());
  for (auto& voxel : voxels) voxel = std::floor(value(random));
  const auto file = folder_ / name;
  imaging::write(file, {core::Volume(geometry, std::move(voxels))}, 0.0, as_bytes(false));
  return QString::fromStdString(file.string());
}

void WindowTest::click(const char* button) {
  auto& found = find<QAbstractButton>(button);
  ASSERT_TRUE(found.isVisible()) << button << " is not visible";
  ASSERT_TRUE(found.isEnabled()) << button << " is not enabled";
  QTest::mouseClick(&found, Qt::LeftButton);
}

void WindowTest::trigger(const char* action) {
  auto& found = find<QAction>(action);
  ASSERT_TRUE(found.isEnabled()) << action << " is not enabled";
  found.trigger();
}

void WindowTest::key(int key, Qt::KeyboardModifiers modifiers) {
  QTest::keyClick(window_.get(), static_cast<Qt::Key>(key), modifiers);
}

void WindowTest::open_sample() {
  click("emptySampleButton");
  ASSERT_TRUE(wait_for([this] { return workbench().has_volume(); }));
}

void WindowTest::build_tissue() {
  workbench().build_tissue();
  ASSERT_TRUE(wait_for(
      [this] { return workbench().simulation_ready() && workbench().last_frame().has_value(); }, 60000));
}

QPointF WindowTest::viewport(const QWidget& widget, const QPoint& place) {
  return QPointF(place.x(), widget.height() - 1 - place.y()) * widget.devicePixelRatioF();
}

void WindowTest::drag(QWidget& widget, const QPoint& from, const QPoint& by, Qt::MouseButton button,
                      Qt::KeyboardModifiers modifiers) {
  constexpr int steps = 8;
  QTest::mousePress(&widget, button, modifiers, from);
  for (int step = 1; step <= steps; ++step) {
    const QPointF place = QPointF(from) + QPointF(by) * step / steps;
    QMouseEvent move(QEvent::MouseMove, place, widget.mapToGlobal(place.toPoint()), Qt::NoButton, button,
                     modifiers);
    QApplication::sendEvent(&widget, &move);
    QCoreApplication::processEvents();
  }
}

std::vector<float> WindowTest::surface_now() {
  const auto& frame = workbench().last_frame();
  if (!frame || !frame->surface) return {};
  const auto& surface = *frame->surface;
  return {surface.vertices(), surface.vertices() + 3 * surface.vertex_count()};
}

double WindowTest::largest_move_mm(const std::vector<float>& before, const std::vector<float>& after) {
  if (before.empty() || before.size() != after.size()) return -1.0;
  double largest = 0.0;
  for (std::size_t n = 0; n + 2 < before.size(); n += 3) {
    const double x = after[n] - before[n];
    const double y = after[n + 1] - before[n + 1];
    const double z = after[n + 2] - before[n + 2];
    largest = std::max(largest, std::sqrt(x * x + y * y + z * z));
  }
  return largest;
}

}  // namespace palpate::testing
