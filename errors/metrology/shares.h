#pragma once

#include <Eigen/Core>

/// How much of a path each of its readings stands for, so that a place that is read again does not
/// count twice.
namespace abbe::errors::metrology {

/// What each reading along a circle stands for: half the way to its neighbours on either side, by
/// whichever turn they were read. Readings at one place (to 1e-9 rad) share what it stands for. At
/// the two ends of an arc a reading reaches as far outwards as inwards, so evenly spaced readings
/// of an arc count alike, and so do those of a circle with its end point read again or not.
/// @param angle  (n) rad, in any order and of any turn
/// @return (n) rad, > 0
Eigen::VectorXd arc_shares(const Eigen::VectorXd& angle);

/// Whether readings go all the way round: the widest gap between neighbouring places is narrower
/// than 5 degrees or than 1.5 times the median gap. Fewer than 3 places never do.
bool goes_round(const Eigen::VectorXd& angle);

/// 1 over the number of rows at the same place, itself among them, so that every place counts once.
/// @param places     (n x k) coordinates; of an angle its cosine and its sine
/// @param tolerance  rows that differ by less in every coordinate are at one place
/// @return (n) in (0, 1]
Eigen::VectorXd place_shares(const Eigen::MatrixXd& places, double tolerance);

}  // namespace abbe::errors::metrology
