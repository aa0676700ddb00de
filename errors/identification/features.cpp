#include "errors/identification/features.h"

#include <cmath>
#include <stdexcept>
#include <utility>

namespace abbe::errors::identification {
namespace {

using Eigen::Index;

/// Calls visit(first row, number of rows) for every run.
template <typename Visit>
void for_every_run(const ThermalData& data, const Visit& visit) {
  const auto n = static_cast<Index>(data.run.size());
  for (Index start = 0, end = 0; start < n; start = end) {
    while (end < n &&
           data.run[static_cast<std::size_t>(end)] == data.run[static_cast<std::size_t>(start)])
      ++end;
    visit(start, end - start);
  }
}

Eigen::MatrixXd lagged(const ThermalData& data, double rows) {
  Eigen::MatrixXd result = data.T;
  const double kept = std::exp(-1.0 / rows);
  for_every_run(data, [&](Index start, Index count) {
    for (Index row = start + 1; row < start + count; ++row)
      result.row(row) = kept * result.row(row - 1) + (1 - kept) * data.T.row(row);
  });
  return result;
}

}  // namespace

ThermalData with_features(const ThermalData& data, const ThermalFeatures& features) {
  if (!(features.lag_rows >= 0) || !std::isfinite(features.lag_rows))
    throw std::invalid_argument("a lag is a number of rows, 0 or more");
  ThermalData result = data;
  if (features.since_start)
    for_every_run(data, [&](Index start, Index count) {
      result.T.middleRows(start, count).rowwise() -= data.T.row(start);
    });
  if (features.lag_rows == 0) return result;
  Eigen::MatrixXd both(result.T.rows(), 2 * result.T.cols());
  both << result.T, lagged(result, features.lag_rows);
  result.T = std::move(both);
  for (const std::string& name : data.names) result.names.push_back(name + " lag");
  return result;
}

ThermalData zeroed(const ThermalData& data) {
  ThermalData result = data;
  for_every_run(data, [&](Index start, Index count) {
    result.y.segment(start, count).array() -= data.y(start);
  });
  return result;
}

}  // namespace abbe::errors::identification
