#pragma once

#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

/// Formats numbers for readers: with a true minus sign, round ticks and a suitable unit.
namespace abbe::render {

/// Returns e.g. "−1.50"; a value that rounds to zero has no sign.
std::string fixed(double value, int decimals);

/// Returns e.g. "+1.5", "−1.5", "0.0".
std::string signed_fixed(double value, int decimals);

/// Returns three significant digits without exponent: "0.0123", "12.3", "1230"; an en dash for a
/// value that is not finite.
std::string figure(double value);
/// Returns the decimals that three significant digits need, at most six.
int significant_decimals(double value);

/// Returns e.g. "12.3 %". Values close to 0 or 100 % are not rounded to 0 or 100 %.
std::string percent_text(double percent);

/// Returns a number with sign and without trailing zeros: "+2.5", "−8".
std::string signed_figure(double value);

/// Returns the number of decimals of a round number 1, 2 or 5 x 10^k.
int round_decimals(double value);

/// Returns the smallest of 1, 2, 5 x 10^k that is at least `value`; 0 for 0.
double round_up_125(double value);

/// Returns the smallest of 1, 1.5, 2, 3, 4, 5, 6, 8 x 10^k that is at least `value`; 0 for 0. As
/// the end of a scale it exceeds the data by at most a half.
double round_up_range(double value);

struct Ticks {
  std::vector<double> values;
  int decimals = 0;  ///< of the labels
};
/// Returns about `count` multiples of a 1-2-5 step within [lower, upper].
Ticks round_ticks(double lower, double upper, int count);

/// Unit of the deviations in a picture.
struct LengthUnit {
  const char* name = "µm";
  double per_um = 1.0;
};
/// Returns nanometres if everything shown is below 0.1 µm, else micrometres.
LengthUnit length_unit(double largest_um);

/// Figures printed with a map; NaN without values.
struct Figures {
  double pv_um = std::numeric_limits<double>::quiet_NaN();
  double rms_um = std::numeric_limits<double>::quiet_NaN();   ///< weighted
  double mean_um = std::numeric_limits<double>::quiet_NaN();  ///< weighted
};

/// Returns the figures of the finite deviations (n), weighted by area (n, >= 0). Sums are formed in
/// the order of the arguments.
/// @throws std::invalid_argument if sizes differ or a weight is negative or not finite
Figures figures(const Eigen::VectorXd& deviation_um, const Eigen::VectorXd& weights);

}  // namespace abbe::render
