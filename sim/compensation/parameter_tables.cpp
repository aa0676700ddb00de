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

constexpr double min_unlimited = 1e9;  // mm or rad; an axis with such a limit has none

[[noreturn]] void throw_table_error(const std::string& reason) {
  throw std::invalid_argument("parameter tables: " + reason);
}

struct TableRange {
  double lower = 0.0;
  double upper = 0.0;
};

/// Returns true if tables may correct a joint. Without stated ranges an axis without limits has no
/// table.
bool is_corrected(const Joint& joint, const TableOptions& options) {
  if (joint.motion == Motion::Spindle) return false;
  return options.range || (joint.min > -min_unlimited && joint.max < min_unlimited);
}

/// Returns the range of the tables over a joint; nothing if it has no tables.
std::optional<TableRange> table_range(const Chain& chain, int joint, const TableOptions& options) {
  const Joint& axis = chain.joints()[std::size_t(joint)];
  if (!is_corrected(axis, options)) return std::nullopt;
  TableRange range{axis.min, axis.max};
  if (options.range) {
    range = {(*options.range)(0, joint), (*options.range)(1, joint)};
    if (!std::isfinite(range.lower) || !std::isfinite(range.upper) || range.lower > range.upper)
      throw_table_error(
          fmt::format("expected a range of {} from a lower to an upper end, seen {} to {}",
                      axis.name, range.lower, range.upper));
  }
  // With a range without width the joint is corrected, but no table depends on it.
  if (range.lower == range.upper) return std::nullopt;
  return range;
}

/// The correction along one axis, relative to that at the reference, with a row for each position.
struct AxisSweep {
  Eigen::MatrixXd upward;    // (n x joints)
  Eigen::MatrixXd downward;  // (n x joints)
};

/// Evaluates the correction along one axis in both directions of motion.
AxisSweep sweep_axis(const CorrectionFunction& correction, const AxisState& reference, int joint,
                     const Eigen::VectorXd& positions) {
  const AxisVector reference_correction = correction(reference);
  AxisSweep sweep{Eigen::MatrixXd(positions.size(), reference_correction.size()),
                  Eigen::MatrixXd(positions.size(), reference_correction.size())};
  AxisState state = reference;
  for (Eigen::Index k = 0; k < positions.size(); ++k) {
    state.q[joint] = positions[k];
    state.direction[std::size_t(joint)] = 1;
    sweep.upward.row(k) = (correction(state) - reference_correction).transpose();
    state.direction[std::size_t(joint)] = -1;
    sweep.downward.row(k) = (correction(state) - reference_correction).transpose();
  }
  return sweep;
}

// The comparison is exact, because a table of tiny values may be intended.
bool is_zero(const AxisTable& table) {
  return (table.upward.array() == 0.0).all() && (table.downward.array() == 0.0).all();
}

}  // namespace

double correction(const AxisTable& table, double position, int direction) {
  const auto& x = table.position;
  const auto value = [direction, &table](Eigen::Index k) {
    // Before the first motion the direction is unknown, so the mean is the best estimate.
    if (direction == 0) return 0.5 * (table.upward[k] + table.downward[k]);
    return direction > 0 ? table.upward[k] : table.downward[k];
  };
  const Eigen::Index last = x.size() - 1;
  // Negated, so that a position that is not a number gives the first value.
  if (!(position > x[0])) return value(0);
  if (position >= x[last]) return value(last);
  const Eigen::Index k = std::upper_bound(x.data(), x.data() + x.size(), position) - x.data();
  const double t = (position - x[k - 1]) / (x[k] - x[k - 1]);
  return value(k - 1) + t * (value(k) - value(k - 1));
}

AxisVector correction(const ParameterTables& tables, const AxisState& state) {
  AxisVector sum = tables.offset;
  for (const AxisTable& table : tables.tables)
    sum[table.corrected_joint] += correction(table, state.q[table.argument_joint],
                                             state.direction[std::size_t(table.argument_joint)]);
  return sum;
}

void validate(const ParameterTables& tables, const Chain& chain) {
  const auto is_movable = [&chain](int joint) {
    return joint >= 0 && joint < chain.size() &&
           chain.joints()[std::size_t(joint)].motion != Motion::Spindle;
  };
  if (tables.offset.size() != chain.size() || !tables.offset.allFinite())
    throw_table_error(fmt::format("expected an offset of {} finite numbers", chain.size()));
  for (const AxisTable& table : tables.tables) {
    if (!is_movable(table.argument_joint) || !is_movable(table.corrected_joint))
      throw_table_error(fmt::format("expected movable axes of the machine, seen {} over {}",
                                    table.corrected_joint, table.argument_joint));
    const Eigen::Index n = table.position.size();
    if (n < 2 || table.upward.size() != n || table.downward.size() != n)
      throw_table_error("expected at least 2 points with a correction for each direction");
    if (!table.position.allFinite() || !table.upward.allFinite() || !table.downward.allFinite())
      throw_table_error("expected finite numbers");
    for (Eigen::Index k = 1; k < n; ++k)
      if (!(table.position[k] > table.position[k - 1]))
        throw_table_error("expected increasing positions");
  }
}

Eigen::VectorXd table_positions(const Chain& chain, int joint, const TableOptions& options) {
  if (options.max_points < 2) throw_table_error("expected at least 2 points per table");
  if (!(options.spacing > 0.0) || !(options.spacing_rad > 0.0))
    throw_table_error("expected a spacing above 0");
  const auto range = table_range(chain, joint, options);
  if (!range) return {};
  const bool is_slide = chain.joints()[std::size_t(joint)].motion == Motion::Linear;
  const double spacing = is_slide ? options.spacing : options.spacing_rad;
  // 1e-12 absorbs the rounding of a range that is a whole number of spacings.
  const double intervals = std::ceil((range->upper - range->lower) / spacing * (1.0 - 1e-12));
  const double max_intervals = double(options.max_points - 1);
  return Eigen::VectorXd::LinSpaced(Eigen::Index(std::clamp(intervals, 1.0, max_intervals)) + 1,
                                    range->lower, range->upper);
}

ParameterTables tabulate(const CorrectionFunction& correction, const Chain& chain,
                         const AxisVector& reference, const TableOptions& options) {
  if (reference.size() != chain.size())
    throw_table_error(
        fmt::format("expected a reference of {} axes, seen {}", chain.size(), reference.size()));
  AxisState reference_state;
  reference_state.q = reference;
  ParameterTables tables;
  tables.offset = AxisVector::Zero(chain.size());
  std::vector<int> corrected_joints;
  for (int i = 0; i < chain.size(); ++i)
    if (is_corrected(chain.joints()[std::size_t(i)], options)) corrected_joints.push_back(i);

  const AxisVector reference_correction = correction(reference_state);
  if (options.constant)
    // The offset takes the correction at the reference, so the tables are zero there.
    for (const int i : corrected_joints) tables.offset[i] = reference_correction[i];
  for (const int argument_joint : corrected_joints) {
    const Eigen::VectorXd positions = table_positions(chain, argument_joint, options);
    if (positions.size() == 0) continue;
    const AxisSweep sweep = sweep_axis(correction, reference_state, argument_joint, positions);
    for (const int corrected_joint : corrected_joints) {
      if (argument_joint != corrected_joint && !options.cross) continue;
      AxisTable table{argument_joint, corrected_joint, positions, sweep.upward.col(corrected_joint),
                      sweep.downward.col(corrected_joint)};
      if (!options.has_direction_columns)
        table.upward = table.downward = (0.5 * (table.upward + table.downward)).eval();
      if (!is_zero(table)) tables.tables.push_back(std::move(table));
    }
  }
  return tables;
}

}  // namespace abbe::sim::compensation
