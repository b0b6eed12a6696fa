#include "views/gl_view.hpp"

#include <QAbstractSpinBox>
#include <QApplication>
#include <QKeyEvent>
#include <QLineEdit>
#include <QMouseEvent>
#include <QOpenGLContext>
#include <QOpenGLFunctions>
#include <QWheelEvent>
#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkNew.h>
#include <vtkRenderWindowInteractor.h>

#include <cmath>

namespace palpate::gui {
namespace {

constexpr int frame_interval_ms = 15;
constexpr double zoom_per_pixel = 0.006;
constexpr int wheel_notch = 120;  // eighths of a degree

QPointF position_of(const QMouseEvent* event) {
#if QT_VERSION >= QT_VERSION_CHECK(6, 0, 0)
  return event->position();
#else
  return event->localPos();
#endif
}

}  // namespace

GlView::GlView(Workbench& workbench, ViewState& state, QWidget* parent)
    : QVTKOpenGLNativeWidget(parent), workbench_(workbench), state_(state) {
  vtkNew<vtkGenericOpenGLRenderWindow> window;
  window->SetMultiSamples(4);
  setRenderWindow(window.Get());
  window->GetInteractor()->SetInteractorStyle(nullptr);
  setMouseTracking(true);
  setFocusPolicy(Qt::StrongFocus);
  setMinimumSize(80, 80);
  render_delay_.setSingleShot(true);
  render_delay_.setTimerType(Qt::PreciseTimer);
  connect(&render_delay_, &QTimer::timeout, this, &GlView::render_now);
  since_render_.start();
}

// Four samples a pixel cost the processor more than half of a picture's time.
void GlView::initializeGL() {
  const auto* name = reinterpret_cast<const char*>(context()->functions()->glGetString(GL_RENDERER));
  if (name != nullptr) renderer_name_ = QString::fromLatin1(name);
  if (draws_in_software()) renderWindow()->SetMultiSamples(0);
  QVTKOpenGLNativeWidget::initializeGL();
}

void GlView::request_render() {
  if (render_delay_.isActive()) return;
  const qint64 left = frame_interval_ms - since_render_.elapsed();
  render_delay_.start(static_cast<int>(std::clamp<qint64>(left, 0, frame_interval_ms)));
}

void GlView::render_now() {
  if (!isVisible()) return;  // showEvent asks again
  renderWindow()->Render();
  since_render_.restart();
  emit rendered();
}

bool GlView::event(QEvent* event) {
  switch (event->type()) {
    case QEvent::MouseButtonPress:
    case QEvent::MouseButtonRelease:
    case QEvent::MouseButtonDblClick:
    case QEvent::MouseMove:
    case QEvent::Wheel:
    case QEvent::KeyPress:
    case QEvent::KeyRelease:
    case QEvent::Leave:
      return QOpenGLWidget::event(event);  // past VTK's interactor
    case QEvent::Enter: {
      // Keys go to the view under the pointer, but typing is not interrupted.
      const QWidget* focus = QApplication::focusWidget();
      if (qobject_cast<const QLineEdit*>(focus) == nullptr &&
          qobject_cast<const QAbstractSpinBox*>(focus) == nullptr) {
        setFocus(Qt::MouseFocusReason);
      }
      return QOpenGLWidget::event(event);
    }
    default:
      return QVTKOpenGLNativeWidget::event(event);
  }
}

QPointF GlView::viewport_place(const QPointF& logical) const {
  const double ratio = devicePixelRatioF();
  return {logical.x() * ratio, (height() - 1 - logical.y()) * ratio};
}

void GlView::mousePressEvent(QMouseEvent* event) {
  if (drag_ != Drag::none) return;
  last_place_ = viewport_place(position_of(event));
  drag_button_ = event->button();
  pressed_with_ = event->modifiers();
  if (event->button() == Qt::RightButton) {
    drag_ = Drag::zoom;
  } else if (event->button() == Qt::MiddleButton ||
             (event->button() == Qt::LeftButton && (event->modifiers() & Qt::ShiftModifier) != 0)) {
    drag_ = Drag::pan;
  } else if (event->button() == Qt::LeftButton) {
    drag_ = Drag::tool;
    tool_pressed(last_place_);
  }
  event->accept();
}

void GlView::mouseMoveEvent(QMouseEvent* event) {
  const QPointF place = viewport_place(position_of(event));
  const QPointF from = last_place_;
  last_place_ = place;
  switch (drag_) {
    case Drag::none:
      point_at(place, (event->modifiers() & Qt::ShiftModifier) != 0);
      break;
    case Drag::tool:
      tool_dragged(from, place);
      break;
    case Drag::zoom:
      zoom(std::exp((place.y() - from.y()) * zoom_per_pixel / devicePixelRatioF()));
      request_render();
      break;
    case Drag::pan:
      pan(place.x() - from.x(), place.y() - from.y());
      request_render();
      break;
  }
  event->accept();
}

void GlView::mouseReleaseEvent(QMouseEvent* event) {
  if (drag_ == Drag::none || event->button() != drag_button_) return;
  const Drag ended = drag_;
  drag_ = Drag::none;
  if (ended == Drag::tool) tool_released();
  event->accept();
}

void GlView::mouseDoubleClickEvent(QMouseEvent* event) {
  if (event->button() == Qt::LeftButton) emit maximiseRequested();
  event->accept();
}

void GlView::wheelEvent(QWheelEvent* event) {
  wheel_angle_ += event->angleDelta().y();
  const int steps = wheel_angle_ / wheel_notch;
  wheel_angle_ -= steps * wheel_notch;
  if (steps != 0) wheel(steps);
  event->accept();
}

void GlView::leaveEvent(QEvent* event) {
  emit hovered(false, 0, 0, 0);
  QVTKOpenGLNativeWidget::leaveEvent(event);
}

void GlView::keyPressEvent(QKeyEvent* event) {
  if (event->key() == Qt::Key_Left || event->key() == Qt::Key_Right) {
    step_slices(event->key() == Qt::Key_Right ? 1 : -1);
    return;
  }
  event->ignore();
}

void GlView::showEvent(QShowEvent* event) {
  QVTKOpenGLNativeWidget::showEvent(event);
  set_text_scale(devicePixelRatioF());
  request_render();
}

void GlView::resizeEvent(QResizeEvent* event) {
  QVTKOpenGLNativeWidget::resizeEvent(event);
  set_text_scale(devicePixelRatioF());
  request_render();
}

// A drag across 500 pixels spans the scan's whole range of values.
void GlView::drag_window_level(const QPointF& from, const QPointF& to) {
  if (!workbench_.has_volume()) return;
  const auto& range = workbench_.volume().range();
  const double per_pixel = (static_cast<double>(range.max) - range.min) / (500.0 * devicePixelRatioF());
  state_.set_window_level(state_.settings().window + (to.x() - from.x()) * per_pixel,
                          state_.settings().level - (to.y() - from.y()) * per_pixel);
}

}  // namespace palpate::gui
