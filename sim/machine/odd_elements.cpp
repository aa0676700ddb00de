#include "sim/machine/odd_elements.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim {
namespace {

using kinematics::AxisVector;

/// The largest value of an element, mm or rad, and where its axis then stands.
struct Largest {
  double value = 0.0;
  double at = 0.0;  // mm or rad
};

double value_at(const errors::GeometricModel& model, const errors::GeometricModel::Bound& bound,
                const AxisVector& q) {
  kinematics::AxisState state;
  state.q = q;
  state.direction.fill(1);
  const errors::CurveState at = errors::curve_state(model, state, bound.joint);
  double sum = 0.0;
  for (const errors::Curve& curve : bound.element.curves) sum += errors::value(curve, at);
  return sum;
}

Largest largest_of(const errors::GeometricModel& model, const errors::GeometricModel::Bound& bound,
                   const AxisVector& least, const AxisVector& most) {
  constexpr int places = 129;
  Largest largest;
  for (int i = 0; i < places; ++i) {
    const AxisVector q = least + (double(i) / (places - 1)) * (most - least);
    try {
      const double value = value_at(model, bound, q);
      if (std::abs(value) > std::abs(largest.value)) largest = {value, q[bound.joint]};
    } catch (const std::out_of_range&) {
      continue;  // reported where the table is left
    }
  }
  return largest;
}

bool is_of_slide(const errors::ElementName& name) {
  return !name.location && std::string_view("XYZUVW").find(name.axis) != std::string_view::npos;
}

std::string place_text(const errors::ElementName& name, const Largest& largest) {
  if (name.location) return "";
  const double unit = is_of_slide(name) ? 1.0 : units::deg;
  return fmt::format(" at {} = {:.4g} {}", name.axis, largest.at / unit,
                     is_of_slide(name) ? "mm" : "deg");
}

}  // namespace

std::vector<std::string> odd_elements(const errors::GeometricModel& model, const AxisVector& least,
                                      const AxisVector& most) {
  constexpr double large_mm = 1.0, large_rad = 0.01, small_mm = 1e-5, small_rad = 1e-8;
  std::vector<std::string> found;
  for (const auto& bound : model.elements) {
    const errors::ElementName& name = bound.element.name;
    const Largest largest = largest_of(model, bound, least, most);
    const double size = std::abs(largest.value);
    const char* word = name.is_angle() ? "urad" : "um";
    const double unit = name.is_angle() ? units::urad : units::um;
    const std::string key = errors::to_string(name);
    if (size >= (name.is_angle() ? large_rad : large_mm))
      found.push_back(
          fmt::format("errors.{} is {:.4g} {}{}, and no machine is that wrong: numbers of {}_{} "
                      "are in {}, {:.4g} "
                      "of them here",
                      key, largest.value / (unit * 1e3), name.is_angle() ? "mrad" : "mm",
                      place_text(name, largest), key, word, word, largest.value / unit));
    else if (is_of_slide(name) && size > 0.0 && size <= (name.is_angle() ? small_rad : small_mm))
      found.push_back(
          fmt::format("errors.{} is at most {:.4g} {}, and no slide is that good: numbers of {}_{} "
                      "are in {}, not "
                      "in {}",
                      key, size / unit, word, key, word, word, name.is_angle() ? "rad" : "mm"));
  }
  return found;
}

}  // namespace abbe::sim
