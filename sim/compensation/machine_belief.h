#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "errors/compliance.h"
#include "errors/element.h"
#include "errors/geometric.h"
#include "errors/identification/thermal_model.h"
#include "kinematics/chain.h"
#include "sim/compensation/correct.h"
#include "sim/compensation/time_series.h"

/// Beliefs about a machine from readings: of heat, of force, from a measured part, and their sum
/// with the geometric belief.
namespace abbe::sim::compensation {

/// The believed load on the tool over time; linear between instants, zero outside their range.
struct LoadSeries {
  Eigen::VectorXd time_s;           ///< (n) increasing
  std::vector<errors::Load> loads;  ///< (n)
};
/// Returns the load at a time, s.
errors::Load load_at(const LoadSeries& series, double time_s);

/// Returns the force on the tool by a dynamometer; it is assumed to act at the tip.
/// @param smoothing_s  duration of the moving mean that ends at each row; 0: no mean
/// @throws std::invalid_argument naming a column that the log lacks
LoadSeries dynamometer_load(const ControlLog& log, double smoothing_s = 0.0);

/// A law for the deflection of a machine in a cut from the spindle current at one speed (Yang
/// 2012), fitted to a part that was cut and measured: d = c1 x + c2 x^2, where x is the current
/// above that in air.
struct CurrentLaw {
  double air_A = 0.0;
  Eigen::Vector2d c = Eigen::Vector2d::Zero();  ///< mm/A, mm/A^2
  double sigma = 0.0;                           ///< mm, scatter of the part about the law
  double max_excess_A = 0.0;  ///< largest x in the training; the law is constant beyond it
  double smoothing_s = 0.0;
};

/// Readings of the training part, with a row for each point.
struct CurrentTraining {
  Eigen::VectorXd time_s;     ///< (n) time at which the point was cut
  Eigen::VectorXd deviation;  ///< (n) mm, material left
};

/// Fits the law of the current.
/// @param log  of the training cut; uses `current_A` and `spindle_rpm`
/// @throws std::invalid_argument if a column is missing, there are no rows in air at the speed of
///     the cut, or the points do not determine two coefficients
CurrentLaw fit_current_law(const ControlLog& log, const CurrentTraining& part,
                           double smoothing_s = 0.0);

/// Evaluates the law for a log.
/// @return one column, mm
TimeSeries current_deflection(const CurrentLaw& law, const ControlLog& log);

/// The believed effect of heat on the error elements, from the temperatures that a control reads:
/// delta(p, T) = offset(T) + slope(T) p (Yang 2012, thermal part of the composite law).
struct ThermalBelief {
  struct Term {
    errors::ElementName name;
    bool slope = false;  ///< true: per travel of the carriage (mm or rad); false: offset
    errors::identification::ThermalModel model;  ///< its inputs are names of sensors
  };
  std::vector<Term> terms;
  bool since_start = true;  ///< temperatures count from the first row of the log
};

/// Converts a belief to the text of a belief file; reading it back gives the same bits.
/// @param comments  lines written at the top, each after "# "; a line end in one becomes a blank
std::string to_text(const ThermalBelief& belief, const std::vector<std::string>& comments = {});
/// Reads the text of a belief file.
/// @throws BadInput with file and line for anything that `to_text` would not write, a term that
/// occurs
///     twice, a slope of a location or spindle element, or more than 1000 terms
ThermalBelief parse_thermal_belief(std::string_view text, const std::string& file);

/// A thermal belief evaluated over a log: the value of each term at each row.
struct ThermalSeries {
  struct Term {
    int joint = 0;
    int component = 0;  ///< 0..5
    bool location = false;
    bool slope = false;
    double sign = 1.0;  ///< of the travel of the carriage relative to the command
  };
  std::vector<Term> terms;  ///< (k)
  Eigen::VectorXd time_s;   ///< (n)
  Eigen::MatrixXd value;    ///< (n x k) mm or rad, or per mm or rad
  int limited_rows = 0;     ///< number of rows with an input that was limited to its trained range
};

/// Evaluates a thermal belief over a log. The trained range of an input includes the margin that
/// its model allows.
/// @throws std::invalid_argument naming a sensor that the log lacks, an axis that the chain lacks,
///     an element that does not exist for its axis, or a sensor with a reading that is not finite;
///     also if the log has no rows
ThermalSeries thermal_series(const ThermalBelief& belief, const ControlLog& log,
                             const kinematics::Chain& chain);

/// Returns the thermal deviation of every joint at a state, by the last readings at or before its
/// time; before the first row, by the first one.
/// @return (joints)
std::vector<kinematics::JointDeviation> deviations(const ThermalSeries& series,
                                                   const kinematics::AxisState& state);

// Feedback of the deviations of a measured part to its program.

/// Interpolates readings of deviations. The value at a point is that of a plane through its eight
/// nearest readings with weights (1/d - 1/d9)^2, so that it does not jump if the neighbours change.
/// At a reading it equals that reading. Exact for deviations that are linear over the part.
/// @param read_at    (n x 3) mm, n >= 1
/// @param deviation  (n) mm
/// @param points     (m x 3) mm; the result is 0 at points farther than `reach` from any reading
/// @return (m) mm
Eigen::VectorXd interpolate_readings(const Eigen::MatrixX3d& reading_points,
                                     const Eigen::VectorXd& deviation,
                                     const Eigen::MatrixX3d& points, double reach);

/// Deviations of points of a part, and the times at which the nominal program shapes them.
struct PartDeviations {
  Eigen::MatrixX3d normals;   ///< (n x 3) unit, outward, in the frame in which the tool is moved
  Eigen::VectorXd deviation;  ///< (n) mm along the normal, plus: material left
  Eigen::VectorXd time_s;     ///< (n)
  Eigen::VectorXi pass = {};  ///< (n) number of the tool pass; empty: a single pass
};

/// The displacement of the tool over time that a part reveals; linear between instants, constant
/// outside.
struct DisplacementSeries {
  Eigen::VectorXd time_s;  ///< (m) increasing
  Eigen::MatrixX3d move;   ///< (m x 3) mm
};

/// Options of `displacement_from_deviations`.
struct DisplacementOptions {
  int group_size = 8;     ///< number of neighbours in time that get one displacement
  double damping = 0.02;  ///< of the least squares: no motion in directions that no normal contains
};
/// Returns the displacement that explains the deviations of neighbours in time: n . move =
/// deviation by damped least squares, with one displacement for every few points, at their mean
/// time. It is extrapolated linearly to the ends of each segment. A deviation that is linear in
/// time along a segment is met up to the damping, including the ends. A new segment begins with
/// another pass, or after a gap of more than ten times the median interval of a group of points.
DisplacementSeries displacement_from_deviations(const PartDeviations& part,
                                                const DisplacementOptions& options = {});

/// Returns the displacement at a time, mm.
Eigen::Vector3d displacement_at(const DisplacementSeries& series, double time_s);

/// The complete belief of a compensator about a machine, from readings alone. Its sources are added
/// element by element (Guo 2016), so one correction includes them all. Immutable.
struct MachineBelief {
  kinematics::Chain chain;          ///< as the control models it
  std::optional<int> part_spindle;  ///< workpiece spindle; `part` is stated for its angle zero
  std::optional<errors::GeometricModel> geometric;
  std::optional<ThermalSeries> thermal;
  struct Force {
    errors::ComplianceModel compliance;
    LoadSeries load;
  };
  std::optional<Force> force;
  std::optional<TimeSeries>
      current_deflection;  ///< one column, mm: deflection of the tool along its axis z_t
  std::optional<DisplacementSeries> part;
};

/// Returns the believed pose T_wt of the tool under a given load, which replaces the believed load.
kinematics::Pose tool_in_workpiece(const MachineBelief& belief, const kinematics::AxisState& state,
                                   const errors::Load& load);

/// Returns the believed pose T_wt of the tool.
/// @throws std::out_of_range if the position lies outside a table of the belief
kinematics::Pose tool_in_workpiece(const MachineBelief& belief, const kinematics::AxisState& state);

}  // namespace abbe::sim::compensation
