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

// Machines are computed in lots, the last one filled up, and passes in tiles whose limits do not
// depend on the machines, so that a machine has the same bits at every position of its lot.
constexpr int lot = machines_at_once;
constexpr Index tile = 512;  // passes: their two products, 590 kB, stay in the cache

using MachineLane = Eigen::Array<double, lot, 1>;
using LaneMatrix = Eigen::Matrix<double, lot, Eigen::Dynamic>;

/// Returns the offsets from the base run of machines from .. from + lot - 1, a row each; rows
/// beyond the last machine are the base run itself.
LaneMatrix offsets(const InfluenceMap& influence, const Eigen::MatrixXd& x, Index from) {
  LaneMatrix offset = LaneMatrix::Zero(lot, x.rows());
  const Index count = std::min<Index>(lot, x.cols() - from);
  offset.topRows(count) = (x.middleCols(from, count).colwise() - influence.centre).transpose();
  return offset;
}

/// Calls `visit(vertex, distances of the lot)` for every vertex that is cut, in order.
template <typename Visit>
void for_every_vertex(const InfluenceMap& influence, const LaneMatrix& offset, const Visit& visit) {
  const Index n = Index(influence.first.size()) - 1;
  LaneMatrix moved, shifted;
  for (Index v = 0; v < n;) {
    const Index begin = influence.first[std::size_t(v)];
    Index end_vertex = v + 1;
    while (end_vertex < n && influence.first[std::size_t(end_vertex) + 1] - begin <= tile)
      ++end_vertex;
    const Index count = influence.first[std::size_t(end_vertex)] - begin;
    moved.noalias() = offset * influence.slope.middleCols(begin, count);
    shifted.noalias() = offset * influence.shift.middleCols(begin, count);
    for (; v < end_vertex; ++v) {
      const Index last = influence.first[std::size_t(v) + 1];
      MachineLane least = MachineLane::Constant(std::numeric_limits<double>::infinity());
      for (Index r = influence.first[std::size_t(v)]; r < last; ++r) {
        const auto across = shifted.col(r - begin).array();
        least = least.min(influence.distance[r] + moved.col(r - begin).array() +
                          influence.half_curvature[r] * across * across);
      }
      if (last > influence.first[std::size_t(v)]) visit(v, least);
    }
  }
}

/// Sums over the vertices from which the responses of a lot are computed.
struct Sums {
  MachineLane low = MachineLane::Constant(std::numeric_limits<double>::infinity());
  MachineLane high = -low;
  MachineLane square = MachineLane::Zero();
  // Sums of heights above the first vertex: a part that is displaced as a whole loses no digits.
  MachineLane level = MachineLane::Zero();
  MachineLane first_above = MachineLane::Zero();
  MachineLane square_above = MachineLane::Zero();
  double area = 0.0;

  void add(const MachineLane& height, double of_area) {
    if (area == 0.0) level = height;
    const MachineLane above = height - level;
    low = low.min(height);
    high = high.max(height);
    square += of_area * height.square();
    first_above += of_area * above;
    square_above += of_area * above.square();
    area += of_area;
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

cutting::Surface surface_of(const InfluenceMap& influence, const Eigen::VectorXd& map) {
  const Index n = map.size();
  return {map, Eigen::VectorXd::Constant(n, none), std::vector<int>(std::size_t(n), 0),
          influence.status};
}

}  // namespace

std::size_t gouges_of(const InfluenceMap& influence) {
  return std::size_t(
      std::count(influence.status.begin(), influence.status.end(), cutting::VertexStatus::Gouged));
}

Eigen::MatrixXd maps(const InfluenceMap& influence, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd all =
      Eigen::MatrixXd::Constant(Index(influence.first.size()) - 1, x.cols(), none);
  for (Index from = 0; from < x.cols(); from += lot) {
    const Index count = std::min<Index>(lot, x.cols() - from);
    for_every_vertex(influence, offsets(influence, x, from),
                     [&](Index v, const MachineLane& distance) {
                       all.row(v).segment(from, count) = distance.head(count).transpose();
                     });
  }
  return all;
}

bool is_counted(Response response) {
  return response == Response::P95Abs || response == Response::InTolerance || is_filtered(response);
}

Eigen::MatrixXd responses(const Study& study, const PreparedConfiguration& ready,
                          const InfluenceMap& influence, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd values(Index(study.responses.size()), x.cols());
  const bool summed = ready.job.scene.alignment == Alignment::None &&
                      std::none_of(study.responses.begin(), study.responses.end(), is_counted);
  if (!summed) {
    // Aligned and counted responses need the maps of all vertices at once.
    const Eigen::MatrixXd all = maps(influence, x);
    for (Index i = 0; i < x.cols(); ++i)
      values.col(i) =
          responses(study, ready.job, surface_of(influence, all.col(i)), ready.error_free);
    return values;
  }
  for (Index from = 0; from < x.cols(); from += lot) {
    const Index count = std::min<Index>(lot, x.cols() - from);
    Sums sums;
    for_every_vertex(influence, offsets(influence, x, from),
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
  const Index n = Index(influence.first.size()) - 1;
  Eigen::MatrixXd all = Eigen::MatrixXd::Constant(influence.slope.rows(), n, none);
  for (Index v = 0; v < n; ++v)
    // The first pass of a vertex makes its surface in the base run.
    if (is_cut(influence, v)) all.col(v) = influence.slope.col(influence.first[std::size_t(v)]);
  return all;
}

namespace {

constexpr Index pass_lot = 8;       // machines whose passes are searched together
constexpr Index answer_block = 64;  // machines whose responses are computed together
constexpr double step = 0.01;       // of the spread, for differences

/// The surface of one machine: the pass that makes it at each vertex.
struct Made {
  std::vector<Index> vertex;          ///< (c) vertices that are cut
  std::vector<Index> competing_pass;  ///< (c) the pass that makes the surface
  std::vector<double> across;         ///< (c) mm, shift across that pass
  std::vector<double> height;         ///< (c) mm
};

/// Finds the surface of one machine.
/// @param moved, shifted  (m) mm, along the normal and across each pass
Made made_by(const InfluenceMap& influence, const Eigen::VectorXd& moved,
             const Eigen::VectorXd& shifted) {
  Made made;
  for (std::size_t v = 0; v + 1 < influence.first.size(); ++v) {
    const Index begin = influence.first[v], end = influence.first[v + 1];
    if (begin == end) continue;
    const auto distance = [&](Index r) {
      return influence.distance[r] + moved[r] +
             influence.half_curvature[r] * shifted[r] * shifted[r];
    };
    Index least = begin;
    for (Index r = begin + 1; r < end; ++r)
      if (distance(r) < distance(least)) least = r;
    made.vertex.push_back(Index(v));
    made.competing_pass.push_back(least);
    made.across.push_back(shifted[least]);
    made.height.push_back(distance(least) - influence.error_free[Index(v)]);
  }
  return made;
}

/// Returns the derivatives of the response with the height of each cut vertex.
std::vector<double> weights(const InfluenceMap& influence, Response response, const Made& made) {
  const std::vector<double>& height = made.height;
  std::vector<double> weight(height.size(), 0.0);
  if (height.empty()) return weight;
  const auto [low, high] = std::minmax_element(height.begin(), height.end());
  const auto place = [&](auto at) { return std::size_t(at - height.begin()); };
  double area = 0.0, first = 0.0, square = 0.0;
  for (std::size_t i = 0; i < height.size(); ++i) {
    weight[i] = influence.design.area[made.vertex[i]];
    area += weight[i];
    first += weight[i] * height[i];
    square += weight[i] * height[i] * height[i];
  }
  const double mean = first / area;
  const auto about = [&](double level, double deviation) {
    for (std::size_t i = 0; i < height.size(); ++i)
      weight[i] *= deviation > 0.0 ? (height[i] - level) / (area * deviation) : 0.0;
    return weight;
  };
  switch (response) {
    case Response::Rms:
      return about(0.0, std::sqrt(square / area));
    case Response::Std:
      return about(mean, std::sqrt(std::max(0.0, square / area - mean * mean)));
    case Response::Mean:
      for (double& one : weight) one /= area;
      return weight;
    default:
      break;
  }
  std::fill(weight.begin(), weight.end(), 0.0);
  if (response == Response::Pv) {
    weight[place(high)] += 1.0;
    weight[place(low)] -= 1.0;
  } else if (*high >= -*low) {
    weight[place(high)] = 1.0;
  } else {
    weight[place(low)] = -1.0;
  }
  return weight;
}

Eigen::VectorXd gradient(const InfluenceMap& influence, Response response, const Made& made) {
  const std::vector<double> weight = weights(influence, response, made);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(influence.slope.rows());
  for (std::size_t i = 0; i < weight.size(); ++i) {
    if (weight[i] == 0.0) continue;
    const Index r = made.competing_pass[i];
    const double lift = 2.0 * influence.half_curvature[r] * made.across[i];
    sum += weight[i] * influence.slope.col(r) + (weight[i] * lift) * influence.shift.col(r);
  }
  return sum;
}

/// Calls `visit(first, count)` for blocks of at most `length`, in parallel.
template <typename Visit>
void for_blocks(Index all, Index length, const Visit& visit) {
  tbb::parallel_for(Index(0), (all + length - 1) / length,
                    [&](Index i) { visit(i * length, std::min(length, all - i * length)); });
}

Eigen::MatrixXd differences(const ResponseFunction& response, const Eigen::VectorXd& spread,
                            const Eigen::MatrixXd& x) {
  const Index p = x.rows();
  Eigen::MatrixXd result(p, x.cols());
  tbb::parallel_for(Index(0), x.cols(), [&](Index k) {
    // The last column is the point itself, so that values and differences come from one evaluation.
    Eigen::MatrixXd around = x.col(k).replicate(1, p + 1);
    around.leftCols(p).diagonal() += step * spread;
    const Eigen::VectorXd values = response.values(around);
    result.col(k) = (values.head(p).array() - values[p]) / (step * spread.array());
  });
  return result;
}

}  // namespace

ResponseFunction response_function(const Study& study, const PreparedConfiguration& ready,
                                   const InfluenceMap& influence, Response response) {
  Study of_one = study;
  of_one.responses = {response};
  ResponseFunction function;
  function.values = [of_one, &ready, &influence](const Eigen::MatrixXd& x) {
    Eigen::VectorXd values(x.cols());
    for_blocks(x.cols(), answer_block, [&](Index first, Index count) {
      values.segment(first, count) =
          responses(of_one, ready, influence, x.middleCols(first, count)).row(0).transpose();
    });
    return values;
  };
  if (ready.job.scene.alignment == Alignment::None && !is_counted(response))
    function.gradients = [&influence, response](const Eigen::MatrixXd& x) {
      return gradients(influence, response, x);
    };
  else
    function.gradients = [values = function, spread = spreads(study)](const Eigen::MatrixXd& x) {
      return differences(values, spread, x);
    };
  return function;
}

Eigen::MatrixXd gradients(const InfluenceMap& influence, Response response,
                          const Eigen::MatrixXd& x) {
  if (is_counted(response))
    throw std::invalid_argument("a response that is counted has no gradient");
  Eigen::MatrixXd result(x.rows(), x.cols());
  for_blocks(x.cols(), pass_lot, [&](Index first, Index count) {
    const Eigen::MatrixXd offset = x.middleCols(first, count).colwise() - influence.centre;
    const Eigen::MatrixXd moved = influence.slope.transpose() * offset;
    const Eigen::MatrixXd shifted = influence.shift.transpose() * offset;
    for (Index k = 0; k < count; ++k)
      result.col(first + k) =
          gradient(influence, response, made_by(influence, moved.col(k), shifted.col(k)));
  });
  return result;
}

}  // namespace abbe::sim::study
