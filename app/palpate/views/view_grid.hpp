#pragma once

#include "views/slice_widget.hpp"
#include "views/tissue_widget.hpp"
#include "views/view_frame.hpp"

#include <QWidget>

#include <array>

class QGridLayout;
class QButtonGroup;

namespace palpate::gui {

/// How the views share the centre.
enum class ViewLayout { four_up, side_by_side, three_d_large, one };

/// The four views: axial and 3-D above, sagittal and coronal below.
class ViewGrid : public QWidget {
  Q_OBJECT

 public:
  enum Place { axial, three_d, sagittal, coronal, count };

  ViewGrid(Workbench& workbench, ViewState& state, QWidget* parent);

  ViewLayout view_layout() const { return layout_; }
  /// The one that comes back when no view is maximised.
  ViewLayout shared_layout() const { return maximised_ >= 0 ? before_ : layout_; }
  int maximised() const { return maximised_; }  ///< its place, or -1
  void set_layout(ViewLayout layout);
  /// One view large and back.
  void toggle_maximised(int place);
  void reset_views();
  /// The view that has the pointer or the focus, the 3-D view where none has.
  int active_place() const;
  GlView& view(int place) const { return frames_[static_cast<std::size_t>(place)]->view(); }
  TissueWidget& tissue_view() const { return *tissue_; }
  /// Settings with the 3-D view's camera, for a picture.
  visualization::ViewSettings picture_settings() const;
  /// Frames of the 3-D view in the last second.
  double frames_per_second() const;

 signals:
  void hovered(bool inside, double x_mm, double y_mm, double z_mm);
  void layoutChanged();

 private:
  void arrange();
  void add_show_buttons();
  void show_volume();
  void show_geometry();
  void show_flat_scan();
  void show_frame();
  void update_all_contents();

  Workbench& workbench_;
  ViewState& state_;
  QGridLayout* grid_;
  std::array<ViewFrame*, count> frames_{};
  TissueWidget* tissue_;
  QButtonGroup* show_buttons_;
  ViewLayout layout_ = ViewLayout::four_up;
  ViewLayout before_ = ViewLayout::four_up;
  int maximised_ = -1;
  bool flat_ = false;  ///< the scan is one slice, which was made large for it
  int next_slice_ = 0;
  int frames_without_slice_ = 0;
  QElapsedTimer clock_;
  mutable std::vector<qint64> drawn_ms_;
};

}  // namespace palpate::gui
