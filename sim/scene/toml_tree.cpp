#include "sim/scene/toml_tree.h"

#include <algorithm>
#include <fstream>
#include <optional>
#include <sstream>
#include <system_error>

#include <fmt/format.h>
#include <toml++/toml.h>

#include "kinematics/bad_input.h"
#include "kinematics/encoding.h"
#include "kinematics/nesting.h"

namespace abbe::sim {

namespace {

Place place_at(std::string_view text, std::size_t offset, const std::string& file) {
  const std::string_view before = text.substr(0, offset);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::size_t start = before.rfind('\n');
  const std::size_t column = start == std::string_view::npos ? offset + 1 : offset - start;
  return {std::make_shared<const std::string>(file), int(line), int(column)};
}

[[noreturn]] void refuse_text(const Place& place, const std::string& expected,
                              const std::string& seen) {
  throw BadInput(*place.file, place.line, place.column, expected, seen);
}

// The parser limits how deep brackets nest, but not how long a dotted key is, and destroys what a
// dotted key builds by recursion.
void refuse_deep_keys(std::string_view text, const std::string& file) {
  int dots = 0;
  bool name_since_dot = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '.') {
      if (name_since_dot && ++dots > 10 * max_nesting) {
        refuse_text(place_at(text, i, file), fmt::format("a key of at most {} parts", max_nesting),
                    "a longer one");
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

/// Column, from 1, of a quote that its line opens and does not close; none where there is none.
std::optional<int> open_quote(std::string_view line) {
  std::optional<int> opened;
  char quote = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (quote == 0 && c == '#') return std::nullopt;
    if (quote == '"' && c == '\\') {
      ++i;
    } else if (quote != 0 && c == quote) {
      quote = 0;
    } else if (quote == 0 && (c == '"' || c == '\'')) {
      quote = c;
      opened = int(i) + 1;
    }
  }
  return quote == 0 ? std::nullopt : opened;
}

std::string_view line_of(std::string_view text, int number) {
  for (; number > 1 && !text.empty(); --number)
    text.remove_prefix(std::min(text.find('\n'), text.size() - 1) + 1);
  return text.substr(0, text.find_first_of("\r\n"));
}

/// A text of one line that the line does not close is named where it opens: what follows it is no
/// control character for the user.
void refuse_open_quote(std::string_view text, const std::string& file, int number) {
  const std::string_view line = line_of(text, number);
  const auto column = open_quote(line);
  if (!column || line.find("\"\"\"") != std::string_view::npos ||
      line.find("'''") != std::string_view::npos)
    return;
  throw BadInput(file, number, *column, std::string("a text that ends with ") + line[*column - 1u],
                 "one that its line does not close");
}

class Converter {
 public:
  explicit Converter(std::shared_ptr<const std::string> file) : file_(std::move(file)) {}

  Node node(const ::toml::node& from, int depth) const {
    if (depth > max_nesting) {
      const Place deep = place(from.source());
      refuse_text(deep, fmt::format("at most {} levels of tables and arrays", max_nesting), "more");
    }
    Node to;
    to.place = place(from.source());
    from.visit([&](const auto& value) { to.value = converted(value, depth); });
    return to;
  }

 private:
  using Value = decltype(Node::value);

  Place place(const ::toml::source_region& source) const {
    return {file_, int(source.begin.line), int(source.begin.column)};
  }
  Value converted(const ::toml::value<bool>& v, int) const { return *v; }
  Value converted(const ::toml::value<std::int64_t>& v, int) const { return *v; }
  Value converted(const ::toml::value<double>& v, int) const { return *v; }
  Value converted(const ::toml::value<std::string>& v, int) const { return *v; }
  template <typename Date>
  Value converted(const ::toml::value<Date>& v, int) const {
    std::ostringstream out;
    out << *v;
    return TomlDate{out.str()};
  }
  Value converted(const ::toml::array& from, int depth) const {
    Node::Array to;
    to.reserve(from.size());
    for (const ::toml::node& element : from) to.push_back(node(element, depth + 1));
    return to;
  }
  // toml++ keeps keys sorted by name; the order of the file is found again from their places.
  Value converted(const ::toml::table& from, int depth) const {
    Node::Table to;
    to.reserve(from.size());
    for (const auto& [key, element] : from) {
      to.push_back({std::string(key.str()), place(key.source()), node(element, depth + 1)});
    }
    std::stable_sort(to.begin(), to.end(), [](const Node::Entry& a, const Node::Entry& b) {
      return std::pair(a.place.line, a.place.column) < std::pair(b.place.line, b.place.column);
    });
    return to;
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
  if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);
  const std::string text = without_tape_marks(bytes);
  if (const auto byte = first_not_utf8(text))
    refuse_text(place_at(text, *byte, file), "text in UTF-8",
                fmt::format("a byte 0x{:02x}, as of Latin-1", (unsigned char)text[*byte]));
  if (const std::size_t nul = text.find('\0'); nul != std::string_view::npos) {
    refuse_text(place_at(text, nul, file), "text", "a NUL byte");
  }
  refuse_deep_keys(text, file);
  try {
    const ::toml::table table = ::toml::parse(text, std::string_view(file));
    Node node = Converter(std::make_shared<const std::string>(file)).node(table, 0);
    return node;
  } catch (const ::toml::parse_error& e) {
    const auto where = e.source().begin;
    refuse_open_quote(text, file, int(where.line));
    std::string seen(e.description());  // "Error while parsing value: what it is about"
    if (const std::size_t colon = seen.find(": ");
        seen.starts_with("Error while") && colon != std::string::npos) {
      seen.erase(0, colon + 2);
    }
    throw BadInput(file, int(where.line), int(where.column), "valid TOML", seen);
  }
}

Node read_toml_file(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::error_code failure;
  if (!std::filesystem::is_regular_file(file, failure)) {
    throw BadInput(name, 0, 0, "a file that can be read",
                   std::filesystem::is_directory(file, failure) ? "a folder" : "no such file");
  }
  const std::uintmax_t size = std::filesystem::file_size(file, failure);
  if (!failure && size > max_toml_bytes) {
    throw BadInput(name, 0, 0, "at most 16 MiB", fmt::format("{} bytes", size));
  }
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw BadInput(name, 0, 0, "a file that can be read", "a failure while reading");
  return parse_toml(text.view(), name);
}

}  // namespace abbe::sim
