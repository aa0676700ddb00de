#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "sim/scene/toml.h"

namespace abbe::sim {

/// Returns true if the whole text matches an ECMAScript regular expression.
bool matches(const std::string& text, const std::string& pattern);

/// Returns the candidate that the user probably intended: the first that begins with the word, else
/// the one of least edit distance, if it is small. Returns nothing if no candidate is plausible.
std::optional<std::string> nearest(std::string_view word, const std::set<std::string>& candidates);

/// Returns the edit distance of two words, the least number of letters to insert, delete or replace
/// (Levenshtein 1966).
int edit_distance(std::string_view a, std::string_view b);

/// Returns a message such as "no file a/b.stl (nearest: \"c.stl\")", with the file of the same
/// folder whose name is nearest.
std::string missing_file_text(const std::filesystem::path& file);

// Units at the end of a key, as in "radius_mm".

/// Returns the factor from the unit at the end of a key to mm, rad, s, N, K, kg, W or A: 1e-3 for
/// "_um", pi/30 for "_rpm", 1e-6 for "_um_per_m_K", 1 for a key without unit.
double unit_factor(std::string_view key);

/// Returns a key without its unit: "radius_mm" gives "radius".
std::string_view key_without_unit(std::string_view key);

/// Returns the unit of a key for messages: "mm", "no unit".
std::string unit_name(std::string_view key);

/// Range of a number, in the unit of its key.
struct Range {
  double min = -std::numeric_limits<double>::max();
  double max = std::numeric_limits<double>::max();
  bool open_min = false;  ///< excludes the bound itself
  bool open_max = false;
};
inline constexpr Range any_number{};
inline constexpr Range positive{0.0, std::numeric_limits<double>::max(), true, false};
inline constexpr Range non_negative{0.0, std::numeric_limits<double>::max(), false, false};

/// Reads one table key by key. Every key that is read becomes known, and `close` reports all
/// others. Numbers are returned in mm, rad and s, whatever the unit in the key. Errors are
/// collected with their positions; after an error the functions return their fallback or another
/// harmless value, so that one run finds all errors.
class TableReader {
 public:
  /// Creates a reader. `table` and `input_errors` must outlive it.
  /// @param section_name  for messages, such as "part"; empty for the top level
  TableReader(const Node& table, std::string section_name, InputErrors& input_errors);

  bool has(const std::string& key) const { return table_.find(key) != nullptr; }
  const Node& node() const { return table_; }
  /// Returns the name of a key in messages, such as "part.radius_mm".
  std::string qualified_name(const std::string& key) const;
  const SourcePosition& position() const { return table_.position; }
  InputErrors& input_errors() const { return input_errors_; }

  double number(const std::string& key, const Range& range);  ///< required
  double number(const std::string& key, const Range& range,
                double fallback);  ///< fallback: mm, rad, s
  std::optional<double> maybe_number(const std::string& key, const Range& range);
  std::optional<double> number_as_written(const std::string& key,
                                          const Range& range);  ///< in the unit of the key
  std::int64_t integer(const std::string& key, std::int64_t min, std::int64_t max,
                       std::int64_t fallback);
  std::optional<std::int64_t> maybe_integer(const std::string& key, std::int64_t min,
                                            std::int64_t max);
  bool boolean(const std::string& key, bool fallback);
  std::string text(const std::string& key);  ///< required, not empty
  std::string text(const std::string& key, const std::string& fallback);

  /// Returns a list of strings; a single string is a list of one. Empty if the key is missing.
  std::vector<std::string> texts(const std::string& key);

  /// Returns an array of `size` numbers (0: at least one).
  Eigen::VectorXd numbers(const std::string& key, int size = 0);  ///< required
  std::optional<Eigen::VectorXd> maybe_numbers(const std::string& key, int size = 0);
  std::optional<Eigen::VectorXd> numbers_as_written(const std::string& key,
                                                    int size = 0);  ///< in the unit of the key
  Eigen::Vector3d vector(const std::string& key);                   ///< required
  Eigen::Vector3d vector(const std::string& key, const Eigen::Vector3d& fallback);
  /// Returns a direction of any length except zero, normalised.
  Eigen::Vector3d direction(const std::string& key);  ///< required
  Eigen::Vector3d direction(const std::string& key, const Eigen::Vector3d& fallback);

  /// Returns the enum value of a key. Returns nothing if the value is none of `choices`, which is
  /// reported, or if the key is missing, which is reported if it is required.
  std::optional<std::string> word(const std::string& key, const std::set<std::string>& choices,
                                  bool required);
  template <typename T>
  using NamedValues = std::initializer_list<std::pair<const char*, T>>;
  template <typename T>
  T choice(const std::string& key, NamedValues<T> named_values, T fallback) {
    return choice_of(key, named_values, std::optional<T>(fallback));
  }
  template <typename T>
  T choice(const std::string& key, NamedValues<T> named_values) {  ///< required
    return choice_of(key, named_values, std::optional<T>());
  }

  /// Returns a section; null if the key is missing, or if it is not a table, which is reported.
  const Node* section(const std::string& key);
  /// Returns a list of tables; a single table counts as a list of one.
  std::vector<const Node*> tables(const std::string& key);

  /// Makes a key known without reading it; returns its value, null if it is missing.
  const Node* accept_key(const std::string& key);
  /// Reports a missing key when the reader is closed.
  /// @param kind  the expected value, such as "a number"
  void report_missing(const std::string& key, const std::string& kind);
  /// Reports an invalid value at the position of the key.
  void report_invalid(const std::string& key, const std::string& expected, const std::string& seen);

  /// Reports unknown keys, each with the nearest known one, and the missing ones.
  void close();

 private:
  template <typename T>
  T choice_of(const std::string& key, NamedValues<T> named_values,
              const std::optional<T>& fallback) {
    std::set<std::string> names;
    for (const auto& [name, value] : named_values) names.insert(name);
    const std::optional<std::string> seen = word(key, names, !fallback);
    for (const auto& [name, value] : named_values)
      if (seen == name) return value;
    return fallback.value_or(named_values.begin()->second);
  }
  std::optional<double> finite_number(const Node& node, const std::string& key);

  const Node& table_;
  std::string section_name_;
  InputErrors& input_errors_;
  std::set<std::string> known_keys_;
  std::vector<std::pair<std::string, std::string>> missing_keys_;  ///< key, kind
};

struct EnumChoice;

/// Description of a key of a table. The key tables of the documents, `abbe schema` and `abbe
/// explain` are made from these descriptions.
struct Key {
  enum class Kind {
    Number,
    Whole,
    Boolean,
    Text,
    Numbers,
    NumberOrNumbers,
    Texts,
    Table,
    Tables,
    Any
  };
  std::string name;      ///< "radius_mm"; for a family of keys its form, such as "<axis>_mm"
  std::string sentence;  ///< description
  Kind kind = Kind::Any;
  bool required = false;  ///< required if its table, or the enum value that adds the key, is
                          ///< present
  std::string fallback;   ///< default value in words; empty: none
  std::string pattern;    ///< regular expression of the names of a family of keys; else empty
  std::string
      exclusive_group;  ///< name of a group of keys of which a table has exactly one; else empty
  Range range{};        ///< of numbers, in the unit of the key
  int size = 0;         ///< of numbers; 0: any size from 1
  std::vector<EnumChoice> choices;  ///< the enum values of a string; empty: any string
  std::vector<Key> keys;            ///< of the table, or of each table in a list
  bool or_file = false;             ///< the name of a file may replace the table
};

/// An enum value of a key, with the keys that it adds to the table.
struct EnumChoice {
  std::string word;
  std::string sentence;
  std::vector<Key> keys;
};

}  // namespace abbe::sim
