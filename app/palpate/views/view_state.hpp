#pragma once

#include "tools.hpp"

#include "palpate/visualization/scene.hpp"

#include <QObject>

namespace palpate::gui {

/// What the views share: crosshair, window and level, what is shown, the tool.
class ViewState : public QObject {
  Q_OBJECT

 public:
  explicit ViewState(QObject* parent = nullptr) : QObject(parent) {}
  const visualization::ViewSettings& settings() const { return settings_; }
  Tool tool() const { return tool_; }

  void set_settings(const visualization::ViewSettings& settings);
  void set_crosshair(const Eigen::Vector3d& lps_mm);
  void set_window_level(double window, double level);
  void set_show(visualization::Show show);
  void set_tool(palpate::gui::Tool tool);

 signals:
  void settingsChanged();
  void showChanged();
  void toolChanged();

 private:
  visualization::ViewSettings settings_;
  Tool tool_ = Tool::navigate;
};

}  // namespace palpate::gui
