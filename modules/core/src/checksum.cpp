#include "palpate/core/checksum.hpp"

#include "palpate/core/error.hpp"

#include <array>
#include <openssl/evp.h>

namespace palpate::core {

namespace {

void require(bool worked) {
  if (!worked)
    throw Error(ErrorKind::internal, "checksum", "SHA-256 of the system's libcrypto cannot be used.");
}

}  // namespace

Sha256::Sha256() : context_(EVP_MD_CTX_new(), [](evp_md_ctx_st* context) { EVP_MD_CTX_free(context); }) {
  require(context_ != nullptr && EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) == 1);
}

void Sha256::add(const void* bytes, std::size_t count) {
  require(EVP_DigestUpdate(context_.get(), bytes, count) == 1);
}

std::string Sha256::hex() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned length = 0;
  require(EVP_DigestFinal_ex(context_.get(), digest.data(), &length) == 1);
  constexpr std::array<char, 17> digits{"0123456789abcdef"};
  std::string text;
  for (unsigned n = 0; n < length; ++n) {
    text += digits[digest[n] >> 4U];
    text += digits[digest[n] & 15U];
  }
  return text;
}

std::string sha256_of(const std::string& bytes) {
  Sha256 sum;
  sum.add(bytes);
  return sum.hex();
}

}  // namespace palpate::core
