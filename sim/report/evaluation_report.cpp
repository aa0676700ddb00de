#include "sim/report/evaluation_report.h"

#include <type_traits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "sim/files/one_lined.h"

namespace abbe::sim {
namespace {

using errors::metrology::Estimated;
using errors::metrology::Figure;
using errors::metrology::FigureGroup;
using errors::metrology::TestResult;
using nlohmann::ordered_json;

std::string key_of(const Figure& figure) {
  return figure.unit.empty() ? figure.name : figure.name + "_" + figure.unit;
}

ordered_json value_of(const Figure& figure) {
  return std::visit(
      [](const auto& value) -> ordered_json {
        using Value = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<Value, std::monostate>)
          return nullptr;
        else if constexpr (std::is_same_v<Value, Estimated>)
          return {{"value", value.value}, {"standard_uncertainty", value.u}};
        else if constexpr (std::is_same_v<Value, Eigen::Vector3d>)
          return {value.x(), value.y(), value.z()};
        else
          return value;
      },
      figure.value);
}

void put(ordered_json& json, const std::vector<Figure>& figures,
         const std::vector<FigureGroup>& groups) {
  for (const Figure& figure : figures) json[key_of(figure)] = value_of(figure);
  for (const FigureGroup& group : groups) {
    ordered_json inner = ordered_json::object();
    put(inner, group.figures, group.groups);
    json[group.name] = std::move(inner);
  }
}

ordered_json tests_json(const std::vector<TestResult>& tests) {
  ordered_json all = ordered_json::array();
  for (const TestResult& test : tests) {
    ordered_json json{{"name", test.name}, {"standard", test.standard}};
    put(json, test.figures, test.groups);
    if (!test.diagonals.empty()) json["diagonals"] = tests_json(test.diagonals);
    all.push_back(std::move(json));
  }
  return all;
}

std::string line(const Figure& figure, const std::string& label) {
  if (const auto* number = std::get_if<double>(&figure.value))
    return fmt::format("{:<40} {:>12.4f}\n", label, *number);
  if (const auto* one = std::get_if<Estimated>(&figure.value))
    return fmt::format("{:<40} {:>12.4f}   u {:.4f}\n", label, one->value, one->u);
  if (const auto* words = std::get_if<std::vector<std::string>>(&figure.value))
    if (words->empty()) return {};
  if (const auto* word = std::get_if<std::string>(&figure.value))
    return fmt::format("{:<40} {:>12}\n", label, escaped(*word));
  if (std::holds_alternative<std::monostate>(figure.value))
    return fmt::format("{:<40} {:>12}\n", label, "-");
  return fmt::format("{:<40} {:>12}\n", label, one_lined(value_of(figure)).dump());
}

std::string lines(const std::vector<Figure>& figures, const std::vector<FigureGroup>& groups,
                  std::size_t indent) {
  const std::string margin(indent, ' ');
  std::string text;
  for (const Figure& figure : figures) text += line(figure, margin + escaped(key_of(figure)));
  for (const FigureGroup& group : groups)
    text += margin + escaped(group.name) + "\n" + lines(group.figures, group.groups, indent + 2);
  return text;
}

}  // namespace

ordered_json to_json(const Evaluation& evaluation,
                     const std::vector<std::filesystem::path>& pictures) {
  ordered_json json{{"file", evaluation.file.string()},
                    {"kind", evaluation.kind},
                    {"tests", tests_json(evaluation.results)}};
  for (const Evaluation::Temperatures& one : evaluation.temperatures)
    json["temperatures"][one.sensor] = {{"min_C", one.min_C}, {"max_C", one.max_C}};
  json["warnings"] = evaluation.warnings;
  json["pictures"] = ordered_json::array();
  for (const std::filesystem::path& picture : pictures)
    json["pictures"].push_back(picture.string());
  return json;
}

std::string to_text(const Evaluation& evaluation,
                    const std::vector<std::filesystem::path>& pictures) {
  std::string text =
      fmt::format("{} ({})\n", escaped(evaluation.file.string()), escaped(evaluation.kind));
  for (const TestResult& test : evaluation.results) {
    text += fmt::format("\n{} -- {}\n", escaped(test.name), test.standard);
    text += lines(test.figures, test.groups, 2);
    for (const TestResult& one : test.diagonals)
      text += "  diagonals: " + escaped(one.name) + "\n" + lines(one.figures, one.groups, 4);
  }
  if (!evaluation.temperatures.empty()) text += "\ntemperatures, C\n";
  for (const Evaluation::Temperatures& one : evaluation.temperatures)
    text += fmt::format("  {:<38} {:>8.2f} .. {:.2f}\n", escaped(one.sensor), one.min_C, one.max_C);
  for (const std::filesystem::path& picture : pictures)
    text += "\npicture " + escaped(picture.string());
  text += pictures.empty() ? "" : "\n";
  for (const std::string& warning : evaluation.warnings)
    text += "\nwarning: " + escaped(warning) + "\n";
  return text;
}

}  // namespace abbe::sim
