#include "options.hpp"

#include "values.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <optional>
#include <utility>

namespace palpate::cli {
namespace {

constexpr std::size_t help_width = 100;
constexpr std::size_t help_column = 30;

/// Wraps at spaces, every line after the first under the help column.
std::string wrapped(const std::string& text) {
  std::string result;
  std::size_t column = help_column;
  for (const auto& word : split(text, ' ')) {
    if (column + word.size() > help_width && column > help_column) {
      result += "\n" + std::string(help_column, ' ');
      column = help_column;
    } else if (!result.empty()) {
      result += ' ';
      ++column;
    }
    result += word;
    column += word.size();
  }
  return result;
}

}  // namespace

OptionSet::OptionSet(std::string command, std::string synopsis, std::string summary)
    : command_(std::move(command)), synopsis_(std::move(synopsis)), summary_(std::move(summary)) {}

void OptionSet::add(Option option) {
  option.section = std::exchange(pending_section_, {});
  options_.push_back(std::move(option));
}

void OptionSet::section(const std::string& title) { pending_section_ = title; }

void OptionSet::flag(const std::string& name, const std::string& help, bool& target) {
  Option option{name, "", help, [&target](const std::string&) { target = true; }, true, false, ""};
  add(std::move(option));
}

void OptionSet::value(const std::string& name, const std::string& argument, const std::string& help,
                      Apply apply) {
  add({name, argument, help, std::move(apply), false, false, ""});
}

void OptionSet::text(const std::string& name, const std::string& argument, const std::string& help,
                     std::string& target) {
  value(name, argument, help, [&target](const std::string& given) {
    if (given.empty()) core::throw_usage("an empty name is not accepted.");
    target = given;
  });
}

void OptionSet::first_value(const std::string& name, const std::string& argument, const std::string& help,
                            Apply apply) {
  add({name, argument, help, std::move(apply), false, true, ""});
}

void OptionSet::later(const std::vector<std::string>& names) {
  later_.insert(later_.end(), names.begin(), names.end());
}

void OptionSet::positional(const std::string& name, std::size_t most, std::vector<std::string>& target) {
  positional_name_ = name;
  most_positionals_ = most;
  positionals_ = &target;
}

void OptionSet::example(const std::string& line) { examples_.push_back(line); }

const OptionSet::Option& OptionSet::find(const std::string& name) const {
  const auto found = std::find_if(options_.begin(), options_.end(),
                                  [&](const Option& option) { return option.name == name; });
  if (found != options_.end()) return *found;
  if (std::find(later_.begin(), later_.end(), name) != later_.end())
    core::throw_usage(name + ": this version of " + command_ + " does not have it yet.");
  std::vector<std::string> names;
  for (const auto& option : options_) names.push_back(option.name);
  core::throw_usage(command_ + " does not know \"" + name + "\"; it accepts " + join(names, ", ") + ".");
}

void OptionSet::parse(const std::vector<std::string>& arguments) const {
  std::vector<std::pair<const Option*, std::string>> given;
  bool only_positionals = false;
  for (std::size_t n = 0; n < arguments.size(); ++n) {
    std::string word = arguments[n];
    if (!only_positionals && word == "--") {
      only_positionals = true;
      continue;
    }
    if (only_positionals || word.size() < 2 || word[0] != '-') {
      if (positionals_ == nullptr || positionals_->size() == most_positionals_)
        core::throw_usage(command_ + " takes " +
                          (most_positionals_ == 0 ? std::string("no") : std::to_string(most_positionals_)) +
                          " input" + (most_positionals_ == 1 ? "" : "s") + "; \"" + word +
                          "\" is one too many.");
      positionals_->push_back(word);
      continue;
    }
    std::optional<std::string> value;
    const auto equals = word.find('=');
    if (word.rfind("--", 0) == 0 && equals != std::string::npos) {
      value = word.substr(equals + 1);
      word.resize(equals);
    }
    const Option& option = find(word);
    if (option.is_flag && value)
      core::throw_usage(word + " takes no value, but \"" + *value + "\" was given.");
    if (!option.is_flag && !value) {
      if (n + 1 == arguments.size())
        core::throw_usage(word + " needs a value: " + word + " " + option.argument + ".");
      value = arguments[++n];
    }
    given.emplace_back(&option, value.value_or(""));
  }
  std::stable_partition(given.begin(), given.end(), [](const auto& one) { return one.first->first; });
  for (const auto& [option, value] : given) {
    try {
      option->apply(value);
    } catch (const core::Error& error) {
      if (error.kind() != core::ErrorKind::usage) throw;
      throw core::Error(error.kind(), error.code(), option->name + ": " + error.what(), error.details());
    }
  }
}

std::string OptionSet::help() const {
  std::string text = "Usage: palpate-cli " + synopsis_ + "\n\n" + summary_ + "\n";
  for (const auto& option : options_) {
    if (!option.section.empty()) text += "\n" + option.section + "\n";
    std::string head = "  " + option.name + (option.argument.empty() ? "" : " " + option.argument);
    if (head.size() + 2 > help_column)
      head += "\n" + std::string(help_column, ' ');
    else
      head.resize(help_column, ' ');
    text += head + wrapped(option.help) + "\n";
  }
  text += examples_.size() > 1 ? "\nExamples:\n" : "\nExample:\n";
  for (const auto& line : examples_) text += "  " + line + "\n";
  return text;
}

}  // namespace palpate::cli
