#include "errors/workpiece_compliance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "errors/compliance.h"
#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

// The deflection of an endless wall of height c is a Fourier integral along it. For each wave
// number k (in units of 1/c) the deflection f over the height y (in units of c) solves (d^2 -
// k^2)^2 f = delta(y - s), clamped at y = 0 and free at y = 1, which leaves four coefficients. Its
// value under the load, integrated over k, is the compliance.
namespace abbe::errors {

namespace {

using Eigen::Matrix4d;
using Eigen::Vector4d;

/// A function value and its first three derivatives.
using Jet = std::array<double, 4>;

/// Returns the two solutions that are clamped at the foot: (x cosh x - sinh x) / k^3 and
/// x sinh x / k^2 with x = k y. With these divisors they become the cubic and the parabola of a
/// beam at k = 0.
std::array<Jet, 2> clamped(double k, double y) {
  const double x = k * y, ch = std::cosh(x), sh = std::sinh(x);
  const double sinhc = x < 1e-3 ? 1.0 + x * x / 6.0 : sh / x;  // sinh x / x
  double odd = 0.0;                                            // (x cosh x - sinh x) / x^3
  // For small x the difference loses digits by cancellation; nine terms of the series reach 1e-17.
  if (x < 1.0) {
    double power = 1.0, factorial = 6.0;  // x^(2n - 2), (2n + 1)!
    for (int n = 1; n <= 9; ++n) {
      odd += power * 2.0 * n / factorial;
      power *= x * x;
      factorial *= (2.0 * n + 2.0) * (2.0 * n + 3.0);
    }
  } else {
    odd = (x * ch - sh) / (x * x * x);
  }
  return {Jet{y * y * y * odd, y * y * sinhc, y * (sinhc + ch), 2.0 * ch + x * sh},
          Jet{y * y * sinhc, y * (sinhc + ch), 2.0 * ch + x * sh, k * (3.0 * sh + x * ch)}};
}

/// Returns the two solutions without moment and shear at the free end, at a distance t below it.
/// Derivatives are with respect to the height.
std::array<Jet, 2> free_end(double k, double t, double nu) {
  const double x = k * t, ch = std::cosh(x), sh = std::sinh(x);
  const double sinhc = x < 1e-3 ? 1.0 + x * x / 6.0 : sh / x;
  const double a = -0.5 * (1.0 - nu), b = (1.0 - nu) / (1.0 + nu);
  const double k2 = k * k;
  return {
      Jet{ch + a * x * sh, -k * ((1.0 + a) * sh + a * x * ch),
          k2 * ((1.0 + 2.0 * a) * ch + a * x * sh), -k2 * k * ((1.0 + 3.0 * a) * sh + a * x * ch)},
      Jet{t * (sinhc + b * ch), -((1.0 + b) * ch + b * x * sh),
          k * ((1.0 + 2.0 * b) * sh + b * x * ch), -k2 * ((1.0 + 3.0 * b) * ch + b * x * sh)}};
}

/// Returns the deflection under the load for long waves: solutions from both ends are joined at the
/// load.
double long_wave(double k, double s, double nu) {
  const auto below = clamped(k, s);
  const auto above = free_end(k, 1.0 - s, nu);
  Matrix4d A;
  for (int i = 0; i < 4; ++i)
    A.row(i) << -below[0][std::size_t(i)], -below[1][std::size_t(i)], above[0][std::size_t(i)],
        above[1][std::size_t(i)];
  const Vector4d c = A.partialPivLu().solve(Vector4d(0.0, 0.0, 0.0, 1.0));
  return c[0] * below[0][0] + c[1] * below[1][0];
}

/// Returns k^3 times the deflection under the load for short waves: that of a plate that is endless
/// in both directions plus contributions of foot and free end, which decay away from them. Heights
/// are in units of 1 / k. The hyperbolic functions of `long_wave` would overflow and cancel here.
double short_wave(double k, double s, double nu) {
  const double r0 = k * s, r1 = k - r0, e0 = 0.25 * std::exp(-r0), e1 = 0.25 * std::exp(-r1);
  const double e = std::exp(-k);
  // Conditions: value and slope at the foot, moment and shear at the free end.
  const auto ends = [&](const Jet& at_foot, const Jet& at_top) {
    return Vector4d(at_foot[0], at_foot[1], at_top[2] - nu * at_top[0],
                    at_top[3] - (2.0 - nu) * at_top[1]);
  };
  Matrix4d A;
  A.col(0) = ends({1, -1, 1, -1}, {e, -e, e, -e});
  A.col(1) = ends({0, 1, -2, 3}, {k * e, (1 - k) * e, (k - 2) * e, (3 - k) * e});
  A.col(2) = ends({e, e, e, e}, {1, 1, 1, 1});
  A.col(3) = ends({k * e, (k - 1) * e, (k - 2) * e, (k - 3) * e}, {0, -1, -2, -3});
  const Vector4d loaded =
      ends({(1 + r0) * e0, r0 * e0, 0, 0}, {(1 + r1) * e1, -r1 * e1, (r1 - 1) * e1, (2 - r1) * e1});
  const Vector4d c = A.partialPivLu().solve(-loaded);
  return 0.25 + 4.0 * (e0 * (c[0] + c[1] * r0) + e1 * (c[2] + c[3] * r1));
}

// `long_wave` overflows for large k; `short_wave` loses digits for small k, where it is divided by
// k^3.
double under_load(double k, double s, double nu) {
  return k < 3.0 ? long_wave(k, s, nu) : short_wave(k, s, nu) / (k * k * k);
}

/// Returns the integral of `under_load` over k from a to b, by eight Gauss points.
double gauss(double a, double b, double s, double nu) {
  constexpr std::array<double, 4> x{0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                                    0.9602898564975363};
  constexpr std::array<double, 4> w{0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                    0.1012285362903763};
  const double middle = 0.5 * (a + b), half = 0.5 * (b - a);
  double sum = 0.0;
  for (std::size_t i = 0; i < 4; ++i)
    sum +=
        w[i] * (under_load(middle - half * x[i], s, nu) + under_load(middle + half * x[i], s, nu));
  return half * sum;
}

}  // namespace

double cantilever_plate(double s, double nu) {
  if (!(s >= 0.0 && s <= 1.0) || !(nu > -1.0 && nu <= 0.5))
    throw std::invalid_argument(fmt::format(
        "cantilever plate: expected a height 0 .. 1 and a Poisson ratio above -1 and at most 0.5, "
        "seen {} and {}",
        s, nu));
  if (s == 0.0) return 0.0;
  // The integrand is smooth: eight points in each interval, first of 0.25, then growing by a
  // quarter, achieve the stated error of 1e-9.
  double sum = 0.0, k = 0.0;
  for (const double step = 0.25; k < 6.0; k += step) sum += gauss(k, k + step, s, nu);
  // Beyond `far` all waves are short compared with the distances of the load from foot and free end
  // (unless it is at the free end). Then f decays as 1/k^3 and its integral to infinity is k f / 2.
  // 4e-6: a smaller distance from the free end counts as this, so that `far` is finite.
  const double above = s < 1.0 ? std::max(1.0 - s, 4e-6) : 1.0;
  const double far = 40.0 / std::min(s, above);
  for (; k < far; k *= 1.25) sum += gauss(k, 1.25 * k, s, nu);
  sum += 0.5 * k * under_load(k, s, nu);
  return sum / pi;
}

namespace {

using Eigen::Matrix3d;
using Eigen::RowVector3d;
using Eigen::Vector3d;

constexpr int leaf = 8;  // ranges of up to this many nodes are searched linearly

/// The five nearest nodes found so far. At equal distance the node of lower index comes first, so
/// that the result does not depend on the order of the search.
class Best {
 public:
  void offer(double squared, int number, int place) {
    const auto nearer = [](const NearestNodes::Node& a, const NearestNodes::Node& b) {
      return a.squared < b.squared || (a.squared == b.squared && a.number < b.number);
    };
    const NearestNodes::Node node{squared, number, place};
    auto& nodes = found_.nodes;
    if (!nearer(node, nodes.back())) return;
    std::size_t i = nodes.size() - 1;
    for (; i > 0 && nearer(node, nodes[i - 1]); --i) nodes[i] = nodes[i - 1];
    nodes[i] = node;
  }
  double worst() const { return found_.nodes.back().squared; }
  const NearestNodes& found() const { return found_; }

 private:
  NearestNodes found_;
};

void build(IndexedField& index, std::vector<int>& order, const WorkpieceField& field, int from,
           int to) {
  if (to - from <= leaf) return;
  RowVector3d least = field.points_w.row(order[std::size_t(from)]), most = least;
  for (int i = from; i < to; ++i) {
    least = least.cwiseMin(field.points_w.row(order[std::size_t(i)]));
    most = most.cwiseMax(field.points_w.row(order[std::size_t(i)]));
  }
  int axis = 0;
  // Split at the median along the longest side: the tree is balanced, and the recursion is at most
  // log2 n deep.
  (most - least).maxCoeff(&axis);
  const int middle = from + (to - from) / 2;
  std::nth_element(order.begin() + from, order.begin() + middle, order.begin() + to,
                   [&](int a, int b) { return field.points_w(a, axis) < field.points_w(b, axis); });
  index.split[std::size_t(middle)] = std::int8_t(axis);
  build(index, order, field, from, middle);
  build(index, order, field, middle + 1, to);
}

class Search {
 public:
  Search(const IndexedField& index, const Vector3d& point_w) : index_(index), point_w_(point_w) {
    look(0, int(index.node.size()));
  }
  const NearestNodes& found() const { return best_.found(); }

 private:
  void look(int from, int to) {
    if (to - from <= leaf) {
      for (int i = from; i < to; ++i) offer(i);
      return;
    }
    const int middle = from + (to - from) / 2;
    const int axis = index_.split[std::size_t(middle)];
    const double beyond = point_w_[axis] - index_.field.points_w(middle, axis);
    offer(middle);
    if (beyond < 0.0) {
      look(from, middle);
      // <= because an equally distant node of lower index may be on the other side.
      if (beyond * beyond <= best_.worst()) look(middle + 1, to);
    } else {
      look(middle + 1, to);
      if (beyond * beyond <= best_.worst()) look(from, middle);
    }
  }
  void offer(int i) {
    best_.offer((index_.field.points_w.row(i).transpose() - point_w_).squaredNorm(),
                index_.node[std::size_t(i)], i);
  }

  const IndexedField& index_;
  const Vector3d& point_w_;
  Best best_;
};

}  // namespace

IndexedField indexed(const WorkpieceField& field) {
  const int n = int(field.compliance_w.size());
  IndexedField index;
  index.node.resize(std::size_t(n));
  std::iota(index.node.begin(), index.node.end(), 0);
  index.split.assign(std::size_t(n), 0);
  build(index, index.node, field, 0, n);
  index.field.points_w.resize(n, 3);
  index.field.compliance_w.reserve(std::size_t(n));
  for (int i = 0; i < n; ++i) {
    const int node = index.node[std::size_t(i)];
    index.field.points_w.row(i) = field.points_w.row(node);
    index.field.compliance_w.push_back(field.compliance_w[std::size_t(node)]);
  }
  return index;
}

NearestNodes nearest_nodes(const WorkpieceField& field, const Vector3d& point_w) {
  Best best;
  for (int i = 0; i < int(field.points_w.rows()); ++i)
    best.offer((field.points_w.row(i).transpose() - point_w).squaredNorm(), i, i);
  return best.found();
}

NearestNodes nearest_nodes(const IndexedField& index, const Vector3d& point_w) {
  return Search(index, point_w).found();
}

Matrix3d interpolated_compliance(const WorkpieceField& field, const NearestNodes& nearest) {
  const auto& nodes = nearest.nodes;
  const auto C = [&](std::size_t i) -> const Matrix3d& {
    return field.compliance_w[std::size_t(nodes[i].place)];
  };
  if (nodes[0].place < 0) return Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
  if (nodes[0].squared == 0.0) return C(0);
  // The weights are scaled by the first distance, so that nothing overflows. A missing fifth node
  // counts as infinitely far.
  const double first = std::sqrt(nodes[0].squared);
  const double last = first / std::sqrt(nodes[4].squared);
  Matrix3d sum = Matrix3d::Zero();
  double weights = 0.0;
  for (std::size_t i = 0; i < 4 && nodes[i].place >= 0; ++i) {
    const double near = first / std::sqrt(nodes[i].squared) - last;
    sum += near * near * C(i);
    weights += near * near;
  }
  if (weights > 0.0) return sum / weights;
  sum.setZero();  // all five nodes are equally far, so all weights are 0
  for (std::size_t i = 0; i < 5; ++i) sum += C(i) / 5.0;
  return sum;
}

double node_spacing(const WorkpieceField& field) {
  const IndexedField index = indexed(field);
  // About 1000 nodes give the median to a few per cent, whatever the size of the field.
  const Eigen::Index n = field.points_w.rows(), every = std::max<Eigen::Index>(1, n / 1000);
  std::vector<double> squared;
  for (Eigen::Index i = 0; i < n; i += every)
    squared.push_back(nearest_nodes(index, field.points_w.row(i).transpose()).nodes[1].squared);
  std::nth_element(squared.begin(), squared.begin() + std::ptrdiff_t(squared.size() / 2),
                   squared.end());
  const double middle = squared[squared.size() / 2];
  return std::isfinite(middle) ? std::sqrt(middle) : 0.0;
}

double coverage(const WorkpieceField& field,
                const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>& points_w) {
  const IndexedField index = indexed(field);
  double most = 0.0;
  for (const auto& point : points_w.rowwise())
    most = std::max(most, nearest_nodes(index, point.transpose()).nodes[0].squared);
  return std::sqrt(most);
}

namespace {

void require(bool good, const std::string& expected) {
  if (!good) throw std::invalid_argument("workpiece: expected " + expected);
}

// The conditions are written so that NaN fails them.
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
        node_error(field.points_w.row(Eigen::Index(i)).transpose(), field.compliance_w[i]);
    require(fault.empty(), fmt::format("{} at node {}", fault, i + 1));
  }
}

Matrix3d across(const WorkpieceBar& bar, const Vector3d& point_w) {
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
Matrix3d across(const WorkpiecePlate& plate, double ratio) {
  const double t = plate.thickness, nu = plate.poisson_ratio;
  const double D = plate.youngs_modulus * t * t * t / (12.0 * (1.0 - nu * nu));
  return ratio * plate.height * plate.height / D * plate.normal_w * plate.normal_w.transpose();
}

PlateTable table_of(const WorkpiecePlate& plate) {
  PlateTable table{plate, {}};
  table.ratio[0] = 0.25 / pi;  // the limit at the foot
  for (int i = 1; i <= PlateTable::intervals; ++i) {
    const double s = 0.5 * (1.0 - std::cos(pi * i / PlateTable::intervals));
    table.ratio[std::size_t(i)] = cantilever_plate(s, plate.poisson_ratio) / (s * s);
  }
  return table;
}

/// Returns the compliance ratio at a relative height s by a cubic through four entries of the
/// table. The entries are equidistant in the angle arccos(1 - 2 s), over which the ratio is even
/// about both ends, so the table is mirrored there.
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

std::string node_error(const Vector3d& point_w, const Matrix3d& C) {
  if (!point_w.allFinite()) return "a finite point";
  if (!C.allFinite()) return "a finite compliance";
  const double largest = C.cwiseAbs().maxCoeff();
  // 1e-6: finite-element solvers iterate to about this; a tighter bound would reject valid fields.
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
  return interpolated_compliance(field, nearest_nodes(field, point_w));
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
  const auto& index = std::get<IndexedField>(part);
  return interpolated_compliance(index.field, nearest_nodes(index, point_w));
}

namespace {

constexpr std::string_view expected_header =
    "x_mm,y_mm,z_mm,Cxx_um_per_N,Cyy_um_per_N,Czz_um_per_N";

/// A column of the file: a coordinate or an entry of the compliance.
struct Column {
  std::string_view name;
  int row = 0;
  int entry = -1;  ///< column in the compliance; -1: coordinate number `row`
  bool required = true;
};
constexpr std::array columns{Column{"x_mm", 0},
                             Column{"y_mm", 1},
                             Column{"z_mm", 2},
                             Column{"Cxx_um_per_N", 0, 0},
                             Column{"Cyy_um_per_N", 1, 1},
                             Column{"Czz_um_per_N", 2, 2},
                             Column{"Cxy_um_per_N", 0, 1, false},
                             Column{"Cyz_um_per_N", 1, 2, false},
                             Column{"Cxz_um_per_N", 0, 2, false}};

/// Reads the file line by line and adds the line number to input errors.
class Reader {
 public:
  Reader(std::string_view text, const std::string& file) : lines_(text), file_(file) {
    check_encoding(text, file);
  }

  [[noreturn]] void refuse(int column, const std::string& expected, const std::string& seen) const {
    throw BadInput(file_, lines_.number(), column, expected, seen);
  }

  /// Advances to the next line with content; returns false at the end.
  bool next() {
    while (const auto line = lines_.next()) {
      line_ = *line;
      const std::size_t start = line_.find_first_not_of(" \t");
      if (start != std::string_view::npos && line_[start] != '#') return true;
    }
    return false;
  }

  std::string_view line() const { return line_; }
  std::vector<Cell> cells(char separator) const {
    return cells_of(line_, separator, columns.size());
  }

 private:
  Lines lines_;
  std::string_view line_;
  const std::string& file_;
};

std::vector<const Column*> read_head(const Reader& reader, char separator) {
  std::vector<const Column*> head;
  for (const Cell& cell : reader.cells(separator)) {
    const auto found = std::find_if(columns.begin(), columns.end(),
                                    [&](const Column& c) { return c.name == cell.text; });
    if (found == columns.end())
      reader.refuse(cell.column, fmt::format("a column of a head such as {}", expected_header),
                    in_quotes(cell.text));
    if (std::find(head.begin(), head.end(), &*found) != head.end())
      reader.refuse(cell.column, "every column once", in_quotes(cell.text));
    head.push_back(&*found);
  }
  for (const Column& column : columns) {
    if (column.required && std::find(head.begin(), head.end(), &column) == head.end())
      reader.refuse(int(reader.line().size()) + 1, fmt::format("a column {}", column.name), "none");
  }
  return head;
}

double number(const Reader& reader, const Cell& cell) {
  const std::optional<double> x = number_of(cell.text);
  if (!x) reader.refuse(cell.column, "a number within +-1e9", in_quotes(cell.text));
  return *x;
}

struct NodeRow {
  Eigen::Vector3d point_w = Eigen::Vector3d::Zero();
  Eigen::Matrix3d C = Eigen::Matrix3d::Zero();
};

NodeRow read_row(const Reader& reader, const std::vector<const Column*>& head, char separator) {
  const std::vector<Cell> cells = reader.cells(separator);
  const std::string wanted = fmt::format("{} cells, as the head has", head.size());
  if (cells.size() < head.size())
    reader.refuse(int(reader.line().size()) + 1, wanted, fmt::format("{}", cells.size()));
  if (cells.size() > head.size()) reader.refuse(cells[head.size()].column, wanted, "more");
  NodeRow node;
  for (std::size_t i = 0; i < head.size(); ++i) {
    const Column& column = *head[i];
    const double x = number(reader, cells[i]);
    if (column.entry < 0) {
      node.point_w[column.row] = x;
    } else {
      node.C(column.row, column.entry) = x * units::um;
      node.C(column.entry, column.row) = x * units::um;
    }
  }
  const std::string fault = node_error(node.point_w, node.C);
  if (!fault.empty()) reader.refuse(1, fault, in_quotes(reader.line()));
  return node;
}

}  // namespace

WorkpieceField read_compliance_field(std::string_view text, const std::string& file) {
  Reader reader(text, file);
  if (text.size() > max_field_bytes)
    reader.refuse(0, "at most 64 MiB", fmt::format("{} bytes", text.size()));
  if (!reader.next())
    reader.refuse(0, fmt::format("a head such as {}", expected_header), "nothing");
  const char separator = reader.line().find(';') != std::string_view::npos ? ';' : ',';
  const std::vector<const Column*> head = read_head(reader, separator);
  std::vector<double> points;
  WorkpieceField field;
  while (reader.next()) {
    const NodeRow node = read_row(reader, head, separator);
    points.insert(points.end(), node.point_w.data(), node.point_w.data() + 3);
    field.compliance_w.push_back(node.C);
  }
  if (field.compliance_w.empty()) reader.refuse(0, "at least one node", "none");
  field.points_w = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>(
      points.data(), Eigen::Index(field.compliance_w.size()), 3);
  return field;
}

}  // namespace abbe::errors
