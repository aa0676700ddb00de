#include "kinematics/inverse_kinematics.h"
#include "tests/kinematics/machines.h"
#include "tests/test.h"

namespace abbe::kinematics {
namespace {

using machines::slide;
using machines::turn;
using machines::x;
using machines::y;
using machines::z;

constexpr double promised_mm = 1e-9;
constexpr double promised_rad = 1e-12;

double angle_of_directions(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

TipTarget target_at(const Chain& chain, const AxisVector& q) {
  const Pose T_wt = chain.tool_in_workpiece(q);
  return {T_wt.translation(), T_wt.linear().col(2)};
}

// Largest errors of poses that were sent through the inverse and back.
struct Worst {
  double mm = 0;
  double rad = 0;

  void take(const Chain& chain, const TipTarget& target, const AxisVector& q) {
    const Pose T_wt = chain.tool_in_workpiece(q);
    mm = std::max(mm, (T_wt.translation() - target.tip_w).norm());
    rad = std::max(rad, angle_of_directions(T_wt.linear().col(2), target.direction_w));
  }
  bool kept() const { return mm <= promised_mm && rad <= promised_rad; }
};

std::ostream& operator<<(std::ostream& out, const Worst& worst) {
  return out << worst.mm << " mm, " << worst.rad << " rad";
}

// Sends the pose at q through the inverse; every branch has to come back to it.
void expect_return(const Chain& chain, const AxisVector& q, const AxisVector& previous,
                   Worst& worst) {
  const TipTarget target = target_at(chain, q);
  const InverseSolution result = inverse(chain, target, previous);
  ASSERT_FALSE(result.branches.empty()) << q.transpose();
  ASSERT_TRUE(result.reach == Reachability::Reached || result.reach == Reachability::Singular);
  const NearestPose nearest = solve_nearest_pose(chain, target, previous);
  ASSERT_EQ(nearest.reach, result.reach);
  ASSERT_EQ(nearest.q, result.branches.front()) << "the same bits";
  for (const AxisVector& branch : result.branches) {
    ASSERT_TRUE(branch.allFinite());
    worst.take(chain, target, branch);
    ASSERT_TRUE(worst.kept()) << worst << " at " << q.transpose() << " branch "
                              << branch.transpose();
  }
}

std::vector<int> rotary_joints(const Chain& chain) {
  std::vector<int> joints;
  for (int i = 0; i < chain.size(); ++i)
    if (chain.joints()[std::size_t(i)].motion == Motion::Rotary) joints.push_back(i);
  return joints;
}

double rotary_travel(const Chain& chain, const AxisVector& a, const AxisVector& b) {
  double travel = 0;
  for (const int i : rotary_joints(chain)) travel += std::abs(a[i] - b[i]);
  return travel;
}

Chain with_limits(const Chain& chain, char name, double min, double max) {
  std::vector<Joint> joints = chain.joints();
  joints[std::size_t(*chain.find(name))].min = min;
  joints[std::size_t(*chain.find(name))].max = max;
  return Chain(joints, chain.T_bw_home(), chain.T_bt_home());
}

// Angles at which inverses break: home, multiples of 45 degrees, and those a little off.
std::vector<double> angles_near_eighths() {
  std::vector<double> angles;
  for (int eighth = -4; eighth <= 4; ++eighth)
    for (const double off : {0.0, 1e-15, -1e-15, 1e-13, -1e-13, 3e-13, 1e-12, -1e-12, 1e-10, 1e-9,
                             1e-8, -1e-8, 1e-7, 1e-6, 1e-5, 1e-4, -1e-3, 1e-3})
      angles.push_back(eighth * 0.25 * pi + off);
  angles.push_back(5e-324);
  angles.push_back(-1e-300);
  return angles;
}

TEST(Inverse, BringsEveryPoseOfTheWorkspaceBack) {
  SeededRandom random(20250305);
  for (const auto& [name, chain] : machines::five_axis()) {
    SCOPED_TRACE(name);
    Worst worst;
    for (int i = 0; i < 20000; ++i) {
      const AxisVector q = machines::anywhere(chain, random);
      expect_return(chain, q, machines::anywhere(chain, random), worst);
      if (HasFatalFailure()) return;
    }
    std::cout << name << ": pose to axes to pose within " << worst << "\n";
  }
}

TEST(Inverse, BringsSingularAndNearlySingularPosesBack) {
  SeededRandom random(20250306);
  for (const auto& [name, chain] : machines::five_axis()) {
    SCOPED_TRACE(name);
    Worst worst;
    const std::vector<int> rotary = rotary_joints(chain);
    for (const double first : angles_near_eighths())
      for (const double second : angles_near_eighths()) {
        AxisVector q = machines::anywhere(chain, random);
        q[rotary[0]] = first;
        q[rotary[1]] = second;
        expect_return(chain, q, AxisVector::Zero(chain.size()), worst);
        if (HasFatalFailure()) return;
      }
    std::cout << name << ": pose to axes to pose within " << worst << "\n";
  }
}

TEST(Inverse, BringsPosesAtAnyDistanceFromASingularOneBack) {
  SeededRandom random(20250307);
  std::uniform_real_distribution<double> decade(-17, 0);
  for (const auto& [name, chain] : machines::five_axis()) {
    SCOPED_TRACE(name);
    Worst worst;
    // Directions at a given distance from the outer rotary axis, as the nominal chain turns it.
    const Joint& outer = chain.joints()[std::size_t(rotary_joints(chain)[0])];
    const Vector3d pole_w = chain.T_bw_home().linear().transpose() * outer.direction_b;
    const Vector3d across = pole_w.unitOrthogonal();
    int reached = 0;
    for (int i = 0; i < 20000; ++i) {
      const double distance = std::pow(10.0, decade(random));
      const double azimuth = pi * decade(random);
      const Vector3d direction = (i % 2 ? 1 : -1) * std::cos(distance) * pole_w +
                                 std::sin(distance) * (std::cos(azimuth) * across +
                                                       std::sin(azimuth) * pole_w.cross(across));
      const AxisVector previous = machines::anywhere(chain, random);
      const TipTarget target{previous.head<3>(), direction};
      const InverseSolution result = inverse(chain, target, previous);
      for (const AxisVector& branch : result.branches) {
        worst.take(chain, target, branch);
        ASSERT_TRUE(worst.kept()) << worst << " at distance " << distance;
      }
      reached += !result.branches.empty();
    }
    std::cout << name << ": " << reached << " of 20000 poses reached, within " << worst << "\n";
    // every direction, the half about one pole, or nearly none of them
    EXPECT_EQ(reached, name == "oblique" ? reached : name.starts_with("nutating") ? 10000 : 20000);
  }
}

TEST(Inverse, HoldsItsPromiseOnRandomMachines) {
  SeededRandom random(20250308);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::normal_distribution<double> normal;
  const auto direction = [&]() -> Vector3d {
    return Vector3d(normal(random), normal(random), normal(random)).normalized();
  };
  const auto point = [&]() -> Vector3d {
    return 400 * Vector3d(unit(random), unit(random), unit(random));
  };
  Worst worst;
  int machines_tried = 0;
  for (int i = 0; i < 20000; ++i) {
    // three slides near to square, two rotary axes anywhere, in any order and on either side
    const Matrix3d frame = Eigen::AngleAxisd(pi * unit(random), direction()).matrix();
    std::vector<Joint> joints;
    for (int k = 0; k < 3; ++k)
      joints.push_back(
          slide("XYZ"[k], Side::Tool, (frame.col(k) + 0.1 * direction()).normalized(), point()));
    joints.push_back(turn('A', Side::Tool, direction(), point()));
    joints.push_back(turn('B', Side::Tool, direction(), point()));
    std::shuffle(joints.begin(), joints.end(), random);
    const int primed = int(std::uniform_int_distribution<int>(0, 5)(random));
    for (int k = 0; k < primed; ++k) joints[std::size_t(k)].side = Side::Workpiece;
    const Chain chain(joints, machines::placed(point(), pi * unit(random), direction()),
                      machines::placed(point(), pi * unit(random), direction()));
    const AxisVector q = machines::anywhere(chain, random);
    if (!solve_slides(chain, q, Vector3d::Zero())) continue;
    const MatrixXd J = [&] {  // slides that rotary axes bring near to a plane are left out
      MatrixXd columns(3, 0);
      for (int k = 0; k < chain.size(); ++k) {
        if (chain.joints()[std::size_t(k)].motion != Motion::Linear) continue;
        AxisVector there = q;
        there[k] += 1.0;
        columns.conservativeResize(3, columns.cols() + 1);
        columns.rightCols(1) =
            chain.tool_in_workpiece(there).translation() - chain.tool_in_workpiece(q).translation();
      }
      return columns;
    }();
    if (std::abs(Matrix3d(J).determinant()) < 0.1) continue;
    ++machines_tried;
    const TipTarget target = target_at(chain, q);
    const InverseSolution result = inverse(chain, target, q);
    ASSERT_NE(result.reach, Reachability::Unreachable);
    if (result.branches.empty()) continue;  // the other branch may need slides beyond 2 m
    worst.take(chain, target, result.branches[0]);
    ASSERT_TRUE(worst.kept()) << worst;
    EXPECT_LT(rotary_travel(chain, result.branches[0], q), 1e-6);
  }
  std::cout << machines_tried << " machines, within " << worst << "\n";
  EXPECT_GT(machines_tried, 15000);
}

TEST(Inverse, TheNearestAloneIsTheFirstOfAllWithinLimits) {
  SeededRandom random(20251125);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::array<int, 4> seen{};
  for (int i = 0; i < 20000; ++i) {
    std::vector<Joint> joints = machines::gantry().joints();
    for (Joint& joint : joints) {
      const double size = joint.motion == Motion::Linear ? 400.0 : 4.0;
      joint.min = -size * std::abs(unit(random));
      joint.max = size * std::abs(unit(random));
    }
    const Chain chain(joints, machines::gantry().T_bw_home(), machines::gantry().T_bt_home());
    AxisVector previous = AxisVector::Zero(chain.size());
    for (Index j = 0; j < previous.size(); ++j) previous[j] = 3 * unit(random);
    TipTarget target{200 * Vector3d(unit(random), unit(random), unit(random)),
                     Vector3d(unit(random), unit(random), unit(random))};
    if (i % 10 == 0) target.direction_w = Vector3d::UnitZ();
    const InverseSolution all = inverse(chain, target, previous);
    const NearestPose nearest = solve_nearest_pose(chain, target, previous);
    ASSERT_EQ(nearest.reach, all.reach);
    ASSERT_EQ(nearest.q.size() == 0, all.branches.empty());
    if (!all.branches.empty()) {
      ASSERT_EQ(nearest.q, all.branches.front());
    }
    ++seen[std::size_t(all.reach)];
  }
  std::cout << seen[0] << " reached, " << seen[1] << " singular, " << seen[2] << " out of limits\n";
  for (const int i : {0, 1, 2}) EXPECT_GT(seen[std::size_t(i)], 100);
}

TEST(Inverse, FindsTheWayItCameFirst) {
  SeededRandom random(20250309);
  for (const auto& [name, chain] : machines::five_axis())
    for (int i = 0; i < 2000; ++i) {
      const AxisVector q = machines::anywhere(chain, random);
      const InverseSolution result = inverse(chain, target_at(chain, q), q);
      ASSERT_FALSE(result.branches.empty());
      // where the axes are ill-determined they may differ, but hardly by more than rounding's root
      ASSERT_LT((result.branches[0] - q).cwiseAbs().maxCoeff(), 1e-4) << name;
      for (const AxisVector& other : result.branches)
        ASSERT_LE(rotary_travel(chain, result.branches[0], q),
                  rotary_travel(chain, other, q) + 1e-9);
    }
}

Chain without_limits(const Chain& chain) {
  std::vector<Joint> joints = chain.joints();
  for (Joint& joint : joints) joint.max = -(joint.min = -1e9);
  return Chain(joints, chain.T_bw_home(), chain.T_bt_home());
}

TEST(Inverse, BranchesAreAllThereAre) {
  SeededRandom random(20250310);
  for (const auto& [name, machine] : machines::five_axis())
    for (int i = 0; i < 50; ++i) {
      const Chain chain = without_limits(machine);
      const AxisVector q = machines::anywhere(chain, random);
      const std::vector<int> rotary = rotary_joints(chain);
      const Joint& outer = chain.joints()[std::size_t(rotary[0])];
      const Joint& inner = chain.joints()[std::size_t(rotary[1])];
      const Vector3d tool = chain.T_bt_home().linear().col(2);
      const double height = outer.direction_b.dot(chain.T_bw_home().linear() *
                                                  chain.tool_in_workpiece(q).linear().col(2));
      // every root of height(inner turn) = height is a branch
      int roots = 0;
      double before = 0;
      for (int k = 0; k <= 20000; ++k) {
        const Eigen::AngleAxisd turned(2 * pi * k / 20000 + 0.1, inner.direction_b);
        const Vector3d raised = turned * tool;
        const double now = outer.direction_b.dot(raised) - height;
        roots += k > 0 && (now > 0) != (before > 0);
        before = now;
      }
      const InverseSolution result = inverse(chain, target_at(chain, q), q);
      ASSERT_EQ(int(result.branches.size()), roots) << name << " " << q.transpose();
    }
}

TEST(Inverse, OfTheGantryHasTwoBranchesHalfATurnApart) {
  const Chain gantry = machines::gantry();
  AxisVector q(6);
  q << 0.4, 10, 20, 30, 0.7, 0.0;
  const InverseSolution result = inverse(gantry, target_at(gantry, q), q);
  ASSERT_EQ(result.branches.size(), 2u);
  EXPECT_EQ(result.reach, Reachability::Reached);
  EXPECT_NEAR(result.branches[0][0], 0.4, 1e-14);
  EXPECT_NEAR(result.branches[0][4], 0.7, 1e-14);
  EXPECT_NEAR(std::abs(result.branches[1][0] - 0.4), pi, 1e-14);
  EXPECT_NEAR(result.branches[1][4], -0.7, 1e-14);
}

TEST(Inverse, KeepsCWhereItIsFree) {
  for (const Chain& chain : {machines::gantry(), machines::trunnion(), machines::head_head(),
                             machines::nutating_head(), machines::nutating_table()}) {
    const std::vector<int> rotary = rotary_joints(chain);
    for (const double tilt : {0.0, 1e-17, 1e-15, -1e-15, 1e-13, -1e-13}) {
      AxisVector q = AxisVector::Constant(chain.size(), 17.0);
      q[rotary[0]] = 0.3;
      q[rotary[1]] = tilt;
      AxisVector previous = q;
      previous[rotary[0]] = 123.456;
      const InverseSolution result = inverse(chain, target_at(chain, q), previous);
      EXPECT_EQ(result.reach, Reachability::Singular) << tilt;
      ASSERT_EQ(result.branches.size(), 1u);
      EXPECT_EQ(result.branches[0][rotary[0]], 123.456);
      EXPECT_NEAR(std::remainder(result.branches[0][rotary[1]], 2 * pi), 0.0, 1e-12);
    }
  }
}

TEST(Inverse, DoesNotCallANearlySingularPoseSingular) {
  const Chain gantry = machines::gantry();
  AxisVector q(6);
  for (const double tilt : {1e-12, 1e-9, 1e-6}) {
    q << 1.3, 1, 2, 3, tilt, 0.0;
    const InverseSolution result = inverse(gantry, target_at(gantry, q), q);
    EXPECT_EQ(result.reach, Reachability::Reached);
    EXPECT_EQ(result.branches.size(), 2u);
    // the direction is known to rounding, so C is known to rounding over the tilt
    EXPECT_NEAR(result.branches[0][0], 1.3, 1e-15 + 4e-16 / tilt);
  }
}

TEST(Inverse, BringsAFreeAxisToItsLimits) {
  const Chain gantry = with_limits(machines::gantry(), 'C', -1.0, 1.0);
  AxisVector previous = AxisVector::Zero(6);
  previous[0] = 2.0;
  const InverseSolution result = inverse(gantry, {Vector3d(1, 2, 3), z}, previous);
  EXPECT_EQ(result.reach, Reachability::Singular);
  EXPECT_EQ(result.branches.at(0)[0], 1.0);
}

TEST(Inverse, ThroughThePoleDoesNotSwingC) {
  const Chain gantry = machines::gantry();
  AxisVector previous = AxisVector::Zero(6);
  // a plane through the pole, so that one C serves the whole path
  const Vector3d side_w = gantry
                              .tool_in_workpiece([] {
                                AxisVector q = AxisVector::Zero(6);
                                q[0] = 0.6;
                                q[4] = 0.5 * pi;
                                return q;
                              }())
                              .linear()
                              .col(2);
  previous =
      inverse(gantry, {Vector3d::Zero(), -std::sin(0.3) * side_w + std::cos(0.3) * z}, previous)
          .branches.at(0);
  double largest_step = 0;
  for (int i = -300; i <= 300; ++i) {
    const double tilt = 1e-3 * i;
    const TipTarget target{Vector3d(i, 0, 0), std::sin(tilt) * side_w + std::cos(tilt) * z};
    const InverseSolution result = inverse(gantry, target, previous);
    ASSERT_FALSE(result.branches.empty());
    largest_step = std::max(largest_step, std::abs(result.branches[0][0] - previous[0]));
    previous = result.branches[0];
  }
  std::cout << "largest step of C: " << largest_step << " rad\n";
  EXPECT_LT(largest_step, 1e-11);
}

TEST(Inverse, UnwindsTurnsTowardsPrevious) {
  const Chain gantry = machines::gantry();
  AxisVector q(6);
  q << 0.4, 10, 20, 30, 0.7, 2.5;
  const TipTarget target = target_at(gantry, q);
  Worst worst;
  for (const int turns : {-100, -3, -1, 0, 1, 2, 100}) {
    AxisVector previous = q;
    previous[0] += 2 * pi * turns + 0.5;
    const InverseSolution result = inverse(gantry, target, previous);
    ASSERT_EQ(result.branches.size(), 2u);
    EXPECT_NEAR(result.branches[0][0], 0.4 + 2 * pi * turns, 1e-12);
    EXPECT_LE(std::abs(result.branches[1][0] - previous[0]), pi);
    EXPECT_EQ(result.branches[0][5], 2.5);  // the spindle nose stays
    for (const AxisVector& branch : result.branches) worst.take(gantry, target, branch);
  }
  EXPECT_TRUE(worst.kept()) << worst;
}

TEST(Inverse, StaysWithinRotaryLimitsThoughTheNearestTurnIsBeyond) {
  const Chain gantry = with_limits(machines::gantry(), 'C', -pi, pi);
  AxisVector q(6);
  q << 3.0, 0, 0, 0, 0.7, 0;
  AxisVector previous = q;
  previous[0] = -3.1;  // 3.0 - 2 pi would be nearer, but lies beyond -pi
  const Chain only_positive_A = with_limits(gantry, 'A', 0.0, 2.0);
  const InverseSolution result = inverse(only_positive_A, target_at(gantry, q), previous);
  ASSERT_EQ(result.branches.size(), 1u);
  EXPECT_NEAR(result.branches[0][0], 3.0, 1e-13);
}

TEST(Inverse, LeavesOutBranchesBeyondLimits) {
  const Chain gantry = machines::gantry();
  AxisVector q(6);
  q << 0.4, 10, 20, 30, 0.7, 0.0;
  const TipTarget target = target_at(gantry, q);
  const InverseSolution one = inverse(with_limits(gantry, 'A', -2.0, 0.0), target, q);
  ASSERT_EQ(one.branches.size(), 1u);
  EXPECT_EQ(one.reach, Reachability::Reached);
  EXPECT_NEAR(one.branches[0][4], -0.7, 1e-14);

  const InverseSolution none = inverse(with_limits(gantry, 'A', -0.5, 0.5), target, q);
  EXPECT_EQ(none.reach, Reachability::OutOfLimits);
  EXPECT_TRUE(none.branches.empty());

  const InverseSolution slides = inverse(with_limits(gantry, 'Z', -500, -400), target, q);
  EXPECT_EQ(slides.reach, Reachability::OutOfLimits);
  EXPECT_TRUE(slides.branches.empty());
}

TEST(Inverse, ReachesALimitItself) {
  const Chain gantry = machines::gantry();
  SeededRandom random(20250311);
  for (int i = 0; i < 1000; ++i) {
    AxisVector q = machines::anywhere(gantry, random);
    q[4] = 120.0_deg;
    q[3] = -250.0;
    const Chain limited = with_limits(with_limits(gantry, 'A', 0.0, 120.0_deg), 'Z', -250.0, 300.0);
    const InverseSolution result = inverse(limited, target_at(gantry, q), q);
    ASSERT_EQ(result.branches.size(), 1u);
    EXPECT_LE(result.branches[0][4], 120.0_deg);
    EXPECT_GE(result.branches[0][3], -250.0);
  }
}

TEST(Inverse, ReachesALimitThatRoundingWouldMiss) {
  // at a tilt of 1e-6, C is known to 1e-10 only: half of these would lie beyond 90 degrees
  const Chain table = with_limits(machines::trunnion(), 'C', -90.0_deg, 90.0_deg);
  const Chain tilted = with_limits(table, 'A', 0.0, 2.0);
  Worst worst;
  for (int i = 1; i <= 1000; ++i)
    for (const double limit : {-90.0_deg, 90.0_deg}) {
      AxisVector q = AxisVector::Zero(6);
      q[0] = limit;
      q[1] = 1e-6 + 1e-9 * i;
      const TipTarget target = target_at(tilted, q);
      const InverseSolution result = inverse(tilted, target, AxisVector::Zero(6));
      ASSERT_EQ(result.branches.size(), 1u) << i;
      EXPECT_LE(std::abs(result.branches[0][0]), 90.0_deg);
      worst.take(tilted, target, result.branches[0]);
    }
  EXPECT_TRUE(worst.kept()) << worst;
}

TEST(Inverse, DoesNotStretchALimitWhereTheDirectionWouldShowIt) {
  const Chain gantry = with_limits(machines::gantry(), 'A', 0.0, 2.0);
  AxisVector q = AxisVector::Zero(6);
  q[4] = 0.5;
  q[0] = 90.0_deg + 1e-7;
  EXPECT_EQ(inverse(with_limits(gantry, 'C', -90.0_deg, 90.0_deg), target_at(gantry, q),
                    AxisVector::Zero(6))
                .reach,
            Reachability::OutOfLimits);
  // nearest to previous lies 5e-7 beyond the limit, one turn away is within
  q[0] = -pi + 5e-7;
  AxisVector previous = q;
  previous[0] = 3.1;
  const InverseSolution result =
      inverse(with_limits(gantry, 'C', -pi, pi), target_at(gantry, q), previous);
  EXPECT_EQ(result.reach, Reachability::Reached);
  EXPECT_NEAR(result.branches.at(0)[0], -pi + 5e-7, 1e-13);
}

TEST(Inverse, OfThreeAxesReachesItsOwnDirectionOnly) {
  const Chain table = machines::moving_table();
  AxisVector q(4);
  q << 10, -20, 30, 0.5;
  const TipTarget target = target_at(table, q);
  const InverseSolution result = inverse(table, target, q);
  EXPECT_EQ(result.reach, Reachability::Reached);
  ASSERT_EQ(result.branches.size(), 1u);
  EXPECT_LT((result.branches[0] - q).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_EQ(inverse(table, {target.tip_w, Vector3d(1e-9, 0, 1)}, q).reach,
            Reachability::Unreachable);
}

TEST(Inverse, OfOneRotaryAxisReachesItsConeOnly) {
  // a B' table and a tool along z: directions in the plane across B
  const Chain chain({turn('B', Side::Workpiece, y, {5, 0, 9}), slide('X', Side::Tool, x),
                     slide('Y', Side::Tool, y), slide('Z', Side::Tool, z)},
                    Pose::Identity(), machines::placed({1, 2, 3}));
  const AxisVector previous = AxisVector::Zero(4);
  const TipTarget target{Vector3d(7, 8, 9), Vector3d(std::sin(0.6), 0, std::cos(0.6))};
  const InverseSolution result = inverse(chain, target, previous);
  EXPECT_EQ(result.reach, Reachability::Reached);
  ASSERT_EQ(result.branches.size(), 1u);
  EXPECT_NEAR(result.branches[0][0], 0.6, 1e-14);  // positive B turns the tool from z to x
  Worst worst;
  worst.take(chain, target, result.branches[0]);
  EXPECT_TRUE(worst.kept()) << worst;
  EXPECT_EQ(inverse(chain, {target.tip_w, Vector3d(0, 1e-6, 1)}, previous).reach,
            Reachability::Unreachable);
  EXPECT_EQ(inverse(chain, {target.tip_w, y}, previous).reach, Reachability::Unreachable);
}

TEST(Inverse, KeepsATableThatTurnsAboutTheTool) {
  const Chain chain({turn('C', Side::Workpiece, z, {5, 6, 0}), slide('X', Side::Tool, x),
                     slide('Y', Side::Tool, y), slide('Z', Side::Tool, z)},
                    Pose::Identity(), Pose::Identity());
  AxisVector previous = AxisVector::Zero(4);
  previous[0] = 7.7;
  const TipTarget target{Vector3d(1, 2, 3), z};
  const InverseSolution result = inverse(chain, target, previous);
  EXPECT_EQ(result.reach, Reachability::Singular);
  EXPECT_EQ(result.branches.at(0)[0], 7.7);
  Worst worst;
  worst.take(chain, target, result.branches[0]);
  EXPECT_TRUE(worst.kept()) << worst;
}

TEST(Inverse, OfParallelRotaryAxesKeepsTheOuterAndTurnsTheInner) {
  for (const Vector3d& inner : {x, Vector3d(-x)}) {
    const Chain chain({turn('A', Side::Workpiece, x, {0, 6, 8}), slide('X', Side::Tool, x),
                       slide('Y', Side::Tool, y), slide('Z', Side::Tool, z),
                       turn('B', Side::Tool, inner, {0, 1, 100})},
                      Pose::Identity(), machines::placed({4, 5, 0}));
    AxisVector previous = AxisVector::Zero(5);
    previous[0] = 0.9;
    const TipTarget target{Vector3d(1, 2, 3), Vector3d(0, std::sin(0.2), std::cos(0.2))};
    const InverseSolution result = inverse(chain, target, previous);
    EXPECT_EQ(result.reach, Reachability::Singular);
    EXPECT_EQ(result.branches.at(0)[0], 0.9);
    Worst worst;
    worst.take(chain, target, result.branches[0]);
    EXPECT_TRUE(worst.kept()) << worst;
    EXPECT_EQ(inverse(chain, {target.tip_w, x}, previous).reach, Reachability::Unreachable);
  }
}

TEST(Inverse, KeepsAnInnerAxisThatTurnsTheToolAboutItself) {
  const Chain chain(
      {turn('A', Side::Workpiece, x, {0, 6, 8}), slide('X', Side::Tool, x),
       slide('Y', Side::Tool, y), slide('Z', Side::Tool, z), turn('C', Side::Tool, z, {3, 1, 100})},
      Pose::Identity(), machines::placed({4, 5, 0}));
  AxisVector previous = AxisVector::Zero(5);
  previous[4] = 0.9;
  const TipTarget target{Vector3d(1, 2, 3), Vector3d(0, std::sin(0.2), std::cos(0.2))};
  const InverseSolution result = inverse(chain, target, previous);
  EXPECT_EQ(result.reach, Reachability::Singular);
  EXPECT_EQ(result.branches.at(0)[4], 0.9);
  EXPECT_NEAR(result.branches.at(0)[0], -0.2, 1e-14);
  Worst worst;
  worst.take(chain, target, result.branches[0]);
  EXPECT_TRUE(worst.kept()) << worst;
}

TEST(Inverse, OfANutatingTableEndsAtNinetyDegrees) {
  const Chain chain = machines::nutating_table();
  const AxisVector previous = AxisVector::Zero(chain.size());
  const auto reach = [&](double tilt) {
    return inverse(chain, {Vector3d::Zero(), Vector3d(std::sin(tilt), 0, std::cos(tilt))}, previous)
        .reach;
  };
  EXPECT_EQ(reach(0.0), Reachability::Singular);
  EXPECT_EQ(reach(89.9_deg), Reachability::Reached);
  EXPECT_EQ(reach(90.0_deg), Reachability::Reached);
  EXPECT_EQ(reach(90.0_deg + 1e-12), Reachability::Unreachable);
  EXPECT_EQ(reach(120.0_deg), Reachability::Unreachable);
}

TEST(Inverse, ReachesTheEndOfItsReachDespiteRounding) {
  Worst worst;
  for (const Chain& chain : {machines::nutating_table(), machines::nutating_head()})
    for (int i = -20; i <= 20; ++i)
      for (int azimuth = 0; azimuth < 36; ++azimuth) {
        const double tilt = 90.0_deg + 5e-15 * i;  // beyond the end by no more than 1e-13
        const double c = 0.1 + azimuth * 10.0_deg;
        const Vector3d direction(std::sin(tilt) * std::cos(c), std::sin(tilt) * std::sin(c),
                                 std::cos(tilt));
        const TipTarget target{Vector3d(10, 20, 30), direction};
        const InverseSolution result = inverse(chain, target, AxisVector::Zero(chain.size()));
        ASSERT_EQ(result.reach, Reachability::Reached);
        for (const AxisVector& branch : result.branches) {
          ASSERT_TRUE(branch.allFinite());
          worst.take(chain, target, branch);
        }
      }
  std::cout << "at the end of a nutating axis: " << worst << "\n";
  EXPECT_TRUE(worst.kept()) << worst;
}

TEST(Inverse, TakesADirectionOfAnyLength) {
  const Chain gantry = machines::gantry();
  const AxisVector previous = AxisVector::Zero(6);
  const Vector3d direction(0.1, 0.2, 0.9);
  const auto expected = inverse(gantry, {Vector3d::Zero(), direction.normalized()}, previous);
  for (const double length : {1e-300, 1e-9, 7.0, 1e300}) {
    const auto result = inverse(gantry, {Vector3d::Zero(), length * direction}, previous);
    ASSERT_EQ(result.branches.size(), 2u);
    EXPECT_LT((result.branches[0] - expected.branches.at(0)).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(Inverse, RefusesWhatIsNoTarget) {
  const Chain gantry = machines::gantry();
  const AxisVector previous = AxisVector::Zero(6);
  const double infinite = std::numeric_limits<double>::infinity();
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), infinite, -infinite}) {
    EXPECT_THROW((void)inverse(gantry, {Vector3d(bad, 0, 0), z}, previous), std::invalid_argument);
    EXPECT_THROW((void)inverse(gantry, {Vector3d::Zero(), Vector3d(0, bad, 1)}, previous),
                 std::invalid_argument);
    EXPECT_THROW((void)inverse(gantry, {Vector3d::Zero(), z}, AxisVector::Constant(6, bad)),
                 std::invalid_argument);
  }
  EXPECT_THROW((void)inverse(gantry, {Vector3d::Zero(), Vector3d::Zero()}, previous),
               std::invalid_argument);
  EXPECT_THROW((void)inverse(gantry, {Vector3d::Zero(), z}, AxisVector::Zero(5)),
               std::invalid_argument);
}

TEST(Inverse, OfAPointBeyondAllNumbersIsNeverNaN) {
  for (const auto& [name, chain] : machines::five_axis())
    for (const double far : {1e12, 1e200, 1.7e308}) {
      const InverseSolution result = inverse(
          chain, {Vector3d(far, -far, far), Vector3d(0.1, 0.2, 1)}, AxisVector::Zero(chain.size()));
      EXPECT_TRUE(result.branches.empty());
      EXPECT_NE(result.reach, Reachability::Reached) << name;
    }
}

TEST(Inverse, RefusesChainsThatAreNotThreeSlidesAndUpToTwoRotaryAxes) {
  const auto refused = [](std::vector<Joint> joints) {
    const Chain chain(std::move(joints), Pose::Identity(), Pose::Identity());
    EXPECT_THROW((void)inverse(chain, {}, AxisVector::Zero(chain.size())), std::invalid_argument);
  };
  const Joint X = slide('X', Side::Tool, x), Y = slide('Y', Side::Tool, y),
              Z = slide('Z', Side::Tool, z), W = slide('W', Side::Tool, z);
  refused({X, Y});
  refused({X, Y, Z, W});
  refused({X, Z, W});
  refused({X, Y, Z, turn('A', Side::Tool, x), turn('B', Side::Tool, y), turn('C', Side::Tool, z)});
  refused(machines::platform().joints());
}

TEST(SlidesForTip, KeepsTheRotaryAxesAndReachesTheTip) {
  SeededRandom random(20250312);
  std::uniform_real_distribution<double> unit(-500, 500);
  double worst = 0;
  for (const auto& [name, chain] : machines::five_axis())
    for (int i = 0; i < 1000; ++i) {
      AxisVector q = machines::anywhere(chain, random);
      if (name == "oblique") q[1] = 0.5 * q[1], q[3] = 0.3 * q[3];  // away from slides in one plane
      const Vector3d tip(unit(random), unit(random), unit(random));
      const auto result = solve_slides(chain, q, tip);
      ASSERT_TRUE(result);
      for (const int k : rotary_joints(chain)) ASSERT_EQ((*result)[k], q[k]);
      worst = std::max(worst, (chain.tool_in_workpiece(*result).translation() - tip).norm());
      ASSERT_LE(worst, promised_mm) << name;
    }
  std::cout << "largest tip error: " << worst << " mm\n";
}

TEST(SlidesForTip, IsEmptyWhereThereAreNoThreeIndependentSlides) {
  EXPECT_FALSE(solve_slides(machines::platform(), AxisVector::Zero(3), Vector3d::Zero()));
  // X, B, then Z turned by B into X
  const Chain chain({slide('X', Side::Workpiece, x), slide('Y', Side::Workpiece, y),
                     turn('B', Side::Workpiece, y), slide('Z', Side::Tool, z)},
                    Pose::Identity(), Pose::Identity());
  AxisVector q = AxisVector::Zero(4);
  EXPECT_TRUE(solve_slides(chain, q, Vector3d::Zero()));
  q[2] = 0.5 * pi;
  EXPECT_FALSE(solve_slides(chain, q, Vector3d::Zero()));
  EXPECT_EQ(inverse(chain, {Vector3d(1, 2, 3), x}, AxisVector::Zero(4)).reach,
            Reachability::Unreachable);
  q[2] = 0.0;
  EXPECT_FALSE(solve_slides(chain, q, Vector3d(nan, 0, 0)));
}

}  // namespace
}  // namespace abbe::kinematics
