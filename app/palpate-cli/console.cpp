#include "console.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fcntl.h>
#include <mutex>
#include <unistd.h>

namespace palpate::cli {
namespace {

bool write_all(int descriptor, const std::string& text) noexcept {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t count = ::write(descriptor, text.data() + done, text.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    done += static_cast<std::size_t>(count);
  }
  return true;
}

/// File names and headers may hold control characters; a terminal obeys them.
std::string harmless(std::string text) {
  for (char& letter : text) {
    const auto code = static_cast<unsigned char>(letter);
    if ((code < 32 && letter != '\n' && letter != '\t') || code == 127) letter = '?';
  }
  return text;
}

std::string dumped(const Json& object) {
  return object.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace

/// The progress line on stderr.
struct Console::Line {
  std::mutex mutex;
  int descriptor = -1;
  bool wanted = false;
  bool terminal = false;
  bool open = false;  ///< a line without its end stands on the terminal
  int percent = -1;
  std::string what;

  void show(double fraction, const std::string& now) {
    const std::lock_guard<std::mutex> lock(mutex);
    const int percent_now = static_cast<int>(std::floor(fraction * 100.0));
    if (!wanted || (percent_now == percent && now == what)) return;
    percent = percent_now;
    what = now;
    std::string number = std::to_string(percent_now);
    number.insert(0, number.size() < 3 ? 3 - number.size() : 0, ' ');
    const std::string text = harmless(number + " %  " + now);
    write_all(descriptor, terminal ? "\r\033[K" + text : text + "\n");
    open = terminal;
  }
  void close() {
    const std::lock_guard<std::mutex> lock(mutex);
    if (open) write_all(descriptor, "\r\033[K");
    open = false;
  }
};

Outlets take_outlets() {
  // Above the numbers that a reader process is given its own under.
  constexpr int first = 10;
  Outlets outlets;
  outlets.out = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, first);
  outlets.error = fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, first);
  const int nothing = open("/dev/null", O_RDWR);
  if (nothing < 0) return outlets;
  if (fcntl(STDIN_FILENO, F_GETFD) < 0) dup2(nothing, STDIN_FILENO);
  dup2(nothing, STDOUT_FILENO);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  dup2(nothing, STDERR_FILENO);  // where sanitizers report
#endif
  if (nothing > STDERR_FILENO) close(nothing);
  return outlets;
}

Console::Console(Outlets outlets, bool json, bool progress, core::CancelToken cancel)
    : outlets_(outlets), json_(json), cancel_(std::move(cancel)), line_(std::make_shared<Line>()) {
  line_->descriptor = outlets_.error;
  line_->terminal = isatty(outlets_.error) == 1;
  line_->wanted = progress || line_->terminal;
}

Console::~Console() { line_->close(); }

void Console::warn(const std::string& code, const std::string& text) {
  line_->close();
  write_all(outlets_.error, harmless("Warning: " + text + "\n"));
  warnings_.push_back({code, text});
}

void Console::warn(const std::vector<core::Warning>& warnings) {
  for (const auto& warning : warnings) warn(warning.code, warning.text);
}

core::Progress Console::progress() const {
  return {[line = line_](double fraction, const std::string& what) { line->show(fraction, what); }, cancel_};
}

void Console::result(Json object, const std::string& text) {
  line_->close();
  if (json_ && !object.contains("warnings")) object["warnings"] = to_json(warnings_);
  printed_ = true;
  print(json_ ? dumped(object) : harmless(text));
}

void Console::result(Json object, const std::string& heading, const Table& table) {
  result(std::move(object), heading + "\n" + table_text(table));
}

void Console::error(const core::Error& error) noexcept {
  try {
    line_->close();
    std::string text = std::string("palpate-cli: ") + error.what() + "\n";
    if (!error.details().empty()) text += error.details() + "\n";
    write_all(outlets_.error, harmless(text));
    if (!json_ || printed_) return;
    Json object;
    object["error"] = {{"code", error.code()}, {"text", error.what()}};
    if (!error.details().empty()) object["error"]["details"] = error.details();
    object["warnings"] = to_json(warnings_);
    write_all(outlets_.out, dumped(object));
  } catch (...) {  // out of memory while saying so: the exit code still tells
  }
}

void Console::print(const std::string& text) const {
  if (!write_all(outlets_.out, text))
    throw core::Error(
        core::ErrorKind::output, "cannot-write",
        std::string("The result cannot be written to the standard output: ") + std::strerror(errno) + ".");
}

Json to_json(const std::vector<core::Warning>& warnings) {
  Json list = Json::array();
  for (const auto& warning : warnings) list.push_back({{"code", warning.code}, {"text", warning.text}});
  return list;
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

std::string table_text(const Table& table) {
  std::size_t width = 0;
  for (const auto& row : table) width = std::max(width, row.first.size());
  std::string text;
  for (const auto& [label, value] : table)
    text += "  " + label + std::string(width - label.size() + 2, ' ') + value + "\n";
  return text;
}

}  // namespace palpate::cli
