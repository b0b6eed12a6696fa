#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace palpate::compute {

/// Where what was found out about drivers and devices is kept between runs:
/// PALPATE_CACHE_DIR, else palpate below XDG_CACHE_HOME, else ~/.cache/palpate.
/// None where the environment names no folder. All of it may be deleted at any
/// time; the folder is made when something is written.
std::optional<std::filesystem::path> cache_folder();

/// Writes aside and renames, a checksum before the bytes. False where that
/// does not work (a full or read-only disk); never throws. Nothing half-written
/// is left.
bool write_cached(const std::filesystem::path& file, const std::string& bytes) noexcept;
/// The same, but where the file is there already it stays: the first writer of
/// all processes wins. One that cannot be read is replaced.
bool write_cached_once(const std::filesystem::path& file, const std::string& bytes) noexcept;
/// The bytes, or none where the file is missing, cut short or damaged. Never throws.
std::optional<std::string> read_cached(const std::filesystem::path& file) noexcept;

}  // namespace palpate::compute
