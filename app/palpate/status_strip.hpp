#pragma once

#include "workbench.hpp"

#include <QAbstractButton>
#include <QFrame>

#include <functional>

class QLabel;

namespace palpate::gui {

/// How near the time step is to the largest stable one: a bar, the numbers and
/// a word, so that the colour says nothing alone.
class StepGauge : public QAbstractButton {
  Q_OBJECT

 public:
  enum class State { none, stable, near_limit, too_large };

  explicit StepGauge(QWidget* parent);
  /// `parts`: how many one step above the limit is taken in.
  void set_steps(double step_s, double stable_step_s, int parts = 1);
  State state() const { return state_; }
  QSize sizeHint() const override;

 protected:
  void paintEvent(QPaintEvent* event) override;

 private:
  double share_ = 0.0;
  State state_ = State::none;
};

/// Device, size, speed, the gauge, frames a second, what draws.
class StatusStrip : public QFrame {
  Q_OBJECT

 public:
  StatusStrip(Workbench& workbench, QWidget* parent);
  /// Where the frames a second and the renderer's name come from.
  void watch(std::function<double()> frames_per_second, std::function<QString()> renderer);

 signals:
  void placeRequested(double x_mm, double y_mm, double z_mm);

 private:
  void refresh();
  void refresh_drawing();
  void explain_step();

  Workbench& workbench_;
  QLabel* device_;
  QLabel* points_;
  QLabel* step_time_;
  QLabel* real_time_;
  StepGauge* gauge_;
  QLabel* fps_;
  QLabel* renderer_;
  QTimer ticker_;
  std::function<double()> frames_per_second_;
  std::function<QString()> renderer_name_;
};

}  // namespace palpate::gui
