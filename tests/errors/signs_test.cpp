// The sign of every element, worked out by hand: a point at arm r is displaced by d + theta x r,
// and the arms are written above each machine's table. Elements are 1 um or 1 urad; what is
// neglected is of second order, 1e-12 rad^2 * 800 mm / 2 = 0.4 pm.

#include "tests/errors/machines.h"
#include "tests/test.h"

namespace abbe::errors {
namespace {

/// What an indicator at the tip, standing in the workpiece, sees of one element.
struct Sign {
  const char* element;
  Vector3d tip_um;
  Vector3d turn_urad;
};

struct Machine {
  const char* code;
  kinematics::Chain chain;
  kinematics::AxisState state;
  std::vector<Sign> signs;
};

constexpr double c30 = 0.86602540378443865;  // cos 30 deg
constexpr double L30 = 0.17320508075688773;  // 0.2 m cos 30 deg

// C = 90 deg turns what happens in the bed into the workpiece: (x, y, z) -> (-y, x, z); what
// happens to C itself comes with the other sign. A = 30 deg; X = 300, Y = 200, Z = -100. Tip in the
// bed (300, 300, 100 - 200 c30). Arms from the carried joint points to the tip, in m:
//   X (0, 0.7, -0.2 - L30)   Y (-0.1, 0.1, -0.25 - L30)   Z (0, 0.05, -0.2 - L30)
//   A (0, 0.1, -L30)   C (0.3, 0.3, 0.15 - L30)
//   s 0.15 along minus its own z; its axes are y (0, c30, 1/2) and z (0, -1/2, c30)
// Location errors turn about the point before the joint's own travel:
//   Y (-0.1, 0.3, -0.25 - L30)   Z (0, 0.05, -0.3 - L30)   A and C as above.
Machine gantry_at_an_angle() {
  const Vector3d none(0, 0, 0);
  return {"w C' b X Y Z A s t",
          gantry(),
          state_at({90.0_deg, 300, 200, -100, 30.0_deg, 0}),
          {
              {"EXX", {0, 1, 0}, none},
              {"EYX", {-1, 0, 0}, none},
              {"EZX", {0, 0, 1}, none},
              {"EAX", {-0.2 - L30, 0, 0.7}, {0, 1, 0}},
              {"EBX", {0, -0.2 - L30, 0}, {-1, 0, 0}},
              {"ECX", {0, -0.7, 0}, {0, 0, 1}},

              {"EXY", {0, 1, 0}, none},
              {"EYY", {-1, 0, 0}, none},
              {"EZY", {0, 0, 1}, none},
              {"EAY", {-0.25 - L30, 0, 0.1}, {0, 1, 0}},
              {"EBY", {0, -0.25 - L30, 0.1}, {-1, 0, 0}},
              {"ECY", {0.1, -0.1, 0}, {0, 0, 1}},

              {"EXZ", {0, 1, 0}, none},
              {"EYZ", {-1, 0, 0}, none},
              {"EZZ", {0, 0, 1}, none},
              {"EAZ", {-0.2 - L30, 0, 0.05}, {0, 1, 0}},
              {"EBZ", {0, -0.2 - L30, 0}, {-1, 0, 0}},
              {"ECZ", {0, -0.05, 0}, {0, 0, 1}},

              {"EXA", {0, 1, 0}, none},
              {"EYA", {-1, 0, 0}, none},
              {"EZA", {0, 0, 1}, none},
              {"EAA", {-L30, 0, 0.1}, {0, 1, 0}},
              {"EBA", {0, -L30, 0}, {-1, 0, 0}},
              {"ECA", {0, -0.1, 0}, {0, 0, 1}},

              {"EXC", {0, -1, 0}, none},
              {"EYC", {1, 0, 0}, none},
              {"EZC", {0, 0, -1}, none},
              {"EAC", {-0.15 + L30, 0, -0.3}, {0, -1, 0}},
              {"EBC", {0, -0.15 + L30, 0.3}, {1, 0, 0}},
              {"ECC", {0.3, 0.3, 0}, {0, 0, -1}},

              {"EXS", {0, 1, 0}, none},
              {"EYS", {-c30, 0, 0.5}, none},
              {"EZS", {0.5, 0, c30}, none},
              {"EAS", {-0.15 * c30, 0, 0.075}, {0, 1, 0}},
              {"EBS", {0, -0.15, 0}, {-c30, 0, 0.5}},

              {"EC0Y", {0.1, -0.3, 0}, {0, 0, 1}},
              {"EB0Z", {0, -0.3 - L30, 0}, {-1, 0, 0}},
              {"EA0Z", {-0.3 - L30, 0, 0.05}, {0, 1, 0}},
              {"EB0A", {0, -L30, 0}, {-1, 0, 0}},
              {"EC0A", {0, -0.1, 0}, {0, 0, 1}},
              {"EA0C", {-0.15 + L30, 0, -0.3}, {0, -1, 0}},
              {"EB0C", {0, -0.15 + L30, 0.3}, {1, 0, 0}},

              {"EY0A", {-1, 0, 0}, none},
              {"EZ0A", {0, 0, 1}, none},
              {"EX0C", {0, -1, 0}, none},
              {"EY0C", {1, 0, 0}, none},
          }};
}

// A = 90 deg turns what happens in the bed into the workpiece: (x, y, z) -> (x, -z, y), and what
// happens to the primed axes comes with the other sign: (-x, z, -y). C = 90 deg. Commands X = -300,
// Y = -200, Z = 100, so the carriages travel by 300, 200, -100. Tip in the bed (400, 300, -50).
// Arms in m:
//   X (0.1, 0.7, -0.35)   Y (0, 0.1, -0.4)   Z (0.1, 0.05, -0.35)   A (0.1, 0.1, -0.15)
//   C (-0.1, 0, -0.3)     s (-0.02, 0, -0.1), its axes x (0, 1, 0) and y (-1, 0, 0)
// before the joint's own travel:  Y (0, 0.3, -0.4)   Z (0.1, 0.05, -0.45)   A and C as above.
Machine turned_gantry_at_an_angle() {
  const Vector3d none(0, 0, 0);
  return {"w A' Z' Y' X' b C s t",
          turned_gantry(),
          state_at({90.0_deg, 100, -200, -300, 90.0_deg, 0}),
          {
              {"EXX", {-1, 0, 0}, none},
              {"EYX", {0, 0, -1}, none},
              {"EZX", {0, 1, 0}, none},
              {"EAX", {0, 0.7, -0.35}, {-1, 0, 0}},
              {"EBX", {0.35, -0.1, 0}, {0, 0, -1}},
              {"ECX", {0.7, 0, -0.1}, {0, 1, 0}},

              {"EXY", {-1, 0, 0}, none},
              {"EYY", {0, 0, -1}, none},
              {"EZY", {0, 1, 0}, none},
              {"EAY", {0, 0.1, -0.4}, {-1, 0, 0}},
              {"EBY", {0.4, 0, 0}, {0, 0, -1}},
              {"ECY", {0.1, 0, 0}, {0, 1, 0}},

              {"EXZ", {-1, 0, 0}, none},
              {"EYZ", {0, 0, -1}, none},
              {"EZZ", {0, 1, 0}, none},
              {"EAZ", {0, 0.05, -0.35}, {-1, 0, 0}},
              {"EBZ", {0.35, -0.1, 0}, {0, 0, -1}},
              {"ECZ", {0.05, 0, -0.1}, {0, 1, 0}},

              {"EXA", {-1, 0, 0}, none},
              {"EYA", {0, 0, -1}, none},
              {"EZA", {0, 1, 0}, none},
              {"EAA", {0, 0.1, -0.15}, {-1, 0, 0}},
              {"EBA", {0.15, -0.1, 0}, {0, 0, -1}},
              {"ECA", {0.1, 0, -0.1}, {0, 1, 0}},

              {"EXC", {1, 0, 0}, none},
              {"EYC", {0, 0, 1}, none},
              {"EZC", {0, -1, 0}, none},
              {"EAC", {0, 0, 0.3}, {1, 0, 0}},
              {"EBC", {-0.3, -0.1, 0}, {0, 0, 1}},
              {"ECC", {0, 0, -0.1}, {0, -1, 0}},

              {"EXS", {0, 0, 1}, none},
              {"EYS", {-1, 0, 0}, none},
              {"EZS", {0, -1, 0}, none},
              {"EAS", {-0.1, -0.02, 0}, {0, 0, 1}},
              {"EBS", {0, 0, -0.1}, {-1, 0, 0}},

              {"EC0Y", {0.3, 0, 0}, {0, 1, 0}},
              {"EB0Z", {0.45, -0.1, 0}, {0, 0, -1}},
              {"EA0Z", {0, 0.05, -0.45}, {-1, 0, 0}},
              {"EB0A", {0.15, -0.1, 0}, {0, 0, -1}},
              {"EC0A", {0.1, 0, -0.1}, {0, 1, 0}},
              {"EA0C", {0, 0, 0.3}, {1, 0, 0}},
              {"EB0C", {-0.3, -0.1, 0}, {0, 0, 1}},

              {"EY0A", {0, 0, -1}, none},
              {"EZ0A", {0, 1, 0}, none},
              {"EX0C", {1, 0, 0}, none},
              {"EY0C", {0, 0, 1}, none},
          }};
}

// S = 90 deg maps as A did above. Commands X = -5 (the slide goes to +5), Z = -8. Tip in the bed
// (20, 0, 4). Arms in m: S (0.015, 0, 0.004)   X (0.005, 0, 0.034)   Z (0, 0, -0.088), before its
// own travel (0, 0, -0.096).
Machine platform_at_an_angle() {
  const Vector3d none(0, 0, 0);
  return {"w S' X' b Z t",
          platform(),
          state_at({90.0_deg, -5, -8}),
          {
              {"EXS", {-1, 0, 0}, none},
              {"EYS", {0, 0, -1}, none},
              {"EZS", {0, 1, 0}, none},
              {"EBS", {-0.004, -0.015, 0}, {0, 0, -1}},
              {"ECS", {0, 0, -0.015}, {0, 1, 0}},

              {"EXX", {-1, 0, 0}, none},
              {"EYX", {0, 0, -1}, none},
              {"EZX", {0, 1, 0}, none},
              {"EAX", {0, 0, 0.034}, {-1, 0, 0}},
              {"EBX", {-0.034, -0.005, 0}, {0, 0, -1}},
              {"ECX", {0, 0, -0.005}, {0, 1, 0}},

              {"EXZ", {1, 0, 0}, none},
              {"EYZ", {0, 0, 1}, none},
              {"EZZ", {0, -1, 0}, none},
              {"EAZ", {0, 0, 0.088}, {1, 0, 0}},
              {"EBZ", {-0.088, 0, 0}, {0, 0, 1}},
              {"ECZ", {0, 0, 0}, {0, -1, 0}},
              {"EB0Z", {-0.096, 0, 0}, {0, 0, 1}},
          }};
}

// Y' on the bed carries X', so EC0Y turns X' by its opposite, about Y's point as Y carries it.
// Command Y = -200: Y carries its point to (100, 200, -50). Tip in the bed (20, 10, 45). Arms in m:
//   Y as carried (-0.08, -0.19, 0.095)   Z before its own travel (0.02, -0.04, -0.355)
Machine moving_table() {
  using kinematics::Motion, kinematics::Side;
  const Vector3d x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  return {"w X' Y' b Z t",
          kinematics::Chain({joint('X', Side::Workpiece, Motion::Linear, x, {7, -8, 9}),
                             joint('Y', Side::Workpiece, Motion::Linear, y, {100, 0, -50}),
                             joint('Z', Side::Tool, Motion::Linear, z, {0, 50, 400})},
                            at(0, 0, 0), at(20, 10, 5)),
          state_at({30, -200, 40}),
          {
              {"EC0Y", {0.19, -0.08, 0}, {0, 0, 1}},
              {"EB0Z", {-0.355, 0, -0.02}, {0, 1, 0}},
              {"EA0Z", {0, 0.355, -0.04}, {1, 0, 0}},
          }};
}

// Y carries Z carries X: EC0Y turns Z and X by its opposite, EB0Z turns X, EA0Z turns Z itself.
// Y = 50, Z = -20, X = 100; tip in the bed (105, 56, -13). Arms in m:
//   Y as carried (0.105, -0.024, -0.003)   Z as carried (0.145, 0.006, -0.053), before its own
//   travel (0.145, 0.006, -0.073)
Machine column_that_carries_x() {
  using kinematics::Motion, kinematics::Side;
  const Vector3d x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  return {"w b Y Z X t",
          kinematics::Chain({joint('Y', Side::Tool, Motion::Linear, y, {0, 30, -10}),
                             joint('Z', Side::Tool, Motion::Linear, z, {-40, 0, 60}),
                             joint('X', Side::Tool, Motion::Linear, x, {1, 2, 3})},
                            at(0, 0, 0), at(5, 6, 7)),
          state_at({50, -20, 100}),
          {
              {"EC0Y", {-0.024, -0.105, 0}, {0, 0, -1}},
              {"EB0Z", {0.053, 0, 0.145}, {0, -1, 0}},
              {"EA0Z", {0, 0.073, 0.006}, {1, 0, 0}},
          }};
}

void expect_signs(const Machine& machine) {
  const kinematics::Pose T_wt = machine.chain.tool_in_workpiece(machine.state.q);
  double worst_mm = 0.0;
  double worst_rad = 0.0;
  for (const Sign& sign : machine.signs) {
    const ElementName name = parse_element_name(sign.element);
    const double size = name.is_angle() ? 1.0_urad : 1.0_um;
    const GeometricModel model = bind({{element(sign.element, Constant{size})}, {}}, machine.chain);
    const kinematics::Pose T_wt_actual =
        machine.chain.tool_in_workpiece(machine.state.q, deviations(model, machine.state));
    const Vector3d tip = T_wt_actual.translation() - T_wt.translation();
    const Vector3d turn =
        kinematics::rotation_vector(T_wt_actual.linear() * T_wt.linear().transpose());
    const double off_mm = (tip - sign.tip_um * 1.0_um).norm();
    const double off_rad = (turn - sign.turn_urad * 1.0_urad).norm();
    EXPECT_LT(off_mm, 1e-9) << machine.code << " " << sign.element << " tip in um "
                            << tip.transpose() / 1.0_um;
    EXPECT_LT(off_rad, 1e-13) << machine.code << " " << sign.element << " turn in urad "
                              << turn.transpose() / 1.0_urad;
    worst_mm = std::max(worst_mm, off_mm);
    worst_rad = std::max(worst_rad, off_rad);
  }
  std::cout << machine.code << ": " << machine.signs.size() << " elements, worst " << worst_mm
            << " mm, " << worst_rad << " rad off the hand\n";
}

std::set<std::string> names(const Machine& machine) {
  std::set<std::string> result;
  for (const Sign& sign : machine.signs) result.insert(sign.element);
  return result;
}

TEST(Signs, EveryElementOfTheGantryMovesTheTipAsWorkedOutByHand) {
  expect_signs(gantry_at_an_angle());
}

TEST(Signs, EveryElementMovesTheTipTheOtherWayWhenItsAxisChangesSides) {
  expect_signs(turned_gantry_at_an_angle());
}

TEST(Signs, EveryElementOfThePlatformMovesTheTipAsWorkedOutByHand) {
  expect_signs(platform_at_an_angle());
}

TEST(Signs, ASquarenessTurnsWhatItsAxisCarriesTheOtherWayWhereThatIsItsReference) {
  expect_signs(moving_table());
  expect_signs(column_that_carries_x());
}

TEST(Signs, TheTablesHoldAllFortySixElementsOnBothSides) {
  EXPECT_EQ(names(gantry_at_an_angle()).size(), 46u);
  EXPECT_EQ(names(gantry_at_an_angle()), names(turned_gantry_at_an_angle()));
}

}  // namespace
}  // namespace abbe::errors
