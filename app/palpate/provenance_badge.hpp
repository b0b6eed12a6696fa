#pragma once

#include "palpate/core/volume.hpp"

#include <QWidget>

#include <vector>

namespace palpate::gui {

/// One word for where a piece of geometry or time came from, with a shape of
/// its own, so that no colour is needed to tell them apart. The hint says what
/// it means for the reader of the picture.
class ProvenanceBadge : public QWidget {
  Q_OBJECT

 public:
  explicit ProvenanceBadge(QWidget* parent = nullptr);
  /// `subject` begins the hint: "Spacing", "Orientation".
  void show_provenance(const QString& subject, core::Provenance provenance);
  /// Of several axes the least certain is shown; the hint names each.
  void show_axes(const QString& subject, const std::vector<core::Provenance>& axes);
  core::Provenance provenance() const { return provenance_; }
  QString word() const { return word_; }
  QSize sizeHint() const override;
  QSize minimumSizeHint() const override { return sizeHint(); }

 protected:
  void paintEvent(QPaintEvent* event) override;

 private:
  core::Provenance provenance_ = core::Provenance::absent;
  QString word_;
};

/// The least certain of them; absent where there is none.
core::Provenance least_certain(const std::vector<core::Provenance>& provenances);
/// Of the axes along which there is more than one voxel.
std::vector<core::Provenance> spacing_provenances(const core::VolumeInfo& info);
/// A value is shown that nobody said: to be looked at twice. What is absent is
/// not shown at all.
bool is_uncertain(core::Provenance provenance);

}  // namespace palpate::gui
