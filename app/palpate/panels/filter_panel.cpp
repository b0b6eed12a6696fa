#include "panels/filter_panel.hpp"

#include "icons.hpp"
#include "panels/filter_card.hpp"
#include "text.hpp"
#include "ui_filter_panel.h"

#include <QMenu>

#include <algorithm>

namespace palpate::gui {
namespace {

QString title_of(const std::string& name) {
  for (const auto& filter : imaging::filters())
    if (filter.name == name) return QString::fromStdString(filter.title);
  return QString::fromStdString(name);
}

QString change_text(double before, double after) {
  return QStringLiteral("%1 → %2").arg(short_number(before), short_number(after));
}

/// With every parameter, so that a chain from the panel equals one that left the standards out.
std::vector<imaging::FilterStep> spelt_out(const std::vector<imaging::FilterStep>& chain) {
  std::vector<imaging::FilterStep> all = chain;
  for (auto& step : all)
    for (const auto& filter : imaging::filters())
      if (filter.name == step.name)
        for (const auto& parameter : filter.parameters)
          step.parameters.emplace(parameter.name, parameter.standard);
  return all;
}

}  // namespace

FilterPanel::FilterPanel(Workbench& workbench, QWidget* parent)
    : QWidget(parent), workbench_(workbench), ui_(std::make_unique<Ui::FilterPanel>()) {
  ui_->setupUi(this);
  fill_menu();
  connect(ui_->applyFilterButton, &QPushButton::clicked, this, [this] { workbench_.apply_filters(chain()); });
  connect(ui_->compareButton, &QPushButton::pressed, this, [this] { workbench_.set_comparing(true); });
  connect(ui_->compareButton, &QPushButton::released, this, [this] { workbench_.set_comparing(false); });
  connect(&workbench_, &Workbench::volumeOpened, this, [this] {
    entries_.clear();
    build_cards();
    follow_recipe();
  });
  connect(&workbench_, &Workbench::volumeFiltered, this, &FilterPanel::follow_recipe);
  for (const auto signal : {&Workbench::tissueBuilt, &Workbench::tissueDropped, &Workbench::frameShown}) {
    connect(&workbench_, signal, this, &FilterPanel::refresh);
  }
  connect(&workbench_, &Workbench::geometryStated, this, [this] { build_cards(); });
  connect(&workbench_.preview(), &FilterPreview::changed, this, [this] {
    if (workbench_.preview().settled()) preview_problem_.clear();
    refresh();
  });
  connect(&workbench_.preview(), &FilterPreview::failed, this, [this](const QString& why) {
    preview_problem_ = why;
    refresh();
  });
  build_cards();
}

FilterPanel::~FilterPanel() = default;

void FilterPanel::fill_menu() {
  auto* menu = new QMenu(this);
  menu->setToolTipsVisible(true);
  for (const auto& filter : imaging::filters()) {
    auto* action = menu->addAction(QString::fromStdString(filter.title));
    action->setObjectName(QStringLiteral("add_") + QString::fromStdString(filter.name));
    action->setToolTip(QString::fromStdString(filter.text));
    connect(action, &QAction::triggered, this, [this, name = filter.name] { add(name); });
  }
  ui_->addFilterButton->setMenu(menu);
}

void FilterPanel::add(const std::string& name) {
  take_cards();
  entries_.append({spelt_out({{name, {}}}).front(), true});
  build_cards();
}

void FilterPanel::move(int at, int by) {
  const int to = at + by;
  if (to < 0 || to >= entries_.size()) return;
  take_cards();
  std::swap(entries_[at], entries_[to]);
  build_cards();
}

void FilterPanel::remove(int at) {
  take_cards();
  entries_.removeAt(at);
  build_cards();
}

void FilterPanel::take_cards() {
  for (int at = 0; at < cards_.size(); ++at) entries_[at] = {cards_[at]->step(), cards_[at]->on()};
}

void FilterPanel::build_cards() {
  // A card asks for this from inside itself: it goes once it is done.
  for (auto* card : cards_) {
    card->hide();
    card->setObjectName({});
    for (auto* child : card->findChildren<QObject*>()) child->setObjectName({});
    card->deleteLater();
  }
  cards_.clear();
  const QString unit = workbench_.has_volume() ? length_unit(workbench_.info()) : QStringLiteral("mm");
  for (int at = 0; at < entries_.size(); ++at) {
    auto* card =
        new FilterCard(at + 1, at + 1 == entries_.size(), entries_[at].step, entries_[at].on, unit, this);
    ui_->chainLayout->addWidget(card);
    cards_.append(card);
    connect(card, &FilterCard::changed, this, &FilterPanel::show_preview);
    connect(card, &FilterCard::moveRequested, this, [this, at](int by) { move(at, by); });
    connect(card, &FilterCard::removeRequested, this, [this, at] { remove(at); });
  }
  show_preview();
}

std::vector<imaging::FilterStep> FilterPanel::chain() const {
  std::vector<imaging::FilterStep> steps;
  for (const auto* card : cards_)
    if (card->on()) steps.push_back(card->step());
  return steps;
}

// The cards show what was applied, as an undo or another scan left it; what
// is switched off stays where the rest agrees.
void FilterPanel::follow_recipe() {
  const auto applied = spelt_out(workbench_.recipe().filters);
  if (!(applied == chain())) {
    entries_.clear();
    for (const auto& step : applied) entries_.append({step, true});
    cards_.isEmpty() && entries_.isEmpty() ? refresh() : build_cards();
  }
  refresh();
}

void FilterPanel::show_preview() {
  preview_problem_.clear();
  const auto wanted = chain();
  const auto& applied = workbench_.recipe().filters;
  if (isVisible()) workbench_.preview_filters(wanted == spelt_out(applied) ? applied : wanted);
  refresh();
}

void FilterPanel::showEvent(QShowEvent* event) {
  QWidget::showEvent(event);
  show_preview();
}

void FilterPanel::hideEvent(QHideEvent* event) {
  QWidget::hideEvent(event);
  workbench_.set_comparing(false);
  workbench_.preview_filters({});
}

void FilterPanel::refresh() {
  const auto wanted = chain();
  const auto applied = spelt_out(workbench_.recipe().filters);
  const bool same = wanted == applied;
  ui_->emptyText->setVisible(cards_.isEmpty());
  ui_->addFilterButton->setEnabled(workbench_.has_volume());
  ui_->compareButton->setEnabled(workbench_.preview().active() || workbench_.is_filtered());
  ui_->compareButton->setVisible(!cards_.isEmpty() || !applied.empty());

  QString state;
  if (!preview_problem_.isEmpty()) {
    state = preview_problem_;
  } else if (workbench_.preview().active()) {
    state = workbench_.preview().settled() ? tr("The slices show a preview.") : tr("Making the preview…");
  } else if (same && !applied.empty()) {
    state = tr("Applied to the whole scan.");
  }
  ui_->previewLabel->setText(state);
  ui_->previewLabel->setVisible(!state.isEmpty());
  show_speckle();

  ui_->noteLabel->setText(tr("This drops the tissue; it is then made again."));
  ui_->noteLabel->setVisible(workbench_.has_tissue() && !(same && !applied.empty()));
  if (wanted.empty()) {
    ui_->applyFilterButton->setText(applied.empty() ? tr("Go on without a filter")
                                                    : tr("Take the filter away"));
  } else {
    ui_->applyFilterButton->setText(same                ? tr("Applied")
                                    : wanted.size() > 1 ? tr("Apply filters")
                                                        : tr("Apply filter"));
  }
  ui_->applyFilterButton->setEnabled(workbench_.has_volume() && !(same && !applied.empty()));
}

void FilterPanel::show_speckle() {
  const auto& speckle = workbench_.speckle();
  ui_->speckleLabel->setVisible(speckle.has_value());
  if (!speckle) return;
  QStringList parts;
  if (speckle->before.blocks > 0)
    parts << tr("Speckle SNR %1").arg(change_text(speckle->before.snr, speckle->after.snr));
  parts << tr("contrast-to-noise %1").arg(change_text(speckle->before.cnr, speckle->after.cnr));
  ui_->speckleLabel->setText(parts.join(QStringLiteral(" · ")));
  ui_->speckleLabel->setToolTip(tr("Before and after the filter. SNR: mean over standard deviation in the %1 "
                                   "most even blocks of tissue. "
                                   "Contrast-to-noise: bright against dark.")
                                    .arg(speckle->before.blocks));
}

QString FilterPanel::result() const {
  const auto& applied = workbench_.recipe().filters;
  if (applied.empty()) return tr("None");
  QStringList parts;
  for (const auto& step : spelt_out(applied)) {
    QString part = title_of(step.name);
    for (const auto& filter : imaging::filters()) {
      if (filter.name != step.name || applied.size() > 1) continue;
      // The first one is what a filter is known by; the rest stands in the panel.
      const auto& parameter = filter.parameters.front();
      const double value = step.parameters.at(parameter.name);
      QString unit = QString::fromStdString(parameter.unit);
      if (parameter.unit == "mm") unit = length_unit(workbench_.info());
      if (parameter.unit == "voxels" && value == 1.0) unit = tr("voxel");
      if (parameter.name == "iterations") unit = tr("steps");
      part += QStringLiteral(", %1 %2").arg(short_number(value), unit);
    }
    parts << part.trimmed();
  }
  return parts.join(QStringLiteral(" → "));
}

}  // namespace palpate::gui
