#include "sim/scene/fields.h"

#include <cmath>
#include <cstdlib>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Joint;
using kinematics::Motion;

KeyName KeyName::with_fallback(std::string text) const {
  KeyName key = *this;
  key.fallback = std::move(text);
  return key;
}

KeyName KeyName::in_exclusive_group(std::string group) const {
  KeyName key = *this;
  key.exclusive_group = std::move(group);
  return key;
}

KeyName required_key(KeyName key) {
  key.required = true;
  return key;
}

Key make_key(const KeyName& name, Key::Kind kind, const char* sentence, std::vector<Key> keys) {
  Key key;
  key.name = name.name;
  key.sentence = sentence;
  key.kind = kind;
  key.required = name.required;
  key.fallback = name.fallback;
  key.exclusive_group = name.exclusive_group;
  key.keys = std::move(keys);
  return key;
}

Key make_numbers_key(const KeyName& name, int size, const char* sentence) {
  Key key = make_key(name, Key::Kind::Numbers, sentence);
  key.size = size;
  return key;
}

std::set<std::string> choice_names(const Key& key) {
  std::set<std::string> choices;
  for (const EnumChoice& choice : key.choices) choices.insert(choice.word);
  return choices;
}

double in_unit(double value, double unit) {
  const double quotient = value / unit;
  const double rounded = std::strtod(fmt::format("{:.15g}", quotient).c_str(), nullptr);
  // The division may round to a neighbour of the number that the user wrote.
  for (const double number :
       {rounded, quotient, std::nextafter(quotient, infinity), std::nextafter(quotient, -infinity)})
    if (number * unit == value) return number;
  return quotient;
}

std::vector<Key> allow_other_unit(std::vector<Key> keys, const std::string& unit,
                                  const std::string& other) {
  const std::string either_unit = "_(" + unit + "|" + other + ")_";
  for (Key& key : keys) {
    std::string names = "_" + (key.pattern.empty() ? key.name : key.pattern) + "_";
    if (const std::size_t at = names.find("_" + unit + "_"); at != std::string::npos) {
      names.replace(at, unit.size() + 2, either_unit);
      key.pattern = names.substr(1, names.size() - 2);
    }
    key.keys = allow_other_unit(std::move(key.keys), unit, other);
    for (EnumChoice& choice : key.choices)
      choice.keys = allow_other_unit(std::move(choice.keys), unit, other);
  }
  return keys;
}

void put_numbers(Node::Table& table, const std::string& key, const Eigen::VectorXd& values,
                 double unit) {
  Node::Array numbers;
  for (const double value : values) numbers.push_back(Node{{}, in_unit(value, unit)});
  put_value(table, key, std::move(numbers));
}

void append_entries(Node::Table& table, Node::Table entries) {
  for (Node::Entry& entry : entries) table.push_back(std::move(entry));
}

namespace fields_detail {
namespace {

/// Marks the keys of all enum values as known, so that they are not reported as unknown.
void accept_keys(TableReader& reader, const std::vector<EnumChoice>& choices) {
  for (const EnumChoice& choice : choices)
    for (const Key& key : choice.keys) {
      reader.accept_key(key.name);
      accept_keys(reader, key.choices);
    }
}

/// Returns a default for documents, with 12 digits and in the unit of its key; empty if it is
/// infinite.
std::string default_text(double value) {
  // Unlimited members hold the largest double and not infinity.
  return std::abs(value) < 1e300 ? fmt::format("{:.12g}", value) : "";
}

std::string default_text(const Eigen::VectorXd& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ", ") + default_text(value);
  return "[" + text + "]";
}

// The functions that read and write a nested struct share its fields, since `std::function` would
// copy them.
std::shared_ptr<const FieldList> shared(FieldList fields) {
  return std::make_shared<const FieldList>(std::move(fields));
}

// `Member` takes a struct that is read into; the callers of this function do not change it.
const void* const_member(const Member& member, const void* value) {
  return member(const_cast<void*>(value));
}

}  // namespace

FieldList::FieldList(std::shared_ptr<const void> initial) : initial_(std::move(initial)) {}
FieldList::FieldList(const FieldList& other) = default;
FieldList::FieldList(FieldList&& other) noexcept = default;
FieldList& FieldList::operator=(const FieldList& other) = default;
FieldList& FieldList::operator=(FieldList&& other) noexcept = default;
FieldList::~FieldList() = default;

std::vector<Key> FieldList::keys() const {
  std::vector<Key> keys;
  for (const Field& field : fields_) keys.insert(keys.end(), field.keys.begin(), field.keys.end());
  return keys;
}

void FieldList::read_into(TableReader& reader, void* target) const {
  for (const Field& field : fields_) field.read(reader, target);
}

void FieldList::read_table_into(const Node& table, const std::string& section_name,
                                InputErrors& input_errors, void* target) const {
  TableReader reader(table, section_name, input_errors);
  read_into(reader, target);
  reader.close();
}

Node::Table FieldList::table_from(const void* source) const {
  Node::Table table;
  for (const Field& field : fields_)
    if (field.write) field.write(source, table);
  return table;
}

void FieldList::add(std::vector<Key>&& keys, Read&& read, Write&& write) {
  fields_.push_back({std::move(keys), std::move(read), std::move(write)});
}

// The members of the initial value are accessed only if their fallback is needed, because a
// function such as `std::get<Cutter>(tool.nominal)` throws for a default struct. The keys of such
// members are required or state their fallback.

void FieldList::add_number(const KeyName& name, Member member, const NumberAccess& access,
                           const Range& range, const char* sentence, double unit) {
  const auto key = std::make_shared<Key>(make_key(name, Key::Kind::Number, sentence));
  key->range = range;
  if (!access.optional && !key->required && key->fallback.empty())
    if (const auto value = access.get(const_member(member, initial())))
      key->fallback = default_text(*value / unit);
  add(
      {*key},
      [key, member, access, unit](TableReader& reader, void* target) {
        const auto stated_value = reader.number_as_written(key->name, key->range);
        if (key->required && !reader.has(key->name)) reader.report_missing(key->name, "a number");
        if (stated_value)
          access.set(member(target), *stated_value * unit);
        else if (key->required)
          // One is harmless as a factor, a divisor and a length, so reading can continue.
          access.set(member(target), 1.0);
      },
      [key, member, access, unit](const void* source, Node::Table& table) {
        if (const auto value = access.get(const_member(member, source)))
          put_value(table, key->name, in_unit(*value, unit));
      });
}

void FieldList::add_integer(const KeyName& name, Member member, const IntegerAccess& access,
                            std::int64_t min, std::int64_t max, const char* sentence) {
  const auto key = std::make_shared<Key>(make_key(name, Key::Kind::Whole, sentence));
  key->range = {double(min), double(max)};
  if (!access.optional && !key->required && key->fallback.empty())
    if (const auto value = access.get(const_member(member, initial())))
      key->fallback = std::to_string(*value);
  add(
      {*key},
      [key, member, access, min, max](TableReader& reader, void* target) {
        if (key->required && !reader.has(key->name)) reader.report_missing(key->name, "an integer");
        if (const auto value = reader.maybe_integer(key->name, min, max))
          access.set(member(target), *value);
      },
      [key, member, access](const void* source, Node::Table& table) {
        if (const auto value = access.get(const_member(member, source)))
          put_value(table, key->name, *value);
      });
}

void FieldList::add_boolean(const KeyName& name, Member member, const char* sentence) {
  const auto get = [member](const void* source) {
    return *static_cast<const bool*>(const_member(member, source));
  };
  const auto key = std::make_shared<Key>(make_key(name, Key::Kind::Boolean, sentence));
  if (key->fallback.empty()) key->fallback = get(initial()) ? "true" : "false";
  add(
      {*key},
      [key, member](TableReader& reader, void* target) {
        bool& value = *static_cast<bool*>(member(target));
        value = reader.boolean(key->name, value);
      },
      [key, get](const void* source, Node::Table& table) {
        put_value(table, key->name, get(source));
      });
}

void FieldList::add_text(const KeyName& name, Member member, const TextAccess& access,
                         const char* sentence) {
  const auto key = std::make_shared<Key>(make_key(name, Key::Kind::Text, sentence));
  if (key->fallback.empty()) key->fallback = access.get(const_member(member, initial()));
  add(
      {*key},
      [key, member, access](TableReader& reader, void* target) {
        if (key->required && !reader.has(key->name)) reader.report_missing(key->name, "a string");
        void* value = member(target);
        access.set(value, reader.text(key->name, access.get(value)));
      },
      [key, member, access](const void* source, Node::Table& table) {
        std::string text = access.get(const_member(member, source));
        if (!text.empty()) put_value(table, key->name, std::move(text));
      });
}

void FieldList::add_texts(const KeyName& name, Member member, const char* sentence) {
  using Texts = std::vector<std::string>;
  const auto key = std::make_shared<Key>(make_key(name, Key::Kind::Texts, sentence));
  add(
      {*key},
      [key, member](TableReader& reader, void* target) {
        if (reader.accept_key(key->name))
          *static_cast<Texts*>(member(target)) = reader.texts(key->name);
      },
      [key, member](const void* source, Node::Table& table) {
        Node::Array texts;
        for (const std::string& text : *static_cast<const Texts*>(const_member(member, source)))
          texts.push_back(Node{{}, text});
        if (!texts.empty()) put_value(table, key->name, std::move(texts));
      });
}

void FieldList::add_remark(const KeyName& name, const char* sentence) {
  add({make_key(name, Key::Kind::Text, sentence)},
      [key = name.name](TableReader& reader, void*) { reader.text(key, ""); }, {});
}

void FieldList::add_enum(const KeyName& name, Member member, EnumAccess access,
                         const char* sentence) {
  const auto key = std::make_shared<Key>(make_key(name, Key::Kind::Text, sentence));
  for (const EnumLabel& label : access.labels)
    key->choices.push_back({label.word, label.sentence, {}});
  if (!key->required && key->fallback.empty())
    if (const auto index = access.get(const_member(member, initial())))
      key->fallback = key->choices[*index].word;
  add(
      {*key},
      [key, member, set = std::move(access.set)](TableReader& reader, void* target) {
        const std::optional<std::string> word =
            reader.word(key->name, choice_names(*key), key->required);
        if (!word && key->required) set(member(target), 0);
        for (std::size_t i = 0; i < key->choices.size(); ++i)
          if (word == key->choices[i].word) set(member(target), i);
      },
      [key, member, get = std::move(access.get)](const void* source, Node::Table& table) {
        if (const auto index = get(const_member(member, source)))
          put_value(table, key->name, key->choices[*index].word);
      });
}

void FieldList::add_direction(const KeyName& name, Member member, const char* sentence) {
  const auto get = [member](const void* source) -> const Vector3d& {
    return *static_cast<const Vector3d*>(const_member(member, source));
  };
  const auto key = std::make_shared<Key>(make_numbers_key(name, 3, sentence));
  if (!key->required && key->fallback.empty())
    key->fallback = default_text(Eigen::VectorXd(get(initial())));
  add(
      {*key},
      [key, member](TableReader& reader, void* target) {
        Vector3d& direction = *static_cast<Vector3d*>(member(target));
        direction =
            key->required ? reader.direction(key->name) : reader.direction(key->name, direction);
      },
      [key, get](const void* source, Node::Table& table) {
        put_numbers(table, key->name, get(source).normalized(), 1.0);
      });
}

void FieldList::add_numbers(const KeyName& name, Member member, const VectorAccess& access,
                            int size, const char* sentence) {
  const auto key = std::make_shared<Key>(make_numbers_key(name, size, sentence));
  if (!access.optional && !key->required && key->fallback.empty())
    if (const auto values = access.get(const_member(member, initial())))
      key->fallback = default_text(Eigen::VectorXd(*values / unit_factor(name.name)));
  add(
      {*key},
      [key, member, access](TableReader& reader, void* target) {
        if (key->required)
          access.set(member(target), reader.numbers(key->name, key->size));
        else if (const auto values = reader.maybe_numbers(key->name, key->size))
          access.set(member(target), *values);
      },
      [key, member, access](const void* source, Node::Table& table) {
        if (const auto values = access.get(const_member(member, source)))
          put_numbers(table, key->name, *values, unit_factor(key->name));
      });
}

void FieldList::add_table(const KeyName& name, Member member, const TableAccess& access,
                          FieldList nested, const char* sentence) {
  const auto fields = shared(std::move(nested));
  const auto key =
      std::make_shared<Key>(make_key(name, Key::Kind::Table, sentence, fields->keys()));
  add(
      {*key},
      [key, member, access, fields](TableReader& reader, void* target) {
        const Node* node = reader.section(key->name);
        if (!node && key->required && !reader.has(key->name))
          reader.report_missing(key->name, "a table");
        if (!node) return;
        fields->read_table_into(*node, reader.qualified_name(key->name), reader.input_errors(),
                                access.make(member(target), fields->initial()));
      },
      [key, member, access, fields](const void* source, Node::Table& table) {
        const void* value = access.get(const_member(member, source));
        if (!value) return;
        Node::Table entries = fields->table_from(value);
        if (access.optional || !entries.empty()) put_value(table, key->name, std::move(entries));
      });
}

void FieldList::add_tables(const KeyName& name, Member member, const ListAccess& access,
                           FieldList nested, const char* sentence, Read read) {
  const auto fields = shared(std::move(nested));
  const auto key =
      std::make_shared<Key>(make_key(name, Key::Kind::Tables, sentence, fields->keys()));
  if (!read)
    read = [key, member, access, fields](TableReader& reader, void* target) {
      if (key->required && !reader.has(key->name))
        reader.report_missing(key->name, "a list of tables");
      for (const Node* node : reader.tables(key->name))
        fields->read_table_into(*node, reader.qualified_name(key->name), reader.input_errors(),
                                access.append(member(target), fields->initial()));
    };
  add({*key}, std::move(read),
      [key, member, access, fields](const void* source, Node::Table& table) {
        const void* list = const_member(member, source);
        Node::Array tables;
        for (std::size_t i = 0; i < access.size(list); ++i)
          tables.push_back(Node{{}, fields->table_from(access.get(list, i))});
        if (!tables.empty()) put_value(table, key->name, std::move(tables));
      });
}

void FieldList::add_all(Member member, FieldList nested) {
  const auto fields = shared(std::move(nested));
  add(
      fields->keys(),
      [member, fields](TableReader& reader, void* target) {
        fields->read_into(reader, member(target));
      },
      [member, fields](const void* source, Node::Table& table) {
        append_entries(table, fields->table_from(const_member(member, source)));
      });
}

void FieldList::add_conditional(std::function<bool(const void*)> condition, FieldList conditional) {
  const auto fields = shared(std::move(conditional));
  std::vector<Key> keys = fields->keys();
  // A table that does not meet the condition is complete without these keys.
  for (Key& key : keys) key.required = false;
  add(
      std::move(keys),
      [condition, fields](TableReader& reader, void* target) {
        if (condition(target)) fields->read_into(reader, target);
      },
      [condition, fields](const void* source, Node::Table& table) {
        if (condition(source)) append_entries(table, fields->table_from(source));
      });
}

void FieldList::add_alternatives(const KeyName& name, Member member,
                                 std::vector<AlternativeAccess> alternatives,
                                 const char* sentence) {
  const auto key = std::make_shared<Key>(make_key(name, Key::Kind::Text, sentence));
  for (const AlternativeAccess& alternative : alternatives)
    key->choices.push_back(alternative.selector);
  const auto accesses =
      std::make_shared<const std::vector<AlternativeAccess>>(std::move(alternatives));
  add(
      {*key},
      [key, member, accesses](TableReader& reader, void* target) {
        const auto stated_word = reader.word(key->name, choice_names(*key), key->required);
        // With an invalid value it is unknown which keys belong to the table, so the keys of every
        // alternative are accepted.
        if (!stated_word && reader.has(key->name)) return accept_keys(reader, key->choices);
        const std::string word = stated_word.value_or(key->choices.front().word);
        for (const AlternativeAccess& alternative : *accesses)
          if (alternative.selector.word == word) alternative.read(reader, member(target));
      },
      [key, member, accesses](const void* source, Node::Table& table) {
        for (const AlternativeAccess& alternative : *accesses) {
          Node::Table entries;
          if (!alternative.write(const_member(member, source), entries)) continue;
          put_value(table, key->name, alternative.selector.word);
          return append_entries(table, std::move(entries));
        }
      });
}

}  // namespace fields_detail

namespace {

/// Returns the sine of an angle in degrees, exact at multiples of 90.
double exact_sine(double degrees) {
  const double remainder = std::remainder(degrees, 360.0);
  if (remainder == 0.0 || std::abs(remainder) == 180.0) return 0.0;
  if (std::abs(remainder) == 90.0) return std::copysign(1.0, remainder);
  return std::sin(remainder * units::deg);
}

/// Returns the rotation by a rotation vector in degrees, exact for multiples of 90 about one axis.
Matrix3d turn_rotation(const Vector3d& degrees) {
  for (int axis = 0; axis < 3; ++axis) {
    const int j = (axis + 1) % 3;
    const int k = (axis + 2) % 3;
    if (degrees[j] != 0.0 || degrees[k] != 0.0) continue;
    const double s = exact_sine(degrees[axis]);
    const double c = exact_sine(degrees[axis] + 90.0);
    Matrix3d R = Matrix3d::Identity();
    R(j, j) = R(k, k) = c;
    R(k, j) = s;
    R(j, k) = -s;
    return R;
  }
  return kinematics::rotation(degrees * units::deg);
}

/// Returns the rotation vector in degrees, rounded to 1e-9 if that gives the same bits of R.
Vector3d turn_vector(const Matrix3d& R) {
  const Vector3d degrees = kinematics::rotation_vector(R) / units::deg;
  const Vector3d rounded = (degrees * 1e9).array().round() / 1e9;
  return turn_rotation(rounded) == R ? rounded : degrees;
}

Matrix3d read_turn_deg(TableReader& reader) {
  constexpr double max_turn_deg = 3600.0;  // larger angles lose digits to whole turns
  const auto turn = reader.numbers_as_written("turn_deg", 3);
  if (!turn) return Matrix3d::Identity();
  if (turn->cwiseAbs().maxCoeff() <= max_turn_deg) return turn_rotation(*turn);
  reader.report_invalid("turn_deg",
                        fmt::format("rotations within +-{} deg for turn_deg", max_turn_deg),
                        fmt::format("{}", turn->cwiseAbs().maxCoeff()));
  return Matrix3d::Identity();
}

}  // namespace

const Fields<Matrix3d>& turn_fields() {
  static const Fields<Matrix3d> fields =
      Fields<Matrix3d>(Matrix3d::Identity())
          .custom_field(
              {make_numbers_key(
                  KeyName("turn_deg").with_fallback("[0, 0, 0]"), 3,
                  "rotation vector, each number within ±3600: [0, 90, 0] turns by 90° "
                  "about y")},
              [](TableReader& reader, Matrix3d& R) { R = read_turn_deg(reader); },
              [](const Matrix3d& R, Node::Table& table) {
                put_numbers(table, "turn_deg", turn_vector(R), 1.0);
              });
  return fields;
}

Matrix3d read_turn(TableReader& reader) { return turn_fields().read(reader); }

const Fields<kinematics::Pose>& placement_fields() {
  using kinematics::Pose;
  static const Fields<Pose> fields =
      Fields<Pose>(Pose::Identity())
          .custom_field(
              {make_numbers_key(KeyName("at_mm").with_fallback("[0, 0, 0]"), 3,
                                "position of its origin")},
              [](TableReader& reader, Pose& pose) {
                pose.translation() = reader.vector("at_mm", pose.translation());
              },
              [](const Pose& pose, Node::Table& table) {
                put_numbers(table, "at_mm", pose.translation(), 1.0);
              })
          .custom_field(
              turn_fields().keys(),
              [](TableReader& reader, Pose& pose) { pose.linear() = read_turn(reader); },
              [](const Pose& pose, Node::Table& table) {
                append_entries(table, turn_fields().to_table(pose.linear()));
              });
  return fields;
}

namespace {

std::string axis_key_name(const Joint& joint) {
  return joint.name + std::string(joint.motion == Motion::Linear ? "_mm" : "_deg");
}

Key position_key(const char* unit, const char* sentence) {
  Key key = make_key(KeyName("<axis>_" + std::string(unit)).with_fallback("0"), Key::Kind::Number,
                     sentence);
  key.pattern = "[A-Z]_" + std::string(unit);
  return key;
}

}  // namespace

Fields<AxisVector> axis_position_fields(const std::vector<Joint>& joints) {
  return Fields<AxisVector>(AxisVector::Zero(Eigen::Index(joints.size())))
      .custom_field(
          {position_key("mm", "position of a slide, such as Z_mm"),
           position_key("deg", "angle of a rotary axis, such as C_deg")},
          [joints](TableReader& reader, AxisVector& positions) {
            positions = AxisVector::Zero(Eigen::Index(joints.size()));
            for (std::size_t j = 0; j < joints.size(); ++j)
              if (joints[j].motion != Motion::Spindle)
                positions[Eigen::Index(j)] =
                    reader.number(axis_key_name(joints[j]), any_number, 0.0);
          },
          [joints](const AxisVector& positions, Node::Table& table) {
            for (std::size_t j = 0; j < joints.size(); ++j)
              if (joints[j].motion != Motion::Spindle)
                put_value(table, axis_key_name(joints[j]),
                          positions[Eigen::Index(j)] / unit_factor(axis_key_name(joints[j])));
          });
}

AxisVector read_axis_positions(TableReader& reader, const std::vector<Joint>& joints) {
  return axis_position_fields(joints).read(reader);
}

}  // namespace abbe::sim
