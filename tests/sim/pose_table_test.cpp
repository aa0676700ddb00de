// Poses by the thousand: against one pose after another, against a second chain, against their own
// sums.

#include "sim/cut/pose_table.h"
#include <nlohmann/json.hpp>
#include "kinematics/inverse_kinematics.h"
#include "sim/report/pose_report.h"
#include "sim/scene/read_scene.h"
#include "tests/oracles/paper_chain.h"
#include "tests/sim/pose_scene.h"
#include "tests/sim/refusal.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;

std::string position_text(const PoseList& poses, std::size_t i) {
  std::string text;
  for (std::size_t c = 0; c < poses.columns.size(); ++c)
    text += fmt::format("{}={} ", poses.columns[c].head[0],
                        poses.numbers[i * poses.columns.size() + c]);
  return text;
}

/// Every number of the table against the digits of `pose --at`.
void expect_the_digits_of_at(const Scene& scene, unsigned seed) {
  SCOPED_TRACE(testing::Message() << scene.file.string() << ", seed " << seed);
  const IdleMachine idle = idle_machine(scene);
  const PoseList poses =
      read_poses(csv_of(idle, any_states(idle, 25, seed)), "poses.csv", idle.machine.nominal);
  const PoseTable table(idle, {{}, {"all"}});
  const auto rows = cells_of_csv(table_text(table, poses, TableFormat::Csv));
  ASSERT_EQ(rows.size(), 26u);
  const std::size_t first = 1 + poses.columns.size();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto at = pose_at(scene, position_text(poses, i), {{}, {"all"}});
    const auto cell = [&](std::size_t k) { return rows[i + 1].at(first + k); };
    ASSERT_EQ(rows[i + 1].size(), first + table.column_names().size());
    for (std::size_t k = 0; k < 3; ++k) {
      const auto c = Index(k);
      EXPECT_EQ(cell(k), fmt::format("{}", at.pose.nominal.translation()[c] + 0.0));
      EXPECT_EQ(cell(3 + k), fmt::format("{}", at.pose.deviation()[c] / units::um + 0.0));
      EXPECT_EQ(cell(7 + k), fmt::format("{}", at.pose.direction()[c] / units::urad + 0.0));
    }
    for (std::size_t k = PoseTable::fixed_column_count; k < table.column_names().size(); ++k) {
      EXPECT_EQ(at.column_names[k - PoseTable::fixed_column_count], table.column_names()[k]);
      EXPECT_EQ(cell(k), fmt::format("{}", at.numbers[k - PoseTable::fixed_column_count]));
    }
  }
}

TEST(PoseTable, HasTheDigitsOfOnePoseAfterAnother) {
  expect_the_digits_of_at(read_scene(scenes() / "gantry_dome.toml"), 1);
  expect_the_digits_of_at(read_scene(scenes() / "platform_plane.toml"), 2);
  expect_the_digits_of_at(read_scene(scenes() / "stepped_shaft.toml"), 3);
  expect_the_digits_of_at(read_scene(scenes() / "gantry_force.toml"), 4);
  expect_the_digits_of_at(read_scene(scenes() / "thermal_protocol.toml"), 5);
  const SceneFolder folder;
  for (const WrongMachine& wrong : wrong_machines())
    expect_the_digits_of_at(read_scene(folder.write("wrong.toml", wrong.toml)), 6);
}

// The 46 elements of the gantry as cubics, and their values worked out here.
TEST(PoseTable, IsTheSecondChainOfThePapersOnTheGantry) {
  const unsigned seed = 20261122;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::map<std::string, std::array<double, 4>> motion;
  std::map<std::string, double> constant;
  std::string toml = "[errors]\n", curves;
  const auto is_angle = [](char direction) { return direction < 'X'; };
  for (const char* name : {"EXS", "EYS", "EZS", "EAS", "EBS", "EC0Y", "EB0Z", "EA0Z", "EB0A",
                           "EC0A", "EA0C", "EB0C", "EY0A", "EZ0A", "EX0C", "EY0C"}) {
    constant[name] = 30.0 * unit(random);
    toml += fmt::format("{}_{} = {}\n", name, is_angle(name[1]) ? "urad" : "um", constant[name]);
  }
  for (const char axis : std::string("XYZAC"))
    for (const char direction : std::string("XYZABC")) {
      const std::string name = {'E', direction, axis};
      for (double& c : motion[name]) c = 10.0 * unit(random);
      const auto& c = motion[name];
      curves += fmt::format(
          "[errors.{}]\nkind = \"polynomial\"\ncoefficients_{} = [{}, {}, {}, {}]\nhalf_range_{}\n",
          name, is_angle(direction) ? "urad" : "um", c[0], c[1], c[2], c[3],
          axis < 'X' ? "deg = 180" : "mm = 300");
    }
  const IdleMachine idle = idle_of(idle_scene("gantry_cxyza", toml + curves));
  const auto six = [&](char axis, double q) {
    const double t = q / (axis < 'X' ? pi : 300.0);
    std::array<double, 6> e{};
    for (int i = 0; i < 6; ++i) {
      const auto& c = motion.at({'E', "XYZABC"[i], axis});
      e[std::size_t(i)] = (c[0] + t * (c[1] + t * (c[2] + t * c[3]))) * (i < 3 ? 1e-3 : 1e-6);
    }
    return oracles::SixErrors{e[0], e[1], e[2], e[3], e[4], e[5]};
  };
  const auto fixed = [&](const char* name) {
    return constant.at(name) * (is_angle(name[1]) ? 1e-6 : 1e-3);
  };
  oracles::GantryPlaces places;
  places.c = places.workpiece = Vector3d::Zero();
  places.x = places.y = places.z = places.a = Vector3d(0, 0, 200);
  places.spindle = Vector3d(0, 0, 50);
  places.tool = Vector3d(0, 0, 50 - 100);
  const PoseTable table(idle, {});
  double worst_mm = 0.0, worst_rad = 0.0;
  for (const AxisState& state : any_states(idle, 500, seed)) {
    const auto& q = state.q;  // C X Y Z A s
    oracles::Gantry g;
    g.c = six('C', q[0]);
    g.x = six('X', q[1]);
    g.y = six('Y', q[2]);
    g.z = six('Z', q[3]);
    g.a = six('A', q[4]);
    g.spindle = {fixed("EXS"), fixed("EYS"), fixed("EZS"), fixed("EAS"), fixed("EBS"), 0.0};
    g.gamma_xy = fixed("EC0Y");
    g.beta_xz = fixed("EB0Z");
    g.alpha_yz = fixed("EA0Z");
    g.beta_a = fixed("EB0A");
    g.gamma_a = fixed("EC0A");
    g.alpha_c = fixed("EA0C");
    g.beta_c = fixed("EB0C");
    g.dy_a = fixed("EY0A");
    g.dz_a = fixed("EZ0A");
    g.dx_c = fixed("EX0C");
    g.dy_c = fixed("EY0C");
    const oracles::GantryForm form{oracles::Angles::Exact, false};
    const oracles::GantryPositions positions{-q[0], q[1], q[2], q[3], q[4]};
    const Eigen::Matrix4d actual = gantry_tool_in_workpiece(g, places, positions, form);
    const Eigen::Matrix4d nominal = gantry_tool_in_workpiece({}, places, positions, form);
    const PoseTable::Row row = table.row(state);
    const Eigen::Matrix4d difference = actual - nominal;
    worst_mm = std::max(worst_mm, (row.deviation - difference.block<3, 1>(0, 3)).norm());
    worst_rad = std::max(worst_rad, (row.direction - difference.block<3, 1>(0, 2)).norm());
    EXPECT_LT((Vector3d(row.numbers[0], row.numbers[1], row.numbers[2]) - nominal.block<3, 1>(0, 3))
                  .norm(),
              1e-9);
  }
  std::cout << "against the papers' chain: " << worst_mm << " mm, " << worst_rad << " rad\n";
  EXPECT_LT(worst_mm, 1e-9);
  EXPECT_LT(worst_rad, 1e-12);
}

/// What the header of idle_machine.h says that the contributions may leave, by what the machine
/// has.
struct Bound {
  double mm = 0.0, rad = 0.0;
};
Bound bound_of(const IdleMachine& idle, const AxisState& state) {
  const errors::ForceDeviations all = deviations(idle.truth, state);
  double T = all.tool_t.tail<3>().norm() + all.workpiece_w.tail<3>().norm();
  double D = all.tool_t.head<3>().norm() + all.workpiece_w.head<3>().norm();
  const Vector3d tip_w = idle.truth.actual.tool_in_workpiece(state.q).translation();
  double L = tip_w.norm();
  const auto& chain = idle.truth.actual;
  for (std::size_t i = 0; i < all.joints.size(); ++i) {
    const auto& d = all.joints[i];
    T += d.motion.tail<3>().norm() + d.location.tail<3>().norm();
    D += d.motion.head<3>().norm() + d.location.head<3>().norm();
    L = std::max(L, chain.joints()[i].motion == kinematics::Motion::Linear
                        ? std::abs(state.q[Index(i)])
                        : 0.0);
    // arm: where the joint's point is carried, by its own Jacobian of pure turns
    const MatrixXd J = kinematics::motion_jacobian(chain, state.q);
    for (int k = 3; k < 6; ++k)
      L = std::max(L, std::sqrt(2.0) * J.col(6 * Index(i) + k).head<3>().norm());
  }
  const double G = idle.truth.heat && idle.truth.heat->model.workpiece
                       ? std::abs(idle.truth.heat->model.workpiece->per_K) * 100.0
                       : 0.0;
  return {(T * T * L / 2 + T * D + G * (T * L + D)) * (1 + 2 * T) + 1e-11,
          T * T / 2 * (1 + T) + 1e-14};
}

TEST(PoseShares, SumToTheDeviationToSecondOrderWithinTheirBound) {
  const unsigned seed = 20261123;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::vector<std::pair<std::string, IdleMachine>> machines;
  for (const double scale : {1.0, 10.0})
    for (const WrongMachine& wrong : wrong_machines(scale))
      machines.emplace_back(fmt::format("{} x {}", wrong.name, scale), idle_of(wrong.toml));
  for (const char* name : {"gantry_dome", "gantry_force", "gantry_warmup_training",
                           "thermal_protocol", "platform_plane", "stepped_shaft"})
    machines.emplace_back(name, idle_of(scenes() / (std::string(name) + ".toml")));
  for (const auto& [name, idle] : machines) {
    const std::vector<ErrorSource> sources = error_sources(idle);
    double worst = 0.0, used = 0.0;
    for (const AxisState& state : any_states(idle, 60, seed)) {
      const TipPose pose = tip_pose(idle, state);
      const Eigen::Matrix<double, 6, 1> sum =
          source_contributions(idle, sources, state).rowwise().sum();
      const double mm = (pose.deviation() - sum.head<3>()).norm();
      const double rad = (pose.direction() - sum.tail<3>()).norm();
      const Bound bound = bound_of(idle, state);
      EXPECT_LE(mm, bound.mm) << name;
      EXPECT_LE(rad, bound.rad) << name;
      worst = std::max(worst, mm);
      used = std::max(used, mm / bound.mm);
    }
    std::cout << name << ": " << sources.size() << " sources, rest at most " << worst / units::nm
              << " nm, " << 100 * used << " % of the bound\n";
  }
}

TEST(PoseShares, OneShareIsWhatTheMachineDoesWithNothingElseWrong) {
  const unsigned seed = 20261124;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  for (const WrongMachine& wrong : wrong_machines()) {
    const SceneFolder folder;
    const Scene scene = read_scene(folder.write("wrong.toml", wrong.toml));
    const IdleMachine idle = idle_machine(scene);
    const std::vector<AxisState> states = any_states(idle, 5, seed);
    for (const ErrorSource& source : error_sources(idle)) {
      if (!std::holds_alternative<errors::GeometricModel>(source.what)) continue;
      Scene alone = scene;
      std::erase_if(alone.geometric.elements,
                    [&](const errors::Element& e) { return to_string(e.name) != source.name; });
      ASSERT_EQ(alone.geometric.elements.size(), 1u);
      const IdleMachine only = idle_machine(alone);
      for (const AxisState& state : states) {
        const Eigen::Matrix<double, 6, 1> share = source_contributions(idle, {source}, state);
        const kinematics::Pose base = idle.truth.actual.tool_in_workpiece(state.q);
        const kinematics::Pose moved = tip_pose(only, state).actual;
        const Bound bound = bound_of(only, state);
        EXPECT_LT((moved.translation() - base.translation() - share.head<3>()).norm(), bound.mm)
            << wrong.name << " " << source.name;
        EXPECT_LT((moved.linear().col(2) - base.linear().col(2) - share.tail<3>()).norm(),
                  bound.rad)
            << wrong.name << " " << source.name;
      }
    }
  }
}

TEST(PoseShares, NamesThatTheMachineLacksAreRefusedWithThoseThatItHas) {
  const IdleMachine idle = idle_of(scenes() / "gantry_dome.toml");
  EXPECT_EQ(select_sources(error_sources(idle), {"EC0Y", "EXX"}).front().name, "EC0Y");
  EXPECT_EQ(select_sources(error_sources(idle), {"all"}).size(), 46u);
  EXPECT_HAS(refusal_by([&] { select_sources(error_sources(idle), {"EXU"}); }), "EXX");
  EXPECT_NE(refusal_by([&] { select_sources(error_sources(idle), {"EXX", "EXX"}); }), "");
}

TEST(PoseTable, JacobiansAreTheDerivativesThatTheirHeadsName) {
  const unsigned seed = 20261125;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  for (const WrongMachine& wrong : wrong_machines()) {
    SCOPED_TRACE(wrong.name);
    const IdleMachine idle = idle_of(wrong.toml);
    const PoseTable table(idle,
                          {{PoseJacobian::Axis, PoseJacobian::Motion, PoseJacobian::Location}, {}});
    const kinematics::Chain& chain = idle.machine.nominal;
    std::map<std::string, int> seen;
    for (const AxisState& state : any_states(idle, 3, seed)) {
      const std::vector<double> numbers = table.row(state).numbers;
      ASSERT_EQ(numbers.size(), table.column_names().size());
      for (std::size_t k = PoseTable::fixed_column_count; k < numbers.size(); k += 6) {
        const std::string by = table.column_names()[k].substr(4);
        ++seen[by];
        const auto moved = [&](double step) {
          AxisState there = state;
          std::vector<kinematics::JointDeviation> deviations(std::size_t(chain.size()),
                                                             kinematics::JointDeviation{});
          if (by.size() == 1) {
            there.q[*chain.find(by[0])] += step;
          } else {
            errors::GeometricErrors one;
            one.elements = {{errors::parse_element_name(by), {{errors::Constant{step}}}}};
            deviations = errors::deviations(errors::bind(one, chain), state);
          }
          return chain.tool_in_workpiece(there.q, deviations);
        };
        const double step = 1e-4;
        const kinematics::Pose up = moved(step), down = moved(-step);
        Eigen::Matrix<double, 6, 1> expected, found;
        expected << (up.translation() - down.translation()) / (2 * step),
            kinematics::rotation_vector(up.linear() * down.linear().transpose()) / (2 * step);
        for (int i = 0; i < 6; ++i) {
          found[i] = numbers[k + std::size_t(i)];
          EXPECT_EQ(table.column_names()[k + std::size_t(i)].substr(0, 4),
                    std::string("d") + "xyzabc"[i] + "_d");
        }
        EXPECT_LT((found - expected).norm(), 1e-5) << by;
      }
    }
    EXPECT_TRUE(seen.count("EXZ") && seen.count("Z")) << "heads of every kind";
  }
}

TEST(PoseTable, TimeIsThatOfTheHeat) {
  const IdleMachine idle = idle_of(scenes() / "gantry_warmup_training.toml");
  const PoseList poses = read_poses("X_mm,time_h\n100,-3\n100,-1.5\n100,0\n100,0\n", "drift.csv",
                                    idle.machine.nominal);
  const PoseTable table(idle, {});
  std::vector<Vector3d> tip;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    AxisState state;
    state.q = kinematics::AxisVector::Zero(idle.machine.nominal.size());
    state.q[*idle.machine.nominal.find('X')] = 100;
    state.time_s = std::array{-10800.0, -5400.0, 0.0, 0.0}[i];
    tip.push_back(table.row(poses.state(i)).deviation);
    EXPECT_EQ(tip.back(), Vector3d(tool_in_workpiece(idle.truth, state).translation() -
                                   idle.machine.nominal.tool_in_workpiece(state.q).translation()));
  }
  std::cout << "drift of the tip over the history " << (tip[2] - tip[0]).transpose() << " mm\n";
  EXPECT_GT((tip[2] - tip[0]).norm(), 1e-3);
  EXPECT_GT((tip[1] - tip[0]).norm(), 1e-3);
  EXPECT_EQ(tip[3], tip[2]);
}

TEST(PoseTable, StatisticsAreThoseOfAllPoses) {
  const VectorXd um = VectorXd::LinSpaced(100, 1.0, 100.0).reverse();
  const PoseStatistics s = pose_statistics(um, 2.0 * um.reverse());
  EXPECT_EQ(s.poses, 100u);
  EXPECT_EQ(s.max_um, 100.0);
  EXPECT_EQ(s.worst, 0u);
  EXPECT_DOUBLE_EQ(s.p95_um, 95.0);
  EXPECT_DOUBLE_EQ(s.rms_um, std::sqrt(100 * 101 * 201 / 6.0 / 100.0));
  EXPECT_EQ(s.direction_max_urad, 200.0);
  EXPECT_EQ(s.direction_worst, 99u);
}

TEST(PoseTable, LeavingATableIsRefusedAtTheFirstPoseThatDoes) {
  const IdleMachine idle = idle_of(idle_scene(
      "gantry_cxyza", "[errors.EXX]\nkind = \"table\"\nq_mm = [-100, 100]\nvalue_um = [0, 5]\n"));
  const PoseTable table(idle, {});
  std::string text = "X_mm\n";
  for (int i = 0; i < 300; ++i) text += i == 270 || i == 140 ? "101\n" : "50\n";
  const PoseList poses = read_poses(text, "poses.csv", idle.machine.nominal);
  const std::string refusal = refusal_by([&] { table_text(table, poses, TableFormat::Csv); });
  EXPECT_EQ(refusal.rfind("poses.csv:142: ", 0), 0u) << refusal;
  EXPECT_HAS(refusal, "EXX");
}

}  // namespace
}  // namespace abbe::sim
