#pragma once

#include <vector>

#include "errors/compliance.h"
#include "sim/compensation/control_log.h"
#include "sim/compensation/course.h"

namespace abbe::sim::compensation {

/// What is believed to act on the tool over time, linear between instants, nothing outside.
struct LoadCourse {
  Eigen::VectorXd time_s;           ///< (n) increasing
  std::vector<errors::Load> loads;  ///< (n)
};
errors::Load load_at(const LoadCourse& course, double time_s);

/// Force on the tool as a dynamometer reads it, at the tip.
/// @param smoothing_s  the mean of what was read so long, ending now; 0: none
/// @throws std::invalid_argument naming a column that the log lacks
LoadCourse load_of_dynamometer(const ControlLog& log, double smoothing_s = 0.0);

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
CurrentLaw fitted_law(const ControlLog& log, const CurrentTraining& part, double smoothing_s = 0.0);

/// What the law says of a log. @return one column, mm
Course bending(const CurrentLaw& law, const ControlLog& log);

}  // namespace abbe::sim::compensation
