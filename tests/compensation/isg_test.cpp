#include <iostream>
#include <stdexcept>

#include <gtest/gtest.h>

#include "errors/element.h"
#include "errors/geometric.h"
#include "kinematics/units.h"
#include "sim/compensation/control_files.h"
#include "tests/compensation/control_cases.h"

namespace abbe::sim::compensation {
namespace {

using namespace cases;
using errors::Constant;
using errors::Element;
using errors::GeometricErrors;

GeometricErrors volumetric_errors(const std::string& text) {
  return read_volumetric_deviations(std::vector<ControlFile>{{"X.csv", text}}, gantry());
}

// laid out as the examples of the manual
const std::string example =
    "// component errors of X\n"
    "X      EXX    EYX    EZX    EAX    EBX    ECX\n"
    "0.0    0.02   0.01   0.07   0.00   0.0042 0.003\n"
    "10.0   0.00   -0.1   0.01   0.00   0.0011 0.002  // the last row\n"
    "# another head\n"
    "\n"
    "C0Y    A0Z    X0C\n"
    "0.1    0      0.11\n";

double value(const GeometricErrors& errors, const std::string& name, double command) {
  for (const Element& element : errors.elements)
    if (to_string(element.name) == name) {
      errors::CurveState state;
      state.command = command;
      return errors::value(element.curves.at(0), state);
    }
  throw std::runtime_error("no element " + name);
}

TEST(Isg, ComponentAndPositionErrorsAreRead) {
  const GeometricErrors errors = volumetric_errors(example);
  ASSERT_EQ(errors.elements.size(), 8u) << "a position error of zero says nothing";
  EXPECT_EQ(value(errors, "EYX", 10.0), -0.1);
  EXPECT_DOUBLE_EQ(value(errors, "EBX", 5.0), 0.5 * (0.0042 + 0.0011));
  EXPECT_EQ(value(errors, "EXX", -50.0), 0.02) << "constant outside";
  EXPECT_EQ(value(errors, "EC0Y", 0.0), 0.1);
  EXPECT_EQ(value(errors, "EX0C", 0.0), 0.11);
  EXPECT_NO_THROW(errors::bind(errors, gantry()));
}

TEST(Isg, RotaryArgumentsAreDegrees) {
  const GeometricErrors errors = volumetric_errors("A EAA\n0 1e-5\n90 3e-5\n");
  EXPECT_DOUBLE_EQ(value(errors, "EAA", 0.25 * pi), 2e-5);
}

GeometricErrors believed_waves() {
  const auto wave = [](double amplitude, double period) {
    return errors::Curve{errors::Fourier{Eigen::VectorXd::Constant(1, amplitude),
                                         Eigen::VectorXd::Constant(1, -0.4 * amplitude), period}};
  };
  const auto element = [](const char* name, std::vector<errors::Curve> curves) {
    return Element{errors::parse_element_name(name), std::move(curves)};
  };
  GeometricErrors errors;
  errors.elements = {element("EXX", {wave(8e-3, 300), {Constant{2e-3}}}),
                     element("EZX", {wave(3e-3, 500)}),
                     element("EBX", {wave(20e-6, 400)}),
                     element("EZY", {wave(5e-3, 450)}),
                     element("EAA", {wave(30e-6, 5.0)}),
                     element("EC0Y", {{Constant{40e-6}}}),
                     element("EB0C", {{Constant{-15e-6}}}),
                     element("EY0C", {{Constant{7e-3}}})};
  errors.measuring_lines = {{'X', {0, 100, 200}, errors::MeasuredBy::Tool}};
  return errors;
}

TEST(Isg, WhatIsBelievedComesBackAtItsPoints) {
  const Chain chain = gantry();
  const errors::GeometricModel model = errors::bind(believed_waves(), chain);
  TableOptions options;
  options.spacing = 10.0;
  const ControlExport made = to_volumetric(model, chain, options);
  EXPECT_TRUE(made.omissions.empty());
  EXPECT_EQ(made.files.size(), 4u) << "X Y A and the position errors; Z and C have nothing";
  EXPECT_EQ(file(made, "position_errors.csv").text,
            "// mm and rad\nY0C\tB0C\tC0Y\n0.007\t-1.5e-05\t4e-05\n");
  EXPECT_TRUE(file(made, "A.csv")
                  .text.starts_with("// mm and rad over deg\nA\tEXA\tEYA\tEZA\tEAA\tEBA\tECA\n-"));
  const errors::GeometricModel back =
      errors::bind(read_volumetric_deviations(made.files, chain), chain);
  double at_points = 0.0, between = 0.0;
  for (int k = 0; k <= 600; ++k) {
    AxisState state;
    state.q = AxisVector::Zero(6);
    state.q[X] = -300.0 + k;
    state.q[Y] = -200.0 + 450.0 * k / 600.0;
    const bool is_point = k % 10 == 0;
    const auto one = errors::deviations(model, state), two = errors::deviations(back, state);
    const double d = (one[X].motion - two[X].motion).cwiseAbs().maxCoeff();
    (is_point ? at_points : between) = std::max(is_point ? at_points : between, d);
    for (int i = 0; i < chain.size(); ++i)
      EXPECT_EQ(one[std::size_t(i)].location, two[std::size_t(i)].location);
  }
  const double bend = 8e-3 * std::hypot(1.0, 0.4) * std::pow(2.0 * pi / 300.0, 2) +
                      401.0 * 20e-6 * std::hypot(1.0, 0.4) * std::pow(2.0 * pi / 400.0, 2);
  std::cout << at_points << " mm at points, " << between << " mm between, bound "
            << 100.0 / 8.0 * bend << " mm\n";
  EXPECT_EQ(at_points, 0.0) << "every bit is written";
  EXPECT_LE(between, 100.0 / 8.0 * bend);
}

TEST(Isg, SaysWhatItCannotHold) {
  const Chain chain = gantry();
  GeometricErrors errors = believed_waves();
  errors.elements[1].curves.push_back({errors::Backlash{1e-3}});
  errors.elements[3].curves.push_back({errors::Repeatability{1e-3, 5}});
  errors.elements.push_back({errors::parse_element_name("EXS"), {{Constant{1e-3}}}});
  const ControlExport made = to_volumetric(errors::bind(errors, chain), chain);
  for (const std::string& sentence : made.omissions) std::cout << sentence << "\n";
  EXPECT_TRUE(says(made.omissions, "X: dependence on direction"));
  EXPECT_TRUE(says(made.omissions, "EZY: its random part"));
  EXPECT_TRUE(says(made.omissions, "EXS: not an axis of the format"));
  EXPECT_EQ(made.omissions.size(), 3u);
}

TEST(Isg, HoldsDeviationsAndNoCorrections) {
  EXPECT_THROW(to_control(none(), gantry(), ControlFormat::Isg), std::invalid_argument);
  EXPECT_THROW(read_control_tables({}, gantry(), ControlFormat::Isg), std::invalid_argument);
}

TEST(Isg, RefusesByLineAndColumn) {
  const auto at = [](const std::string& from, const std::string& to) {
    return refusal([&] { volumetric_errors(with(example, from, to)); });
  };
  EXPECT_EQ(at("X ", "X "), Place{});
  EXPECT_EQ(at("X      EXX", "Z      X"), (Place{2, 8})) << "two arguments";
  EXPECT_EQ(at("X      EXX", "B      EXX"), (Place{2, 8}));
  EXPECT_EQ(at("X      EXX    EYX    EZX    EAX    EBX    ECX",
               "B      EXB    EYB    EZB    EAB    EBB    ECB"),
            (Place{2, 1}));
  EXPECT_EQ(at("-0.1", "-0.1.1"), (Place{4, 15}));
  EXPECT_EQ(at("10.0", "0.0"), (Place{4, 1}));
  EXPECT_EQ(at("0.002", "     "), (Place{4, 50}));
  EXPECT_EQ(at("C0Y    A0Z", "C0Y    EAZ"), (Place{7, 8}));
  EXPECT_EQ(at("C0Y    A0Z", "C0Y    C0Y"), Place{}) << "the second is zero";
  EXPECT_EQ(at("X0C", "C0Y"), (Place{8, 15}));
  EXPECT_EQ(at("X0C", "C0C"), (Place{8, 15})) << "an axis has no squareness about itself";
  EXPECT_EQ(at("X0C", "X0B"), (Place{7, 15}));
  EXPECT_EQ(at("0.1    0      0.11\n", "0.1    0\n"), (Place{8, 1}));
  EXPECT_EQ(at("0.1    0      0.11\n", "").line, 7);
  EXPECT_EQ(at("0.11\n", "0.11\n1 2 3\n"), (Place{9, 1}));
  EXPECT_EQ(at("// the last row\n", "\n#\nX EYX\n0 0\n1 0\n"), (Place{6, 1})) << "EYX twice";
  std::string heads;
  for (int k = 0; k < 100; ++k) heads += "#\n";
  EXPECT_EQ(refusal([&] { volumetric_errors(heads); }), (Place{64, 1}));
  EXPECT_TRUE(volumetric_errors("").elements.empty());
  EXPECT_TRUE(volumetric_errors("\xEF\xBB\xBF\xEF\xBB\xBF// nothing\n").elements.empty());
}

}  // namespace
}  // namespace abbe::sim::compensation
