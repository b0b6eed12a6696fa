// The part of the panel that holds the time step against its limit, and points in their place.
#include "panels/simulate_panel.hpp"
#include "text.hpp"
#include "ui_simulate_panel.h"

#include "palpate/simulation/sag.hpp"

#include <QFileDialog>
#include <QFileInfo>
#include <QSignalBlocker>

#include <cmath>

namespace palpate::gui {
namespace {

using Rule = session::AnchorSettings::Rule;

double three_digits(double value) {
  const double unit = std::pow(10.0, std::floor(std::log10(value)) - 2.0);
  return std::round(value / unit) * unit;
}

void set_text(QLabel* label, const QString& text) {
  if (label->text() != text) label->setText(text);
  label->setVisible(!text.isEmpty());
}

}  // namespace

void SimulatePanel::wire_step() {
  connect(ui_->stepAuto, &QCheckBox::toggled, this, [this](bool automatic) {
    change([&](Settings& s) {
      s.step_s.reset();
      if (!automatic) s.step_s = ui_->stepSpin->value() / 1000.0;
    });
  });
  bind(ui_->stepSpin, [](Settings& s, double ms) {
    if (s.step_s) s.step_s = ms / 1000.0;
  });
  connect(ui_->limitButton, &QPushButton::toggled, &workbench_, &Workbench::show_limiting_point);
  connect(&workbench_, &Workbench::limitShown, this,
          [this] { ui_->limitButton->setChecked(workbench_.limiting_point_shown()); });
}

void SimulatePanel::wire_anchors() {
  connect(ui_->anchorCombo, QOverload<int>::of(&QComboBox::activated), this, &SimulatePanel::choose_anchors);
  connect(ui_->clearAnchorsButton, &QPushButton::clicked, &workbench_, &Workbench::clear_painted_anchors);
  connect(&workbench_, &Workbench::anchorsChanged, this, &SimulatePanel::show_anchors);
}

void SimulatePanel::choose_anchors(int rule) {
  session::AnchorSettings anchors = workbench_.recipe().simulation.anchors;
  anchors.rule = static_cast<Rule>(rule);
  anchors.sha256.clear();
  if (anchors.rule != Rule::file) {
    anchors.file.clear();
  } else {
    const QString scan = QString::fromStdString(workbench_.recipe().input.path.parent_path().string());
    const QString path = QFileDialog::getOpenFileName(
        this, tr("Open a label file: what is not 0 in it stays fixed"), scan,
        tr("Label images (*.mha *.mhd *.nrrd *.nhdr *.nii *.nii.gz *.dcm);;All files (*)"));
    if (path.isEmpty()) {
      show_anchors();
      return;
    }
    anchors.file = native_path(path);
  }
  change([&](Settings& s) { s.anchors = anchors; });
}

void SimulatePanel::show_anchors() {
  const auto& settings = workbench_.recipe().simulation;
  ui_->anchorCombo->setCurrentIndex(static_cast<int>(settings.anchors.rule));
  ui_->clearAnchorsButton->setVisible(!settings.anchors.painted.empty());
  ui_->anchorCombo->setItemText(0, settings.anchors.painted.empty() ? tr("Nothing") : tr("What is painted"));
  QStringList lines;
  if (settings.anchors.rule == Rule::file)
    lines << QString::fromStdString(settings.anchors.file.filename().string());
  const std::size_t count = workbench_.anchors() ? workbench_.anchors()->size() : 0;
  if (workbench_.has_tissue() && count == 0 && settings.anchors.rule == Rule::border)
    lines << tr("No tissue touches the border of the scan or of the crop box, so nothing is fixed.");
  else if (workbench_.has_tissue() && (count > 0 || settings.anchors.rule != Rule::none))
    lines << tr("%1 of %2 points\nfixed: blue squares")
                 .arg(grouped(count), grouped(workbench_.tissue()->statistics.points));
  set_text(ui_->anchorLabel, lines.join(QLatin1Char('\n')));
  const bool falls = workbench_.has_tissue() && count == 0 && !settings.parameters.gravity_mm_per_s2.isZero();
  QString note;
  if (falls) {
    note = tr("Nothing is fixed, so the tissue will fall out of view.");
  } else if (workbench_.has_tissue() && count > 0) {
    const auto sag = simulation::sag_under_gravity(*workbench_.tissue()->tissue, *workbench_.anchors(),
                                                   settings.parameters);
    if (!std::isfinite(sag.strain))
      note = tr("Nothing holds the tissue against this gravity.");
    else if (sag.is_too_soft())
      note =
          tr("Too soft for this gravity: it would stretch by about %1. It takes a stiffness of at least %2, "
             "or more that is fixed.")
              .arg(describe_length(sag.sag_mm, workbench_.info(), 0),
                   grouped(static_cast<qulonglong>(sag.stiffness_per_s2)) + QStringLiteral(" /s²"));
  }
  set_text(ui_->fallNote, note);
}

void SimulatePanel::show_limit() {
  const auto limit = workbench_.step_limit();
  const auto& frame = workbench_.last_frame();
  ui_->limitButton->setEnabled(limit.has_value() && std::isfinite(limit->step_s));
  QString text = QStringLiteral("–");
  if (limit && !std::isfinite(limit->step_s)) {
    text = tr("no limit with this method");
  } else if (limit && !(limit->step_s > 0.0)) {
    text = tr("none with this method");
  } else if (limit) {
    text = tr("%1, %2").arg(short_time(limit->step_s),
                            limit->is_estimate ? tr("measured") : tr("by a quick bound"));
  }
  if (ui_->limitLabel->text() != text) ui_->limitLabel->setText(text);
  ui_->limitLabel->setToolTip(
      limit && limit->is_estimate
          ? tr("The fastest vibration of this tissue was worked out; 0.90 to 1.00 of the true limit")
          : tr("A bound that is known at once and always safe; the true limit may be somewhat larger"));
  // The automatic step is shown where it would be set by hand.
  if (ui_->stepAuto->isChecked() && frame && frame->step_s > 0.0) {
    const QSignalBlocker quiet(ui_->stepSpin);
    ui_->stepSpin->setValue(three_digits(frame->step_s * 1000.0));
  }
  show_warning();
}

// Said before the run starts: the step that was named, not what the run makes of it.
void SimulatePanel::show_warning() {
  const auto limit = workbench_.step_limit();
  const auto& step_s = workbench_.recipe().simulation.step_s;
  const bool hopeless = limit && !(limit->step_s > 0.0);
  const bool above = limit && step_s && *step_s > limit->step_s;
  ui_->stepWarning->setVisible(above || hopeless);
  if (hopeless) {
    set_text(ui_->stepWarningText, tr("With this method no step is stable without damping. Choose another "
                                      "method under More, or add damping."));
    return;
  }
  if (!above) return;
  simulation::StableStep stable;
  stable.step_s = limit->step_s;
  const double parts = std::ceil(*step_s / simulation::automatic_step_s(stable) - 1e-9);
  set_text(
      ui_->stepWarningText,
      tr("%1 is above the largest stable step. Each step is taken in %2 parts of %3, so the tissue stays "
         "whole and keeps its time, and the simulation runs slower.")
          .arg(short_time(*step_s))
          .arg(static_cast<int>(parts))
          .arg(short_time(*step_s / parts)));
}

}  // namespace palpate::gui
