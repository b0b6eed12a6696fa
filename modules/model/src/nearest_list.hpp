#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace palpate::model {

/// The n best so far, nearest first, ties by the lower number. n is at most 64.
class NearestList {
 public:
  static constexpr std::size_t most = 64;

  explicit NearestList(std::size_t n) noexcept : n_(n) {}
  void clear() noexcept { size_ = 0; }
  std::size_t size() const noexcept { return size_; }
  bool full() const noexcept { return size_ == n_; }
  /// What lies beyond this squared distance cannot enter any more.
  double bound() const noexcept {
    return full() ? squared_[size_ - 1] : std::numeric_limits<double>::infinity();
  }
  std::uint32_t point(std::size_t place) const noexcept { return points_[place]; }
  bool holds(std::uint32_t point) const noexcept {
    for (std::size_t place = 0; place < size_; ++place)
      if (points_[place] == point) return true;
    return false;
  }

  void offer(double squared, std::uint32_t point) noexcept {
    if (full()) {
      if (!before(squared, point, size_ - 1)) return;
      --size_;
    }
    std::size_t place = size_++;
    for (; place > 0 && before(squared, point, place - 1); --place) {
      squared_[place] = squared_[place - 1];
      points_[place] = points_[place - 1];
    }
    squared_[place] = squared;
    points_[place] = point;
  }

 private:
  bool before(double squared, std::uint32_t point, std::size_t place) const noexcept {
    return squared < squared_[place] || (squared == squared_[place] && point < points_[place]);
  }

  std::size_t n_;
  std::size_t size_ = 0;
  std::array<double, most> squared_{};
  std::array<std::uint32_t, most> points_{};
};

}  // namespace palpate::model
