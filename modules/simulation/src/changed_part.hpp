#pragma once

#include "palpate/compute/buffer.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace palpate::simulation {

/// The part of an array that was changed.
struct Changed {
  std::size_t begin = std::numeric_limits<std::size_t>::max();
  std::size_t end = 0;
  void add(std::size_t index) {
    begin = std::min(begin, index);
    end = std::max(end, index + 1);
  }
  template <typename Value>
  void write(const std::vector<Value>& values, compute::Buffer& buffer) const {
    if (begin < end)
      buffer.write(values.data() + begin, (end - begin) * sizeof(Value), begin * sizeof(Value));
  }
};

}  // namespace palpate::simulation
