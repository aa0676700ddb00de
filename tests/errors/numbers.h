#pragma once

#include <initializer_list>
#include "tests/test.h"

namespace abbe::errors {

inline VectorXd numbers(std::initializer_list<double> list) {
  return VectorXd::Map(list.begin(), Index(list.size()));
}

}  // namespace abbe::errors
