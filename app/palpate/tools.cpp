#include "tools.hpp"

#include <QCoreApplication>

namespace palpate::gui {
namespace {

QString words(const char* text) { return QCoreApplication::translate("Tools", text); }

}  // namespace

const QVector<ToolDescription>& tools() {
  static const QVector<ToolDescription> list{
      {Tool::navigate,
       words("Navigate"),
       "navigate",
       words("Places the crosshair on slices, turns the 3-D view."),
       {{words("Left drag on a slice"), words("moves the crosshair")},
        {words("Left drag in 3-D"), words("turns the view")}}},
      {Tool::window_level,
       words("Window/level"),
       "window-level",
       words("Changes contrast and brightness of the slices."),
       {{words("Left drag sideways"), words("window: contrast")},
        {words("Left drag up and down"), words("level: brightness")}}},
      {Tool::grab,
       words("Grab"),
       "grab",
       words("Takes hold of the tissue and pulls it."),
       {{words("Left press on tissue"), words("takes hold of what lies within the radius")},
        {words("Left drag"), words("pulls it along")},
        {words("Let go"), words("the tissue swings back; Ctrl+Z undoes the pull")}}},
      {Tool::anchor,
       words("Anchor"),
       "anchor",
       words("Paints points that never move, such as where the tissue hangs on its neighbours."),
       {{words("Left drag on tissue"), words("fixes the points within the radius")},
        {words("Ctrl + left drag"), words("frees them again")},
        {words("Let go"), words("ends the stroke; Ctrl+Z undoes it")}}},
  };
  return list;
}

const ToolDescription& describe(Tool tool) {
  for (const auto& description : tools()) {
    if (description.tool == tool) return description;
  }
  return tools().front();
}

const QVector<Binding>& common_bindings() {
  static const QVector<Binding> list{
      {words("Wheel"), words("next slice; zoom in 3-D")},
      {words("Right drag"), words("zoom")},
      {words("Middle drag, Shift + left drag"), words("pan")},
      {words("Shift + move"), words("crosshair in every view")},
      {words("Double click"), words("one view large, and back")},
      {QStringLiteral("← →"), words("slice by slice")},
      {QStringLiteral("R"), words("fit the view")},
      {words("Space"), words("play and pause")},
      {QStringLiteral("1  2  3  4"), words("navigate, window/level, grab, anchor")},
      {QStringLiteral("Ctrl+Z  Ctrl+Shift+Z"), words("undo, redo")},
      {QStringLiteral("Ctrl+Shift+P"), words("save a picture")},
      {QStringLiteral("F11"), words("full screen")},
  };
  return list;
}

}  // namespace palpate::gui
