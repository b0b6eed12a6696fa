#pragma once

#include "icons.hpp"
#include "theme.hpp"

#include <QToolButton>

namespace palpate::gui {

/// Makes the "More" button of a form show and hide its box.
inline void wire_more(QToolButton* button, QWidget* box) {
  const auto show = [button, box](bool shown) {
    box->setVisible(shown);
    button->setIcon(icon(shown ? "chevron-down" : "chevron-right", colors::quiet_text));
    button->setText(shown ? QObject::tr("Less") : QObject::tr("More"));
  };
  QObject::connect(button, &QToolButton::toggled, box, show);
  show(false);
}

}  // namespace palpate::gui
