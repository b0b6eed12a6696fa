#include "views/view_frame.hpp"

#include "icons.hpp"
#include "views/slice_widget.hpp"

#include <QHBoxLayout>
#include <QSignalBlocker>
#include <QSlider>
#include <QToolButton>
#include <QVBoxLayout>
#include <QVariant>

namespace palpate::gui {

ViewFrame::ViewFrame(const QString& id, const QString& title, GlView* view, QWidget* parent)
    : QFrame(parent), view_(view), column_(new QVBoxLayout), maximise_(new QToolButton(this)) {
  setObjectName(id + QStringLiteral("Frame"));
  setProperty("block", "viewFrame");
  setFrameShape(QFrame::NoFrame);
  view_->setParent(this);
  view_->setObjectName(id + QStringLiteral("View"));
  view_->setAccessibleName(tr("%1 view").arg(title));

  maximise_->setObjectName(id + QStringLiteral("Maximise"));
  maximise_->setAutoRaise(true);
  maximise_->setIconSize({16, 16});
  maximise_->setAccessibleName(tr("Show only the %1 view").arg(title));
  column_->setContentsMargins(0, 4, 0, 4);
  column_->setSpacing(4);
  column_->addWidget(maximise_, 0, Qt::AlignHCenter);

  auto* row = new QHBoxLayout(this);
  row->setContentsMargins(0, 0, 0, 0);
  row->setSpacing(0);
  row->addWidget(view_, 1);
  row->addLayout(column_);
  add_slider(id);

  connect(maximise_, &QToolButton::clicked, this, &ViewFrame::maximiseRequested);
  connect(view_, &GlView::maximiseRequested, this, &ViewFrame::maximiseRequested);
  set_maximised(false);
}

void ViewFrame::add_slider(const QString& id) {
  auto* slice = qobject_cast<SliceWidget*>(view_);
  if (slice == nullptr) {
    column_->addStretch();
    return;
  }
  slider_ = new QSlider(Qt::Vertical, this);
  slider_->setObjectName(id + QStringLiteral("Slider"));
  slider_->setAccessibleName(tr("Slice"));
  slider_->setToolTip(tr("Slice (wheel over the view, ← →)"));
  slider_->setFixedWidth(24);
  column_->addWidget(slider_, 1);
  connect(slider_, &QSlider::valueChanged, slice, &SliceWidget::set_slice);
  connect(slice, &SliceWidget::sliceChanged, this, &ViewFrame::refresh_slider);
  connect(slice, &GlView::rendered, this, &ViewFrame::refresh_slider);
}

void ViewFrame::refresh_slider() {
  const auto* slice = qobject_cast<SliceWidget*>(view_);
  if (slice == nullptr) return;
  const QSignalBlocker quiet(slider_);
  slider_->setRange(0, std::max(0, slice->slice_count() - 1));
  slider_->setValue(slice->slice());
  slider_->setEnabled(slice->slice_count() > 1);
}

void ViewFrame::set_maximised(bool maximised) {
  maximise_->setIcon(icon(maximised ? "restore" : "maximise"));
  maximise_->setToolTip(maximised ? tr("Back to all views (double click)")
                                  : tr("Show only this view (double click)"));
}

void ViewFrame::add_button(QToolButton* button) {
  column_->insertWidget(column_->count() - 1, button, 0, Qt::AlignHCenter);
}

}  // namespace palpate::gui
