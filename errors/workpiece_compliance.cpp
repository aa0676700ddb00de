#include "errors/compliance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "kinematics/bad_input.h"
#include "kinematics/table_file.h"
#include "kinematics/units.h"

// The deflection of an endless wall of height c is a Fourier integral along the wall. For each wave
// number k (in units of 1/c) the deflection f over the height y (in units of c) solves (d^2 -
// k^2)^2 f = delta(y - s), clamped at y = 0 and free at y = 1, which determines four coefficients.
// The integral over k of the deflection under the load is the compliance.
namespace abbe::errors {

namespace {

using Eigen::Matrix4d;
using Eigen::Vector4d;

/// A function value and its first three derivatives.
using Jet = std::array<double, 4>;

/// Returns the two solutions that are clamped at the foot: (x cosh x - sinh x) / k^3 and
/// x sinh x / k^2 with x = k y. With these divisors they become the cubic and the parabola of a
/// beam at k = 0.
std::array<Jet, 2> clamped_solutions(double k, double y) {
  const double x = k * y, ch = std::cosh(x), sh = std::sinh(x);
  const double sinhc = x < 1e-3 ? 1.0 + x * x / 6.0 : sh / x;  // sinh x / x
  double cubic_factor = 0.0;                                   // (x cosh x - sinh x) / x^3
  // For small x the difference loses digits by cancellation; nine terms of the series reach 1e-17.
  if (x < 1.0) {
    double power = 1.0, factorial = 6.0;  // x^(2n - 2), (2n + 1)!
    for (int n = 1; n <= 9; ++n) {
      cubic_factor += power * 2.0 * n / factorial;
      power *= x * x;
      factorial *= (2.0 * n + 2.0) * (2.0 * n + 3.0);
    }
  } else {
    cubic_factor = (x * ch - sh) / (x * x * x);
  }
  return {Jet{y * y * y * cubic_factor, y * y * sinhc, y * (sinhc + ch), 2.0 * ch + x * sh},
          Jet{y * y * sinhc, y * (sinhc + ch), 2.0 * ch + x * sh, k * (3.0 * sh + x * ch)}};
}

/// Returns the two solutions without moment and shear at the free end, at a distance t below it.
/// Derivatives are with respect to the height.
std::array<Jet, 2> free_end_solutions(double k, double t, double nu) {
  const double x = k * t, ch = std::cosh(x), sh = std::sinh(x);
  const double sinhc = x < 1e-3 ? 1.0 + x * x / 6.0 : sh / x;
  const double a = -0.5 * (1.0 - nu), b = (1.0 - nu) / (1.0 + nu);
  const double squared_k = k * k;
  return {Jet{ch + a * x * sh, -k * ((1.0 + a) * sh + a * x * ch),
              squared_k * ((1.0 + 2.0 * a) * ch + a * x * sh),
              -squared_k * k * ((1.0 + 3.0 * a) * sh + a * x * ch)},
          Jet{t * (sinhc + b * ch), -((1.0 + b) * ch + b * x * sh),
              k * ((1.0 + 2.0 * b) * sh + b * x * ch),
              -squared_k * ((1.0 + 3.0 * b) * ch + b * x * sh)}};
}

/// Returns the deflection under the load for long waves: solutions from both ends are joined at the
/// load.
double long_wave_deflection(double k, double s, double nu) {
  const auto below = clamped_solutions(k, s);
  const auto above = free_end_solutions(k, 1.0 - s, nu);
  Matrix4d A;
  for (int i = 0; i < 4; ++i)
    A.row(i) << -below[0][std::size_t(i)], -below[1][std::size_t(i)], above[0][std::size_t(i)],
        above[1][std::size_t(i)];
  const Vector4d c = A.partialPivLu().solve(Vector4d(0.0, 0.0, 0.0, 1.0));
  return c[0] * below[0][0] + c[1] * below[1][0];
}

/// Returns k^3 times the deflection under the load for short waves: that of a plate that is endless
/// in both directions plus contributions of foot and free end, which decay away from them. Heights
/// are in units of 1 / k. The hyperbolic functions of `long_wave_deflection` would overflow and
/// cancel here.
double scaled_short_wave_deflection(double k, double s, double nu) {
  const double r0 = k * s, r1 = k - r0, exp_foot = std::exp(-r0), exp_top = std::exp(-r1);
  const double e = std::exp(-k);
  // Conditions: value and slope at the foot, moment and shear at the free end.
  const auto ends = [&](const Jet& at_foot, const Jet& at_top) {
    return Vector4d(at_foot[0], at_foot[1], at_top[2] - nu * at_top[0],
                    at_top[3] - (2.0 - nu) * at_top[1]);
  };
  Matrix4d A;
  // Columns: exp(-y) and y exp(-y), which decay away from the foot, and the same from the free end.
  A.col(0) = ends({1, -1, 1, -1}, {e, -e, e, -e});
  A.col(1) = ends({0, 1, -2, 3}, {k * e, (1 - k) * e, (k - 2) * e, (3 - k) * e});
  A.col(2) = ends({e, e, e, e}, {1, 1, 1, 1});
  A.col(3) = ends({k * e, (k - 1) * e, (k - 2) * e, (k - 3) * e}, {0, -1, -2, -3});
  const Vector4d load_terms =
      0.25 * ends({(1 + r0) * exp_foot, r0 * exp_foot, 0, 0},
                  {(1 + r1) * exp_top, -r1 * exp_top, (r1 - 1) * exp_top, (2 - r1) * exp_top});
  const Vector4d c = A.partialPivLu().solve(-load_terms);
  return 0.25 + (exp_foot * (c[0] + c[1] * r0) + exp_top * (c[2] + c[3] * r1));
}

// `long_wave_deflection` overflows for large k; `scaled_short_wave_deflection` loses digits for
// small k, where it is divided by k^3.
double deflection_under_load(double k, double s, double nu) {
  return k < 3.0 ? long_wave_deflection(k, s, nu)
                 : scaled_short_wave_deflection(k, s, nu) / (k * k * k);
}

/// Returns the integral of `deflection_under_load` over k from a to b, by eight Gauss points.
double gauss(double a, double b, double s, double nu) {
  constexpr std::array<double, 4> x{0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                                    0.9602898564975363};
  constexpr std::array<double, 4> w{0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                    0.1012285362903763};
  const double middle = 0.5 * (a + b), half = 0.5 * (b - a);
  double sum = 0.0;
  for (std::size_t i = 0; i < 4; ++i)
    sum += w[i] * (deflection_under_load(middle - half * x[i], s, nu) +
                   deflection_under_load(middle + half * x[i], s, nu));
  return half * sum;
}

}  // namespace

double cantilever_plate(double s, double nu) {
  if (!(s >= 0.0 && s <= 1.0) || !(nu > -1.0 && nu <= 0.5))
    throw std::invalid_argument(
        fmt::format("cantilever plate: expected a relative height from 0 to 1 and a Poisson ratio "
                    "above -1 and at most 0.5, seen {} and {}",
                    s, nu));
  if (s == 0.0) return 0.0;
  // The integrand is smooth: eight points in each interval, first of 0.25, then growing by a
  // quarter, achieve the stated error of 1e-9.
  double sum = 0.0, k = 0.0;
  for (const double step = 0.25; k < 6.0; k += step) sum += gauss(k, k + step, s, nu);
  // Beyond `short_wave_limit` all waves are short compared with the distances of the load from the
  // foot and the free end (unless it is at the free end). Then f decays as 1/k^3 and its integral
  // to infinity is k f / 2. 4e-6 is the minimum distance from the free end, so that the limit stays
  // finite.
  const double top_distance = s < 1.0 ? std::max(1.0 - s, 4e-6) : 1.0;
  const double short_wave_limit = 40.0 / std::min(s, top_distance);
  for (; k < short_wave_limit; k *= 1.25) sum += gauss(k, 1.25 * k, s, nu);
  sum += 0.5 * k * deflection_under_load(k, s, nu);
  return sum / pi;
}

namespace {

using Eigen::Matrix3d;
using Eigen::RowVector3d;
using Eigen::Vector3d;

constexpr int max_leaf_nodes = 8;  // ranges of up to this many nodes are searched linearly

/// The five nodes nearest to a point, nearest first; at equal distance the one of lower index.
struct NearestNodes {
  struct Node {
    double squared_distance = std::numeric_limits<double>::infinity();  ///< mm^2
    int index = std::numeric_limits<int>::max();  ///< index in the original field
    int row = -1;                                 ///< row of the field; -1: none
  };
  std::array<Node, 5> nodes;
};

/// List of the five nearest of the nodes offered. At equal distance the node of lower index comes
/// first, so that the result does not depend on the order of the search.
class NearestNodeList {
 public:
  void offer(double squared_distance, int index, int row) {
    const auto nearer = [](const NearestNodes::Node& a, const NearestNodes::Node& b) {
      return a.squared_distance < b.squared_distance ||
             (a.squared_distance == b.squared_distance && a.index < b.index);
    };
    const NearestNodes::Node node{squared_distance, index, row};
    auto& nodes = nearest_.nodes;
    if (!nearer(node, nodes.back())) return;
    std::size_t i = nodes.size() - 1;
    for (; i > 0 && nearer(node, nodes[i - 1]); --i) nodes[i] = nodes[i - 1];
    nodes[i] = node;
  }
  double max_squared_distance() const { return nearest_.nodes.back().squared_distance; }
  const NearestNodes& nodes() const { return nearest_; }

 private:
  NearestNodes nearest_;
};

/// Sorts a range of nodes around their median, recursively.
void split_range(FieldTree& tree, std::vector<int>& node_order, const WorkpieceField& field,
                 int begin, int end) {
  if (end - begin <= max_leaf_nodes) return;
  RowVector3d min_point = field.points_w.row(node_order[std::size_t(begin)]), max_point = min_point;
  for (int i = begin; i < end; ++i) {
    min_point = min_point.cwiseMin(field.points_w.row(node_order[std::size_t(i)]));
    max_point = max_point.cwiseMax(field.points_w.row(node_order[std::size_t(i)]));
  }
  int axis = 0;
  // The range is split at the median along its longest side: the tree is balanced, and the
  // recursion is at most log2 n deep.
  (max_point - min_point).maxCoeff(&axis);
  const int middle = begin + (end - begin) / 2;
  std::nth_element(node_order.begin() + begin, node_order.begin() + middle,
                   node_order.begin() + end,
                   [&](int a, int b) { return field.points_w(a, axis) < field.points_w(b, axis); });
  tree.split[std::size_t(middle)] = std::int8_t(axis);
  split_range(tree, node_order, field, begin, middle);
  split_range(tree, node_order, field, middle + 1, end);
}

/// Search for the nodes nearest to a point in the tree of a field.
class TreeSearch {
 public:
  TreeSearch(const FieldTree& tree, const Vector3d& point_w) : tree_(tree), point_w_(point_w) {
    search_range(0, int(tree.node.size()));
  }
  const NearestNodes& nodes() const { return nearest_.nodes(); }

 private:
  void search_range(int begin, int end) {
    if (end - begin <= max_leaf_nodes) {
      for (int i = begin; i < end; ++i) offer(i);
      return;
    }
    const int middle = begin + (end - begin) / 2;
    const int axis = tree_.split[std::size_t(middle)];
    const double offset = point_w_[axis] - tree_.field.points_w(middle, axis);
    offer(middle);
    if (offset < 0.0) {
      search_range(begin, middle);
      // <= because an equally distant node of lower index may be on the other side.
      if (offset * offset <= nearest_.max_squared_distance()) search_range(middle + 1, end);
    } else {
      search_range(middle + 1, end);
      if (offset * offset <= nearest_.max_squared_distance()) search_range(begin, middle);
    }
  }
  void offer(int i) {
    nearest_.offer((tree_.field.points_w.row(i).transpose() - point_w_).squaredNorm(),
                   tree_.node[std::size_t(i)], i);
  }

  const FieldTree& tree_;
  const Vector3d& point_w_;
  NearestNodeList nearest_;
};

/// Returns the field as a balanced tree: the middle node of a range splits it along `split`.
FieldTree build_tree(const WorkpieceField& field) {
  const int node_count = int(field.compliance_w.size());
  FieldTree tree;
  tree.node.resize(std::size_t(node_count));
  std::iota(tree.node.begin(), tree.node.end(), 0);
  tree.split.assign(std::size_t(node_count), 0);
  split_range(tree, tree.node, field, 0, node_count);
  tree.field.points_w.resize(node_count, 3);
  tree.field.compliance_w.reserve(std::size_t(node_count));
  for (int i = 0; i < node_count; ++i) {
    const int node = tree.node[std::size_t(i)];
    tree.field.points_w.row(i) = field.points_w.row(node);
    tree.field.compliance_w.push_back(field.compliance_w[std::size_t(node)]);
  }
  return tree;
}

/// Returns the nodes nearest to a point, by exhaustive search.
NearestNodes nearest_nodes(const WorkpieceField& field, const Vector3d& point_w) {
  NearestNodeList nearest;
  for (int i = 0; i < int(field.points_w.rows()); ++i)
    nearest.offer((field.points_w.row(i).transpose() - point_w).squaredNorm(), i, i);
  return nearest.nodes();
}

/// Returns the same nodes by a search in the tree.
NearestNodes nearest_nodes(const FieldTree& tree, const Vector3d& point_w) {
  return TreeSearch(tree, point_w).nodes();
}

/// Returns the weighted mean of the four nearest nodes, with the weights of `local_compliance`.
Matrix3d interpolated_compliance(const WorkpieceField& field, const NearestNodes& nearest) {
  const auto& nodes = nearest.nodes;
  const auto C = [&](std::size_t i) -> const Matrix3d& {
    return field.compliance_w[std::size_t(nodes[i].row)];
  };
  if (nodes[0].row < 0) return Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
  if (nodes[0].squared_distance == 0.0) return C(0);
  // The weights are scaled by the first distance, so that nothing overflows. A missing fifth node
  // counts as infinitely far.
  const double min_distance = std::sqrt(nodes[0].squared_distance);
  const double relative_cutoff = min_distance / std::sqrt(nodes[4].squared_distance);
  Matrix3d sum = Matrix3d::Zero();
  double weight_sum = 0.0;
  for (std::size_t i = 0; i < 4 && nodes[i].row >= 0; ++i) {
    const double root_weight =
        min_distance / std::sqrt(nodes[i].squared_distance) - relative_cutoff;
    sum += root_weight * root_weight * C(i);
    weight_sum += root_weight * root_weight;
  }
  if (weight_sum > 0.0) return sum / weight_sum;
  sum.setZero();  // all five nodes are equally distant, so all weights are 0
  for (std::size_t i = 0; i < 5; ++i) sum += C(i) / 5.0;
  return sum;
}

}  // namespace

double node_spacing(const WorkpieceField& field) {
  const FieldTree tree = build_tree(field);
  // About 1000 nodes give the median to a few per cent, whatever the size of the field.
  const Eigen::Index n = field.points_w.rows(), stride = std::max<Eigen::Index>(1, n / 1000);
  std::vector<double> squared_distances;
  for (Eigen::Index i = 0; i < n; i += stride)
    squared_distances.push_back(
        nearest_nodes(tree, field.points_w.row(i).transpose()).nodes[1].squared_distance);
  std::nth_element(squared_distances.begin(),
                   squared_distances.begin() + std::ptrdiff_t(squared_distances.size() / 2),
                   squared_distances.end());
  const double median = squared_distances[squared_distances.size() / 2];
  return std::isfinite(median) ? std::sqrt(median) : 0.0;
}

double max_node_distance(
    const WorkpieceField& field,
    const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>& points_w) {
  const FieldTree tree = build_tree(field);
  double max_squared = 0.0;
  for (const auto& point : points_w.rowwise())
    max_squared =
        std::max(max_squared, nearest_nodes(tree, point.transpose()).nodes[0].squared_distance);
  return std::sqrt(max_squared);
}

namespace {

void require_workpiece(bool holds, const std::string& expected) {
  if (!holds) throw std::invalid_argument("workpiece: expected " + expected);
}

// The conditions are written so that NaN fails them.
void require_positive(double x, const char* quantity) {
  require_workpiece(x > 0.0 && std::isfinite(x), fmt::format("{} above 0, seen {}", quantity, x));
}

void require_unit(const Vector3d& u, const char* quantity) {
  require_workpiece(std::abs(u.norm() - 1.0) <= 1e-9,
                    fmt::format("a unit vector for {}", quantity));
}

void check(const WorkpieceBar& bar) {
  require_workpiece(bar.clamp_w.allFinite(), "a finite point for the clamp");
  require_unit(bar.direction_w, "the direction of the bar");
  require_positive(bar.length, "a length");
  require_positive(bar.second_moment, "a second moment of area");
  require_positive(bar.youngs_modulus, "a Young's modulus");
}

void check(const WorkpiecePlate& plate) {
  require_workpiece(plate.foot_w.allFinite(), "a finite point for the foot");
  require_unit(plate.up_w, "the upward direction of the plate");
  require_unit(plate.normal_w, "the normal of the plate");
  require_workpiece(std::abs(plate.up_w.dot(plate.normal_w)) <= 1e-9,
                    "a plate normal perpendicular to its upward direction");
  require_positive(plate.height, "a height");
  require_positive(plate.thickness, "a thickness");
  require_positive(plate.youngs_modulus, "a Young's modulus");
  require_workpiece(
      plate.poisson_ratio > -1.0 && plate.poisson_ratio <= 0.5,
      fmt::format("a Poisson ratio above -1 and at most 0.5, seen {}", plate.poisson_ratio));
}

/// Returns the requirement that a node does not meet, for a message; empty if the node is valid.
std::string unmet_requirement(const Vector3d& point_w, const Matrix3d& C) {
  if (!point_w.allFinite()) return "a finite point";
  if (!C.allFinite()) return "a finite compliance";
  const double largest = C.cwiseAbs().maxCoeff();
  // 1e-6: finite-element solvers iterate to about this; a tighter bound would reject valid fields.
  const double slack = 1e-6 * largest;
  if ((C - C.transpose()).cwiseAbs().maxCoeff() > slack) return "a symmetric compliance";
  if (largest == 0.0) return {};
  Eigen::SelfAdjointEigenSolver<Matrix3d> solver;
  solver.computeDirect(C / largest, Eigen::EigenvaluesOnly);
  if (!(solver.eigenvalues()[0] >= -1e-6)) return "a compliance without negative eigenvalues";
  return {};
}

void check(const WorkpieceField& field) {
  const std::size_t node_count = field.compliance_w.size();
  require_workpiece(node_count > 0 && std::size_t(field.points_w.rows()) == node_count,
                    fmt::format("one compliance per node, seen {} for {} nodes", node_count,
                                field.points_w.rows()));
  for (std::size_t i = 0; i < node_count; ++i) {
    const std::string requirement =
        unmet_requirement(field.points_w.row(Eigen::Index(i)).transpose(), field.compliance_w[i]);
    require_workpiece(requirement.empty(), fmt::format("{} at node {}", requirement, i + 1));
  }
}

/// Returns the compliance of a bar across its direction.
Matrix3d compliance_across(const WorkpieceBar& bar, const Vector3d& point_w) {
  const double arm = std::clamp(bar.direction_w.dot(point_w - bar.clamp_w), 0.0, bar.length);
  const double per_force = arm * arm * arm / (3.0 * bar.youngs_modulus * bar.second_moment);
  return per_force * (Matrix3d::Identity() - bar.direction_w * bar.direction_w.transpose());
}

/// Returns the height of a point above the foot as a fraction of that of the plate, 0 .. 1.
double relative_height(const WorkpiecePlate& plate, const Vector3d& point_w) {
  return std::clamp(plate.up_w.dot(point_w - plate.foot_w) / plate.height, 0.0, 1.0);
}

/// Returns the compliance of a plate.
/// @param ratio  compliance in units of c^2 / D: height squared over flexural rigidity
Matrix3d compliance_across(const WorkpiecePlate& plate, double ratio) {
  const double t = plate.thickness, nu = plate.poisson_ratio;
  const double D = plate.youngs_modulus * t * t * t / (12.0 * (1.0 - nu * nu));
  return ratio * plate.height * plate.height / D * plate.normal_w * plate.normal_w.transpose();
}

/// Returns the compliance ratio of a plate, tabulated over its height.
PlateTable tabulate_plate(const WorkpiecePlate& plate) {
  PlateTable table{plate, {}};
  table.ratio[0] = 0.25 / pi;  // the limit at the foot
  for (int i = 1; i <= PlateTable::intervals; ++i) {
    const double s = 0.5 * (1.0 - std::cos(pi * i / PlateTable::intervals));
    table.ratio[std::size_t(i)] = cantilever_plate(s, plate.poisson_ratio) / (s * s);
  }
  return table;
}

/// Returns the compliance ratio at a relative height s by a cubic through four entries of the
/// table. The entries are equidistant in the angle arccos(1 - 2 s). The ratio is symmetric about
/// both ends of this angle, so the table is mirrored there.
double interpolate_ratio(const PlateTable& table, double s) {
  constexpr int n = PlateTable::intervals;
  const double table_position = std::acos(1.0 - 2.0 * s) / pi * n;
  const int i = std::min(int(table_position), n - 1);
  const auto entry = [&](int k) {
    return table.ratio[std::size_t(k < 0 ? -k : k > n ? 2 * n - k : k)];
  };
  const double u = table_position - i, a = entry(i - 1), b = entry(i), c = entry(i + 1),
               d = entry(i + 2);
  const double ratio = b * (1.0 - u * u) * (2.0 - u) / 2.0 + c * u * (1.0 + u) * (2.0 - u) / 2.0 -
                       u * (1.0 - u) * (a * (2.0 - u) + d * (1.0 + u)) / 6.0;
  return ratio * s * s;
}

}  // namespace

void validate(const WorkpieceCompliance& workpiece) {
  std::visit([](const auto& kind) { check(kind); }, workpiece);
}

Matrix3d local_compliance(const WorkpieceCompliance& workpiece, const Vector3d& point_w) {
  if (const auto* bar = std::get_if<WorkpieceBar>(&workpiece))
    return compliance_across(*bar, point_w);
  if (const auto* plate = std::get_if<WorkpiecePlate>(&workpiece)) {
    return compliance_across(
        *plate, cantilever_plate(relative_height(*plate, point_w), plate->poisson_ratio));
  }
  const auto& field = std::get<WorkpieceField>(workpiece);
  return interpolated_compliance(field, nearest_nodes(field, point_w));
}

PreparedWorkpiece prepare(const WorkpieceCompliance& workpiece) {
  validate(workpiece);
  if (const auto* bar = std::get_if<WorkpieceBar>(&workpiece)) return *bar;
  if (const auto* plate = std::get_if<WorkpiecePlate>(&workpiece)) return tabulate_plate(*plate);
  return build_tree(std::get<WorkpieceField>(workpiece));
}

Matrix3d local_compliance(const PreparedWorkpiece& workpiece, const Vector3d& point_w) {
  if (const auto* bar = std::get_if<WorkpieceBar>(&workpiece))
    return compliance_across(*bar, point_w);
  if (const auto* table = std::get_if<PlateTable>(&workpiece)) {
    return compliance_across(table->plate,
                             interpolate_ratio(*table, relative_height(table->plate, point_w)));
  }
  const auto& tree = std::get<FieldTree>(workpiece);
  return interpolated_compliance(tree.field, nearest_nodes(tree, point_w));
}

WorkpieceField read_compliance_field(std::string_view text, const std::string& file) {
  TableSchema schema{.header = "x_mm,y_mm,z_mm,Cxx_um_per_N,Cyy_um_per_N,Czz_um_per_N",
                     .separators = ";,",
                     .max_bytes = max_field_bytes};
  for (const char* coordinate : {"x_mm", "y_mm", "z_mm"})
    schema.columns.push_back({.names = {{coordinate}}});
  for (const char* entry : {"xx", "yy", "zz", "xy", "yz", "xz"})
    schema.columns.push_back({.names = {{fmt::format("C{}_um_per_N", entry), units::um}},
                              .required = entry[0] == entry[1]});
  const TableFile table = read_table(text, file, schema);
  WorkpieceField field;
  field.points_w.resize(Eigen::Index(table.rows()), 3);
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const auto value = [&](std::size_t column) { return table.value(row, column); };
    field.points_w.row(Eigen::Index(row)) << value(0), value(1), value(2);
    Eigen::Matrix3d C;
    C << value(3), value(6), value(8), value(6), value(4), value(7), value(8), value(7), value(5);
    const std::string requirement = unmet_requirement({value(0), value(1), value(2)}, C);
    if (!requirement.empty())
      throw BadInput(file, table.line[row], 1, requirement, quoted_excerpt(table.row_text(row)));
    field.compliance_w.push_back(C);
  }
  return field;
}

}  // namespace abbe::errors
