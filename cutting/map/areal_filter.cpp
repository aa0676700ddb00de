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

// 12 cells keep the transmission within the stated 0.5 %.
constexpr double cells_per_cutoff = 12.0;
constexpr double reach_per_cutoff = 0.65;  // 0.25 % of the weight is beyond it

// Maximum distance of a point from the mean position of the values at which the plane is evaluated.
constexpr double max_standard_deviations = 3.0;

constexpr double min_area = 1e-12;  // mm^2, of a vertex between triangles without any area

using CellIndex = std::array<std::int64_t, 4>;  // patch, then x, y, z

/// A cut vertex, or the sample within a triangle, and its cell.
struct CellSample {
  CellIndex cell;
  Index sample;  // index of the vertex, or n + index of the triangle
  auto operator<=>(const CellSample&) const = default;
};

/// The combined samples of a cell.
struct FilterCell {
  CellIndex index;
  int begin = 0, end = 0;  // range of the sorted samples
  double area = 0.0;
  Vector3d centroid = Vector3d::Zero(), normal = Vector3d::Zero();
  double residual = 0.0;       // mean
  double variance = 0.0;       // mm^2, of the positions in one direction of the surface
  double squared_areas = 0.0;  // mm^4, sum
  double low = std::numeric_limits<double>::infinity(), high = -low;  // range of the residuals
};

/// The samples, sorted by cells, and the cells.
struct SampleGrid {
  std::vector<CellSample> samples;
  std::vector<FilterCell> cells;
};

CellIndex cell_index(const Vector3d& point, int patch, double cell_size) {
  CellIndex index = {patch, 0, 0, 0};
  for (int k = 0; k < 3; ++k)
    index[std::size_t(k) + 1] = std::int64_t(std::floor(point[k] / cell_size));
  return index;
}

/// A sample with its point and normal, residual, and the area it represents.
struct SampledValue {
  Vector3d point, normal;
  double residual, area;
};

/// Returns the value of a sample; the area of a vertex is at least `min_area`.
SampledValue sampled_value(const Design& design, const Surface& surface, const Weights& weights,
                           Index sample) {
  const Index vertex_count = design.vertices.rows();
  if (sample < vertex_count)
    return {design.vertices.row(sample), design.normals.row(sample), surface.residual[sample],
            std::max(weights.vertex[sample], min_area)};
  const auto value_in_triangle = [&](const Points& rows) {
    return value_at_sample(surface.interior_sample, rows, design.triangles, sample - vertex_count);
  };
  return {value_in_triangle(design.vertices), value_in_triangle(design.normals),
          surface.within[sample - vertex_count], weights.within[sample - vertex_count]};
}

/// Returns the cut samples of a map, combined in cells.
SampleGrid make_grid(const Design& design, const Surface& surface, double cell_size) {
  const std::vector<int> patch = patches(design);
  const Weights weights = cutting::weights(surface, design);
  const Index vertex_count = design.vertices.rows();
  SampleGrid grid;
  for (Index i = 0; i < vertex_count; ++i)
    if (surface.status[std::size_t(i)] == VertexStatus::Cut) grid.samples.push_back({{}, i});
  for (Index t = 0; t < weights.within.size(); ++t)
    if (weights.within[t] > 0.0) grid.samples.push_back({{}, vertex_count + t});
  tbb::parallel_for(std::size_t(0), grid.samples.size(), [&](std::size_t i) {
    auto& [cell, sample] = grid.samples[i];
    const Index vertex =
        sample < vertex_count ? sample : design.triangles(sample - vertex_count, 0);
    cell = cell_index(sampled_value(design, surface, weights, sample).point,
                      patch[std::size_t(vertex)], cell_size);
  });
  // Sorted by cell and sample, so that sums do not depend on the threads.
  tbb::parallel_sort(grid.samples.begin(), grid.samples.end());
  for (int i = 0; i < int(grid.samples.size()); ++i) {
    const CellIndex& index = grid.samples[std::size_t(i)].cell;
    if (grid.cells.empty() || grid.cells.back().index != index)
      grid.cells.push_back({.index = index, .begin = i, .end = i});
    ++grid.cells.back().end;
  }
  tbb::parallel_for(std::size_t(0), grid.cells.size(), [&](std::size_t c) {
    FilterCell& cell = grid.cells[c];
    for (int i = cell.begin; i < cell.end; ++i) {
      const SampledValue value =
          sampled_value(design, surface, weights, grid.samples[std::size_t(i)].sample);
      cell.area += value.area;
      cell.variance += value.area * value.point.squaredNorm();
      cell.centroid += value.area * value.point;
      cell.normal += value.area * value.normal;
      cell.residual += value.area * value.residual;
      cell.squared_areas += value.area * value.area;
      cell.low = std::min(cell.low, value.residual);
      cell.high = std::max(cell.high, value.residual);
    }
    cell.centroid /= cell.area;
    cell.residual /= cell.area;
    // A surface has two directions, so the variance in one of them is half of the mean square.
    cell.variance = std::max(0.0, 0.5 * (cell.variance / cell.area - cell.centroid.squaredNorm()));
  });
  return grid;
}

/// Returns the maximum distance between the centroids of two cells of which one is within reach of
/// the other, mm.
double max_reach(double reach, double cell_size) { return reach + 2.0 * cell_size; }

/// Cells by blocks. The width of a block is half of the reach, so that the next two blocks in every
/// direction contain all cells within reach.
using Blocks = std::map<CellIndex, std::vector<int>>;

Blocks sort_into_blocks(const std::vector<FilterCell>& cells, double block_size) {
  Blocks blocks;
  for (int i = 0; i < int(cells.size()); ++i) {
    const FilterCell& cell = cells[std::size_t(i)];
    blocks[cell_index(cell.centroid, int(cell.index[0]), block_size)].push_back(i);
  }
  return blocks;
}

/// Cells stored by columns, so that several of them are processed at a time.
struct CellColumns {
  explicit CellColumns(const std::vector<FilterCell>& cells);

  ArrayXd x, y, z, normal_x, normal_y, normal_z, area, residual, variance, squared_areas, low, high;
  std::vector<int> begin;  // identifies the cell
};

CellColumns::CellColumns(const std::vector<FilterCell>& cells) {
  const auto count = Index(cells.size());
  for (ArrayXd* column : {&x, &y, &z, &normal_x, &normal_y, &normal_z, &area, &residual, &variance,
                          &squared_areas, &low, &high})
    column->resize(count);
  begin.resize(cells.size());
  for (Index i = 0; i < count; ++i) {
    const FilterCell& cell = cells[std::size_t(i)];
    x[i] = cell.centroid.x();
    y[i] = cell.centroid.y();
    z[i] = cell.centroid.z();
    normal_x[i] = cell.normal.x();
    normal_y[i] = cell.normal.y();
    normal_z[i] = cell.normal.z();
    area[i] = cell.area;
    residual[i] = cell.residual;
    variance[i] = cell.variance;
    squared_areas[i] = cell.squared_areas;
    low[i] = cell.low;
    high[i] = cell.high;
    begin[std::size_t(i)] = cell.begin;
  }
}

/// Returns the cells of a block and those of the blocks around it that are within reach of it.
CellColumns cells_around(const std::vector<FilterCell>& cells, const Blocks& blocks,
                         const Blocks::value_type& block_at_centre, double reach) {
  const CellIndex& centre = block_at_centre.first;
  Eigen::AlignedBox3d box;
  for (const int c : block_at_centre.second) box.extend(cells[std::size_t(c)].centroid);
  std::vector<FilterCell> result;
  for (std::int64_t i = -2; i <= 2; ++i)
    for (std::int64_t j = -2; j <= 2; ++j)
      for (std::int64_t k = -2; k <= 2; ++k) {
        const auto neighbour_block =
            blocks.find({centre[0], centre[1] + i, centre[2] + j, centre[3] + k});
        if (neighbour_block == blocks.end()) continue;
        for (const int c : neighbour_block->second)
          if (box.squaredExteriorDistance(cells[std::size_t(c)].centroid) < reach * reach)
            result.push_back(cells[std::size_t(c)]);
      }
  return CellColumns(result);
}

constexpr Index lane_size = 4;  // cells whose sums are computed in parallel
using Lane = Eigen::Array<double, lane_size, 1>;

/// The cells within reach of a cell; the last lane is filled with cells without area.
struct ReachedCells {
  enum : int { X, Y, Z, Area, Residual, Squares };  ///< Residual: mm, relative to the reference

  Eigen::Array<double, Eigen::Dynamic, 6> cells;
  double variance = 0.0;         // mm^2, mean of the cells
  double low = 0.0, high = 0.0;  // mm, range of all values, relative to the reference
  double reference = 0.0;        // mm, residual of the cell from which the others are reached
};

/// Returns the indices of the cells within reach whose normals do not oppose.
std::vector<int> similar_cells_within(const CellColumns& cells_around, const FilterCell& cell,
                                      double reach) {
  const double squared_reach = reach * reach;
  const Vector3d centroid = cell.centroid, n = cell.normal;
  std::vector<int> indices(cells_around.begin.size());
  std::size_t count = 0;
  // Without a branch, because it could not be predicted which cells are within reach.
  for (std::size_t c = 0; c < indices.size(); ++c) {
    const auto i = Index(c);
    const double dx = cells_around.x[i] - centroid.x(), dy = cells_around.y[i] - centroid.y(),
                 dz = cells_around.z[i] - centroid.z();
    const bool is_within_reach = dx * dx + dy * dy + dz * dz < squared_reach;
    const bool is_similar =
        bool((cells_around.begin[c] == cell.begin) |
             (cells_around.normal_x[i] * n.x() + cells_around.normal_y[i] * n.y() +
                  cells_around.normal_z[i] * n.z() >
              0.0));
    indices[count] = int(c);
    count += std::size_t(is_within_reach & is_similar);
  }
  indices.resize(count);
  return indices;
}

/// Returns the cells within reach of a cell.
ReachedCells reached_cells(const CellColumns& cells_around, const FilterCell& cell, double reach) {
  const std::vector<int> indices = similar_cells_within(cells_around, cell, reach);
  const auto count = Index(indices.size()), lanes = (count + lane_size - 1) / lane_size * lane_size;
  ReachedCells result;
  result.reference = cell.residual;
  result.cells.resize(lanes, 6);
  result.cells.bottomRows(lanes - count).setZero();
  const auto fill = [&](int column, const ArrayXd& values) {
    double* const target = result.cells.col(column).data();
    for (Index i = 0; i < count; ++i) target[i] = values[indices[std::size_t(i)]];
  };
  fill(ReachedCells::X, cells_around.x);
  fill(ReachedCells::Y, cells_around.y);
  fill(ReachedCells::Z, cells_around.z);
  fill(ReachedCells::Area, cells_around.area);
  fill(ReachedCells::Residual, cells_around.residual);
  fill(ReachedCells::Squares, cells_around.squared_areas);
  result.cells.col(ReachedCells::Residual).head(count) -= cell.residual;
  result.low = cell.low - cell.residual;
  result.high = cell.high - cell.residual;
  for (Index i = 0; i < count; ++i) {
    const int c = indices[std::size_t(i)];
    result.variance += result.cells(i, ReachedCells::Area) * cells_around.variance[c];
    result.low = std::min(result.low, cells_around.low[c] - cell.residual);
    result.high = std::max(result.high, cells_around.high[c] - cell.residual);
  }
  result.variance /= result.cells.col(ReachedCells::Area).sum();
  return result;
}

/// Sums of values around a point with Gaussian weights, for a plane over (u, v) in the tangent
/// plane.
struct PlaneSums {
  Matrix3d moments;        // of 1, u, v
  Vector3d residuals;      // times 1, u, v
  double squared_weights;  // sum, of the single values
};

/// Returns the sums of the values of cells around a point.
PlaneSums plane_sums(const ReachedCells& reached_cells, const Vector3d& point,
                     const Vector3d& normal, double two_variance) {
  const Vector3d first = normal.unitOrthogonal(), second = normal.cross(first);
  Lane w = Lane::Zero(), wu = w, wv = w, wuu = w, wuv = w, wvv = w, wr = w, wur = w, wvr = w,
       ww = w;
  const auto& cells = reached_cells.cells;
  for (Index first_row = 0; first_row < cells.rows(); first_row += lane_size) {
    const auto numbers = [&](int column) {
      return cells.col(column).segment<lane_size>(first_row);
    };
    const Lane dx = numbers(ReachedCells::X) - point.x(), dy = numbers(ReachedCells::Y) - point.y(),
               dz = numbers(ReachedCells::Z) - point.z(), r = numbers(ReachedCells::Residual);
    const Lane gaussian = (-(dx * dx + dy * dy + dz * dz) / two_variance).exp();
    const Lane weight = numbers(ReachedCells::Area) * gaussian;
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
    ww += numbers(ReachedCells::Squares) * gaussian * gaussian;
  }
  PlaneSums sums;
  sums.moments << w.sum(), wu.sum(), wv.sum(),  //
      wu.sum(), wuu.sum(), wuv.sum(),           //
      wv.sum(), wuv.sum(), wvv.sum();
  sums.residuals << wr.sum(), wur.sum(), wvr.sum();
  sums.squared_weights = ww.sum();
  return sums;
}

/// Returns the form at a point: of first order if enough values support it, otherwise of order
/// zero.
double form_at(const ReachedCells& reached_cells, const Vector3d& point, const Vector3d& normal,
               double two_variance) {
  PlaneSums sums = plane_sums(reached_cells, point, normal, two_variance);
  const double weight = sums.moments(0, 0), mean = sums.residuals[0] / weight;
  // A few values determine no slope: a plane through three of them may leave their range by any
  // factor.
  if (weight * weight < min_filter_values * sums.squared_weights)
    return reached_cells.reference + mean;
  // On a line of vertices only one slope is determined; the small term sets the other to zero.
  const double regularisation = 1e-6 * two_variance * weight;
  sums.moments(1, 1) += regularisation;
  sums.moments(2, 2) += regularisation;
  const Eigen::LDLT<Matrix3d> factors(sums.moments);
  const double plane_value = factors.solve(sums.residuals)[0];
  // At a rim the point is 1.3 standard deviations from the mean position of the values, in a corner
  // 1.9; beyond 3 it is outside them, and the plane would be extrapolated.
  const double squared_deviations = weight * factors.solve(Vector3d::UnitX())[0] - 1.0;
  if (squared_deviations > max_standard_deviations * max_standard_deviations)
    return reached_cells.reference + mean;
  // At a rim some weights of the plane are negative, so it may leave the range of curved values. It
  // is clamped to that range, so that the form is continuous.
  return reached_cells.reference + std::clamp(plane_value, reached_cells.low, reached_cells.high);
}

/// Returns the variance, in one direction, of the weights of the filter with a cut-off (mm), mm^2.
double gaussian_variance(double cutoff) {
  return cutoff * cutoff * std::numbers::ln2 / (2.0 * std::numbers::pi * std::numbers::pi);
}

}  // namespace

double effective_value_count(double cutoff, double density) {
  return 4.0 * std::numbers::pi * gaussian_variance(cutoff) * density;
}

bool resolves_form(const Design& design, double cutoff) {
  return effective_value_count(cutoff, double(design.triangles.rows()) / design.area.sum()) >=
         min_filter_values;
}

Eigen::VectorXd gaussian_form(const Design& design, const Surface& surface, double cutoff) {
  const Index vertex_count = design.vertices.rows();
  require(surface.residual.size() == vertex_count && design.area.size() == vertex_count &&
              design.normals.rows() == vertex_count,
          "gaussian_form: sizes differ");
  require(std::isfinite(cutoff) && cutoff > 0.0, "gaussian_form: the cut-off must be positive");
  const double cell_size = cutoff / cells_per_cutoff;
  const double reach = max_reach(reach_per_cutoff * cutoff, cell_size);
  const double variance = gaussian_variance(cutoff);
  const SampleGrid grid = make_grid(design, surface, cell_size);
  const Blocks blocks = sort_into_blocks(grid.cells, 0.5 * reach);
  std::vector<const Blocks::value_type*> block_list;
  for (const auto& block : blocks) block_list.push_back(&block);
  Eigen::VectorXd form =
      Eigen::VectorXd::Constant(vertex_count, std::numeric_limits<double>::quiet_NaN());
  tbb::parallel_for(std::size_t(0), block_list.size(), [&](std::size_t b) {
    const CellColumns block_cells = cells_around(grid.cells, blocks, *block_list[b], reach);
    const std::vector<int>& cells_of_block = block_list[b]->second;
    tbb::parallel_for(std::size_t(0), cells_of_block.size(), [&](std::size_t c) {
      const FilterCell& cell = grid.cells[std::size_t(cells_of_block[c])];
      // Samples within triangles follow the vertices.
      if (grid.samples[std::size_t(cell.begin)].sample >= vertex_count) return;
      const ReachedCells neighbourhood = reached_cells(block_cells, cell, reach);
      // Combining samples in cells adds the variance of their positions to that of the filter, so
      // it is subtracted here.
      const double two_variance = 2.0 * (variance - neighbourhood.variance);
      for (int i = cell.begin; i < cell.end; ++i) {
        const Index vertex = grid.samples[std::size_t(i)].sample;
        if (vertex >= vertex_count) break;
        form[vertex] = form_at(neighbourhood, design.vertices.row(vertex),
                               design.normals.row(vertex), two_variance);
      }
    });
  });
  return form;
}

}  // namespace abbe::cutting
