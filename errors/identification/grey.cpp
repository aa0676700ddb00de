#include "errors/identification/grey.h"

#include <cmath>
#include <stdexcept>

#include "kinematics/require.h"

namespace abbe::errors::identification {
namespace {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void validate_series(const MatrixXd& series, const GreyOptions& options) {
  require(series.rows() >= 2, "a grey degree needs two instants or more");
  require(series.cols() >= 1, "a grey degree needs a series");
  require(series.allFinite(), "a grey degree needs finite numbers");
  require(options.rho > 0 && options.rho <= 1, "rho of a grey degree lies in (0, 1]");
  require(options.theta >= 0 && options.theta <= 1, "theta of a grey degree lies in [0, 1]");
}

struct Images {
  GreyStatus status = GreyStatus::Ok;
  int series = -1;
  MatrixXd image;
};

/// Every column divided, or shifted and divided, as the image says.
Images images(const MatrixXd& series, Image image) {
  Images result;
  result.image = series;
  for (int i = 0; i < series.cols() && result.status == GreyStatus::Ok; ++i) {
    auto x = result.image.col(i);
    double divisor = 1.0;
    if (image == Image::Initial) {
      divisor = x(0);
      if (divisor == 0) result.status = GreyStatus::StartsAtZero;
    } else if (image == Image::Mean) {
      divisor = x.mean();
      if (divisor == 0) result.status = GreyStatus::MeanIsZero;
    } else if (image == Image::Interval) {
      divisor = x.maxCoeff() - x.minCoeff();
      if (divisor == 0) result.status = GreyStatus::StandsStill;
      x.array() -= x.minCoeff();
    }
    if (result.status == GreyStatus::Ok)
      x /= divisor;
    else
      result.series = i;
  }
  return result;
}

/// |s| of each column: the area from the column's own start.
VectorXd areas(const MatrixXd& series) {
  const auto n = series.rows();
  const MatrixXd from_start = series.rowwise() - series.row(0);
  return (from_start.middleRows(1, n - 2).colwise().sum() + 0.5 * from_start.row(n - 1))
      .transpose();
}

double liu(double s0, double si) {
  const double sum = 1.0 + std::abs(s0) + std::abs(si);
  return sum / (sum + std::abs(si - s0));
}

/// Liu's degree of every pair of areas.
MatrixXd liu_matrix(const VectorXd& s) {
  return MatrixXd::NullaryExpr(s.size(), s.size(), [&](auto i, auto j) { return liu(s(i), s(j)); });
}

double mean_grade(const ArrayXd& difference, double least, double most, double rho) {
  if (most == 0) return 1.0;
  return ((least + rho * most) / (difference + rho * most)).mean();
}

/// Liu's degrees of all pairs, by the kind asked for.
MutualDegrees liu_degrees(const MatrixXd& series, const GreyOptions& options) {
  MutualDegrees result;
  const bool absolute = options.kind != GreyKind::Relative;
  const bool relative = options.kind != GreyKind::Absolute;
  const double theta = !relative ? 1.0 : !absolute ? 0.0 : options.theta;
  result.degree.setZero(series.cols(), series.cols());
  if (absolute) result.degree += theta * liu_matrix(areas(series));
  if (relative) {
    const Images initial = images(series, Image::Initial);
    if (initial.status != GreyStatus::Ok) return {initial.status, initial.series, {}};
    result.degree += (1 - theta) * liu_matrix(areas(initial.image));
  }
  return result;
}

}  // namespace

GreyDegrees grey_degrees(const VectorXd& reference, const MatrixXd& series,
                         const GreyOptions& options) {
  require(reference.size() == series.rows(),
          "reference and series of a grey degree differ in length");
  const auto m = series.cols();
  MatrixXd all(series.rows(), m + 1);
  all << reference, series;
  validate_series(all, options);
  require(m >= 1, "a grey degree needs a series");
  if (options.kind != GreyKind::Deng) {
    const MutualDegrees mutual = liu_degrees(all, options);
    if (mutual.status != GreyStatus::Ok) return {mutual.status, mutual.series - 1, {}};
    return {GreyStatus::Ok, -1, mutual.degree.col(0).tail(m)};
  }
  const Images made = images(all, options.image);
  if (made.status != GreyStatus::Ok) return {made.status, made.series - 1, {}};
  const MatrixXd difference = (made.image.rightCols(m).colwise() - made.image.col(0)).cwiseAbs();
  const double least = difference.minCoeff(), most = difference.maxCoeff();
  GreyDegrees result{GreyStatus::Ok, -1, VectorXd(m)};
  for (int i = 0; i < m; ++i)
    result.degree(i) = mean_grade(difference.col(i).array(), least, most, options.rho);
  return result;
}

MutualDegrees mutual_degrees(const MatrixXd& series, const GreyOptions& options) {
  validate_series(series, options);
  if (options.kind != GreyKind::Deng) return liu_degrees(series, options);
  const Images made = images(series, options.image);
  if (made.status != GreyStatus::Ok) return {made.status, made.series, {}};
  const auto m = series.cols();
  double most = 0;
  for (int i = 0; i < m; ++i)
    most = std::max(most, (made.image.colwise() - made.image.col(i)).cwiseAbs().maxCoeff());
  MutualDegrees result{GreyStatus::Ok, -1, MatrixXd::Identity(m, m)};
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < i; ++j) {
      const ArrayXd difference = (made.image.col(i) - made.image.col(j)).cwiseAbs().array();
      result.degree(i, j) = result.degree(j, i) = mean_grade(difference, 0, most, options.rho);
    }
  return result;
}

const char* to_string(GreyStatus status) {
  switch (status) {
    case GreyStatus::Ok:
      return "ok";
    case GreyStatus::StartsAtZero:
      return "a series that starts at zero has no initial image";
    case GreyStatus::MeanIsZero:
      return "a series of mean zero has no mean image";
    case GreyStatus::StandsStill:
      return "a series that stands still has no interval image";
  }
  return "";
}

}  // namespace abbe::errors::identification
