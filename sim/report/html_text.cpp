#include "sim/report/html_text.h"

#include <fmt/format.h>

namespace abbe::sim::html {

using nlohmann::ordered_json;

std::string in_html(std::string_view text) {
  std::string out;
  for (const char c : text) switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  return out;
}

std::string in_script(const ordered_json& json) {
  std::string out;
  for (const char c : json.dump(-1, ' ', false, ordered_json::error_handler_t::replace))
    out += c == '<' ? std::string("\\u003c") : std::string(1, c);
  return out;
}

std::string label(const char* key, const char* element) {
  return fmt::format("<{0} data-label=\"{1}\"></{0}>", element, key);
}

std::string row(const char* key, const std::string& value) {
  return "<dt>" + label(key) + "</dt><dd>" + in_html(value) + "</dd>";
}

std::string list(const std::vector<std::string>& lines) {
  if (lines.empty()) return "<p>" + label("none") + "</p>";
  std::string text = "<ul>";
  for (const std::string& line : lines) text += "<li>" + in_html(line) + "</li>";
  return text + "</ul>";
}

ordered_json labels_json(std::span<const ReportLabel> labels) {
  ordered_json json;
  for (const ReportLabel& one : labels)
    json[std::string(one.key)] = {{"en", one.en}, {"zh", one.zh}};
  return json;
}

std::string with_labels(std::string_view page, std::span<const ReportLabel> labels,
                        const std::string& language) {
  std::map<std::string_view, std::string_view> words;
  for (const ReportLabel& one : labels) words[one.key] = language == "zh" ? one.zh : one.en;
  constexpr std::string_view begin = "data-label=\"", end = "\">";
  std::string text;
  for (;;) {
    const std::size_t from = page.find(begin), key = from + begin.size(), to = page.find(end, from);
    if (from == std::string_view::npos) return text.append(page);
    text.append(page.substr(0, to + end.size()));
    text += in_html(words.at(page.substr(key, to - key)));
    page.remove_prefix(to + end.size());
  }
}

std::string filled(std::string_view page, const std::map<std::string, std::string>& values) {
  std::string text;
  for (;;) {
    const std::size_t from = page.find("{{"), to = page.find("}}", from);
    if (from == std::string_view::npos) return text.append(page);
    text.append(page.substr(0, from));
    text += values.at(std::string(page.substr(from + 2, to - from - 2)));
    page.remove_prefix(to + 2);
  }
}

}  // namespace abbe::sim::html
