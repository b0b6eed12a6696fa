#include "panels/tissue_panel.hpp"

#include "panels/more_button.hpp"
#include "text.hpp"
#include "ui_tissue_panel.h"

#include <QFileDialog>
#include <QSignalBlocker>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace palpate::gui {
namespace {

const QString about = QStringLiteral("≈ ");
constexpr int slider_steps = 1000;
// As the list in the form has them.
constexpr model::LinkRule link_rules[] = {model::LinkRule::nearest, model::LinkRule::six,
                                          model::LinkRule::lattice18, model::LinkRule::lattice26};

}  // namespace

TissuePanel::TissuePanel(Workbench& workbench, QWidget* parent)
    : QWidget(parent), workbench_(workbench), ui_(std::make_unique<Ui::TissuePanel>()) {
  ui_->setupUi(this);
  crop_ = {
      {{ui_->cropIBegin, ui_->cropIEnd}, {ui_->cropJBegin, ui_->cropJEnd}, {ui_->cropKBegin, ui_->cropKEnd}}};
  wire_more(ui_->moreButton, ui_->moreBox);
  ui_->thresholdSlider->setRange(0, slider_steps);
  ui_->cropBox->hide();
  wire();
  show_waiting(QString());
  show_note();
  show_surface_source();
  show_mask();
  setEnabled(false);
}

TissuePanel::~TissuePanel() = default;

void TissuePanel::wire() {
  wire_mask();
  const auto take = [this] { take_parameters(); };
  connect(ui_->thresholdAuto, &QCheckBox::toggled, this, take);
  connect(ui_->thresholdSpin, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this, take);
  connect(ui_->thresholdSlider, &QSlider::valueChanged, this, [this](int slider) {
    if (filling_) return;
    ui_->thresholdAuto->setChecked(false);  // who moves it wants this one
    ui_->thresholdSpin->setValue(slider_to_value(slider));
  });
  for (auto* box : {ui_->thresholdHigh, ui_->noiseSpin}) {
    connect(box, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this, take);
  }
  for (auto* box : {ui_->strideSpin, ui_->maxLinksSpin, ui_->minComponentSpin, ui_->seedSpin}) {
    connect(box, QOverload<int>::of(&QSpinBox::valueChanged), this, take);
  }
  for (const auto& axis : crop_) {
    for (auto* box : axis) connect(box, QOverload<int>::of(&QSpinBox::valueChanged), this, take);
  }
  for (auto* box : {ui_->linksCombo, ui_->pointsCombo})
    connect(box, QOverload<int>::of(&QComboBox::currentIndexChanged), this, take);
  connect(ui_->cropCheck, &QCheckBox::toggled, this, take);
  connect(ui_->faceBudgetSpin, QOverload<int>::of(&QSpinBox::valueChanged), this, [this](int faces) {
    if (filling_) return;
    workbench_.set_face_budget(faces);
    changed_since_built_ = true;
    show_note();
  });
  connect(ui_->surfaceCombo, QOverload<int>::of(&QComboBox::activated), this, &TissuePanel::choose_surface);
  connect(ui_->meshSpaceCombo, QOverload<int>::of(&QComboBox::activated), this, [this](int space) {
    const auto& mesh = workbench_.recipe().surface.mesh;
    workbench_.set_surface_mesh(mesh ? QString::fromStdString(mesh->string()) : QString(),
                                static_cast<surface::MeshSpace>(space));
  });
  connect(&workbench_, &Workbench::surfaceSourceChanged, this, [this] {
    changed_since_built_ = workbench_.has_tissue();
    show_surface_source();
    show_note();
  });
  connect(ui_->buildButton, &QPushButton::clicked, &workbench_, &Workbench::build_tissue);
  connect(&workbench_, &Workbench::tissueParametersChanged, this, &TissuePanel::show_parameters);
  connect(&workbench_, &Workbench::volumeOpened, this, &TissuePanel::set_ranges);
  connect(&workbench_, &Workbench::volumeOpened, this, &TissuePanel::show_note);
  connect(&workbench_, &Workbench::volumeFiltered, this, &TissuePanel::set_ranges);
  connect(&workbench_, &Workbench::frameShown, this, &TissuePanel::show_note);
  connect(&workbench_, &Workbench::estimateStarted, this, [this] { show_waiting(tr("Counting…")); });
  connect(&workbench_, &Workbench::tissueEstimated, this, &TissuePanel::show_estimate);
  connect(&workbench_, &Workbench::estimateFailed, this, [this](const QString& why) { show_waiting(why); });
  connect(&workbench_, &Workbench::tissueBuilt, this, &TissuePanel::show_built);
  connect(&workbench_, &Workbench::tissueDropped, this, &TissuePanel::show_note);
}

// The ranges of the volume that is there; what the user chose stays where it fits.
void TissuePanel::set_ranges() {
  filling_ = true;
  setEnabled(true);
  const auto& range = workbench_.filtered().range();
  const double span = static_cast<double>(range.max) - range.min;
  const int decimals = span > 20.0 ? 0 : 3;
  for (auto* box : {ui_->thresholdSpin, ui_->thresholdHigh}) {
    box->setDecimals(decimals);
    box->setSingleStep(decimals == 0 ? 1.0 : span / 100.0);
    box->setRange(range.min, std::max<double>(range.max, range.min));
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int last = workbench_.volume().dims()[axis] - 1;
    for (auto* box : crop_[axis]) box->setRange(0, last);
  }
  filling_ = false;
  show_parameters();
  changed_since_built_ = false;
  show_note();
}

// What the recipe says, after a session was opened too.
void TissuePanel::show_parameters() {
  if (!workbench_.has_volume() || taking_) return;
  filling_ = true;
  const auto& tissue = workbench_.recipe().tissue;
  const bool automatic = !tissue.threshold_low.has_value();
  ui_->thresholdAuto->setChecked(automatic);
  ui_->thresholdHigh->setValue(std::isfinite(tissue.threshold_high) ? tissue.threshold_high
                                                                    : ui_->thresholdHigh->maximum());
  ui_->strideSpin->setValue(tissue.stride);
  ui_->pointsCombo->setCurrentIndex(tissue.points == model::PointRule::lattice ? 0 : 1);
  const auto* rule = std::find(std::begin(link_rules), std::end(link_rules), tissue.links);
  ui_->linksCombo->setCurrentIndex(static_cast<int>(rule - std::begin(link_rules)));
  ui_->maxLinksSpin->setValue(tissue.max_links);
  ui_->minComponentSpin->setValue(static_cast<int>(tissue.min_component));
  ui_->noiseSpin->setValue(tissue.noise);
  ui_->seedSpin->setValue(static_cast<int>(tissue.seed));
  ui_->faceBudgetSpin->setValue(workbench_.recipe().surface.face_budget);
  ui_->cropCheck->setChecked(tissue.crop.has_value());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    crop_[axis][0]->setValue(tissue.crop ? tissue.crop->begin[axis] : 0);
    crop_[axis][1]->setValue((tissue.crop ? tissue.crop->end[axis] : workbench_.volume().dims()[axis]) - 1);
  }
  filling_ = false;
  if (!automatic) show_threshold(*tissue.threshold_low);
  show_mask();
  show_enabled();
}

void TissuePanel::show_enabled() {
  const bool lattice = ui_->pointsCombo->currentIndex() == 0;
  ui_->thresholdSpin->setEnabled(!ui_->thresholdAuto->isChecked());
  ui_->linksCombo->setEnabled(lattice);
  ui_->noiseSpin->setEnabled(lattice);
  ui_->maxLinksSpin->setEnabled(ui_->linksCombo->currentIndex() == 0);
  ui_->cropBox->setVisible(ui_->cropCheck->isChecked());
}

double TissuePanel::slider_to_value(int slider) const {
  const auto& range = workbench_.filtered().range();
  return range.min + (static_cast<double>(range.max) - range.min) * slider / slider_steps;
}

void TissuePanel::show_threshold(double threshold) {
  if (!std::isfinite(threshold)) return;
  filling_ = true;
  const auto& range = workbench_.filtered().range();
  const double span = static_cast<double>(range.max) - range.min;
  ui_->thresholdSpin->setValue(threshold);
  ui_->thresholdSlider->setValue(span > 0 ? static_cast<int>((threshold - range.min) / span * slider_steps)
                                          : 0);
  filling_ = false;
}

void TissuePanel::take_parameters() {
  if (filling_) return;
  // Points without a lattice have no voxels around them.
  if (ui_->pointsCombo->currentIndex() == 1) {
    const QSignalBlocker quiet(ui_->linksCombo);
    ui_->linksCombo->setCurrentIndex(0);
  }
  show_enabled();
  model::TissueParameters tissue;
  if (!ui_->thresholdAuto->isChecked()) {
    tissue.threshold_low = ui_->thresholdSpin->value();
    show_threshold(*tissue.threshold_low);
  }
  if (ui_->thresholdHigh->value() < ui_->thresholdHigh->maximum())
    tissue.threshold_high = ui_->thresholdHigh->value();
  tissue.stride = ui_->strideSpin->value();
  tissue.points =
      ui_->pointsCombo->currentIndex() == 0 ? model::PointRule::lattice : model::PointRule::blue_noise;
  tissue.links = link_rules[ui_->linksCombo->currentIndex()];
  tissue.max_links = ui_->maxLinksSpin->value();
  tissue.min_component = static_cast<std::size_t>(ui_->minComponentSpin->value());
  tissue.noise = ui_->noiseSpin->value();
  tissue.seed = static_cast<std::uint64_t>(ui_->seedSpin->value());
  if (ui_->cropCheck->isChecked()) {
    model::CropBox crop;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      crop.begin[axis] = crop_[axis][0]->value();
      crop.end[axis] = std::max(crop_[axis][0]->value(), crop_[axis][1]->value()) + 1;
    }
    tissue.crop = crop;
  }
  changed_since_built_ = true;
  taking_ = true;  // the fields say already what the recipe is told
  workbench_.set_tissue_parameters(tissue);
  taking_ = false;
  show_note();
}

void TissuePanel::show_waiting(const QString& text) {
  for (auto* label :
       {ui_->pointsValue, ui_->linksValue, ui_->componentsValue, ui_->memoryValue, ui_->stepValue}) {
    label->setText(QStringLiteral("–"));
  }
  ui_->estimateLabel->setText(text);
}

void TissuePanel::show_estimate() {
  const auto& estimate = workbench_.estimate();
  if (!estimate) return;
  if (ui_->thresholdAuto->isChecked()) show_threshold(estimate->threshold_low);
  if (workbench_.has_tissue() && !changed_since_built_) return;  // the real ones stand there
  const auto& statistics = estimate->tissue.statistics;
  const QString mark = estimate->tissue.sampled ? about : QString();
  ui_->pointsValue->setText(grouped(statistics.points));
  ui_->linksValue->setText(mark + (estimate->tissue.sampled
                                       ? short_count(static_cast<double>(statistics.links))
                                       : grouped(statistics.links)));
  ui_->componentsValue->setText(mark + grouped(statistics.components));
  ui_->memoryValue->setText(about + short_bytes(static_cast<double>(statistics.bytes)));
  ui_->stepValue->setText(about + short_time(estimate->stable_step.step_s));
  ui_->estimateLabel->setText(tr("≈ is estimated from a part of the tissue."));
}

void TissuePanel::show_built() {
  changed_since_built_ = false;
  const auto& built = *workbench_.tissue();
  ui_->pointsValue->setText(grouped(built.statistics.points));
  ui_->linksValue->setText(grouped(built.statistics.links));
  ui_->componentsValue->setText(grouped(built.statistics.components));
  ui_->memoryValue->setText(short_bytes(static_cast<double>(built.statistics.bytes)));
  ui_->stepValue->setText(short_time(built.stable_step.step_s));
  ui_->estimateLabel->setText(tr("Built in %1.").arg(short_time(built.build_s)));
  if (ui_->thresholdAuto->isChecked()) show_threshold(built.threshold_low);
  show_note();
  show_surface_source();
}

void TissuePanel::wire_mask() {
  connect(ui_->maskCombo, QOverload<int>::of(&QComboBox::activated), this, &TissuePanel::choose_mask);
  connect(ui_->maskLabelSpin, QOverload<int>::of(&QSpinBox::valueChanged), this, [this](int label) {
    if (filling_) return;
    session::MaskSettings mask = workbench_.recipe().mask;
    mask.label.reset();
    if (label > 0) mask.label = label;
    changed_since_built_ = workbench_.has_tissue();
    workbench_.set_mask(mask);
    show_note();
  });
  connect(&workbench_.jobs(), &JobTracker::jobCancelled, this, &TissuePanel::show_mask);
}

void TissuePanel::choose_mask(int source) {
  session::MaskSettings mask;
  if (source > 0) {
    const QString scan = QString::fromStdString(workbench_.recipe().input.path.parent_path().string());
    const QString path = QFileDialog::getOpenFileName(
        this, tr("Open a label file: what it marks becomes tissue"), scan,
        tr("Label images (*.mha *.mhd *.nrrd *.nhdr *.nii *.nii.gz *.dcm);;All files (*)"));
    if (path.isEmpty()) {
      show_mask();
      return;
    }
    mask.path = native_path(path);
  }
  changed_since_built_ = workbench_.has_tissue();
  workbench_.set_mask(mask);
  show_note();
}

void TissuePanel::show_mask() {
  const auto& mask = workbench_.recipe().mask;
  const bool masked = mask.path.has_value();
  const bool was_filling = filling_;
  filling_ = true;
  ui_->maskCombo->setCurrentIndex(masked ? 1 : 0);
  ui_->maskLabelSpin->setValue(mask.label.value_or(0));
  filling_ = was_filling;
  for (QWidget* widget :
       {static_cast<QWidget*>(ui_->maskLabelTitle), static_cast<QWidget*>(ui_->maskLabelSpin),
        static_cast<QWidget*>(ui_->maskFileLabel)})
    widget->setVisible(masked);
  ui_->maskFileLabel->setText(masked ? QString::fromStdString(mask.path->filename().string()) : QString());
  // Within a mask the threshold counts only where it is named.
  ui_->thresholdAuto->setText(masked ? tr("All &of the label") : tr("A&utomatic threshold"));
  ui_->thresholdAuto->setToolTip(masked ? tr("All that the label file marks is tissue, however bright it is")
                                        : tr("Otsu's threshold: splits bright from dark by the histogram"));
  ui_->introLabel->setText(masked ? tr("Voxels that the label file marks become tissue.")
                                  : tr("Voxels brighter than the threshold become tissue."));
}

void TissuePanel::choose_surface(int source) {
  QString path;
  if (source > 0) {
    path = QFileDialog::getOpenFileName(this, tr("Open a mesh"), QString(),
                                        tr("Meshes (*.stl *.ply *.obj *.vtp *.vtk);;All files (*)"));
    if (path.isEmpty()) {
      show_surface_source();
      return;
    }
  }
  workbench_.set_surface_mesh(path, static_cast<surface::MeshSpace>(ui_->meshSpaceCombo->currentIndex()));
}

/// The mesh's file and which way its axes were taken, once it was read.
void TissuePanel::show_surface_source() {
  const auto& settings = workbench_.recipe().surface;
  const bool from_mesh = settings.mesh.has_value();
  ui_->surfaceCombo->setCurrentIndex(from_mesh ? 1 : 0);
  ui_->meshSpaceCombo->setCurrentIndex(static_cast<int>(settings.mesh_space));
  for (QWidget* widget :
       {static_cast<QWidget*>(ui_->meshSpaceLabel), static_cast<QWidget*>(ui_->meshSpaceCombo),
        static_cast<QWidget*>(ui_->meshLabel)}) {
    widget->setVisible(from_mesh);
  }
  if (!from_mesh) return;
  QString text = QString::fromStdString(settings.mesh->filename().string());
  const bool read = workbench_.has_tissue() && !changed_since_built_;
  if (read) text += QStringLiteral(" · ") + QString::fromStdString(workbench_.surface().space_reason);
  ui_->meshLabel->setText(text);
}

void TissuePanel::show_note() {
  const bool built = workbench_.has_tissue();
  const bool of_another = built && workbench_.tissue_frame() != workbench_.frame();
  const bool flat = workbench_.has_volume() && !workbench_.has_depth();
  QString note;
  if (flat) {
    note = tr("This scan is a single slice. Tissue needs a volume: open a 3-D scan.");
  } else if (of_another) {
    note = tr("The tissue is of frame %1. Building again takes frame %2, and drops its pulls.")
               .arg(workbench_.tissue_frame() + 1)
               .arg(workbench_.frame() + 1);
  } else if (changed_since_built_) {
    note = tr("Building again replaces the tissue that is shown and its pulls.");
  }
  ui_->noteLabel->setText(note);
  ui_->noteLabel->setVisible((built || flat) && !note.isEmpty());
  ui_->buildButton->setEnabled(!flat);
  ui_->buildButton->setText(built ? tr("&Build again") : tr("&Build tissue"));
}

}  // namespace palpate::gui
