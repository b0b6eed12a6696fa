#pragma once

#include "palpate/core/volume.hpp"

#include <QSettings>
#include <QString>

namespace palpate::gui {

/// Which orientation the user chose for a scanner's files that leave it open.
/// Never a spacing: that differs from scan to scan.
class ScannerMemory {
 public:
  explicit ScannerMemory(QSettings& settings) : settings_(settings) {}
  /// Whether there is something to remember: the file names its scanner, and
  /// does not settle how the patient lay.
  static bool is_open_question(const core::VolumeInfo& as_the_file_says);
  /// Empty where nothing is remembered.
  QString orientation(const core::VolumeInfo& info) const;
  void remember(const core::VolumeInfo& info, const QString& orientation);
  void forget(const core::VolumeInfo& info);

 private:
  QSettings& settings_;
};

}  // namespace palpate::gui
