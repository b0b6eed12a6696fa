#pragma once

#include <cstdint>
#include <vector>

namespace palpate::core {

/// Pixels as they are saved: RGBA, 8 bits each, top row first.
struct Picture {
  int width_px = 0;
  int height_px = 0;
  std::vector<std::uint8_t> rgba;
};

}  // namespace palpate::core
