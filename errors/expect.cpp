#include "errors/expect.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace abbe::errors {

void refuse(const std::string& who, const std::string& why) {
  throw std::invalid_argument(who + ": " + why);
}

void expect_positive(double value, const std::string& who, const char* what) {
  if (!(value > 0.0) || !std::isfinite(value))
    refuse(who, fmt::format("expected a {} above 0, seen {}", what, value));
}

void expect_not_negative(double value, const std::string& who, const char* what) {
  if (!(value >= 0.0) || !std::isfinite(value))
    refuse(who, fmt::format("expected a {} of 0 or more, seen {}", what, value));
}

void expect_finite(double value, const std::string& who, const char* what) {
  if (!std::isfinite(value)) refuse(who, fmt::format("expected a finite {}, seen {}", what, value));
}

void expect_node(int node, int nodes, const std::string& who) {
  if (node < 0 || node >= nodes)
    refuse(who, fmt::format("expected a node 0 .. {}, seen {}", nodes - 1, node));
}

}  // namespace abbe::errors
