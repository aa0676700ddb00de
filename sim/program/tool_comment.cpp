#include "sim/program/tool_comment.h"

#include <regex>

#include "kinematics/units.h"

namespace abbe::sim::program {
namespace {

using Found = std::match_results<std::string::const_iterator>;

constexpr std::size_t longest = 200;  // of a comment that names a tool

// 10, 10., .5, 1/2, 1-1/2
const std::string a_length = "([0-9]+-[0-9]+/[0-9]+|[0-9]+/[0-9]+|[0-9]+\\.?[0-9]*|\\.[0-9]+)";
const std::string a_unit = "(MM|INCHES|INCH|IN\\b|\")";

std::regex pattern(const std::string& text) { return std::regex(text, std::regex::optimize); }

std::optional<Found> found(const std::string& text, const std::regex& wanted) {
  Found match;
  if (!std::regex_search(text, match, wanted)) return std::nullopt;
  return match;
}

bool has(const std::string& text, const std::regex& wanted) {
  return std::regex_search(text, wanted);
}

double quotient(const std::string& text, std::size_t slash) {
  const double below = std::stod(text.substr(slash + 1));
  return below > 0.0 ? std::stod(text.substr(0, slash)) / below : 0.0;
}

double length_of(const std::string& text) {
  if (text.size() > 12) return 0.0;  // no length of a tool
  const std::size_t dash = text.find('-');
  if (dash != std::string::npos)
    return length_of(text.substr(0, dash)) + length_of(text.substr(dash + 1));
  const std::size_t slash = text.find('/');
  return slash == std::string::npos ? std::stod(text) : quotient(text, slash);
}

std::optional<double> unit_of_words(const std::string& text) {
  if (text.empty()) return std::nullopt;
  return text == "MM" ? 1.0 : units::inch;
}

std::optional<int> number_in(const std::string& text) {
  static const std::regex t = pattern("\\bT ?0*([0-9]{1,6})\\b");
  static const std::regex tool =
      pattern("\\bTOOL *(?:NO\\.?|NUMBER|#)? *[-:=#]? *-? *0*([0-9]{1,6})\\b(?![./])");
  for (const std::regex* wanted : {&t, &tool})
    if (const auto match = found(text, *wanted)) return std::stoi((*match)[1].str());
  return std::nullopt;
}

/// A D of its own, which is a diameter where a tool is spoken of and no register is.
std::optional<double> bare_diameter(const std::string& text, const std::optional<int>& number) {
  static const std::regex bare = pattern("(?:^|[^A-Z0-9])D ?([0-9]+\\.?[0-9]*)(?![0-9A-Z])");
  static const std::regex register_of = pattern("\\bH ?[0-9]|\\||\\bOFF|\\bCOMP|\\bWEAR");
  static const std::regex tool =
      pattern("\\bT ?[0-9]|TOOL|MILL|CUTTER|BALL|FLAT|BULL|^ *D ?[0-9.]+ *$");
  const auto match = found(text, bare);
  if (!match || has(text, register_of) || !has(text, tool)) return std::nullopt;
  const double length = length_of((*match)[1].str());
  if (number && length == double(*number)) return std::nullopt;
  return length;
}

/// The diameter with the unit and the radius that stand in the same words.
std::optional<ToolWords> with_diameter(const std::string& text, ToolWords words) {
  static const std::regex letter = pattern("\\bD *[=:] *" + a_length);
  static const std::regex written =
      pattern("\\bDIA(?:M(?:ETER)?)?\\b\\.? *[-=:]? *D?" + a_length + " *" + a_unit + "?");
  static const std::regex sign = pattern("(?:\xC3\x98|\xC3\xB8|\xE2\x8C\x80) ?" + a_length);
  static const std::regex code = pattern("(?:^|[^A-Z0-9])D ?" + a_length + "[ _-]?R ?" + a_length);
  static const std::regex mill =
      pattern(a_length + " *" + a_unit +
              " *(?:[A-Z0-9]+ +){0,2}?(?:END ?-?MILL|BALL|FLAT|BULL|MILL\\b|CUTTER)");
  static const std::regex kind =
      pattern(a_length + " +(?:FLAT|BALL|BULL|SQUARE)[A-Z]* *(?:NOSED?|END)? *-?(?:END)? *-?MILL");
  static const std::regex braces = pattern("MILL.*\\{ *" + a_length + " *" + a_unit + " *\\}");
  if (const auto both = found(text, code)) {
    words.diameter = length_of((*both)[1].str());
    words.corner_radius = length_of((*both)[2].str());
    return words;
  }
  for (const std::regex* wanted : {&letter, &written, &sign, &braces, &mill, &kind})
    if (const auto match = found(text, *wanted)) {
      words.diameter = length_of((*match)[1].str());
      if (match->size() > 2) words.unit_mm = unit_of_words((*match)[2].str());
      return words;
    }
  if (const auto bare = bare_diameter(text, words.number)) {
    words.diameter = *bare;
    return words;
  }
  return std::nullopt;
}

std::optional<double> corner_radius_in(const std::string& text) {
  static const std::regex radius =
      pattern("\\b(?:CR|R|(?:TIP|CORNER) *RAD(?:IUS)?) *[=:] *" + a_length + "|\\bR ?" + a_length);
  const auto match = found(text, radius);
  if (!match) return std::nullopt;
  return length_of((*match)[(*match)[1].matched ? 1 : 2].str());
}

ToolWords::End end_in(const std::string& text) {
  static const std::regex ball = pattern("\\bBALL"), flat = pattern("\\bFLAT\\b|\\bSQUARE\\b");
  if (has(text, ball)) return ToolWords::End::Ball;
  return has(text, flat) ? ToolWords::End::Flat : ToolWords::End::Unsaid;
}

}  // namespace

std::optional<ToolWords> tool_words(std::string_view comment) {
  if (comment.size() > longest || comment.find_first_of("0123456789") == std::string_view::npos)
    return std::nullopt;
  std::string text(comment);
  for (char& c : text)
    if (c >= 'a' && c <= 'z') c = char(c - 'a' + 'A');
  const auto words = with_diameter(text, {.number = number_in(text)});
  if (!words || !(words->diameter > 0.0)) return std::nullopt;
  ToolWords all = *words;
  if (!all.corner_radius) all.corner_radius = corner_radius_in(text);
  all.end = end_in(text);
  return all;
}

}  // namespace abbe::sim::program
