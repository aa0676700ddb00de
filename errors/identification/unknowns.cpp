#include "errors/identification/unknowns.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

namespace abbe::errors::identification {

using Eigen::Index;
using Eigen::VectorXd;
using metrology::Readings;

namespace {

std::string owner(std::span<const Readings> readings, std::size_t r) {
  const std::string& name = readings[r].plan.instrument;
  const auto namesakes =
      std::count_if(readings.begin(), readings.end(),
                    [&](const Readings& other) { return other.plan.instrument == name; });
  return namesakes > 1 ? fmt::format("{} (readings {})", name, r + 1) : name;
}

}  // namespace

Unknowns unknowns_of(const GeometricErrors& model, std::span<const Readings> readings) {
  Unknowns result;
  result.coefficients = coefficients(model.elements);
  for (const Coefficient& coefficient : result.coefficients)
    result.names.push_back(name_of(coefficient, model.elements));
  for (std::size_t r = 0; r < readings.size(); ++r) {
    const auto& list = readings[r].plan.set_ups;
    for (std::size_t s = 0; s < list.size(); ++s) {
      const std::vector<metrology::SetUpUnknown> unknowns = metrology::unknowns(list[s]);
      result.set_ups.push_back({int(r), int(s), result.size(), int(unknowns.size())});
      for (const metrology::SetUpUnknown& unknown : unknowns)
        result.names.push_back(
            fmt::format("{}, {}: {}", owner(readings, r), list[s].name, unknown.name));
    }
  }
  return result;
}

const Unknowns::SetUp& place_of(const Unknowns& unknowns, int readings, int set_up) {
  for (const Unknowns::SetUp& place : unknowns.set_ups)
    if (place.readings == readings && place.set_up == set_up) return place;
  throw std::logic_error("a set-up without a place");
}

VectorXd start(const GeometricErrors& model, const Unknowns& unknowns) {
  VectorXd x = VectorXd::Zero(unknowns.size());
  x.head(Index(unknowns.coefficients.size())) = values(model.elements);
  return x;
}

std::vector<metrology::Misalignment> set_ups(std::span<const Readings> readings,
                                             const Unknowns& unknowns, const VectorXd& values) {
  std::vector<metrology::Misalignment> result;
  for (const Unknowns::SetUp& place : unknowns.set_ups)
    result.push_back(metrology::misalignment(
        readings[std::size_t(place.readings)].plan.set_ups[std::size_t(place.set_up)],
        values.segment(place.first, place.count)));
  return result;
}

}  // namespace abbe::errors::identification
