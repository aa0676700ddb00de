#include "errors/metrology/shares.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double full_turn = 2.0 * pi;
constexpr double one_place = 1e-9;  // rad: rounding of an angle that was made of two coordinates

/// The places of readings around a circle and the gap that follows each.
struct Ring {
  std::vector<double> place;  ///< (m) rad in [0, 2 pi), rising
  std::vector<double> gap;    ///< (m) rad to the next place, round the end too
  std::vector<int> place_of;  ///< (n) of each reading
  std::vector<int> readings;  ///< (m) at each place

  std::size_t size() const { return place.size(); }
  std::size_t widest() const {
    return std::size_t(std::max_element(gap.begin(), gap.end()) - gap.begin());
  }
};

Ring ring_of(const VectorXd& angle) {
  std::vector<Index> order(static_cast<std::size_t>(angle.size()));
  std::iota(order.begin(), order.end(), 0);
  const VectorXd within = angle.unaryExpr([](double a) {
    const double rest = a - full_turn * std::floor(a / full_turn);
    return rest > full_turn - one_place ? 0.0 : rest;
  });
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return within[a] < within[b]; });
  Ring ring;
  ring.place_of.resize(order.size());
  for (const Index i : order) {
    if (ring.place.empty() || within[i] - ring.place.back() > one_place) {
      ring.place.push_back(within[i]);
      ring.readings.push_back(0);
    }
    ring.place_of[std::size_t(i)] = int(ring.size()) - 1;
    ++ring.readings.back();
  }
  for (std::size_t k = 0; k + 1 < ring.size(); ++k)
    ring.gap.push_back(ring.place[k + 1] - ring.place[k]);
  if (ring.size() > 0) ring.gap.push_back(full_turn - (ring.place.back() - ring.place.front()));
  return ring;
}

bool goes_round(const Ring& ring) {
  if (ring.size() < 3) return false;
  std::vector<double> gap = ring.gap;
  std::sort(gap.begin(), gap.end());
  return gap.back() < 5.0 * units::deg || gap.back() < 1.5 * gap[(gap.size() - 1) / 2];
}

}  // namespace

VectorXd arc_shares(const VectorXd& angle) {
  const Ring ring = ring_of(angle);
  const std::size_t m = ring.size(), widest = m > 0 ? ring.widest() : 0;
  const bool whole = goes_round(ring);
  VectorXd shares(angle.size());
  for (Index i = 0; i < shares.size(); ++i) {
    const auto k = std::size_t(ring.place_of[std::size_t(i)]);
    double before = ring.gap[(k + m - 1) % m], after = ring.gap[k];
    if (!whole && k == widest) after = std::min(before, after);
    if (!whole && (k + m - 1) % m == widest) before = std::min(before, after);
    shares[i] = 0.5 * (before + after) / ring.readings[k];
  }
  return shares;
}

bool goes_round(const VectorXd& angle) { return goes_round(ring_of(angle)); }

// Rows are sorted by one number that differs from place to place nearly always, so that only those
// next to each other are compared.
VectorXd place_shares(const Eigen::MatrixXd& places, double tolerance) {
  const Index n = places.rows();
  VectorXd along(places.cols());
  for (Index c = 0; c < along.size(); ++c)
    along[c] = 0.5 + std::fmod(0.6180339887498949 * double(c + 1), 1.0);
  const VectorXd key = places * along;
  const double reach = tolerance * along.sum();
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return key[a] < key[b]; });
  VectorXd count = VectorXd::Ones(n);
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = i + 1; j < order.size() && key[order[j]] - key[order[i]] <= reach; ++j) {
      if ((places.row(order[i]) - places.row(order[j])).cwiseAbs().maxCoeff() > tolerance) continue;
      count[order[i]] += 1.0;
      count[order[j]] += 1.0;
    }
  return count.cwiseInverse();
}

}  // namespace abbe::errors::metrology
