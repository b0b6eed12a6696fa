#include "lost_session_bar.hpp"

#include "icons.hpp"
#include "theme.hpp"

#include <QHBoxLayout>
#include <QLabel>
#include <QLocale>
#include <QPushButton>

namespace palpate::gui {

LostSessionBar::LostSessionBar(QWidget* parent) : QFrame(parent), text_(new QLabel(this)) {
  setObjectName(QStringLiteral("lostSessionBar"));
  auto* row = new QHBoxLayout(this);
  row->setContentsMargins(12, 8, 12, 8);
  row->setSpacing(8);
  auto* mark = new QLabel(this);
  mark->setPixmap(icon_pixmap("info", colors::accent, 20, devicePixelRatioF()));
  text_->setObjectName(QStringLiteral("lostSessionText"));
  text_->setWordWrap(true);
  auto* restore = new QPushButton(tr("Restore what was open"), this);
  restore->setObjectName(QStringLiteral("restoreLostButton"));
  restore->setToolTip(tr("Opens the scan with its filters, parameters and views; pulls are not part of it"));
  auto* discard = new QPushButton(tr("Discard it"), this);
  discard->setObjectName(QStringLiteral("discardLostButton"));
  discard->setToolTip(tr("Forgets it; the scan itself stays untouched"));
  row->addWidget(mark);
  row->addWidget(text_, 1);
  row->addWidget(restore);
  row->addWidget(discard);
  connect(restore, &QPushButton::clicked, this, [this] {
    hide();
    emit restoreRequested();
  });
  connect(discard, &QPushButton::clicked, this, [this] {
    hide();
    emit discardRequested();
  });
  hide();
}

void LostSessionBar::offer(const LostSession& lost) {
  text_->setText(tr("Palpate ended without being closed; what was open at %1 is kept.")
                     .arg(QLocale().toString(lost.when, QLocale::ShortFormat)));
  show();
}

}  // namespace palpate::gui
