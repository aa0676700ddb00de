#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"
#include "sim/study/configuration.h"

namespace abbe::sim::study {

/// A linear model of the effect of every input on the surface, from one run of a configuration with
/// all inputs at their centres. For each vertex it has the few competing passes, and for each pass
/// the displacement along the normal and the shift across the pass per unit of each input, by the
/// Jacobian of the chain at the instant of the pass (for sources other than geometry by a finite
/// difference). The map at other values is the minimum over the passes of
///   distance + slope x + curvature / 2 (shift x)^2,
/// x being the offsets of the inputs from their centres.
struct InfluenceMap {
  cutting::Design design;           ///< workpiece frame
  std::vector<Eigen::Index> first;  ///< (n + 1) passes of vertex v are first[v] .. first[v + 1] - 1
  std::vector<cutting::VertexStatus> status;  ///< (n) of the base run
  Eigen::VectorXd error_free;      ///< (n) mm, zero unless the study subtracts the error-free map
  Eigen::VectorXd distance;        ///< (m) mm
  Eigen::VectorXd half_curvature;  ///< (m) 1/mm
  Eigen::MatrixXd slope;           ///< (p x m) mm per unit of the input
  Eigen::MatrixXd shift;           ///< (p x m) the same, across the pass
  Eigen::VectorXd centre;          ///< (p) inputs of the base run
  Eigen::VectorXd max_error;  ///< (n) largest difference from a machine that was cut in full, mm;
                              ///< infinite where only one of the two is cut
  double flagged_percent = 0.0;  ///< fraction of the judged area where `max_error` exceeds the
                                 ///< limit of the study
};

/// Returns true if the base run cuts a vertex, so that the vertex has passes.
inline bool is_cut(const InfluenceMap& influence, Eigen::Index vertex) {
  return influence.first[std::size_t(vertex)] < influence.first[std::size_t(vertex) + 1];
}

/// Returns the number of vertices that the base run gouges deeper than the band. They have no
/// passes, so that the figures of the map would leave out its worst part.
std::size_t gouge_count(const InfluenceMap& influence);

/// Number of machines that are computed together; fewer cost as much. Eigen sums the rows beyond a
/// multiple of three packets in another order; 72 is such a multiple for packets of 2, 4 and 8
/// numbers.
inline constexpr int machines_per_lot = 72;

/// Returns the maps of many machines. The bits of a case do not depend on the others.
/// @param x (p x cases) inputs
/// @return (n x cases) mm, NaN where not cut
Eigen::MatrixXd maps(const InfluenceMap& influence, const Eigen::MatrixXd& x);

/// Returns true for a response that counts ordered vertices or comes from the filtered map. It
/// needs the whole map and has no gradient in closed form.
bool is_counted_response(Response response);

/// Returns the responses of many machines, equal to `responses` of their maps. Without alignment
/// and counted responses the maps are not stored: 10 000 vertices, 100 inputs and four passes a
/// vertex cost 8 M multiplications a machine, 0.2 ms on two cores.
/// @return (responses x cases)
Eigen::MatrixXd responses(const Study& study, const PreparedConfiguration& ready,
                          const InfluenceMap& influence, const Eigen::MatrixXd& x);

/// Returns (p x n) the effect of a unit of each input on each vertex, for the pass that makes the
/// surface in the base run; NaN where not cut.
Eigen::MatrixXd effects(const InfluenceMap& influence);

/// Returns the values between which the difference for an input is taken: those at standard normal
/// scores of -1 and +1, which the input may always have.
std::array<double, 2> difference_points(const Study& study, Eigen::Index input);

/// Finds the competing passes of the base run, the effect of every input on them, and the vertices
/// where the model fails. In addition to the terms listed at `cutting::CompetingPass` it neglects:
/// products of two inputs; the change of the cutting force by a geometric input (under compliance,
/// by the ratio of the change of the depth of cut); on a turned part the square of a displacement D
/// along the cut, slope D^2 / 2r, so that vertices nearer to the spindle axis than some D are
/// flagged. A nonlinear input has the mean slope between its values at one standard deviation to
/// either side, and is reported as if it were linear.
/// @throws BadInput naming an input that changes part, program, nominal machine or stock, or a worn
/// or hollow tool, which only the full engine can represent; if none of the checked machines can
/// cut the program; if the base run leaves all of the part uncut or gouged
InfluenceMap influence_map(const Study& study, const PreparedConfiguration& ready,
                           const Progress& progress = {});

/// A response of a configuration as a function of its inputs. Both functions are thread-safe.
struct ResponseFunction {
  /// (p x cases) inputs -> (cases) mm or percent
  std::function<Eigen::VectorXd(const Eigen::MatrixXd& x)> values;
  /// (p x cases) inputs -> (p x cases) per unit of the input; at a kink a one-sided gradient
  std::function<Eigen::MatrixXd(const Eigen::MatrixXd& x)> gradients;
};

/// Returns a response by influence maps. Gradients are exact derivatives of the maps if the scene
/// aligns nothing and the response is not counted, otherwise differences over a hundredth of the
/// spreads. The arguments must outlive the result.
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
