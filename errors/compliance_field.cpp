#include "errors/compliance_field.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace abbe::errors {
namespace {

using Eigen::Matrix3d;
using Eigen::RowVector3d;
using Eigen::Vector3d;

constexpr int leaf = 8;  // nodes that are looked at one by one

/// Best five so far. Compared with the number too, so that the order of the search does not matter.
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

void build(FieldIndex& index, std::vector<int>& order, const WorkpieceField& field, int from,
           int to) {
  if (to - from <= leaf) return;
  RowVector3d least = field.points_w.row(order[std::size_t(from)]), most = least;
  for (int i = from; i < to; ++i) {
    least = least.cwiseMin(field.points_w.row(order[std::size_t(i)]));
    most = most.cwiseMax(field.points_w.row(order[std::size_t(i)]));
  }
  int axis = 0;
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
  Search(const FieldIndex& index, const Vector3d& point_w) : index_(index), point_w_(point_w) {
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

  const FieldIndex& index_;
  const Vector3d& point_w_;
  Best best_;
};

}  // namespace

FieldIndex indexed(const WorkpieceField& field) {
  const int n = int(field.compliance_w.size());
  FieldIndex index;
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

NearestNodes nearest_nodes(const FieldIndex& index, const Vector3d& point_w) {
  return Search(index, point_w).found();
}

Matrix3d blended(const WorkpieceField& field, const NearestNodes& nearest) {
  const auto& nodes = nearest.nodes;
  const auto C = [&](std::size_t i) -> const Matrix3d& {
    return field.compliance_w[std::size_t(nodes[i].place)];
  };
  if (nodes[0].place < 0) return Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
  if (nodes[0].squared == 0.0) return C(0);
  // Times the first distance, so that nothing overflows; a fifth that is not there is far away.
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
  sum.setZero();  // five at one distance
  for (std::size_t i = 0; i < 5; ++i) sum += C(i) / 5.0;
  return sum;
}

double node_spacing(const WorkpieceField& field) {
  const FieldIndex index = indexed(field);
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
  const FieldIndex index = indexed(field);
  double most = 0.0;
  for (const auto& point : points_w.rowwise())
    most = std::max(most, nearest_nodes(index, point.transpose()).nodes[0].squared);
  return std::sqrt(most);
}

}  // namespace abbe::errors
