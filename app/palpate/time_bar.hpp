#pragma once

#include "frame_clock.hpp"
#include "workbench.hpp"

#include <QElapsedTimer>
#include <QFrame>
#include <QTimer>

#include <memory>

class QAction;
namespace Ui {
class TimeBar;
}

namespace palpate::gui {

/// The frames of a 4-D scan: play, step, and a slider with the time. It belongs
/// to the scan, not to the simulation, and is only there where there are frames.
class TimeBar : public QFrame {
  Q_OBJECT

 public:
  TimeBar(Workbench& workbench, QWidget* parent);
  ~TimeBar() override;
  bool playing() const { return workbench_.scan_playing(); }

 protected:
  bool eventFilter(QObject* watched, QEvent* event) override;

 private:
  void wire();
  void take_scan();
  void refresh();
  void refresh_state();
  void play();
  void stop();
  void tick();
  void step(int count);

  Workbench& workbench_;
  std::unique_ptr<Ui::TimeBar> ui_;
  QAction* play_action_;
  FrameClock clock_;
  QTimer ticker_;
  QTimer announce_;
  QElapsedTimer since_start_;
  int start_frame_ = 0;
};

}  // namespace palpate::gui
