#include "errors/metrology/diagonal_tests.h"

#include <array>
#include <utility>

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

/// Signs of the slides along a diagonal, in the order X Y Z; nothing if other axes move.
std::optional<std::array<int, 3>> signs_of(const Series& series, const std::vector<int>& moving) {
  std::array<int, 3> signs{0, 0, 0};
  int first = series.look(0).target, last = first;
  for (std::size_t i = 1; i < series.looks.size(); ++i) {
    first = std::min(first, series.look(i).target);
    last = std::max(last, series.look(i).target);
  }
  for (const int joint : moving) {
    const char name = series.readings.nominal.joints()[std::size_t(joint)].name;
    if (name < 'X' || name > 'Z') return std::nullopt;
    double from = 0.0, to = 0.0;
    for (std::size_t i = 0; i < series.looks.size(); ++i) {
      if (series.look(i).target == first) from = series.look(i).state.q[joint];
      if (series.look(i).target == last) to = series.look(i).state.q[joint];
    }
    signs[std::size_t(name - 'X')] = to > from ? 1 : -1;
  }
  return signs;
}

bool goes_along_its_beam(const Series& series) {
  const Vector3d& beam = series.sensor().direction_in;
  const Vector3d start = place_w(series, series.look(0).state.q);
  for (std::size_t i = 1; i < series.looks.size(); ++i) {
    const Vector3d way = place_w(series, series.look(i).state.q) - start;
    if ((way - way.dot(beam) * beam).norm() > 1e-6 * (1 + way.norm())) return false;
  }
  return true;
}

}  // namespace

std::optional<DiagonalTest> diagonal_test(const Series& series, const std::vector<int>& moving) {
  if (series.sensor().quantity != Quantity::Displacement) return std::nullopt;
  const auto signs = signs_of(series, moving);
  if (!signs || !goes_along_its_beam(series)) return std::nullopt;
  const int leading = moving.front();
  const int sign =
      (*signs)[std::size_t(series.readings.nominal.joints()[std::size_t(leading)].name - 'X')];
  Eigen::VectorXd along(Index(series.looks.size()));
  std::vector<bool> from_below;
  for (std::size_t i = 0; i < series.looks.size(); ++i) {
    const Bodies nominal = nominal_at(series, i);
    along[Index(i)] = reading(series.optics(), series.channel, {}, nominal, nominal);
    from_below.push_back(sign * series.look(i).state.direction[std::size_t(leading)] >= 0);
  }
  auto runs = runs_of(series, along, from_below);
  if (!runs) return std::nullopt;
  const double zero = runs->up.cols() > 0 ? runs->up.row(0).mean() : runs->down.row(0).mean();
  runs->up.array() -= zero;
  runs->down.array() -= zero;
  return DiagonalTest{series.name(), {*signs, std::move(*runs)}};
}

}  // namespace abbe::errors::metrology
