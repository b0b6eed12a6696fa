#include "text.hpp"

#include <QLocale>
#include <QRegularExpression>
#include <QStringList>

#include <cmath>

namespace palpate::gui {

QString short_number(double value, int significant_digits) {
  if (!std::isfinite(value)) return QStringLiteral("∞");
  const double size = std::abs(value);
  if (size == 0.0) return QStringLiteral("0");
  // A whole number is shown whole.
  if (size < 1e6 && value == std::round(value)) return QString::number(value, 'f', 0);
  const int whole = static_cast<int>(std::floor(std::log10(size))) + 1;
  return QString::number(value, 'f', std::clamp(significant_digits - whole, 0, 6));
}

QString short_count(double count) {
  if (count < 1000.0) return QString::number(std::lround(count));
  if (count < 1e6) return QStringLiteral("%1 k").arg(short_number(count / 1e3));
  return QStringLiteral("%1 M").arg(short_number(count / 1e6));
}

QString grouped(qulonglong count) {
  QString text = QString::number(count);
  // A thin space that does not break, as the SI writes numbers.
  for (int place = text.size() - 3; place > 0; place -= 3) text.insert(place, QChar(0x202F));
  return text;
}

QString short_bytes(double bytes) {
  if (bytes < 1e6) return QStringLiteral("%1 kB").arg(short_number(std::max(1.0, bytes / 1e3)));
  if (bytes < 1e9) return QStringLiteral("%1 MB").arg(short_number(bytes / 1e6));
  return QStringLiteral("%1 GB").arg(short_number(bytes / 1e9));
}

QString short_time(double seconds) {
  if (!std::isfinite(seconds)) return QStringLiteral("∞");
  if (seconds < 1e-3) return QStringLiteral("%1 µs").arg(short_number(seconds * 1e6, 2));
  if (seconds < 1.0) return QStringLiteral("%1 ms").arg(short_number(seconds * 1e3, 2));
  if (seconds < 100.0) return QStringLiteral("%1 s").arg(short_number(seconds, 2));
  return QStringLiteral("%1 min").arg(std::lround(seconds / 60.0));
}

QString describe_dims(const core::ImageGeometry& geometry) {
  const auto& dims = geometry.dims();
  return QStringLiteral("%1 × %2 × %3").arg(dims[0]).arg(dims[1]).arg(dims[2]);
}

QString describe_spacing(const core::VolumeInfo& info) {
  const auto& spacing = info.geometry.spacing_mm();
  if (spacing.maxCoeff() - spacing.minCoeff() < 1e-6 * spacing.maxCoeff()) {
    return QStringLiteral("%1 mm").arg(short_number(spacing[0]));
  }
  return QStringLiteral("%1 × %2 × %3 mm")
      .arg(short_number(spacing[0]), short_number(spacing[1]), short_number(spacing[2]));
}

QString describe_series(const core::VolumeInfo& info) {
  QStringList parts;
  if (!info.modality.empty()) parts << QString::fromStdString(info.modality);
  parts << describe_dims(info.geometry) << describe_spacing(info);
  if (info.frames > 1) parts << QStringLiteral("%1 frames").arg(info.frames);
  return parts.join(QStringLiteral(" · "));
}

QString describe_provenance(core::Provenance provenance) {
  switch (provenance) {
    case core::Provenance::stated:
      return QStringLiteral("stated in the file");
    case core::Provenance::private_tag:
      return QStringLiteral("from the maker's own tags");
    case core::Provenance::derived:
      return QStringLiteral("derived from the file");
    case core::Provenance::assumed:
      return QStringLiteral("assumed: the file does not say");
    case core::Provenance::user:
      return QStringLiteral("stated by you");
    case core::Provenance::absent:
      return QStringLiteral("not in the file");
  }
  return {};
}

QString short_device(const QString& name) {
  QString shown = name;
  // The portable driver puts its own words and the compiler's target first.
  static const QRegularExpression portable(
      QStringLiteral("^(pthread|cpu|basic)(-minimal)?-((?!AMD|Intel|ARM)[a-z0-9_]+(-avx512|-avx2|-avx)?-)?"));
  const bool is_portable = portable.match(shown).hasMatch();
  shown.remove(portable);
  static const QRegularExpression noise(
      QStringLiteral("\\((R|TM|C)\\)|\\b\\d+-Core\\b|\\bProcessor\\b|\\bCPU\\b|@ *[0-9.]+ *GHz"),
      QRegularExpression::CaseInsensitiveOption);
  shown.remove(noise);
  shown = shown.simplified();
  return is_portable ? QStringLiteral("CPU · %1 (PoCL)").arg(shown) : shown;
}

bool is_software_renderer(const QString& name) {
  for (const char* word : {"llvmpipe", "softpipe", "swrast", "swr"}) {
    if (name.contains(QLatin1String(word), Qt::CaseInsensitive)) return true;
  }
  return false;
}

}  // namespace palpate::gui
