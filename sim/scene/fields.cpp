#include "sim/scene/fields.h"

#include <cmath>
#include <cstdlib>
#include <limits>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim {

using kinematics::AxisVector;
using kinematics::Joint;
using kinematics::Motion;

KeyName KeyName::otherwise(std::string text) const {
  KeyName with = *this;
  with.fallback = std::move(text);
  return with;
}

KeyName KeyName::one_of(std::string group) const {
  KeyName with = *this;
  with.either = std::move(group);
  return with;
}

KeyName must(KeyName key) {
  key.required = true;
  return key;
}

Key make_field_key(const KeyName& name, Key::Kind kind, const char* sentence,
                   std::vector<Key> keys) {
  Key key;
  key.name = name.name;
  key.sentence = sentence;
  key.kind = kind;
  key.required = name.required;
  key.fallback = name.fallback;
  key.either = name.either;
  key.keys = std::move(keys);
  return key;
}

Key make_numbers_key(const KeyName& name, int size, const char* sentence) {
  Key key = make_field_key(name, Key::Kind::Numbers, sentence);
  key.size = size;
  return key;
}

std::set<std::string> words_of(const Key& key) {
  std::set<std::string> words;
  for (const Word& one : key.words) words.insert(one.word);
  return words;
}

double in_unit(double value, double unit) {
  const double divided = value / unit;
  const double few = std::strtod(fmt::format("{:.15g}", divided).c_str(), nullptr);
  for (const double number :
       {few, divided, std::nextafter(divided, infinity), std::nextafter(divided, -infinity)})
    if (number * unit == value) return number;
  return divided;
}

std::vector<Key> with_other_unit(std::vector<Key> keys, const std::string& unit,
                                 const std::string& other) {
  const std::string either = "_(" + unit + "|" + other + ")_";
  for (Key& key : keys) {
    std::string names = "_" + (key.pattern.empty() ? key.name : key.pattern) + "_";
    if (const std::size_t at = names.find("_" + unit + "_"); at != std::string::npos) {
      names.replace(at, unit.size() + 2, either);
      key.pattern = names.substr(1, names.size() - 2);
    }
    key.keys = with_other_unit(std::move(key.keys), unit, other);
    for (Word& word : key.words) word.keys = with_other_unit(std::move(word.keys), unit, other);
  }
  return keys;
}

void accept_keys(TableReader& reader, const std::vector<Word>& words) {
  for (const Word& word : words)
    for (const Key& key : word.keys) {
      reader.know(key.name);
      accept_keys(reader, key.words);
    }
}

void put_numbers(Node::Table& table, const std::string& key, const Eigen::VectorXd& values,
                 double unit) {
  Node::Array numbers;
  for (const double value : values) numbers.push_back(Node{{}, in_unit(value, unit)});
  put(table, key, std::move(numbers));
}

void append_entries(Node::Table& table, Node::Table entries) {
  for (Node::Entry& entry : entries) table.push_back(std::move(entry));
}

std::string default_text(double value) {
  return std::abs(value) < 1e300 ? fmt::format("{:.12g}", value) : "";
}

std::string default_text(const Eigen::VectorXd& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ", ") + default_text(value);
  return "[" + text + "]";
}

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

double sine_of_right_angles(double degrees) {
  const double turns = std::remainder(degrees, 360.0);
  if (turns == 0.0 || std::abs(turns) == 180.0) return 0.0;
  if (std::abs(turns) == 90.0) return std::copysign(1.0, turns);
  return std::sin(turns * units::deg);
}

Matrix3d turned(const Vector3d& degrees) {
  for (int axis = 0; axis < 3; ++axis) {
    const int j = (axis + 1) % 3;
    const int k = (axis + 2) % 3;
    if (degrees[j] != 0.0 || degrees[k] != 0.0) continue;
    const double s = sine_of_right_angles(degrees[axis]);
    const double c = sine_of_right_angles(degrees[axis] + 90.0);
    Matrix3d R = Matrix3d::Identity();
    R(j, j) = R(k, k) = c;
    R(k, j) = s;
    R(j, k) = -s;
    return R;
  }
  return kinematics::rotation(degrees * units::deg);
}

/// The vector that turns so, with few digits where they give the same bits.
Vector3d turn_of(const Matrix3d& R) {
  const Vector3d degrees = kinematics::rotation_vector(R) / units::deg;
  const Vector3d few = (degrees * 1e9).array().round() / 1e9;
  return turned(few) == R ? few : degrees;
}

Matrix3d read_turn_deg(TableReader& reader) {
  constexpr double max_turn_deg = 3600.0;  // beyond, the last digits of the angle are its turns
  const auto turn = reader.numbers_as_written("turn_deg", 3);
  if (!turn) return Matrix3d::Identity();
  if (turn->cwiseAbs().maxCoeff() <= max_turn_deg) return turned(*turn);
  reader.refuse("turn_deg", fmt::format("turns within +-{} deg for turn_deg", max_turn_deg),
                fmt::format("{}", turn->cwiseAbs().maxCoeff()));
  return Matrix3d::Identity();
}

}  // namespace

const Fields<Matrix3d>& turn_fields() {
  static const Fields<Matrix3d> fields =
      Fields<Matrix3d>(Matrix3d::Identity())
          .custom(
              {make_numbers_key(
                  KeyName("turn_deg").otherwise("[0, 0, 0]"), 3,
                  "rotation vector, each number within ±3600: [0, 90, 0] turns by 90° "
                  "about y")},
              [](TableReader& reader, Matrix3d& R) { R = read_turn_deg(reader); },
              [](const Matrix3d& R, Node::Table& table) {
                put_numbers(table, "turn_deg", turn_of(R), 1.0);
              });
  return fields;
}

Matrix3d read_turn(TableReader& reader) { return turn_fields().read(reader); }

const Fields<kinematics::Pose>& placement_fields() {
  using kinematics::Pose;
  static const Fields<Pose> fields =
      Fields<Pose>(Pose::Identity())
          .custom(
              {make_numbers_key(KeyName("at_mm").otherwise("[0, 0, 0]"), 3, "where its zero is")},
              [](TableReader& reader, Pose& pose) {
                pose.translation() = reader.vector("at_mm", pose.translation());
              },
              [](const Pose& pose, Node::Table& table) {
                put_numbers(table, "at_mm", pose.translation(), 1.0);
              })
          .custom(
              turn_fields().keys(),
              [](TableReader& reader, Pose& pose) { pose.linear() = read_turn(reader); },
              [](const Pose& pose, Node::Table& table) {
                append_entries(table, turn_fields().written(pose.linear()));
              });
  return fields;
}

namespace {

std::string word_of(const Joint& joint) {
  return joint.name + std::string(joint.motion == Motion::Linear ? "_mm" : "_deg");
}

Key word_key(const char* unit, const char* sentence) {
  Key key = make_field_key(KeyName("<axis>_" + std::string(unit)).otherwise("0"), Key::Kind::Number,
                           sentence);
  key.pattern = "[A-Z]_" + std::string(unit);
  return key;
}

}  // namespace

Fields<AxisVector> axis_position_fields(const std::vector<Joint>& joints) {
  return Fields<AxisVector>(AxisVector::Zero(Eigen::Index(joints.size())))
      .custom(
          {word_key("mm", "position of a slide, such as Z_mm"),
           word_key("deg", "angle of an axis that turns, such as C_deg")},
          [joints](TableReader& reader, AxisVector& words) {
            words = AxisVector::Zero(Eigen::Index(joints.size()));
            for (std::size_t j = 0; j < joints.size(); ++j)
              if (joints[j].motion != Motion::Spindle)
                words[Eigen::Index(j)] = reader.number(word_of(joints[j]), any_number, 0.0);
          },
          [joints](const AxisVector& words, Node::Table& table) {
            for (std::size_t j = 0; j < joints.size(); ++j)
              if (joints[j].motion != Motion::Spindle)
                put(table, word_of(joints[j]),
                    words[Eigen::Index(j)] / unit_of(word_of(joints[j])));
          });
}

AxisVector read_axis_positions(TableReader& reader, const std::vector<Joint>& joints) {
  return axis_position_fields(joints).read(reader);
}

}  // namespace abbe::sim
