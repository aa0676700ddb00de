#include "sim/scene/axis_words.h"

namespace abbe::sim {

using kinematics::AxisVector;
using kinematics::Joint;
using kinematics::Motion;

namespace {

std::string word_of(const Joint& joint) {
  return joint.name + std::string(joint.motion == Motion::Linear ? "_mm" : "_deg");
}

Key word_key(const char* unit, const char* sentence) {
  Key key =
      key_of(KeyName("<axis>_" + std::string(unit)).otherwise("0"), Key::Kind::Number, sentence);
  key.pattern = "[A-Z]_" + std::string(unit);
  return key;
}

}  // namespace

Fields<AxisVector> axis_word_fields(const std::vector<Joint>& joints) {
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

AxisVector read_axis_words(TableReader& reader, const std::vector<Joint>& joints) {
  return axis_word_fields(joints).read(reader);
}

}  // namespace abbe::sim
