#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/core/volume.hpp"

#include <nlohmann/json.hpp>

#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace palpate::cli {

using Json = nlohmann::ordered_json;
/// Label and value, printed in two columns.
using Table = std::vector<std::pair<std::string, std::string>>;

/// The program's own ways out. The standard descriptors themselves are led
/// away, so that what libraries print reaches nobody, breaks no JSON, and
/// lands in no file that took the number of a closed descriptor.
struct Outlets {
  int out = -1;
  int error = -1;
};
Outlets take_outlets();

/// Where a subcommand speaks: the result to stdout, as text or as one JSON
/// object; progress and warnings to stderr.
class Console {
 public:
  Console(Outlets outlets, bool json, bool progress, core::CancelToken cancel);
  ~Console();

  bool json() const noexcept { return json_; }
  void warn(const std::string& code, const std::string& text);
  void warn(const std::vector<core::Warning>& warnings);
  core::Progress progress() const;
  /// Help and version. Error(output) where stdout is closed or full.
  void print(const std::string& text) const;
  /// Prints the result and the warnings. Error(output) where stdout is closed or full.
  void result(Json object, const std::string& text);
  void result(Json object, const std::string& heading, const Table& table);
  /// An error that ends the program; never throws. With --json it is the one
  /// object on stdout, unless a result stands there already.
  void error(const core::Error& error) noexcept;

 private:
  struct Line;
  Outlets outlets_;
  bool json_;
  bool printed_ = false;
  core::CancelToken cancel_;
  std::shared_ptr<Line> line_;
  std::vector<core::Warning> warnings_;
};

Json to_json(const std::vector<core::Warning>& warnings);
/// NaN and infinity are no JSON: null.
Json number(double value);
std::string table_text(const Table& table);

}  // namespace palpate::cli
