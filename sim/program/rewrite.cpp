#include "sim/program/rewrite.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <stdexcept>

#include "kinematics/units.h"
#include "sim/program/nc_write.h"
#include "sim/program/pvt.h"

namespace abbe::sim::program {
namespace {

using kinematics::AxisVector;
using kinematics::Motion;

void check(const Path& path, std::span<const std::vector<CorrectedPoint>> corrected) {
  if (corrected.size() != path.blocks.size())
    throw std::invalid_argument("expected one list of corrected points for every block");
  for (std::size_t i = 0; i < corrected.size(); ++i) {
    double last = i == 0 ? -1.0 : 0.0;
    for (const CorrectedPoint& point : corrected[i]) {
      if (!(point.u > last && point.u <= 1.0) || point.at.size() != path.blocks[i].end.size() ||
          !point.at.allFinite())
        throw std::invalid_argument(
            fmt::format("expected increasing u in (0, 1] and finite axes in block {}", i));
      last = point.u;
    }
    if (!corrected[i].empty() && last != 1.0)
      throw std::invalid_argument(
          fmt::format("expected a corrected point at u = 1 in block {}", i));
  }
}

AxisVector chord(const PvtRow& a, const PvtRow& b) {
  return (b.position - a.position) / (b.time_s - a.time_s);
}

/// Rates of a quantity known at instants: of the parabola through each row and its neighbours.
std::vector<AxisVector> rates(const std::vector<PvtRow>& rows) {
  const std::size_t n = rows.size();
  std::vector<AxisVector> rates(n, AxisVector::Zero(rows.front().position.size()));
  for (std::size_t k = 1; k + 1 < n; ++k) {
    const double before = rows[k].time_s - rows[k - 1].time_s,
                 after = rows[k + 1].time_s - rows[k].time_s;
    rates[k] = (chord(rows[k - 1], rows[k]) * after + chord(rows[k], rows[k + 1]) * before) /
               (before + after);
  }
  if (n == 2) rates[0] = rates[1] = chord(rows[0], rows[1]);
  if (n > 2) {
    rates[0] = 2 * chord(rows[0], rows[1]) - rates[1];
    rates[n - 1] = 2 * chord(rows[n - 2], rows[n - 1]) - rates[n - 2];
  }
  return rates;
}

std::string rewritten_pvt(const Path& path, std::span<const std::vector<CorrectedPoint>> corrected,
                          const NcOptions& control) {
  std::vector<PvtRow> nominal, correction;
  const auto add = [&](const Block& block, double u, const AxisVector& at) {
    const double time_s =
        u == 1.0 ? block.end_s : block.start_s + u * (block.end_s - block.start_s);
    nominal.push_back({time_s, position(path, block, u), velocity(path, block, u)});
    correction.push_back({time_s, at - nominal.back().position, {}});
  };
  for (std::size_t i = 0; i < path.blocks.size(); ++i) {
    const Block& block = path.blocks[i];
    const bool start_given = !corrected[i].empty() && corrected[i].front().u == 0.0;
    if (i == 0 && !start_given) add(block, 0.0, block.start);
    for (const CorrectedPoint& point : corrected[i]) add(block, point.u, point.at);
    if (corrected[i].empty()) add(block, 1.0, block.end);
  }
  const std::vector<AxisVector> extra = rates(correction);
  for (std::size_t k = 0; k < nominal.size(); ++k)
    for (Eigen::Index j = 0; j < nominal[k].position.size(); ++j) {
      // A correction of zero must not cost the sign of a zero.
      if (correction[k].position[j] != 0.0) nominal[k].position[j] += correction[k].position[j];
      if (extra[k][j] != 0.0) nominal[k].velocity[j] += extra[k][j];
    }
  std::vector<int> columns(control.axes.size());
  std::iota(columns.begin(), columns.end(), 0);
  return write_pvt(nominal, control.axes, columns);
}

/// NC text of a path, block by block.
class NcRewriter {
 public:
  NcRewriter(const Path& path, const NcOptions& control, const RewriteOptions& options);
  void block(const Block& block, const std::vector<CorrectedPoint>& points);
  std::string text();

 private:
  void coordinates(const Block& block);
  void spindle(const Block& block);
  void dwell(const Block& block);
  AxisVector words(const AxisVector& at) const;

  const NcOptions& control_;
  const RewriteOptions& options_;
  std::vector<NcItem> items_;
  std::optional<Coordinates> mode_;
  double rpm_ = 0.0;
  const int spindle_;
};

NcRewriter::NcRewriter(const Path& path, const NcOptions& control, const RewriteOptions& options)
    : control_(control), options_(options), spindle_(spindle_of(control.axes)) {
  items_.push_back("(corrected program)");
  items_.push_back("G17 G21 G90 G93 G54");
  if (path.blocks.empty()) items_.push_back("G49");
}

void NcRewriter::coordinates(const Block& block) {
  if (mode_ == block.coordinates) return;
  mode_ = block.coordinates;
  if (mode_ == Coordinates::Axis) {
    items_.push_back("G49");
    return;
  }
  if (control_.tool_length.empty())
    throw std::invalid_argument("expected a tool length for G43.4 H");
  items_.push_back(fmt::format("G43.4 H{}", control_.tool_length.begin()->first));
}

void NcRewriter::spindle(const Block& block) {
  if (spindle_ < 0 || !(block.end_s > block.start_s)) return;
  const double rate = (block.end[spindle_] - block.start[spindle_]) / (block.end_s - block.start_s);
  // The angle is a sum of many turns; what its rounding leaves is no change of speed.
  const double rpm = std::round(rate / units::rpm * 1e6) / 1e6;
  if (std::abs(rpm - rpm_) <= 1e-5) return;
  rpm_ = rpm;
  items_.push_back(
      rpm == 0.0 ? "M5" : fmt::format("S{} M{}", nc_number(std::abs(rpm), 6), rpm > 0 ? 3 : 4));
}

void NcRewriter::dwell(const Block& block) {
  if (block.end_s > block.start_s)
    items_.push_back("G4 P" + nc_number(block.end_s - block.start_s));
}

AxisVector NcRewriter::words(const AxisVector& at) const {
  AxisVector words = at;
  const AxisVector& offset = control_.work_offset[0];
  for (Eigen::Index j = 0; j < words.size(); ++j) {
    const bool linear = control_.axes[std::size_t(j)].motion == Motion::Linear;
    const double step = linear ? options_.word_mm : options_.word_rad / units::deg;
    const double value =
        (words[j] - (offset.size() > 0 ? offset[j] : 0.0)) / (linear ? 1.0 : units::deg);
    words[j] = std::round(value / step) * step * (linear ? 1.0 : units::deg);
  }
  return words;
}

void NcRewriter::block(const Block& block, const std::vector<CorrectedPoint>& points) {
  if (block.interpolation == Interpolation::Cubic)
    throw std::invalid_argument("expected a path of cubics only, or of none");
  coordinates(block);
  spindle(block);
  if (block.interpolation == Interpolation::Dwell) return dwell(block);
  const bool rapid = block.interpolation == Interpolation::Rapid;
  const auto move = [&](double from, double to, const AxisVector& at) {
    const double seconds = (to - from) * (block.end_s - block.start_s);
    items_.push_back(NcMove{rapid, words(at), seconds > 0 ? 60.0 / seconds : 0.0});
  };
  double u = 0.0;
  for (const CorrectedPoint& point : points) {
    if (point.u > 0.0) move(u, point.u, point.at);
    u = point.u;
  }
  if (points.empty()) move(0.0, 1.0, block.end);
}

std::string NcRewriter::text() {
  items_.push_back("M2");
  // More digits than the step has, so that the text adds no rounding of its own.
  return write_nc(items_, control_.axes, {.format = {9, 9}, .inverse_time = true});
}

}  // namespace

std::string rewritten(const Path& path, std::span<const std::vector<CorrectedPoint>> corrected,
                      const NcOptions& control, const RewriteOptions& options) {
  check(path, corrected);
  if (!(options.word_mm > 0.0) || !(options.word_rad > 0.0))
    throw std::invalid_argument("expected steps of words above zero");
  const auto is_cubic = [](const Block& block) {
    return block.interpolation == Interpolation::Cubic;
  };
  if (!path.blocks.empty() && std::all_of(path.blocks.begin(), path.blocks.end(), is_cubic))
    return rewritten_pvt(path, corrected, control);
  NcRewriter writer(path, control, options);
  for (std::size_t i = 0; i < path.blocks.size(); ++i) writer.block(path.blocks[i], corrected[i]);
  return writer.text();
}

}  // namespace abbe::sim::program
