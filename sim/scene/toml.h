#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "kinematics/bad_input.h"

/// A TOML file as a tree of plain values, each with its place.
namespace abbe::sim {

/// Where something stands; line and column count from 1, 0 is "not known".
struct Place {
  std::shared_ptr<const std::string> file;
  int line = 0;
  int column = 0;
  bool typed = false;  ///< not in a file but on the command line
};

/// A date or time of TOML, kept as its text only to be refused with its place.
struct TomlDate {
  std::string text;
};

/// One value of a TOML tree with its place. A plain value: trees are copied, merged and changed.
struct Node {
  struct Entry;
  using Table = std::vector<Entry>;  ///< in the order of the file
  using Array = std::vector<Node>;
  Place place;
  std::variant<bool, std::int64_t, double, std::string, Array, Table, TomlDate> value;

  const Table* table() const { return std::get_if<Table>(&value); }
  Table* table() { return std::get_if<Table>(&value); }
  const Array* array() const { return std::get_if<Array>(&value); }
  Array* array() { return std::get_if<Array>(&value); }
  const std::string* text() const { return std::get_if<std::string>(&value); }

  /// Entry of a table by key; null if this is no table or has none.
  const Node* find(std::string_view key) const;
  Node* find(std::string_view key);
};
struct Node::Entry {
  std::string key;
  Place place;  ///< of the key
  Node node;
};

inline constexpr std::uintmax_t max_toml_bytes = std::uintmax_t(16) << 20;

/// Reads a text; a byte order mark and CRLF are taken.
/// @throws BadInput with the place: syntax, a key twice, a NUL, not UTF-8, more than 16 MiB,
/// nesting
///         beyond 100 levels
Node parse_toml(std::string_view text, const std::string& file);

/// @throws BadInput, also where the file cannot be read
Node read_toml_file(const std::filesystem::path& file);

// TOML text of a tree, and how its values read in messages.

/// TOML text of a table: plain values first, then sections; numbers as short as reads back the same
/// bits. parse_toml(to_toml(x)) has the values of x.
std::string to_toml(const Node& table);

/// One value as it stands right of "=", tables inline.
std::string to_toml_value(const Node& node);
/// A text as TOML has it: between quotes on one line, whatever is in it.
std::string to_toml_value(const std::string& text);
/// A number, as short as reads back the same bits.
std::string to_toml_value(double number);

/// How a value reads in a message: short, strings quoted.
std::string shown(const Node& node);

/// All that is wrong with a scene.
class InputErrors : public InputErrorList {
 public:
  using InputErrorList::add;
  void add(const Place& place, const std::string& expected, const std::string& seen);
};

/// All faults of a scene at once; `what()` has one "file:line:column: expected ..., seen ..." a
/// line.
struct BadScene : std::runtime_error {
  explicit BadScene(std::vector<BadInput> input_errors);
  std::vector<BadInput> input_errors;
};

}  // namespace abbe::sim
