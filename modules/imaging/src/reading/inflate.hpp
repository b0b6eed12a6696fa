#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace palpate::imaging::reading {

struct Inflated {
  bool whole = false;       ///< the stream came to its proper end
  std::uint64_t bytes = 0;  ///< that come out, counted up to one over `enough`
  std::string start;        ///< the first of them, as many as asked for
};
/// Counts what a zlib or gzip stream holds without keeping it: `offset` and
/// `length` say where it lies in the file (length 0: to the end).
Inflated inflate_and_count(const std::filesystem::path& path, std::uint64_t offset, std::uint64_t length,
                           std::uint64_t enough, std::size_t keep = 0);

}  // namespace palpate::imaging::reading
