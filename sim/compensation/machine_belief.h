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

/// Beliefs about a machine from readings: heat, force, a measured part, and their sum with the
/// geometry.
namespace abbe::sim::compensation {

/// The believed load on the tool over time; linear between instants, zero outside.
struct LoadSeries {
  Eigen::VectorXd time_s;           ///< (n) increasing
  std::vector<errors::Load> loads;  ///< (n)
};
/// Returns the load at a time.
errors::Load load_at(const LoadSeries& course, double time_s);

/// Returns the force on the tool that a dynamometer reads, acting at the tip.
/// @param smoothing_s  length of the mean, ending at each row; 0: none
/// @throws std::invalid_argument naming a column that the log lacks
LoadSeries load_of_dynamometer(const ControlLog& log, double smoothing_s = 0.0);

/// The deflection of a machine in a cut from the current of the spindle at one speed (Yang 2012),
/// learned from a part that was cut and measured: d = c1 x + c2 x^2, x the current above that in
/// air.
struct CurrentLaw {
  double air_A = 0.0;
  Eigen::Vector2d c = Eigen::Vector2d::Zero();  ///< mm/A, mm/A^2
  double sigma = 0.0;                           ///< mm, scatter of the part about the law
  double largest_A = 0.0;  ///< largest current above air in the training; beyond it the law is held
  double smoothing_s = 0.0;
};

/// Readings of the training part, a row for each point.
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

/// Returns the deflection that the law gives for a log.
/// @return one column, mm
TimeSeries bending(const CurrentLaw& law, const ControlLog& log);

/// The believed effect of heat on the elements, from the temperatures that a control reads:
/// delta(p, T) = offset(T) + slope(T) p (Yang 2012, thermal part of the composite law).
struct ThermalBelief {
  struct Term {
    errors::ElementName name;
    bool slope = false;  ///< true: multiplied by the travel of the carriage (mm or rad); false: a
                         ///< value
    errors::identification::ThermalModel model;  ///< its inputs are names of sensors
  };
  std::vector<Term> terms;
  bool since_start = true;  ///< temperatures count from the first row of the log
};

/// Converts a belief to the text of a belief file; reading it back gives the same bits.
/// @param comments  lines written above, each after "# "; a line end in one of them becomes a blank
std::string to_text(const ThermalBelief& belief, const std::vector<std::string>& comments = {});
/// Reads the text of a belief file.
/// @throws BadInput with file and line: anything that `to_text` would not write, a term twice, a
///     slope of a location or spindle element, more than 1000 terms
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
  int held = 0;  ///< number of rows with an input outside its trained range, which was limited to
                 ///< it
};

/// Evaluates a thermal belief over a log. A trained range ends where its model refuses: its margin
/// beyond the training.
/// @throws std::invalid_argument naming a sensor that the log lacks, an axis that the chain lacks,
///     an element that does not exist for its axis, or a sensor with a reading that is not finite;
///     also if the log has no rows
ThermalSeries thermal_series(const ThermalBelief& belief, const ControlLog& log,
                             const kinematics::Chain& chain);

/// Returns the thermal part of every joint's deviation at a state, from the last readings at or
/// before it; before the first row, from the first.
/// @return (joints)
std::vector<kinematics::JointDeviation> deviations(const ThermalSeries& course,
                                                   const kinematics::AxisState& state);

// Feedback of the deviation of a cut and measured part to its program

/// Interpolates deviations between the points where they were read: at every point the value of a
/// plane through its eight nearest readings, weighted by (1/d - 1/d9)^2, so that it does not jump
/// where neighbours change. At a reading it equals that reading. Exact for deviations that are
/// linear over the part.
/// @param read_at    (n x 3) mm, n >= 1
/// @param deviation  (n) mm
/// @param points     (m x 3) mm; the result is 0 at points farther than `reach` from any reading
/// @return (m) mm
Eigen::VectorXd interpolate_readings(const Eigen::MatrixX3d& read_at,
                                     const Eigen::VectorXd& deviation,
                                     const Eigen::MatrixX3d& points, double reach);

/// Deviations of a part, with the times at which the nominal program shapes the points.
struct PartDeviations {
  Eigen::MatrixX3d normals;   ///< (n x 3) unit, outward, in the frame in which the tool is moved
  Eigen::VectorXd deviation;  ///< (n) mm along the normal, plus: material left
  Eigen::VectorXd time_s;     ///< (n)
  Eigen::VectorXi pass = {};  ///< (n) number of the tool pass; empty: one pass
};

/// The displacement of the tool that a part shows over time; linear between instants, held outside.
struct DisplacementSeries {
  Eigen::VectorXd time_s;  ///< (m) increasing
  Eigen::MatrixX3d move;   ///< (m x 3) mm
};

/// Options for explaining the deviations of a part.
struct MirrorOptions {
  int together = 8;       ///< number of neighbours in time that are taken together
  double damping = 0.02;  ///< of the least squares; a direction that hardly any normal contains
                          ///< stays unmoved
};
/// Returns the displacement that explains the deviations of neighbours in time: n . move =
/// deviation by damped least squares, one displacement for every few points, at their mean time,
/// extrapolated linearly to the ends of their stretch. A deviation that is linear in time along a
/// stretch is met up to the damping, including the ends. Another pass, or a gap in time of more
/// than ten times the usual interval of points taken together, begins a new stretch.
DisplacementSeries explain_deviation(const PartDeviations& part, const MirrorOptions& options = {});

/// Returns the displacement at a time, mm.
Eigen::Vector3d move_at(const DisplacementSeries& course, double time_s);

/// The complete belief of a compensator about a machine, from readings alone. The sources add
/// element by element (Guo 2016), so one correction serves them all. Immutable.
struct MachineBelief {
  kinematics::Chain chain;          ///< as the control knows it
  std::optional<int> part_spindle;  ///< the workpiece spindle, whose rotation `part` does not
                                    ///< include
  std::optional<errors::GeometricModel> geometric;
  std::optional<ThermalSeries> thermal;
  struct Force {
    errors::ComplianceModel compliance;
    LoadSeries load;
  };
  std::optional<Force> force;
  std::optional<TimeSeries> bending;  ///< one column, mm: deflection of the tool along its own axis
                                      ///< z_t
  std::optional<DisplacementSeries> part;
};

/// Returns the believed pose T_wt of the tool under a given load, instead of the believed load of
/// that time.
kinematics::Pose tool_in_workpiece(const MachineBelief& belief, const kinematics::AxisState& state,
                                   const errors::Load& load);

/// Returns the believed pose of the tool, T_wt.
/// @throws std::out_of_range if the position lies outside a table of the belief
kinematics::Pose tool_in_workpiece(const MachineBelief& belief, const kinematics::AxisState& state);

}  // namespace abbe::sim::compensation
