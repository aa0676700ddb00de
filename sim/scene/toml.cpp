#include "sim/scene/toml.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <system_error>

#include <fmt/format.h>
#include <toml++/toml.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::sim {

namespace {

/// Returns the line and column of an offset in a text.
SourcePosition place_at(std::string_view text, std::size_t offset, const std::string& file) {
  const std::string_view preceding_text = text.substr(0, offset);
  const auto line = 1 + std::count(preceding_text.begin(), preceding_text.end(), '\n');
  const std::size_t line_break = preceding_text.rfind('\n');
  const std::size_t column =
      line_break == std::string_view::npos ? offset + 1 : offset - line_break;
  return {std::make_shared<const std::string>(file), int(line), int(column)};
}

[[noreturn]] void throw_at(const SourcePosition& position, const std::string& expected,
                           const std::string& seen) {
  throw BadInput(*position.file, position.line, position.column, expected, seen);
}

// Throws an input error for very long dotted keys. toml++ limits the nesting of brackets but not
// the length of a dotted key, and the tables of such a key are destroyed by recursion.
void check_key_depth(std::string_view text, const std::string& file) {
  int dots = 0;
  bool name_since_dot = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '.') {
      // The limit is generous, because the scan also counts dots in strings.
      if (name_since_dot && ++dots > 10 * max_nesting) {
        throw_at(place_at(text, i, file),
                 fmt::format("a key of at most {} components", max_nesting), "a longer key");
      }
      name_since_dot = false;
    } else if (std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-') {
      name_since_dot = true;
    } else if (c != ' ' && c != '\t' && c != '"' && c != '\'') {
      dots = 0;
      name_since_dot = false;
    }
  }
}

/// Returns the column, from 1, of the opening quote of a string that does not end in this line.
std::optional<int> unclosed_quote(std::string_view line) {
  std::optional<int> column;
  char quote = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (quote == 0 && c == '#') return std::nullopt;  // a comment until the end of the line
    // A backslash escapes the next character only within double quotes.
    if (quote == '"' && c == '\\') {
      ++i;
    } else if (quote != 0 && c == quote) {
      quote = 0;
    } else if (quote == 0 && (c == '"' || c == '\'')) {
      quote = c;
      column = int(i) + 1;
    }
  }
  return quote == 0 ? std::nullopt : column;
}

std::string_view text_line(std::string_view text, int line_number) {
  for (; line_number > 1 && !text.empty(); --line_number)
    text.remove_prefix(std::min(text.find('\n'), text.size() - 1) + 1);
  return text.substr(0, text.find_first_of("\r\n"));
}

/// Throws an input error at the opening quote if a line has no closing one. The parser would report
/// the line break as an invalid control character, which would puzzle the user.
void check_quotes(std::string_view text, const std::string& file, int line_number) {
  const std::string_view line = text_line(text, line_number);
  const auto column = unclosed_quote(line);
  // Texts in triple quotes may span lines.
  if (!column || line.find("\"\"\"") != std::string_view::npos ||
      line.find("'''") != std::string_view::npos)
    return;
  throw BadInput(file, line_number, *column,
                 std::string("a string that ends with ") + line[*column - 1u],
                 "a string not closed on its line");
}

/// Converts a tree of toml++ to `Node`.
class TomlConverter {
 public:
  explicit TomlConverter(std::shared_ptr<const std::string> file) : file_(std::move(file)) {}

  Node node(const ::toml::node& from, int depth) const {
    if (depth > max_nesting) {
      throw_at(position(from.source()),
               fmt::format("at most {} levels of tables and arrays", max_nesting), "more");
    }
    Node node;
    node.position = position(from.source());
    from.visit([&](const auto& value) { node.value = convert(value, depth); });
    return node;
  }

 private:
  using Value = decltype(Node::value);

  SourcePosition position(const ::toml::source_region& source) const {
    return {file_, int(source.begin.line), int(source.begin.column)};
  }
  Value convert(const ::toml::value<bool>& v, int) const { return *v; }
  Value convert(const ::toml::value<std::int64_t>& v, int) const { return *v; }
  Value convert(const ::toml::value<double>& v, int) const { return *v; }
  Value convert(const ::toml::value<std::string>& v, int) const { return *v; }
  template <typename Date>
  Value convert(const ::toml::value<Date>& v, int) const {
    std::ostringstream out;
    out << *v;
    return TomlDate{out.str()};
  }
  Value convert(const ::toml::array& from, int depth) const {
    Node::Array array;
    array.reserve(from.size());
    for (const ::toml::node& element : from) array.push_back(node(element, depth + 1));
    return array;
  }
  // toml++ sorts keys by name, so the order of the file is restored from their positions.
  Value convert(const ::toml::table& from, int depth) const {
    Node::Table table;
    table.reserve(from.size());
    for (const auto& [key, element] : from) {
      table.push_back({std::string(key.str()), position(key.source()), node(element, depth + 1)});
    }
    std::stable_sort(table.begin(), table.end(), [](const Node::Entry& a, const Node::Entry& b) {
      return std::pair(a.position.line, a.position.column) <
             std::pair(b.position.line, b.position.column);
    });
    return table;
  }

  std::shared_ptr<const std::string> file_;
};

}  // namespace

const Node* Node::find(std::string_view key) const {
  const Table* entries = table();
  if (!entries) return nullptr;
  for (const Entry& entry : *entries) {
    if (entry.key == key) return &entry.node;
  }
  return nullptr;
}

Node* Node::find(std::string_view key) { return const_cast<Node*>(std::as_const(*this).find(key)); }

Node parse_toml(std::string_view bytes, const std::string& file) {
  if (bytes.size() > max_toml_bytes) {
    throw BadInput(file, 0, 0, "at most 16 MiB", fmt::format("{} bytes", bytes.size()));
  }
  check_encoding(bytes, file);
  // Some editors write the mark, and the parser would take it for part of the first key.
  if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);
  const std::string text = strip_tape_characters(bytes);
  if (const auto byte = find_invalid_utf8(text))
    throw_at(place_at(text, *byte, file), "UTF-8 text",
             fmt::format("a byte 0x{:02x}, as in Latin-1", (unsigned char)text[*byte]));
  if (const std::size_t nul = text.find('\0'); nul != std::string_view::npos) {
    throw_at(place_at(text, nul, file), "text", "a NUL byte");
  }
  check_key_depth(text, file);
  try {
    const ::toml::table table = ::toml::parse(text, std::string_view(file));
    return TomlConverter(std::make_shared<const std::string>(file)).node(table, 0);
  } catch (const ::toml::parse_error& error) {
    const auto position = error.source().begin;
    check_quotes(text, file, int(position.line));
    std::string cause(error.description());  // "Error while parsing value: cause of the error"
    if (const std::size_t colon = cause.find(": ");
        cause.starts_with("Error while") && colon != std::string::npos) {
      cause.erase(0, colon + 2);
    }
    throw BadInput(file, int(position.line), int(position.column), "valid TOML", cause);
  }
}

Node read_toml_file(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::error_code error_code;
  // Some systems open a folder as a stream, so the kind of file is tested first.
  if (!std::filesystem::is_regular_file(file, error_code)) {
    throw BadInput(name, 0, 0, "a file that can be read",
                   std::filesystem::is_directory(file, error_code) ? "a folder" : "no such file");
  }
  // A large file is rejected without reading it.
  const std::uintmax_t size = std::filesystem::file_size(file, error_code);
  if (!error_code && size > max_toml_bytes) {
    throw BadInput(name, 0, 0, "at most 16 MiB", fmt::format("{} bytes", size));
  }
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream) throw BadInput(name, 0, 0, "a file that can be read", "a failure while reading");
  return parse_toml(text.view(), name);
}

namespace {

/// Escapes the invisible format characters of a text as TOML does: U+2028 as \u2028, a tag as
/// \U000E0041. ASCII stays as it is.
std::string escape_format_characters(const std::string& text) {
  std::string result;
  for (std::size_t offset = 0; offset < text.size();) {
    const auto lead = static_cast<unsigned char>(text[offset]);
    // The first byte of a UTF-8 sequence determines its length.
    const std::size_t bytes = lead < 0x80 ? 1 : lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
    const std::string character = text.substr(offset, bytes),
                      escaped_character = escaped(character);
    offset += bytes;
    if (lead < 0x80 || escaped_character == character || escaped_character.starts_with("\\x")) {
      result += character;
    } else if (escaped_character.size() == 6) {
      result += escaped_character;
    } else {  // a surrogate pair of UTF-16, which TOML does not allow
      const unsigned high = unsigned(std::stoul(escaped_character.substr(2, 4), nullptr, 16));
      const unsigned low = unsigned(std::stoul(escaped_character.substr(8, 4), nullptr, 16));
      result += fmt::format("\\U{:08X}", 0x10000 + ((high - 0xD800) << 10) + (low - 0xDC00));
    }
  }
  return result;
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
  return escape_format_characters(out) + '"';
}

std::string key_text(const std::string& key) {
  const bool is_bare = !key.empty() && std::all_of(key.begin(), key.end(), [](unsigned char c) {
    return (c < 0x80 && std::isalnum(c)) || c == '_' || c == '-';
  });
  return is_bare ? key : quoted_text(key);
}

bool is_list_of_tables(const Node& node) {
  const Node::Array* array = node.array();
  return array && !array->empty() &&
         std::all_of(array->begin(), array->end(), [](const Node& n) { return n.table(); });
}

void write_section(const Node& table, const std::string& path, std::string& out) {
  for (const Node::Entry& entry : *table.table()) {
    // Plain values come first; after a section header they would belong to that section.
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
  // Without a point or an exponent, TOML would read back an integer.
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

std::string display_text(const Node& node) {
  if (node.table()) return "a table";
  if (node.array()) return fmt::format("an array of {}", node.array()->size());
  std::string text = to_toml_value(node);
  if (text.size() > 60) {
    text.resize(57);
    // No partial UTF-8 sequence must remain at the end.
    while (!text.empty() && (static_cast<unsigned char>(text.back()) & 0xC0) == 0x80) {
      text.pop_back();
    }
    text += "...";
  }
  return text;
}

void InputErrors::add(const SourcePosition& position, const std::string& expected,
                      const std::string& seen) {
  add(BadInput(position.file ? *position.file : "", position.line, position.column, expected,
               seen));
}

namespace {

std::string joined_lines(const std::vector<BadInput>& input_errors) {
  std::string text;
  for (const BadInput& error : input_errors)
    text += (text.empty() ? "" : "\n") + std::string(error.what());
  return text;
}

}  // namespace

BadScene::BadScene(std::vector<BadInput> list)
    : std::runtime_error(joined_lines(list)), input_errors(std::move(list)) {}

}  // namespace abbe::sim
