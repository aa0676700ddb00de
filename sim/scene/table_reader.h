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

/// Whether all of a text is as an ECMAScript pattern says.
bool matches(const std::string& text, const std::string& pattern);

/// The candidate that begins with the word, else that with the least edit distance, if it is near
/// enough to be meant.
std::optional<std::string> nearest(std::string_view word, const std::set<std::string>& candidates);

/// Letters to insert, delete or replace to make one word of the other (Levenshtein 1966).
int edit_distance(std::string_view a, std::string_view b);

/// "no file a/b.stl (nearest: \"c.stl\")", of the files in its folder.
std::string missing_file_text(const std::filesystem::path& file);

// Units that stand at the end of a key: "radius_mm".

/// Factor from the unit that ends a key to mm, rad, s, N, K, and to kg, W and A where the key has
/// them: "_um" gives 1e-3, "_rpm" pi/30, "_um_per_m_K" 1e-6; 1 without.
double unit_of(std::string_view key);

/// Key without its unit: "radius_mm" gives "radius".
std::string_view key_stem(std::string_view key);

/// Unit of a key as messages name it: "mm", "no unit".
std::string unit_name(std::string_view key);

// Strict reading of TOML: every key has a place, every fault is collected, nothing is guessed.

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
  TableReader(const Node& table, std::string where, InputErrors& input_errors);

  bool has(const std::string& key) const { return table_.find(key) != nullptr; }
  const Node& node() const { return table_; }
  /// How messages name a key: "part.radius_mm".
  std::string name_of(const std::string& key) const;
  const Place& place() const { return table_.place; }
  InputErrors& input_errors() const { return input_errors_; }

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

  /// List of texts; a text alone is a list of one. Empty if it is not there.
  std::vector<std::string> texts(const std::string& key);

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

  /// One word of a list; none if it is missing, which is a fault where it is required, or another.
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

  /// A section, if it is there and is a table.
  const Node* section(const std::string& key);
  /// A list of tables; a single table counts as a list of one.
  std::vector<const Node*> tables(const std::string& key);

  /// Makes a key known without reading it; returns its value if it is there.
  const Node* know(const std::string& key);
  /// Reports that a key is missing.
  void missing(const std::string& key, const std::string& kind);
  void refuse(const std::string& key, const std::string& expected, const std::string& seen);

  /// Refuses every key that was not asked for, with the nearest one that was.
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

/// What a key of a table takes, as people and editors read it: the one statement from which come
/// the tables of keys in the documents, `abbe schema` and `abbe explain`.
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
  std::string name;      ///< "radius_mm"; of keys that are many how they look: "<axis>_mm"
  std::string sentence;  ///< what it is
  Kind kind = Kind::Any;
  bool required = false;    ///< wherever its table, or the word that brings it, is
  std::string fallback;     ///< what stands in where it is left out, for people; empty: nothing
  std::string pattern;      ///< regular expression of the names where they are many; else empty
  std::string either;       ///< of the keys of a table with one `either`, exactly one is given
  Range range{};            ///< of numbers, in the unit of the key
  int size = 0;             ///< of numbers; 0: any from 1 on
  std::vector<Word> words;  ///< of a text that is one of these
  std::vector<Key> keys;    ///< of the table or of each table
  bool or_file = false;     ///< a table that may stand in a file of its own, which is then named
};

/// A word that a key may have, and the keys of its table that it brings.
struct Word {
  std::string word;
  std::string sentence;
  std::vector<Key> keys;
};

}  // namespace abbe::sim
