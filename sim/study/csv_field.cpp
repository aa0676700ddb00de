#include "sim/study/csv_field.h"

#include <cmath>

#include <fmt/format.h>

namespace abbe::sim::study {

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string field = "\"";
  for (const char c : text) field += c == '"' ? std::string("\"\"") : std::string(1, c);
  return field + "\"";
}

std::string csv_field(double value) { return std::isfinite(value) ? fmt::format("{}", value) : ""; }

std::string csv_field(const std::optional<double>& value) { return value ? csv_field(*value) : ""; }

}  // namespace abbe::sim::study
