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

/// `Fields` declares the keys of a TOML table and the members of a struct that they set. From one
/// declaration it reads the struct from a table, writes it to a table and describes each key.
namespace abbe::sim {

/// Name of a key, with the properties that do not follow from the type of its member.
struct KeyName {
  std::string name;
  bool required = false;
  std::string fallback;         ///< default in words, if it is not that of the struct
  std::string exclusive_group;  ///< `Key::exclusive_group`

  KeyName(const char* key) : name(key) {}
  KeyName(std::string key) : name(std::move(key)) {}
  KeyName with_fallback(std::string text) const;        ///< a copy with a default in words
  KeyName in_exclusive_group(std::string group) const;  ///< a copy in the group
};
/// Makes a key required.
KeyName required_key(KeyName key);

/// Returns the description of a key. The caller sets the members that only some kinds have.
/// @param keys  keys of the table, for kinds of tables
Key make_key(const KeyName& name, Key::Kind kind, const char* sentence, std::vector<Key> keys = {});
/// Returns the description of a key for `size` numbers; 0 for any size.
Key make_numbers_key(const KeyName& name, int size, const char* sentence);

/// Appends `key = value` to a table.
template <typename V>
void put_value(Node::Table& table, const std::string& key, V value) {
  table.push_back({key, {}, Node{{}, std::move(value)}});
}
/// Returns value / unit, adjusted so that the result times the unit gives the same bits again if
/// any number does. Among such numbers, one of at most 15 digits is preferred.
double in_unit(double value, double unit);
/// Appends an array of numbers, each divided by the unit of the key, to a table.
void put_numbers(Node::Table& table, const std::string& key, const Eigen::VectorXd& values,
                 double unit);

/// Appends the entries of another table to a table.
void append_entries(Node::Table& table, Node::Table entries);

/// Selects the whole struct where `Fields` takes a member.
inline constexpr auto whole_struct = [](auto& value) -> auto& { return value; };

/// Returns the enum values of a key.
std::set<std::string> choice_names(const Key& key);

/// Allows every key with `unit` in its name, nested keys included, to have `other` instead: the
/// pattern of "value_um" becomes "value_(um|urad)".
std::vector<Key> allow_other_unit(std::vector<Key> keys, const std::string& unit,
                                  const std::string& other);

/// One alternative of a variant V: the enum value that selects it, and its keys.
template <typename V>
struct Alternative {
  EnumChoice selector;
  std::function<V(TableReader&)> read;
  /// Returns false and writes nothing if the variant holds another alternative.
  std::function<bool(const V&, Node::Table&)> write;
};

/// The part of `Fields` that does not depend on the struct. Structs and members are passed as
/// `void*`, so that each kind of field is compiled once and not for every struct. The `...Access`
/// structs hold the few operations that depend on the type of a member.
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

/// Maps the address of a struct to the address of one of its members.
using Member = std::function<void*(void*)>;

/// Gets and sets a `double` or an optional one.
struct NumberAccess {
  bool optional;
  std::optional<double> (*get)(const void* member);  ///< empty for a value that is not written
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

/// Gets and sets any integer or an optional one.
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

/// Gets and sets a `std::string` or a path.
struct TextAccess {
  std::string (*get)(const void* member);
  void (*set)(void* member, std::string value);
};
template <typename V>
TextAccess text_access() {
  return {[](const void* member) { return std::string(*static_cast<const V*>(member)); },
          [](void* member, std::string value) { *static_cast<V*>(member) = std::move(value); }};
}

/// Gets and sets an Eigen vector of any size or an optional one.
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

/// An enum value with its name and description.
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

/// Gets and sets an enum value by its index in a list.
struct EnumAccess {
  std::vector<EnumLabel> labels;
  std::function<std::optional<std::size_t>(const void* member)> get;  ///< the first equal value
  std::function<void(void* member, std::size_t index)> set;
};
template <typename V>
EnumAccess enum_access(std::vector<EnumValue<V>> labelled_values) {
  std::vector<EnumLabel> labels;
  for (const EnumValue<V>& labelled_value : labelled_values)
    labels.push_back({labelled_value.word, labelled_value.sentence});
  const auto shared_values =
      std::make_shared<const std::vector<EnumValue<V>>>(std::move(labelled_values));
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

/// Gets and creates the struct of a section. The member is the struct or an optional one.
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

/// Gets and appends the structs of a `std::vector`.
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

/// An `Alternative` without the type of its variant.
struct AlternativeAccess {
  EnumChoice selector;
  std::function<void(TableReader&, void* variant)> read;
  std::function<bool(const void* variant, Node::Table&)> write;
};
template <typename V>
std::vector<AlternativeAccess> alternative_access(std::vector<Alternative<V>> alternatives) {
  std::vector<AlternativeAccess> accesses;
  accesses.reserve(alternatives.size());
  for (Alternative<V>& alternative : alternatives)
    accesses.push_back(
        {std::move(alternative.selector),
         [read = std::move(alternative.read)](TableReader& reader, void* variant) {
           *static_cast<V*>(variant) = read(reader);
         },
         [write = std::move(alternative.write)](const void* variant, Node::Table& table) {
           return write(*static_cast<const V*>(variant), table);
         }});
  return accesses;
}

/// Fields without the type of their struct; the parameters `target` and `source` are its address.
class FieldList {
 public:
  using Read = std::function<void(TableReader&, void*)>;
  using Write = std::function<void(const void*, Node::Table&)>;

  // Defined in fields.cpp, because inline copies would appear wherever a `Fields` is passed on.
  FieldList(const FieldList& other);
  FieldList(FieldList&& other) noexcept;
  FieldList& operator=(const FieldList& other);
  FieldList& operator=(FieldList&& other) noexcept;
  ~FieldList();

  std::vector<Key> keys() const;

 protected:
  explicit FieldList(std::shared_ptr<const void> initial);

  const void* initial() const { return initial_.get(); }
  void read_into(TableReader& reader, void* target) const;
  void read_table_into(const Node& table, const std::string& section_name,
                       InputErrors& input_errors, void* target) const;
  Node::Table table_from(const void* source) const;

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
  // The fields of a nested struct are passed as their base class, as `Fields` has no data members.
  void add_table(const KeyName& name, Member member, const TableAccess& access, FieldList nested,
                 const char* sentence);
  /// @param read  reads the list; if it is empty, every table of the list gives one struct
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

/// Declares the keys of a table in the order in which they are read. Each function below adds one
/// kind of field. A `member` is a pointer to a member or a function `(T&) -> M&`; it keeps its
/// value if its key is missing.
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

  // Constructed in place, because GCC warns of the move of an uninitialized Eigen vector.
  Fields() : FieldList(std::make_shared<const T>()) {}
  /// @param initial  the value if all keys are missing
  explicit Fields(T initial) : FieldList(std::make_shared<const T>(std::move(initial))) {}

  /// Adds a double in mm, rad, s, N, K; an optional one has no fallback.
  template <typename M>
  Fields& number(const KeyName& key, M member, const Range& range, const char* sentence) {
    return number_in(unit_factor(key.name), key, std::move(member), range, sentence);
  }
  /// Adds a double in the unit of its key.
  template <typename M>
  Fields& number_as_written(const KeyName& key, M member, const Range& range,
                            const char* sentence) {
    return number_in(1.0, key, std::move(member), range, sentence);
  }
  /// Adds a double with a given unit, for keys such as "um_per_K" that consist of a unit only.
  template <typename M>
  Fields& number_in(double unit, const KeyName& key, M member, const Range& range,
                    const char* sentence) {
    add_number(key, untyped(std::move(member)), fields_detail::number_access<Value<M>>(), range,
               sentence, unit);
    return *this;
  }
  /// Adds an integer of any type from min to max, or an optional one.
  template <typename M>
  Fields& integer(const KeyName& key, M member, std::int64_t min, std::int64_t max,
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
  /// Adds a std::string or path; an empty string is an input error.
  template <typename M>
  Fields& text(const KeyName& key, M member, const char* sentence) {
    add_text(key, untyped(std::move(member)), fields_detail::text_access<Value<M>>(), sentence);
    return *this;
  }
  /// Adds a std::vector<std::string>.
  template <typename M>
  Fields& texts(const KeyName& key, M member, const char* sentence) {
    static_assert(std::is_same_v<Value<M>, std::vector<std::string>>);
    add_texts(key, untyped(std::move(member)), sentence);
    return *this;
  }
  /// Adds a remark for human readers, which is not stored.
  Fields& remark(const KeyName& key, const char* sentence) {
    add_remark(key, sentence);
    return *this;
  }
  /// Adds an enum value. If a required key is missing or invalid, the first value is set.
  template <typename M>
  Fields& choice(const KeyName& key, M member,
                 std::vector<fields_detail::EnumValue<Value<M>>> labelled_values,
                 const char* sentence) {
    add_enum(key, untyped(std::move(member)),
             fields_detail::enum_access(std::move(labelled_values)), sentence);
    return *this;
  }
  /// Adds an Eigen::Vector3d.
  template <typename M>
  Fields& vector(const KeyName& key, M member, const char* sentence) {
    return numbers(key, std::move(member), 3, sentence);
  }
  /// Adds a normalised Eigen::Vector3d.
  template <typename M>
  Fields& direction(const KeyName& key, M member, const char* sentence) {
    static_assert(std::is_same_v<Value<M>, Eigen::Vector3d>);
    add_direction(key, untyped(std::move(member)), sentence);
    return *this;
  }
  /// Adds a vector of `size` numbers, 0 for any size, or an optional one.
  template <typename M>
  Fields& numbers(const KeyName& key, M member, int size, const char* sentence) {
    add_numbers(key, untyped(std::move(member)), fields_detail::vector_access<Value<M>>(), size,
                sentence);
    return *this;
  }
  /// Adds a section, which sets a U or an optional U; without the section the latter stays empty.
  template <typename M, typename U>
  Fields& table(const KeyName& key, M member, Fields<U> fields, const char* sentence) {
    static_assert(std::is_same_v<typename fields_detail::WithoutOptional<Value<M>>::type, U>);
    add_table(key, untyped(std::move(member)), fields_detail::table_access<Value<M>>(),
              std::move(fields), sentence);
    return *this;
  }
  /// Adds a list of tables, which sets a std::vector<U>.
  /// @param read  reads the list if its tables depend on each other; may be empty
  template <typename M, typename U>
  Fields& tables(const KeyName& key, M member, Fields<U> fields, const char* sentence,
                 std::function<void(TableReader&, T&)> read = {}) {
    static_assert(std::is_same_v<Value<M>, std::vector<U>>);
    add_tables(key, untyped(std::move(member)), fields_detail::list_access<U>(), std::move(fields),
               sentence, untyped_read(std::move(read)));
    return *this;
  }
  /// Adds the keys of a member to this table.
  template <typename M, typename U>
  Fields& include_fields(M member, Fields<U> fields) {
    static_assert(std::is_same_v<Value<M>, U>);
    add_all(untyped(std::move(member)), std::move(fields));
    return *this;
  }
  /// Adds a variant whose alternative is selected by a key. If the key is missing, the first
  /// alternative is read; if its value is invalid, none is read.
  template <typename M>
  Fields& variant(const KeyName& key, M member, std::vector<Alternative<Value<M>>> alternatives,
                  const char* sentence) {
    add_alternatives(key, untyped(std::move(member)),
                     fields_detail::alternative_access(std::move(alternatives)), sentence);
    return *this;
  }
  /// Adds keys that are read together by a function of their own.
  Fields& custom_field(std::vector<Key> keys, std::function<void(TableReader&, T&)> read,
                       std::function<void(const T&, Node::Table&)> write) {
    add(std::move(keys), untyped_read(std::move(read)),
        [write = std::move(write)](const void* source, Node::Table& table) {
          write(*static_cast<const T*>(source), table);
        });
    return *this;
  }
  /// Adds a check of the keys declared so far.
  Fields& check(std::function<void(TableReader&, T&)> read) {
    add({}, untyped_read(std::move(read)), {});
    return *this;
  }
  /// Adds a function that derives members from the keys declared so far.
  Fields& derive(std::function<void(T&)> set) {
    add({}, [set = std::move(set)](TableReader&, void* target) { set(*static_cast<T*>(target)); },
        {});
    return *this;
  }
  /// Adds keys that are read only if the keys declared so far meet a condition.
  Fields& only_if(std::function<bool(const T&)> condition, Fields fields) {
    add_conditional([condition = std::move(condition)](
                        const void* value) { return condition(*static_cast<const T*>(value)); },
                    std::move(fields));
    return *this;
  }

  /// Returns `start` after setting the members whose keys are present. `TableReader::close` reports
  /// the other keys.
  T read(TableReader& reader) const { return read(reader, initial_value()); }
  T read(TableReader& reader, T start) const {
    read_into(reader, std::addressof(start));
    return start;
  }
  /// Reads a whole table and reports unknown keys.
  T read_table(const Node& table, const std::string& section_name,
               InputErrors& input_errors) const {
    return read_table(table, section_name, input_errors, initial_value());
  }
  T read_table(const Node& table, const std::string& section_name, InputErrors& input_errors,
               T start) const {
    read_table_into(table, section_name, input_errors, std::addressof(start));
    return start;
  }
  /// Returns the table from which `read` gives this value, without the keys of empty members.
  Node::Table to_table(const T& value) const { return table_from(std::addressof(value)); }

 private:
  template <typename M>
  static fields_detail::Member untyped(M member) {
    return [member = std::move(member)](void* value) -> void* {
      return std::addressof(std::invoke(member, *static_cast<T*>(value)));
    };
  }
  static Read untyped_read(std::function<void(TableReader&, T&)> read) {
    if (!read) return {};
    return [read = std::move(read)](TableReader& reader, void* target) {
      read(reader, *static_cast<T*>(target));
    };
  }
  const T& initial_value() const { return *static_cast<const T*>(initial()); }
};

/// Returns an alternative A of the variant V. Its keys are in the same table as the key that
/// selects it.
template <typename V, typename A>
Alternative<V> alternative(const char* word, Fields<A> fields, const char* sentence = "") {
  EnumChoice selector{word, sentence, fields.keys()};
  const auto shared_fields = std::make_shared<const Fields<A>>(std::move(fields));
  return {std::move(selector),
          [shared_fields](TableReader& reader) -> V { return shared_fields->read(reader); },
          [shared_fields](const V& value, Node::Table& table) {
            const A* member = std::get_if<A>(&value);
            if (!member) return false;
            append_entries(table, shared_fields->to_table(*member));
            return true;
          }};
}

/// Appends a list of tables, one for each value, to a table; nothing if there are no values.
template <typename U>
void put_tables(Node::Table& table, const std::string& key, const std::vector<U>& values,
                const Fields<U>& fields) {
  Node::Array tables;
  for (const U& value : values) tables.push_back(Node{{}, fields.to_table(value)});
  if (!tables.empty()) put_value(table, key, std::move(tables));
}

/// Returns the field `turn_deg`: a rotation vector in degrees, by default zero. Rotations by
/// multiples of 90 degrees about one axis are exact.
const Fields<Eigen::Matrix3d>& turn_fields();
Eigen::Matrix3d read_turn(TableReader& reader);

/// Returns the fields `at_mm` and `turn_deg`, the pose of a body in its parent.
const Fields<kinematics::Pose>& placement_fields();

/// Returns the fields of positions of joints, with keys such as Z_mm and A_deg; the default is 0.
/// @param joints  empty if only the keys are needed
Fields<kinematics::AxisVector> axis_position_fields(const std::vector<kinematics::Joint>& joints);
kinematics::AxisVector read_axis_positions(TableReader& reader,
                                           const std::vector<kinematics::Joint>& joints);

}  // namespace abbe::sim
