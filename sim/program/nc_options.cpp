#include "sim/program/nc_options.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "kinematics/units.h"

namespace abbe::sim::program {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Motion;

namespace {

/// Calls `visit(joint, axis)` for every axis except spindles.
template <typename Visit>
void for_each_positioned_axis(const std::vector<ControlledAxis>& axes, const Visit& visit) {
  const int spindle = find_spindle(axes);
  for (int j = 0; j < int(axes.size()); ++j)
    if (const ControlledAxis& axis = axes[std::size_t(j)];
        axis.motion != Motion::Spindle && j != spindle)
      visit(j, axis);
}

}  // namespace

std::vector<ControlledAxis> controlled_axes(const Chain& chain) {
  std::vector<ControlledAxis> axes;
  for (const kinematics::Joint& joint : chain.joints()) axes.push_back({joint.name, joint.motion});
  return axes;
}

// A rotary S carries the workpiece and has precedence: on a lathe S and M3 turn the work.
int find_spindle(const std::vector<ControlledAxis>& axes) {
  int nose = -1;
  for (std::size_t j = 0; j < axes.size(); ++j) {
    if (axes[j].name == 'S' && axes[j].motion == Motion::Rotary) return int(j);
    if (axes[j].motion == Motion::Spindle && nose < 0) nose = int(j);
  }
  return nose;
}

bool turns_workpiece(const std::vector<ControlledAxis>& axes) {
  const int spindle = find_spindle(axes);
  return spindle >= 0 && axes[std::size_t(spindle)].motion == Motion::Rotary;
}

std::array<int, 26> joints_by_letter(const std::vector<ControlledAxis>& axes) {
  std::array<int, 26> joints;
  joints.fill(-1);
  for_each_positioned_axis(axes, [&](int j, const ControlledAxis& axis) {
    if (axis.name >= 'A' && axis.name <= 'Z') joints[std::size_t(axis.name - 'A')] = j;
  });
  return joints;
}

std::string axis_letter_list(const std::vector<ControlledAxis>& axes) {
  std::string letters;
  for_each_positioned_axis(axes, [&](int, const ControlledAxis& axis) {
    if (!letters.empty()) letters += ' ';
    letters += axis.name;
  });
  return letters;
}

SquaredDistance squared_distances(const std::vector<ControlledAxis>& axes, const AxisVector& start,
                                  const AxisVector& end) {
  SquaredDistance squared;
  for_each_positioned_axis(axes, [&](int j, const ControlledAxis& axis) {
    const double displacement = end[j] - start[j];
    double& sum = axis.motion != Motion::Linear ? squared.rotation
                  : axis.name >= 'X'            ? squared.xyz  // U V W sort before X
                                                : squared.uvw;
    sum += displacement * displacement;
  });
  return squared;
}

FeedLength feed_length(const std::vector<ControlledAxis>& axes, const AxisVector& start,
                       const AxisVector& end, const Arc* arc,
                       const Eigen::Matrix3d* plane_rotation) {
  SquaredDistance squared = squared_distances(axes, start, end);
  // In a rotated plane the chord is replaced by the arc length; the displacement along the normal
  // (helix) stays.
  if (arc != nullptr && plane_rotation != nullptr) {
    const Eigen::Vector3d displacement(end[arc->first] - start[arc->first],
                                       end[arc->second] - start[arc->second],
                                       end[arc->third] - start[arc->third]);
    const double arc_length = (arc->radius + 0.5 * arc->growth) * arc->sweep;
    squared.xyz = squared.xyz -
                  (plane_rotation->transpose() * displacement).head<2>().squaredNorm() +
                  arc_length * arc_length;
  } else if (arc != nullptr) {
    const double chord =
        (end[arc->first] - start[arc->first]) * (end[arc->first] - start[arc->first]) +
        (end[arc->second] - start[arc->second]) * (end[arc->second] - start[arc->second]);
    // The radius grows evenly over the arc, so the length is the mean radius times the sweep.
    const double arc_length = (arc->radius + 0.5 * arc->growth) * arc->sweep;
    squared.xyz = squared.xyz - chord + arc_length * arc_length;
  }
  const double mm = std::sqrt(squared.xyz > 0.0 ? squared.xyz : squared.uvw);
  if (mm > 0.0) return {mm, true};
  // F in degrees per minute if nothing moves linearly.
  return {std::sqrt(squared.rotation) / units::deg, false};
}

std::optional<BlockSkip> parse_block_skip(std::string_view text) {
  if (text == "on") return BlockSkip().set();
  if (text == "off") return BlockSkip();
  BlockSkip levels;
  // Digits may be separated by blanks or not.
  for (const char c : text) {
    if (c >= '0' && c <= '9')
      levels.set(std::size_t(c - '0'));
    else if (c != ' ')
      return std::nullopt;
  }
  return levels.any() ? std::optional(levels) : std::nullopt;
}

std::string to_text(const BlockSkip& levels) {
  if (levels.all()) return "on";
  if (levels.none()) return "off";
  std::string text;
  for (std::size_t level = 0; level < levels.size(); ++level)
    if (levels.test(level)) text += (text.empty() ? "" : " ") + std::to_string(level);
  return text;
}

const AxisVector& work_offset(const NcOptions& options, int system) {
  static const AxisVector none;
  if (system >= 1 && system <= int(options.work_offset.size()))
    return options.work_offset[std::size_t(system - 1)];
  const auto offset = options.extra_offsets.find(system);
  return offset == options.extra_offsets.end() ? none : offset->second;
}

bool is_known_tool(const NcOptions& options, int number) {
  return !options.tool_table || number == 0 || options.tool_length.contains(number);
}

std::optional<int> only_tool(const NcOptions& options) {
  const std::map<int, double>& lengths = options.tool_length;
  if (options.tool_table)
    return lengths.size() == 1 ? std::optional(lengths.begin()->first) : std::nullopt;
  if (!options.control_by_h.empty() || lengths.empty()) return std::nullopt;
  // Without a tool table the lengths are registers of one tool; H1 is its usual one.
  return lengths.contains(1) ? 1 : lengths.begin()->first;
}

AxisVector initial_position(const NcOptions& options) {
  const Eigen::Index n = Eigen::Index(options.axes.size());
  if (options.start.size() == 0) return AxisVector::Zero(n);
  if (options.start.size() != n)
    throw std::invalid_argument("expected one start position for every axis");
  return options.start;
}

AxisVector reference_position(const NcOptions& options) {
  return options.reference.size() > 0 ? options.reference : initial_position(options);
}

std::optional<Vector3d> tip_at_zero(const Chain& chain) {
  constexpr double max_misalignment = 1e-9;  // mm per mm
  std::array<int, 3> xyz{-1, -1, -1};
  for (int j = 0; j < chain.size(); ++j) {
    const kinematics::Joint& joint = chain.joints()[std::size_t(j)];
    if (joint.name >= 'X' && joint.name <= 'Z' && joint.motion == kinematics::Motion::Linear)
      xyz[std::size_t(joint.name - 'X')] = j;
  }
  // A displacement of each axis by 1 mm must move the tip by 1 mm along x, y or z of the workpiece.
  const AxisVector zero = AxisVector::Zero(chain.size());
  const Vector3d tip_w = chain.tool_in_workpiece(zero).translation();
  for (int k = 0; k < 3; ++k) {
    if (xyz[std::size_t(k)] < 0) return std::nullopt;
    AxisVector q = zero;
    q[xyz[std::size_t(k)]] = 1.0;
    const Vector3d displacement_w = chain.tool_in_workpiece(q).translation() - tip_w;
    if ((displacement_w - Vector3d::Unit(k)).norm() > max_misalignment) return std::nullopt;
  }
  return tip_w;
}

std::optional<AxisVector> tip_shift(const Chain& chain) {
  constexpr double max_cosine = 1e-9;  // of the angle between two perpendicular slides
  const AxisVector zero = AxisVector::Zero(chain.size());
  const Vector3d tip_w = chain.tool_in_workpiece(zero).translation();
  AxisVector shift = zero;
  std::vector<Vector3d> directions;
  for (int j = 0; j < chain.size(); ++j) {
    const kinematics::Joint& joint = chain.joints()[std::size_t(j)];
    if (joint.name < 'X' || joint.name > 'Z' || joint.motion != kinematics::Motion::Linear)
      continue;
    AxisVector q = zero;
    q[j] = 1.0;
    const Vector3d displacement_w = chain.tool_in_workpiece(q).translation() - tip_w;
    for (const Vector3d& direction_w : directions)
      if (std::abs(direction_w.dot(displacement_w)) > max_cosine) return std::nullopt;
    directions.push_back(displacement_w);
    // Subtracting the tip position along the slide puts the tip at the programmed position.
    shift[j] = -displacement_w.dot(tip_w);
  }
  return shift;
}

// G43 adds the length along Z, so the nose lies above the tip by that much in Z, whatever the
// direction of the tool with all axes at zero.
std::optional<ProgramZero> workpiece_zero(const NcOptions& options) {
  const bool has_tool_chains = !options.control_by_h.empty();
  if (!has_tool_chains && !options.control) return std::nullopt;
  const Chain& chain = has_tool_chains ? options.control_by_h.begin()->second : *options.control;
  auto length = options.tool_length.find(has_tool_chains ? options.control_by_h.begin()->first : 1);
  // H1 is the usual register of the only tool; without it the first one counts.
  if (length == options.tool_length.end()) length = options.tool_length.begin();
  const auto tip_w = tip_at_zero(chain);
  if (!tip_w) return std::nullopt;
  const double mm = length == options.tool_length.end() ? 0.0 : length->second;
  const auto& joints = chain.joints();
  const bool has_rotary_axis = std::any_of(
      joints.begin(), joints.end(),
      [](const kinematics::Joint& joint) { return joint.motion == kinematics::Motion::Rotary; });
  return ProgramZero{*tip_w + mm * Vector3d::UnitZ(), has_rotary_axis};
}

std::optional<ProgramZero> program_zero(const NcOptions& options) {
  const auto& offsets = options.work_offset;
  const bool has_offsets = !options.extra_offsets.empty() ||
                           std::any_of(offsets.begin(), offsets.end(),
                                       [](const AxisVector& offset) { return offset.size() > 0; });
  return has_offsets ? workpiece_zero(options) : std::nullopt;
}

Vector3d offset_correction(const std::optional<ProgramZero>& zero, Coordinates coordinates) {
  // Points under a tip mode and slide positions under axis coordinates need no correction; the
  // other two combinations differ by the nose position.
  const bool needs_correction = zero && zero->places == (coordinates == Coordinates::Axis);
  if (!needs_correction) return Vector3d::Zero();
  return zero->places ? Vector3d(-zero->nose_w) : zero->nose_w;
}

}  // namespace abbe::sim::program
