#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "errors/geometric.h"
#include "sim/compensation/correct.h"
#include "tests/kinematics/machines.h"

/// What the tests of the strategies believe of a machine.
namespace abbe::sim::compensation {

/// Every element that a chain can have, of the size and shape of a typical machine: slides have
/// Legendre series of five or six terms and the screw's pitch, rotary axes three orders of a turn;
/// squarenesses, parallelisms, places of the rotary axes and the spindle are constants. On the
/// gantry these are the 42 of Guo 2016 and four offsets.
inline errors::GeometricErrors typical_errors(const kinematics::Chain& chain, std::uint64_t seed,
                                              double scale = 1.0) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto series = [&](Eigen::Index n, double size) {
    return Eigen::VectorXd(Eigen::VectorXd::NullaryExpr(n, [&] { return size * unit(random); }));
  };
  errors::GeometricErrors all;
  const auto add = [&](const std::string& name, auto... shapes) {
    errors::Element element{errors::parse_element_name(name), {}};
    (element.curves.push_back({shapes, {}, {}, {}, scale}), ...);
    all.elements.push_back(element);
  };
  const auto along = [](char direction, const kinematics::Joint& joint) {
    return std::abs(joint.direction_b[(direction - (direction < 'X' ? 'A' : 'X'))]) > 0.999;
  };
  for (const kinematics::Joint& joint : chain.joints())
    for (const char direction : std::string("XYZABC")) {
      const std::string name = std::string("E") + direction + joint.name;
      const bool angle = direction < 'X';
      if (joint.motion == kinematics::Motion::Spindle) {
        if (direction != 'C')
          add(name.substr(0, 2) + 'S', errors::Constant{(angle ? 15e-6 : 5e-3) * unit(random)});
      } else if (joint.motion == kinematics::Motion::Rotary) {
        if (joint.name == 'S' && angle && along(direction, joint)) continue;
        const double size = angle ? 8e-6 : 1.5e-3;
        add(name, errors::Fourier{series(3, size), series(3, size), 2.0 * pi});
      } else if (direction == joint.name) {
        add(name, errors::Legendre{series(5, 5e-3), 0.0, 350.0},
            errors::Fourier{series(2, 0.5e-3), series(2, 0.5e-3), 16.0});
      } else {
        add(name, errors::Legendre{series(angle ? 5 : 6, angle ? 10e-6 : 3e-3), 0.0, 350.0});
      }
    }
  const std::pair<const char*, char> squarenesses[] = {{"EC0Y", 'X'}, {"EB0Z", 'X'}, {"EA0Z", 'Y'}};
  for (const auto& [name, reference] : squarenesses)
    if (chain.find(name[3]) && chain.find(reference))
      add(name, errors::Constant{30e-6 * unit(random)});
  for (const kinematics::Joint& joint : chain.joints()) {
    if (joint.motion != kinematics::Motion::Rotary) continue;
    for (const char direction : std::string("ABCXYZ")) {
      const bool angle = direction < 'X';
      if (along(direction, joint)) continue;
      add(std::string("E") + direction + '0' + joint.name,
          errors::Constant{(angle ? 30e-6 : 15e-3) * unit(random)});
    }
  }
  return all;
}

/// Belief of a machine with these errors. The chain must outlive it.
inline Belief believed(const kinematics::Chain& chain, const errors::GeometricModel& model) {
  return [&chain, model](const kinematics::AxisState& state) {
    return chain.tool_in_workpiece(state.q, errors::deviations(model, state));
  };
}

}  // namespace abbe::sim::compensation
