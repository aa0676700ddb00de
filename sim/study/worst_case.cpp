#include "sim/study/worst_case.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "kinematics/numbers.h"
#include "sim/study/promising_corners.h"
#include "sim/study/sequence.h"
#include "sim/study/worst_bound.h"

namespace abbe::sim::study {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index few = 12;  // inputs of which all corners are tried
constexpr int random_starts = 64;
constexpr Index finalists = 8;  // climbs that go on input by input
constexpr int most_steps = 50;  // of a climb along gradients
constexpr int most_flips = 20;  // of single inputs put to their other end
constexpr std::uint64_t start_seed = 0x243f6a8885a308d3ULL;

/// Corners and what they come to, the sign such that more is worse.
struct Places {
  Eigen::MatrixXd x;  ///< (p x count)
  VectorXd value;     ///< (count)
};

class Climb {
 public:
  Climb(const Box& box, const ResponseFunction& function, double sign)
      : box_(box), function_(function), sign_(sign) {}

  Places at(const Eigen::MatrixXd& x) const { return {x, sign_ * function_.values(x)}; }

  /// A convex response is at least what its gradient promises, so every step goes up. All places
  /// together, as many machines cost little more than one.
  Places along_gradients(Places places) const {
    std::vector<Index> rising(std::size_t(places.value.size()));
    std::iota(rising.begin(), rising.end(), Index(0));
    for (int i = 0; i < most_steps && !rising.empty(); ++i) {
      const Places next = at(ends_along(places.x(Eigen::all, rising)));
      std::vector<Index> still;
      for (std::size_t k = 0; k < rising.size(); ++k) {
        const Index place = rising[k];
        if (!(next.value[Index(k)] > places.value[place])) continue;
        places.x.col(place) = next.x.col(Index(k));
        places.value[place] = next.value[Index(k)];
        still.push_back(place);
      }
      rising = std::move(still);
    }
    return places;
  }

  Places input_by_input(Places place) const {
    for (int i = 0; i < most_flips; ++i) {
      const Places next = best(at(one_flipped(place.x)), 1);
      if (!(next.value[0] > place.value[0])) break;
      place = along_gradients(next);
    }
    return place;
  }

  /// The first of places in falling order.
  static Places best(const Places& places, Index count) {
    std::vector<Index> order(std::size_t(places.value.size()));
    std::iota(order.begin(), order.end(), Index(0));
    std::stable_sort(order.begin(), order.end(),
                     [&](Index a, Index b) { return places.value[a] > places.value[b]; });
    order.resize(std::min(order.size(), std::size_t(count)));
    return {places.x(Eigen::all, order), places.value(order)};
  }

 private:
  Eigen::MatrixXd ends_along(const Eigen::MatrixXd& x) const {
    const Eigen::MatrixXd gradient = sign_ * function_.gradients(x);
    Eigen::MatrixXd ends = x;
    for (Index k = 0; k < x.cols(); ++k)
      for (Index i = 0; i < x.rows(); ++i)
        if (gradient(i, k) != 0.0) ends(i, k) = gradient(i, k) > 0.0 ? box_.high[i] : box_.low[i];
    return ends;
  }

  /// All corners that differ from one in one input.
  Eigen::MatrixXd one_flipped(const VectorXd& corner) const {
    Eigen::MatrixXd x = corner.replicate(1, corner.size());
    x.diagonal() = (corner.array() == box_.low.array()).select(box_.high, box_.low);
    return x;
  }

  const Box& box_;
  const ResponseFunction& function_;
  double sign_;
};

Eigen::MatrixXd all_corners(const Box& box) {
  return Eigen::MatrixXd::NullaryExpr(
      box.low.size(), Index(1) << box.low.size(),
      [&](Index i, Index k) { return (k >> i) & 1 ? box.high[i] : box.low[i]; });
}

/// Promising corners, their opposites, and random ones.
Eigen::MatrixXd starting_corners(const Box& box, const InfluenceMap& influence, Response response) {
  const Eigen::MatrixXd promising = promising_corners(influence, box, response);
  const Index count = promising.cols();
  const auto of = [&](const Eigen::VectorXd& end, Index n) { return end.replicate(1, n).eval(); };
  const Eigen::MatrixXd u =
      points({Sampling::Random, int(box.low.size()), start_seed}, 0, random_starts);
  Eigen::MatrixXd all(box.low.size(), 2 * count + random_starts);
  all << promising,
      (promising.array() == of(box.low, count).array())
          .select(of(box.high, count), of(box.low, count)),
      (u.array() < 0.5).select(of(box.low, random_starts), of(box.high, random_starts));
  return all;
}

Corner climbed(const Box& box, const InfluenceMap& influence, Response response,
               const ResponseFunction& function) {
  const double sign = response == Response::InTolerance ? -1.0 : 1.0;
  const Climb climb(box, function, sign);
  if (box.low.size() <= few) {
    const Places worst = Climb::best(climb.at(all_corners(box)), 1);
    return {worst.x, sign * worst.value[0], 0.0};
  }
  const Places first = Climb::best(
      climb.along_gradients(climb.at(starting_corners(box, influence, response))), finalists);
  Places last = first;
  for (Index k = 0; k < first.value.size(); ++k) {
    const Places one = climb.input_by_input({first.x.col(k), first.value.segment(k, 1)});
    last.x.col(k) = one.x;
    last.value[k] = one.value[0];
  }
  const Places worst = Climb::best(last, 1);
  return {worst.x, sign * worst.value[0], 0.0};
}

}  // namespace

Corner worst_corner(const Box& box, const InfluenceMap& influence, Response response,
                    const ResponseFunction& function) {
  Corner corner = climbed(box, influence, response, function);
  corner.bound = bound_over(influence, box, response, corner.response);
  return corner;
}

Corner worst_corner(const Study& study, const ReadyArm& ready, const InfluenceMap& influence,
                    Response response) {
  const Box box = box_of(study, study.worst_case.value_or(WorstCase{}).coverage);
  const ResponseFunction function = response_function(study, ready, influence, response);
  if (ready.job.scene.alignment == Alignment::None)
    return worst_corner(box, influence, response, function);
  Corner corner = climbed(box, influence, response, function);
  corner.bound = response == Response::InTolerance ? 0.0 : infinity;
  return corner;
}

}  // namespace abbe::sim::study
