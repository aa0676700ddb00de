#include "sim/study/response_function.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <tbb/parallel_for.h>

namespace abbe::sim::study {
namespace {

using Eigen::Index;

constexpr Index pass_lot = 8;       // machines whose passes are looked at together
constexpr Index answer_block = 64;  // machines that are answered together
constexpr double step = 0.01;       // of the spread

/// The surface of one machine.
struct Made {
  std::vector<Index> vertex;   ///< (c) that are cut
  std::vector<Index> rival;    ///< (c) which makes the surface
  std::vector<double> across;  ///< (c) mm, by which that pass is shifted
  std::vector<double> height;  ///< (c) mm
};

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
    made.rival.push_back(least);
    made.across.push_back(shifted[least]);
    made.height.push_back(distance(least) - influence.error_free[Index(v)]);
  }
  return made;
}

/// What the response gains with the height of each cut vertex.
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
    const Index r = made.rival[i];
    const double lift = 2.0 * influence.half_curvature[r] * made.across[i];
    sum += weight[i] * influence.slope.col(r) + (weight[i] * lift) * influence.shift.col(r);
  }
  return sum;
}

/// Calls `visit(first, count)` for stretches of at most `length`, in parallel.
template <typename Visit>
void for_stretches(Index all, Index length, const Visit& visit) {
  tbb::parallel_for(Index(0), (all + length - 1) / length,
                    [&](Index i) { visit(i * length, std::min(length, all - i * length)); });
}

Eigen::MatrixXd differences(const ResponseFunction& response, const Eigen::VectorXd& spread,
                            const Eigen::MatrixXd& x) {
  const Index p = x.rows();
  Eigen::MatrixXd result(p, x.cols());
  tbb::parallel_for(Index(0), x.cols(), [&](Index k) {
    Eigen::MatrixXd around = x.col(k).replicate(1, p + 1);
    around.leftCols(p).diagonal() += step * spread;
    const Eigen::VectorXd values = response.values(around);
    result.col(k) = (values.head(p).array() - values[p]) / (step * spread.array());
  });
  return result;
}

}  // namespace

ResponseFunction response_function(const Study& study, const ReadyArm& ready,
                                   const InfluenceMap& influence, Response response) {
  Study of_one = study;
  of_one.responses = {response};
  ResponseFunction function;
  function.values = [of_one, &ready, &influence](const Eigen::MatrixXd& x) {
    Eigen::VectorXd values(x.cols());
    for_stretches(x.cols(), answer_block, [&](Index first, Index count) {
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
  for_stretches(x.cols(), pass_lot, [&](Index first, Index count) {
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
