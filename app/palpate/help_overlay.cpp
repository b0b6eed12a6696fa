#include "help_overlay.hpp"

#include "theme.hpp"

#include <QEvent>
#include <QLabel>
#include <QVBoxLayout>

namespace palpate::gui {
namespace {

QString rows(const QVector<Binding>& bindings) {
  QString html;
  for (const auto& binding : bindings) {
    html += QStringLiteral(
                "<tr><td width='220' style='padding:2px 24px 2px 0; color:%1'>%2</td><td style='padding:2px "
                "0'>%3</td></tr>")
                .arg(colors::quiet_text.name(), binding.keys.toHtmlEscaped(), binding.effect.toHtmlEscaped());
  }
  return html;
}

}  // namespace

HelpOverlay::HelpOverlay(QWidget* parent) : QFrame(parent), text_(new QLabel(this)) {
  setObjectName(QStringLiteral("helpOverlay"));
  setProperty("block", "help");
  text_->setTextFormat(Qt::RichText);
  auto* column = new QVBoxLayout(this);
  column->setContentsMargins(24, 16, 24, 16);
  column->addWidget(text_);
  parent->installEventFilter(this);
  hide();
}

void HelpOverlay::show_tool(Tool tool) {
  const auto& description = describe(tool);
  text_->setText(QStringLiteral("<h3>%1</h3><p>%2</p><table>%3</table><h4 style='margin-top:12px'>%4</h4>"
                                "<table>%5</table><p style='color:%6'>%7</p>")
                     .arg(description.title, description.text, rows(description.bindings),
                          tr("With every tool"), rows(common_bindings()), colors::quiet_text.name(),
                          tr("F1 or a click closes this.")));
  setAccessibleName(tr("Keys of the tool %1").arg(description.title));
  place();
  show();
  raise();
}

void HelpOverlay::place() {
  adjustSize();
  const QWidget* around = parentWidget();
  move((around->width() - width()) / 2, std::max(0, (around->height() - height()) / 2));
}

void HelpOverlay::mousePressEvent(QMouseEvent*) { hide(); }

bool HelpOverlay::eventFilter(QObject* watched, QEvent* event) {
  if (watched == parentWidget() && event->type() == QEvent::Resize && isVisible()) place();
  return QFrame::eventFilter(watched, event);
}

}  // namespace palpate::gui
