#include "message_bar.hpp"

#include "icons.hpp"
#include "theme.hpp"
#include "ui_message_bar.h"

#include <QClipboard>
#include <QCoreApplication>
#include <QGuiApplication>
#include <QStyle>

namespace palpate::gui {

MessageBar::MessageBar(QWidget* parent) : QFrame(parent), ui_(std::make_unique<Ui::MessageBar>()) {
  ui_->setupUi(this);
  action_ = new QPushButton(this);
  action_->setObjectName(QStringLiteral("messageAction"));
  action_->setAccessibleName(tr("What to do about it"));
  action_->setToolTip(action_->accessibleName());
  ui_->layout89->insertWidget(ui_->layout89->indexOf(ui_->messageOffer), action_);
  connect(action_, &QPushButton::clicked, this, [this] {
    hide();
    if (act_) act_();
  });
  ui_->messageClose->setIcon(icon("close"));
  ui_->messageCopyButton->setIcon(icon("copy"));
  // The sentence takes the width; the buttons take what they need.
  QSizePolicy wide(QSizePolicy::Expanding, QSizePolicy::Preferred);
  wide.setHorizontalStretch(1);
  wide.setHeightForWidth(true);
  ui_->messageText->setSizePolicy(wide);
  for (auto* button : {action_, ui_->messageOffer, ui_->messageDetailsButton, ui_->messageCopyButton}) {
    button->setSizePolicy(QSizePolicy::Maximum, QSizePolicy::Fixed);
  }
  ui_->messageDetails->hide();
  hide();
  connect(ui_->messageClose, &QToolButton::clicked, this, &QWidget::hide);
  connect(ui_->messageDetailsButton, &QPushButton::toggled, ui_->messageDetails, &QWidget::setVisible);
  connect(ui_->messageCopyButton, &QPushButton::clicked, this, &MessageBar::copy);
  connect(ui_->messageOffer, &QPushButton::clicked, this, [this] {
    hide();
    emit referenceRequested();
  });
}

MessageBar::~MessageBar() = default;

void MessageBar::show_kind(const char* kind, const char* icon_name, const QColor& color,
                           const QString& text) {
  setProperty("kind", QString::fromLatin1(kind));
  style()->unpolish(this);
  style()->polish(this);
  ui_->messageIcon->setPixmap(icon_pixmap(icon_name, color, 20, devicePixelRatioF()));
  ui_->messageIcon->setAccessibleName(QString::fromLatin1(kind));
  ui_->messageText->setText(text);
  ui_->messageDetailsButton->setChecked(false);
  show();
}

void MessageBar::show_problem(const Problem& problem) {
  problem_ = problem;
  const bool elsewhere = problem.offer == Problem::Offer::other_device;
  action_->setVisible(elsewhere);
  if (elsewhere) {
    action_->setText(tr("Go on with %1").arg(problem.other_device_name));
    action_->setToolTip(tr("Run the simulation on this device, from what is on the screen"));
    act_ = [this, selector = problem.other_device] { emit deviceRequested(selector); };
  }
  ui_->messageOffer->setVisible(problem.offer != Problem::Offer::none);
  ui_->messageDetailsButton->setVisible(!problem.details.isEmpty());
  ui_->messageCopyButton->show();
  ui_->messageDetails->setPlainText(problem.details);
  if (problem.warning) {
    show_kind("warning", "warning", colors::amber, problem.text);
  } else {
    show_kind("error", "error", colors::red, problem.text);
  }
}

void MessageBar::show_info(const QString& text) { show_info(text, QString(), {}); }

void MessageBar::show_info(const QString& text, const QString& action, std::function<void()> act) {
  act_ = std::move(act);
  action_->setText(action);
  action_->setToolTip(action);
  action_->setVisible(!action.isEmpty());
  problem_ = {};
  problem_.text = text;
  ui_->messageOffer->hide();
  ui_->messageDetailsButton->hide();
  ui_->messageCopyButton->hide();
  show_kind("info", "info", colors::accent, text);
}

void MessageBar::copy() const {
  QString report = QStringLiteral("Palpate %1\n").arg(QCoreApplication::applicationVersion());
  report += problem_.text;
  if (!problem_.code.isEmpty()) report += QStringLiteral("\ncode: ") + problem_.code;
  if (!problem_.details.isEmpty()) report += QStringLiteral("\n\n") + problem_.details;
  QGuiApplication::clipboard()->setText(report + QLatin1Char('\n'));
}

}  // namespace palpate::gui
