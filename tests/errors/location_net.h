#pragma once

#include "errors/geometric.h"
#include "kinematics/chain.h"
#include "tests/oracles/axis_geometry.h"
#include "tests/test.h"

/// Every element of a machine, one at a time, against the angle, the line or the motion that it is
/// by definition, measured from poses of the tool in the workpiece alone. Axes lie along those of
/// the bed; the letters say the rest.
namespace abbe::errors::net {

using Eigen::Matrix4d;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Side;

constexpr double angle_given = 40e-6;   // rad
constexpr double offset_given = 20e-3;  // mm
constexpr double second_order = 3.0 * angle_given * angle_given;
constexpr double rounding_mm = 1e-10;

/// Largest misses by what was measured, in rad or mm.
using Misses = std::map<std::string, double>;

inline void expect_within(Misses& misses, const std::string& what, double miss, double bound,
                          const std::string& who) {
  misses[what] = std::max(misses[what], std::abs(miss));
  EXPECT_LE(std::abs(miss), bound) << who << ": " << what;
}

inline std::string code_of(const Chain& chain) {
  return kinematics::to_string(kinematics::chain_topology(chain.joints()));
}

/// Bed axis along which a joint points.
inline int bed_axis(const Joint& joint) {
  Index k = 0;
  joint.direction_b.cwiseAbs().maxCoeff(&k);
  return int(k);
}

inline bool is_slide(const Joint& joint) { return joint.motion == Motion::Linear; }

/// The slides X Y Z that the machine has, by bed axis.
inline std::map<int, int> slides_of(const Chain& chain) {
  std::map<int, int> result;
  for (const char letter : {'X', 'Y', 'Z'})
    if (const auto joint = chain.find(letter))
      result[bed_axis(chain.joints()[std::size_t(*joint)])] = *joint;
  return result;
}

inline char element_letter(const Joint& joint) {
  return joint.motion == Motion::Spindle ? 'S' : joint.name;
}

/// Location elements that a machine has by ISO 230-1: EC0Y EB0Z EA0Z of the slides that there are,
/// two angles of a further slide, two angles and two offsets of a rotary axis and of the nose.
inline std::set<std::string> location_elements(const Chain& chain) {
  std::set<std::string> result;
  const auto has = [&](char letter) { return chain.find(letter).has_value(); };
  if (has('X') && has('Y')) result.insert("EC0Y");
  if (has('X') && has('Z')) result.insert("EB0Z");
  if (has('Y') && has('Z')) result.insert("EA0Z");
  for (const Joint& joint : chain.joints()) {
    if (std::string("XYZ").find(joint.name) != std::string::npos) continue;
    if (joint.motion == Motion::Spindle && has('S')) continue;
    for (int k = 0; k < 3; ++k) {
      if (std::abs(joint.direction_b[k]) > 1.0 - 1e-12) continue;  // along it there is neither
      result.insert({'E', char('A' + k), '0', element_letter(joint)});
      if (!is_slide(joint)) result.insert({'E', char('X' + k), '0', element_letter(joint)});
    }
  }
  return result;
}

inline oracles::Poses poses_of(const Chain& chain, const GeometricModel& model) {
  return {[chain, model](const VectorXd& q) -> Matrix4d {
            kinematics::AxisState state;
            state.q = q;
            return chain.tool_in_workpiece(q, deviations(model, state)).matrix();
          },
          chain.size()};
}

/// One element of a machine and what the machine does with it and without.
struct Alone {
  const Chain& chain;
  ElementName name;
  int joint;
  double value;
  oracles::Poses nominal, actual;
  std::string who;

  int component() const { return name.component(); }
  Vector3d unit() const { return Vector3d::Unit(component() % 3); }
  const Joint& axis() const { return chain.joints()[std::size_t(joint)]; }
};

inline Alone alone(const Chain& chain, const std::string& text) {
  const ElementName name = parse_element_name(text);
  const double value = name.is_angle() ? angle_given : offset_given;
  const GeometricModel model = bind(GeometricErrors{{{name, {Curve{Constant{value}}}}}, {}}, chain);
  return {chain,
          name,
          model.elements[0].joint,
          value,
          poses_of(chain, bind(GeometricErrors{}, chain)),
          poses_of(chain, model),
          code_of(chain) + " " + text};
}

/// Angle of two slides beyond what it is nominally.
inline double opened(const Alone& one, int first, int second) {
  const auto angle = [&](const oracles::Poses& machine) {
    return oracles::angle(oracles::direction_of_travel(machine, first),
                          oracles::direction_of_travel(machine, second));
  };
  return angle(one.actual) - angle(one.nominal);
}

/// By how much turning the second of two slides about the letter's axis opens their angle: of
/// slides that both point along the bed the element, for EB0Z its opposite; once again the opposite
/// where the `direction` of one of the two is reversed.
inline double opening(const Alone& one, const Joint& first, const Joint& second) {
  return -one.value * first.direction_b.dot(one.unit().cross(second.direction_b));
}

/// The angle of every pair of X Y Z, by directions, ball bar, diagonals and square: that of the
/// element's own pair opens as the rule says, the others stay.
inline void expect_slides(const Alone& one, Misses& misses) {
  const std::map<std::string, std::pair<int, int>> pair_of = {
      {"EC0Y", {0, 1}}, {"EB0Z", {0, 2}}, {"EA0Z", {1, 2}}};
  const std::map<int, int> slides = slides_of(one.chain);
  for (const auto& [a, first] : slides)
    for (const auto& [b, second] : slides) {
      if (a >= b) continue;
      const auto own = pair_of.find(to_string(one.name));
      const bool is_own = own != pair_of.end() && own->second == std::pair(a, b);
      const auto& joints = one.chain.joints();
      const double expected =
          is_own ? opening(one, joints[std::size_t(first)], joints[std::size_t(second)]) : 0.0;
      const std::string what = is_own ? "angle of its slides" : "angle of other slides";
      const auto check = [&](const std::string& how, double seen) {
        expect_within(misses, what + how, seen - expected, second_order, one.who);
      };
      check("", opened(one, first, second));
      check(" by ball bar", oracles::angle_by_ball_bar(one.actual, first, second, 150.0));
      check(" by diagonals", oracles::angle_by_diagonals(one.actual, first, second, 200.0));
      check(" by square", oracles::angle_by_square(one.actual, first, second, 100.0));
    }
}

/// Direction in the workpiece of any axis that moves.
inline Vector3d direction(const oracles::Poses& machine, const Joint& joint, int index) {
  if (is_slide(joint)) return oracles::direction_of_travel(machine, index);
  return oracles::axis_line(machine, index, oracles::Standing::InWorkpiece, Vector3d::Zero())
      .direction;
}

/// How far an axis has turned towards each of the slides: u_s . u, actual minus nominal.
inline std::map<int, double> turned_to_slides(const Alone& one, int joint) {
  std::map<int, double> result;
  const Joint& axis = one.chain.joints()[std::size_t(joint)];
  const auto cosine = [&](const oracles::Poses& machine, int slide) {
    return direction(machine, axis, joint).dot(oracles::direction_of_travel(machine, slide));
  };
  for (const auto& [k, slide] : slides_of(one.chain))
    result[k] = cosine(one.actual, slide) - cosine(one.nominal, slide);
  return result;
}

/// An angle of a rotary axis or of a further slide turns it against X, Y and Z as a turn about the
/// letter's axis by its value does; an offset turns nothing.
inline void expect_own_direction(const Alone& one, Misses& misses) {
  const Vector3d turn = one.name.is_angle() ? Vector3d(one.value * one.unit()) : Vector3d::Zero();
  for (const auto& [k, seen] : turned_to_slides(one, one.joint)) {
    const Joint& slide = one.chain.joints()[std::size_t(slides_of(one.chain).at(k))];
    const double expected = slide.direction_b.dot(turn.cross(one.axis().direction_b));
    expect_within(misses, "angle of the axis to the slides", seen - expected, second_order,
                  one.who);
  }
}

inline bool is_mounted_on(const Chain& chain, int lower, int upper) {
  const auto& joints = chain.joints();
  const Side side = joints[std::size_t(lower)].side;
  return joints[std::size_t(upper)].side == side &&
         (side == Side::Tool ? upper > lower : upper < lower);
}

/// A squareness takes along what is mounted on the slide that is turned: of the pair the later one,
/// or, if that carries the earlier, everything that it carries. So each rotary axis keeps its
/// angles to one of the two slides.
inline void expect_mechanics(const Alone& one, int earlier, Misses& misses) {
  for (int j = 0; j < one.chain.size(); ++j) {
    const Joint& joint = one.chain.joints()[std::size_t(j)];
    if (joint.motion != Motion::Rotary) continue;
    const bool with_own =
        is_mounted_on(one.chain, one.joint, earlier) != is_mounted_on(one.chain, one.joint, j);
    const int other = with_own ? earlier : one.joint;
    for (const auto& [k, seen] : turned_to_slides(one, j))
      if (slides_of(one.chain).at(k) != other)
        expect_within(misses, "rotary axis beside its carriage", seen, second_order, one.who);
  }
}

/// The line of a rotary axis passes through the joint's point, moved by an offset, in the eyes of
/// whoever stands on the other side of it than the slides that locate it are mounted on.
inline void expect_line(const Alone& one, Misses& misses) {
  bool carries_slides = false;
  for (const auto& [k, slide] : slides_of(one.chain)) {
    const bool sees = one.name.is_angle() ? k != one.component() - 3 : k == one.component();
    carries_slides = carries_slides || (sees && is_mounted_on(one.chain, one.joint, slide));
  }
  const bool on_tool = one.axis().side == Side::Tool;
  const bool with_tool = on_tool == carries_slides;
  const auto standing = with_tool ? oracles::Standing::WithTool : oracles::Standing::InWorkpiece;
  const kinematics::Pose home =
      (with_tool ? one.chain.T_bt_home() : one.chain.T_bw_home()).inverse();
  const Vector3d at = home * one.axis().point_b;
  const oracles::Line line = oracles::axis_line(one.actual, one.joint, standing, at);
  Vector3d expected = Vector3d::Zero();
  if (!one.name.is_angle()) expected = home.linear() * (one.value * one.unit());
  const Vector3d miss = line.point - at - expected;
  const Vector3d across = miss - line.direction * line.direction.dot(miss);
  expect_within(misses, "place of the axis line, mm", across.norm(), rounding_mm, one.who);
}

/// An element of the nose displaces the tool at the nose by its value, which is all that poses
/// show.
inline void expect_nose(const Alone& one, Misses& misses) {
  const kinematics::Pose& T_bw = one.chain.T_bw_home();
  const VectorXd zero = VectorXd::Zero(one.chain.size());
  const kinematics::Pose from(T_bw.matrix() * one.nominal.T_wt(zero));
  const kinematics::Pose to(T_bw.matrix() * one.actual.T_wt(zero));
  const kinematics::Pose moved = to * from.inverse();
  kinematics::Deviation seen, expected = kinematics::Deviation::Zero();
  seen << moved * one.axis().point_b - one.axis().point_b,
      kinematics::rotation_vector(moved.linear());
  expected[one.component()] = one.value;
  expect_within(misses, "nose", (seen - expected).norm(), rounding_mm, one.who);
}

inline void expect_location_element(const Chain& chain, const std::string& text, Misses& misses) {
  const Alone one = alone(chain, text);
  expect_slides(one, misses);
  if (one.axis().motion == Motion::Spindle) return expect_nose(one, misses);
  const std::map<int, int> slides = slides_of(chain);
  const auto is_main = [&](int j) {
    return std::any_of(slides.begin(), slides.end(), [&](auto& s) { return s.second == j; });
  };
  if (!is_main(one.joint)) expect_own_direction(one, misses);
  if (is_main(one.joint)) expect_mechanics(one, slides.at(text[1] == 'A' ? 1 : 0), misses);
  if (one.axis().motion == Motion::Rotary) expect_line(one, misses);
}

/// Whatever is not among `location_elements` is refused with its reason; each of them makes the
/// angle or moves the line that it is, and no other angle of the slides.
inline void expect_location_elements(const Chain& chain, Misses& misses) {
  const std::set<std::string> defined = location_elements(chain);
  for (const Joint& joint : chain.joints())
    for (const char direction : std::string("XYZABC")) {
      const std::string text = {'E', direction, '0', element_letter(joint)};
      if (defined.count(text)) {
        expect_location_element(chain, text, misses);
        continue;
      }
      const std::string said = thrown_text<std::invalid_argument>([&] { alone(chain, text); });
      EXPECT_EQ(said.find(text + ": "), 0u) << said;
    }
}

// ---- error motions

/// A curve that is nowhere the same, and its value: over mm of a slide, over turns of a rotary
/// axis.
inline Shape motion_shape(const Joint& joint, double size) {
  if (joint.motion == Motion::Spindle) return Constant{size};
  if (is_slide(joint)) return Polynomial{size * Vector3d(0.5, 1.0, -0.8), 20.0, 250.0};
  return Fourier{size * Vector2d(1.0, -0.4), size * Vector2d(0.3, 0.7), 2.0 * std::numbers::pi};
}

inline double motion_value(const Joint& joint, double size, double q) {
  if (joint.motion == Motion::Spindle) return size;
  if (is_slide(joint)) {
    const double t = (q - 20.0) / 250.0;
    return size * (0.5 + t - 0.8 * t * t);
  }
  return size * (std::cos(q) - 0.4 * std::cos(2 * q) + 0.3 * std::sin(q) + 0.7 * std::sin(2 * q));
}

/// What the carriage of an axis has done beyond its nominal travel, in bed axes: displacement of
/// the carried point and turn. On the tool side the tool in the workpiece shows it, on the other
/// the workpiece about the tool.
inline kinematics::Deviation carriage_motion(const Alone& one, double q) {
  const bool on_tool = one.axis().side == Side::Tool;
  const kinematics::Pose home = on_tool ? one.chain.T_bw_home() : one.chain.T_bt_home();
  kinematics::Pose from(oracles::with_axis_at(one.nominal, one.joint, q));
  kinematics::Pose to(oracles::with_axis_at(one.actual, one.joint, q));
  if (!on_tool) {
    from = from.inverse();
    to = to.inverse();
  }
  const kinematics::Pose moved = home * to * from.inverse() * home.inverse();
  Vector3d point = one.axis().point_b;
  if (is_slide(one.axis())) point += (on_tool ? q : -q) * one.axis().direction_b;
  kinematics::Deviation seen;
  seen << moved * point - point, kinematics::rotation_vector(moved.linear());
  return seen;
}

/// Six error motions of every axis: straightness, positioning, roll, pitch, yaw; radial, axial,
/// tilt, angular positioning, each the translation of the carried point or the turn of the carriage
/// itself that its name says, and nothing else.
inline void expect_error_motions(const Chain& chain, Misses& misses) {
  for (int j = 0; j < chain.size(); ++j) {
    const Joint& joint = chain.joints()[std::size_t(j)];
    const bool is_nose = joint.motion == Motion::Spindle;
    if (is_nose && chain.find('S')) continue;
    for (const char direction : std::string("XYZABC")) {
      const ElementName name{direction, element_letter(joint), false};
      if (name.axis == 'S' && name.is_angle() && name.component() - 3 == bed_axis(joint)) continue;
      const double size = name.is_angle() ? angle_given : offset_given;
      const GeometricModel model =
          bind(GeometricErrors{{{name, {Curve{motion_shape(joint, size)}}}}, {}}, chain);
      const Alone one{chain,
                      name,
                      j,
                      size,
                      poses_of(chain, bind(GeometricErrors{}, chain)),
                      poses_of(chain, model),
                      code_of(chain) + " " + to_string(name)};
      for (const double q : {-150.0, 0.0, 35.0, 200.0}) {
        const double at = is_slide(joint) ? q : q / 70.0;
        kinematics::Deviation expected = kinematics::Deviation::Zero();
        expected[name.component()] = motion_value(joint, size, at);
        if (joint.motion == Motion::Rotary &&
            joint.deviation_axes == kinematics::DeviationAxes::Turning) {
          const double turn = joint.side == Side::Tool ? at : -at;
          const Eigen::AngleAxisd R(turn, joint.direction_b);
          expected << R * expected.head<3>().eval(), R * expected.tail<3>().eval();
        }
        const kinematics::Deviation miss = carriage_motion(one, at) - expected;
        expect_within(misses, "error motion, mm", miss.head<3>().norm(), rounding_mm, one.who);
        expect_within(misses, "error motion, rad", miss.tail<3>().norm(), 1e-13, one.who);
      }
    }
  }
}

// ---- machines

/// X Y Z with none to two of A B C, a further slide in three of ten and a nose in half, in any
/// order on any side, each along its bed axis or against it, every point and the clamping of part
/// and tool anywhere.
/// @param oblique  spread of the directions about the bed's, rad
inline Chain random_machine(std::mt19937& random, double oblique = 0.0) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto any = [&](double size) {
    return Vector3d(size * unit(random), size * unit(random), size * unit(random));
  };
  std::string names = "XYZ", turns = "ABC";
  std::shuffle(turns.begin(), turns.end(), random);
  names += turns.substr(0, random() % 3);
  if (random() % 10 < 3) names += "UVW"[random() % 3];
  std::shuffle(names.begin(), names.end(), random);
  const std::size_t primed = random() % (names.size() + 1);
  std::vector<Joint> joints;
  for (const char name : names) {
    Joint joint;
    joint.name = name;
    joint.side = joints.size() < primed ? Side::Workpiece : Side::Tool;
    joint.motion = name < 'D' ? Motion::Rotary : Motion::Linear;
    const int k = name < 'D' ? name - 'A' : (name < 'X' ? name - 'U' : name - 'X');
    const double way = random() % 2 ? 1.0 : -1.0;
    joint.direction_b = (way * Vector3d::Unit(k) + any(oblique)).normalized();
    joint.point_b = any(300.0);
    joints.push_back(joint);
  }
  if (random() % 2) {
    Joint nose;
    nose.name = 's';
    nose.motion = Motion::Spindle;
    nose.direction_b = Vector3d::UnitZ();
    nose.point_b = any(300.0);
    joints.push_back(nose);
  }
  const auto clamped = [&] {
    kinematics::Pose T = kinematics::Pose::Identity();
    T.linear() = kinematics::rotation(any(0.5));
    T.translation() = any(100.0);
    return T;
  };
  const kinematics::Pose T_bw = clamped();
  return Chain(joints, T_bw, clamped());
}

/// Random machines of a test: 200, with ABBE_LONG=1 twenty thousand.
inline int random_machines() { return std::getenv("ABBE_LONG") ? 20000 : 200; }

inline void print(const std::string& title, const Misses& misses) {
  std::cout << title << "\n";
  for (const auto& [what, miss] : misses) std::cout << "  " << what << ": " << miss << "\n";
}

}  // namespace abbe::errors::net
