#include "session_dialog.hpp"

#include "icons.hpp"
#include "theme.hpp"

#include <QDialogButtonBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QPushButton>
#include <QVBoxLayout>

namespace palpate::gui {

SessionDialog::SessionDialog(const ScanQuestion& question, QWidget* parent) : QDialog(parent) {
  setObjectName(QStringLiteral("sessionDialog"));
  setAttribute(Qt::WA_DeleteOnClose);
  const bool changed = question.state == session::FoundInput::State::changed;
  setWindowTitle(changed ? tr("The scan has changed") : tr("The scan is not there"));
  auto* column = new QVBoxLayout(this);
  column->setContentsMargins(16, 16, 16, 16);
  column->setSpacing(12);
  auto* row = new QHBoxLayout;
  auto* mark = new QLabel(this);
  mark->setPixmap(icon_pixmap("warning", colors::amber, 32, devicePixelRatioF()));
  auto* text = new QLabel(this);
  text->setObjectName(QStringLiteral("sessionQuestion"));
  text->setTextFormat(Qt::PlainText);
  text->setTextInteractionFlags(Qt::TextSelectableByMouse);
  text->setWordWrap(true);
  text->setMinimumWidth(440);
  const QString words =
      changed ? tr("%1 was saved with another content of the scan %2 (its checksum differs).\n\n"
                   "What is there now: %3\n\nFilters and parameters may not fit it. Nothing was opened yet.")
              : tr("The scan %2 of %1 was not found, neither beside the session nor where it was.\n\n"
                   "Looked for: %3\n\nWhere is it now?");
  text->setText(words.arg(question.session, question.scan, question.place));
  row->addWidget(mark, 0, Qt::AlignTop);
  row->addWidget(text, 1);
  column->addLayout(row);

  auto* buttons = new QDialogButtonBox(this);
  const auto add = [&](const QString& title, const char* name, const QString& hint,
                       QDialogButtonBox::ButtonRole role) {
    auto* button = buttons->addButton(title, role);
    button->setObjectName(QString::fromLatin1(name));
    button->setToolTip(hint);
    return button;
  };
  auto* find = add(tr("Find the file…"), "findScanButton", tr("Shows where the scan is now"),
                   QDialogButtonBox::ActionRole);
  auto* folder = add(tr("Find the folder…"), "findFolderButton", tr("For a scan that is a folder of files"),
                     QDialogButtonBox::ActionRole);
  connect(find, &QPushButton::clicked, this, &SessionDialog::findRequested);
  connect(folder, &QPushButton::clicked, this, &SessionDialog::findFolderRequested);
  if (changed) {
    auto* anyway =
        add(tr("Open anyway"), "openAnywayButton",
            tr("Takes the scan as it is now; what is saved next goes with it"), QDialogButtonBox::ActionRole);
    connect(anyway, &QPushButton::clicked, this, &SessionDialog::openAnywayRequested);
  }
  add(tr("Cancel"), "cancelSessionButton", tr("Leaves all as it was"), QDialogButtonBox::RejectRole);
  connect(buttons, &QDialogButtonBox::rejected, this, &QDialog::reject);
  find->setDefault(true);
  column->addWidget(buttons);
}

}  // namespace palpate::gui
