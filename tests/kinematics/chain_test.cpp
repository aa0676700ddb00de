#include "kinematics/chain.h"
#include "kinematics/axes.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/pose.h"
#include "tests/kinematics/machines.h"
#include "tests/test.h"

namespace abbe::kinematics {
namespace {

using machines::slide;
using machines::turn;
using machines::x;
using machines::y;
using machines::z;

AxisVector axes(std::initializer_list<double> values) {
  AxisVector q(Index(values.size()));
  std::copy(values.begin(), values.end(), q.data());
  return q;
}

// One component of one joint's deviation, everything else zero.
std::vector<JointDeviation> only(const Chain& chain, char name, int component, double value,
                                 bool location) {
  std::vector<JointDeviation> deviations(std::size_t(chain.size()));
  JointDeviation& joint = deviations[std::size_t(*chain.find(name))];
  (location ? joint.location : joint.motion)[component] = value;
  return deviations;
}

std::vector<JointDeviation> motion_of(const Chain& chain, char name, int component, double value) {
  return only(chain, name, component, value, false);
}

std::vector<JointDeviation> location_of(const Chain& chain, char name, int component,
                                        double value) {
  return only(chain, name, component, value, true);
}

// What deviations do to the tip, workpiece frame.
Vector3d tip_shift(const Chain& chain, const AxisVector& q,
                   const std::vector<JointDeviation>& deviations) {
  return chain.tool_in_workpiece(q, deviations).translation() -
         chain.tool_in_workpiece(q).translation();
}

// Numbers of a component in a Deviation.
enum : int { EX, EY, EZ, EA, EB, EC };

// w C' b X Y Z t with the table centre, the workpiece and the tip at zero all in the origin.
Chain table_C(DeviationAxes deviation_axes = DeviationAxes::Fixed) {
  Joint C = turn('C', Side::Workpiece, z);
  C.deviation_axes = deviation_axes;
  return Chain({C, slide('X', Side::Tool, x), slide('Y', Side::Tool, y), slide('Z', Side::Tool, z)},
               Pose::Identity(), Pose::Identity());
}

// w b A t: a head that swivels about x through the origin, its tip 100 mm below.
Chain head_A(DeviationAxes deviation_axes = DeviationAxes::Fixed) {
  Joint A = turn('A', Side::Tool, x);
  A.deviation_axes = deviation_axes;
  return Chain({A}, Pose::Identity(), machines::placed({0, 0, -100}));
}

// w b X Y t, or w X' Y' b t with the same commands; Y stands on X on either side.
Chain cross_slides(Side side, Squareness squareness = Squareness::Frame) {
  Joint X = slide('X', side, x);
  Joint Y = slide('Y', side, y);
  Y.squareness = squareness;
  const auto joints = side == Side::Tool ? std::vector<Joint>{X, Y} : std::vector<Joint>{Y, X};
  return Chain(joints, Pose::Identity(), machines::placed({0, 0, 30}));
}

TEST(Chain, AtZeroIsTheHomePoses) {
  for (const auto& [name, chain] : machines::all()) {
    const Pose expected = chain.T_bw_home().inverse() * chain.T_bt_home();
    const Pose T_wt = chain.tool_in_workpiece(AxisVector::Zero(chain.size()));
    EXPECT_LT((T_wt.matrix() - expected.matrix()).cwiseAbs().maxCoeff(), 1e-12) << name;
  }
}

TEST(Chain, PositiveCTurnsTheToolCounterClockwiseInTheWorkpieceOnEitherSide) {
  const double quarter = 90.0_deg;
  const Chain table = table_C();
  EXPECT_LT(
      (table.tool_in_workpiece(axes({quarter, 100, 0, 0})).translation() - Vector3d(0, 100, 0))
          .norm(),
      1e-13);
  const Chain head({turn('C', Side::Tool, z)}, Pose::Identity(), machines::placed({100, 0, 0}));
  EXPECT_LT((head.tool_in_workpiece(axes({quarter})).translation() - Vector3d(0, 100, 0)).norm(),
            1e-13);
}

TEST(Chain, PositiveXMovesTheToolToPositiveXInTheWorkpieceOnEitherSide) {
  for (const Side side : {Side::Tool, Side::Workpiece}) {
    const Chain machine = cross_slides(side);
    const AxisVector q = side == Side::Tool ? axes({7, 3}) : axes({3, 7});
    EXPECT_EQ(Vector3d(machine.tool_in_workpiece(q).translation()), Vector3d(7, 3, 30));
  }
}

TEST(Chain, APrimedCarriageItselfMovesAgainstItsCommand) {
  const Chain machine = cross_slides(Side::Workpiece);
  EXPECT_EQ(Vector3d(machine.workpiece_in_bed(axes({3, 7})).translation()), Vector3d(-7, -3, 0));
  EXPECT_EQ(Vector3d(machine.tool_in_bed(axes({3, 7})).translation()), Vector3d(0, 0, 30));
  EXPECT_EQ(carriage_travel(Side::Workpiece, 7.0), -7.0);
  EXPECT_EQ(carriage_travel(Side::Tool, 7.0), 7.0);
}

TEST(Chain, OfTheGantryFollowsAHandComputedPose) {
  // C = 90, A = -90 deg, table centre and pivot known: the tool axis z turns to +y by A, then to -x
  // by C; the tip hangs 200 mm below the pivot.
  const Chain machine(
      {turn('C', Side::Workpiece, z, {10, 0, 0}), slide('X', Side::Tool, x),
       slide('Y', Side::Tool, y), slide('Z', Side::Tool, z), turn('A', Side::Tool, x, {0, 0, 200})},
      Pose::Identity(), Pose::Identity());
  const Pose T_wt = machine.tool_in_workpiece(axes({90.0_deg, 15, 20, 30, -90.0_deg}));
  // In the bed the tip stands at (15, 20 - 200, 30 + 200); about (10, 0) by 90 deg: (10 + 180, 5).
  EXPECT_LT((T_wt.translation() - Vector3d(190, 5, 230)).norm(), 1e-12);
  EXPECT_LT((T_wt.linear() * z - Vector3d(-1, 0, 0)).norm(), 1e-15);
}

TEST(Chain, TableOffsetEX0CMovesTheToolOnACircleInTheWorkpiece) {
  const double ex = 10.0_um;
  const Chain machine = table_C();
  for (const double c : {0.0, 0.3, 1.7, 3.1, -2.2}) {
    const Vector3d d =
        tip_shift(machine, axes({c, 80, -40, 15}), location_of(machine, 'C', EX, ex));
    // by hand: the table has moved by +ex in the bed, the tool by -ex; the workpiece sees it turned
    const Vector3d expected(-ex * std::cos(c), -ex * std::sin(c), 0);
    EXPECT_LT((d - expected).norm(), 1e-13) << "C = " << c;
  }
}

TEST(Chain, PositiveEC0YOpensTheAngleFromXToYOnEitherSide) {
  const double square = 40.0_urad;
  for (const Side side : {Side::Tool, Side::Workpiece})
    for (const Squareness how : {Squareness::Frame, Squareness::Travel}) {
      const Chain machine = cross_slides(side, how);
      const auto wrong = location_of(machine, 'Y', EC, square);
      const auto tip = [&](double qx, double qy) -> Vector3d {
        const AxisVector q = side == Side::Tool ? axes({qx, qy}) : axes({qy, qx});
        return machine.tool_in_workpiece(q, wrong).translation();
      };
      const Vector3d along_x = tip(100, 0) - tip(0, 0);
      const Vector3d along_y = tip(0, 100) - tip(0, 0);
      const double angle = std::atan2(along_x.cross(along_y).z(), along_x.dot(along_y));
      EXPECT_NEAR(angle, 0.5 * pi + square, 1e-14) << int(side) << " " << int(how);
    }
}

TEST(Chain, FrameSquarenessTurnsEverythingDownstreamAndTravelSquarenessTheDirectionOnly) {
  const double square = 40.0_urad;
  Joint Z = slide('Z', Side::Tool, z, {0, 0, 500});
  const AxisVector q = axes({100});
  for (const Squareness how : {Squareness::Frame, Squareness::Travel}) {
    Z.squareness = how;
    const Chain machine({Z}, Pose::Identity(), machines::placed({0, 0, 200}));
    const Pose T_wt = machine.tool_in_workpiece(q, location_of(machine, 'Z', EB, square));
    const Vector3d axis = T_wt.linear() * z;
    // EB > 0 turns z towards x. About the point at 500 the tip 300 below leans to -x; travel adds.
    const double turned = how == Squareness::Frame ? std::sin(square) : 0.0;
    EXPECT_NEAR(T_wt.translation().x(), 100 * std::sin(square) - 300 * turned, 1e-15);
    EXPECT_NEAR(axis.x(), turned, 1e-18);
  }
}

TEST(Chain, TravelSquarenessOfARotaryAxisTiltsItsLineOnly) {
  const double tilt = 1e-3;
  Joint C = turn('C', Side::Tool, z, {0, 0, 0});
  C.squareness = Squareness::Travel;
  const Chain machine({C}, Pose::Identity(), machines::placed({100, 0, 0}));
  const auto wrong = location_of(machine, 'C', EB, tilt);
  // nothing has turned yet, so nothing shows
  EXPECT_LT(tip_shift(machine, axes({0}), wrong).norm(), 1e-13);
  // half a turn about the line u = (sin t, 0, cos t): p -> 2 u (u.p) - p
  const Vector3d expected =
      200 * std::sin(tilt) * Vector3d(std::sin(tilt), 0, std::cos(tilt)) - Vector3d(100, 0, 0);
  EXPECT_LT((machine.tool_in_workpiece(axes({pi}), wrong).translation() - expected).norm(), 1e-13);
}

TEST(Chain, OffsetsActAlikeInBothKindsOfSquareness) {
  for (const auto& [name, chain] : machines::all()) {
    const Chain frame = machines::with_options(chain, DeviationAxes::Fixed, Squareness::Frame);
    const Chain travel = machines::with_options(chain, DeviationAxes::Fixed, Squareness::Travel);
    const AxisVector q = AxisVector::Constant(chain.size(), 0.7);
    for (const Joint& joint : chain.joints())
      for (const int component : {EX, EY, EZ}) {
        const Vector3d a = tip_shift(frame, q, location_of(chain, joint.name, component, 0.01));
        const Vector3d b = tip_shift(travel, q, location_of(chain, joint.name, component, 0.01));
        EXPECT_LT((a - b).norm(), 1e-12) << name << " " << joint.name << " " << component;
        EXPECT_NEAR(a.norm(), 0.01, 1e-12);
      }
  }
}

TEST(Chain, ErrorMotionOfAToolSlideActsAfterItsTravelAtThePointThatItCarries) {
  const double pitch = 20.0_urad;
  const Chain machine({slide('X', Side::Tool, x, {50, 0, 400})}, Pose::Identity(),
                      machines::placed({0, 0, 100}));
  for (const double q : {-300.0, 0.0, 300.0}) {
    // by hand: the tip stays 50 before and 300 below the carried point: EB x (-50, 0, -300)
    const Vector3d d = tip_shift(machine, axes({q}), motion_of(machine, 'X', EB, pitch));
    const Vector3d expected(-300 * std::sin(pitch) + 50 * (1 - std::cos(pitch)), 0,
                            50 * std::sin(pitch) + 300 * (1 - std::cos(pitch)));
    EXPECT_LT((d - expected).norm(), 1e-13);
  }
}

TEST(Chain, ErrorMotionOfAPrimedSlideHasALeverThatGrowsWithTravel) {
  const double yaw = 20.0_urad;
  const Chain machine({slide('X', Side::Workpiece, x, {50, 0, 0})}, Pose::Identity(),
                      machines::placed({0, 0, 100}));
  for (const double q : {-300.0, 0.0, 300.0}) {
    // by hand: the carriage turns by +yaw about its point, which it has carried to 50 - q, so the
    // workpiece sees the tip, q - 50 beyond that point, turn by -yaw
    const Vector3d d = tip_shift(machine, axes({q}), motion_of(machine, 'X', EC, yaw));
    const double lever = q - 50;
    const Vector3d expected(lever * (std::cos(yaw) - 1), -lever * std::sin(yaw), 0);
    EXPECT_LT((d - expected).norm(), 1e-13) << q;
  }
}

TEST(Chain, TranslationsOfACarriageMoveTheToolAlongOnItsOwnSideAndAgainstOnTheOther) {
  for (const int component : {EX, EY, EZ})
    for (const Side side : {Side::Tool, Side::Workpiece}) {
      const Chain machine = cross_slides(side);
      for (const char name : {'X', 'Y'}) {
        const Vector3d d =
            tip_shift(machine, axes({12, -9}), motion_of(machine, name, component, 5.0_um));
        Vector3d expected = Vector3d::Zero();
        expected[component] = side == Side::Tool ? 5.0_um : -5.0_um;
        EXPECT_LT((d - expected).norm(), 1e-14);
      }
    }
}

TEST(Chain, ErrorMotionOfARotaryAxisIsAlongAxesThatDoNotTurn) {
  const double e = 5.0_um;
  for (const double q : {0.0, 0.4, 90.0_deg, 180.0_deg, -2.0}) {
    const Vector3d head = tip_shift(head_A(), axes({q}), motion_of(head_A(), 'A', EZ, e));
    EXPECT_LT((head - Vector3d(0, 0, e)).norm(), 1e-13) << q;
    const Vector3d table =
        tip_shift(table_C(), axes({q, 80, 0, 0}), motion_of(table_C(), 'C', EX, e));
    EXPECT_LT((table - Vector3d(-e * std::cos(q), -e * std::sin(q), 0)).norm(), 1e-13) << q;
  }
}

TEST(Chain, TurningErrorMotionOfARotaryAxisTurnsWithIt) {
  const double e = 5.0_um;
  const Chain head = head_A(DeviationAxes::Turning);
  const Chain table = table_C(DeviationAxes::Turning);
  for (const double q : {0.0, 0.4, 90.0_deg, 180.0_deg, -2.0}) {
    // positive A turns z to -y
    const Vector3d d = tip_shift(head, axes({q}), motion_of(head, 'A', EZ, e));
    EXPECT_LT((d - Vector3d(0, -e * std::sin(q), e * std::cos(q))).norm(), 1e-13) << q;
    // on the table it is a shift of the workpiece and nothing else
    const Vector3d shift = tip_shift(table, axes({q, 80, 0, 0}), motion_of(table, 'C', EX, e));
    EXPECT_LT((shift - Vector3d(-e, 0, 0)).norm(), 1e-13) << q;
  }
}

TEST(Chain, TurningMeansNothingToASlide) {
  const std::vector<Joint> joints = cross_slides(Side::Tool).joints();
  std::vector<Joint> turning = joints;
  for (Joint& joint : turning) joint.deviation_axes = DeviationAxes::Turning;
  const Chain a(joints, Pose::Identity(), machines::placed({0, 0, 30}));
  const Chain b(turning, Pose::Identity(), machines::placed({0, 0, 30}));
  const auto wrong = motion_of(a, 'X', EB, 1e-3);
  EXPECT_EQ(a.tool_in_workpiece(axes({20, 30}), wrong).matrix(),
            b.tool_in_workpiece(axes({20, 30}), wrong).matrix());
}

TEST(Chain, SpindleNoseMovesNothingButItsDeviations) {
  const Chain machine({machines::nose({0, 0, 200})}, Pose::Identity(), Pose::Identity());
  EXPECT_EQ(machine.tool_in_workpiece(axes({1.3})).matrix(), Pose::Identity().matrix());
  // a tilt EB at the nose swings a tip 200 mm below it to -x
  const Vector3d d = tip_shift(machine, axes({1.3}), motion_of(machine, 's', EB, 10.0_urad));
  EXPECT_NEAR(d.x(), -200 * std::sin(10e-6), 1e-13);
}

TEST(Chain, WithZeroDeviationsIsTheNominalMachineBitForBit) {
  SeededRandom random(20250302);
  for (const auto& [name, chain] : machines::all())
    for (const DeviationAxes deviation_axes : {DeviationAxes::Fixed, DeviationAxes::Turning})
      for (const Squareness squareness : {Squareness::Frame, Squareness::Travel}) {
        const Chain machine = machines::with_options(chain, deviation_axes, squareness);
        std::vector<JointDeviation> zero(std::size_t(chain.size()));
        std::vector<JointDeviation> negative_zero = zero;
        for (JointDeviation& d : negative_zero) d.motion = d.location = -Deviation::Zero();
        for (int i = 0; i < 200; ++i) {
          const AxisVector q = machines::anywhere(machine, random);
          const Pose nominal = machine.tool_in_workpiece(q);
          ASSERT_EQ(machine.tool_in_workpiece(q, zero).matrix(), nominal.matrix()) << name;
          ASSERT_EQ(machine.tool_in_workpiece(q, negative_zero).matrix(), nominal.matrix()) << name;
        }
      }
}

TEST(Chain, PosesAreWorkpieceInvertedTimesTool) {
  std::mt19937 random(7);
  for (const auto& [name, chain] : machines::all()) {
    const AxisVector q = machines::anywhere(chain, random);
    const Pose T_wt = chain.workpiece_in_bed(q).inverse() * chain.tool_in_bed(q);
    EXPECT_EQ(T_wt.matrix(), chain.tool_in_workpiece(q).matrix()) << name;
  }
}

TEST(Chain, FindsItsJointsByLetter) {
  const Chain machine = machines::gantry();
  EXPECT_EQ(machine.find('C'), 0);
  EXPECT_EQ(machine.find('s'), 5);
  EXPECT_EQ(machine.find('B'), std::nullopt);
}

TEST(ErrorTransform, IsExpressedInTheNominalToolFrame) {
  // the tool points along +x of the workpiece: a shift along x is a shift along its own z
  const Pose nominal = machines::placed({5, 6, 7}, 90.0_deg, y);
  Pose actual = nominal;
  actual.translation() += Vector3d(0.01, 0, 0);
  const Pose E = error_transform(nominal, actual);
  EXPECT_LT((E.translation() - Vector3d(0, 0, 0.01)).norm(), 1e-15);
  EXPECT_LT((E.linear() - Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-15);
}

TEST(Chain, RefusesWhatIsNoMachine) {
  const Pose I = Pose::Identity();
  const Joint X = slide('X', Side::Tool, x);
  const auto refused = [&](const Joint& joint) {
    EXPECT_THROW(Chain({joint}, I, I), std::invalid_argument);
  };
  const auto changed = [&](auto change) {
    Joint joint = X;
    change(joint);
    return joint;
  };
  EXPECT_NO_THROW(Chain({X}, I, I));
  refused(changed([](Joint& j) { j.direction_b = Vector3d(1, 1e-5, 0); }));
  refused(changed([](Joint& j) { j.direction_b = Vector3d::Zero(); }));
  refused(changed([](Joint& j) { j.direction_b = Vector3d(nan, 0, 0); }));
  refused(changed([](Joint& j) { j.point_b.y() = nan; }));
  refused(changed([](Joint& j) { j.min = nan; }));
  refused(changed([](Joint& j) { j.max = nan; }));
  refused(changed([](Joint& j) { j.max = j.min - 1; }));
  EXPECT_THROW(Chain({X, X}, I, I), std::invalid_argument);
  EXPECT_THROW(Chain({X, turn('C', Side::Workpiece, z)}, I, I), std::invalid_argument);
  std::vector<Joint> nine;
  for (const char name : {'X', 'Y', 'Z', 'U', 'V', 'W', 'A', 'B', 'C'})
    nine.push_back(changed([&](Joint& j) { j.name = name; }));
  EXPECT_THROW(Chain(nine, I, I), std::invalid_argument);
}

TEST(Chain, RefusesHomePosesThatAreNotRigid) {
  const Pose I = Pose::Identity();
  Pose scaled = I;
  scaled.linear() *= 1.001;
  Pose mirrored = I;
  mirrored.linear()(0, 0) = -1;
  Pose lost = I;
  lost.translation().x() = nan;
  for (const Pose& T : {scaled, mirrored, lost}) {
    EXPECT_THROW(Chain({}, T, I), std::invalid_argument);
    EXPECT_THROW(Chain({}, I, T), std::invalid_argument);
  }
}

TEST(Chain, StaysRigidWhereDirectionsAreUnitOnlyToTheirTolerance) {
  Joint C = turn('C', Side::Tool, Vector3d(0, 0, 1 + 9e-13));
  const Chain machine({C}, Pose::Identity(), Pose::Identity());
  const Matrix3d R = machine.tool_in_workpiece(axes({2.0})).linear();
  EXPECT_LT((R.transpose() * R - Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-15);
}

TEST(Chain, CarriagesCarryToolAndWorkpiece) {
  SeededRandom random(20261126);
  std::uniform_real_distribution<double> unit(-1, 1);
  const Pose home_w = machines::placed({10, -20, 30}, 0.2, {2, 1, 2}),
             home_t = machines::placed({1, 2, 3}, 0.3, {1, 2, 2});
  const Chain chain(
      {machines::turn('C', Side::Workpiece, machines::z, {5, 6, 7}),
       machines::slide('Y', Side::Workpiece, machines::y, {1, 2, 3}),
       machines::slide('X', Side::Tool, machines::x, {300, -200, 450}),
       machines::turn('A', Side::Tool, machines::x, {9, 8, 200}), machines::nose({0, 0, 50})},
      home_w, home_t);
  for (int n = 0; n < 50; ++n) {
    std::vector<JointDeviation> wrong(5);
    AxisVector q(5);
    for (int k = 0; k < 5; ++k) {
      q[k] = k == 0 || k >= 3 ? 2.0 * unit(random) : 300.0 * unit(random);
      for (int i = 0; i < 6; ++i) {
        wrong[std::size_t(k)].motion[i] = 1e-3 * unit(random);
        wrong[std::size_t(k)].location[i] = 1e-3 * unit(random);
      }
    }
    const std::vector<Pose> T = carriage_poses(chain, q, wrong);
    ASSERT_EQ(T.size(), 5u);
    EXPECT_EQ((T[0] * home_w).matrix(), chain.workpiece_in_bed(q, wrong).matrix());
    EXPECT_EQ((T[4] * home_t).matrix(), chain.tool_in_bed(q, wrong).matrix());
    // each but for its own joint and those beyond it
    AxisVector without = q;
    without[0] = 0.0;
    EXPECT_EQ(carriage_poses(chain, without, wrong)[1].matrix(), T[1].matrix());
  }
}

// A chain may turn by small angles in a cheaper way than motion() does; nobody may see it.
TEST(ChainDeviation, IsTheProductOfTheExactMotionsAtEverySizeOfTheAngle) {
  SeededRandom random(20260111);
  std::uniform_real_distribution<double> unit(-1, 1);
  const Pose home = machines::placed({1, 2, 3}, 0.3, {1, 2, 2});
  const Vector3d point_x(300, -200, 450), point_y(-120, 80, 700);
  const Chain chain({machines::slide('X', Side::Tool, machines::x, point_x),
                     machines::slide('Y', Side::Tool, machines::y, point_y)},
                    Pose::Identity(), home);
  double worst_turn = 0.0, worst_place = 0.0;
  for (const double size : {0.0, 1e-300, 1e-150, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 3.1e-3, 3.2e-3,
                            1e-2, 0.1, 1.0, 3.14, 10.0})
    for (int i = 0; i < 200; ++i) {
      const auto any = [&] { return Vector3d(unit(random), unit(random), unit(random)); };
      std::vector<JointDeviation> wrong(2);
      for (JointDeviation& one : wrong) {
        one.motion << any(), size * any().normalized();
        one.location << any(), size * any().normalized();
      }
      AxisVector q(2);
      q << 100.0 * unit(random), 100.0 * unit(random);
      const Pose expected =
          motion(wrong[0].location, point_x) * Eigen::Translation3d(q[0] * machines::x) *
          motion(wrong[0].motion, point_x) * motion(wrong[1].location, point_y) *
          Eigen::Translation3d(q[1] * machines::y) * motion(wrong[1].motion, point_y) * home;
      const Pose seen = chain.tool_in_workpiece(q, wrong);
      worst_turn = std::max(worst_turn, (seen.linear() - expected.linear()).cwiseAbs().maxCoeff());
      worst_place = std::max(worst_place, (seen.translation() - expected.translation()).norm());
    }
  std::cout << "largest difference: " << worst_turn << ", " << worst_place << " mm\n";
  EXPECT_LT(worst_turn, 4e-15);
  EXPECT_LT(worst_place, 4e-12);
}

std::string refusal(std::string_view code) {
  return thrown_text<std::invalid_argument>([&] { parse_structural_code(code); }, "accepted");
}

TEST(StructuralCode, OfTheGantryHasItsAxesInOrder) {
  const Topology expected = {{'C', Side::Workpiece}, {'X', Side::Tool}, {'Y', Side::Tool},
                             {'Z', Side::Tool},      {'A', Side::Tool}, {'s', Side::Tool}};
  EXPECT_EQ(parse_structural_code("w C' b X Y Z A s t"), expected);
  EXPECT_EQ(parse_structural_code("wC'bXYZAst"), expected);
  EXPECT_EQ(parse_structural_code("  w\tC 'bX YZ A s t "), expected);
}

TEST(StructuralCode, IsWrittenAsItIsRead) {
  for (const char* code : {"w C' b X Y Z A s t", "w S' X' b Z t", "w C' A' b X Y Z s t",
                           "w b X Y Z C A s t", "w X' Y' b Z s t", "w X' Y' Z' b t", "w b t",
                           "w U' V' W' b X Y Z A s t", "w C' b X Y Z W A s t"}) {
    const Topology topology = parse_structural_code(code);
    EXPECT_EQ(to_string(topology), code);
    EXPECT_EQ(parse_structural_code(to_string(topology)), topology);
  }
}

TEST(StructuralCode, RefusalsSayWhatWasExpectedAndSeen) {
  const std::string head = "structural code: expected ";
  EXPECT_EQ(refusal(""), head + "w as the first letter, seen nothing");
  EXPECT_EQ(refusal("  "), head + "w as the first letter, seen nothing");
  EXPECT_EQ(refusal("b X t"), head + "w as the first letter, seen 'b'");
  EXPECT_EQ(refusal("w"), head + "t as the last letter, seen 'w'");
  EXPECT_EQ(refusal("w b X"), head + "t as the last letter, seen 'X'");
  EXPECT_EQ(refusal("w b X b t"), head + "only one b, seen a second b");
  EXPECT_EQ(refusal("w t"), head + "b for the bed, seen no b");
  EXPECT_EQ(refusal("w X' t"), head + "b for the bed, seen no b");
  EXPECT_EQ(refusal("w X b t"),
            head + "a prime after 'X', which carries the workpiece, seen no prime");
  EXPECT_EQ(refusal("w b X' t"), head + "no prime after 'X', which carries the tool, seen a prime");
  EXPECT_EQ(refusal("w X' b X t"), head + "each letter only once, seen 'X' twice");
  EXPECT_EQ(refusal("w b s X t"), head + "s directly before t, seen s elsewhere");
  EXPECT_EQ(refusal("w s' b X t"), head + "s directly before t, seen s elsewhere");
  EXPECT_EQ(refusal("w b X s' t"), head + "s directly before t, seen s elsewhere");
  EXPECT_EQ(refusal("w b x t"), head + "an axis letter of XYZUVWABCS, b or s, seen 'x'");
  EXPECT_EQ(refusal("w ' b X t"), head + "an axis letter of XYZUVWABCS, b or s, seen '''");
  EXPECT_EQ(refusal(std::string("w b \n t")),
            head + "an axis letter of XYZUVWABCS, b or s, seen a character of code 10");
  EXPECT_EQ(refusal("w C\xc3\xa2 b t"),
            head + "a prime after 'C', which carries the workpiece, seen no prime");
  EXPECT_EQ(refusal(std::string("w b \0 t", 7)),
            head + "an axis letter of XYZUVWABCS, b or s, seen a character of code 0");
  EXPECT_EQ(refusal("w X' Y' Z' b U V W A B C t"), head + "at most 8 joints, seen 9");
}

TEST(StructuralCode, OfAMillionLettersIsRefusedAtTheFirstRepetition) {
  EXPECT_EQ(refusal("w b" + std::string(1000000, 'X') + "t"),
            "structural code: expected each letter only once, seen 'X' twice");
}

TEST(BodyArray, OfThePlatformIsPengs) {
  const BodyArray array = low_order_body_array(parse_structural_code("w S' X' b Z s t"));
  EXPECT_EQ(array.parent, (std::vector<int>{0, 1, 2, 0, 4, 5}));
  EXPECT_EQ(array.body, (std::vector<std::string>{"X", "S", "workpiece", "Z", "s", "tool"}));
}

TEST(BodyArray, OfTheGantryHasTwoBranchesAtTheBed) {
  const BodyArray array = low_order_body_array(parse_structural_code("w C' b X Y Z A s t"));
  EXPECT_EQ(array.parent, (std::vector<int>{0, 1, 0, 3, 4, 5, 6, 7}));
  EXPECT_EQ(array.body,
            (std::vector<std::string>{"C", "workpiece", "X", "Y", "Z", "A", "s", "tool"}));
}

TEST(BodyArray, OfAMachineWithoutAxesIsWorkpieceAndTool) {
  const BodyArray array = low_order_body_array({});
  EXPECT_EQ(array.parent, (std::vector<int>{0, 0}));
}

// Poles against what poses show: the tool's direction, and what turning an axis does to it.

Vector3d direction_at(const Chain& chain, const AxisVector& q) {
  return chain.tool_in_workpiece(q).linear().col(2);
}

AxisVector with(AxisVector q, int joint, double value) {
  q[joint] = value;
  return q;
}

/// The line of the pole axis in the workpiece, measured: what stays while it turns.
double angle_to_pole(const Chain& chain, const AxisVector& q, int axis) {
  const Vector3d a = direction_at(chain, q);
  const Vector3d b = direction_at(chain, with(q, axis, q[axis] + pi));
  // half a turn about a line at angle t takes the tool by 2 t, or by pi - 2 (pi/2 - t) beyond
  const double moved = angle_between(a, b);
  return 0.5 * moved;
}

TEST(Pole, ByHandOnTheGantry) {
  const Chain chain = machines::gantry();
  const int c = *chain.find('C'), a = *chain.find('A');
  const auto at = [&](double tilt) {
    return with(AxisVector::Zero(chain.size()), a, tilt * units::deg);
  };
  const auto through = nearest_pole(chain, at(-5), at(3));
  ASSERT_TRUE(through);
  EXPECT_EQ(through->axis, c);
  EXPECT_EQ(through->other, a);
  EXPECT_LT(through->angle, 1e-15);
  EXPECT_NEAR(nearest_pole(chain, at(2), at(7))->angle / units::deg, 2.0, 1e-12);
  EXPECT_NEAR(nearest_pole(chain, at(-7), at(-3))->angle / units::deg, 3.0, 1e-12);
  // upside down it is a pole as well, and a turn away the same one
  EXPECT_LT(nearest_pole(chain, at(170), at(190))->angle, 1e-15);
  EXPECT_LT(nearest_pole(chain, at(350), at(365))->angle, 1e-14);
}

TEST(Pole, ThereIsNoneWithoutTwoAxesThatTurnTheTool) {
  const AxisVector q = AxisVector::Zero(machines::moving_table().size());
  EXPECT_FALSE(nearest_pole(machines::moving_table(), q, q));
  const Chain lathe = machines::platform();
  EXPECT_FALSE(nearest_pole(lathe, AxisVector::Zero(lathe.size()), AxisVector::Zero(lathe.size())));
}

TEST(Pole, IsWhatPosesShowOnEveryMachine) {
  SeededRandom random(20261126);
  double worst = 0.0, worst_turn = 0.0;
  for (const machines::Named& machine : machines::five_axis())
    for (int i = 0; i < 1000; ++i) {
      const Chain& chain = machine.chain;
      const AxisVector from = machines::anywhere(chain, random),
                       to = machines::anywhere(chain, random);
      const auto here = nearest_pole(chain, from, from);
      ASSERT_TRUE(here) << machine.name;
      worst = std::max(worst, std::abs(here->angle - angle_to_pole(chain, from, here->axis)));
      // along the way none is nearer, and one is as near
      const auto way = nearest_pole(chain, from, to);
      double least = pi;
      for (int k = 0; k <= 200; ++k)
        least = std::min(least, angle_to_pole(chain, from + k / 200.0 * (to - from), way->axis));
      EXPECT_LE(way->angle, least + 1e-12) << machine.name;
      EXPECT_GE(way->angle, least - pi / 200.0 * std::abs(to[way->other] - from[way->other]))
          << machine.name;
      // no small turn brings the tool nearer to a direction than the nearest one
      const Vector3d wanted = direction_at(chain, to);
      const double turn = nearest_rotary_position(chain, *here, from, wanted);
      const auto off = [&](double by) {
        return angle_between(direction_at(chain, with(from, here->other, turn + by)), wanted);
      };
      for (const double by : {-0.3, -1e-3, 1e-3, 0.3})
        worst_turn = std::max(worst_turn, off(0) - off(by));
    }
  std::cout << "angle to the pole within " << worst << " rad; nearest turn missed by " << worst_turn
            << " rad\n";
  EXPECT_LT(worst, 1e-12);
  EXPECT_LT(worst_turn, 1e-12);
}

}  // namespace
}  // namespace abbe::kinematics
