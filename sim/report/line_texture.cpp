#include "sim/report/line_texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/files/json_files.h"

namespace abbe::sim {

namespace {

using Eigen::Index;
using Eigen::Vector3d;
using EdgeOfMesh = std::pair<int, int>;  // pair of vertices, the lower first

/// Point where the plane crosses an edge.
struct TraceNode {
  Vector3d point;
  double residual;
};

/// A plane perpendicular to x or y.
struct CrossPlane {
  int across;
  double level;

  // A vertex in the plane counts as above it. Each edge then has at most one crossing, and no chain
  // of nodes is interrupted at a vertex.
  bool is_below(const cutting::Design& design, int vertex) const {
    return design.vertices(vertex, across) < level;
  }
};

/// A section of the mesh: its nodes, the neighbours of each node in the triangles, and these
/// triangles.
struct MeshSection {
  std::map<EdgeOfMesh, TraceNode> nodes;
  std::map<EdgeOfMesh, std::vector<EdgeOfMesh>> neighbours;
  std::vector<Index> triangles;
};

/// Returns the plane of a line: through the middle of the part or, for a radius, through its z
/// axis.
CrossPlane section_plane(const cutting::Design& design, ProfileLine line) {
  if (line == ProfileLine::Radius) return {1, 0.0};
  const int across = line == ProfileLine::X ? 1 : 0;
  const auto column = design.vertices.col(across);
  return {across, 0.5 * (column.minCoeff() + column.maxCoeff())};
}

/// Returns the point where the plane crosses an edge, with the residual interpolated there.
TraceNode crossing_node(const ProfiledMap& map, const CrossPlane& plane, const EdgeOfMesh& edge) {
  const auto& [a, b] = edge;
  const auto& vertices = map.design.vertices;
  const double p = vertices(a, plane.across) - plane.level;
  const double q = vertices(b, plane.across) - plane.level;
  const double u = p / (p - q);
  return {(1.0 - u) * vertices.row(a) + u * vertices.row(b),
          (1.0 - u) * map.residual[a] + u * map.residual[b]};
}

/// Returns the section of the cut area by a plane.
MeshSection mesh_section(const ProfiledMap& map, const CrossPlane& plane) {
  MeshSection section;
  for (Index t = 0; t < map.design.triangles.rows(); ++t) {
    std::vector<EdgeOfMesh> ends;
    for (int k = 0; k < 3; ++k) {
      const int a = map.design.triangles(t, k), b = map.design.triangles(t, (k + 1) % 3);
      if (plane.is_below(map.design, a) != plane.is_below(map.design, b))
        ends.emplace_back(std::min(a, b), std::max(a, b));
    }
    if (ends.size() != 2) continue;
    const std::array<TraceNode, 2> nodes = {crossing_node(map, plane, ends[0]),
                                            crossing_node(map, plane, ends[1])};
    // A triangle with an uncut corner ends a segment: residuals there are unknown.
    if (!std::isfinite(nodes[0].residual) || !std::isfinite(nodes[1].residual)) continue;
    for (std::size_t k = 0; k < 2; ++k) {
      section.nodes.emplace(ends[k], nodes[k]);
      section.neighbours[ends[k]].push_back(ends[1 - k]);
    }
    section.triangles.push_back(t);
  }
  return section;
}

using NodeChain = std::vector<TraceNode>;

/// Returns the chain of nodes from a node to the end, and removes its connections from the section.
NodeChain take_chain(MeshSection& section, EdgeOfMesh edge) {
  NodeChain chain{section.nodes.at(edge)};
  while (true) {
    std::vector<EdgeOfMesh>& neighbours = section.neighbours.at(edge);
    if (neighbours.empty()) return chain;
    const EdgeOfMesh next_edge = neighbours.back();
    neighbours.pop_back();
    std::vector<EdgeOfMesh>& reverse = section.neighbours.at(next_edge);
    reverse.erase(std::find(reverse.begin(), reverse.end(), edge));
    edge = next_edge;
    chain.push_back(section.nodes.at(edge));
  }
}

/// Returns the connected chains of a section. Open chains are taken first, from their ends; all
/// that remains then is closed.
/// @param axis  coordinate of which a closed chain begins at its smallest value
std::vector<NodeChain> node_chains(MeshSection section, int axis) {
  std::vector<NodeChain> chains;
  for (const auto& [edge, node] : section.nodes)
    if (section.neighbours.at(edge).size() == 1) chains.push_back(take_chain(section, edge));
  for (const auto& [edge, node] : section.nodes) {
    if (section.neighbours.at(edge).empty()) continue;
    NodeChain ring = take_chain(section, edge);
    ring.pop_back();  // a closed chain ends at its first node
    std::rotate(ring.begin(),
                std::min_element(ring.begin(), ring.end(),
                                 [&](const TraceNode& a, const TraceNode& b) {
                                   return a.point[axis] < b.point[axis];
                                 }),
                ring.end());
    ring.push_back(ring.front());
    chains.push_back(std::move(ring));
  }
  return chains;
}

/// Returns the parts of a chain with x >= 0, cut at x = 0.
std::vector<NodeChain> positive_x_parts(const NodeChain& chain) {
  std::vector<NodeChain> parts(1);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    if (i > 0 && (chain[i - 1].point.x() < 0.0) != (chain[i].point.x() < 0.0)) {
      const double p = chain[i - 1].point.x(), q = chain[i].point.x(), u = p / (p - q);
      const TraceNode axis{(1.0 - u) * chain[i - 1].point + u * chain[i].point,
                           std::lerp(chain[i - 1].residual, chain[i].residual, u)};
      parts.back().push_back(axis);
      if (q < 0.0) parts.emplace_back();
    }
    if (chain[i].point.x() >= 0.0) parts.back().push_back(chain[i]);
  }
  return parts;
}

/// Returns the chain without coinciding nodes, between which the line has no direction.
NodeChain distinct_nodes(const NodeChain& chain) {
  // If the plane passes through a vertex, its crossings with the edges there agree to about 1e-13
  // mm.
  constexpr double min_distance = 1e-9;  // mm
  NodeChain distinct;
  for (const TraceNode& node : chain)
    if (distinct.empty() || (node.point - distinct.back().point).norm() > min_distance)
      distinct.push_back(node);
  return distinct;
}

double chain_length(const NodeChain& chain) {
  double length = 0.0;
  for (std::size_t i = 1; i < chain.size(); ++i)
    length += (chain[i].point - chain[i - 1].point).norm();
  return length;
}

/// Returns the error of linear interpolation at the sampled points of triangles; empty without
/// sampled points.
std::optional<LineTrace::InterpolationError> interpolation_error(
    const ProfiledMap& map, const std::vector<Index>& triangles) {
  LineTrace::InterpolationError result;
  double sum_of_squares = 0.0;
  for (const Index t : triangles) {
    if (map.within.size() == 0 || !std::isfinite(map.within[t])) continue;
    const std::array<double, 3> weights = cutting::sample_barycentric(map.interior_sample, t);
    double interpolated = 0.0;
    for (int k = 0; k < 3; ++k)
      interpolated += weights[std::size_t(k)] * map.residual[map.design.triangles(t, k)];
    const double error = map.within[t] - interpolated;
    if (!std::isfinite(error)) continue;
    ++result.points;
    sum_of_squares += error * error;
    result.max = std::max(result.max, std::abs(error));
  }
  if (result.points == 0) return std::nullopt;
  result.rms = std::sqrt(sum_of_squares / result.points);
  return result;
}

/// Returns the trace of a chain with arc lengths and spacings.
LineTrace chain_trace(const NodeChain& chain, ProfileLine line) {
  const auto n = Index(chain.size());
  LineTrace trace;
  trace.s = trace.along = trace.residual = Eigen::VectorXd(n);
  trace.points.resize(n, 3);
  for (Index i = 0; i < n; ++i) {
    const TraceNode& node = chain[std::size_t(i)];
    const double step = i > 0 ? (node.point - chain[std::size_t(i) - 1].point).norm() : 0.0;
    trace.s[i] = i > 0 ? trace.s[i - 1] + step : 0.0;
    trace.points.row(i) = node.point;
    trace.along[i] = line == ProfileLine::Y        ? node.point.y()
                     : line == ProfileLine::Radius ? node.point.head<2>().norm()
                                                   : node.point.x();
    trace.residual[i] = node.residual;
    trace.max_spacing = std::max(trace.max_spacing, step);
  }
  trace.mean_spacing = trace.s[n - 1] / double(n - 1);
  return trace;
}

}  // namespace

ProfileLine parse_profile_line(const std::string& name) {
  if (name == "x") return ProfileLine::X;
  if (name == "y") return ProfileLine::Y;
  require(name == "radius", "traced_line: expected x, y or radius");
  return ProfileLine::Radius;
}

std::optional<LineTrace> line_trace(const ProfiledMap& map, ProfileLine line) {
  require(map.residual.size() == map.design.vertices.rows() &&
              (map.within.size() == 0 || map.within.size() == map.design.triangles.rows()),
          "line_trace: sizes differ");
  const CrossPlane plane = section_plane(map.design, line);
  const int axis = line == ProfileLine::Y ? 1 : 0;
  const MeshSection section = mesh_section(map, plane);
  std::vector<NodeChain> chains;
  for (const NodeChain& whole : node_chains(section, axis)) {
    const std::vector<NodeChain> parts =
        line == ProfileLine::Radius ? positive_x_parts(whole) : std::vector<NodeChain>{whole};
    for (const NodeChain& part : parts)
      if (NodeChain chain = distinct_nodes(part); chain.size() >= 2)
        chains.push_back(std::move(chain));
  }
  if (chains.empty()) return std::nullopt;
  double total_length = 0.0;
  for (const NodeChain& chain : chains) total_length += chain_length(chain);
  const auto longest = std::max_element(
      chains.begin(), chains.end(),
      [](const NodeChain& a, const NodeChain& b) { return chain_length(a) < chain_length(b); });
  const double length = chain_length(*longest);
  // The direction of a chain is arbitrary; a profile is drawn in the direction of the axis.
  if (longest->front().point[axis] > longest->back().point[axis])
    std::reverse(longest->begin(), longest->end());
  LineTrace trace = chain_trace(*longest, line);
  trace.segments = int(chains.size());
  trace.omitted_length = std::max(0.0, total_length - length);
  trace.interpolation = interpolation_error(map, section.triangles);
  return trace;
}

namespace {

using errors::metrology::EvaluationLength;
using errors::metrology::ProfileParameters;
using errors::metrology::ProfileTexture;
using errors::metrology::SettingClass;
using nlohmann::ordered_json;

// Largest interpolation error over Rq. Added in squares, an error of 5 % changes Rq by 0.1 %.
constexpr double resolved_fraction = 0.05;

/// Returns the setting class of the standard for Nic; null if the standard has no class for it.
const SettingClass* find_setting_class(double Nic) {
  const SettingClass& nearest = errors::metrology::setting_class(Nic);
  return std::abs(nearest.Nic - Nic) < 1e-9 * Nic ? &nearest : nullptr;
}

/// Returns a warning if the line is too short for its sections or for the filter.
std::string short_warning(const LineTexture& t, int requested_sections) {
  const EvaluationLength& e = t.texture.sections;
  if (t.texture.length < t.Nic)
    return fmt::format(
        "the profile is {:.4g} mm long, less than one section length of {:.4g} mm (Nic): R covers "
        "all of it, and waves near Nic may be in either W or R",
        t.texture.length, t.Nic);
  if (e.sections < requested_sections)
    return fmt::format(
        "R covers {} section{} of {:.4g} mm instead of {}: the profile is only {:.4g} mm long, so "
        "R parameters scatter more",
        e.sections, e.sections == 1 ? "" : "s", e.section, requested_sections, t.texture.length);
  // The filter of ISO 16610-21 needs half of Nic on either side of the evaluation length.
  if (t.texture.run_in < 0.5 * t.Nic)
    return fmt::format(
        "the profile has {:.3g} mm before and after the evaluation length of R, less than half of "
        "Nic ({:.3g} mm); the mean line there is fitted one-sided",
        t.texture.run_in, 0.5 * t.Nic);
  return {};
}

/// Returns true if the sampled points prove that linear interpolation resolves the profile.
bool is_resolved(const LineTexture& t) {
  return t.trace.interpolation && t.trace.interpolation->rms <= resolved_fraction * t.texture.R.q;
}

/// Returns a warning if the map does not resolve the profile, or if that is unknown; else empty.
std::string spacing_warning(const LineTexture& t) {
  const double Rq = t.texture.R.q;
  const LineTrace& trace = t.trace;
  if (is_resolved(t)) return {};
  if (trace.interpolation) {
    return fmt::format(
        "the map does not resolve the profile: at {} points inside the triangles it deviates by "
        "{:.3g} um RMS ({:.3g} um at most) from linear interpolation between their corners, and Rq "
        "is {:.3g} um: waves finer than the triangles (spacing {:.3g} mm, {:.3g} mm at most) are "
        "missing from R or appear as longer waves",
        trace.interpolation->points, trace.interpolation->rms / units::um,
        trace.interpolation->max / units::um, Rq / units::um, trace.mean_spacing,
        trace.max_spacing);
  }
  const double widest = errors::metrology::setting_class(t.Nic).widest_step;
  if (trace.max_spacing <= widest) return {};
  return fmt::format(
      "it is unknown whether the map resolves the profile: the triangle spacing is {:.3g} mm "
      "({:.3g} mm at most), Nis {:.3g} um needs a point every {:.3g} um, and the map was not "
      "sampled between the vertices (part.sampling = \"adaptive\" does this)",
      trace.mean_spacing, trace.max_spacing, t.texture.requested_Nis / units::um,
      widest / units::um);
}

/// Returns all warnings about the evaluation.
std::vector<std::string> texture_warnings(const LineTexture& t, int sections) {
  std::vector<std::string> warnings;
  const auto add = [&](std::string text) {
    if (!text.empty()) warnings.push_back(std::move(text));
  };
  add(short_warning(t, sections));
  if (t.trace.omitted_length > 0.0)
    add(
        fmt::format("the profile is cut in {} segments; the longest, {:.4g} mm, is evaluated, "
                    "{:.4g} mm are omitted",
                    t.trace.segments, t.texture.length, t.trace.omitted_length));
  if (t.texture.Nis > t.texture.requested_Nis * (1.0 + 1e-6))
    add(fmt::format(
        "Nis is {:.4g} um instead of {:.4g} um: the profile has at most {} points, {:.4g} um apart",
        t.texture.Nis / units::um, t.texture.requested_Nis / units::um, t.texture.primary.z.size(),
        t.texture.primary.step / units::um));
  add(spacing_warning(t));
  return warnings;
}

/// A profile parameter of ISO 21920-2.
struct ParameterRow {
  const char* name;  ///< without the letter of the profile, P, W or R
  const char* description;
  const char* unit;  ///< suffix of the key; empty for a dimensionless number
  std::optional<double> (*value)(const ProfileParameters&);
};

constexpr std::array parameter_rows = {
    ParameterRow{"a", "arithmetic mean height", "um",
                 [](const ProfileParameters& p) { return std::optional(p.a / units::um); }},
    ParameterRow{"q", "root mean square height", "um",
                 [](const ProfileParameters& p) { return std::optional(p.q / units::um); }},
    ParameterRow{"t", "total height", "um",
                 [](const ProfileParameters& p) { return std::optional(p.t / units::um); }},
    ParameterRow{"z", "maximum height, mean of sections", "um",
                 [](const ProfileParameters& p) { return std::optional(p.z / units::um); }},
    ParameterRow{"zx", "largest maximum height of a section", "um",
                 [](const ProfileParameters& p) { return std::optional(p.zx / units::um); }},
    ParameterRow{"p", "mean peak height of sections", "um",
                 [](const ProfileParameters& p) { return std::optional(p.p / units::um); }},
    ParameterRow{"v", "mean pit depth of sections", "um",
                 [](const ProfileParameters& p) { return std::optional(p.v / units::um); }},
    ParameterRow{"sk", "skewness", "", [](const ProfileParameters& p) { return p.sk; }},
    ParameterRow{"ku", "kurtosis", "", [](const ProfileParameters& p) { return p.ku; }},
    ParameterRow{"sm", "mean profile element spacing", "mm",
                 [](const ProfileParameters& p) { return p.sm; }},
    ParameterRow{"dq", "root mean square gradient", "um_per_mm",
                 [](const ProfileParameters& p) { return std::optional(p.dq / units::um); }}};

std::string shown_row_unit(const ParameterRow& row) {
  const std::string unit = row.unit;
  return unit == "um_per_mm" ? "um/mm" : unit.empty() ? "1" : unit;
}

/// Returns the parameters of a profile under keys such as "Ra_um".
/// @param letter  P, W or R
ordered_json parameters_json(char letter, const ProfileParameters& p) {
  ordered_json json;
  for (const ParameterRow& row : parameter_rows) {
    const std::string unit = row.unit;
    json[letter + std::string(row.name) + (unit.empty() ? "" : "_" + unit)] = number(row.value(p));
  }
  return json;
}

/// Returns the length over which a kind of profile was evaluated.
ordered_json evaluation_json(const ProfileTexture& t, const EvaluationLength& e) {
  const double length = std::min(e.section * e.sections, t.length);
  return {{"from_mm", e.from},
          {"length_mm", length},
          {"sections", e.sections},
          {"section_mm", std::min(e.section, t.length)}};
}

std::string class_text(double Nic) {
  const SettingClass* setting_class = find_setting_class(Nic);
  return setting_class != nullptr ? fmt::format(", setting class {}", setting_class->name) : "";
}

}  // namespace

LineTexture line_texture(LineTrace trace, const std::optional<double>& form_cutoff,
                         const LineTextureOptions& options) {
  constexpr double default_Nic = 2.5;  // mm, for a part without form_cutoff_mm
  LineTexture t;
  t.Nic = options.Nic.value_or(form_cutoff.value_or(default_Nic));
  t.Nic_source = options.Nic ? "--nic" : form_cutoff ? "form_cutoff_mm of the part" : "assumed";
  errors::metrology::TextureOptions settings;
  settings.Nic = t.Nic;
  settings.Nis = options.Nis;
  settings.sections = options.sections;
  t.texture = errors::metrology::profile_texture(trace.s, trace.residual, settings);
  t.trace = std::move(trace);
  t.warnings = texture_warnings(t, options.sections);
  return t;
}

Eigen::VectorXd values_on_profile(const LineTexture& t, const Eigen::VectorXd& values) {
  const Eigen::VectorXd& s = t.trace.s;
  Eigen::VectorXd profile(t.texture.primary.z.size());
  Index k = 0;
  for (Index i = 0; i < profile.size(); ++i) {
    const double position = double(i) * t.texture.primary.step;
    while (k + 2 < s.size() && s[k + 1] < position) ++k;
    profile[i] = std::lerp(values[k], values[k + 1],
                           std::clamp((position - s[k]) / (s[k + 1] - s[k]), 0.0, 1.0));
  }
  return profile;
}

std::string to_text(const LineTexture& t) {
  const ProfileTexture& texture = t.texture;
  const EvaluationLength& e = texture.sections;
  std::string text = fmt::format(
      "profile along {}\n{:.4g} mm along the surface; Nis {:.4g} um, Nic {:.4g} mm ({}{}); "
      "Gaussian filters (ISO 16610-21), lines fitted at the ends (ISO 16610-28)\nP and W: {:.4g} "
      "mm, minus the least-squares line; R: {} section{} of {:.4g} mm from {:.4g} mm\n",
      t.position, texture.length, texture.Nis / units::um, t.Nic, t.Nic_source, class_text(t.Nic),
      texture.length, e.sections, e.sections == 1 ? "" : "s", std::min(e.section, texture.length),
      e.from);
  if (t.trace.interpolation)
    text += fmt::format(
        "inside its triangles the map deviates from linear interpolation by {:.3g} um RMS, {:.3g} "
        "um at most, at {} points\n",
        t.trace.interpolation->rms / units::um, t.trace.interpolation->max / units::um,
        t.trace.interpolation->points);
  text += fmt::format("\n{:<40} {:>12} {:>12} {:>12}  {}\n", "ISO 21920-2", "P", "W", "R", "unit");
  for (const ParameterRow& row : parameter_rows) {
    text += fmt::format("{:<3} {:<36}", row.name, row.description);
    for (const ProfileParameters* p : {&texture.P, &texture.W, &texture.R}) {
      const std::optional<double> value = row.value(*p);
      text += fmt::format(" {:>12}", value ? fmt::format("{:.5g}", *value) : "-");
    }
    text += "  " + shown_row_unit(row) + "\n";
  }
  return text;
}

ordered_json to_json(const LineTexture& t) {
  const ProfileTexture& texture = t.texture;
  const SettingClass* setting_class = find_setting_class(t.Nic);
  ordered_json json = {
      {"line", t.line},
      {"where", t.position},
      {"length_mm", texture.length},
      {"stretches", t.trace.segments},
      {"left_out_mm", t.trace.omitted_length},
      {"filter", "Gaussian, ISO 16610-21"},
      {"ends", "first moment retained, ISO 16610-28"},
      {"form_removed", "the design surface, then the least-squares line"},
      {"Nic_mm", t.Nic},
      {"Nic_of", t.Nic_source},
      {"Nis_um", texture.Nis / units::um},
      {"setting_class",
       setting_class != nullptr ? ordered_json(setting_class->name) : ordered_json()},
      {"step_um", texture.primary.step / units::um},
      {"places", texture.primary.z.size()},
      {"spacing_mm", {{"mean", t.trace.mean_spacing}, {"max", t.trace.max_spacing}}}};
  json["interpolation"] = t.trace.interpolation
                              ? ordered_json{{"places", t.trace.interpolation->points},
                                             {"rms_um", t.trace.interpolation->rms / units::um},
                                             {"worst_um", t.trace.interpolation->max / units::um}}
                              : ordered_json();
  json["evaluation"] = {{"P", evaluation_json(texture, texture.whole)},
                        {"W", evaluation_json(texture, texture.whole)},
                        {"R", evaluation_json(texture, texture.sections)}};
  json["P"] = parameters_json('P', texture.P);
  json["W"] = parameters_json('W', texture.W);
  json["R"] = parameters_json('R', texture.R);
  json["warnings"] = t.warnings;
  return json;
}

std::string to_csv(const LineTexture& t) {
  const ProfileTexture& texture = t.texture;
  const Eigen::VectorXd x = values_on_profile(t, t.trace.points.col(0));
  const Eigen::VectorXd y = values_on_profile(t, t.trace.points.col(1));
  const Eigen::VectorXd z = values_on_profile(t, t.trace.points.col(2));
  const Eigen::VectorXd residual = values_on_profile(t, t.trace.residual);
  std::string text = "s_mm,x_mm,y_mm,z_mm,residual_um,primary_um,waviness_um,roughness_um\n";
  for (Index i = 0; i < residual.size(); ++i)
    fmt::format_to(std::back_inserter(text),
                   "{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f}\n",
                   double(i) * texture.primary.step, x[i], y[i], z[i], residual[i] / units::um,
                   texture.primary.z[i] / units::um, texture.waviness[i] / units::um,
                   texture.roughness[i] / units::um);
  return text;
}

std::string main_parameters(const LineTexture& t) {
  const auto um = [](double mm) { return fmt::format("{:.3g} µm", mm / units::um); };
  const ProfileTexture& texture = t.texture;
  return fmt::format("Ra {}, Rq {}, Rz {}, Rsm {}; Wa {}, Wt {}; Pt {}", um(texture.R.a),
                     um(texture.R.q), um(texture.R.z),
                     texture.R.sm ? fmt::format("{:.3g} mm", *texture.R.sm) : "none",
                     um(texture.W.a), um(texture.W.t), um(texture.P.t));
}

std::string main_settings(const LineTexture& t) {
  const EvaluationLength& e = t.texture.sections;
  return fmt::format(
      "ISO 21920{}: Nis {:.4g} µm, Nic {:.4g} mm, R over {} × {:.4g} mm, P and W over "
      "{:.4g} mm",
      t.line == "radius" ? " towards +x" : "", t.texture.Nis / units::um, t.Nic, e.sections,
      std::min(e.section, t.texture.length), t.texture.length);
}

std::string resolution_warning(const LineTexture& t) {
  if (!t.trace.interpolation || is_resolved(t)) return {};
  return fmt::format(
      "not resolved: inside its triangles the map deviates from linear interpolation by {:.3g} µm "
      "RMS",
      t.trace.interpolation->rms / units::um);
}

}  // namespace abbe::sim
