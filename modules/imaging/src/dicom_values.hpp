#pragma once

#include "palpate/core/volume.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace palpate::imaging {

/// 128 bits of the content, by FNV-1a's scheme with a final mixing.
class ContentHash {
 public:
  void add(const void* data, std::size_t bytes);
  /// A UID of the 2.25 root: the decimal of a UUID (version 8, made of content).
  std::string uid(std::uint64_t member) const;

 private:
  std::uint64_t low_ = 0xCBF29CE484222325ULL;
  std::uint64_t high_ = 0x6C62272E07BB0142ULL;
};

/// A decimal string (DS) has at most 16 characters.
std::string decimal_string(double value);

template <typename Values>
std::string decimal_strings(const Values& values) {
  std::string text;
  for (Eigen::Index n = 0; n < values.size(); ++n) text += (n == 0 ? "" : "\\") + decimal_string(values[n]);
  return text;
}

/// How greys become whole numbers: value = intercept + slope * number. As they
/// are where they are whole and fit, so nothing is lost, otherwise spread over
/// the range of all frames.
struct StoredGreys {
  int bits = 16;  ///< 8 where all are whole and in [0, 255]
  bool rescaled = false;
  double slope = 1.0;
  double intercept = 0.0;

  std::uint16_t number_of(float value) const;
};
StoredGreys stored_greys(const std::vector<core::Volume>& frames);

}  // namespace palpate::imaging
