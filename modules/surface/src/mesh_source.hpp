#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::surface {

/// A mesh file in memory, and how to refuse it in words.
struct MeshSource {
  std::string name;  ///< the path, for messages
  std::string_view bytes;

  [[noreturn]] void damaged(const std::string& what) const;
  [[noreturn]] void unsupported(const std::string& what) const;
  [[noreturn]] void no_polygons(std::size_t points, const std::string& instead) const;
};

/// What a reader finds: triangles whose indices lie within `vertices`.
struct MeshContents {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<float> intensities;  ///< empty or one a vertex
  std::string stated_space;        ///< what SPACE= says, in capitals; empty where it is not said
};

// Each checks every count against the bytes that there are before it takes memory.
MeshContents read_stl(const MeshSource& source);
MeshContents read_ply(const MeshSource& source);
MeshContents read_obj(const MeshSource& source);
MeshContents read_legacy_vtk(const MeshSource& source);
MeshContents read_vtp(const MeshSource& source);

/// The word after "SPACE=", in capitals; empty without one.
std::string stated_space_in(std::string_view header);

/// Words and lines of a text, one after another. CR LF, LF and CR end a line.
class TextCursor {
 public:
  explicit TextCursor(std::string_view text, std::size_t at = 0) : text_(text), at_(at) {}
  bool at_end() const noexcept { return at_ >= text_.size(); }
  std::size_t position() const noexcept { return at_; }
  void skip(std::size_t bytes) noexcept { at_ = bytes > text_.size() - at_ ? text_.size() : at_ + bytes; }
  std::size_t left() const noexcept { return text_.size() - at_; }
  /// The rest of this line; the cursor then stands at the next.
  std::string_view line();
  /// The next word, over line ends; empty at the end of the text.
  std::string_view word();

 private:
  std::string_view text_;
  std::size_t at_;
};

std::optional<double> number_in(std::string_view word);
std::optional<std::int64_t> integer_in(std::string_view word);
std::string lower_case(std::string_view text);

/// The number of type T at `bytes`, in the byte order given.
template <typename T>
T binary_number(const char* bytes, bool big_endian) {
  std::array<char, sizeof(T)> ordered{};
  for (std::size_t n = 0; n < sizeof(T); ++n) ordered[big_endian ? sizeof(T) - 1 - n : n] = bytes[n];
  T value;
  static_assert(std::is_trivially_copyable_v<T>);
  std::char_traits<char>::copy(reinterpret_cast<char*>(&value), ordered.data(), sizeof(T));
  return value;
}

/// Adds the fan of a polygon; false when an index lies outside the vertices.
bool add_polygon(const std::vector<std::int64_t>& corners, std::size_t vertex_count, MeshContents& contents);

}  // namespace palpate::surface
