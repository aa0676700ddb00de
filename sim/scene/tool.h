#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "cutting/surface/tool.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

/// What the true cutter loses while it cuts, in proportion to the time or the way of its tip at
/// feed.
struct ToolWear {
  std::optional<double> time_s;  ///< after which it has lost the two
  std::optional<double> way;     ///< mm, likewise; one of the two is there
  double radius = 0.0;           ///< mm, the tip stays where it is; a ball stays a ball
  double length = 0.0;           ///< mm, the tip goes back along the axis of the tool
};

/// The cutter of APT as it is described.
struct AptForm {
  cutting::AptCutter numbers{.diameter = 0.0, .height = 0.0};  ///< but for the next three
  std::optional<double> diameter;       ///< mm; none: the corner's middle is on the axis
  std::optional<double> radial, axial;  ///< mm, of the middle of the corner; none: it is tangent
};
/// A cutter by points of its outline.
struct OutlineForm {
  Eigen::VectorXd radii, heights;       ///< (n) mm
  std::optional<Eigen::VectorXd> arcs;  ///< (n) mm, on the way to a point; 0 and none: straight
};
/// The same of one that may be hollow.
struct ProfileForm {
  Eigen::VectorXd radii, heights;       ///< (n) mm
  std::optional<Eigen::VectorXd> arcs;  ///< (n) mm, as above; below 0: it bulges inwards
};
/// What makes the shape of a tool that is no common cutter and no round nose: of a cutter the first
/// three, of a turning tool an insert or points around a free edge.
using ToolForm = std::variant<std::monostate, AptForm, OutlineForm, ProfileForm, cutting::Insert,
                              std::vector<cutting::OutlinePoint>>;
using ToolShape = std::variant<cutting::Cutter, cutting::Nose>;

/// A tool, what the control believes of it, and what it really is.
struct ToolDescription {
  std::string name;
  std::optional<int> number;  ///< T of a program that calls it
  ToolShape nominal;
  ToolShape actual;                              ///< same alternative as nominal
  ToolForm nominal_form = {}, actual_form = {};  ///< of which those are made
  double length = 0.0;                           ///< mm from the nose s to the tip t
  double actual_length = 0.0;                    ///< mm
  double centring_offset = 0.0;       ///< mm, turning: the tip stands this much along t's x really
  double centring_height = 0.0;       ///< mm, turning: and this much along t's y
  std::optional<ToolWear> wear = {};  ///< of a milling cutter
  std::optional<double> shank_radius = {};      ///< mm, above the flank; none: the cutter's
  std::optional<Eigen::MatrixX2d> holder = {};  ///< (n x 2) mm, radius and height above the tip
};

struct Key;

/// One tool, or several of which each has its number.
/// @param section  a table or a list of them @return one at least
std::vector<ToolDescription> read_tools(const Node& section, InputErrors& input_errors);
Node::Table written_tool(const ToolDescription& tool);
std::vector<Key> tool_keys();

}  // namespace abbe::sim
