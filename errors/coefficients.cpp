#include "errors/coefficients.h"

#include <stdexcept>
#include <type_traits>
#include <variant>

#include <fmt/format.h>

namespace abbe::errors {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Appends pointers to the numbers of a vector; `Vector` is VectorXd or const VectorXd.
template <typename Number, typename Vector>
void append(std::vector<Number*>& pointers, Vector& numbers) {
  for (Index i = 0; i < numbers.size(); ++i) pointers.push_back(&numbers[i]);
}

// Returns pointers to the numbers of a shape in their fixed order. Reading and writing share this
// function, so that their orders cannot differ.
template <typename SomeShape>
auto number_pointers(SomeShape& shape) {
  using Number = std::conditional_t<std::is_const_v<SomeShape>, const double, double>;
  std::vector<Number*> result;
  std::visit(
      [&](auto& s) {
        using S = std::remove_const_t<std::remove_reference_t<decltype(s)>>;
        if constexpr (std::is_same_v<S, Constant>) {
          result.push_back(&s.value);
        } else if constexpr (std::is_same_v<S, Polynomial> || std::is_same_v<S, Legendre>) {
          append(result, s.c);
        } else if constexpr (std::is_same_v<S, Fourier>) {
          append(result, s.a);
          append(result, s.b);
        } else if constexpr (std::is_same_v<S, Backlash>) {
          result.push_back(&s.half);
        } else if constexpr (std::is_same_v<S, Table>) {
          append(result, s.value);
        } else if constexpr (std::is_same_v<S, DirectionalTables>) {
          append(result, s.up.value);
          append(result, s.down.value);
        }
      },
      shape);
  return result;
}

/// Recomputes the second derivatives of a spline after its values have changed.
void update_spline(Table& table) {
  if (table.between == TableInterpolation::Spline)
    table = make_table(table.q, table.value, table.between, table.outside);
}

void update_spline(Shape& shape) {
  if (auto* table = std::get_if<Table>(&shape)) update_spline(*table);
  if (auto* tables = std::get_if<DirectionalTables>(&shape)) {
    update_spline(tables->up);
    update_spline(tables->down);
  }
}

/// Returns the part of a coefficient's name that identifies the number within its shape.
std::string number_name(const Shape& shape, int number) {
  if (std::holds_alternative<Constant>(shape)) return "";
  if (std::holds_alternative<Backlash>(shape)) return " backlash";
  if (const auto* fourier = std::get_if<Fourier>(&shape)) {
    const int n = int(fourier->a.size());
    return number < n ? fmt::format(" cos {}", number + 1) : fmt::format(" sin {}", number - n + 1);
  }
  if (const auto* tables = std::get_if<DirectionalTables>(&shape)) {
    const int n = int(tables->up.value.size());
    return number < n ? fmt::format(" up[{}]", number) : fmt::format(" down[{}]", number - n);
  }
  return fmt::format("[{}]", number);
}

/// Returns the name of a curve: the element and, among several curves, the curve.
std::string curve_name(const Element& element, std::size_t curve, bool has_number) {
  std::string name = to_string(element.name);
  const Curve& c = element.curves[curve];
  if (element.curves.size() > 1 && !c.name.empty()) name += " " + c.name;
  if (has_number) name += fmt::format(" #{}", curve + 1);
  return name;
}

// Returns true if two numbers of an element have the same name, as those of two unnamed curves do;
// then the names contain the number of the curve.
bool has_namesakes(const Element& element) {
  std::vector<std::string> names;
  for (std::size_t c = 0; c < element.curves.size(); ++c)
    for (int k = 0; k < int(number_pointers(element.curves[c].shape).size()); ++k)
      names.push_back(curve_name(element, c, false) + number_name(element.curves[c].shape, k));
  for (std::size_t i = 0; i < names.size(); ++i)
    for (std::size_t k = 0; k < i; ++k)
      if (names[i] == names[k]) return true;
  return false;
}

}  // namespace

std::vector<Coefficient> coefficients(const std::vector<Element>& elements) {
  std::vector<Coefficient> result;
  for (std::size_t e = 0; e < elements.size(); ++e)
    for (std::size_t c = 0; c < elements[e].curves.size(); ++c) {
      const int count = int(number_pointers(elements[e].curves[c].shape).size());
      for (int k = 0; k < count; ++k) result.push_back({int(e), int(c), k});
    }
  return result;
}

std::string name_of(const Coefficient& coefficient, const std::vector<Element>& elements) {
  const Element& element = elements.at(std::size_t(coefficient.element));
  const auto curve = std::size_t(coefficient.curve);
  return curve_name(element, curve, has_namesakes(element)) +
         number_name(element.curves.at(curve).shape, coefficient.number);
}

VectorXd values(const std::vector<Element>& elements) {
  std::vector<double> result;
  for (const Element& element : elements)
    for (const Curve& curve : element.curves)
      for (const double* number : number_pointers(curve.shape)) result.push_back(*number);
  return VectorXd::Map(result.data(), Index(result.size()));
}

std::vector<Element> with_values(std::vector<Element> elements, const VectorXd& values) {
  const auto count = Index(coefficients(elements).size());
  if (values.size() != count)
    throw std::invalid_argument(
        fmt::format("expected {} values, one per coefficient, seen {}", count, values.size()));
  Index index = 0;
  for (Element& element : elements)
    for (Curve& curve : element.curves) {
      for (double* number : number_pointers(curve.shape)) *number = values[index++];
      update_spline(curve.shape);
    }
  return elements;
}

// Shapes are linear in their numbers, so the factor of a number is the value of the curve with that
// number at 1 and all others at 0.
VectorXd basis(const Curve& curve, const CurveState& state) {
  Curve unit_curve = curve;
  for (double* number : number_pointers(unit_curve.shape)) *number = 0.0;
  const std::size_t count = number_pointers(unit_curve.shape).size();
  VectorXd result(static_cast<Index>(count));
  for (std::size_t k = 0; k < count; ++k) {
    *number_pointers(unit_curve.shape)[k] = 1.0;
    update_spline(unit_curve.shape);  // moves the numbers of a table, so the pointers are obsolete
    result[Index(k)] = value(unit_curve, state);
    *number_pointers(unit_curve.shape)[k] = 0.0;
  }
  return result;
}

}  // namespace abbe::errors
