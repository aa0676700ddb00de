#include "errors/metrology/diagonals.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace abbe::errors::metrology {
namespace {

/// The same signs for a diagonal and its reverse.
std::array<int, 3> forward(std::array<int, 3> signs) {
  const auto first = std::find_if(signs.begin(), signs.end(), [](int s) { return s != 0; });
  if (first != signs.end() && *first < 0)
    for (int& s : signs) s = -s;
  return signs;
}

void check(const std::vector<DiagonalRuns>& set) {
  if (set.empty()) throw std::invalid_argument("diagonals: expected at least one diagonal");
  for (std::size_t i = 0; i < set.size(); ++i) {
    const auto& signs = set[i].signs;
    const auto zeros = std::count(signs.begin(), signs.end(), 0);
    const bool known = std::all_of(signs.begin(), signs.end(), [](int s) { return s * s <= 1; });
    if (!known || zeros > 1)
      throw std::invalid_argument("diagonals: expected signs -1, 0, 1 and at most one 0");
    for (std::size_t k = 0; k < i; ++k)
      if (forward(set[k].signs) == forward(signs))
        throw std::invalid_argument("diagonals: expected every diagonal once");
  }
}

double systematic(const Positioning& one) {
  if (one.E) return *one.E;
  return one.up ? one.up->E : one.down->E;
}

bool is_side(double length) { return length > 0.0 && std::isfinite(length); }

}  // namespace

Diagonals diagonals(const std::vector<DiagonalRuns>& set) {
  check(set);
  Diagonals result;
  result.B_d = 0.0;
  for (const DiagonalRuns& one : set) {
    result.each.push_back(positioning(one.runs));
    const Positioning& last = result.each.back();
    result.E_d = std::max(result.E_d, systematic(last));
    if (last.B && result.B_d)
      result.B_d = std::max(*result.B_d, *last.B);
    else
      result.B_d.reset();
  }
  return result;
}

Squareness squareness_from_body_diagonals(const std::array<double, 3>& sides,
                                          const std::array<double, 4>& lengthening) {
  const auto [x, y, z] = sides;
  const auto [ppp, npp, pnp, ppn] = lengthening;
  if (!is_side(x) || !is_side(y) || !is_side(z) || !std::isfinite(ppp + npp + pnp + ppn))
    throw std::invalid_argument("body diagonals: expected positive sides and finite deviations");
  const double D = std::hypot(x, y, z);
  return {-D * ((ppp + ppn) - (npp + pnp)) / (4.0 * x * y),
          D * ((ppp + pnp) - (npp + ppn)) / (4.0 * x * z),
          -D * ((ppp + npp) - (pnp + ppn)) / (4.0 * y * z)};
}

double squareness_from_face_diagonals(double first, double second, double lengthening_pp,
                                      double lengthening_np) {
  if (!is_side(first) || !is_side(second) || !std::isfinite(lengthening_pp + lengthening_np))
    throw std::invalid_argument("face diagonals: expected positive sides and finite deviations");
  return -std::hypot(first, second) * (lengthening_pp - lengthening_np) / (2.0 * first * second);
}

}  // namespace abbe::errors::metrology
