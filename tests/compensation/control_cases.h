#pragma once

#include <ostream>
#include "sim/compensation/control_files.h"
#include "tests/test.h"

/// What the tests of tables and control files share.
namespace abbe::sim::compensation::cases {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Side;

/// w C' b X Y Z A s t with travel, C without end.
inline Chain gantry() {
  const auto slide = [](char name, const Vector3d& direction, double min, double max) {
    return Joint{name, Side::Tool, Motion::Linear, direction, {3, 40, 600}, min, max, {}, {}};
  };
  const double down = -30.0 * units::deg, up = 120.0 * units::deg;
  return Chain(
      {{'C', Side::Workpiece, Motion::Rotary, Vector3d::UnitZ(), {12, -7, 0}, -1e9, 1e9, {}, {}},
       slide('X', Vector3d::UnitX(), -300, 300),
       slide('Y', Vector3d::UnitY(), -200, 250),
       slide('Z', Vector3d::UnitZ(), -400, 0),
       {'A', Side::Tool, Motion::Rotary, Vector3d::UnitX(), {0, 3, 251}, down, up, {}, {}},
       {'s', Side::Tool, Motion::Spindle, Vector3d::UnitZ(), {1, 2, 120}, -1e9, 1e9, {}, {}}},
      kinematics::Pose::Identity(), kinematics::Pose::Identity());
}
inline constexpr int C = 0, X = 1, Y = 2, Z = 3, A = 4, s = 5;

inline ParameterTables none() { return {{}, AxisVector::Zero(6)}; }

struct Shape {
  bool cross = true;
  bool has_direction_columns = true;
  bool even = true;  ///< equidistant
  int max_points = 60;
};

/// Tables of at most one a pair of axes, 20 um and 100 urad large.
template <typename Random>
ParameterTables any_tables(const Chain& chain, Random& random, const Shape& shape) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  ParameterTables tables = none();
  for (const int argument_joint : {X, Y, Z, A})
    for (const int corrected_joint : {X, Y, Z, A}) {
      if ((argument_joint != corrected_joint && !shape.cross) || unit(random) < -0.4) continue;
      const Joint& joint = chain.joints()[std::size_t(argument_joint)];
      const auto n = std::uniform_int_distribution<Index>(2, shape.max_points)(random);
      AxisTable table{
          argument_joint, corrected_joint, VectorXd::LinSpaced(n, joint.min, joint.max), {}, {}};
      const double spacing = (joint.max - joint.min) / double(n - 1);
      if (!shape.even)
        for (double& p : table.position) p += 0.3 * spacing * unit(random);
      const double large = corrected_joint == A ? 1e-4 : 20e-3;
      table.upward = VectorXd::NullaryExpr(n, [&] { return large * unit(random); });
      table.downward = table.upward;
      if (shape.has_direction_columns)
        table.downward = VectorXd::NullaryExpr(n, [&] { return large * unit(random); });
      tables.tables.push_back(std::move(table));
    }
  return tables;
}

/// Largest difference of two sets of tables over random states within and beyond the travel.
struct Difference {
  double mm = 0.0;
  double rad = 0.0;
};
template <typename Random>
Difference difference(const ParameterTables& a, const ParameterTables& b, const Chain& chain,
                      Random& random) {
  Difference largest;
  std::uniform_real_distribution<double> unit(-0.2, 1.2);
  for (int k = 0; k < 300; ++k) {
    AxisState state;
    state.q = AxisVector::Zero(chain.size());
    for (const int i : {X, Y, Z, A}) {
      const Joint& joint = chain.joints()[std::size_t(i)];
      state.q[i] = joint.min + (joint.max - joint.min) * unit(random);
      state.direction[std::size_t(i)] = unit(random) < 0.5 ? -1 : 1;
    }
    const AxisVector d = (correction(a, state) - correction(b, state)).cwiseAbs();
    largest.mm = std::max(largest.mm, d.segment(X, 3).maxCoeff());
    largest.rad = std::max(largest.rad, d[A]);
  }
  return largest;
}

/// Line and column of a refusal; -1 where there is none.
struct Place {
  int line = -1;
  int column = -1;
  friend bool operator==(const Place&, const Place&) = default;
};
inline std::ostream& operator<<(std::ostream& out, const Place& p) {
  return out << p.line << ":" << p.column;
}
template <typename Read>
Place refusal(const Read& read) {
  try {
    read();
  } catch (const BadInput& bad) {
    EXPECT_FALSE(bad.expected.empty() || bad.seen.empty()) << bad.what();
    return {bad.line, bad.column};
  }
  return {};
}

inline std::string with(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

inline const ControlFile& file(const ControlExport& made, const std::string& name) {
  for (const ControlFile& f : made.files)
    if (f.name == name) return f;
  throw std::runtime_error("no file " + name);
}

/// True if one of the sentences has that part.
inline bool says(const std::vector<std::string>& sentences, const std::string& part) {
  return std::any_of(sentences.begin(), sentences.end(), [&part](const std::string& sentence) {
    return sentence.find(part) != std::string::npos;
  });
}

}  // namespace abbe::sim::compensation::cases
