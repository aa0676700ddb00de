#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"
#include "sim/study/configuration.h"

namespace abbe::sim::study {

/// What every input does to the surface, from one run of an arm with all inputs at their centres:
/// for each vertex its few rival passes, for each of them the distance along the normal and the
/// shift across the pass per unit of each input, from the instant of the pass and the Jacobian of
/// the chain (of a source other than geometry: from its own difference). The map of other values is
/// the least over the rivals of
///   distance + slope x + curvature / 2 (shift x)^2.
struct InfluenceMap {
  cutting::Design design;           ///< workpiece frame
  std::vector<Eigen::Index> first;  ///< (n + 1) rivals of vertex v are first[v] .. first[v + 1]
  std::vector<cutting::VertexStatus> status;  ///< (n) of the base run
  Eigen::VectorXd error_free;      ///< (n) mm, taken away where the study asks; else zero
  Eigen::VectorXd distance;        ///< (m) mm
  Eigen::VectorXd half_curvature;  ///< (m) 1/mm
  Eigen::MatrixXd slope;           ///< (p x m) mm per unit of the input
  Eigen::MatrixXd shift;           ///< (p x m) the same, across the pass
  Eigen::VectorXd centre;          ///< (p) inputs of the base run
  Eigen::VectorXd doubt;  ///< (n) mm, most by which a checked machine differed; infinite where
                          ///< only one of both is cut
  double flagged_percent = 0.0;  ///< of the judged area: doubt beyond the study's flag
};

/// Whether the base run cuts vertex v, so that it has rivals.
inline bool is_cut(const InfluenceMap& influence, Eigen::Index v) {
  return influence.first[std::size_t(v)] < influence.first[std::size_t(v) + 1];
}

/// Vertices that the base run gouges deeper than the band: they have no rivals, so that figures of
/// the map would leave out what is worst on it.
std::size_t gouges_of(const InfluenceMap& influence);

/// So many machines are computed together; fewer cost as much. Eigen sums rows beyond a multiple of
/// three packets in another order: 72 is one of packets of 2, 4 and 8 numbers.
inline constexpr int machines_at_once = 72;

/// Maps of many machines. @param x (p x cases) inputs  @return (n x cases) mm, NaN where not cut
/// The bits of a case do not depend on which others are computed with it.
Eigen::MatrixXd maps(const InfluenceMap& influence, const Eigen::MatrixXd& x);

/// Whether a response is counted over the vertices in their order or of the filtered map: it needs
/// the maps themselves and has no gradient in closed form.
bool is_counted(Response response);

/// The responses of many machines, as `responses` of their maps; without an alignment, and of
/// responses that are not counted, the maps are not kept: 10 000 vertices, 100 inputs
/// and four rivals a vertex cost 8 M multiplications a machine, 0.2 ms on two cores.
/// @return (responses x cases)
Eigen::MatrixXd responses(const Study& study, const PreparedConfiguration& ready,
                          const InfluenceMap& influence, const Eigen::MatrixXd& x);

/// Effect on each vertex of a unit of each input, of the pass that makes the surface in the base
/// run. (p x n), NaN where not cut
Eigen::MatrixXd effects(const InfluenceMap& influence);

/// Finds the rivals of the base run, what every input does to them, and where that fails.
/// Left out, beside what `cutting::CompetingPass` says: products of two inputs; that an input
/// through geometric elements changes the cutting force (under compliance, by the share that it
/// changes the depth of cut); of a turned part the square of a displacement D along the cut, slope
/// D^2 / 2r, so that vertices nearer to the spindle line than some D are flagged. An input that is
/// not linear has the mean slope between its values of one standard deviation, and is reported as
/// if it were.
/// @throws BadInput naming an input that changes part, program, nominal machine or stock: the maps
///         cannot follow those, the full engine can; where no checked machine can cut the program;
///         where the base run leaves all of the part uncut or gouged
InfluenceMap influence_map(const Study& study, const PreparedConfiguration& ready,
                           const Progress& progress = {});

/// A response of an arm as a function of its inputs. Both may be called from any thread.
struct ResponseFunction {
  /// (p x cases) inputs -> (cases) mm or percent
  std::function<Eigen::VectorXd(const Eigen::MatrixXd& x)> values;
  /// (p x cases) inputs -> (p x cases) per unit of the input; at a kink that of one side
  std::function<Eigen::MatrixXd(const Eigen::MatrixXd& x)> gradients;
};

/// By influence maps. Gradients are those of the maps in closed form where the scene aligns nothing
/// and the response is not counted, else differences over a hundredth of the spreads. Keeps
/// references: the arguments must outlive it.
ResponseFunction response_function(const Study& study, const PreparedConfiguration& ready,
                                   const InfluenceMap& influence, Response response);

/// Gradients of a response of maps that are not aligned: of the pass that makes the surface at each
/// vertex, weighted as the response weighs the vertex.
/// @param x  (p x cases)  @return (p x cases); zero where nothing is cut
/// @throws std::invalid_argument for a response that is counted
Eigen::MatrixXd gradients(const InfluenceMap& influence, Response response,
                          const Eigen::MatrixXd& x);

}  // namespace abbe::sim::study
