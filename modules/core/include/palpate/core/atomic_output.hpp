#pragma once

#include "palpate/core/error.hpp"

#include <cstddef>
#include <filesystem>
#include <string>

namespace palpate::core {

/// Error(output): `path` could not be written, and why.
Error output_error(const std::filesystem::path& path, const std::string& code, const std::string& reason);

/// A hidden folder beside the target, where output is made under its final
/// names (a .mhd names its data file) and from where it is renamed into
/// place. Whatever was not placed is removed with the folder.
class AtomicOutput {
 public:
  /// A target that is a link stands for what it points to. Throws
  /// Error(output) when the target's folder is missing or not writable.
  explicit AtomicOutput(const std::filesystem::path& target);
  ~AtomicOutput();
  AtomicOutput(const AtomicOutput&) = delete;
  AtomicOutput& operator=(const AtomicOutput&) = delete;

  const std::filesystem::path& target() const noexcept { return target_; }
  /// Where to make what ends up at `target()`.
  std::filesystem::path staged() const { return staging_ / target_.filename(); }
  /// Where to make a file that goes beside the target.
  std::filesystem::path staged(const std::string& name) const { return staging_ / name; }
  /// Sends a staged file or folder to the disk and renames it to `place`.
  void commit(const std::filesystem::path& staged_path, const std::filesystem::path& place) const;

 private:
  std::filesystem::path target_;
  std::filesystem::path staging_;
};

/// Writes a file whole or not at all: what stood there stays until the new
/// bytes lie on the disk. A device or a pipe is written as it is, since a
/// rename would put a file in its place. Throws Error(output).
void write_file(const std::filesystem::path& path, const void* bytes, std::size_t count);
void write_file(const std::filesystem::path& path, const std::string& bytes);

}  // namespace palpate::core
