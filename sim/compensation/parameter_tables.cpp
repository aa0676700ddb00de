#include "sim/compensation/parameter_tables.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace abbe::sim::compensation {

namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

constexpr double endless = 1e9;  // mm or rad; limit of an axis that has none

[[noreturn]] void refuse(const std::string& why) {
  throw std::invalid_argument("parameter tables: " + why);
}

struct Range {
  double lower = 0.0;
  double upper = 0.0;
};

// Returns true if tables may correct a joint. Without stated ranges an axis without limits has no
// table.
bool is_corrected(const Joint& joint, const TableOptions& options) {
  if (joint.motion == Motion::Spindle) return false;
  return options.range || (joint.min > -endless && joint.max < endless);
}

/// Returns the range of a joint's tables; none if it has no tables.
std::optional<Range> range_of(const Chain& chain, int joint, const TableOptions& options) {
  const Joint& it = chain.joints()[std::size_t(joint)];
  if (!is_corrected(it, options)) return std::nullopt;
  Range range{it.min, it.max};
  if (options.range) {
    range = {(*options.range)(0, joint), (*options.range)(1, joint)};
    if (!std::isfinite(range.lower) || !std::isfinite(range.upper) || range.lower > range.upper)
      refuse(fmt::format("expected a range of {} from a lower to an upper end, seen {} to {}",
                         it.name, range.lower, range.upper));
  }
  // a range without width: the joint is corrected, but no table depends on it
  if (range.lower == range.upper) return std::nullopt;
  return range;
}

/// The correction along one axis alone, relative to that at the reference; a row for each position.
struct Sweep {
  Eigen::MatrixXd upward;    // (n x joints)
  Eigen::MatrixXd downward;  // (n x joints)
};

Sweep swept(const CorrectionAt& correction, const AxisState& reference, int joint,
            const Eigen::VectorXd& positions) {
  const AxisVector here = correction(reference);
  Sweep sweep{Eigen::MatrixXd(positions.size(), here.size()),
              Eigen::MatrixXd(positions.size(), here.size())};
  AxisState state = reference;
  for (Eigen::Index k = 0; k < positions.size(); ++k) {
    state.q[joint] = positions[k];
    state.direction[std::size_t(joint)] = 1;
    sweep.upward.row(k) = (correction(state) - here).transpose();
    state.direction[std::size_t(joint)] = -1;
    sweep.downward.row(k) = (correction(state) - here).transpose();
  }
  return sweep;
}

// Exactly zero: a table of tiny values may still be wanted.
bool is_zero(const AxisTable& table) {
  return (table.upward.array() == 0.0).all() && (table.downward.array() == 0.0).all();
}

}  // namespace

double correction(const AxisTable& table, double position, int direction) {
  const auto& x = table.position;
  const auto at = [direction, &table](Eigen::Index k) {
    // before the first motion the direction is unknown, so the mean is the best guess
    if (direction == 0) return 0.5 * (table.upward[k] + table.downward[k]);
    return direction > 0 ? table.upward[k] : table.downward[k];
  };
  const Eigen::Index last = x.size() - 1;
  // negated, so that a position that is not a number reads the first value
  if (!(position > x[0])) return at(0);
  if (position >= x[last]) return at(last);
  const Eigen::Index k = std::upper_bound(x.data(), x.data() + x.size(), position) - x.data();
  const double t = (position - x[k - 1]) / (x[k] - x[k - 1]);
  return at(k - 1) + t * (at(k) - at(k - 1));
}

AxisVector correction(const ParameterTables& tables, const AxisState& state) {
  AxisVector sum = tables.offset;
  for (const AxisTable& table : tables.tables)
    sum[table.moves] +=
        correction(table, state.q[table.of], state.direction[std::size_t(table.of)]);
  return sum;
}

void validate(const ParameterTables& tables, const Chain& chain) {
  const auto is_movable = [&chain](int joint) {
    return joint >= 0 && joint < chain.size() &&
           chain.joints()[std::size_t(joint)].motion != Motion::Spindle;
  };
  if (tables.offset.size() != chain.size() || !tables.offset.allFinite())
    refuse(fmt::format("expected an offset of {} finite numbers", chain.size()));
  for (const AxisTable& table : tables.tables) {
    if (!is_movable(table.of) || !is_movable(table.moves))
      refuse(fmt::format("expected axes of the machine that move, seen {} over {}", table.moves,
                         table.of));
    const Eigen::Index n = table.position.size();
    if (n < 2 || table.upward.size() != n || table.downward.size() != n)
      refuse("expected at least 2 points with a correction either way");
    if (!table.position.allFinite() || !table.upward.allFinite() || !table.downward.allFinite())
      refuse("expected finite numbers");
    for (Eigen::Index k = 1; k < n; ++k)
      if (!(table.position[k] > table.position[k - 1])) refuse("expected positions that increase");
  }
}

Eigen::VectorXd table_positions(const Chain& chain, int joint, const TableOptions& options) {
  if (options.max_points < 2) refuse("expected at least 2 points a table");
  if (!(options.spacing > 0.0) || !(options.spacing_rad > 0.0))
    refuse("expected a spacing above 0");
  const auto range = range_of(chain, joint, options);
  if (!range) return {};
  const bool is_slide = chain.joints()[std::size_t(joint)].motion == Motion::Linear;
  const double spacing = is_slide ? options.spacing : options.spacing_rad;
  // 1e-12: a range that is a whole number of spacings up to rounding keeps that number.
  const double pieces = std::ceil((range->upper - range->lower) / spacing * (1.0 - 1e-12));
  const double most = double(options.max_points - 1);
  return Eigen::VectorXd::LinSpaced(Eigen::Index(std::clamp(pieces, 1.0, most)) + 1, range->lower,
                                    range->upper);
}

ParameterTables tabulate(const CorrectionAt& correction, const Chain& chain,
                         const AxisVector& reference, const TableOptions& options) {
  if (reference.size() != chain.size())
    refuse(fmt::format("expected a reference of {} axes, seen {}", chain.size(), reference.size()));
  AxisState at_reference;
  at_reference.q = reference;
  ParameterTables tables;
  tables.offset = AxisVector::Zero(chain.size());
  std::vector<int> corrected;
  for (int i = 0; i < chain.size(); ++i)
    if (is_corrected(chain.joints()[std::size_t(i)], options)) corrected.push_back(i);

  const AxisVector here = correction(at_reference);
  if (options.constant)
    // The offset holds the correction at the reference, so that the tables start from zero there.
    for (const int i : corrected) tables.offset[i] = here[i];
  for (const int of : corrected) {
    const Eigen::VectorXd positions = table_positions(chain, of, options);
    if (positions.size() == 0) continue;
    const Sweep sweep = swept(correction, at_reference, of, positions);
    for (const int moves : corrected) {
      if (of != moves && !options.cross) continue;
      AxisTable table{of, moves, positions, sweep.upward.col(moves), sweep.downward.col(moves)};
      if (!options.both_ways)
        table.upward = table.downward = (0.5 * (table.upward + table.downward)).eval();
      if (!is_zero(table)) tables.tables.push_back(std::move(table));
    }
  }
  return tables;
}

}  // namespace abbe::sim::compensation
