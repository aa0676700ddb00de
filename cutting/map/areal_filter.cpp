#include "cutting/map/areal_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <compare>
#include <cstdint>
#include <limits>
#include <map>
#include <numbers>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>
#include <Eigen/Geometry>

#include "cutting/map/residual.h"
#include "cutting/part/remeshing.h"
#include "kinematics/bad_input.h"

namespace abbe::cutting {

namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;

// 12 cells keep the transmission within the stated 0.5 %
constexpr double cells_a_cutoff = 12.0;
constexpr double reach_of_cutoff = 0.65;  // beyond it lies 0.25 % of the weight

// largest distance of a point from the mean of the values, in their spreads, at which the plane is
// evaluated
constexpr double max_spreads = 3.0;

constexpr double min_area = 1e-12;  // mm^2, of a vertex between triangles without any area

using GridPlace = std::array<std::int64_t, 4>;  // patch, then x, y, z

/// A cut vertex, or the sample within a triangle.
struct SampledPlace {
  GridPlace place;
  Index number;  // of the vertex, or n + that of the triangle
  auto operator<=>(const SampledPlace&) const = default;
};

/// Neighbouring samples.
struct FilterCell {
  GridPlace place;
  int first = 0, last = 0;  // range of the sorted samples
  double area = 0.0;
  Vector3d middle = Vector3d::Zero(), normal = Vector3d::Zero();
  double residual = 0.0;  // mean
  double spread = 0.0;    // mm^2, variance of the samples in one direction of the surface
  double squares = 0.0;   // mm^4, sum of the squared areas
  double low = std::numeric_limits<double>::infinity(), high = -low;  // residuals
};

/// The samples, sorted by cells of a given size, and the cells.
struct Cells {
  std::vector<SampledPlace> places;
  std::vector<FilterCell> cells;
};

GridPlace place_of(const Vector3d& p, int patch, double size) {
  GridPlace place = {patch, 0, 0, 0};
  for (int k = 0; k < 3; ++k) place[std::size_t(k) + 1] = std::int64_t(std::floor(p[k] / size));
  return place;
}

/// A sample: point and normal, residual, and the area it represents.
struct SampledValue {
  Vector3d point, normal;
  double residual, area;
};

SampledValue sampled_value(const Design& design, const Surface& surface, const Weights& weights,
                           Index number) {
  const Index n = design.vertices.rows();
  if (number < n)
    return {design.vertices.row(number), design.normals.row(number), surface.residual[number],
            std::max(weights.vertex[number], min_area)};
  const auto there = [&](const Points& rows) {
    return value_at_place_within(surface.sampled_within, rows, design.triangles, number - n);
  };
  return {there(design.vertices), there(design.normals), surface.within[number - n],
          weights.within[number - n]};
}

Cells cells_of(const Design& design, const Surface& surface, double size) {
  const std::vector<int> patch = patches(design);
  const Weights weights = cutting::weights(surface, design);
  const Index n = design.vertices.rows();
  Cells all;
  for (Index i = 0; i < n; ++i)
    if (surface.status[std::size_t(i)] == VertexStatus::Cut) all.places.push_back({{}, i});
  for (Index t = 0; t < weights.within.size(); ++t)
    if (weights.within[t] > 0.0) all.places.push_back({{}, n + t});
  tbb::parallel_for(std::size_t(0), all.places.size(), [&](std::size_t i) {
    auto& [place, number] = all.places[i];
    const Index vertex = number < n ? number : design.triangles(number - n, 0);
    place = place_of(sampled_value(design, surface, weights, number).point,
                     patch[std::size_t(vertex)], size);
  });
  // sorted by cell and number, so that sums do not depend on the threads
  tbb::parallel_sort(all.places.begin(), all.places.end());
  for (int here = 0; here < int(all.places.size()); ++here) {
    const GridPlace& place = all.places[std::size_t(here)].place;
    if (all.cells.empty() || all.cells.back().place != place)
      all.cells.push_back({.place = place, .first = here, .last = here});
    ++all.cells.back().last;
  }
  tbb::parallel_for(std::size_t(0), all.cells.size(), [&](std::size_t c) {
    FilterCell& cell = all.cells[c];
    for (int i = cell.first; i < cell.last; ++i) {
      const SampledValue one =
          sampled_value(design, surface, weights, all.places[std::size_t(i)].number);
      cell.area += one.area;
      cell.spread += one.area * one.point.squaredNorm();
      cell.middle += one.area * one.point;
      cell.normal += one.area * one.normal;
      cell.residual += one.area * one.residual;
      cell.squares += one.area * one.area;
      cell.low = std::min(cell.low, one.residual);
      cell.high = std::max(cell.high, one.residual);
    }
    cell.middle /= cell.area;
    cell.residual /= cell.area;
    // a surface has two directions, so the variance in one is half of the mean square
    cell.spread = std::max(0.0, 0.5 * (cell.spread / cell.area - cell.middle.squaredNorm()));
  });
  return all;
}

/// Returns the largest distance between the means of two cells of which one is within reach of the
/// other, mm.
double widest(double reach, double size) { return reach + 2.0 * size; }

/// Cells by the blocks in which they lie; blocks are so wide that the next two contain all cells
/// within reach.
using Blocks = std::map<GridPlace, std::vector<int>>;

Blocks blocks_of(const std::vector<FilterCell>& cells, double size) {
  Blocks blocks;
  for (int i = 0; i < int(cells.size()); ++i) {
    const FilterCell& cell = cells[std::size_t(i)];
    blocks[place_of(cell.middle, int(cell.place[0]), size)].push_back(i);
  }
  return blocks;
}

/// Cells stored by columns, so that several are processed at a time.
struct CellColumns {
  explicit CellColumns(const std::vector<FilterCell>& cells);

  ArrayXd x, y, z, normal_x, normal_y, normal_z, area, residual, spread, squares, low, high;
  std::vector<int> first;
};

CellColumns::CellColumns(const std::vector<FilterCell>& cells) {
  const auto n = Index(cells.size());
  for (ArrayXd* column : {&x, &y, &z, &normal_x, &normal_y, &normal_z, &area, &residual, &spread,
                          &squares, &low, &high})
    column->resize(n);
  first.resize(cells.size());
  for (Index i = 0; i < n; ++i) {
    const FilterCell& cell = cells[std::size_t(i)];
    x[i] = cell.middle.x();
    y[i] = cell.middle.y();
    z[i] = cell.middle.z();
    normal_x[i] = cell.normal.x();
    normal_y[i] = cell.normal.y();
    normal_z[i] = cell.normal.z();
    area[i] = cell.area;
    residual[i] = cell.residual;
    spread[i] = cell.spread;
    squares[i] = cell.squares;
    low[i] = cell.low;
    high[i] = cell.high;
    first[std::size_t(i)] = cell.first;
  }
}

/// Returns the cells of a block and of those around it that a cell of the block can reach.
CellColumns around(const std::vector<FilterCell>& cells, const Blocks& blocks,
                   const Blocks::value_type& home, double width) {
  const GridPlace& at = home.first;
  Eigen::AlignedBox3d box;
  for (const int c : home.second) box.extend(cells[std::size_t(c)].middle);
  std::vector<FilterCell> found;
  for (std::int64_t i = -2; i <= 2; ++i)
    for (std::int64_t j = -2; j <= 2; ++j)
      for (std::int64_t k = -2; k <= 2; ++k) {
        const auto block = blocks.find({at[0], at[1] + i, at[2] + j, at[3] + k});
        if (block == blocks.end()) continue;
        for (const int c : block->second)
          if (box.squaredExteriorDistance(cells[std::size_t(c)].middle) < width * width)
            found.push_back(cells[std::size_t(c)]);
      }
  return CellColumns(found);
}

constexpr Index lane = 4;  // cells whose sums run side by side
using Lane = Eigen::Array<double, lane, 1>;

/// The cells within reach of a vertex; the last lane is filled with cells without area.
struct Reached {
  enum : int {
    X,
    Y,
    Z,
    Area,
    Residual,
    Squares
  };  ///< residual: mm, relative to that of the cell they are reached from

  Eigen::Array<double, Eigen::Dynamic, 6> cells;
  double spread = 0.0;           // mm^2, mean
  double low = 0.0, high = 0.0;  // mm, range of all values, relative to the reference
  double reference = 0.0;        // mm, residual of the cell from which they are reached
};

/// Returns the numbers of the cells within reach whose normals do not oppose.
std::vector<int> similar_cells_near(const CellColumns& around, const FilterCell& from,
                                    double width) {
  const double reach2 = width * width;
  const Vector3d m = from.middle, n = from.normal;
  std::vector<int> numbers(around.first.size());
  std::size_t count = 0;
  // Without a branch, since which cells are within reach cannot be predicted.
  for (std::size_t c = 0; c < numbers.size(); ++c) {
    const auto i = Index(c);
    const double dx = around.x[i] - m.x(), dy = around.y[i] - m.y(), dz = around.z[i] - m.z();
    const bool close = dx * dx + dy * dy + dz * dz < reach2;
    const bool alike =
        bool((around.first[c] == from.first) |
             (around.normal_x[i] * n.x() + around.normal_y[i] * n.y() + around.normal_z[i] * n.z() >
              0.0));
    numbers[count] = int(c);
    count += std::size_t(close & alike);
  }
  numbers.resize(count);
  return numbers;
}

Reached reached(const CellColumns& around, const FilterCell& from, double width) {
  const std::vector<int> near = similar_cells_near(around, from, width);
  const auto n = Index(near.size()), lanes = (n + lane - 1) / lane * lane;
  Reached all;
  all.reference = from.residual;
  all.cells.resize(lanes, 6);
  all.cells.bottomRows(lanes - n).setZero();
  const auto fill = [&](int column, const ArrayXd& values) {
    double* const to = all.cells.col(column).data();
    for (Index i = 0; i < n; ++i) to[i] = values[near[std::size_t(i)]];
  };
  fill(Reached::X, around.x);
  fill(Reached::Y, around.y);
  fill(Reached::Z, around.z);
  fill(Reached::Area, around.area);
  fill(Reached::Residual, around.residual);
  fill(Reached::Squares, around.squares);
  all.cells.col(Reached::Residual).head(n) -= from.residual;
  all.low = from.low - from.residual;
  all.high = from.high - from.residual;
  for (Index i = 0; i < n; ++i) {
    const int c = near[std::size_t(i)];
    all.spread += all.cells(i, Reached::Area) * around.spread[c];
    all.low = std::min(all.low, around.low[c] - from.residual);
    all.high = std::max(all.high, around.high[c] - from.residual);
  }
  all.spread /= all.cells.col(Reached::Area).sum();
  return all;
}

/// Sums of the values about a point with Gaussian weights, for a plane over (u, v) in the tangent
/// plane.
struct PlaneSums {
  Matrix3d moments;    // of 1, u, v
  Vector3d residuals;  // times 1, u, v
  double squares;      // of the weights of the single values
};

PlaneSums plane_sums(const Reached& reached, const Vector3d& point, const Vector3d& normal,
                     double two_variance) {
  const Vector3d first = normal.unitOrthogonal(), second = normal.cross(first);
  Lane w = Lane::Zero(), wu = w, wv = w, wuu = w, wuv = w, wvv = w, wr = w, wur = w, wvr = w,
       ww = w;
  const auto& cells = reached.cells;
  for (Index at = 0; at < cells.rows(); at += lane) {
    const auto numbers = [&](int column) { return cells.col(column).segment<lane>(at); };
    const Lane dx = numbers(Reached::X) - point.x(), dy = numbers(Reached::Y) - point.y(),
               dz = numbers(Reached::Z) - point.z(), r = numbers(Reached::Residual);
    const Lane gaussian = (-(dx * dx + dy * dy + dz * dz) / two_variance).exp();
    const Lane weight = numbers(Reached::Area) * gaussian;
    const Lane u = first.x() * dx + first.y() * dy + first.z() * dz;
    const Lane v = second.x() * dx + second.y() * dy + second.z() * dz;
    const Lane weight_u = weight * u, weight_v = weight * v;
    w += weight;
    wu += weight_u;
    wv += weight_v;
    wuu += weight_u * u;
    wuv += weight_u * v;
    wvv += weight_v * v;
    wr += weight * r;
    wur += weight_u * r;
    wvr += weight_v * r;
    ww += numbers(Reached::Squares) * gaussian * gaussian;
  }
  PlaneSums sums;
  sums.moments << w.sum(), wu.sum(), wv.sum(),  //
      wu.sum(), wuu.sum(), wuv.sum(),           //
      wv.sum(), wuv.sum(), wvv.sum();
  sums.residuals << wr.sum(), wur.sum(), wvr.sum();
  sums.squares = ww.sum();
  return sums;
}

/// Returns the form at a point: of first order if enough values support it, otherwise of order
/// zero.
double form_at(const Reached& reached, const Vector3d& point, const Vector3d& normal,
               double two_variance) {
  PlaneSums sums = plane_sums(reached, point, normal, two_variance);
  const double weight = sums.moments(0, 0), mean = sums.residuals[0] / weight;
  // A few values determine no slope: a plane through three of them may leave their range by any
  // factor.
  if (weight * weight < min_filter_values * sums.squares) return reached.reference + mean;
  // On a line of vertices only one slope is determined: the small term keeps the other at zero.
  const double little = 1e-6 * two_variance * weight;
  sums.moments(1, 1) += little;
  sums.moments(2, 2) += little;
  const Eigen::LDLT<Matrix3d> factors(sums.moments);
  const double fitted = factors.solve(sums.residuals)[0];
  // At a rim the point lies 1.3 spreads from the mean of the values, in a corner 1.9; beyond 3 it
  // lies outside them, and the plane would be extrapolated.
  const double spreads2 = weight * factors.solve(Vector3d::UnitX())[0] - 1.0;
  if (spreads2 > max_spreads * max_spreads) return reached.reference + mean;
  // At a rim the plane has negative weights too, and curved values may make it leave their range.
  // There it is limited to that range, so that the form is continuous.
  return reached.reference + std::clamp(fitted, reached.low, reached.high);
}

}  // namespace

double gaussian_variance(double cutoff) {
  return cutoff * cutoff * std::numbers::ln2 / (2.0 * std::numbers::pi * std::numbers::pi);
}

double filter_values(double cutoff, double density) {
  return 4.0 * std::numbers::pi * gaussian_variance(cutoff) * density;
}

bool resolves_form(const Design& design, double cutoff) {
  return filter_values(cutoff, double(design.triangles.rows()) / design.area.sum()) >=
         min_filter_values;
}

Eigen::VectorXd gaussian_form(const Design& design, const Surface& surface, double cutoff) {
  const Index n = design.vertices.rows();
  require(surface.residual.size() == n && design.area.size() == n && design.normals.rows() == n,
          "gaussian_form: sizes differ");
  require(std::isfinite(cutoff) && cutoff > 0.0, "gaussian_form: the cut-off must be positive");
  const double size = cutoff / cells_a_cutoff;
  const double width = widest(reach_of_cutoff * cutoff, size);
  const double variance = gaussian_variance(cutoff);
  const Cells all = cells_of(design, surface, size);
  const Blocks blocks = blocks_of(all.cells, 0.5 * width);
  std::vector<const Blocks::value_type*> each;
  for (const auto& block : blocks) each.push_back(&block);
  Eigen::VectorXd form = Eigen::VectorXd::Constant(n, std::numeric_limits<double>::quiet_NaN());
  tbb::parallel_for(std::size_t(0), each.size(), [&](std::size_t b) {
    const CellColumns near = around(all.cells, blocks, *each[b], width);
    const std::vector<int>& here = each[b]->second;
    tbb::parallel_for(std::size_t(0), here.size(), [&](std::size_t c) {
      const FilterCell& cell = all.cells[std::size_t(here[c])];
      // Samples within triangles follow the vertices.
      if (all.places[std::size_t(cell.first)].number >= n) return;
      const Reached cells = reached(near, cell, width);
      // Combining samples in cells adds their variance to that of the filter, so it is subtracted
      // here.
      const double two_variance = 2.0 * (variance - cells.spread);
      for (int i = cell.first; i < cell.last; ++i) {
        const Index v = all.places[std::size_t(i)].number;
        if (v >= n) break;
        form[v] = form_at(cells, design.vertices.row(v), design.normals.row(v), two_variance);
      }
    });
  });
  return form;
}

}  // namespace abbe::cutting
