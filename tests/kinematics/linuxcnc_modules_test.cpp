// Chains against LinuxCNC's own kinematics modules: an oracle that shares no code. In LinuxCNC the
// tool's length is added to the place of the tool by the interpreter (G43), so the module's z is
// that of the tip plus the length; its "rotation point" and offsets are places in the bed. Positive
// turns of xyzac-trt and xyzbc-trt are those of the table itself, the reverse of ISO 841.

#include "tests/kinematics/linuxcnc_modules.h"
#include "kinematics/chain.h"
#include "kinematics/inverse_kinematics.h"
#include "tests/kinematics/machines.h"
#include "tests/test.h"

namespace abbe::kinematics {
namespace {

using linuxcnc::KinematicsModule;
using linuxcnc::Nine;
using linuxcnc::Pin;
using machines::placed;
using machines::slide;
using machines::turn;

constexpr double promised = 1e-9;  // mm
constexpr int poses = 10000;

/// What a module knows of its machine, mm.
struct Figures {
  Vector3d rotation = Vector3d::Zero();  ///< the point about which its last table turns
  Vector3d offset = Vector3d::Zero();    ///< from there to the other axis
  double tool = 0.0;  ///< length of the tool, or of the head from its axes to the tip
};

/// A machine as the module takes it, and its chain.
struct Modelled {
  std::string module;
  int kind = 0;  ///< of its kinematics
  std::vector<Pin> pins;
  Chain chain;
  std::vector<int> joint_of;  ///< where the axes of the chain stand among the module's joints
  std::string letters;        ///< of the chain's axes, as places count them
  double length_added = 0.0;  ///< to z of the tip
};

std::vector<Pin> pins_of(const std::string& module, const Figures& f, const char* tool) {
  std::vector<Pin> pins;
  for (int k = 0; k < 3; ++k)
    pins.push_back({module + "." + "xyz"[k] + "-rot-point", f.rotation[k]});
  pins.push_back({module + "." + tool, f.tool});
  return pins;
}

/// w C' A' b X Y Z t
Modelled xyzac_trt(const Figures& f) {
  const std::string module = "xyzac-trt-kins";
  std::vector<Pin> pins = pins_of(module, f, "tool-offset");
  pins.push_back({module + ".y-offset", f.offset.y()});
  pins.push_back({module + ".z-offset", f.offset.z()});
  const Vector3d tilt = f.rotation + Vector3d(0, f.offset.y(), f.offset.z());
  return {
      module,
      0,
      pins,
      Chain({turn('C', Side::Workpiece, -machines::z, f.rotation),
             turn('A', Side::Workpiece, -machines::x, tilt), slide('X', Side::Tool, machines::x),
             slide('Y', Side::Tool, machines::y), slide('Z', Side::Tool, machines::z)},
            Pose::Identity(), placed({0, 0, -f.tool})),
      {4, 3, 0, 1, 2},
      "CAXYZ",
      f.tool};
}

/// w C' B' b X Y Z t
Modelled xyzbc_trt(const Figures& f) {
  const std::string module = "xyzbc-trt-kins";
  std::vector<Pin> pins = pins_of(module, f, "tool-offset");
  pins.push_back({module + ".x-offset", f.offset.x()});
  pins.push_back({module + ".z-offset", f.offset.z()});
  const Vector3d tilt = f.rotation + Vector3d(f.offset.x(), 0, f.offset.z());
  return {
      module,
      0,
      pins,
      Chain({turn('C', Side::Workpiece, -machines::z, f.rotation),
             turn('B', Side::Workpiece, -machines::y, tilt), slide('X', Side::Tool, machines::x),
             slide('Y', Side::Tool, machines::y), slide('Z', Side::Tool, machines::z)},
            Pose::Identity(), placed({0, 0, -f.tool})),
      {4, 3, 0, 1, 2},
      "CBXYZ",
      f.tool};
}

/// w A' B' b X Y Z t: its x-offset cancels in both directions
Modelled xyzab_tdr(const Figures& f) {
  const std::string module = "xyzab_tdr_kins";
  std::vector<Pin> pins = pins_of(module, f, "tool-offset-z");
  pins.push_back({module + ".x-offset", f.offset.x()});
  pins.push_back({module + ".z-offset", f.offset.z()});
  return {module,
          1,
          pins,
          Chain({turn('A', Side::Workpiece, machines::x, f.rotation + Vector3d(0, 0, f.offset.z())),
                 turn('B', Side::Workpiece, machines::y, f.rotation),
                 slide('X', Side::Tool, machines::x), slide('Y', Side::Tool, machines::y),
                 slide('Z', Side::Tool, machines::z)},
                Pose::Identity(), placed({0, 0, -f.tool})),
          {3, 4, 0, 1, 2},
          "ABXYZ",
          f.tool};
}

/// w b X Y Z C B W t: positive B leans the tool to -X, positive W lengthens it
Modelled five_axis_head(const Figures& f) {
  return {"5axiskins",
          0,
          {{"5axiskins.pivot-length", f.tool}},
          Chain({slide('X', Side::Tool, machines::x), slide('Y', Side::Tool, machines::y),
                 slide('Z', Side::Tool, machines::z),
                 turn('C', Side::Tool, machines::z, {0, 0, f.tool}),
                 turn('B', Side::Tool, -machines::y, {0, 0, f.tool}),
                 slide('W', Side::Tool, -machines::z)},
                Pose::Identity(), Pose::Identity()),
          {0, 1, 2, 4, 3, 5},
          "XYZCBW",
          0.0};
}

Nine joints_of(const Modelled& machine, const AxisVector& q) {
  Nine joints{};
  for (int i = 0; i < machine.chain.size(); ++i)
    joints[std::size_t(machine.joint_of[std::size_t(i)])] =
        machine.chain.joints()[std::size_t(i)].motion == Motion::Rotary ? q[i] / units::deg : q[i];
  return joints;
}

Nine place_of(const Modelled& machine, const AxisVector& q) {
  const Vector3d tip = machine.chain.tool_in_workpiece(q).translation();
  Nine place{tip.x(), tip.y(), tip.z() + machine.length_added};
  for (int i = 0; i < machine.chain.size(); ++i) {
    const std::size_t k = std::string("XYZABCUVW").find(machine.letters[std::size_t(i)]);
    if (k > 2)
      place[k] = machine.chain.joints()[std::size_t(i)].motion == Motion::Rotary ? q[i] / units::deg
                                                                                 : q[i];
  }
  return place;
}

double farthest(const Nine& a, const Nine& b) {
  double far = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) far = std::max(far, std::abs(a[k] - b[k]));
  return far;
}

/// Axis positions: awkward ones first.
std::vector<AxisVector> positions(const Chain& chain, std::mt19937& random) {
  std::vector<AxisVector> all;
  for (const double turned : {0.0, 90.0, -90.0, 180.0, -180.0, 45.0, 359.999999, 3600.0}) {
    AxisVector q = AxisVector::Constant(chain.size(), 100.0);
    for (int i = 0; i < chain.size(); ++i)
      if (chain.joints()[std::size_t(i)].motion == Motion::Rotary) q[i] = turned * units::deg;
    all.push_back(q);
  }
  while (int(all.size()) < poses) all.push_back(machines::anywhere(chain, random));
  return all;
}

struct Misses {
  double forward = 0.0, inverse = 0.0, slides = 0.0;
};

/// The module's places against the chain's, its joints against those that the chain was set to,
/// and what the control's inverse of the chain (`solve_slides`) makes of the module's places.
Misses held(const Modelled& machine, const std::vector<AxisVector>& positions) {
  const KinematicsModule module(machine.module, machine.pins, machine.kind);
  std::vector<Nine> joints, places;
  for (const AxisVector& q : positions) {
    joints.push_back(joints_of(machine, q));
    places.push_back(place_of(machine, q));
  }
  const std::vector<Nine> there = module.forward(joints), back = module.inverse(places);
  const bool three_slides = machine.letters.find('W') == std::string::npos;
  Misses worst;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    worst.forward = std::max(worst.forward, farthest(there[i], places[i]));
    worst.inverse = std::max(worst.inverse, farthest(back[i], joints[i]));
    if (!three_slides) continue;
    const Vector3d tip(there[i][0], there[i][1], there[i][2] - machine.length_added);
    const auto q = solve_slides(machine.chain, positions[i], tip);
    worst.slides = std::max(worst.slides, q ? (*q - positions[i]).norm() : 1e9);
  }
  return worst;
}

class LinuxCncKinematics : public testing::TestWithParam<Modelled (*)(const Figures&)> {};

TEST_P(LinuxCncKinematics, ModulesAndChainsPutTheToolInTheSamePlace) {
  if (!linuxcnc::modules()) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const unsigned seed = 20261125;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const Figures cases[] = {{{0, 0, 0}, {0, 0, 0}, 0},
                           {{0, 0, 0}, {-20, 0, -15}, 0},
                           {{11, -7, 23}, {-20, 13, -15}, 87.5},
                           {{-310, 205, -140}, {61, -44, 35}, 250}};
  for (const Figures& figures : cases) {
    const Modelled machine = GetParam()(figures);
    const Misses worst = held(machine, positions(machine.chain, random));
    std::cout << machine.module << ", tool " << figures.tool << " mm, " << poses << " poses, seed "
              << seed << ": forward " << worst.forward << ", inverse " << worst.inverse
              << ", slides for the tip " << worst.slides << " mm or deg\n";
    EXPECT_LT(worst.forward, promised);
    EXPECT_LT(worst.inverse, promised);
    EXPECT_LT(worst.slides, promised);
  }
}

std::string name_of_module(const testing::TestParamInfo<Modelled (*)(const Figures&)>& info) {
  std::string name = info.param(Figures{}).module;
  std::erase_if(name, [](char c) { return c == '-' || c == '_'; });
  return name;
}

INSTANTIATE_TEST_SUITE_P(Modules, LinuxCncKinematics,
                         testing::Values(xyzac_trt, xyzbc_trt, xyzab_tdr, five_axis_head),
                         name_of_module);

// The comparison itself sees what it should see.
TEST(LinuxCncModules, AnOffsetOfAMicrometreShows) {
  if (!linuxcnc::modules()) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  std::mt19937 random(1);
  const Figures told{{11, -7, 23}, {-20, 13, -15}, 87.5};
  Figures wrong = told;
  wrong.offset.z() += 0.001;
  Modelled machine = xyzbc_trt(told);
  machine.pins = xyzbc_trt(wrong).pins;
  const Misses worst = held(machine, positions(machine.chain, random));
  EXPECT_GT(worst.forward, 0.001);
  EXPECT_LT(worst.forward, 0.0021);
}

}  // namespace
}  // namespace abbe::kinematics
