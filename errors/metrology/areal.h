#pragma once

#include <optional>

#include <Eigen/Core>

namespace abbe::errors::metrology {

/// From where heights count.
enum class ArealReference { Plane, Mean, None };

struct ArealOptions {
  ArealReference reference = ArealReference::Plane;  ///< least squares, weighted; None: as given
};

/// Height parameters of ISO 25178-2, mm but for the two shapes.
struct Areal {
  double Sa = 0.0;            ///< mean of |z|
  double Sq = 0.0;            ///< root of the mean of z^2
  double Sp = 0.0;            ///< highest peak above the reference
  double Sv = 0.0;            ///< deepest pit below it, positive
  double Sz = 0.0;            ///< Sp + Sv
  std::optional<double> Ssk;  ///< skewness, none where Sq is 0
  std::optional<double> Sku;  ///< kurtosis, 3 of a normal distribution; the same
};

/// Height parameters of scattered points, each standing for an area; means are weighted by it. The
/// plane is that of least squares in z. No filter is applied.
/// @param xy       (n x 2) mm
/// @param z        (n) mm
/// @param weights  (n) >= 0, some > 0
/// @throws std::invalid_argument if sizes differ, for numbers not finite, or where the points do
/// not
///         fix a plane that is wanted
Areal areal(const Eigen::MatrixX2d& xy, const Eigen::VectorXd& z, const Eigen::VectorXd& weights,
            const ArealOptions& options = {});

}  // namespace abbe::errors::metrology
