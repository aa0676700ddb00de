#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
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

/// The keys of a table and the members that they set, declared once: `Fields` reads a struct from a
/// table, writes it to a table and describes each key.
namespace abbe::sim {

/// Name of a key and the properties that do not follow from the member it sets.
struct KeyName {
  std::string name;
  bool required = false;
  std::string fallback;  ///< shown to people if it differs from the default of the struct
  std::string either;    ///< `Key::either`

  KeyName(const char* key) : name(key) {}
  KeyName(std::string key) : name(std::move(key)) {}
  KeyName otherwise(std::string text) const;  ///< with this fallback
  KeyName one_of(std::string group) const;    ///< with this `either`
};
/// Makes a key required.
KeyName must(KeyName key);

/// Makes the key of a name; the caller sets the members that belong to `kind`.
/// @param keys  of a table
Key make_key(const KeyName& name, Key::Kind kind, const char* sentence, std::vector<Key> keys = {});
/// Makes the key of `size` numbers; 0: any size.
Key make_numbers_key(const KeyName& name, int size, const char* sentence);

/// Puts `key = value` at the end of a table.
template <typename V>
void put(Node::Table& table, const std::string& key, V value) {
  table.push_back({key, {}, Node{{}, std::move(value)}});
}
/// Returns the value in a unit. The result times the unit has the bits of the value if any number
/// has this property; among such numbers one of at most 15 digits is preferred.
double in_unit(double value, double unit);
/// Puts numbers, each divided by the unit of the key, at the end of a table.
void put_numbers(Node::Table& table, const std::string& key, const Eigen::VectorXd& values,
                 double unit);

/// Puts the entries of another table at the end of a table.
void append_entries(Node::Table& table, Node::Table entries);

/// Selects the value itself where `Fields` takes a member.
inline constexpr auto itself = [](auto& value) -> auto& { return value; };

/// Marks the keys of enum values as known without reading them.
void accept_keys(TableReader& reader, const std::vector<Word>& words);

/// Names of the values that a key may have.
std::set<std::string> words_of(const Key& key);

/// Lets every key with `unit` in its name, nested keys included, have `other` instead: the pattern
/// of "value_um" becomes "value_(um|urad)".
std::vector<Key> with_other_unit(std::vector<Key> keys, const std::string& unit,
                                 const std::string& other);

/// A number in the unit of its key as documents show it, 12 digits; empty if it is infinite.
std::string default_text(double value);
std::string default_text(const Eigen::VectorXd& values);

/// One alternative of a variant V: the enum value that selects it, and its keys.
template <typename V>
struct Alternative {
  Word word;
  std::function<V(TableReader&)> read;
  /// Returns false and writes nothing if the variant holds another alternative.
  std::function<bool(const V&, Node::Table&)> write;
};

/// The part of `Fields` that does not depend on the struct. Structs and members are passed as
/// `void*`, so that each kind of field is compiled once; the `...Access` structs hold the few
/// operations that depend on the type of a member.
namespace fields_detail {

template <typename V>
inline constexpr bool is_optional = false;
template <typename V>
inline constexpr bool is_optional<std::optional<V>> = true;

template <typename V>
struct WithoutOptional {
  using type = V;
};
template <typename V>
struct WithoutOptional<std::optional<V>> {
  using type = V;
};

/// Returns the address of a member from the address of its struct.
using Member = std::function<void*(void*)>;

/// Reads and sets a `double` or an optional one.
struct NumberAccess {
  bool optional;
  std::optional<double> (*get)(const void* member);  ///< empty: not written
  void (*set)(void* member, double value);
};
template <typename V>
NumberAccess number_access() {
  return {is_optional<V>,
          [](const void* member) -> std::optional<double> {
            const V& value = *static_cast<const V*>(member);
            if constexpr (is_optional<V>)
              return value;
            else
              return std::isfinite(value) ? std::optional<double>(value) : std::nullopt;
          },
          [](void* member, double value) { *static_cast<V*>(member) = value; }};
}

/// Reads and sets any integer or an optional one.
struct IntegerAccess {
  bool optional;
  std::optional<std::int64_t> (*get)(const void* member);
  void (*set)(void* member, std::int64_t value);
};
template <typename V>
IntegerAccess integer_access() {
  using Integer = typename WithoutOptional<V>::type;
  static_assert(std::is_integral_v<Integer>);
  return {is_optional<V>,
          [](const void* member) -> std::optional<std::int64_t> {
            const V& value = *static_cast<const V*>(member);
            if constexpr (is_optional<V>)
              return value ? std::optional<std::int64_t>(*value) : std::nullopt;
            else
              return std::int64_t(value);
          },
          [](void* member, std::int64_t value) { *static_cast<V*>(member) = Integer(value); }};
}

/// Reads and sets a `std::string` or a path.
struct TextAccess {
  std::string (*get)(const void* member);
  void (*set)(void* member, std::string value);
};
template <typename V>
TextAccess text_access() {
  return {[](const void* member) { return std::string(*static_cast<const V*>(member)); },
          [](void* member, std::string value) { *static_cast<V*>(member) = std::move(value); }};
}

/// Reads and sets an Eigen vector of any size or an optional one.
struct VectorAccess {
  bool optional;
  std::optional<Eigen::VectorXd> (*get)(const void* member);
  void (*set)(void* member, const Eigen::VectorXd& value);
};
template <typename V>
VectorAccess vector_access() {
  using Vector = typename WithoutOptional<V>::type;
  return {
      is_optional<V>,
      [](const void* member) -> std::optional<Eigen::VectorXd> {
        const V& value = *static_cast<const V*>(member);
        if constexpr (is_optional<V>)
          return value ? std::optional<Eigen::VectorXd>(*value) : std::nullopt;
        else
          return Eigen::VectorXd(value);
      },
      [](void* member, const Eigen::VectorXd& value) { *static_cast<V*>(member) = Vector(value); }};
}

/// Name and description of an enum value, and the value.
template <typename V>
struct EnumValue {
  const char* word;
  V value;
  const char* sentence = "";
};
struct EnumLabel {
  const char* word;
  const char* sentence;
};

/// Reads and sets a value by its index in a list of enum values.
struct EnumAccess {
  std::vector<EnumLabel> labels;
  std::function<std::optional<std::size_t>(const void* member)> get;  ///< the first that is equal
  std::function<void(void* member, std::size_t index)> set;
};
template <typename V>
EnumAccess enum_access(std::vector<EnumValue<V>> enum_values) {
  std::vector<EnumLabel> labels;
  for (const EnumValue<V>& enum_value : enum_values)
    labels.push_back({enum_value.word, enum_value.sentence});
  const auto shared_values =
      std::make_shared<const std::vector<EnumValue<V>>>(std::move(enum_values));
  return {std::move(labels),
          [shared_values](const void* member) -> std::optional<std::size_t> {
            const V& value = *static_cast<const V*>(member);
            for (std::size_t i = 0; i < shared_values->size(); ++i)
              if ((*shared_values)[i].value == value) return i;
            return std::nullopt;
          },
          [shared_values](void* member, std::size_t index) {
            *static_cast<V*>(member) = (*shared_values)[index].value;
          }};
}

/// Finds and makes the struct of a section, which is the member or stands in an optional.
struct TableAccess {
  bool optional;
  const void* (*get)(const void* member);  ///< null if the optional is empty
  /// Returns the struct to read into: the member as it is, or the optional filled with `initial`.
  void* (*make)(void* member, const void* initial);
};
template <typename V>
TableAccess table_access() {
  using Struct = typename WithoutOptional<V>::type;
  return {is_optional<V>,
          [](const void* member) -> const void* {
            if constexpr (is_optional<V>) {
              const V& value = *static_cast<const V*>(member);
              return value ? std::addressof(*value) : nullptr;
            } else {
              return member;
            }
          },
          [](void* member, [[maybe_unused]] const void* initial) -> void* {
            if constexpr (is_optional<V>) {
              V& value = *static_cast<V*>(member);
              value = *static_cast<const Struct*>(initial);
              return std::addressof(*value);
            } else {
              return member;
            }
          }};
}

/// Reads and extends a `std::vector` of structs.
struct ListAccess {
  std::size_t (*size)(const void* list);
  const void* (*get)(const void* list, std::size_t index);
  void* (*append)(void* list, const void* initial);  ///< returns the new struct
};
template <typename U>
ListAccess list_access() {
  return {[](const void* list) { return static_cast<const std::vector<U>*>(list)->size(); },
          [](const void* list, std::size_t index) -> const void* {
            return std::addressof((*static_cast<const std::vector<U>*>(list))[index]);
          },
          [](void* list, const void* initial) -> void* {
            auto& structs = *static_cast<std::vector<U>*>(list);
            structs.push_back(*static_cast<const U*>(initial));
            return std::addressof(structs.back());
          }};
}

/// `Alternative` of a variant whose type is not known.
struct AlternativeAccess {
  Word word;
  std::function<void(TableReader&, void* variant)> read;
  std::function<bool(const void* variant, Node::Table&)> write;
};
template <typename V>
std::vector<AlternativeAccess> alternative_access(std::vector<Alternative<V>> alternatives) {
  std::vector<AlternativeAccess> accesses;
  accesses.reserve(alternatives.size());
  for (Alternative<V>& alternative : alternatives)
    accesses.push_back(
        {std::move(alternative.word),
         [read = std::move(alternative.read)](TableReader& reader, void* variant) {
           *static_cast<V*>(variant) = read(reader);
         },
         [write = std::move(alternative.write)](const void* variant, Node::Table& table) {
           return write(*static_cast<const V*>(variant), table);
         }});
  return accesses;
}

/// Fields of a struct whose type is not known; `to` and `from` are its address.
class FieldList {
 public:
  using Read = std::function<void(TableReader&, void*)>;
  using Write = std::function<void(const void*, Node::Table&)>;

  // defined in fields.cpp: inline they would be repeated wherever a `Fields` is passed on
  FieldList(const FieldList& other);
  FieldList(FieldList&& other) noexcept;
  FieldList& operator=(const FieldList& other);
  FieldList& operator=(FieldList&& other) noexcept;
  ~FieldList();

  std::vector<Key> keys() const;

 protected:
  explicit FieldList(std::shared_ptr<const void> initial);

  const void* initial() const { return initial_.get(); }
  void read_into(TableReader& reader, void* to) const;
  void read_table_into(const Node& table, const std::string& where, InputErrors& input_errors,
                       void* to) const;
  Node::Table written_from(const void* from) const;

  /// @param write  may be empty
  void add(std::vector<Key>&& keys, Read&& read, Write&& write);
  void add_number(const KeyName& name, Member member, const NumberAccess& access,
                  const Range& range, const char* sentence, double unit);
  void add_integer(const KeyName& name, Member member, const IntegerAccess& access,
                   std::int64_t min, std::int64_t max, const char* sentence);
  void add_boolean(const KeyName& name, Member member, const char* sentence);
  void add_text(const KeyName& name, Member member, const TextAccess& access, const char* sentence);
  void add_texts(const KeyName& name, Member member, const char* sentence);
  void add_remark(const KeyName& name, const char* sentence);
  void add_enum(const KeyName& name, Member member, EnumAccess access, const char* sentence);
  void add_direction(const KeyName& name, Member member, const char* sentence);
  void add_numbers(const KeyName& name, Member member, const VectorAccess& access, int size,
                   const char* sentence);
  // `Fields` has no data of its own, so that the fields of a nested struct are passed as their base
  void add_table(const KeyName& name, Member member, const TableAccess& access, FieldList nested,
                 const char* sentence);
  /// @param read  empty: every table of the list gives a struct
  void add_tables(const KeyName& name, Member member, const ListAccess& access, FieldList nested,
                  const char* sentence, Read read);
  void add_all(Member member, FieldList nested);
  void add_conditional(std::function<bool(const void*)> condition, FieldList conditional);
  void add_alternatives(const KeyName& name, Member member,
                        std::vector<AlternativeAccess> alternatives, const char* sentence);

 private:
  struct Field {
    std::vector<Key> keys;
    Read read;
    Write write;
  };

  std::shared_ptr<const void> initial_;
  std::vector<Field> fields_;
};

}  // namespace fields_detail

/// Keys of a table in the order in which they are read. Members are pointers to members or
/// functions `(T&) -> M&`; a member keeps its value if its key is left out.
template <typename T>
class Fields : public fields_detail::FieldList {
 public:
  /// One key, or several that are read together.
  struct Field {
    std::vector<Key> keys;
    std::function<void(TableReader&, T&)> read;
    std::function<void(const T&, Node::Table&)> write;
  };
  template <typename M>
  using Value = std::remove_cvref_t<std::invoke_result_t<M, T&>>;

  // in place: moving a struct that leaves an Eigen vector uninitialized is a warning of GCC
  Fields() : FieldList(std::make_shared<const T>()) {}
  /// @param initial  value if every key is left out
  explicit Fields(T initial) : FieldList(std::make_shared<const T>(std::move(initial))) {}

  /// double in mm, rad, s, N, K; an optional one has no fallback
  template <typename M>
  Fields& number(const KeyName& key, M member, const Range& range, const char* sentence) {
    return number_in(unit_of(key.name), key, std::move(member), range, sentence);
  }
  /// double in the unit of its key
  template <typename M>
  Fields& number_as_written(const KeyName& key, M member, const Range& range,
                            const char* sentence) {
    return number_in(1.0, key, std::move(member), range, sentence);
  }
  /// double, times a unit that does not follow from the key: "um_per_K" is a unit from end to end
  template <typename M>
  Fields& number_in(double unit, const KeyName& key, M member, const Range& range,
                    const char* sentence) {
    add_number(key, untyped(std::move(member)), fields_detail::number_access<Value<M>>(), range,
               sentence, unit);
    return *this;
  }
  /// any integer from min to max, or an optional one
  template <typename M>
  Fields& whole(const KeyName& key, M member, std::int64_t min, std::int64_t max,
                const char* sentence) {
    add_integer(key, untyped(std::move(member)), fields_detail::integer_access<Value<M>>(), min,
                max, sentence);
    return *this;
  }
  template <typename M>
  Fields& boolean(const KeyName& key, M member, const char* sentence) {
    static_assert(std::is_same_v<Value<M>, bool>);
    add_boolean(key, untyped(std::move(member)), sentence);
    return *this;
  }
  /// std::string or path, not empty if it is given
  template <typename M>
  Fields& text(const KeyName& key, M member, const char* sentence) {
    add_text(key, untyped(std::move(member)), fields_detail::text_access<Value<M>>(), sentence);
    return *this;
  }
  /// std::vector<std::string>
  template <typename M>
  Fields& texts(const KeyName& key, M member, const char* sentence) {
    static_assert(std::is_same_v<Value<M>, std::vector<std::string>>);
    add_texts(key, untyped(std::move(member)), sentence);
    return *this;
  }
  /// A text for people, which is read and not kept.
  Fields& remark(const KeyName& key, const char* sentence) {
    add_remark(key, sentence);
    return *this;
  }
  /// A value of a list. A required one that is missing or wrong is read as the first of the list.
  template <typename M>
  Fields& word(const KeyName& key, M member,
               std::vector<fields_detail::EnumValue<Value<M>>> enum_values, const char* sentence) {
    add_enum(key, untyped(std::move(member)), fields_detail::enum_access(std::move(enum_values)),
             sentence);
    return *this;
  }
  /// Eigen::Vector3d
  template <typename M>
  Fields& vector(const KeyName& key, M member, const char* sentence) {
    return numbers(key, std::move(member), 3, sentence);
  }
  /// Eigen::Vector3d, normalized
  template <typename M>
  Fields& direction(const KeyName& key, M member, const char* sentence) {
    static_assert(std::is_same_v<Value<M>, Eigen::Vector3d>);
    add_direction(key, untyped(std::move(member)), sentence);
    return *this;
  }
  /// A vector of `size` numbers, 0: any; or an optional one
  template <typename M>
  Fields& numbers(const KeyName& key, M member, int size, const char* sentence) {
    add_numbers(key, untyped(std::move(member)), fields_detail::vector_access<Value<M>>(), size,
                sentence);
    return *this;
  }
  /// A section: U, or an optional one that is filled if the section is there
  template <typename M, typename U>
  Fields& table(const KeyName& key, M member, Fields<U> fields, const char* sentence) {
    static_assert(std::is_same_v<typename fields_detail::WithoutOptional<Value<M>>::type, U>);
    add_table(key, untyped(std::move(member)), fields_detail::table_access<Value<M>>(),
              std::move(fields), sentence);
    return *this;
  }
  /// std::vector<U>, one for every table of a list
  /// @param read  reads the list instead, if given: a table may depend on those before it
  template <typename M, typename U>
  Fields& tables(const KeyName& key, M member, Fields<U> fields, const char* sentence,
                 std::function<void(TableReader&, T&)> read = {}) {
    static_assert(std::is_same_v<Value<M>, std::vector<U>>);
    add_tables(key, untyped(std::move(member)), fields_detail::list_access<U>(), std::move(fields),
               sentence, untyped_read(std::move(read)));
    return *this;
  }
  /// A member whose own keys stand in this table.
  template <typename M, typename U>
  Fields& all_of(M member, Fields<U> fields) {
    static_assert(std::is_same_v<Value<M>, U>);
    add_all(untyped(std::move(member)), std::move(fields));
    return *this;
  }
  /// A variant whose alternative is selected by a key. The first alternative is read if the key is
  /// missing; none is read if its value is wrong.
  template <typename M>
  Fields& kinds(const KeyName& key, M member, std::vector<Alternative<Value<M>>> alternatives,
                const char* sentence) {
    add_alternatives(key, untyped(std::move(member)),
                     fields_detail::alternative_access(std::move(alternatives)), sentence);
    return *this;
  }
  /// Keys that are read together by a function of their own.
  Fields& custom(std::vector<Key> keys, std::function<void(TableReader&, T&)> read,
                 std::function<void(const T&, Node::Table&)> write) {
    add(std::move(keys), untyped_read(std::move(read)),
        [write = std::move(write)](const void* from, Node::Table& table) {
          write(*static_cast<const T*>(from), table);
        });
    return *this;
  }
  /// Checks the keys before it against each other.
  Fields& check(std::function<void(TableReader&, T&)> read) {
    add({}, untyped_read(std::move(read)), {});
    return *this;
  }
  /// Sets members that follow from the keys before it.
  Fields& then(std::function<void(T&)> set) {
    add({}, [set = std::move(set)](TableReader&, void* to) { set(*static_cast<T*>(to)); }, {});
    return *this;
  }
  /// Keys that this table has only if the keys before them meet a condition.
  Fields& where(std::function<bool(const T&)> condition, Fields fields) {
    add_conditional([condition = std::move(condition)](
                        const void* value) { return condition(*static_cast<const T*>(value)); },
                    std::move(fields));
    return *this;
  }

  /// Sets the members of `start` whose keys are there; `TableReader::close` reports other keys.
  T read(TableReader& reader) const { return read(reader, initial_value()); }
  T read(TableReader& reader, T start) const {
    read_into(reader, std::addressof(start));
    return start;
  }
  /// Reads a whole table: an unknown key is an input error.
  T read_table(const Node& table, const std::string& where, InputErrors& input_errors) const {
    return read_table(table, where, input_errors, initial_value());
  }
  T read_table(const Node& table, const std::string& where, InputErrors& input_errors,
               T start) const {
    read_table_into(table, where, input_errors, std::addressof(start));
    return start;
  }
  /// Returns the table that gives this value, without the keys of empty members.
  Node::Table written(const T& value) const { return written_from(std::addressof(value)); }

 private:
  template <typename M>
  static fields_detail::Member untyped(M member) {
    return [member = std::move(member)](void* value) -> void* {
      return std::addressof(std::invoke(member, *static_cast<T*>(value)));
    };
  }
  static Read untyped_read(std::function<void(TableReader&, T&)> read) {
    if (!read) return {};
    return [read = std::move(read)](TableReader& reader, void* to) {
      read(reader, *static_cast<T*>(to));
    };
  }
  const T& initial_value() const { return *static_cast<const T*>(initial()); }
};

/// An alternative A of the variant V, whose keys stand in the same table as the key that selects
/// it.
template <typename V, typename A>
Alternative<V> alternative(const char* word, Fields<A> fields, const char* sentence = "") {
  Word enum_value{word, sentence, fields.keys()};
  const auto shared_fields = std::make_shared<const Fields<A>>(std::move(fields));
  return {std::move(enum_value),
          [shared_fields](TableReader& reader) -> V { return shared_fields->read(reader); },
          [shared_fields](const V& value, Node::Table& table) {
            const A* held = std::get_if<A>(&value);
            if (!held) return false;
            append_entries(table, shared_fields->written(*held));
            return true;
          }};
}

/// Puts a list of tables, one for each value, at the end of a table, unless there is no value.
template <typename U>
void put_tables(Node::Table& table, const std::string& key, const std::vector<U>& values,
                const Fields<U>& fields) {
  Node::Array tables;
  for (const U& value : values) tables.push_back(Node{{}, fields.written(value)});
  if (!tables.empty()) put(table, key, std::move(tables));
}

/// `turn_deg`: a rotation vector in degrees; the identity if it is left out. Turns by multiples of
/// 90 degrees about one axis are exact.
const Fields<Eigen::Matrix3d>& turn_fields();
Eigen::Matrix3d read_turn(TableReader& reader);

/// Pose of a body in its parent: `at_mm` and `turn_deg`.
const Fields<kinematics::Pose>& placement_fields();

/// Positions of axes (joints) by keys such as Z_mm and A_deg; an axis that is left out stands at
/// zero.
/// @param joints  empty if only the keys are needed
Fields<kinematics::AxisVector> axis_position_fields(const std::vector<kinematics::Joint>& joints);
kinematics::AxisVector read_axis_positions(TableReader& reader,
                                           const std::vector<kinematics::Joint>& joints);

}  // namespace abbe::sim
