#pragma once

#include <initializer_list>

#include <Eigen/Core>

namespace abbe::errors {

inline Eigen::VectorXd numbers(std::initializer_list<double> list) {
  return Eigen::VectorXd::Map(list.begin(), Eigen::Index(list.size()));
}

}  // namespace abbe::errors
