#pragma once

#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

/// Numbers as a reader wants them: a true minus sign, round ticks, a unit that fits.
namespace abbe::render {

/// "−1.50"; a value that rounds to zero has no sign.
std::string fixed(double value, int decimals);

/// "+1.5", "−1.5", "0.0"
std::string signed_fixed(double value, int decimals);

/// Three significant digits without exponent as far as a picture needs them: "0.0123", "12.3",
/// "1230"; an en dash where the value is not finite.
std::string figure(double value);
int significant_decimals(double value);

/// "12.3 %"; what is not quite nothing or all says so.
std::string percent_text(double percent);

/// The same with a sign and without zeros at its end: a number that somebody gave, "+2.5", "−8".
std::string signed_figure(double value);

/// Decimals that a round number 1, 2 or 5 x 10^k needs.
int round_decimals(double value);

/// Smallest of 1, 2, 5 x 10^k that is at least `value`; 0 for 0.
double round_up_125(double value);

/// Smallest of 1, 1.5, 2, 3, 4, 5, 6, 8 x 10^k that is at least `value`: an end of a scale, all
/// ticks and at most half as long again as its data; 0 for 0.
double round_up_range(double value);

/// Multiples of a 1-2-5 step within [lower, upper], about `wanted` of them.
struct Ticks {
  std::vector<double> values;
  int decimals = 0;
};
Ticks round_ticks(double lower, double upper, int wanted);

/// The unit in which lengths of a picture are stated.
struct LengthUnit {
  const char* name = "µm";
  double per_um = 1.0;
};
/// Nanometres where everything shown is below 0.1 µm.
LengthUnit length_unit(double largest_um);

/// The figures printed with a map; NaN where there are none.
struct Figures {
  double pv_um = std::numeric_limits<double>::quiet_NaN();
  double rms_um = std::numeric_limits<double>::quiet_NaN();   ///< weighted
  double mean_um = std::numeric_limits<double>::quiet_NaN();  ///< weighted
};

/// Figures of the finite deviations (n), weighted by area (n, >= 0); sums run in the order given.
/// @throws std::invalid_argument if sizes differ or a weight is negative or not finite
Figures figures(const Eigen::VectorXd& deviation_um, const Eigen::VectorXd& weights);

}  // namespace abbe::render
