#pragma once

#include "palpate/core/progress.hpp"

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>

struct evp_md_ctx_st;

namespace palpate::session {

/// SHA-256 by the system's libcrypto, fed piece by piece.
class Sha256 {
 public:
  Sha256();
  void add(const void* bytes, std::size_t count);
  void add(const std::string& text) { add(text.data(), text.size()); }
  std::string hex();  ///< once, at the end

 private:
  std::unique_ptr<evp_md_ctx_st, void (*)(evp_md_ctx_st*)> context_;
};

std::string sha256_of(const std::string& text);
std::string sha256_of_file(const std::filesystem::path& path, const core::Progress& progress);

}  // namespace palpate::session
