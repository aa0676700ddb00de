#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "kinematics/bad_input.h"

/// Strict reading of TOML: every key has a place, every fault is collected, nothing is guessed.
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

/// TOML text of a table: plain values first, then sections; numbers as short as reads back the same
/// bits. parse_toml(to_toml(x)) has the values of x.
std::string to_toml(const Node& table);

/// One value as it stands right of "=", tables inline.
std::string to_toml_value(const Node& node);
/// A text as TOML has it: between quotes on one line, whatever is in it.
std::string to_toml_value(const std::string& text);

/// All that is wrong, in the order found; a fault told twice is kept once, and beyond 200 no more.
class Faults {
 public:
  void add(const Place& place, const std::string& expected, const std::string& seen);
  void add(const BadInput& fault);
  const std::vector<BadInput>& list() const { return list_; }
  bool empty() const { return list_.empty(); }

 private:
  std::vector<BadInput> list_;
};

/// Factor from the unit that ends a key to mm, rad, s, N, K, and to kg, W and A where the key has
/// them: "_um" gives 1e-3, "_rpm" pi/30, "_um_per_m_K" 1e-6; 1 without.
double unit_of(std::string_view key);

/// Key without its unit: "radius_mm" gives "radius".
std::string_view stem_of(std::string_view key);

/// The candidate with the least edit distance, if it is near enough to be meant.
std::optional<std::string> nearest(std::string_view word, const std::set<std::string>& candidates);

/// What a number may be, in the unit of its key.
struct Range {
  double min = -std::numeric_limits<double>::max();
  double max = std::numeric_limits<double>::max();
  bool open_min = false;  ///< the bound itself is refused
  bool open_max = false;
};
inline constexpr Range any_number{};
inline constexpr Range positive{0.0, std::numeric_limits<double>::max(), true, false};
inline constexpr Range non_negative{0.0, std::numeric_limits<double>::max(), false, false};

/// Reads one table key by key. A key asked for is known; `close` refuses all others. Numbers are
/// returned in mm, rad and s whatever the unit in the key. After a fault the questions return their
/// fallback (or something harmless), so that reading goes on to the next fault.
class TableReader {
 public:
  /// @param where  name of the section for messages, "part"; empty for the top
  /// Both references must outlive the reader.
  TableReader(const Node& table, std::string where, Faults& faults);

  bool has(const std::string& key) const { return table_.find(key) != nullptr; }
  const Node& node() const { return table_; }
  const Place& place() const { return table_.place; }
  Faults& faults() const { return faults_; }

  double number(const std::string& key, const Range& range);  ///< required
  double number(const std::string& key, const Range& range,
                double fallback);  ///< fallback: mm, rad, s
  std::optional<double> maybe_number(const std::string& key, const Range& range);
  std::optional<double> number_as_written(const std::string& key,
                                          const Range& range);  ///< unit of the key
  std::int64_t integer(const std::string& key, std::int64_t min, std::int64_t max,
                       std::int64_t fallback);
  std::optional<std::int64_t> maybe_integer(const std::string& key, std::int64_t min,
                                            std::int64_t max);
  bool boolean(const std::string& key, bool fallback);
  std::string text(const std::string& key);  ///< required, not empty
  std::string text(const std::string& key, const std::string& fallback);

  /// Array of numbers, `size` of them (0: at least one).
  Eigen::VectorXd numbers(const std::string& key, int size = 0);  ///< required
  std::optional<Eigen::VectorXd> maybe_numbers(const std::string& key, int size = 0);
  std::optional<Eigen::VectorXd> numbers_as_written(const std::string& key,
                                                    int size = 0);  ///< unit of the key
  Eigen::Vector3d vector(const std::string& key);                   ///< required
  Eigen::Vector3d vector(const std::string& key, const Eigen::Vector3d& fallback);
  /// Direction of any length but zero, made unit.
  Eigen::Vector3d direction(const std::string& key);  ///< required
  Eigen::Vector3d direction(const std::string& key, const Eigen::Vector3d& fallback);

  /// One word of a list.
  template <typename T>
  using Words = std::initializer_list<std::pair<const char*, T>>;
  template <typename T>
  T choice(const std::string& key, Words<T> words, T fallback) {
    return choice_of(key, words, std::optional<T>(fallback));
  }
  template <typename T>
  T choice(const std::string& key, Words<T> words) {  ///< required
    return choice_of(key, words, std::optional<T>());
  }

  /// A section, if it is there and is a table.
  const Node* section(const std::string& key);
  /// A list of tables; a single table counts as a list of one.
  std::vector<const Node*> tables(const std::string& key);

  /// Tells that a key is known without reading it; returns its value if it is there.
  const Node* know(const std::string& key);
  /// Tells that a key is missing.
  void missing(const std::string& key, const std::string& kind);
  void refuse(const std::string& key, const std::string& expected, const std::string& seen);

  /// Refuses every key that was not asked for, with the nearest one that was.
  void close();

 private:
  template <typename T>
  T choice_of(const std::string& key, Words<T> words, const std::optional<T>& fallback) {
    std::set<std::string> names;
    for (const auto& word : words) names.insert(word.first);
    const std::optional<std::string> seen = word_of(key, names, !fallback);
    for (const auto& word : words) {
      if (seen == word.first) return word.second;
    }
    return fallback.value_or(words.begin()->second);
  }
  std::optional<std::string> word_of(const std::string& key, const std::set<std::string>& words,
                                     bool required);
  std::optional<double> finite(const Node& node, const std::string& key);
  std::string name_of(const std::string& key) const;

  const Node& table_;
  std::string where_;
  Faults& faults_;
  std::set<std::string> known_;
  std::vector<std::pair<std::string, std::string>> missing_;  ///< key, kind
};

/// How a value reads in a message: short, strings quoted.
std::string shown(const Node& node);

}  // namespace abbe::sim
