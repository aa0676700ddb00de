#pragma once

#include <Eigen/Core>

/// Grey relational degrees: how alike two short series run. Deng's grades every instant against the
/// worst of all series, Liu's compare the areas that the series leave from their start.
namespace abbe::errors::identification {

enum class GreyKind {
  Deng,           ///< mean over k of (min + rho max) / (|x0(k) - xi(k)| + rho max)
  Absolute,       ///< Liu, areas of x - x(1)
  Relative,       ///< Liu, the same of x / x(1)
  Comprehensive,  ///< theta absolute + (1 - theta) relative
};
/// What Deng's degree makes of a series first. Liu's degrees take the series as they are.
enum class Image {
  None,      ///< as it is
  Initial,   ///< x / x(1): depends on deg C or K, impossible where a series starts at 0
  Mean,      ///< x / mean, impossible where the mean is 0
  Interval,  ///< (x - min) / (max - min), impossible for a series that stands still
};
struct GreyOptions {
  GreyKind kind = GreyKind::Deng;
  Image image = Image::Initial;
  double rho = 0.5;    ///< of Deng, in (0, 1]
  double theta = 0.5;  ///< of the comprehensive degree, in [0, 1]
};
enum class GreyStatus { Ok, StartsAtZero, MeanIsZero, StandsStill };

struct GreyDegrees {
  GreyStatus status = GreyStatus::Ok;
  int series = -1;  ///< column that has no image, where the status is not Ok; -1: the reference
  Eigen::VectorXd degree;  ///< (m), in (0, 1]; empty unless Ok
};
struct MutualDegrees {
  GreyStatus status = GreyStatus::Ok;
  int series = -1;
  Eigen::MatrixXd degree;  ///< (m x m), symmetric with ones on the diagonal; empty unless Ok
};

/// Degree of every series with the reference. Deng's min and max run over all series and instants;
/// where every series equals the reference, every degree is 1.
/// @param reference  (n), n >= 2
/// @param series     (n x m), m >= 1
/// @throws std::invalid_argument for other shapes, a number that is not finite, options out of
/// range Source: Deng's relational grade as in chen2013; Liu's three degrees.
[[nodiscard]] GreyDegrees grey_degrees(const Eigen::VectorXd& reference,
                                       const Eigen::MatrixXd& series,
                                       const GreyOptions& options = {});

/// Degree of every series with every other. Deng's min and max run over all pairs, a series with
/// itself among them (so min = 0), which makes the matrix symmetric.
[[nodiscard]] MutualDegrees mutual_degrees(const Eigen::MatrixXd& series,
                                           const GreyOptions& options = {});

const char* to_string(GreyStatus status);

}  // namespace abbe::errors::identification
