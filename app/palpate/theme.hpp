#pragma once

#include <QApplication>
#include <QColor>
#include <QSettings>

#include <memory>

namespace palpate::gui {

/// The colours of docs/window.md.
namespace colors {
inline const QColor ground{0x1f, 0x23, 0x28};
inline const QColor panel{0x26, 0x2b, 0x31};
inline const QColor raised{0x30, 0x36, 0x3d};
inline const QColor line{0x3a, 0x41, 0x49};
inline const QColor text{0xe6, 0xe8, 0xeb};
inline const QColor quiet_text{0xa3, 0xab, 0xb4};
inline const QColor faint_text{0x6d, 0x76, 0x80};
inline const QColor accent{0x2f, 0xb3, 0xa6};
inline const QColor good{0x5c, 0xc4, 0x7d};
inline const QColor amber{0xe8, 0xb1, 0x4a};
inline const QColor red{0xef, 0x6b, 0x62};
inline const QColor axial{0xe0, 0x5a, 0x52};
inline const QColor sagittal{0xe3, 0xc0, 0x4b};
inline const QColor coronal{0x62, 0xbf, 0x6a};
}  // namespace colors

/// What must be set before the application is made: high DPI, shared contexts,
/// the surface format that VTK draws into.
void prepare_application();
/// Fusion with our palette and the style sheet; also loads the resources.
void apply_theme(QApplication& application);

}  // namespace palpate::gui
