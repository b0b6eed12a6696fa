#include "mesh_source.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>

namespace palpate::surface {

using core::Error;
using core::ErrorKind;

void MeshSource::damaged(const std::string& what) const {
  throw Error(
      ErrorKind::input, "damaged",
      "The mesh " + name + " is damaged: " + what + ". Export it again from the program that made it.");
}

void MeshSource::unsupported(const std::string& what) const {
  throw Error(ErrorKind::input, "unsupported",
              "The mesh " + name + " cannot be used: " + what +
                  ". Give triangles as .stl, .ply, .obj, .vtp or .vtk.");
}

void MeshSource::no_polygons(std::size_t points, const std::string& instead) const {
  throw Error(ErrorKind::input, "no-polygons",
              "The mesh " + name + " has " + std::to_string(points) + " points and no polygons" +
                  (instead.empty() ? "" : ": " + instead) +
                  ". A surface of triangles or polygons is needed.");
}

std::string stated_space_in(std::string_view header) {
  constexpr std::string_view key = "SPACE=";
  const auto at = header.find(key);
  if (at == std::string_view::npos) return {};
  std::string word;
  for (auto letter : header.substr(at + key.size())) {
    if (std::isalnum(static_cast<unsigned char>(letter)) == 0) break;
    word += static_cast<char>(std::toupper(static_cast<unsigned char>(letter)));
  }
  return word;
}

namespace {
bool is_space(char letter) {
  return letter == ' ' || letter == '\t' || letter == '\n' || letter == '\r' || letter == '\v' ||
         letter == '\f';
}
}  // namespace

std::string_view TextCursor::line() {
  const std::size_t begin = at_;
  const std::size_t end = std::min(text_.find_first_of("\r\n", begin), text_.size());
  at_ = end;
  if (at_ < text_.size()) at_ += text_.substr(at_, 2) == "\r\n" ? 2 : 1;
  return text_.substr(begin, end - begin);
}

std::string_view TextCursor::word() {
  while (at_ < text_.size() && is_space(text_[at_])) ++at_;
  const std::size_t begin = at_;
  while (at_ < text_.size() && !is_space(text_[at_])) ++at_;
  return text_.substr(begin, at_ - begin);
}

std::optional<double> number_in(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (end != word.data() + word.size() || word.empty()) return std::nullopt;
  // Numbers below what a double holds are zeros; std::from_chars refuses them.
  if (error == std::errc::result_out_of_range) return value;
  return error == std::errc() ? std::optional<double>(value) : std::nullopt;
}

std::optional<std::int64_t> integer_in(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (auto& letter : lower) letter = static_cast<char>(std::tolower(static_cast<unsigned char>(letter)));
  return lower;
}

bool add_polygon(const std::vector<std::int64_t>& corners, std::size_t vertex_count, MeshContents& contents) {
  for (const auto corner : corners)
    if (corner < 0 || static_cast<std::uint64_t>(corner) >= vertex_count) return false;
  for (std::size_t n = 2; n < corners.size(); ++n)
    contents.triangles.push_back({static_cast<std::uint32_t>(corners[0]),
                                  static_cast<std::uint32_t>(corners[n - 1]),
                                  static_cast<std::uint32_t>(corners[n])});
  return true;
}

}  // namespace palpate::surface
