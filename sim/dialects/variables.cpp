#include "sim/dialects/variables.h"

namespace abbe::sim::dialects {

void Variables::leave() {
  count_ -= calls_.back().numbers.size() + calls_.back().names.size();
  calls_.pop_back();
}

std::optional<double> Variables::number(int number, Of of) const {
  const auto& numbers = table(of).numbers;
  const auto found = numbers.find(number);
  return found == numbers.end() ? std::nullopt : std::optional(found->second);
}

std::optional<double> Variables::named(std::string_view name, Of of) const {
  const auto& names = table(of).names;
  const auto found = names.find(name);
  return found == names.end() ? std::nullopt : std::optional(found->second);
}

bool Variables::set(int number, double value, Of of) {
  auto& numbers = table(of).numbers;
  const auto found = numbers.find(number);
  if (found != numbers.end()) {
    found->second = value;
    return true;
  }
  if (count_ == most_) return false;
  numbers.emplace(number, value);
  ++count_;
  return true;
}

bool Variables::set(std::string_view name, double value, Of of) {
  auto& names = table(of).names;
  const auto found = names.find(name);
  if (found != names.end()) {
    found->second = value;
    return true;
  }
  if (count_ == most_) return false;
  names.emplace(std::string(name), value);
  ++count_;
  return true;
}

void Variables::unset(int number, Of of) { count_ -= table(of).numbers.erase(number); }

}  // namespace abbe::sim::dialects
