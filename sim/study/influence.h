#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"
#include "sim/study/configuration.h"

namespace abbe::sim::study {

/// Linear model of the effect of every input on the surface, from one run of a configuration with
/// all inputs at their centres. For each vertex it holds the few competing passes, and for each of
/// them the distance along the normal and the shift across the pass per unit of each input, from
/// the instant of the pass and the Jacobian of the chain (for sources other than geometry: from a
/// finite difference). The map at other values is the minimum over the passes of
///   distance + slope x + curvature / 2 (shift x)^2,
/// x being the offsets of the inputs from their centres.
struct InfluenceMap {
  cutting::Design design;           ///< workpiece frame
  std::vector<Eigen::Index> first;  ///< (n + 1) passes of vertex v are first[v] .. first[v + 1] - 1
  std::vector<cutting::VertexStatus> status;  ///< (n) of the base run
  Eigen::VectorXd error_free;      ///< (n) mm, subtracted if the study requests it; else zero
  Eigen::VectorXd distance;        ///< (m) mm
  Eigen::VectorXd half_curvature;  ///< (m) 1/mm
  Eigen::MatrixXd slope;           ///< (p x m) mm per unit of the input
  Eigen::MatrixXd shift;           ///< (p x m) the same, across the pass
  Eigen::VectorXd centre;          ///< (p) inputs of the base run
  Eigen::VectorXd doubt;  ///< (n) mm, largest difference from a machine that was cut in full;
                          ///< infinite where only one of the two is cut
  double flagged_percent = 0.0;  ///< of the judged area: doubt exceeds the study's flag
};

/// Returns true if the base run cuts vertex v, so that the vertex has passes.
inline bool is_cut(const InfluenceMap& influence, Eigen::Index v) {
  return influence.first[std::size_t(v)] < influence.first[std::size_t(v) + 1];
}

/// Returns the number of vertices that the base run gouges deeper than the band. They have no
/// passes, so the figures of the map would omit its worst part.
std::size_t gouge_count(const InfluenceMap& influence);

/// Number of machines that are computed together; fewer cost as much. Eigen sums rows beyond a
/// multiple of three packets in another order: 72 is such a multiple for packets of 2, 4 and 8
/// numbers.
inline constexpr int machines_per_lot = 72;

/// Returns the maps of many machines. The bits of a case do not depend on the cases computed with
/// it.
/// @param x (p x cases) inputs
/// @return (n x cases) mm, NaN where not cut
Eigen::MatrixXd maps(const InfluenceMap& influence, const Eigen::MatrixXd& x);

/// Returns true if a response is found by counting vertices in order or from the filtered map: it
/// needs the maps themselves and has no gradient in closed form.
bool is_counted_response(Response response);

/// Returns the responses of many machines, equal to `responses` of their maps. Without an
/// alignment, and if no response is counted, the maps are not stored: 10 000 vertices, 100 inputs
/// and four passes a vertex cost 8 M multiplications a machine, 0.2 ms on two cores.
/// @return (responses x cases)
Eigen::MatrixXd responses(const Study& study, const PreparedConfiguration& ready,
                          const InfluenceMap& influence, const Eigen::MatrixXd& x);

/// Returns the effect on each vertex of a unit of each input, for the pass that makes the surface
/// in the base run. (p x n), NaN where not cut
Eigen::MatrixXd effects(const InfluenceMap& influence);

/// Finds the competing passes of the base run, the effect of every input on them, and the vertices
/// where the model fails. Neglected, besides the terms listed at `cutting::CompetingPass`: products
/// of two inputs; the change of the cutting force by a geometric input (under compliance, by the
/// ratio of the change of the depth of cut); on a turned part the square of a displacement D along
/// the cut, slope D^2 / 2r, so that vertices nearer to the spindle axis than some D are flagged. An
/// input that acts nonlinearly has the mean slope between its values at one standard deviation to
/// either side, and is reported as if it were linear.
/// @throws BadInput naming an input that changes part, program, nominal machine or stock, which
/// only the full engine can represent; if none of the checked machines can cut the program; if the
/// base run leaves all of the part uncut or gouged
InfluenceMap influence_map(const Study& study, const PreparedConfiguration& ready,
                           const Progress& progress = {});

/// A response of a configuration as a function of its inputs. Both functions are thread-safe.
struct ResponseFunction {
  /// (p x cases) inputs -> (cases) mm or percent
  std::function<Eigen::VectorXd(const Eigen::MatrixXd& x)> values;
  /// (p x cases) inputs -> (p x cases) per unit of the input; at a kink a one-sided gradient
  std::function<Eigen::MatrixXd(const Eigen::MatrixXd& x)> gradients;
};

/// Returns a response by influence maps. Gradients are exact derivatives of the maps where the
/// scene aligns nothing and the response is not counted, else differences over a hundredth of the
/// spreads. Keeps references: the arguments must outlive it.
ResponseFunction response_function(const Study& study, const PreparedConfiguration& ready,
                                   const InfluenceMap& influence, Response response);

/// Returns the gradients of a response of maps that are not aligned: the slopes of the pass that
/// makes the surface at each vertex, weighted by the derivative of the response with the height of
/// the vertex.
/// @param x  (p x cases)
/// @return (p x cases); zero where nothing is cut
/// @throws std::invalid_argument for a response that is counted
Eigen::MatrixXd gradients(const InfluenceMap& influence, Response response,
                          const Eigen::MatrixXd& x);

}  // namespace abbe::sim::study
