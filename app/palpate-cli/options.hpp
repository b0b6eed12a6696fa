#pragma once

#include <functional>
#include <string>
#include <vector>

namespace palpate::cli {

/// The options of one subcommand, declared once: they parse the command line
/// and print its help. Everything that does not fit is an Error(usage) that
/// names the option and what it accepts.
class OptionSet {
 public:
  using Apply = std::function<void(const std::string&)>;

  OptionSet(std::string command, std::string synopsis, std::string summary);

  void section(const std::string& title);
  void flag(const std::string& name, const std::string& help, bool& target);
  void value(const std::string& name, const std::string& argument, const std::string& help, Apply apply);
  void text(const std::string& name, const std::string& argument, const std::string& help,
            std::string& target);
  /// Applied before all others, whatever its place on the line.
  void first_value(const std::string& name, const std::string& argument, const std::string& help,
                   Apply apply);
  /// Options that a later version brings; refused until then.
  void later(const std::vector<std::string>& names);
  void positional(const std::string& name, std::size_t most, std::vector<std::string>& target);
  void example(const std::string& line);

  void parse(const std::vector<std::string>& arguments) const;
  std::string help() const;

 private:
  struct Option {
    std::string name, argument, help;
    Apply apply;
    bool is_flag = false;
    bool first = false;
    std::string section;  ///< a title that stands above it
  };
  const Option& find(const std::string& name) const;
  void add(Option option);

  std::string command_, synopsis_, summary_, positional_name_, pending_section_;
  std::size_t most_positionals_ = 0;
  std::vector<std::string>* positionals_ = nullptr;
  std::vector<Option> options_;
  std::vector<std::string> later_, examples_;
};

}  // namespace palpate::cli
