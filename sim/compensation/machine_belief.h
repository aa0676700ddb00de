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

namespace abbe::sim::compensation {

/// What is believed to act on the tool over time, linear between instants, nothing outside.
struct LoadSeries {
  Eigen::VectorXd time_s;           ///< (n) increasing
  std::vector<errors::Load> loads;  ///< (n)
};
errors::Load load_at(const LoadSeries& course, double time_s);

/// Force on the tool as a dynamometer reads it, at the tip.
/// @param smoothing_s  the mean of what was read so long, ending now; 0: none
/// @throws std::invalid_argument naming a column that the log lacks
LoadSeries load_of_dynamometer(const ControlLog& log, double smoothing_s = 0.0);

/// How far a cut bends the machine by the current of the spindle at one speed (Yang 2012): learnt
/// from a part that was cut and measured, d = c1 x + c2 x^2, x the current above that in air.
struct CurrentLaw {
  double air_A = 0.0;
  Eigen::Vector2d c = Eigen::Vector2d::Zero();  ///< mm/A, mm/A^2
  double sigma = 0.0;                           ///< mm, scatter of the part about the law
  double largest_A = 0.0;  ///< above air, that was trained; the law is held beyond
  double smoothing_s = 0.0;
};

/// What was read of the training part, one row a place.
struct CurrentTraining {
  Eigen::VectorXd time_s;     ///< (n) when the place was cut
  Eigen::VectorXd deviation;  ///< (n) mm, material left
};

/// @param log  of the training cut; `current_A`, `spindle_rpm`
/// @throws std::invalid_argument without those columns, without rows in air at the speed of the
///         cut, or where the places do not determine two coefficients
CurrentLaw fit_current_law(const ControlLog& log, const CurrentTraining& part,
                           double smoothing_s = 0.0);

/// What the law says of a log. @return one column, mm
TimeSeries bending(const CurrentLaw& law, const ControlLog& log);

/// What heat is believed to add to the elements, by the temperatures that a control reads:
/// delta(p, T) = offset(T) + slope(T) p (Yang 2012, the thermal part of the composite law).
struct ThermalBelief {
  struct Term {
    errors::ElementName name;
    bool slope = false;  ///< times the carriage's own travel (mm or rad), else a value
    errors::identification::ThermalModel model;  ///< inputs are names of sensors
  };
  std::vector<Term> terms;
  bool since_start = true;  ///< temperatures count from the first row of the log
};

/// Text of a belief file and back, the same bits.
/// @param comments  lines written above, each after "# "; a line end in one of them becomes a blank
std::string to_text(const ThermalBelief& belief, const std::vector<std::string>& comments = {});
/// @throws BadInput with file and line: anything that `to_text` would not write, a term twice, a
///         slope of a location or spindle element, more than 1000 terms
ThermalBelief parse_thermal_belief(std::string_view text, const std::string& file);

/// A thermal belief over the readings of a day: what each term says at each row.
struct ThermalSeries {
  struct Term {
    int joint = 0;
    int component = 0;  ///< 0..5
    bool location = false;
    bool slope = false;
    double sign = 1.0;  ///< of the carriage's travel against the command
  };
  std::vector<Term> terms;  ///< (k)
  Eigen::VectorXd time_s;   ///< (n)
  Eigen::MatrixXd value;    ///< (n x k) mm or rad, or per mm or rad
  int held = 0;             ///< rows at which an input was outside its trained range and was held
                            ///< at the end of it
};

/// A trained range ends where its model refuses: its margin beyond what was seen in training.
/// @throws std::invalid_argument naming a sensor that the log lacks, an axis that the chain lacks,
///         an element that means nothing for its axis or a sensor with a reading that is not
///         finite; for a log without rows
ThermalSeries thermal_series(const ThermalBelief& belief, const ControlLog& log,
                             const kinematics::Chain& chain);

/// Thermal part of every joint's deviation at a state, by the readings held since they were taken;
/// before the first row, by the first. @return (joints)
std::vector<kinematics::JointDeviation> deviations(const ThermalSeries& course,
                                                   const kinematics::AxisState& state);

// The deviation of a part that was cut and measured, fed back to the program that cut it.

/// Deviations between the places where they were read: at every point that of a plane through its
/// eight nearest readings, weighted by (1/d - 1/d9)^2, so that it does not jump where neighbours
/// change; a reading's own place has its own value. Exact for what is linear over the part.
/// @param read_at    (n x 3) mm, n >= 1 @param deviation (n) mm
/// @param points     (m x 3) mm, farther than `reach` from any reading: none, 0
/// @return (m) mm
Eigen::VectorXd interpolate_readings(const Eigen::MatrixX3d& read_at,
                                     const Eigen::VectorXd& deviation,
                                     const Eigen::MatrixX3d& points, double reach);

/// What is known of a part: deviations at places, and when the nominal program shapes each.
struct PartDeviations {
  Eigen::MatrixX3d normals;   ///< (n x 3) unit, outward, in the frame in which the tool is moved
  Eigen::VectorXd deviation;  ///< (n) mm along the normal, plus: material left
  Eigen::VectorXd time_s;     ///< (n)
  Eigen::VectorXi pass = {};  ///< (n) number of the tool's pass, or empty: one
};

/// Displacement of the tool that a part shows, over time, linear between instants, held outside.
struct DisplacementSeries {
  Eigen::VectorXd time_s;  ///< (m) increasing
  Eigen::MatrixX3d move;   ///< (m x 3) mm
};

struct MirrorOptions {
  int together = 8;       ///< neighbours in time that are taken together
  double damping = 0.02;  ///< of the least squares, so that a direction that hardly any normal sees
                          ///< stays unmoved
};
/// Displacement that explains the deviations of neighbours in time: n . move = deviation by damped
/// least squares, one for every few points, at their mean time, and carried on straight to the ends
/// of their stretch. What is linear in time along a stretch is met to the damping, ends included.
/// Another pass, or a gap in time of more than ten times what is usual for points taken together,
/// begins a stretch.
DisplacementSeries explain_deviation(const PartDeviations& part, const MirrorOptions& options = {});

Eigen::Vector3d move_at(const DisplacementSeries& course, double time_s);

/// All that a compensator believes of a machine, from readings alone: the sources add element by
/// element (Guo 2016), one correction serves them all. Immutable.
struct MachineBelief {
  kinematics::Chain chain;          ///< as the control knows it
  std::optional<int> part_spindle;  ///< the workpiece spindle, whose turning `part` leaves out
  std::optional<errors::GeometricModel> geometric;
  std::optional<ThermalSeries> thermal;
  struct Force {
    errors::ComplianceModel compliance;
    LoadSeries load;
  };
  std::optional<Force> force;
  std::optional<TimeSeries> bending;  ///< one column, mm: the tool gives way along its own axis z_t
  std::optional<DisplacementSeries> part;
};

/// The same under a load, instead of that which the belief has of the instant.
kinematics::Pose tool_in_workpiece(const MachineBelief& belief, const kinematics::AxisState& state,
                                   const errors::Load& load);

/// Where the tool is believed to be, T_wt. @throws std::out_of_range where a table of the belief is
/// left
kinematics::Pose tool_in_workpiece(const MachineBelief& belief, const kinematics::AxisState& state);

}  // namespace abbe::sim::compensation
