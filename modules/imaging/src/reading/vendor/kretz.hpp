#pragma once

#include "../dicom_file.hpp"
#include "../parsed.hpp"

#include <filesystem>

namespace palpate::imaging::reading {

/// Whether a file begins as GE Kretz volumes do (.vol, .v00).
bool is_kretz_file(const std::filesystem::path& path);
/// Whether a DICOM file carries one.
bool holds_kretz(const DicomFile& file);

/// Reads a Kretz volume or sequence, converted to a Cartesian grid. Throws
/// Error(input): "unsupported" where it is compressed or of another kind,
/// "truncated", "bad-header", "too-large".
Parsed parse_kretz_file(const std::filesystem::path& path, const Context& context);
/// `info` comes with what the DICOM header says.
Parsed parse_kretz_in(const DicomFile& file, core::VolumeInfo info, const Context& context);

}  // namespace palpate::imaging::reading
