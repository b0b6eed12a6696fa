#pragma once

#include <nlohmann/json.hpp>

#include <cstdint>
#include <set>
#include <string>
#include <vector>

namespace palpate::session {

/// Parses a whole text; Error(usage) says line and column. `what` names the
/// text for people ("The recipe").
nlohmann::json parse_json(const std::string& text, const std::string& what);

/// An object that is read key by key. Every refusal is an Error(usage) with
/// the place ("tissue.max_links"). Absent keys leave the value as it is;
/// finish() refuses the keys that nobody asked for.
class ObjectReader {
 public:
  ObjectReader(const nlohmann::json& value, std::string place);

  bool has(const std::string& key);  ///< present and not null; marks the key as known
  const nlohmann::json& at(const std::string& key);
  ObjectReader object(const std::string& key);
  std::string place_of(const std::string& key) const;
  void finish() const;

  void read(const std::string& key, std::string& value);
  void read(const std::string& key, bool& value);
  void read(const std::string& key, double& value, double low, double high);
  void read(const std::string& key, int& value, int low, int high);
  void read(const std::string& key, std::uint64_t& value);
  /// One of the words; gives its index.
  void read_word(const std::string& key, std::size_t& index, const std::vector<std::string>& words);

  static double number(const nlohmann::json& value, const std::string& place, double low, double high);
  static std::int64_t whole(const nlohmann::json& value, const std::string& place, std::int64_t low,
                            std::int64_t high);
  /// The index of one of the words.
  static std::size_t word(const nlohmann::json& value, const std::string& place,
                          const std::vector<std::string>& words);

 private:
  const nlohmann::json& value_;
  std::string place_;
  std::set<std::string> known_;
};

[[noreturn]] void refuse(const std::string& place, const std::string& why);

}  // namespace palpate::session
