#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "errors/element.h"
#include "errors/identification/thermal_model.h"
#include "kinematics/chain.h"
#include "sim/compensation/control_log.h"

namespace abbe::sim::compensation {

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
ThermalBelief thermal_belief_of_text(std::string_view text, const std::string& file);

/// A thermal belief over the readings of a day: what each term says at each row.
struct ThermalCourse {
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
ThermalCourse course_of(const ThermalBelief& belief, const ControlLog& log,
                        const kinematics::Chain& chain);

/// Thermal part of every joint's deviation at a state, by the readings held since they were taken;
/// before the first row, by the first. @return (joints)
std::vector<kinematics::JointDeviation> deviations(const ThermalCourse& course,
                                                   const kinematics::AxisState& state);

}  // namespace abbe::sim::compensation
