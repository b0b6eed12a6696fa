#include "icons.hpp"

#include "theme.hpp"

#include <QFile>
#include <QIconEngine>
#include <QPainter>
#include <QSvgRenderer>

namespace palpate::gui {
namespace {

// The colour that the drawings of resources/icons are stroked with.
constexpr const char* drawn_color = "#e6e8eb";

QByteArray source_of(const QString& name) {
  QFile file(QStringLiteral(":/palpate/icons/%1.svg").arg(name));
  return file.open(QIODevice::ReadOnly) ? file.readAll() : QByteArray();
}

class SvgEngine : public QIconEngine {
 public:
  SvgEngine(QString name, QColor color) : name_(std::move(name)), color_(std::move(color)) {}

  void paint(QPainter* painter, const QRect& rect, QIcon::Mode mode, QIcon::State state) override {
    QColor tint = color_;
    if (!tint.isValid()) tint = state == QIcon::On ? colors::accent : colors::text;
    if (mode == QIcon::Disabled) tint = colors::faint_text;
    QByteArray source = source_of(name_);
    if (name_ != QLatin1String("palpate")) source.replace(drawn_color, tint.name().toLatin1());
    QSvgRenderer renderer(source);
    renderer.render(painter, QRectF(rect));
  }
  QPixmap pixmap(const QSize& size, QIcon::Mode mode, QIcon::State state) override {
    QPixmap pixmap(size);
    pixmap.fill(Qt::transparent);
    QPainter painter(&pixmap);
    paint(&painter, QRect(QPoint(), size), mode, state);
    return pixmap;
  }
  QIconEngine* clone() const override { return new SvgEngine(name_, color_); }

 private:
  QString name_;
  QColor color_;
};

}  // namespace

QIcon icon(const char* name) { return QIcon(new SvgEngine(QString::fromLatin1(name), QColor())); }

QIcon icon(const char* name, const QColor& color) {
  return QIcon(new SvgEngine(QString::fromLatin1(name), color));
}

QPixmap icon_pixmap(const char* name, const QColor& color, int size, qreal scale) {
  SvgEngine engine(QString::fromLatin1(name), color);
  const int pixels = qRound(size * scale);
  QPixmap pixmap = engine.pixmap(QSize(pixels, pixels), QIcon::Normal, QIcon::Off);
  pixmap.setDevicePixelRatio(scale);
  return pixmap;
}

}  // namespace palpate::gui
