#include "sim/program/assumption.h"

#include <fmt/format.h>

namespace abbe::sim::program {

std::string to_text(const Assumption& assumption) {
  std::string place;
  if (assumption.line > 0)
    place = assumption.file.empty() ? fmt::format("line {}: ", assumption.line)
                                    : fmt::format("{}:{}: ", assumption.file, assumption.line);
  const char* or_option = assumption.key.empty() || assumption.option.empty() ? "" : ", ";
  return fmt::format("{}{} ({}{}{})", place, assumption.text, assumption.key, or_option,
                     assumption.option);
}

}  // namespace abbe::sim::program
