#include "sim/scene/toml_text.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/escape.h"

namespace abbe::sim {

namespace {

/// Marks of format beyond ASCII as TOML spells them: U+2028 is \u2028, a tag \U000E0041.
std::string with_marks_as_toml(const std::string& text) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const auto lead = static_cast<unsigned char>(text[at]);
    const std::size_t bytes = lead < 0x80 ? 1 : lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
    const std::string letter = text.substr(at, bytes), shown = escaped(letter);
    at += bytes;
    if (lead < 0x80 || shown == letter || shown.starts_with("\\x")) {
      out += letter;
    } else if (shown.size() == 6) {
      out += shown;
    } else {  // two halves of UTF-16
      const unsigned high = unsigned(std::stoul(shown.substr(2, 4), nullptr, 16));
      const unsigned low = unsigned(std::stoul(shown.substr(8, 4), nullptr, 16));
      out += fmt::format("\\U{:08X}", 0x10000 + ((high - 0xD800) << 10) + (low - 0xDC00));
    }
  }
  return out;
}

std::string quoted_text(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      out += fmt::format("\\u{:04X}", static_cast<unsigned char>(c));
    } else {
      out += c;
    }
  }
  return with_marks_as_toml(out) + '"';
}

std::string key_text(const std::string& key) {
  const bool bare = !key.empty() && std::all_of(key.begin(), key.end(), [](unsigned char c) {
    return (c < 0x80 && std::isalnum(c)) || c == '_' || c == '-';
  });
  return bare ? key : quoted_text(key);
}

bool is_list_of_tables(const Node& node) {
  const Node::Array* array = node.array();
  return array && !array->empty() &&
         std::all_of(array->begin(), array->end(), [](const Node& n) { return n.table(); });
}

void write_section(const Node& table, const std::string& path, std::string& out) {
  for (const Node::Entry& entry : *table.table()) {
    if (entry.node.table() || is_list_of_tables(entry.node)) continue;
    out += key_text(entry.key) + " = " + to_toml_value(entry.node) + "\n";
  }
  for (const Node::Entry& entry : *table.table()) {
    const std::string inner = path.empty() ? key_text(entry.key) : path + "." + key_text(entry.key);
    if (entry.node.table()) {
      out += fmt::format("\n[{}]\n", inner);
      write_section(entry.node, inner, out);
    } else if (is_list_of_tables(entry.node)) {
      for (const Node& element : *entry.node.array()) {
        out += fmt::format("\n[[{}]]\n", inner);
        write_section(element, inner, out);
      }
    }
  }
}

}  // namespace

std::string to_toml_value(double number) {
  if (!std::isfinite(number)) return std::isnan(number) ? "nan" : number > 0 ? "inf" : "-inf";
  std::string text = fmt::format("{}", number);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string to_toml_value(const std::string& text) {
  Node node;
  node.value = text;
  return to_toml_value(node);
}

std::string to_toml_value(const Node& node) {
  struct Writer {
    std::string operator()(bool v) const { return v ? "true" : "false"; }
    std::string operator()(std::int64_t v) const { return std::to_string(v); }
    std::string operator()(double v) const { return to_toml_value(v); }
    std::string operator()(const std::string& v) const { return quoted_text(v); }
    std::string operator()(const TomlDate& v) const { return v.text; }
    std::string operator()(const Node::Array& v) const {
      std::string out = "[";
      for (const Node& element : v) out += (out.size() > 1 ? ", " : "") + to_toml_value(element);
      return out + "]";
    }
    std::string operator()(const Node::Table& v) const {
      std::string out = "{";
      for (const Node::Entry& entry : v) {
        out +=
            (out.size() > 1 ? ", " : " ") + key_text(entry.key) + " = " + to_toml_value(entry.node);
      }
      return out + " }";
    }
  };
  return std::visit(Writer{}, node.value);
}

std::string to_toml(const Node& table) {
  std::string out;
  write_section(table, "", out);
  return out;
}

std::string shown(const Node& node) {
  if (node.table()) return "a table";
  if (node.array()) return fmt::format("an array of {}", node.array()->size());
  std::string text = to_toml_value(node);
  if (text.size() > 60) {
    text.resize(57);
    while (!text.empty() && (static_cast<unsigned char>(text.back()) & 0xC0) == 0x80) {
      text.pop_back();
    }
    text += "...";
  }
  return text;
}

}  // namespace abbe::sim
