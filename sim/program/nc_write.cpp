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

std::string write_nc(std::span<const NcItem> items, std::span<const ControlledAxis> axes,
                     const NcWriteOptions& options) {
  std::string text;
  std::vector<std::string> in_force(axes.size());
  std::string feed_in_force;
  const auto write = [&](const NcMove& move) {
    text += move.rapid ? "G0" : "G1";
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
    if (!move.rapid) {
      std::string feed = nc_number(move.feed);
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
