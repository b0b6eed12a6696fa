#pragma once

#include "palpate/core/volume.hpp"

#include <QString>

namespace palpate::gui {

/// Numbers as people read them: "216 k", "1.2 M", "8.1 ms", "147 × 106 × 104".
QString short_count(double count);
QString grouped(qulonglong count);
QString short_bytes(double bytes);
QString short_time(double seconds);
QString short_number(double value, int significant_digits = 3);
QString describe_dims(const core::ImageGeometry& geometry);
QString describe_spacing(const core::VolumeInfo& info);
QString describe_series(const core::VolumeInfo& info);
QString describe_provenance(core::Provenance provenance);
/// A device's name as people know it: "CPU · AMD EPYC (PoCL)".
QString short_device(const QString& name);
/// Whether OpenGL's renderer of this name is the processor.
bool is_software_renderer(const QString& name);

}  // namespace palpate::gui
