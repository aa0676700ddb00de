#include "sim/scene/placement.h"

#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

double exact_sine(double degrees) {
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

/// The vector that turns so, with few digits where they give the same bits.
Vector3d turn_of(const Matrix3d& R) {
  const Vector3d degrees = kinematics::rotation_vector(R) / units::deg;
  const Vector3d few = (degrees * 1e9).array().round() / 1e9;
  return turned(few) == R ? few : degrees;
}

Matrix3d read_turn_deg(TableReader& reader) {
  constexpr double most_turn_deg = 3600.0;  // beyond, the last digits of the angle are its turns
  const auto turn = reader.numbers_as_written("turn_deg", 3);
  if (!turn) return Matrix3d::Identity();
  if (turn->cwiseAbs().maxCoeff() <= most_turn_deg) return turned(*turn);
  reader.refuse("turn_deg", fmt::format("turns within +-{} deg for turn_deg", most_turn_deg),
                fmt::format("{}", turn->cwiseAbs().maxCoeff()));
  return Matrix3d::Identity();
}

}  // namespace

const Fields<Matrix3d>& turn_fields() {
  static const Fields<Matrix3d> fields =
      Fields<Matrix3d>(Matrix3d::Identity())
          .custom(
              {key_of_numbers(KeyName("turn_deg").otherwise("[0, 0, 0]"), 3,
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
              {key_of_numbers(KeyName("at_mm").otherwise("[0, 0, 0]"), 3, "where its zero is")},
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
                put_all(table, turn_fields().written(pose.linear()));
              });
  return fields;
}

}  // namespace abbe::sim
