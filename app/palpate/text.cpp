#include "text.hpp"

#include <QObject>
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
  const QString plane = QStringLiteral("%1 × %2").arg(dims[0]).arg(dims[1]);
  return dims[2] > 1 ? QStringLiteral("%1 × %2").arg(plane).arg(dims[2]) : plane;
}

QString describe_spacing(const core::VolumeInfo& info) {
  if (info.spacing_is_assumed()) return QObject::tr("not known");
  const auto& spacing = info.geometry.spacing_mm();
  const auto plain = [](double mm) { return QString::number(mm, 'g', 3); };
  const int axes = info.geometry.dims()[2] > 1 ? 3 : 2;
  const auto used = spacing.head(axes);
  if (used.maxCoeff() - used.minCoeff() < 1e-6 * used.maxCoeff()) {
    return QStringLiteral("%1 mm").arg(plain(spacing[0]));
  }
  QStringList numbers;
  for (int axis = 0; axis < axes; ++axis) numbers << plain(spacing[axis]);
  return numbers.join(QStringLiteral(" × ")) + QStringLiteral(" mm");
}

QString describe_spacing_provenance(const core::VolumeInfo& info) {
  QStringList lines;
  const QString names = QStringLiteral("ijk");
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (info.geometry.dims()[axis] > 1)
      lines << QStringLiteral("%1: %2").arg(names.at(static_cast<int>(axis)),
                                            describe_provenance(info.spacing_provenance[axis]));
  }
  return lines.join(QLatin1Char('\n'));
}

QString length_unit(const core::VolumeInfo& info) {
  return info.spacing_is_assumed() ? QObject::tr("voxels") : QStringLiteral("mm");
}

double in_length_unit(double mm, const core::VolumeInfo& info) {
  return info.spacing_is_assumed() ? mm / info.geometry.spacing_mm().minCoeff() : mm;
}

QString describe_length(double mm, const core::VolumeInfo& info, int decimals) {
  return QStringLiteral("%1 %2").arg(in_length_unit(mm, info), 0, 'f', decimals).arg(length_unit(info));
}

QString describe_frame_time(const core::VolumeInfo& info, int frame) {
  const auto& times = info.frame_times_s;
  if (frame < 0 || static_cast<std::size_t>(frame) >= times.size()) return {};
  const double mean_s = times.size() > 1
                            ? (times.back() - times.front()) / static_cast<double>(times.size() - 1)
                            : times.front();
  return QStringLiteral("%1 s").arg(times[static_cast<std::size_t>(frame)], 0, 'f', mean_s < 0.02 ? 3 : 2);
}

QString describe_frame(const core::VolumeInfo& info, int frame) {
  const QString time = describe_frame_time(info, frame);
  const QString number = QObject::tr("frame %1 of %2").arg(frame + 1).arg(info.frames);
  return time.isEmpty() ? number : QStringLiteral("%1 · %2").arg(number, time);
}

QString describe_volume(const core::VolumeInfo& info) {
  QStringList parts{describe_dims(info.geometry),
                    info.spacing_is_assumed() ? QObject::tr("spacing not known") : describe_spacing(info)};
  if (info.frames > 1) parts << QObject::tr("%1 frames").arg(info.frames);
  return parts.join(QStringLiteral(" · "));
}

QString geometry_report(const core::VolumeInfo& info) {
  const auto word = [](core::Provenance from) { return QString::fromStdString(core::to_string(from)); };
  const auto three = [](const Eigen::Vector3d& v) {
    return QStringLiteral("%1 %2 %3").arg(v[0], 0, 'g', 8).arg(v[1], 0, 'g', 8).arg(v[2], 0, 'g', 8);
  };
  const auto& from = info.spacing_provenance;
  const auto& dims = info.geometry.dims();
  QStringList lines;
  const auto add = [&](const char* name, const QString& value) {
    if (!value.isEmpty()) lines << QStringLiteral("%1: %2").arg(QLatin1String(name), value);
  };
  add("format", QString::fromStdString(info.format));
  add("modality", QString::fromStdString(info.modality));
  add("SOP class", QString::fromStdString(info.sop_class));
  add("scanner", QString::fromStdString(info.scanner));
  add("pixel type", QString::fromStdString(info.pixel_type));
  add("size", QStringLiteral("%1 %2 %3, %4 frames").arg(dims[0]).arg(dims[1]).arg(dims[2]).arg(info.frames));
  add("spacing in mm", three(info.geometry.spacing_mm()) +
                           QStringLiteral(" (%1, %2, %3)").arg(word(from[0]), word(from[1]), word(from[2])));
  add("origin in mm",
      three(info.geometry.origin_mm()) + QStringLiteral(" (%1)").arg(word(info.origin_provenance)));
  for (int axis = 0; axis < 3; ++axis)
    lines << QStringLiteral("direction of %1: %2 (%3)")
                 .arg(QStringLiteral("ijk").at(axis))
                 .arg(three(info.geometry.direction().col(axis)), word(info.direction_provenance));
  add("orientation", QString::fromStdString(info.orientation) +
                         (info.patient_axes ? QString() : QStringLiteral(", not known in the patient")));
  if (info.frames > 1)
    add("times",
        QStringLiteral("%1 (%2)").arg(info.frame_times_s.empty() ? QStringLiteral("not known")
                                                                 : QStringLiteral("%1 s to %2 s")
                                                                       .arg(info.frame_times_s.front())
                                                                       .arg(info.frame_times_s.back()),
                                      word(info.time_provenance)));
  for (const auto& warning : info.warnings)
    lines << QStringLiteral("%1: %2").arg(QString::fromStdString(warning.code),
                                          QString::fromStdString(warning.text));
  return lines.join(QLatin1Char('\n')) + QLatin1Char('\n');
}

QString describe_provenance(core::Provenance provenance) {
  switch (provenance) {
    case core::Provenance::stated:
      return QObject::tr("stated in the file");
    case core::Provenance::private_tag:
      return QObject::tr("from the scanner maker's own entries in the file");
    case core::Provenance::derived:
      return QObject::tr("worked out from what the file says");
    case core::Provenance::assumed:
      return QObject::tr("assumed; the file does not say, so do not measure by it");
    case core::Provenance::user:
      return QObject::tr("stated by you");
    case core::Provenance::absent:
      return QObject::tr("not in the file");
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
