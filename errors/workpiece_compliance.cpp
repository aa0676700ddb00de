#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "errors/compliance.h"
#include "errors/compliance_field.h"
#include "kinematics/units.h"

namespace abbe::errors {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

void require(bool good, const std::string& expected) {
  if (!good) throw std::invalid_argument("workpiece: expected " + expected);
}

// Conditions are written so that NaN fails them.
void require_positive(double x, const char* what) {
  require(x > 0.0 && std::isfinite(x), fmt::format("{} above 0, seen {}", what, x));
}

void require_unit(const Vector3d& u, const char* what) {
  require(std::abs(u.norm() - 1.0) <= 1e-9, fmt::format("a unit vector for {}", what));
}

void check(const WorkpieceBar& bar) {
  require(bar.clamp_w.allFinite(), "a finite point for the clamp");
  require_unit(bar.direction_w, "the direction of the bar");
  require_positive(bar.length, "a length");
  require_positive(bar.second_moment, "a second moment of area");
  require_positive(bar.youngs_modulus, "a Young's modulus");
}

void check(const WorkpiecePlate& plate) {
  require(plate.foot_w.allFinite(), "a finite point for the foot");
  require_unit(plate.up_w, "the way up of the plate");
  require_unit(plate.normal_w, "the normal of the plate");
  require(std::abs(plate.up_w.dot(plate.normal_w)) <= 1e-9,
          "a normal of the plate square to its way up");
  require_positive(plate.height, "a height");
  require_positive(plate.thickness, "a thickness");
  require_positive(plate.youngs_modulus, "a Young's modulus");
  require(plate.poisson_ratio > -1.0 && plate.poisson_ratio <= 0.5,
          fmt::format("a Poisson ratio above -1 and at most 0.5, seen {}", plate.poisson_ratio));
}

void check(const WorkpieceField& field) {
  const std::size_t n = field.compliance_w.size();
  require(n > 0 && std::size_t(field.points_w.rows()) == n,
          fmt::format("one compliance a node, seen {} for {} nodes", n, field.points_w.rows()));
  for (std::size_t i = 0; i < n; ++i) {
    const std::string fault =
        fault_of_node(field.points_w.row(Eigen::Index(i)).transpose(), field.compliance_w[i]);
    require(fault.empty(), fmt::format("{} at node {}", fault, i + 1));
  }
}

Matrix3d across(const WorkpieceBar& bar, const Vector3d& point_w) {
  const double arm = std::clamp(bar.direction_w.dot(point_w - bar.clamp_w), 0.0, bar.length);
  const double per_force = arm * arm * arm / (3.0 * bar.youngs_modulus * bar.second_moment);
  return per_force * (Matrix3d::Identity() - bar.direction_w * bar.direction_w.transpose());
}

/// Height of a point over the foot, in heights of the plate.
double relative_height(const WorkpiecePlate& plate, const Vector3d& point_w) {
  return std::clamp(plate.up_w.dot(point_w - plate.foot_w) / plate.height, 0.0, 1.0);
}

/// @param ratio  of the compliance to c^2 / D
Matrix3d across(const WorkpiecePlate& plate, double ratio) {
  const double t = plate.thickness, nu = plate.poisson_ratio;
  const double D = plate.youngs_modulus * t * t * t / (12.0 * (1.0 - nu * nu));
  return ratio * plate.height * plate.height / D * plate.normal_w * plate.normal_w.transpose();
}

PlateTable table_of(const WorkpiecePlate& plate) {
  PlateTable table{plate, {}};
  table.ratio[0] = 0.25 / pi;  // near the clamp it is that of half an endless plate
  for (int i = 1; i <= PlateTable::intervals; ++i) {
    const double s = 0.5 * (1.0 - std::cos(pi * i / PlateTable::intervals));
    table.ratio[std::size_t(i)] = cantilever_plate(s, plate.poisson_ratio) / (s * s);
  }
  return table;
}

/// Cubic through four entries. As a function of the angle whose cosine counts the height, the ratio
/// goes on beyond both ends as its mirror image.
double looked_up(const PlateTable& table, double s) {
  constexpr int n = PlateTable::intervals;
  const double at = std::acos(1.0 - 2.0 * s) / pi * n;
  const int i = std::min(int(at), n - 1);
  const auto entry = [&](int k) {
    return table.ratio[std::size_t(k < 0 ? -k : k > n ? 2 * n - k : k)];
  };
  const double u = at - i, a = entry(i - 1), b = entry(i), c = entry(i + 1), d = entry(i + 2);
  const double ratio = b * (1.0 - u * u) * (2.0 - u) / 2.0 + c * u * (1.0 + u) * (2.0 - u) / 2.0 -
                       u * (1.0 - u) * (a * (2.0 - u) + d * (1.0 + u)) / 6.0;
  return ratio * s * s;
}

}  // namespace

std::string fault_of_node(const Vector3d& point_w, const Matrix3d& C) {
  if (!point_w.allFinite()) return "a finite point";
  if (!C.allFinite()) return "a finite compliance";
  const double largest = C.cwiseAbs().maxCoeff();
  const double slack = 1e-6 * largest;
  if ((C - C.transpose()).cwiseAbs().maxCoeff() > slack) return "a symmetric compliance";
  if (largest == 0.0) return {};
  Eigen::SelfAdjointEigenSolver<Matrix3d> solver;
  solver.computeDirect(C / largest, Eigen::EigenvaluesOnly);
  if (!(solver.eigenvalues()[0] >= -1e-6)) return "a compliance without negative eigenvalue";
  return {};
}

void validate(const WorkpieceCompliance& part) {
  std::visit([](const auto& kind) { check(kind); }, part);
}

Matrix3d local_compliance(const WorkpieceCompliance& part, const Vector3d& point_w) {
  if (const auto* bar = std::get_if<WorkpieceBar>(&part)) return across(*bar, point_w);
  if (const auto* plate = std::get_if<WorkpiecePlate>(&part)) {
    return across(*plate, cantilever_plate(relative_height(*plate, point_w), plate->poisson_ratio));
  }
  const auto& field = std::get<WorkpieceField>(part);
  return blended(field, nearest_nodes(field, point_w));
}

PreparedWorkpiece prepare(const WorkpieceCompliance& part) {
  validate(part);
  if (const auto* bar = std::get_if<WorkpieceBar>(&part)) return *bar;
  if (const auto* plate = std::get_if<WorkpiecePlate>(&part)) return table_of(*plate);
  return indexed(std::get<WorkpieceField>(part));
}

Matrix3d local_compliance(const PreparedWorkpiece& part, const Vector3d& point_w) {
  if (const auto* bar = std::get_if<WorkpieceBar>(&part)) return across(*bar, point_w);
  if (const auto* table = std::get_if<PlateTable>(&part)) {
    return across(table->plate, looked_up(*table, relative_height(table->plate, point_w)));
  }
  const auto& index = std::get<FieldIndex>(part);
  return blended(index.field, nearest_nodes(index, point_w));
}

}  // namespace abbe::errors
