#include "errors/metrology/part_results.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include <Eigen/Geometry>

#include "errors/metrology/areal.h"
#include "errors/metrology/form.h"
#include "errors/metrology/observable.h"
#include "errors/metrology/shares.h"
#include "kinematics/singular_values.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;
using Eigen::MatrixX2d;
using Eigen::MatrixX3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double one_point = 1e-6;  // mm: points of a design closer than this are one

MatrixX3d machined(const PartReadings& r) {
  return r.points_w + (r.normals_w.array().colwise() * r.deviation.array()).matrix();
}

TestResult flatness_result(const PartReadings& r, const VectorXd& share) {
  const MatrixX3d points = machined(r);
  const MinimumZonePlanes zone = minimum_zone_planes(points);
  return {"flatness",
          "ISO 12781-1:2011",
          {{"points", "", points.rows()},
           figure("flatness_lsq", least_squares_plane(points, share).flatness),
           figure("flatness_minimum_zone", zone.flatness),
           {"minimum_zone_proven", "", zone.proven}}};
}

/// The direction that no normal has a part of, where the normals have every other: of a cylinder or
/// a ring its axis.
std::optional<Vector3d> axis_of(const PartReadings& r) {
  const Principal normals = principal(r.normals_w);
  const Vector3d size = normals.size / normals.size[0];
  if (size[2] > 1e-9 || size[1] < 0.1) return std::nullopt;
  Vector3d axis = normals.axes.col(2);
  Index largest = 0;
  axis.cwiseAbs().maxCoeff(&largest);
  return axis[largest] < 0.0 ? Vector3d(-axis) : axis;
}

/// Rows of the points at each height along an axis, from the lowest.
std::vector<std::vector<Index>> heights_of(const MatrixX3d& points, const Vector3d& axis) {
  const VectorXd height = points * axis;
  std::vector<Index> order(static_cast<std::size_t>(height.size()));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return height[a] < height[b]; });
  std::vector<std::vector<Index>> rings;
  for (const Index i : order) {
    if (rings.empty() || height[i] - height[rings.back().front()] > one_point) rings.emplace_back();
    rings.back().push_back(i);
  }
  return rings;
}

/// Angles of points about a centre.
VectorXd angles_about(const MatrixX2d& points, const Eigen::Vector2d& centre) {
  VectorXd angle(points.rows());
  for (Index i = 0; i < angle.size(); ++i)
    angle[i] = std::atan2(points(i, 1) - centre.y(), points(i, 0) - centre.x());
  return angle;
}

/// Circularity of the points at one height; nothing where the design is no circle there or the
/// points do not go round it.
std::optional<TestResult> circularity_result(const PartReadings& r, const std::vector<Index>& rows,
                                             const Vector3d& axis) {
  const Eigen::Matrix<double, 3, 2> plane = across(axis);
  const MatrixX2d design = r.points_w(rows, Eigen::all) * plane;
  const Eigen::Vector2d middle = design.colwise().mean();
  if (!goes_round(angles_about(design, middle))) return std::nullopt;  // nor on a line
  const LeastSquaresCircle nominal = least_squares_circle(design);
  const VectorXd angle = angles_about(design, nominal.centre);
  if (nominal.circularity > one_point || !goes_round(angle)) return std::nullopt;
  const MatrixX2d points = machined(r)(rows, Eigen::all) * plane;
  const auto circle = least_squares_circle(points, arc_shares(angle));
  const auto zone = minimum_zone_circles(points);
  const double height = r.points_w.row(rows.front()).dot(axis);
  const Vector3d centre = plane * circle.centre + height * axis;
  return TestResult{"circularity",
                    "ISO 12181-1:2011",
                    {{"points", "", Index(rows.size())},
                     {"centre", "mm", centre},
                     {"radius", "mm", circle.radius},
                     figure("circularity_lsq", circle.circularity),
                     figure("circularity_minimum_zone", zone.circularity),
                     {"minimum_zone_proven", "", zone.proven}}};
}

Figure shape(const char* name, const std::optional<double>& value) {
  Figure figure{name, "", {}};
  if (value) figure.value = *value;
  return figure;
}

// Heights of a part that is no plane are counted from their mean, along the design's normals.
TestResult heights_result(const PartReadings& r, const VectorXd& share, bool flat) {
  ArealOptions options;
  options.reference = flat ? ArealReference::Plane : ArealReference::Mean;
  const Areal heights =
      areal(r.points_w * across(Vector3d(r.normals_w.row(0))), r.deviation, share, options);
  return {"heights",
          "ISO 25178-2:2021 height parameters, unfiltered",
          {{"reference", "", flat ? "least-squares plane" : "mean, along the design's normals"},
           {"points", "", r.deviation.size()},
           figure("Sa", heights.Sa),
           figure("Sq", heights.Sq),
           figure("Sz", heights.Sz),
           figure("Sp", heights.Sp),
           figure("Sv", heights.Sv),
           shape("Ssk", heights.Ssk),
           shape("Sku", heights.Sku),
           figure("mean", share.dot(r.deviation) / share.sum()),
           figure("pv", r.deviation.maxCoeff() - r.deviation.minCoeff())}};
}

}  // namespace

std::vector<TestResult> results_of(const PartReadings& r) {
  const VectorXd share = place_shares(r.points_w, one_point);
  const bool flat = (r.normals_w * r.normals_w.row(0).transpose()).minCoeff() > 1.0 - 1e-12;
  std::vector<TestResult> results;
  if (flat) results.push_back(flatness_result(r, share));
  if (const auto axis = axis_of(r))
    for (const std::vector<Index>& rows : heights_of(r.points_w, *axis))
      if (auto ring = circularity_result(r, rows, *axis)) results.push_back(std::move(*ring));
  results.push_back(heights_result(r, share, flat));
  return results;
}

}  // namespace abbe::errors::metrology
