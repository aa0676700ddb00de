#include "render/figures.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace abbe::render {

std::string fixed(double value, int decimals) {
  std::string text = fmt::format("{:.{}f}", std::abs(value), decimals);
  // A value that rounds to zero must not show a minus sign.
  const bool is_zero = text.find_first_not_of("0.") == std::string::npos;
  return value < 0.0 && !is_zero ? "−" + text : text;
}

std::string signed_fixed(double value, int decimals) {
  std::string text = fixed(value, decimals);
  const bool is_zero = text.find_first_not_of("0.") == std::string::npos;
  return value > 0.0 && !is_zero ? "+" + text : text;
}

int significant_decimals(double value) {
  if (value == 0.0 || !std::isfinite(value)) return 0;
  return std::clamp(2 - static_cast<int>(std::floor(std::log10(std::abs(value)))), 0, 6);
}

std::string figure(double value) {
  return std::isfinite(value) ? fixed(value, significant_decimals(value)) : "–";
}

int round_decimals(double value) {
  // By rounding, log10 of a power of ten may be just below the integer.
  return std::max(0, -static_cast<int>(std::floor(std::log10(value) + 1e-9)));
}

double round_up_125(double value) {
  if (!(value > 0.0)) return 0.0;
  const double decade = std::pow(10.0, std::floor(std::log10(value)));
  for (const double step : {1.0, 2.0, 5.0}) {
    // The tolerance of 1e-12 keeps a round number with a rounding error from becoming the next one.
    if (step * decade >= value * (1.0 - 1e-12)) return step * decade;
  }
  return 10.0 * decade;
}

double round_up_range(double value) {
  if (!(value > 0.0)) return 0.0;
  const double decade = std::pow(10.0, std::floor(std::log10(value)));
  for (const double step : {1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0})
    if (step * decade >= value * (1.0 - 1e-12)) return step * decade;
  return 10.0 * decade;
}

Ticks round_ticks(double lower, double upper, int count) {
  Ticks ticks;
  const double span = upper - lower;
  if (!(span > 0.0) || !std::isfinite(span) || count < 1) return ticks;
  // The factor 0.999 avoids the next larger step if the range is a multiple of the step.
  const double step = round_up_125(span / count * 0.999);
  ticks.decimals = round_decimals(step);
  const auto first = static_cast<long long>(std::ceil(lower / step - 1e-9));
  const auto last = static_cast<long long>(std::floor(upper / step + 1e-9));
  for (long long i = first; i <= last; ++i) ticks.values.push_back(static_cast<double>(i) * step);
  return ticks;
}

std::string signed_figure(double value) {
  std::string text = signed_fixed(value, significant_decimals(value));
  if (text.find('.') == std::string::npos) return text;
  // Trailing zeros are removed only behind a decimal point.
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

std::string percent_text(double percent) {
  // A small fraction must not be rounded to none, nor an almost complete one to all.
  if (percent > 0.0 && percent < 0.01) return "< 0.01 %";
  if (percent < 100.0 && percent > 99.99) return "> 99.99 %";
  return fixed(percent, percent == 0.0 || percent == 100.0 ? 0
                        : percent < 10.0 || percent > 99.9 ? 2
                                                           : 1) +
         " %";
}

LengthUnit length_unit(double largest_um) {
  return largest_um < 0.1 ? LengthUnit{"nm", 1000.0} : LengthUnit{};
}

Figures figures(const Eigen::VectorXd& deviation_um, const Eigen::VectorXd& weights) {
  if (deviation_um.size() != weights.size()) {
    throw std::invalid_argument("figures: expected one weight per deviation");
  }
  if (!weights.allFinite() || (weights.size() > 0 && weights.minCoeff() < 0.0)) {
    throw std::invalid_argument("figures: weights must be finite and nonnegative");
  }
  Figures result;
  double total = 0.0;
  double sum = 0.0;
  double squares = 0.0;
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -lowest;
  for (Eigen::Index i = 0; i < deviation_um.size(); ++i) {
    const double deviation = deviation_um[i];
    // Vertices that are uncut or not judged have no deviation.
    if (!std::isfinite(deviation)) continue;
    total += weights[i];
    sum += weights[i] * deviation;
    squares += weights[i] * deviation * deviation;
    lowest = std::min(lowest, deviation);
    highest = std::max(highest, deviation);
  }
  if (highest >= lowest) result.pv_um = highest - lowest;
  if (total > 0.0) {
    result.mean_um = sum / total;
    result.rms_um = std::sqrt(squares / total);
  }
  return result;
}

}  // namespace abbe::render
