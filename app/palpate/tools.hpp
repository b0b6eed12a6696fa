#pragma once

#include <QString>
#include <QVector>

namespace palpate::gui {

/// What the left mouse button does in the views.
enum class Tool { navigate, window_level, grab, anchor };

struct Binding {
  QString keys;    ///< "Wheel", "Left drag"
  QString effect;  ///< "next slice"
};
struct ToolDescription {
  Tool tool;
  QString title;
  const char* icon;
  QString text;               ///< one line, for the tooltip
  QVector<Binding> bindings;  ///< of the tool itself
};

const QVector<ToolDescription>& tools();
const ToolDescription& describe(Tool tool);
/// Bindings that hold with every tool.
const QVector<Binding>& common_bindings();

}  // namespace palpate::gui
