#pragma once

#include <stdexcept>
#include <string>

#include <Eigen/Core>

namespace abbe::cutting {

/// A point that an outline or an edge cannot have. what(): "outline: expected ..., seen ..."
struct OutlineFault : std::invalid_argument {
  /// Of a point the two coordinates, or the radius of the arc to it.
  enum class Number { First, Second, Radius };

  OutlineFault(const std::string& what, const Eigen::Vector2d& point, Number of = Number::First)
      : std::invalid_argument(what), at(point), number(of) {}

  Eigen::Vector2d at;  ///< mm, the point
  Number number;       ///< by which it is wrong
};

/// A point at which an outline that is to be convex bends inwards.
struct InwardBend : OutlineFault {
  using OutlineFault::OutlineFault;
};

}  // namespace abbe::cutting
