#include "sim/study/promising_corners.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>

#include "sim/study/passes.h"
#include "sim/study/sequence.h"

namespace abbe::sim::study {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr int starts = 24;           // vertices from which pairs are improved
constexpr int most_exchanges = 8;    // of one of a pair for a farther one
constexpr Index signs_tried = 1024;  // random corners that are improved by the linear map
constexpr std::size_t signs_kept = 16;
constexpr std::uint64_t sign_seed = 0x13198a2e03707344ULL;

/// The vertex that is farthest from another one.
/// @param above  whether it is above that one
Index farthest(const Passes& passes, Index from, bool above) {
  std::vector<double> distance(passes.cut.size());
  tbb::parallel_for(std::size_t(0), distance.size(), [&](std::size_t i) {
    distance[i] = above ? apart(passes, passes.cut[i], from) : apart(passes, from, passes.cut[i]);
  });
  const auto most = std::max_element(distance.begin(), distance.end());
  return passes.cut[std::size_t(most - distance.begin())];
}

/// Slopes of the distance between the vertices of pairs that are farther apart than all pairs with
/// one of them.
std::vector<VectorXd> slopes_of_pairs(const InfluenceMap& influence, const Box& box) {
  const Passes passes = passes_over(influence, box, common_slope(influence));
  const std::vector<HeightRange> range = heights(passes);
  const auto high = ordered(passes, [&](Index v) { return range[std::size_t(v)].high; });
  std::vector<VectorXd> slopes;
  std::vector<std::pair<Index, Index>> known;
  for (int start = 0; start < starts && !high.empty(); ++start) {
    // The highest few, and others spread over all heights.
    const auto place =
        start < 8 ? std::size_t(start) : (high.size() - 1) * std::size_t(start - 8) / (starts - 9);
    std::pair pair{high[std::min(place, high.size() - 1)], Index(-1)};
    for (int i = 0; i < most_exchanges; ++i) {
      const Index before = std::exchange(pair.second, farthest(passes, pair.first, false));
      if (pair.second == before) break;
      pair.first = farthest(passes, pair.second, true);
    }
    if (std::find(known.begin(), known.end(), pair) != known.end()) continue;
    known.push_back(pair);
    slopes.push_back(influence.slope.col(passes.begin(pair.first)) -
                     influence.slope.col(passes.begin(pair.second)));
  }
  return slopes;
}

/// Slopes of the highest vertices, and of the lowest downwards.
std::vector<VectorXd> slopes_of_farthest(const InfluenceMap& influence, const Box& box) {
  const Passes passes = passes_over(influence, box, no_slope(influence));
  const std::vector<HeightRange> range = heights(passes);
  const auto high = ordered(passes, [&](Index v) { return range[std::size_t(v)].high; });
  const auto low = ordered(passes, [&](Index v) { return -range[std::size_t(v)].low; });
  std::vector<VectorXd> slopes;
  for (std::size_t i = 0; i < std::min<std::size_t>(high.size(), starts / 2); ++i) {
    slopes.push_back(influence.slope.col(passes.begin(high[i])));
    slopes.push_back(-influence.slope.col(passes.begin(low[i])));
  }
  return slopes;
}

/// The square of a norm of linear heights at the corners of a box: s^T Q s + 2 b^T s, s of +-1.
struct Square {
  Eigen::MatrixXd Q;
  VectorXd b;
};

Square square_of(const LinearHeights& all, const VectorXd& half) {
  const Eigen::MatrixXd weighted = all.slope * all.weight.asDiagonal();
  return {half.asDiagonal() * (weighted * all.slope.transpose()) * half.asDiagonal(),
          half.cwiseProduct(weighted * all.base)};
}

/// Signs changed one by one, each time the one that gains most. First the square, then the signs.
std::pair<double, VectorXd> improved(const Square& square, VectorXd s) {
  VectorXd pull = square.Q * s + square.b;
  const auto gains = [&] {
    return (4.0 * (square.Q.diagonal().array() - s.array() * pull.array())).eval();
  };
  Index i = 0;
  for (Index step = 0; step < 50 * s.size(); ++step) {
    // Rounding must not make it turn a sign to and fro.
    if (!(gains().maxCoeff(&i) > 1e-12 * std::abs(square.Q(i, i)))) break;
    pull -= 2.0 * s[i] * square.Q.col(i);
    s[i] = -s[i];
  }
  return {s.dot(pull) + s.dot(square.b), s};
}

/// Signs of the largest squares that are found.
std::vector<VectorXd> signs_of_norm(const Square& square) {
  const Eigen::MatrixXd u =
      points({Sampling::Random, int(square.b.size()), sign_seed}, 0, signs_tried);
  std::vector<std::pair<double, VectorXd>> found(std::size_t(u.cols()));
  tbb::parallel_for(Index(0), u.cols(), [&](Index k) {
    found[std::size_t(k)] = improved(square, (2.0 * u.col(k).array().round() - 1.0).matrix());
  });
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<VectorXd> signs;
  for (const auto& [value, s] : found)
    if (signs.size() < signs_kept &&
        std::none_of(signs.begin(), signs.end(), [&](const VectorXd& other) { return other == s; }))
      signs.push_back(s);
  return signs;
}

}  // namespace

Eigen::MatrixXd promising_corners(const InfluenceMap& influence, const Box& box,
                                  Response response) {
  std::vector<VectorXd> slopes = slopes_of_pairs(influence, box);
  const auto add = [&](const std::vector<VectorXd>& more) {
    slopes.insert(slopes.end(), more.begin(), more.end());
  };
  add(slopes_of_farthest(influence, box));
  const Passes passes = passes_over(influence, box, no_slope(influence));
  if (!passes.cut.empty() && response == Response::Rms)
    add(signs_of_norm(square_of(linear_heights(passes), passes.half)));
  if (!passes.cut.empty() && response == Response::Std)
    add(signs_of_norm(square_of(about_mean(linear_heights(passes)), passes.half)));
  Eigen::MatrixXd corners(box.low.size(), Index(slopes.size()));
  for (std::size_t k = 0; k < slopes.size(); ++k)
    corners.col(Index(k)) = (slopes[k].array() < 0.0).select(box.low, box.high);
  return corners;
}

}  // namespace abbe::sim::study
