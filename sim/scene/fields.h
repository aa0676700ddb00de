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

#include "kinematics/chain.h"
#include "kinematics/pose.h"
#include "sim/scene/table_reader.h"

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
Key make_field_key(const KeyName& name, Key::Kind kind, const char* sentence,
                   std::vector<Key> keys = {});
/// The key of `size` numbers, 0: any
Key make_numbers_key(const KeyName& name, int size, const char* sentence);

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
void append_entries(Node::Table& table, Node::Table entries);

/// The member of a table whose keys set the value itself.
inline constexpr auto itself = [](auto& value) -> auto& { return value; };

/// Makes the keys that words bring known without reading them.
void accept_keys(TableReader& reader, const std::vector<Word>& words);

/// A number of the key's unit as documents show it, 12 digits; empty for one without end.
std::string default_text(double value);
std::string default_text(const Eigen::VectorXd& values);

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
        {make_field_key(key, Key::Kind::Text, sentence)},
        [key](TableReader& reader, T&) { reader.text(key.name, ""); },
        [](const T&, Node::Table&) {});
  }
  /// A value that a word stands for. The first word is read on where a required one is missing.
  template <typename M>
  struct EnumValue {
    const char* word;
    Value<M> value;
    const char* sentence = "";
  };
  template <typename M>
  Fields& word(const KeyName& key, M member, std::vector<EnumValue<M>> words, const char* sentence);
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
  T read_table(const Node& table, const std::string& where, InputErrors& input_errors) const {
    return read_table(table, where, input_errors, usual_);
  }
  T read_table(const Node& table, const std::string& where, InputErrors& input_errors,
               T start) const {
    TableReader reader(table, where, input_errors);
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
            append_entries(table, all->written(*own));
            return true;
          }};
}

// What the templates of `Fields` do. Only `fields.h` includes this, at its end.

std::set<std::string> words_of(const Key& key);

/// What the functions of a field hold in common: a copy of the field is a copy of a pointer, not of
/// every list below it.
template <typename V>
std::shared_ptr<const V> shared(V value) {
  return std::make_shared<const V>(std::move(value));
}
/// The keys, all the way down, whose `unit` may also be another: the pattern of "value_um" becomes
/// "value_(um|urad)".
std::vector<Key> with_other_unit(std::vector<Key> keys, const std::string& unit,
                                 const std::string& other);

/// Puts a list of tables, one for each value, unless there is none.
template <typename U>
void put_tables(Node::Table& table, const std::string& key, const std::vector<U>& values,
                const Fields<U>& fields) {
  Node::Array all;
  for (const U& one : values) all.push_back(Node{{}, fields.written(one)});
  if (!all.empty()) put(table, key, std::move(all));
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::add_number(const KeyName& name, M member, const Range& range,
                                 const char* sentence, double unit) {
  using V = Value<M>;
  const auto key = std::make_shared<Key>(make_field_key(name, Key::Kind::Number, sentence));
  key->range = range;
  if constexpr (!fields_detail::is_optional<V>::value) {
    if (!key->required && key->fallback.empty())
      key->fallback = default_text(std::invoke(member, usual_) / unit);
  }
  const auto read = [key, member, unit](TableReader& reader, T& to) {
    const auto written = reader.number_as_written(key->name, key->range);
    if (key->required && !reader.has(key->name)) reader.missing(key->name, "a number");
    if (written)
      std::invoke(member, to) = *written * unit;
    else if (key->required)
      std::invoke(member, to) = 1.0;  // harmless, so that reading goes on to the next fault
  };
  const auto write = [key, member, unit](const T& from, Node::Table& to) {
    if constexpr (fields_detail::is_optional<V>::value) {
      if (std::invoke(member, from)) put(to, key->name, in_unit(*std::invoke(member, from), unit));
    } else if (std::isfinite(std::invoke(member, from))) {
      put(to, key->name, in_unit(std::invoke(member, from), unit));
    }
  };
  return add(key, read, write);
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::whole(const KeyName& name, M member, std::int64_t min, std::int64_t max,
                            const char* sentence) {
  using V = Value<M>;
  using Bare = typename fields_detail::bare<V>::type;
  const auto key = std::make_shared<Key>(make_field_key(name, Key::Kind::Whole, sentence));
  key->range = {double(min), double(max)};
  if constexpr (!fields_detail::is_optional<V>::value) {
    if (!key->required && key->fallback.empty())
      key->fallback = std::to_string(std::invoke(member, usual_));
  }
  const auto read = [key, member, min, max](TableReader& reader, T& to) {
    if (key->required && !reader.has(key->name)) reader.missing(key->name, "a whole number");
    if (const auto value = reader.maybe_integer(key->name, min, max))
      std::invoke(member, to) = Bare(*value);
  };
  const auto write = [key, member](const T& from, Node::Table& to) {
    if constexpr (fields_detail::is_optional<V>::value) {
      if (std::invoke(member, from)) put(to, key->name, std::int64_t(*std::invoke(member, from)));
    } else {
      put(to, key->name, std::int64_t(std::invoke(member, from)));
    }
  };
  return add(key, read, write);
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::boolean(const KeyName& name, M member, const char* sentence) {
  const auto key = std::make_shared<Key>(make_field_key(name, Key::Kind::Boolean, sentence));
  if (key->fallback.empty()) key->fallback = std::invoke(member, usual_) ? "true" : "false";
  return add(
      key,
      [key, member](TableReader& reader, T& to) {
        std::invoke(member, to) = reader.boolean(key->name, std::invoke(member, to));
      },
      [key, member](const T& from, Node::Table& to) {
        put(to, key->name, bool(std::invoke(member, from)));
      });
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::text(const KeyName& name, M member, const char* sentence) {
  const auto key = std::make_shared<Key>(make_field_key(name, Key::Kind::Text, sentence));
  if (key->fallback.empty()) key->fallback = std::string(std::invoke(member, usual_));
  return add(
      key,
      [key, member](TableReader& reader, T& to) {
        if (key->required && !reader.has(key->name)) reader.missing(key->name, "a text");
        std::invoke(member, to) = reader.text(key->name, std::string(std::invoke(member, to)));
      },
      [key, member](const T& from, Node::Table& to) {
        const std::string text(std::invoke(member, from));
        if (!text.empty()) put(to, key->name, text);
      });
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::texts(const KeyName& name, M member, const char* sentence) {
  const auto key = std::make_shared<Key>(make_field_key(name, Key::Kind::Texts, sentence));
  return add(
      key,
      [key, member](TableReader& reader, T& to) {
        if (reader.know(key->name)) std::invoke(member, to) = reader.texts(key->name);
      },
      [key, member](const T& from, Node::Table& to) {
        Node::Array all;
        for (const std::string& one : std::invoke(member, from)) all.push_back(Node{{}, one});
        if (!all.empty()) put(to, key->name, std::move(all));
      });
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::word(const KeyName& name, M member, std::vector<EnumValue<M>> words,
                           const char* sentence) {
  const auto key = std::make_shared<Key>(make_field_key(name, Key::Kind::Text, sentence));
  for (const EnumValue<M>& one : words) {
    key->words.push_back({one.word, one.sentence, {}});
    if (!key->required && key->fallback.empty() && one.value == std::invoke(member, usual_))
      key->fallback = one.word;
  }
  return add(
      key,
      [key, member, words](TableReader& reader, T& to) {
        const std::optional<std::string> seen =
            reader.word(key->name, words_of(*key), key->required);
        if (!seen && key->required) std::invoke(member, to) = words.front().value;
        for (const EnumValue<M>& one : words)
          if (seen == one.word) std::invoke(member, to) = one.value;
      },
      [key, member, words](const T& from, Node::Table& to) {
        for (const EnumValue<M>& one : words)
          if (one.value == std::invoke(member, from))
            return put(to, key->name, std::string(one.word));
      });
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::vector(const KeyName& name, M member, const char* sentence) {
  return numbers(name, member, 3, sentence);
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::direction(const KeyName& name, M member, const char* sentence) {
  const auto key = std::make_shared<Key>(make_numbers_key(name, 3, sentence));
  if (!key->required && key->fallback.empty())
    key->fallback = default_text(Eigen::VectorXd(std::invoke(member, usual_)));
  return add(
      key,
      [key, member](TableReader& reader, T& to) {
        std::invoke(member, to) = key->required
                                      ? reader.direction(key->name)
                                      : reader.direction(key->name, std::invoke(member, to));
      },
      [key, member](const T& from, Node::Table& to) {
        const Eigen::Vector3d direction = std::invoke(member, from);
        put_numbers(to, key->name, direction.normalized(), 1.0);
      });
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::numbers(const KeyName& name, M member, int size, const char* sentence) {
  using V = Value<M>;
  const auto key = std::make_shared<Key>(make_numbers_key(name, size, sentence));
  if constexpr (!fields_detail::is_optional<V>::value) {
    if (!key->required && key->fallback.empty())
      key->fallback =
          default_text(Eigen::VectorXd(std::invoke(member, usual_)) / unit_of(name.name));
  }
  return add(
      key,
      [key, member](TableReader& reader, T& to) {
        if (key->required)
          std::invoke(member, to) = reader.numbers(key->name, key->size);
        else if (const auto values = reader.maybe_numbers(key->name, key->size))
          std::invoke(member, to) = *values;
      },
      [key, member](const T& from, Node::Table& to) {
        if constexpr (fields_detail::is_optional<V>::value) {
          if (std::invoke(member, from))
            put_numbers(to, key->name, *std::invoke(member, from), unit_of(key->name));
        } else {
          put_numbers(to, key->name, std::invoke(member, from), unit_of(key->name));
        }
      });
}

template <typename T>
template <typename M, typename U>
Fields<T>& Fields<T>::table(const KeyName& name, M member, Fields<U> fields, const char* sentence) {
  using V = Value<M>;
  const auto own = shared(std::move(fields));
  const auto key =
      std::make_shared<Key>(make_field_key(name, Key::Kind::Table, sentence, own->keys()));
  return add(
      key,
      [key, member, own](TableReader& reader, T& to) {
        const Node* node = reader.section(key->name);
        if (!node && key->required && !reader.has(key->name)) reader.missing(key->name, "a table");
        if (!node) return;
        const std::string where = reader.name_of(key->name);
        if constexpr (fields_detail::is_optional<V>::value)
          std::invoke(member, to) = own->read_table(*node, where, reader.input_errors());
        else
          std::invoke(member, to) =
              own->read_table(*node, where, reader.input_errors(), std::invoke(member, to));
      },
      [key, member, own](const T& from, Node::Table& to) {
        if constexpr (fields_detail::is_optional<V>::value) {
          if (std::invoke(member, from))
            put(to, key->name, own->written(*std::invoke(member, from)));
        } else if (Node::Table entries = own->written(std::invoke(member, from));
                   !entries.empty()) {
          put(to, key->name, std::move(entries));
        }
      });
}

template <typename T>
template <typename M, typename U>
Fields<T>& Fields<T>::tables(const KeyName& name, M member, Fields<U> fields,
                             const char* sentence) {
  const auto own = shared(fields);
  const auto read = [key = name.name, required = name.required, member, own](TableReader& reader,
                                                                             T& to) {
    if (required && !reader.has(key)) reader.missing(key, "a list of tables");
    for (const Node* node : reader.tables(key))
      std::invoke(member, to)
          .push_back(own->read_table(*node, reader.name_of(key), reader.input_errors()));
  };
  return tables(name, member, std::move(fields), sentence, read);
}

template <typename T>
template <typename M, typename U>
Fields<T>& Fields<T>::tables(const KeyName& name, M member, Fields<U> fields, const char* sentence,
                             std::function<void(TableReader&, T&)> read) {
  const auto own = shared(std::move(fields));
  const auto key =
      std::make_shared<Key>(make_field_key(name, Key::Kind::Tables, sentence, own->keys()));
  return add(key, std::move(read), [key, member, own](const T& from, Node::Table& to) {
    put_tables(to, key->name, std::invoke(member, from), *own);
  });
}

template <typename T>
template <typename M, typename U>
Fields<T>& Fields<T>::all_of(M member, Fields<U> fields) {
  const auto own = shared(std::move(fields));
  return custom(
      own->keys(),
      [member, own](TableReader& reader, T& to) {
        std::invoke(member, to) = own->read(reader, std::invoke(member, to));
      },
      [member, own](const T& from, Node::Table& to) {
        append_entries(to, own->written(std::invoke(member, from)));
      });
}

template <typename T>
Fields<T>& Fields<T>::where(std::function<bool(const T&)> holds, Fields fields) {
  const auto own = shared(std::move(fields));
  std::vector<Key> keys = own->keys();
  for (Key& key : keys) key.required = false;
  return custom(
      std::move(keys),
      [holds, own](TableReader& reader, T& to) {
        if (holds(to)) to = own->read(reader, std::move(to));
      },
      [holds, own](const T& from, Node::Table& to) {
        if (holds(from)) append_entries(to, own->written(from));
      });
}

template <typename T>
template <typename M>
Fields<T>& Fields<T>::kinds(const KeyName& name, M member, std::vector<Alternative<Value<M>>> kinds,
                            const char* sentence) {
  const auto key = std::make_shared<Key>(make_field_key(name, Key::Kind::Text, sentence));
  for (const auto& one : kinds) key->words.push_back(one.word);
  const auto all = shared(std::move(kinds));
  return add(
      key,
      [key, member, all](TableReader& reader, T& to) {
        const auto given = reader.word(key->name, words_of(*key), key->required);
        // beside a word that is none nobody knows which keys are meant
        if (!given && reader.has(key->name)) return accept_keys(reader, key->words);
        const std::string word = given.value_or(key->words.front().word);
        for (const auto& one : *all)
          if (one.word.word == word) std::invoke(member, to) = one.read(reader);
      },
      [key, member, all](const T& from, Node::Table& to) {
        for (const auto& one : *all) {
          Node::Table own;
          if (!one.write(std::invoke(member, from), own)) continue;
          put(to, key->name, one.word.word);
          return append_entries(to, std::move(own));
        }
      });
}

/// `turn_deg`: a rotation vector in degrees; the identity where it is left out. Turns by multiples
/// of 90 degrees about one axis are exact.
const Fields<Eigen::Matrix3d>& turn_fields();
Eigen::Matrix3d read_turn(TableReader& reader);

/// Place of a thing in its parent: `at_mm` and `turn_deg`.
const Fields<kinematics::Pose>& placement_fields();

/// Positions of axes (joints) by words such as Z_mm and A_deg; those left out stand at zero.
/// @param joints  none where only the keys are wanted
Fields<kinematics::AxisVector> axis_position_fields(const std::vector<kinematics::Joint>& joints);
kinematics::AxisVector read_axis_positions(TableReader& reader,
                                           const std::vector<kinematics::Joint>& joints);

}  // namespace abbe::sim
