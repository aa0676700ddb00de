#include "sim/readings/belief_file.h"

#include <cmath>
#include <iterator>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/coefficients.h"
#include "kinematics/units.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {
namespace {

using Eigen::VectorXd;
using errors::Curve;
using errors::Element;
using kinematics::Joint;

/// Units of the values and positions of an element in the file.
struct Units {
  double value = units::um;
  const char* value_unit = "um";
  double position = 1.0;
  const char* position_unit = "mm";
};

/// Returns um and mm, with urad for an angle and deg for the positions of a rotary axis.
Units element_units(const errors::ElementName& name, const std::vector<Joint>& joints) {
  Units result;
  if (name.is_angle()) {
    result.value = units::urad;
    result.value_unit = "urad";
  }
  for (const Joint& joint : joints) {
    const bool is_axis_of_element =
        joint.name == name.axis || (joint.name == 's' && name.axis == 'S');
    if (is_axis_of_element && joint.motion != kinematics::Motion::Linear) {
      result.position = units::deg;
      result.position_unit = "deg";
    }
  }
  return result;
}

std::string to_toml_array(const VectorXd& numbers, double unit) {
  std::string text;
  for (const double x : numbers) text += fmt::format("{}{}", text.empty() ? "" : ", ", x / unit);
  return "[" + text + "]";
}

/// Writes the keys of a curve's shape.
class ShapeKeys {
 public:
  ShapeKeys(std::string& text, const Units& unit) : text_(text), unit_(unit) {}

  void operator()(const errors::Constant& shape) {
    kind("constant");
    value("value", shape.value);
  }
  void operator()(const errors::Polynomial& shape) { series("polynomial", shape); }
  void operator()(const errors::Legendre& shape) { series("legendre", shape); }
  void operator()(const errors::Fourier& shape) {
    kind("fourier");
    position("period", shape.period);
    values("a", shape.a);
    values("b", shape.b);
  }
  void operator()(const errors::Table& shape) {
    kind("table");
    rows(shape);
  }
  void operator()(const errors::Backlash& shape) {
    kind("backlash");
    value("half", shape.half);
  }
  void operator()(const errors::DirectionalTables& shape) {
    kind("up_down");
    // The tables of both directions are written as inline tables, so that each curve remains a
    // single TOML table.
    const std::string outer = std::exchange(text_, {});
    rows(shape.up);
    const std::string up = std::exchange(text_, {});
    rows(shape.down);
    const std::string down = std::exchange(text_, outer);
    text_ += "up = { " + to_single_line(up) + " }\ndown = { " + to_single_line(down) + " }\n";
  }
  void operator()(const errors::Repeatability&) { refuse(); }
  void operator()(const errors::Asynchronous&) { refuse(); }

 private:
  [[noreturn]] static void refuse() {
    // A random error cannot be compensated.
    throw std::invalid_argument("a belief cannot contain a random curve");
  }
  static std::string to_single_line(std::string text) {
    text.pop_back();
    for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 2)
      text.replace(at, 1, ", ");
    return text;
  }
  void line(const std::string& key, const std::string& value_text) {
    text_ += key + " = " + value_text + "\n";
  }
  void kind(const char* kind_name) { line("kind", "\"" + std::string(kind_name) + "\""); }
  void value(const std::string& key, double x) {
    line(key + "_" + unit_.value_unit, fmt::format("{}", x / unit_.value));
  }
  void values(const std::string& key, const VectorXd& x) {
    line(key + "_" + unit_.value_unit, to_toml_array(x, unit_.value));
  }
  void position(const std::string& key, double x) {
    line(key + "_" + unit_.position_unit, fmt::format("{}", x / unit_.position));
  }
  template <typename Series>
  void series(const char* kind_name, const Series& shape) {
    kind(kind_name);
    values("coefficients", shape.c);
    position("centre", shape.centre);
    position("half_range", shape.half_range);
  }
  void rows(const errors::Table& shape) {
    line(std::string("q_") + unit_.position_unit, to_toml_array(shape.q, unit_.position));
    values("value", shape.value);
    // Defaults are not written.
    if (shape.between == errors::TableInterpolation::Spline) line("between", "\"spline\"");
    if (shape.outside == errors::TableExtrapolation::Hold) line("outside", "\"hold\"");
  }

  std::string& text_;
  const Units& unit_;
};

void write_curve(std::string& text, const Element& element, const Curve& curve, const Units& unit) {
  text += "\n[[" + to_string(element.name) + "]]\n";
  if (!curve.name.empty()) text += "name = " + to_toml_value(curve.name) + "\n";
  std::visit(ShapeKeys(text, unit), curve.shape);
  if (curve.argument == errors::Argument::Carriage) text += "argument = \"carriage\"\n";
  if (curve.negate) text += "negate = true\n";
  if (curve.scale != 1.0) text += fmt::format("scale = {}\n", curve.scale);
}

/// Writes standard uncertainties and correlations, if the belief has a covariance.
void write_covariance(std::string& text, const errors::GeometricErrors& belief) {
  const errors::Covariance& covariance = belief.covariance;
  const auto count = Eigen::Index(covariance.of.size());
  if (count == 0) return;
  // Rounding may leave a tiny negative variance.
  const VectorXd sigma = covariance.matrix.diagonal().cwiseMax(0.0).cwiseSqrt();
  text +=
      "\n# standard uncertainties in um and urad; correlation: lower triangle row by row\n"
      "[covariance]\nof = [";
  std::string uncertainties, correlation;
  for (Eigen::Index i = 0; i < count; ++i) {
    const errors::Coefficient& number = covariance.of[std::size_t(i)];
    const bool is_angle = belief.elements[std::size_t(number.element)].name.is_angle();
    text += (i ? ", " : "") + to_toml_value(errors::name_of(number, belief.elements));
    // Correlations have no units, unlike covariances between um and urad.
    uncertainties +=
        fmt::format("{}{}", i ? ", " : "", sigma[i] / (is_angle ? units::urad : units::um));
    for (Eigen::Index k = 0; k < i; ++k) {
      const double sigma_product = sigma[i] * sigma[k];
      const double r = sigma_product > 0.0 ? covariance.matrix(i, k) / sigma_product : 0.0;
      correlation += fmt::format("{}{}", correlation.empty() ? "" : ", ", r);
    }
  }
  text += "]\nstandard_uncertainty_um_urad = [" + uncertainties + "]\n";
  if (count > 1) text += "correlation = [" + correlation + "]\n";
}

}  // namespace

std::string errors_file_text(const errors::GeometricErrors& belief,
                             const std::vector<Joint>& joints,
                             const std::vector<std::string>& comments) {
  std::string text;
  for (const std::string& comment : comments) text += "# " + comment + "\n";
  for (const Element& element : belief.elements) {
    const Units unit = element_units(element.name, joints);
    for (const Curve& curve : element.curves) write_curve(text, element, curve, unit);
  }
  for (const errors::MeasuringLine& line : belief.measuring_lines)
    text += fmt::format("\n[measured.{}]\nat_mm = [{}, {}, {}]\nby = \"{}\"\n", line.axis,
                        line.at_b.x(), line.at_b.y(), line.at_b.z(),
                        line.by == errors::MeasuredBy::Tool ? "tool" : "carriage");
  write_covariance(text, belief);
  return text;
}

}  // namespace abbe::sim
