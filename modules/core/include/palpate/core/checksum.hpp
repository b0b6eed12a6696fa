#pragma once

#include <cstddef>
#include <memory>
#include <string>

struct evp_md_ctx_st;

namespace palpate::core {

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

std::string sha256_of(const std::string& bytes);

}  // namespace palpate::core
