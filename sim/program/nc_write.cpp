#include "sim/program/nc_write.h"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "kinematics/units.h"

namespace abbe::sim::program {

std::string nc_number(double value, int decimals) {
  std::string text = fmt::format("{:.{}f}", value, decimals);
  if (text.find('.') != std::string::npos) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
  }
  return text == "-0" ? "0" : text;
}

std::string nc_number(double value) {
  const std::string shortest = fmt::format("{}", value);
  if (shortest.find('e') == std::string::npos) return shortest;
  // 17 significant digits hold the bits of any double, however small.
  int decimals = 17;
  for (double size = std::abs(value); size < 1.0 && size > 0.0; size *= 10) ++decimals;
  return nc_number(value, decimals);
}

std::string nc_significant(double value, int digits) {
  if (value == 0.0) return "0";
  const int before = int(std::floor(std::log10(std::abs(value)))) + 1;
  if (before <= digits) return nc_number(value, digits - before);
  const double step = std::pow(10.0, before - digits);
  return nc_number(std::round(value / step) * step, 0);
}

std::string write_nc(std::span<const NcItem> items, std::span<const ControlledAxis> axes,
                     const NcWriteOptions& options) {
  std::string text;
  std::vector<std::string> in_force(axes.size());
  std::string feed_in_force;
  const auto write = [&](const NcMove& move) {
    text += move.rapid ? "G0" : !move.round ? "G1" : move.round->clockwise ? "G2" : "G3";
    for (std::size_t j = 0; j < axes.size(); ++j) {
      const bool linear = axes[j].motion == kinematics::Motion::Linear;
      if (axes[j].motion == kinematics::Motion::Spindle || axes[j].name == 'S') continue;
      const double value = linear ? move.to[int(j)] : move.to[int(j)] / units::deg;
      std::string word =
          nc_number(value, linear ? options.format.decimals_mm : options.format.decimals_deg);
      if (word == in_force[j]) continue;
      text += fmt::format(" {}{}", axes[j].name, word);
      in_force[j] = std::move(word);
    }
    if (move.round)
      for (std::size_t k = 0; k < 2; ++k)
        text += fmt::format(" {}{}", move.round->letters[k],
                            nc_number(move.round->centre[int(k)], options.format.decimals_mm));
    if (!move.rapid) {
      std::string feed = options.feed_digits > 0 ? nc_significant(move.feed, options.feed_digits)
                                                 : nc_number(move.feed);
      if (options.inverse_time || feed != feed_in_force) text += " F" + feed;
      feed_in_force = std::move(feed);
    }
    text += '\n';
  };
  for (const NcItem& item : items) {
    if (const auto* line = std::get_if<std::string>(&item)) {
      text += *line + '\n';
      in_force.assign(axes.size(), {});
      feed_in_force.clear();
    } else {
      write(std::get<NcMove>(item));
    }
  }
  return text;
}

}  // namespace abbe::sim::program
