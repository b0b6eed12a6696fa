#include "views/view_state.hpp"

#include <algorithm>

namespace palpate::gui {

void ViewState::set_settings(const visualization::ViewSettings& settings) {
  settings_ = settings;
  emit settingsChanged();
  emit showChanged();
}

void ViewState::set_crosshair(const Eigen::Vector3d& lps_mm) {
  if (settings_.crosshair_mm == lps_mm) return;
  settings_.crosshair_mm = lps_mm;
  emit settingsChanged();
}

void ViewState::set_window_level(double window, double level) {
  settings_.window = std::max(window, 1e-3);
  settings_.level = level;
  emit settingsChanged();
}

void ViewState::set_show(visualization::Show show) {
  if (settings_.show == show) return;
  settings_.show = show;
  emit settingsChanged();
  emit showChanged();
}

void ViewState::set_tool(Tool tool) {
  if (tool_ == tool) return;
  tool_ = tool;
  emit toolChanged();
}

}  // namespace palpate::gui
