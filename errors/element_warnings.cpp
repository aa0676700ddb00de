#include "errors/element_warnings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::errors {
namespace {

using kinematics::AxisVector;

/// The largest value of an element, mm or rad, and where its axis then stands.
struct Largest {
  double value = 0.0;
  double at = 0.0;  // mm or rad
};

double value_at(const GeometricModel& model, const GeometricModel::Bound& bound,
                const AxisVector& q) {
  kinematics::AxisState state;
  state.q = q;
  state.direction.fill(1);
  const CurveState at = curve_state(model, state, bound.joint);
  double sum = 0.0;
  for (const Curve& curve : bound.element.curves) sum += value(curve, at);
  return sum;
}

Largest largest_of(const GeometricModel& model, const GeometricModel::Bound& bound,
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

bool is_of_slide(const ElementName& name) {
  return !name.location && std::string_view("XYZUVW").find(name.axis) != std::string_view::npos;
}

/// Returns how far from its middle a position lies, in half ranges of a curve that has one; else 0.
double half_ranges(const Curve& curve, double q) {
  // a half range of 1 or 10 mm is none: the polynomial is one of mm or cm, as papers print it
  const auto* polynomial = std::get_if<Polynomial>(&curve.shape);
  if (polynomial && polynomial->half_range != 1.0 && polynomial->half_range != 10.0)
    return std::abs(q - polynomial->centre) / polynomial->half_range;
  if (const auto* legendre = std::get_if<Legendre>(&curve.shape))
    return std::abs(q - legendre->centre) / legendre->half_range;
  return 0.0;
}

/// Returns how far beyond the ends of a table that holds its last value a position lies, in lengths
/// of the table; 0 within it.
double lengths_beyond(const Table& table, double q) {
  if (table.outside != Outside::Hold) return 0.0;
  const double low = table.q[0], high = table.q[table.q.size() - 1];
  return std::max({0.0, low - q, q - high}) / (high - low);
}

double lengths_beyond(const Curve& curve, double q) {
  if (const auto* table = std::get_if<Table>(&curve.shape)) return lengths_beyond(*table, q);
  if (const auto* both = std::get_if<UpDown>(&curve.shape))
    return std::max(lengths_beyond(both->up, q), lengths_beyond(both->down, q));
  return 0.0;
}

double argument_of(const Curve& curve, const CurveState& at) {
  return curve.argument == Argument::Command ? at.command : at.carriage;
}

/// "EXX 3.33, EYX 2" of the elements whose curves are followed beyond a limit at either end.
/// @param beyond  (curve, position) of a curve
template <typename Beyond>
std::string elements_beyond(const GeometricModel& model,
                            const std::array<const AxisVector*, 2>& ends, double limit,
                            const Beyond& beyond) {
  std::string text;
  for (const auto& bound : model.elements) {
    double farthest = 0.0;
    for (const AxisVector* q : ends) {
      kinematics::AxisState state;
      state.q = *q;
      const CurveState at = curve_state(model, state, bound.joint);
      for (const Curve& curve : bound.element.curves)
        farthest = std::max(farthest, beyond(curve, argument_of(curve, at)));
    }
    if (farthest > limit)
      text += fmt::format("{}{} {:.3g}", text.empty() ? "" : ", ", to_string(bound.element.name),
                          farthest);
  }
  return text;
}

/// Returns what is said of curves that are followed beyond the range that they are stated over.
std::vector<std::string> extrapolated(const GeometricModel& model, const AxisVector& least,
                                      const AxisVector& most, const std::string& section) {
  // a table that is held over half of its own length more is one of another travel, or in m
  constexpr double most_held = 0.5;
  const std::array<const AxisVector*, 2> ends{&least, &most};
  std::vector<std::string> texts;
  const std::string of = section == "errors" ? "" : section + ": ";
  const auto by_range = [](const Curve& curve, double q) { return half_ranges(curve, q); };
  if (const auto beyond = elements_beyond(model, ends, 1.0 + 1e-9, by_range); !beyond.empty())
    texts.push_back(of +
                    "curves are followed beyond the range that they are stated over, in half "
                    "ranges from its middle: " +
                    beyond);
  const auto by_table = [](const Curve& curve, double q) { return lengths_beyond(curve, q); };
  if (const auto beyond = elements_beyond(model, ends, most_held, by_table); !beyond.empty())
    texts.push_back(
        of +
        "tables hold their last value (outside = \"hold\") far beyond their range, in lengths of "
        "the table: " +
        beyond);
  return texts;
}

std::string place_text(const ElementName& name, const Largest& largest) {
  if (name.location) return "";
  const double unit = is_of_slide(name) ? 1.0 : units::deg;
  return fmt::format(" at {} = {:.4g} {}", name.axis, largest.at / unit,
                     is_of_slide(name) ? "mm" : "deg");
}

std::string oversize_text(const ElementName& name, const Largest& largest,
                          const ElementSource& source) {
  const std::string key = to_string(name);
  const char* enum_value = name.is_angle() ? "urad" : "um";
  const double unit = name.is_angle() ? units::urad : units::um;
  const std::string size =
      fmt::format("{:.4g} {}{}, and no machine is that wrong", largest.value / (unit * 1e3),
                  name.is_angle() ? "mrad" : "mm", place_text(name, largest));
  if (source.identified)
    return fmt::format(
        "{} comes to {}: readings may be in another unit, of the other sign or in another order",
        key, size);
  return fmt::format("{}.{} is {}: numbers of {}_{} are in {}, {:.4g} of them here", source.section,
                     key, size, key, enum_value, enum_value, largest.value / unit);
}

}  // namespace

std::vector<std::string> element_warnings(const GeometricModel& model, const AxisVector& least,
                                          const AxisVector& most, const ElementSource& source) {
  constexpr double large_mm = 0.25, large_rad = 2.5e-3, small_mm = 1e-5, small_rad = 1e-8;
  std::vector<std::string> warnings;
  for (const auto& bound : model.elements) {
    const ElementName& name = bound.element.name;
    const Largest largest = largest_of(model, bound, least, most);
    const double size = std::abs(largest.value);
    if (size >= (name.is_angle() ? large_rad : large_mm)) {
      warnings.push_back(oversize_text(name, largest, source));
      continue;
    }
    // a perfect machine read without noise is found right, with elements of nearly nothing
    if (source.identified || !(is_of_slide(name) || name.location)) continue;
    const char* enum_value = name.is_angle() ? "urad" : "um";
    if (size > 0.0 && size <= (name.is_angle() ? small_rad : small_mm))
      warnings.push_back(fmt::format(
          "{}.{} is at most {:.4g} {}, and no {} is that good: numbers of {}_{} "
          "are in {}, not in {}",
          source.section, to_string(name), size / (name.is_angle() ? units::urad : units::um),
          enum_value, name.location ? "machine" : "slide", to_string(name), enum_value, enum_value,
          name.is_angle() ? "rad" : "mm"));
  }
  if (!source.identified)
    for (std::string& text : extrapolated(model, least, most, source.section))
      warnings.push_back(std::move(text));
  return warnings;
}

}  // namespace abbe::errors
