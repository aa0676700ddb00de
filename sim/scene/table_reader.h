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

/// Returns true if the whole text matches an ECMAScript pattern.
bool matches(const std::string& text, const std::string& pattern);

/// Returns the candidate that begins with the word, else the one with the least edit distance if it
/// is near enough to be plausible.
std::optional<std::string> nearest(std::string_view word, const std::set<std::string>& candidates);

/// Returns the number of letters to insert, delete or replace that turns one word into the other
/// (Levenshtein 1966).
int edit_distance(std::string_view a, std::string_view b);

/// Returns "no file a/b.stl (nearest: \"c.stl\")", with the nearest file of the same folder.
std::string missing_file_text(const std::filesystem::path& file);

// Units at the end of a key, as in "radius_mm".

/// Returns the factor from the unit at the end of a key to mm, rad, s, N, K, and to kg, W and A for
/// keys in those units: "_um" gives 1e-3, "_rpm" pi/30, "_um_per_m_K" 1e-6; a key without unit
/// gives 1.
double unit_of(std::string_view key);

/// Returns a key without its unit: "radius_mm" gives "radius".
std::string_view key_stem(std::string_view key);

/// Returns the unit of a key for messages: "mm", "no unit".
std::string unit_name(std::string_view key);

// Strict reading of TOML: every key has a position, every error is collected, nothing is guessed.

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

/// Reads one table key by key. Every key that is read becomes known, and `close` rejects all
/// others. Numbers are returned in mm, rad and s, whatever the unit in the key. After an error the
/// functions return their fallback (or another harmless value), so that reading continues to the
/// next error.
class TableReader {
 public:
  /// Creates a reader.
  /// @param where  name of the section for messages, such as "part"; empty for the top level
  /// Both references must outlive the reader.
  TableReader(const Node& table, std::string where, InputErrors& input_errors);

  bool has(const std::string& key) const { return table_.find(key) != nullptr; }
  const Node& node() const { return table_; }
  /// Returns the name of a key in messages, such as "part.radius_mm".
  std::string name_of(const std::string& key) const;
  const Place& place() const { return table_.place; }
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

  /// Returns a list of texts; a single text is a list of one. Empty if the key is missing.
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

  /// Returns one word of a list. Returns nothing for another word, which is an error, and for a
  /// missing key, which is an error if it is required.
  std::optional<std::string> word(const std::string& key, const std::set<std::string>& words,
                                  bool required);
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

  /// Returns a section if the key is present and is a table.
  const Node* section(const std::string& key);
  /// Returns a list of tables; a single table counts as a list of one.
  std::vector<const Node*> tables(const std::string& key);

  /// Makes a key known without reading it; returns its value if present.
  const Node* accept_key(const std::string& key);
  /// Reports that a key is missing.
  void missing(const std::string& key, const std::string& kind);
  void refuse(const std::string& key, const std::string& expected, const std::string& seen);

  /// Rejects every key that was not read, with the nearest known one.
  void close();

 private:
  template <typename T>
  T choice_of(const std::string& key, Words<T> words, const std::optional<T>& fallback) {
    std::set<std::string> names;
    for (const auto& word : words) names.insert(word.first);
    const std::optional<std::string> seen = word(key, names, !fallback);
    for (const auto& word : words) {
      if (seen == word.first) return word.second;
    }
    return fallback.value_or(words.begin()->second);
  }
  std::optional<double> finite(const Node& node, const std::string& key);

  const Node& table_;
  std::string where_;
  InputErrors& input_errors_;
  std::set<std::string> known_;
  std::vector<std::pair<std::string, std::string>> missing_;  ///< key, kind
};

struct Word;

/// Description of a key of a table for readers and editors: the single source of the tables of keys
/// in the documents, of `abbe schema` and of `abbe explain`.
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
  bool required = false;    ///< required wherever its table, or the word that introduces it, is
                            ///< present
  std::string fallback;     ///< value used without the key, in words; empty: none
  std::string pattern;      ///< regular expression of the names of a family of keys; else empty
  std::string either;       ///< exactly one of the keys of a table with the same `either` is given
  Range range{};            ///< of numbers, in the unit of the key
  int size = 0;             ///< of numbers; 0: any size from 1
  std::vector<Word> words;  ///< the allowed words of a text
  std::vector<Key> keys;    ///< of the table, or of each table in a list
  bool or_file = false;     ///< a table that may be stored in a file of its own, whose name then
                            ///< replaces it
};

/// A word that a key may take, with the keys that it adds to the table.
struct Word {
  std::string word;
  std::string sentence;
  std::vector<Key> keys;
};

}  // namespace abbe::sim
