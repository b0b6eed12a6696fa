#include "panels/filter_panel.hpp"

#include "text.hpp"
#include "ui_filter_panel.h"

#include "palpate/imaging/filters.hpp"

#include <algorithm>

namespace palpate::gui {

FilterPanel::FilterPanel(Workbench& workbench, QWidget* parent)
    : QWidget(parent), workbench_(workbench), ui_(std::make_unique<Ui::FilterPanel>()) {
  ui_->setupUi(this);
  ui_->filterCombo->addItem(tr("None"));
  for (const auto& filter : imaging::filters()) {
    ui_->filterCombo->addItem(QString::fromStdString(filter.title), QString::fromStdString(filter.name));
  }
  connect(ui_->filterCombo, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &FilterPanel::choose);
  connect(ui_->applyFilterButton, &QPushButton::clicked, this, &FilterPanel::apply);
  connect(&workbench_, &Workbench::volumeOpened, this, [this] {
    ui_->filterCombo->setCurrentIndex(0);
    refresh();
  });
  connect(&workbench_, &Workbench::tissueBuilt, this, &FilterPanel::refresh);
  connect(&workbench_, &Workbench::tissueDropped, this, &FilterPanel::refresh);
  choose(0);
}

FilterPanel::~FilterPanel() = default;

void FilterPanel::choose(int index) {
  const bool any = index > 0;
  ui_->parameterLabel->setVisible(any);
  ui_->parameterSpin->setVisible(any);
  if (any) {
    const auto& filter = imaging::filters()[static_cast<std::size_t>(index - 1)];
    ui_->filterText->setText(QString::fromStdString(filter.text));
    const auto& parameter = filter.parameters.front();
    ui_->parameterLabel->setText(QString::fromStdString(parameter.text));
    ui_->parameterSpin->setDecimals(parameter.whole_number ? 0 : 2);
    ui_->parameterSpin->setSingleStep(parameter.whole_number ? 1.0 : 0.1);
    ui_->parameterSpin->setRange(parameter.min, parameter.max);
    ui_->parameterSpin->setValue(parameter.standard);
  } else {
    ui_->filterText->setText(tr("The tissue is taken from the scan as it is."));
  }
  ui_->applyFilterButton->setText(any ? tr("Apply filter") : tr("Go on without a filter"));
  refresh();
}

void FilterPanel::apply() {
  const int index = ui_->filterCombo->currentIndex();
  std::vector<imaging::FilterStep> chain;
  if (index > 0) {
    const auto& filter = imaging::filters()[static_cast<std::size_t>(index - 1)];
    chain.push_back({filter.name, {{filter.parameters.front().name, ui_->parameterSpin->value()}}});
  }
  workbench_.apply_filters(chain);
}

void FilterPanel::refresh() {
  ui_->noteLabel->setText(tr("This drops the tissue; it is then made again."));
  ui_->noteLabel->setVisible(workbench_.has_tissue());
  ui_->applyFilterButton->setEnabled(workbench_.has_volume());
}

QString FilterPanel::result() const {
  const auto& chain = workbench_.recipe().filters;
  if (chain.empty()) return tr("None");
  QStringList parts;
  for (const auto& step : chain) {
    const auto& known = imaging::filters();
    const auto found = std::find_if(known.begin(), known.end(),
                                    [&](const auto& filter) { return filter.name == step.name; });
    QString part = QString::fromStdString(found != known.end() ? found->title : step.name);
    for (const auto& [name, value] : step.parameters) {
      const bool voxels = name.find("voxel") != std::string::npos;
      part += QStringLiteral(", %1 %2").arg(short_number(value, voxels ? 1 : 2),
                                            voxels ? tr("voxels") : tr("mm"));
    }
    parts << part;
  }
  return parts.join(QStringLiteral(" + "));
}

}  // namespace palpate::gui
