#include "views/view_grid.hpp"

#include "icons.hpp"

#include <QApplication>
#include <QButtonGroup>
#include <QGridLayout>
#include <QToolButton>

namespace palpate::gui {

using visualization::SlicePlane;

ViewGrid::ViewGrid(Workbench& workbench, ViewState& state, QWidget* parent)
    : QWidget(parent),
      workbench_(workbench),
      state_(state),
      grid_(new QGridLayout(this)),
      tissue_(new TissueWidget(workbench, state, this)),
      show_buttons_(new QButtonGroup(this)) {
  setObjectName(QStringLiteral("viewGrid"));
  grid_->setContentsMargins(0, 0, 0, 0);
  grid_->setSpacing(2);
  const auto slice = [&](SlicePlane plane) { return new SliceWidget(plane, workbench, state, this); };
  frames_[axial] = new ViewFrame(QStringLiteral("axial"), tr("Axial"), slice(SlicePlane::axial), this);
  frames_[three_d] = new ViewFrame(QStringLiteral("tissue"), tr("3-D"), tissue_, this);
  frames_[sagittal] =
      new ViewFrame(QStringLiteral("sagittal"), tr("Sagittal"), slice(SlicePlane::sagittal), this);
  frames_[coronal] =
      new ViewFrame(QStringLiteral("coronal"), tr("Coronal"), slice(SlicePlane::coronal), this);
  add_show_buttons();
  for (int place = 0; place < count; ++place) {
    auto* frame = frames_[static_cast<std::size_t>(place)];
    connect(frame, &ViewFrame::maximiseRequested, this, [this, place] { toggle_maximised(place); });
    connect(&frame->view(), &GlView::hovered, this, &ViewGrid::hovered);
    connect(&state_, &ViewState::settingsChanged, &frame->view(), &GlView::update_settings);
  }
  connect(tissue_, &GlView::rendered, this, [this] { drawn_ms_.push_back(clock_.elapsed()); });
  connect(&workbench_, &Workbench::volumeOpened, this, &ViewGrid::show_volume);
  connect(&workbench_, &Workbench::geometryStated, this, &ViewGrid::show_geometry);
  connect(&workbench_, &Workbench::frameShown, this, &ViewGrid::update_all_contents);
  connect(&workbench_, &Workbench::volumeFiltered, this, &ViewGrid::update_all_contents);
  connect(&workbench_, &Workbench::tissueDropped, this, &ViewGrid::update_all_contents);
  connect(&workbench_, &Workbench::tissueBuilt, this, [this] {
    update_all_contents();
    tissue_->fit();
  });
  connect(&workbench_, &Workbench::frameArrived, this, &ViewGrid::show_frame);
  for (const auto signal : {&Workbench::anchorsChanged, &Workbench::limitShown})
    connect(&workbench_, signal, this, &ViewGrid::update_all_contents);
  clock_.start();
  arrange();
}

void ViewGrid::add_show_buttons() {
  using visualization::Show;
  struct Choice {
    Show show;
    const char* icon;
    const char* name;
    QString title;
  };
  const Choice choices[] = {{Show::surface, "surface", "showSurface", tr("Surface")},
                            {Show::points, "points", "showPoints", tr("Points")},
                            {Show::links, "links", "showLinks", tr("Links")}};
  for (const auto& choice : choices) {
    auto* button = new QToolButton(this);
    button->setObjectName(QString::fromLatin1(choice.name));
    button->setIcon(icon(choice.icon));
    button->setIconSize({16, 16});
    button->setText(choice.title);
    button->setToolTip(tr("Show the tissue as %1").arg(choice.title.toLower()));
    button->setAccessibleName(button->toolTip());
    button->setCheckable(true);
    button->setChecked(choice.show == Show::surface);
    show_buttons_->addButton(button, static_cast<int>(choice.show));
    frames_[three_d]->add_button(button);
    connect(button, &QToolButton::clicked, this, [this, show = choice.show] { state_.set_show(show); });
  }
  connect(&state_, &ViewState::showChanged, this, [this] {
    if (auto* button = show_buttons_->button(static_cast<int>(state_.settings().show)))
      button->setChecked(true);
  });
}

void ViewGrid::set_layout(ViewLayout layout) {
  if (layout == ViewLayout::one) {
    toggle_maximised(active_place());
    return;
  }
  maximised_ = -1;
  layout_ = layout;
  arrange();
}

void ViewGrid::toggle_maximised(int place) {
  if (maximised_ >= 0) {
    maximised_ = -1;
    layout_ = before_;
  } else {
    maximised_ = place;
    before_ = layout_;
    layout_ = ViewLayout::one;
  }
  arrange();
}

void ViewGrid::arrange() {
  for (auto* frame : frames_) grid_->removeWidget(frame);
  for (int line = 0; line < 3; ++line) {
    grid_->setRowStretch(line, 0);
    grid_->setColumnStretch(line, 0);
  }
  std::array<bool, count> shown{};
  const auto put = [&](int place, int row, int column, int rows, int columns) {
    grid_->addWidget(frames_[static_cast<std::size_t>(place)], row, column, rows, columns);
    shown[static_cast<std::size_t>(place)] = true;
  };
  switch (layout_) {
    case ViewLayout::four_up:
      put(axial, 0, 0, 1, 1);
      put(three_d, 0, 1, 1, 1);
      put(sagittal, 1, 0, 1, 1);
      put(coronal, 1, 1, 1, 1);
      for (int line = 0; line < 2; ++line) {
        grid_->setRowStretch(line, 1);
        grid_->setColumnStretch(line, 1);
      }
      break;
    case ViewLayout::side_by_side:
      put(axial, 0, 0, 1, 1);
      put(three_d, 0, 1, 1, 1);
      grid_->setRowStretch(0, 1);
      grid_->setColumnStretch(0, 1);
      grid_->setColumnStretch(1, 1);
      break;
    case ViewLayout::three_d_large:
      put(three_d, 0, 0, 3, 1);
      put(axial, 0, 1, 1, 1);
      put(sagittal, 1, 1, 1, 1);
      put(coronal, 2, 1, 1, 1);
      for (int line = 0; line < 3; ++line) grid_->setRowStretch(line, 1);
      grid_->setColumnStretch(0, 5);
      grid_->setColumnStretch(1, 2);
      break;
    case ViewLayout::one:
      put(maximised_, 0, 0, 1, 1);
      grid_->setRowStretch(0, 1);
      grid_->setColumnStretch(0, 1);
      break;
  }
  for (int place = 0; place < count; ++place) {
    auto* frame = frames_[static_cast<std::size_t>(place)];
    frame->setVisible(shown[static_cast<std::size_t>(place)]);
    frame->set_maximised(maximised_ == place);
  }
  emit layoutChanged();
}

void ViewGrid::reset_views() {
  for (auto* frame : frames_) frame->view().fit();
}

int ViewGrid::active_place() const {
  for (int place = 0; place < count; ++place) {
    const auto& active = view(place);
    if (active.isVisible() && active.underMouse()) return place;
  }
  for (int place = 0; place < count; ++place) {
    const auto& active = view(place);
    if (active.isVisible() && active.hasFocus()) return place;
  }
  return maximised_ >= 0 ? maximised_ : static_cast<int>(three_d);
}

void ViewGrid::update_all_contents() {
  for (auto* frame : frames_) frame->view().update_content();
}

void ViewGrid::show_volume() {
  update_all_contents();
  visualization::ViewSettings settings = visualization::standard_settings(workbench_.volume());
  settings.show = state_.settings().show;
  state_.set_settings(settings);
  show_flat_scan();
  reset_views();
}

void ViewGrid::show_geometry() {
  update_all_contents();
  visualization::ViewSettings settings = state_.settings();
  settings.crosshair_mm = visualization::standard_settings(workbench_.volume()).crosshair_mm;
  settings.camera.reset();
  state_.set_settings(settings);
  show_flat_scan();
  reset_views();
}

// One slice has nothing to show but itself; the layouts bring the rest back.
void ViewGrid::show_flat_scan() {
  const auto& geometry = workbench_.volume().geometry();
  constexpr std::array<std::pair<Place, int>, 3> planes{{{axial, 2}, {sagittal, 0}, {coronal, 1}}};
  int flat = -1;
  for (const auto& [place, lps_axis] : planes)
    if (geometry.dims()[2] == 1 && geometry.axis_closest_to(lps_axis) == 2) flat = place;
  if (maximised_ >= 0 && flat_) toggle_maximised(maximised_);
  flat_ = flat >= 0;
  if (!flat_) return;
  if (maximised_ >= 0) toggle_maximised(maximised_);
  toggle_maximised(flat);
}

// While it plays, each frame draws the 3-D view and one of the slices in turn:
// the outline on a slice costs more than it tells at 60 Hz. Where the processor
// draws, it also simulates, and the slices follow at a third of that rate.
void ViewGrid::show_frame() {
  tissue_->update_content();
  if (!workbench_.playing()) {
    for (const int place : {axial, sagittal, coronal}) view(place).update_content();
    return;
  }
  if (tissue_->isVisible() && tissue_->draws_in_software() && ++frames_without_slice_ < 3) return;
  frames_without_slice_ = 0;
  constexpr std::array<int, 3> slices{axial, sagittal, coronal};
  for (std::size_t tried = 0; tried < slices.size(); ++tried) {
    next_slice_ = (next_slice_ + 1) % 3;
    auto& slice = view(slices[static_cast<std::size_t>(next_slice_)]);
    if (!slice.isVisible()) continue;
    slice.update_content();
    break;
  }
}

visualization::ViewSettings ViewGrid::picture_settings() const {
  visualization::ViewSettings settings = state_.settings();
  settings.camera = tissue_->camera();
  return settings;
}

double ViewGrid::frames_per_second() const {
  const qint64 now = clock_.elapsed();
  drawn_ms_.erase(drawn_ms_.begin(), std::find_if(drawn_ms_.begin(), drawn_ms_.end(),
                                                  [now](qint64 drawn) { return drawn > now - 1000; }));
  return static_cast<double>(drawn_ms_.size());
}

}  // namespace palpate::gui
