#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace palpate::cli {

/// Refuses before the long work what could not be written after it:
/// Error(usage) for an ending that is not in `endings`, Error(output) for a
/// folder that does not exist or may not be written to.
void check_output(const std::string& option, const std::filesystem::path& path,
                  const std::vector<std::string>& endings, const std::vector<std::string>& later = {});

/// Error(usage) where two of these options, with what they name, would write
/// the same file. Options that were not given have an empty path.
void check_apart(const std::vector<std::pair<std::string, std::filesystem::path>>& outputs);

}  // namespace palpate::cli
