#include "job_bar.hpp"

#include "icons.hpp"

#include <QHBoxLayout>
#include <QLabel>
#include <QProgressBar>
#include <QToolButton>
#include <QVBoxLayout>
#include <QVariant>

#include <cmath>

namespace palpate::gui {
namespace {
// What ends sooner is not worth a line that comes and goes.
constexpr double shown_after_s = 0.2;
constexpr int bar_steps = 1000;
}  // namespace

QString time_left(const JobStatus& job) {
  if (!job.running) return QObject::tr("waiting");
  if (job.elapsed_s < 1.0 || job.fraction < 0.05) return {};
  const double left_s = job.elapsed_s * (1.0 - job.fraction) / job.fraction;
  if (left_s < 1.0) return QObject::tr("nearly done");
  if (left_s < 90.0) return QObject::tr("%1 s left").arg(std::lround(left_s));
  return QObject::tr("%1 min left").arg(std::lround(left_s / 60.0));
}

JobBar::JobBar(JobTracker& tracker, QWidget* parent)
    : QWidget(parent), tracker_(tracker), column_(new QVBoxLayout(this)) {
  setObjectName(QStringLiteral("jobBar"));
  column_->setContentsMargins(0, 0, 0, 0);
  column_->setSpacing(0);
  connect(&tracker_, &JobTracker::jobsChanged, this, &JobBar::refresh);
  hide();
}

JobBar::Row JobBar::add_row(quint64 epoch) {
  Row row{};
  row.widget = new QWidget(this);
  row.widget->setProperty("block", "jobRow");
  row.widget->setAttribute(Qt::WA_StyledBackground);
  row.text = new QLabel(row.widget);
  row.text->setObjectName(QStringLiteral("jobText"));
  row.bar = new QProgressBar(row.widget);
  row.bar->setRange(0, bar_steps);
  row.bar->setTextVisible(false);
  row.left = new QLabel(row.widget);
  row.left->setProperty("role", "quiet");
  row.left->setMinimumWidth(80);
  auto* stop = new QToolButton(row.widget);
  stop->setObjectName(QStringLiteral("cancelJob"));
  stop->setIcon(icon("close"));
  stop->setAutoRaise(true);
  stop->setToolTip(tr("Stop this"));
  stop->setAccessibleName(tr("Stop this"));
  stop->setFocusPolicy(Qt::TabFocus);
  connect(stop, &QToolButton::clicked, &tracker_, [this, epoch] { tracker_.cancel(epoch); });
  auto* line = new QHBoxLayout(row.widget);
  line->setContentsMargins(12, 4, 8, 4);
  line->setSpacing(12);
  line->addWidget(row.text, 2);
  line->addWidget(row.bar, 3);
  line->addWidget(row.left);
  line->addWidget(stop);
  column_->addWidget(row.widget);
  return row;
}

void JobBar::refresh() {
  const auto jobs = tracker_.jobs();
  QHash<quint64, Row> kept;
  for (const auto& job : jobs) {
    if (job.elapsed_s < shown_after_s && !rows_.contains(job.epoch)) continue;
    const Row row = rows_.contains(job.epoch) ? rows_.take(job.epoch) : add_row(job.epoch);
    row.text->setText(job.what.isEmpty() ? job.title : QStringLiteral("%1: %2").arg(job.title, job.what));
    // Where nothing was told yet the bar only says that something goes on.
    row.bar->setRange(0, job.fraction > 0.0 ? bar_steps : 0);
    row.bar->setValue(static_cast<int>(job.fraction * bar_steps));
    row.bar->setAccessibleName(job.title);
    row.left->setText(time_left(job));
    kept.insert(job.epoch, row);
  }
  for (const auto& row : rows_) row.widget->deleteLater();
  for (const auto& row : rows_) row.widget->hide();
  rows_ = kept;
  setVisible(!rows_.isEmpty());
}

}  // namespace palpate::gui
