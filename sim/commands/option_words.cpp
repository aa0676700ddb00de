#include "sim/commands/option_words.h"

#include <fmt/format.h>

namespace abbe::sim {
namespace {

/// The rule of a kind that an option has; null if it has none.
template <typename Kind>
const Kind* rule_of(const Option& option) {
  const Kind* first = std::get_if<Kind>(&option.rule);
  return first ? first : std::get_if<Kind>(&option.second_rule);
}

bool has_dashes(const Option& option) { return option.name.starts_with('-'); }

template <typename... Kinds>
bool holds(const Target& target) {
  return (std::holds_alternative<Kinds>(target) || ...);
}

bool is_file(const Option& option) {
  return holds<std::filesystem::path*, std::optional<std::filesystem::path>*,
               std::vector<std::filesystem::path>*>(option.target);
}

bool is_number(const Option& option) {
  return holds<int*, double*, std::optional<std::int64_t>*>(option.target);
}

}  // namespace

std::vector<Option> dashed_options(const Command& command) {
  std::vector<Option> all;
  for (const std::vector<Option>& options : {command.options, command.where})
    for (const Option& option : options)
      if (has_dashes(option)) all.push_back(option);
  all.push_back({"--help", static_cast<bool*>(nullptr), "say what the command takes"});
  return all;
}

std::vector<Option> placed_options(const Command& command) {
  std::vector<Option> all;
  for (const Option& option : command.options)
    if (!has_dashes(option)) all.push_back(option);
  return all;
}

bool is_flag(const Option& option) { return holds<bool*>(option.target); }

bool is_list(const Option& option) {
  return holds<std::vector<std::string>*, std::vector<std::filesystem::path>*>(option.target);
}

bool may_be_left_out(const Option& option) { return rule_of<MayBeLeftOut>(option) != nullptr; }

std::vector<std::string> words_of(const Option& option) {
  const OneOf* rule = rule_of<OneOf>(option);
  return rule ? rule->values : std::vector<std::string>{};
}

std::string value_name(const Option& option) {
  if (is_flag(option)) return "";
  if (const Type* type = rule_of<Type>(option)) return type->name;
  if (const std::vector<std::string> words = words_of(option); !words.empty())
    return fmt::format("{}", fmt::join(words, "|"));
  if (is_number(option)) return "N";
  return is_file(option) ? "FILE" : "TEXT";
}

Offer offer_for(const Option& option) {
  if (!words_of(option).empty()) return Offer::Words;
  if (option.name == "--case") return Offer::Cases;
  if (option.name == "--set") return Offer::Settings;
  if (option.name == "KEY") return Offer::Keys;
  return is_file(option) ? Offer::Files : Offer::Nothing;
}

bool sets_a_study(const Command& command) {
  const std::vector<Option> placed = placed_options(command);
  return !placed.empty() && placed.front().name == "STUDY";
}

}  // namespace abbe::sim
