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

/// Reads TOML text into a tree of plain values with their positions, writes such a tree, and
/// collects the errors of a scene with their positions.
namespace abbe::sim {

/// A position in a file. Lines and columns are counted from 1; 0 means unknown.
struct SourcePosition {
  std::shared_ptr<const std::string> file;
  int line = 0;
  int column = 0;
  bool from_command_line = false;  ///< the value is from the command line, not from a file
};

/// A TOML date or time. No key accepts one; it is kept only for the position of the input error.
struct TomlDate {
  std::string text;
};

/// A node of a TOML tree: a value and its position.
struct Node {
  struct Entry;
  using Table = std::vector<Entry>;  ///< in the order of the file
  using Array = std::vector<Node>;
  SourcePosition position;
  std::variant<bool, std::int64_t, double, std::string, Array, Table, TomlDate> value;

  const Table* table() const { return std::get_if<Table>(&value); }
  Table* table() { return std::get_if<Table>(&value); }
  const Array* array() const { return std::get_if<Array>(&value); }
  Array* array() { return std::get_if<Array>(&value); }
  const std::string* text() const { return std::get_if<std::string>(&value); }

  /// Returns the entry of a table by key; null if the node is not a table or lacks the key.
  const Node* find(std::string_view key) const;
  Node* find(std::string_view key);
};
struct Node::Entry {
  std::string key;
  SourcePosition position;  ///< position of the key
  Node node;
};

inline constexpr std::uintmax_t max_toml_bytes = std::uintmax_t(16) << 20;

/// Parses a TOML text, with or without byte order mark and CRLF.
/// @throws BadInput with the position of a syntax error, a repeated key, a NUL character, text that
///         is not UTF-8, more than 16 MiB, or nesting beyond 100 levels
Node parse_toml(std::string_view text, const std::string& file);

/// Reads and parses a TOML file.
/// @throws BadInput if the file cannot be read or parsed
Node read_toml_file(const std::filesystem::path& file);

/// Returns the TOML text of a table, plain values first, then sections. Numbers are the shortest
/// that read back as the same bits, so that parse_toml(to_toml(x)) has the values of x.
std::string to_toml(const Node& table);

/// Returns a value as TOML text, as written after "="; tables become inline tables.
std::string to_toml_value(const Node& node);
/// Returns a string quoted on a single line, with special characters escaped.
std::string to_toml_value(const std::string& text);
/// Returns the shortest text of a number that reads back as the same bits.
std::string to_toml_value(double number);

/// Returns the short form of a value for messages, with quoted strings.
std::string display_text(const Node& node);

/// The input errors of a scene, collected while it is read.
class InputErrors : public InputErrorList {
 public:
  using InputErrorList::add;
  void add(const SourcePosition& position, const std::string& expected, const std::string& seen);
};

/// Thrown with all input errors of a scene. `what()` has one line
/// "file:line:column: expected ..., seen ..." per error.
struct BadScene : std::runtime_error {
  explicit BadScene(std::vector<BadInput> input_errors);
  std::vector<BadInput> input_errors;
};

}  // namespace abbe::sim
