#include "sim/scene/joined_errors.h"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace abbe::sim {

namespace {

using errors::Curve;
using errors::Element;
using errors::ElementName;

/// Adds a table behind the others.
void append(errors::GeometricErrors& all, ErrorsSection table) {
  const auto base = int(all.elements.size());
  for (Element& element : table.geometric.elements) {
    for (Curve& curve : element.curves) curve.scale *= table.scale;
    all.elements.push_back(std::move(element));
  }
  for (const errors::MeasuringLine& line : table.geometric.measuring_lines)
    all.measuring_lines.push_back(line);
  const errors::Covariance& one = table.geometric.covariance;
  const auto m = Eigen::Index(all.covariance.of.size()), k = Eigen::Index(one.of.size());
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(m + k, m + k);
  matrix.topLeftCorner(m, m) = all.covariance.matrix;
  matrix.bottomRightCorner(k, k) = one.matrix;
  all.covariance.matrix = std::move(matrix);
  for (errors::Coefficient number : one.of) {
    number.element += base;
    all.covariance.of.push_back(number);
  }
}

}  // namespace

errors::GeometricErrors joined(std::vector<ErrorsSection> tables,
                               const MachineDescription& machine) {
  errors::GeometricErrors all;
  for (ErrorsSection& table : tables) append(all, std::move(table));
  const auto rank = [&](const ElementName& name) {
    std::size_t joint = 0;
    while (joint < machine.joints.size() && machine.joints[joint].name != name.axis &&
           !(machine.joints[joint].name == 's' && name.axis == 'S')) {
      ++joint;
    }
    return std::tuple(joint, name.location, name.component(), name.axis);
  };
  std::vector<std::size_t> order(all.elements.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return rank(all.elements[a].name) < rank(all.elements[b].name);
  });
  errors::GeometricErrors result = all;
  result.elements.clear();
  for (const std::size_t from : order) {
    const Element& element = all.elements[from];
    if (result.elements.empty() || !(result.elements.back().name == element.name))
      result.elements.push_back({element.name, {}});
    std::vector<Curve>& curves = result.elements.back().curves;
    for (std::size_t i = 0; i < all.covariance.of.size(); ++i) {
      if (all.covariance.of[i].element != int(from)) continue;
      result.covariance.of[i].element = int(result.elements.size()) - 1;
      result.covariance.of[i].curve += int(curves.size());
    }
    curves.insert(curves.end(), element.curves.begin(), element.curves.end());
  }
  return result;
}

}  // namespace abbe::sim
