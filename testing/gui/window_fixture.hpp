#pragma once

#include "main_window.hpp"
#include "views/view_grid.hpp"

#include "palpate/imaging/writer.hpp"
#include "palpate/testing/support.hpp"

#include <QAction>
#include <QApplication>
#include <QtTest>
#include <gtest/gtest.h>

#include <functional>
#include <memory>

namespace palpate::testing {

/// Runs the event loop until `reached` holds; false after the time limit.
bool wait_for(const std::function<bool()>& reached, int limit_ms = 30000);

/// Voxels written as whole numbers of 8 bits.
imaging::WriteOptions as_bytes(bool compress = true);

/// A window of 1280 x 800 with its own settings and a small sample heart.
class WindowTest : public ::testing::Test {
 protected:
  /// Voxels along the sample's longest side.
  static constexpr int sample_size = 64;

  WindowTest();
  ~WindowTest() override;

  void make_window(const QString& device = {});
  void close_window();
  gui::MainWindow& window() { return *window_; }
  gui::Workbench& workbench() { return window_->workbench(); }
  bool has_window() const { return window_ != nullptr; }
  const TemporaryFolder& folder() const { return folder_; }
  QString sample_path() const { return sample_path_; }
  /// A volume of uniform noise, `size` voxels a side, that takes a while to build.
  QString noise_volume(const char* name, int size);

  /// The one widget or object of this name; the test fails where there is none.
  template <typename T>
  T& find(const char* name) {
    T* found = window_->findChild<T*>(QString::fromLatin1(name));
    if (found == nullptr) throw std::runtime_error(std::string("nothing is named ") + name);
    return *found;
  }
  void click(const char* button);
  void trigger(const char* action);
  void key(int key, Qt::KeyboardModifiers modifiers = Qt::NoModifier);

  void open_sample();
  void build_tissue();
  /// The pixel of a view under a place of its widget, as the views count them.
  static QPointF viewport(const QWidget& widget, const QPoint& place);
  /// A left drag by the offset, in steps, with the event loop running between.
  void drag(QWidget& widget, const QPoint& from, const QPoint& by, Qt::MouseButton button = Qt::LeftButton,
            Qt::KeyboardModifiers modifiers = Qt::NoModifier);
  /// Vertices of the last frame's surface; empty where there is none.
  std::vector<float> surface_now();
  /// Largest move of a vertex between two such lists, in mm.
  static double largest_move_mm(const std::vector<float>& before, const std::vector<float>& after);

 private:
  TemporaryFolder folder_;
  QString sample_path_;
  std::unique_ptr<gui::MainWindow> window_;
};

}  // namespace palpate::testing
