#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "cutting/stock/force.h"
#include "cutting/surface/tool.h"
#include "errors/compliance.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

/// Wear of the actual cutter, in proportion to the cutting time or to the cutting distance.
struct ToolWear {
  std::optional<double> time_s;    ///< time at feed until the cutter has lost `radius` and `length`
  std::optional<double> distance;  ///< mm, distance of the tip at feed until then; either the time
                                   ///< or the distance is present
  double radius = 0.0;  ///< mm, loss of radius; the tip stays in place, a ball stays a ball
  double length = 0.0;  ///< mm, loss of length; the tip recedes along the tool axis
};

/// A cutter described by the parameters of APT.
struct AptForm {
  cutting::AptCutter numbers{.diameter = 0.0, .height = 0.0};  ///< parameters except those below
  std::optional<double> diameter;       ///< mm; none: the centre of the corner lies on the axis
  std::optional<double> radial, axial;  ///< mm, centre of the corner; none: the corner is tangent
};
/// A cutter described by points of its outline.
struct OutlineForm {
  Eigen::VectorXd radii, heights;       ///< (n) mm
  std::optional<Eigen::VectorXd> arcs;  ///< (n) mm, arc radius up to each point; 0 or none:
                                        ///< straight
};
/// A cutter described by points of an outline that may be hollow.
struct ProfileForm {
  Eigen::VectorXd radii, heights;       ///< (n) mm
  std::optional<Eigen::VectorXd> arcs;  ///< (n) mm, as above; negative: the arc bulges inwards
};
/// The form of a tool that is neither a ball, bull-nosed or flat cutter nor a round nose. The first
/// three forms are milling cutters; a turning tool has an insert or the points of its edge.
using ToolForm = std::variant<std::monostate, AptForm, OutlineForm, ProfileForm, cutting::Insert,
                              std::vector<cutting::OutlinePoint>>;
using ToolShape = std::variant<cutting::Cutter, cutting::Nose>;

/// A tool, nominal and actual.
struct ToolDescription {
  std::string name;
  std::optional<int> number;  ///< T number by which a program calls the tool
  ToolShape nominal;
  ToolShape actual;                              ///< same alternative as nominal
  ToolForm nominal_form = {}, actual_form = {};  ///< the forms from which the shapes are made
  double length = 0.0;                           ///< mm from the nose s to the tip t
  double actual_length = 0.0;                    ///< mm
  double centring_offset = 0.0;       ///< mm, turning: actual displacement of the tip along x of t
  double centring_height = 0.0;       ///< mm, turning: actual displacement of the tip along y of t
  std::optional<ToolWear> wear = {};  ///< of a milling cutter
  std::optional<double> shank_radius = {};      ///< mm, above the flank; none: that of the cutter
  std::optional<Eigen::MatrixX2d> holder = {};  ///< (n x 2) mm, radius and height above the tip
  // Properties that replace those of [cutting], [material] and [compliance] for this tool:
  std::optional<cutting::Flutes> flutes = {};  ///< of a milling cutter
  std::optional<cutting::CuttingCoefficients> material = {};
  std::optional<errors::Compliance> compliance = {};  ///< nose to tip, at the tip in frame t
};

struct Key;

/// Reads `tool`, one tool or several tools with numbers.
/// @param section  a table or a list of tables
/// @return at least one tool
std::vector<ToolDescription> read_tools(const Node& section, InputErrors& input_errors);
Node::Table tool_to_table(const ToolDescription& tool);
std::vector<Key> tool_keys();

}  // namespace abbe::sim
