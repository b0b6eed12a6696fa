#pragma once

#include <QSlider>

namespace palpate::gui {

/// The time slider: a tick for each frame as far as there is room, and a mark
/// under the one that the tissue was built from. A click goes to the place.
class FrameSlider : public QSlider {
  Q_OBJECT

 public:
  explicit FrameSlider(QWidget* parent = nullptr);
  /// -1: none.
  void set_tissue_frame(int frame);
  QSize sizeHint() const override { return {160, 24}; }
  QSize minimumSizeHint() const override { return {80, 24}; }

 protected:
  void paintEvent(QPaintEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void mouseReleaseEvent(QMouseEvent* event) override;

 private:
  double x_of(int frame) const;
  int frame_at(int x) const;
  int tissue_frame_ = -1;
};

}  // namespace palpate::gui
