#pragma once

#include <QColor>
#include <QIcon>
#include <QPixmap>

namespace palpate::gui {

/// An icon of resources/icons by its name, drawn at whatever size and scale is
/// asked for and tinted: the text colour, the accent where it is checked,
/// faint where it is disabled.
QIcon icon(const char* name);
/// The same in one fixed colour.
QIcon icon(const char* name, const QColor& color);
QPixmap icon_pixmap(const char* name, const QColor& color, int size, qreal scale);

}  // namespace palpate::gui
