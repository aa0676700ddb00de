#include "sim/study/influence.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <tbb/parallel_for.h>

#include "kinematics/units.h"

namespace abbe::sim::study {

namespace {

using Eigen::Index;

// Machines are computed in lots of the same size, and passes in tiles whose limits do not depend on
// the machines, so that a machine has the same bits at every position in a lot.
constexpr int lot_size = machines_per_lot;
constexpr Index max_tile_passes = 512;  // passes: their two products, 590 kB, stay in the cache

using MachineLane = Eigen::Array<double, lot_size, 1>;
using LaneMatrix = Eigen::Matrix<double, lot_size, Eigen::Dynamic>;

/// Returns (lot x inputs) the offsets of the machines of a lot from the base run. Rows beyond the
/// last machine are zero, i.e. the base run itself.
/// @param from  number of the first machine of the lot
LaneMatrix offsets(const InfluenceMap& influence, const Eigen::MatrixXd& x, Index from) {
  LaneMatrix offset = LaneMatrix::Zero(lot_size, x.rows());
  const Index count = std::min<Index>(lot_size, x.cols() - from);
  offset.topRows(count) = (x.middleCols(from, count).colwise() - influence.centre).transpose();
  return offset;
}

/// Calls `visit(vertex, distances of the lot_size)` for every vertex that is cut, in order.
template <typename Visit>
void visit_vertices(const InfluenceMap& influence, const LaneMatrix& offset, const Visit& visit) {
  const Index vertex_count = Index(influence.first.size()) - 1;
  LaneMatrix displacement_n, displacement_across;
  for (Index vertex = 0; vertex < vertex_count;) {
    const Index begin = influence.first[std::size_t(vertex)];
    Index end_vertex = vertex + 1;
    while (end_vertex < vertex_count &&
           influence.first[std::size_t(end_vertex) + 1] - begin <= max_tile_passes)
      ++end_vertex;
    const Index count = influence.first[std::size_t(end_vertex)] - begin;
    displacement_n.noalias() = offset * influence.slope.middleCols(begin, count);
    displacement_across.noalias() = offset * influence.shift.middleCols(begin, count);
    for (; vertex < end_vertex; ++vertex) {
      const Index last = influence.first[std::size_t(vertex) + 1];
      MachineLane lowest = MachineLane::Constant(std::numeric_limits<double>::infinity());
      for (Index pass = influence.first[std::size_t(vertex)]; pass < last; ++pass) {
        const auto across = displacement_across.col(pass - begin).array();
        lowest = lowest.min(influence.distance[pass] + displacement_n.col(pass - begin).array() +
                            influence.half_curvature[pass] * across * across);
      }
      if (last > influence.first[std::size_t(vertex)]) visit(vertex, lowest);
    }
  }
}

/// Sums of the heights of the vertices, from which the responses of a lot are computed.
struct HeightSums {
  MachineLane low = MachineLane::Constant(std::numeric_limits<double>::infinity());
  MachineLane high = -low;
  MachineLane square = MachineLane::Zero();
  // Heights above that of the first vertex lose no digits if the whole part is displaced.
  MachineLane level = MachineLane::Zero();
  MachineLane first_above = MachineLane::Zero();
  MachineLane square_above = MachineLane::Zero();
  double area = 0.0;

  void add(const MachineLane& height, double vertex_area) {
    if (area == 0.0) level = height;
    const MachineLane above = height - level;
    low = low.min(height);
    high = high.max(height);
    square += vertex_area * height.square();
    first_above += vertex_area * above;
    square_above += vertex_area * above.square();
    area += vertex_area;
  }

  MachineLane value(Response response) const {
    if (!(area > 0.0)) return MachineLane::Constant(none);
    const MachineLane mean_above = first_above / area;
    switch (response) {
      case Response::Pv:
        return high - low;
      case Response::Rms:
        return (square / area).sqrt();
      case Response::Mean:
        return level + mean_above;
      case Response::Std:
        return (square_above / area - mean_above.square()).max(0.0).sqrt();
      case Response::MaxAbs:
        return high.abs().max(low.abs());
      default:
        return MachineLane::Constant(none);
    }
  }
};

cutting::Surface map_surface(const InfluenceMap& influence, const Eigen::VectorXd& map) {
  const Index n = map.size();
  return {map, Eigen::VectorXd::Constant(n, none), std::vector<int>(std::size_t(n), 0),
          influence.status};
}

}  // namespace

std::size_t gouge_count(const InfluenceMap& influence) {
  return std::size_t(
      std::count(influence.status.begin(), influence.status.end(), cutting::VertexStatus::Gouged));
}

Eigen::MatrixXd maps(const InfluenceMap& influence, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd result =
      Eigen::MatrixXd::Constant(Index(influence.first.size()) - 1, x.cols(), none);
  for (Index from = 0; from < x.cols(); from += lot_size) {
    const Index count = std::min<Index>(lot_size, x.cols() - from);
    visit_vertices(influence, offsets(influence, x, from),
                   [&](Index v, const MachineLane& distance) {
                     result.row(v).segment(from, count) = distance.head(count).transpose();
                   });
  }
  return result;
}

bool is_counted_response(Response response) {
  return response == Response::P95Abs || response == Response::InTolerance || is_filtered(response);
}

Eigen::MatrixXd responses(const Study& study, const PreparedConfiguration& ready,
                          const InfluenceMap& influence, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd values(Index(study.responses.size()), x.cols());
  const bool can_sum =
      ready.job.scene.alignment == Alignment::None &&
      std::none_of(study.responses.begin(), study.responses.end(), is_counted_response);
  if (!can_sum) {
    // Aligned and counted responses need the whole maps.
    const Eigen::MatrixXd all_maps = maps(influence, x);
    for (Index i = 0; i < x.cols(); ++i)
      values.col(i) =
          responses(study, ready.job, map_surface(influence, all_maps.col(i)), ready.error_free);
    return values;
  }
  for (Index from = 0; from < x.cols(); from += lot_size) {
    const Index count = std::min<Index>(lot_size, x.cols() - from);
    HeightSums sums;
    visit_vertices(influence, offsets(influence, x, from),
                   [&](Index v, const MachineLane& distance) {
                     sums.add(distance - influence.error_free[v], influence.design.area[v]);
                   });
    for (std::size_t i = 0; i < study.responses.size(); ++i)
      values.row(Index(i)).segment(from, count) =
          sums.value(study.responses[i]).head(count).transpose();
  }
  return values;
}

Eigen::MatrixXd effects(const InfluenceMap& influence) {
  const Index vertex_count = Index(influence.first.size()) - 1;
  Eigen::MatrixXd result = Eigen::MatrixXd::Constant(influence.slope.rows(), vertex_count, none);
  for (Index v = 0; v < vertex_count; ++v)
    // In the base run the first pass of a vertex makes the surface.
    if (is_cut(influence, v)) result.col(v) = influence.slope.col(influence.first[std::size_t(v)]);
  return result;
}

namespace {

constexpr Index machines_per_search = 8;  // machines whose passes are searched together
constexpr Index machines_per_block = 64;  // machines whose responses are computed together
constexpr double relative_step = 0.01;    // of the spread, for differences

/// The surface of one machine, with the pass that makes it at each vertex.
struct MachineSurface {
  std::vector<Index> vertex;          ///< (c) vertices that are cut
  std::vector<Index> competing_pass;  ///< (c) the pass that makes the surface
  std::vector<double> across;         ///< (c) mm, shift across that pass
  std::vector<double> height;         ///< (c) mm
};

/// Finds the surface of one machine.
/// @param moved, shifted  (m) mm, along the normal and across each pass
MachineSurface find_surface(const InfluenceMap& influence, const Eigen::VectorXd& displacement_n,
                            const Eigen::VectorXd& displacement_across) {
  MachineSurface surface;
  for (std::size_t vertex = 0; vertex + 1 < influence.first.size(); ++vertex) {
    const Index begin = influence.first[vertex], end = influence.first[vertex + 1];
    if (begin == end) continue;
    const auto distance = [&](Index pass) {
      return influence.distance[pass] + displacement_n[pass] +
             influence.half_curvature[pass] * displacement_across[pass] * displacement_across[pass];
    };
    Index lowest = begin;
    for (Index pass = begin + 1; pass < end; ++pass)
      if (distance(pass) < distance(lowest)) lowest = pass;
    surface.vertex.push_back(Index(vertex));
    surface.competing_pass.push_back(lowest);
    surface.across.push_back(displacement_across[lowest]);
    surface.height.push_back(distance(lowest) - influence.error_free[Index(vertex)]);
  }
  return surface;
}

/// Returns the derivatives of the response with the height of each cut vertex.
std::vector<double> height_weights(const InfluenceMap& influence, Response response,
                                   const MachineSurface& surface) {
  const std::vector<double>& height = surface.height;
  std::vector<double> weight(height.size(), 0.0);
  if (height.empty()) return weight;
  const auto [low, high] = std::minmax_element(height.begin(), height.end());
  const auto position = [&](auto at) { return std::size_t(at - height.begin()); };
  double area = 0.0, weighted_sum = 0.0, weighted_square = 0.0;
  for (std::size_t i = 0; i < height.size(); ++i) {
    weight[i] = influence.design.area[surface.vertex[i]];
    area += weight[i];
    weighted_sum += weight[i] * height[i];
    weighted_square += weight[i] * height[i] * height[i];
  }
  const double mean = weighted_sum / area;
  const auto weigh_about = [&](double level, double deviation) {
    for (std::size_t i = 0; i < height.size(); ++i)
      weight[i] *= deviation > 0.0 ? (height[i] - level) / (area * deviation) : 0.0;
    return weight;
  };
  switch (response) {
    case Response::Rms:
      return weigh_about(0.0, std::sqrt(weighted_square / area));
    case Response::Std:
      return weigh_about(mean, std::sqrt(std::max(0.0, weighted_square / area - mean * mean)));
    case Response::Mean:
      for (double& vertex_weight : weight) vertex_weight /= area;
      return weight;
    default:
      break;
  }
  std::fill(weight.begin(), weight.end(), 0.0);
  if (response == Response::Pv) {
    weight[position(high)] += 1.0;
    weight[position(low)] -= 1.0;
  } else if (*high >= -*low) {
    weight[position(high)] = 1.0;
  } else {
    weight[position(low)] = -1.0;
  }
  return weight;
}

Eigen::VectorXd gradient(const InfluenceMap& influence, Response response,
                         const MachineSurface& surface) {
  const std::vector<double> weight = height_weights(influence, response, surface);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(influence.slope.rows());
  for (std::size_t i = 0; i < weight.size(); ++i) {
    if (weight[i] == 0.0) continue;
    const Index pass = surface.competing_pass[i];
    const double curvature_slope = 2.0 * influence.half_curvature[pass] * surface.across[i];
    sum += weight[i] * influence.slope.col(pass) +
           (weight[i] * curvature_slope) * influence.shift.col(pass);
  }
  return sum;
}

/// Calls `visit(first, count)` for blocks of at most `length`, in parallel.
template <typename Visit>
void visit_blocks(Index count, Index block_length, const Visit& visit) {
  tbb::parallel_for(Index(0), (count + block_length - 1) / block_length, [&](Index i) {
    visit(i * block_length, std::min(block_length, count - i * block_length));
  });
}

Eigen::MatrixXd difference_gradients(const ResponseFunction& response,
                                     const Eigen::VectorXd& spread, const Eigen::MatrixXd& x) {
  const Index p = x.rows();
  Eigen::MatrixXd result(p, x.cols());
  tbb::parallel_for(Index(0), x.cols(), [&](Index k) {
    // The last column is the point itself, so that one evaluation gives all values.
    Eigen::MatrixXd points = x.col(k).replicate(1, p + 1);
    points.leftCols(p).diagonal() += relative_step * spread;
    const Eigen::VectorXd values = response.values(points);
    result.col(k) = (values.head(p).array() - values[p]) / (relative_step * spread.array());
  });
  return result;
}

}  // namespace

ResponseFunction response_function(const Study& study, const PreparedConfiguration& ready,
                                   const InfluenceMap& influence, Response response) {
  Study single_response = study;
  single_response.responses = {response};
  ResponseFunction function;
  function.values = [single_response, &ready, &influence](const Eigen::MatrixXd& x) {
    Eigen::VectorXd values(x.cols());
    visit_blocks(x.cols(), machines_per_block, [&](Index first, Index count) {
      values.segment(first, count) =
          responses(single_response, ready, influence, x.middleCols(first, count))
              .row(0)
              .transpose();
    });
    return values;
  };
  if (ready.job.scene.alignment == Alignment::None && !is_counted_response(response))
    function.gradients = [&influence, response](const Eigen::MatrixXd& x) {
      return gradients(influence, response, x);
    };
  else
    function.gradients = [values = function, spread = spreads(study)](const Eigen::MatrixXd& x) {
      return difference_gradients(values, spread, x);
    };
  return function;
}

Eigen::MatrixXd gradients(const InfluenceMap& influence, Response response,
                          const Eigen::MatrixXd& x) {
  if (is_counted_response(response))
    throw std::invalid_argument("a response that is a count has no gradient");
  Eigen::MatrixXd result(x.rows(), x.cols());
  visit_blocks(x.cols(), machines_per_search, [&](Index first, Index count) {
    const Eigen::MatrixXd offset = x.middleCols(first, count).colwise() - influence.centre;
    const Eigen::MatrixXd displacement_n = influence.slope.transpose() * offset;
    const Eigen::MatrixXd displacement_across = influence.shift.transpose() * offset;
    for (Index k = 0; k < count; ++k)
      result.col(first + k) =
          gradient(influence, response,
                   find_surface(influence, displacement_n.col(k), displacement_across.col(k)));
  });
  return result;
}

}  // namespace abbe::sim::study
