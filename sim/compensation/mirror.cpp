#include "sim/compensation/mirror.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <vector>

#include <tbb/parallel_for.h>
#include <Eigen/Dense>

namespace abbe::sim::compensation {
namespace {

using Eigen::Index;
using Eigen::MatrixX3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr std::size_t neighbours = 9;  // the last one only bounds the weights

struct Neighbour {
  double distance = std::numeric_limits<double>::infinity();
  Index row = -1;
};

std::array<Neighbour, neighbours> nearest_of(const MatrixX3d& read_at, const Vector3d& point) {
  std::array<Neighbour, neighbours> best;
  for (Index i = 0; i < read_at.rows(); ++i) {
    const double d = (read_at.row(i).transpose() - point).norm();
    if (!(d < best.back().distance)) continue;
    auto at = best.end() - 1;
    for (; at != best.begin() && d < (at - 1)->distance; --at) *at = *(at - 1);
    *at = {d, i};
  }
  return best;
}

/// Value at a point of the weighted plane through its neighbours.
double plane_at(const MatrixX3d& read_at, const VectorXd& deviation, const Vector3d& point) {
  const auto near = nearest_of(read_at, point);
  if (near[0].distance == 0.0) return deviation[near[0].row];
  const double beyond = 1.0 / near.back().distance;  // 0 where there are fewer
  Eigen::Matrix<double, Eigen::Dynamic, 4, 0, neighbours, 4> A(Index(neighbours), 4);
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, neighbours, 1> b(Index{neighbours});
  Index n = 0;
  for (const Neighbour& one : near) {
    if (one.row < 0) break;
    const double weight = 1.0 / one.distance - beyond;
    if (!(weight > 0.0)) continue;
    const Vector3d from = (read_at.row(one.row).transpose() - point) / near[0].distance;
    A.row(n) << weight, weight * from.transpose();
    b[n++] = weight * deviation[one.row];
  }
  if (n == 0) return deviation[near[0].row];
  // of least norm: across the surface nothing is known, and nothing is assumed to change
  Eigen::CompleteOrthogonalDecomposition<Eigen::Matrix<double, Eigen::Dynamic, 4, 0, neighbours, 4>>
      plane;
  plane.setThreshold(1e-3);
  plane.compute(A.topRows(n));
  return plane.solve(b.head(n))[0];
}

/// Rows [first, last) of neighbours in time.
struct Group {
  std::size_t first = 0, last = 0;
};

/// What a part says, in the order of time.
struct Sorted {
  MatrixX3d normals;
  VectorXd deviation;
  std::vector<double> time_s;
  std::vector<int> pass;
};

Sorted sorted(const KnownPart& part) {
  std::vector<Index> order(std::size_t(part.time_s.size()));
  std::iota(order.begin(), order.end(), Index(0));
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return part.time_s[a] < part.time_s[b]; });
  Sorted result{part.normals(order, Eigen::all), part.deviation(order), {}, {}};
  for (const Index i : order) {
    result.time_s.push_back(part.time_s[i]);
    result.pass.push_back(part.pass.size() > 0 ? part.pass[i] : 0);
  }
  return result;
}

std::vector<Group> stretches_of(const Sorted& part, std::size_t together) {
  const std::vector<double>& t = part.time_s;
  std::vector<double> gaps;
  for (std::size_t i = 1; i < t.size(); ++i)
    if (t[i] > t[i - 1]) gaps.push_back(t[i] - t[i - 1]);
  double longest = std::numeric_limits<double>::infinity();
  if (!gaps.empty()) {
    std::nth_element(gaps.begin(), gaps.begin() + std::ptrdiff_t(gaps.size() / 2), gaps.end());
    longest = 10.0 * double(together) * gaps[gaps.size() / 2];
  }
  std::vector<Group> stretches;
  for (std::size_t i = 0; i < t.size(); ++i) {
    const bool begins = i == 0 || part.pass[i] != part.pass[i - 1] || t[i] - t[i - 1] > longest;
    if (begins) stretches.push_back({i, i});
    stretches.back().last = i + 1;
  }
  return stretches;
}

/// A stretch in groups of about the same size; what was shaped at one instant stays together.
std::vector<Group> groups_of(const Group& stretch, const std::vector<double>& time_s,
                             std::size_t together) {
  const std::size_t n = stretch.last - stretch.first;
  const std::size_t count = std::max<std::size_t>(1, n / together);
  std::vector<Group> groups;
  std::size_t at = stretch.first;
  for (std::size_t g = 1; g <= count; ++g) {
    std::size_t end = std::max(at, stretch.first + g * n / count);
    while (end > at && end < stretch.last && time_s[end] == time_s[end - 1]) ++end;
    if (end > at) groups.push_back({at, end});
    at = end;
  }
  return groups;
}

struct Node {
  double time_s = 0.0;
  Vector3d move = Vector3d::Zero();
};

Node node_of(const Sorted& part, const Group& group, double damping) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Vector3d b = Vector3d::Zero();
  Node node;
  for (std::size_t k = group.first; k < group.last; ++k) {
    const Vector3d n = part.normals.row(Index(k)).transpose();
    A += n * n.transpose();
    b += part.deviation[Index(k)] * n;
    node.time_s += part.time_s[k];
  }
  const double count = double(group.last - group.first);
  A.diagonal().array() += damping * damping * count;
  node.time_s /= count;
  node.move = A.ldlt().solve(b);
  return node;
}

/// The line through two nodes at another time.
Node carried_on(const Node& from, const Node& before, double time_s) {
  const double length = from.time_s - before.time_s;
  const double u = length != 0.0 ? (time_s - from.time_s) / length : 0.0;
  return {time_s, from.move + u * (from.move - before.move)};
}

void append_stretch(std::vector<Node>& course, const Sorted& part, const Group& stretch,
                    const MirrorOptions& options) {
  std::vector<Node> nodes;
  for (const Group& group :
       groups_of(stretch, part.time_s, std::size_t(std::max(1, options.together))))
    nodes.push_back(node_of(part, group, options.damping));
  const std::size_t n = nodes.size();
  const double begin_s = part.time_s[stretch.first], end_s = part.time_s[stretch.last - 1];
  if (begin_s < nodes.front().time_s)
    course.push_back(carried_on(nodes.front(), nodes[std::min<std::size_t>(1, n - 1)], begin_s));
  course.insert(course.end(), nodes.begin(), nodes.end());
  if (end_s > nodes.back().time_s)
    course.push_back(carried_on(nodes.back(), nodes[n > 1 ? n - 2 : 0], end_s));
}

}  // namespace

VectorXd between_readings(const MatrixX3d& read_at, const VectorXd& deviation,
                          const MatrixX3d& points, double reach) {
  if (read_at.rows() == 0 || read_at.rows() != deviation.size())
    throw std::invalid_argument("expected readings of a part, seen none");
  VectorXd values(points.rows());
  tbb::parallel_for(Index(0), points.rows(), [&](Index i) {
    const Vector3d point = points.row(i).transpose();
    const bool near = (read_at.rowwise() - point.transpose()).rowwise().norm().minCoeff() <= reach;
    values[i] = near ? plane_at(read_at, deviation, point) : 0.0;
  });
  return values;
}

PartCourse explained(const KnownPart& part, const MirrorOptions& options) {
  const Sorted known = sorted(part);
  std::vector<Node> nodes;
  for (const Group& stretch : stretches_of(known, std::size_t(std::max(1, options.together))))
    append_stretch(nodes, known, stretch, options);
  PartCourse course{VectorXd(Index(nodes.size())), MatrixX3d(Index(nodes.size()), 3)};
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    course.time_s[Index(i)] = nodes[i].time_s;
    course.move.row(Index(i)) = nodes[i].move.transpose();
  }
  return course;
}

Vector3d move_at(const PartCourse& course, double time_s) {
  const VectorXd& t = course.time_s;
  const Index n = t.size();
  if (n == 0) return Vector3d::Zero();
  const Index after = std::upper_bound(t.data(), t.data() + n, time_s) - t.data();
  if (after == 0) return course.move.row(0).transpose();
  if (after == n) return course.move.row(n - 1).transpose();
  const double u = (time_s - t[after - 1]) / (t[after] - t[after - 1]);
  return ((1 - u) * course.move.row(after - 1) + u * course.move.row(after)).transpose();
}

}  // namespace abbe::sim::compensation
