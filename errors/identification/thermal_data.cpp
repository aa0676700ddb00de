#include "errors/identification/thermal_data.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>
#include <utility>

#include "kinematics/bad_input.h"

namespace abbe::errors::identification {

namespace {

using Eigen::Index;

ThermalData select_rows(const ThermalData& data, const std::vector<Index>& rows) {
  ThermalData result{data.names, data.T(rows, Eigen::all), data.y(rows), {}};
  for (const Index row : rows) result.run.push_back(data.run[static_cast<std::size_t>(row)]);
  return result;
}

template <typename Keep>
ThermalData filter_rows(const ThermalData& data, const Keep& keep) {
  std::vector<Index> rows;
  for (Index row = 0; row < data.y.size(); ++row)
    if (keep(data.run[static_cast<std::size_t>(row)])) rows.push_back(row);
  return select_rows(data, rows);
}

}  // namespace

void validate(const ThermalData& data) {
  const auto n = data.y.size(), m = data.T.cols();
  require(n >= 1 && m >= 1, "thermal data need at least one row and one input");
  require(data.T.rows() == n && data.run.size() == static_cast<std::size_t>(n) &&
              data.names.size() == static_cast<std::size_t>(m),
          "the sizes of the thermal data do not match");
  require(data.T.allFinite() && data.y.allFinite(),
          "thermal data contain a number that is not finite");
  require(std::set(data.names.begin(), data.names.end()).size() == data.names.size(),
          "two inputs of the thermal data have the same name");
  std::vector<int> starts = data.run;
  // Equal neighbours collapse, so a label that remains twice belongs to separate rows.
  starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
  require(std::set(starts.begin(), starts.end()).size() == starts.size(),
          "the rows of a run of thermal data are not contiguous");
}

std::vector<int> runs(const ThermalData& data) {
  std::vector<int> labels = data.run;
  labels.erase(std::unique(labels.begin(), labels.end()), labels.end());
  return labels;
}

ThermalData select_runs(const ThermalData& data, const std::vector<int>& labels) {
  return filter_rows(data, [&](int run) { return std::ranges::count(labels, run) > 0; });
}

ThermalData exclude_run(const ThermalData& data, int label) {
  return filter_rows(data, [&](int run) { return run != label; });
}

ThermalData select_inputs(const ThermalData& data, const std::vector<int>& inputs) {
  ThermalData result{{}, data.T(Eigen::all, inputs), data.y, data.run};
  for (const int input : inputs)
    result.names.push_back(data.names.at(static_cast<std::size_t>(input)));
  return result;
}

ThermalData thin_runs(const ThermalData& data, int row_stride) {
  require(row_stride >= 1, "thinning must keep every n-th row with n of at least 1");
  std::vector<Index> rows;
  // Counting restarts with every run, so the first row of each run is kept.
  Index start = 0;
  for (Index row = 0; row < data.y.size(); ++row) {
    if (data.run[static_cast<std::size_t>(row)] != data.run[static_cast<std::size_t>(start)])
      start = row;
    if ((row - start) % row_stride == 0) rows.push_back(row);
  }
  return select_rows(data, rows);
}

Spread spread(const Eigen::VectorXd& values) {
  if (values.size() == 0) return {};
  return {std::sqrt(values.squaredNorm() / static_cast<double>(values.size())),
          values.cwiseAbs().maxCoeff()};
}

namespace {

/// Calls visit(first row, row count) for every run.
template <typename Visit>
void for_each_run(const ThermalData& data, const Visit& visit) {
  const auto n = static_cast<Index>(data.run.size());
  for (Index start = 0, end = 0; start < n; start = end) {
    while (end < n &&
           data.run[static_cast<std::size_t>(end)] == data.run[static_cast<std::size_t>(start)])
      ++end;
    visit(start, end - start);
  }
}

/// Returns the temperatures after a first-order lag; exp(-1 / rows) is its exact decay over one
/// row.
Eigen::MatrixXd lagged_temperatures(const ThermalData& data, double rows) {
  Eigen::MatrixXd result = data.T;
  const double decay = std::exp(-1.0 / rows);
  for_each_run(data, [&](Index start, Index count) {
    for (Index row = start + 1; row < start + count; ++row)
      result.row(row) = decay * result.row(row - 1) + (1 - decay) * data.T.row(row);
  });
  return result;
}

}  // namespace

ThermalData with_features(const ThermalData& data, const ThermalFeatures& features) {
  if (!(features.lag_rows >= 0) || !std::isfinite(features.lag_rows))
    throw std::invalid_argument("a lag must be a number of rows of at least 0");
  ThermalData result = data;
  // The temperature at the start of a run serves as its reference.
  if (features.since_start)
    for_each_run(data, [&](Index start, Index count) {
      result.T.middleRows(start, count).rowwise() -= data.T.row(start);
    });
  if (features.lag_rows == 0) return result;
  Eigen::MatrixXd with_lags(result.T.rows(), 2 * result.T.cols());
  with_lags << result.T, lagged_temperatures(result, features.lag_rows);
  result.T = std::move(with_lags);
  for (const std::string& name : data.names) result.names.push_back(name + " lag");
  return result;
}

}  // namespace abbe::errors::identification
