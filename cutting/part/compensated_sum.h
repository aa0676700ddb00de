#pragma once

#include <cmath>

namespace abbe::cutting {

/// A compensated sum (Neumaier): the rounding error for n terms is below 2 ulp of the result plus
/// n^2 ulp^2 of the sum of magnitudes. The result depends on the order of the terms.
class CompensatedSum {
 public:
  void add(double term) {
    const double sum = sum_ + term;
    lost_digits_ += std::abs(sum_) >= std::abs(term) ? (sum_ - sum) + term : (term - sum) + sum_;
    sum_ = sum;
  }
  double value() const { return sum_ + lost_digits_; }

 private:
  double sum_ = 0.0;
  double lost_digits_ = 0.0;
};

}  // namespace abbe::cutting
