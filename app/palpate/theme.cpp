#include "theme.hpp"

#include "icons.hpp"

#include <QFile>
#include <QFont>
#include <QIcon>
#include <QPalette>
#include <QStyleFactory>
#include <QSurfaceFormat>
#include <QVTKOpenGLNativeWidget.h>

// Outside any namespace: the macro declares a function there.
static void load_resources() { Q_INIT_RESOURCE(palpate); }

namespace palpate::gui {

void prepare_application() {
#if QT_VERSION < QT_VERSION_CHECK(6, 0, 0)
  QApplication::setAttribute(Qt::AA_EnableHighDpiScaling);
  QApplication::setAttribute(Qt::AA_UseHighDpiPixmaps);
#endif
  QApplication::setHighDpiScaleFactorRoundingPolicy(Qt::HighDpiScaleFactorRoundingPolicy::PassThrough);
  QApplication::setAttribute(Qt::AA_ShareOpenGLContexts);
  QSurfaceFormat::setDefaultFormat(QVTKOpenGLNativeWidget::defaultFormat());
}

void apply_theme(QApplication& application) {
  load_resources();
  QApplication::setStyle(QStyleFactory::create(QStringLiteral("Fusion")));

  QPalette palette;
  palette.setColor(QPalette::Window, colors::panel);
  palette.setColor(QPalette::WindowText, colors::text);
  palette.setColor(QPalette::Base, colors::ground);
  palette.setColor(QPalette::AlternateBase, colors::panel);
  palette.setColor(QPalette::Text, colors::text);
  palette.setColor(QPalette::Button, colors::raised);
  palette.setColor(QPalette::ButtonText, colors::text);
  palette.setColor(QPalette::BrightText, Qt::white);
  palette.setColor(QPalette::ToolTipBase, colors::raised);
  palette.setColor(QPalette::ToolTipText, colors::text);
  palette.setColor(QPalette::Highlight, colors::accent);
  palette.setColor(QPalette::HighlightedText, colors::ground);
  palette.setColor(QPalette::Link, colors::accent);
  palette.setColor(QPalette::PlaceholderText, colors::faint_text);
  palette.setColor(QPalette::Light, colors::line);
  palette.setColor(QPalette::Midlight, colors::raised);
  palette.setColor(QPalette::Mid, colors::line);
  palette.setColor(QPalette::Dark, colors::ground);
  palette.setColor(QPalette::Shadow, QColor(0x14, 0x17, 0x1a));
  for (const auto role : {QPalette::WindowText, QPalette::Text, QPalette::ButtonText}) {
    palette.setColor(QPalette::Disabled, role, colors::faint_text);
  }
  palette.setColor(QPalette::Disabled, QPalette::Highlight, colors::line);
  QApplication::setPalette(palette);

  QFile sheet(QStringLiteral(":/palpate/style/palpate.qss"));
  if (sheet.open(QIODevice::ReadOnly)) application.setStyleSheet(QString::fromUtf8(sheet.readAll()));
  QApplication::setWindowIcon(icon("palpate"));
}

}  // namespace palpate::gui
