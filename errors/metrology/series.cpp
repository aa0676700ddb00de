#include "errors/metrology/series.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

namespace abbe::errors::metrology {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

/// Targets by their position along a path, from the lowest.
struct Targets {
  VectorXd position;         ///< (m)
  std::map<int, Index> row;  ///< by number of the target
};

Targets targets_of(const Series& series, const VectorXd& along) {
  std::map<int, double> position;
  for (std::size_t i = 0; i < series.looks.size(); ++i)
    position.emplace(series.look(i).target, along[Index(i)]);
  std::vector<std::pair<double, int>> order;
  for (const auto& [target, at] : position) order.emplace_back(at, target);
  std::sort(order.begin(), order.end());
  Targets targets;
  targets.position.resize(Index(order.size()));
  for (std::size_t i = 0; i < order.size(); ++i) {
    targets.position[Index(i)] = order[i].first;
    targets.row[order[i].second] = Index(i);
  }
  return targets;
}

}  // namespace

std::string Series::name() const {
  return optics().channels.size() > 1 ? optics().name + ", " + sensor().name : optics().name;
}

Bodies nominal_at(const Series& series, std::size_t i) {
  return nominal_bodies(series.readings.nominal, series.look(i).state.q);
}

VectorXd deviations(const Series& series) {
  VectorXd result(Index(series.looks.size()));
  for (std::size_t i = 0; i < series.looks.size(); ++i) {
    const Bodies nominal = nominal_at(series, i);
    result[Index(i)] = series.readings.value[Index(series.looks[i])] -
                       reading(series.optics(), series.channel, {}, nominal, nominal,
                               spindle_angle(series.readings.nominal, series.look(i).state));
  }
  return result;
}

Eigen::Vector3d place_w(const Series& series, const kinematics::AxisVector& q) {
  const Bodies nominal = nominal_bodies(series.readings.nominal, q);
  return nominal.T_bw.inverse() * (nominal.T_bt * series.sensor().point_of);
}

std::vector<int> moving_joints(const Series& series) {
  std::vector<int> moving;
  for (Index j = 0; j < series.look(0).state.q.size(); ++j)
    for (std::size_t i = 1; i < series.looks.size(); ++i)
      if (std::abs(series.look(i).state.q[j] - series.look(0).state.q[j]) > 1e-9) {
        moving.push_back(int(j));
        break;
      }
  return moving;
}

std::optional<PositionRuns> runs_of(const Series& series, const VectorXd& along,
                                    const std::vector<bool>& from_below) {
  const Targets targets = targets_of(series, along);
  const Index m = targets.position.size();
  if (m < 2) return std::nullopt;
  const VectorXd value = deviations(series);
  std::map<std::pair<bool, int>, VectorXd> columns;
  std::map<std::pair<bool, int>, std::set<Index>> filled;
  for (std::size_t i = 0; i < series.looks.size(); ++i) {
    const std::pair key{bool(from_below[i]), series.look(i).run};
    VectorXd& column = columns.try_emplace(key, VectorXd::Zero(m)).first->second;
    const Index row = targets.row.at(series.look(i).target);
    if (!filled[key].insert(row).second) return std::nullopt;
    column[row] = value[Index(i)];
  }
  PositionRuns runs;
  runs.target = targets.position;
  for (const auto& [key, column] : columns) {
    if (Index(filled[key].size()) != m) return std::nullopt;
    Eigen::MatrixXd& side = key.first ? runs.up : runs.down;
    side.conservativeResize(m, side.cols() + 1);
    side.rightCols(1) = column;
  }
  for (Index i = 1; i < m; ++i)
    if (!(runs.target[i] > runs.target[i - 1])) return std::nullopt;
  return runs;
}

}  // namespace abbe::errors::metrology
