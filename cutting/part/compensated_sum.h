#pragma once

#include <cmath>

namespace abbe::cutting {

/// A compensated sum (Neumaier): the rounding of n terms is below 2 ulp of the result plus n^2
/// ulp^2 of the sum of magnitudes. The result depends on the order of the terms.
class Sum {
 public:
  void add(double term) {
    const double next = sum_ + term;
    lost_ += std::abs(sum_) >= std::abs(term) ? (sum_ - next) + term : (term - next) + sum_;
    sum_ = next;
  }
  double value() const { return sum_ + lost_; }

 private:
  double sum_ = 0.0;
  double lost_ = 0.0;
};

}  // namespace abbe::cutting
