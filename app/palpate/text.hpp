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
/// "0.5 mm", "0.3 × 0.3 × 1 mm"; a picture has no third one. Not in mm where
/// nobody said how large a voxel is.
QString describe_spacing(const core::VolumeInfo& info);
/// Where the spacing of each axis came from.
QString describe_spacing_provenance(const core::VolumeInfo& info);
/// What a length is told in: "mm", or "voxels" while the spacing is assumed.
QString length_unit(const core::VolumeInfo& info);
/// A length of the volume's own millimetres in that unit.
double in_length_unit(double mm, const core::VolumeInfo& info);
/// "12.3 mm" or "24.6 voxels".
QString describe_length(double mm, const core::VolumeInfo& info, int decimals = 1);
/// "1.26 s", with as many decimals as the frames need; empty where not known.
QString describe_frame_time(const core::VolumeInfo& info, int frame);
/// "frame 3 of 8 · 0.40 s".
QString describe_frame(const core::VolumeInfo& info, int frame);
/// "147 × 106 × 104 · 0.5 mm · 8 frames".
QString describe_volume(const core::VolumeInfo& info);
/// What the header says of kind and geometry, line by line, with the codes of
/// the warnings; nothing of the patient, no description, no date.
QString geometry_report(const core::VolumeInfo& info);
QString describe_provenance(core::Provenance provenance);
/// A device's name as people know it: "CPU · AMD EPYC (PoCL)".
QString short_device(const QString& name);
/// Whether OpenGL's renderer of this name is the processor.
bool is_software_renderer(const QString& name);

}  // namespace palpate::gui
