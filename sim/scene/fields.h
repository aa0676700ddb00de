#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "sim/scene/key.h"

/// The keys of a table and the members that they set, stated once: `Fields` reads a struct from a
/// table, writes it as one, and says what each key takes.
namespace abbe::sim {

/// Name of a key, and what of it is not seen from the member that it sets.
struct KeyName {
  std::string name;
  bool required = false;
  std::string fallback;  ///< for people, where it is not the value of a struct made by default
  std::string either;    ///< `Key::either`

  KeyName(const char* key) : name(key) {}
  KeyName(std::string key) : name(std::move(key)) {}
  KeyName otherwise(std::string text) const;  ///< with this fallback
  KeyName one_of(std::string group) const;    ///< with this `either`
};
/// A key that must be there.
KeyName must(KeyName key);

/// The key of a name; `kind` and what belongs to it are set by the caller.
/// @param keys  of a table
Key key_of(const KeyName& name, Key::Kind kind, const char* sentence, std::vector<Key> keys = {});
/// The key of `size` numbers, 0: any
Key key_of_numbers(const KeyName& name, int size, const char* sentence);

/// Puts `key = value` at the end of a table.
template <typename V>
void put(Node::Table& table, const std::string& key, V value) {
  table.push_back({key, {}, Node{{}, std::move(value)}});
}
/// A value in a unit, such that the number times the unit gives the same bits where one does, and
/// has few digits where it can.
double in_unit(double value, double unit);
/// Numbers, each in the unit of the key.
void put_numbers(Node::Table& table, const std::string& key, const Eigen::VectorXd& values,
                 double unit);

/// Puts the entries of another table at the end of a table.
void put_all(Node::Table& table, Node::Table entries);

/// The member of a table whose keys set the value itself.
inline constexpr auto itself = [](auto& value) -> auto& { return value; };

/// Makes the keys that words bring known without reading them.
void know_all(TableReader& reader, const std::vector<Word>& words);

/// A number of the key's unit as documents show it, 12 digits; empty for one without end.
std::string shown_default(double value);
std::string shown_default(const Eigen::VectorXd& values);

namespace fields_detail {
template <typename V>
struct is_optional : std::false_type {};
template <typename V>
struct is_optional<std::optional<V>> : std::true_type {};
template <typename V>
struct bare {
  using type = V;
};
template <typename V>
struct bare<std::optional<V>> {
  using type = V;
};
}  // namespace fields_detail

/// One of the alternatives of a variant V: the word that chooses it and the keys that it has.
template <typename V>
struct Alternative {
  Word word;
  std::function<V(TableReader&)> read;
  std::function<bool(const V&, Node::Table&)> write;  ///< false, and nothing, if it is another
};

/// Keys of a table in the order in which they are read. Members are pointers to members or
/// functions `(T&) -> M&`; where a key is left out the member stays as it is.
template <typename T>
class Fields {
 public:
  /// One key, or several that are read together.
  struct Field {
    std::vector<Key> keys;
    std::function<void(TableReader&, T&)> read;
    std::function<void(const T&, Node::Table&)> write;
  };
  template <typename M>
  using Value = std::remove_cvref_t<std::invoke_result_t<M, T&>>;

  Fields() = default;
  /// @param usual  value where every key is left out
  explicit Fields(T usual) : usual_(std::move(usual)) {}

  /// double in mm, rad, s, N, K; an optional one has no fallback
  template <typename M>
  Fields& number(const KeyName& key, M member, const Range& range, const char* sentence) {
    return add_number(key, member, range, sentence, unit_of(key.name));
  }
  /// double in the unit of its key
  template <typename M>
  Fields& number_as_written(const KeyName& key, M member, const Range& range,
                            const char* sentence) {
    return add_number(key, member, range, sentence, 1.0);
  }
  /// double, times a unit that is not seen from the key: "um_per_K" is one from end to end
  template <typename M>
  Fields& number_in(double unit, const KeyName& key, M member, const Range& range,
                    const char* sentence) {
    return add_number(key, member, range, sentence, unit);
  }
  /// any integer from min to max, or an optional one
  template <typename M>
  Fields& whole(const KeyName& key, M member, std::int64_t min, std::int64_t max,
                const char* sentence);
  template <typename M>
  Fields& boolean(const KeyName& key, M member, const char* sentence);
  /// std::string or path, not empty where it is given
  template <typename M>
  Fields& text(const KeyName& key, M member, const char* sentence);
  /// std::vector<std::string>
  template <typename M>
  Fields& texts(const KeyName& key, M member, const char* sentence);
  /// A text for people alone, which is read and not kept.
  Fields& remark(const KeyName& key, const char* sentence) {
    return custom(
        {key_of(key, Key::Kind::Text, sentence)},
        [key](TableReader& reader, T&) { reader.text(key.name, ""); },
        [](const T&, Node::Table&) {});
  }
  /// A value that a word stands for. The first word is read on where a required one is missing.
  template <typename M>
  struct WordOf {
    const char* word;
    Value<M> value;
    const char* sentence = "";
  };
  template <typename M>
  Fields& word(const KeyName& key, M member, std::vector<WordOf<M>> words, const char* sentence);
  /// Eigen::Vector3d
  template <typename M>
  Fields& vector(const KeyName& key, M member, const char* sentence);
  /// Eigen::Vector3d, made unit
  template <typename M>
  Fields& direction(const KeyName& key, M member, const char* sentence);
  /// A vector of `size` numbers, 0: any; or an optional one
  template <typename M>
  Fields& numbers(const KeyName& key, M member, int size, const char* sentence);
  /// A section: U, or an optional one that is there when the section is
  template <typename M, typename U>
  Fields& table(const KeyName& key, M member, Fields<U> fields, const char* sentence);
  /// std::vector<U>, one for every table of a list
  template <typename M, typename U>
  Fields& tables(const KeyName& key, M member, Fields<U> fields, const char* sentence);
  /// The same, read by a function of its own: a table may depend on those before it.
  template <typename M, typename U>
  Fields& tables(const KeyName& key, M member, Fields<U> fields, const char* sentence,
                 std::function<void(TableReader&, T&)> read);
  /// A member whose own keys stand in this table.
  template <typename M, typename U>
  Fields& all_of(M member, Fields<U> fields);
  /// A member that is one of several by the word of a key. The first is read on where the word is
  /// missing or wrong.
  template <typename M>
  Fields& kinds(const KeyName& key, M member, std::vector<Alternative<Value<M>>> kinds,
                const char* sentence);
  /// Keys that are read together by a function of their own.
  Fields& custom(std::vector<Key> keys, std::function<void(TableReader&, T&)> read,
                 std::function<void(const T&, Node::Table&)> write) {
    fields_.push_back({std::move(keys), std::move(read), std::move(write)});
    return *this;
  }
  /// What the keys before it ask of each other.
  Fields& check(std::function<void(TableReader&, T&)> read) {
    return custom({}, std::move(read), [](const T&, Node::Table&) {});
  }
  /// Sets what follows from the keys before it.
  Fields& then(std::function<void(T&)> set) {
    return check([set = std::move(set)](TableReader&, T& to) { set(to); });
  }
  /// Keys that this table has only where the keys before them say so.
  Fields& where(std::function<bool(const T&)> holds, Fields own);
  /// The last key may be a table in a file of its own.
  Fields& or_file() {
    fields_.back().keys.back().or_file = true;
    return *this;
  }

  /// Sets the members of `start` whose keys are there; other keys are left to `close`.
  T read(TableReader& reader) const { return read(reader, usual_); }
  T read(TableReader& reader, T start) const {
    for (const Field& field : fields_) field.read(reader, start);
    return start;
  }
  /// Reads a table whole: a key that is not of it is refused.
  T read_table(const Node& table, const std::string& where, Faults& faults) const {
    return read_table(table, where, faults, usual_);
  }
  T read_table(const Node& table, const std::string& where, Faults& faults, T start) const {
    TableReader reader(table, where, faults);
    T value = read(reader, std::move(start));
    reader.close();
    return value;
  }
  /// The table that gives this value, every key but those that hold nothing.
  Node::Table written(const T& value) const {
    Node::Table table;
    for (const Field& field : fields_) field.write(value, table);
    return table;
  }
  std::vector<Key> keys() const {
    std::vector<Key> all;
    for (const Field& field : fields_) all.insert(all.end(), field.keys.begin(), field.keys.end());
    return all;
  }

 private:
  Fields& add(const std::shared_ptr<Key>& key, std::function<void(TableReader&, T&)> read,
              std::function<void(const T&, Node::Table&)> write) {
    return custom(std::vector<Key>(1, *key), std::move(read), std::move(write));
  }
  template <typename M>
  Fields& add_number(const KeyName& key, M member, const Range& range, const char* sentence,
                     double unit);

  T usual_{};
  std::vector<Field> fields_;
};

/// An alternative A of the variant V, whose keys stand beside the word.
template <typename V, typename A>
Alternative<V> alternative(const char* word, Fields<A> fields, const char* sentence = "") {
  Word named{word, sentence, fields.keys()};
  const auto all = std::make_shared<const Fields<A>>(std::move(fields));
  return {std::move(named), [all](TableReader& reader) -> V { return all->read(reader); },
          [all](const V& value, Node::Table& table) {
            const A* own = std::get_if<A>(&value);
            if (!own) return false;
            put_all(table, all->written(*own));
            return true;
          }};
}

}  // namespace abbe::sim

#include "sim/scene/fields_definitions.h"
