#include "scanner_memory.hpp"

#include "stated_geometry.hpp"

namespace palpate::gui {
namespace {

QString key_of(const core::VolumeInfo& info) {
  const QString name = QString::fromStdString(info.scanner).simplified() + QLatin1Char('|') +
                       QString::fromStdString(info.format);
  return QStringLiteral("scanners/%1/orientation")
      .arg(QString::fromLatin1(name.toUtf8().toPercentEncoding()));
}

}  // namespace

bool ScannerMemory::is_open_question(const core::VolumeInfo& info) {
  return !info.scanner.empty() && !info.patient_axes;
}

QString ScannerMemory::orientation(const core::VolumeInfo& info) const {
  if (info.scanner.empty()) return {};
  const QString kept = settings_.value(key_of(info)).toString();
  return is_orientation(kept) ? kept : QString();
}

void ScannerMemory::remember(const core::VolumeInfo& info, const QString& orientation) {
  if (!info.scanner.empty() && is_orientation(orientation)) settings_.setValue(key_of(info), orientation);
}

void ScannerMemory::forget(const core::VolumeInfo& info) {
  if (!info.scanner.empty()) settings_.remove(key_of(info));
}

}  // namespace palpate::gui
