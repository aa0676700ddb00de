#include "sim/compensation/parameter_tables.h"
#include "tests/compensation/control_cases.h"
#include "tests/test.h"

namespace abbe::sim::compensation {
namespace {

using namespace cases;

/// A correction of one axis over the position of one axis.
template <typename Curve>
CorrectionFunction along(int argument_joint, int corrected_joint, const Curve& curve) {
  return [=](const AxisState& state) -> AxisVector {
    AxisVector c = AxisVector::Zero(state.q.size());
    c[corrected_joint] = curve(state.q[argument_joint]);
    return c;
  };
}

/// Largest miss of tables along one axis, at 20 001 places of its travel.
double missed(const ParameterTables& tables, const CorrectionFunction& correction_at,
              const Chain& chain, int argument_joint, int corrected_joint) {
  double largest = 0.0;
  AxisState state;
  state.q = AxisVector::Zero(chain.size());
  const Joint& joint = chain.joints()[std::size_t(argument_joint)];
  for (int k = 0; k <= 20000; ++k) {
    state.q[argument_joint] = joint.min + (joint.max - joint.min) * k / 20000.0;
    largest = std::max(largest, std::abs(correction(tables, state)[corrected_joint] -
                                         correction_at(state)[corrected_joint]));
  }
  return largest;
}

TEST(ParameterTables, ATableLeavesNoMoreThanTheSquareOfItsSpacingTimesTheBendOverEight) {
  const Chain chain = gantry();
  struct Case {
    const char* name;
    int argument_joint, corrected_joint;
    double spacing, spacing_rad, amplitude, wave;  // mm or rad
  };
  for (const Case& c : {Case{"pitch of X", X, X, 5.0, 0.0873, 10e-3, 60.0},
                        Case{"straightness of Y over X", X, Y, 12.0, 0.0873, 25e-3, 400.0},
                        Case{"A over itself", A, A, 5.0, 0.05, 100e-6, 0.9},
                        Case{"Z over A", A, Z, 5.0, 0.02, 8e-3, 0.7}}) {
    const double w = 2.0 * pi / c.wave;
    const auto at = along(c.argument_joint, c.corrected_joint,
                          [&](double q) { return c.amplitude * std::sin(w * q); });
    TableOptions options;
    options.spacing = c.spacing;
    options.spacing_rad = c.spacing_rad;
    const ParameterTables tables = tabulate(at, chain, AxisVector::Zero(6), options);
    ASSERT_EQ(tables.tables.size(), 1u) << c.name;
    const double h = tables.tables[0].position[1] - tables.tables[0].position[0];
    const double bound = h * h / 8.0 * c.amplitude * w * w;
    const double left = missed(tables, at, chain, c.argument_joint, c.corrected_joint);
    std::cout << c.name << ": " << left << " left of " << bound << "\n";
    EXPECT_LE(left, bound);
    EXPECT_GT(left, 0.9 * bound) << "the bound is sharp";
  }
}

TEST(ParameterTables, AParabolaIsMissedByExactlyThat) {
  const Chain chain = gantry();
  const double bend = 2e-6;  // 1/mm
  const auto at = along(X, X, [&](double q) { return 0.5 * bend * q * q; });
  TableOptions options;
  options.spacing = 20.0;
  const ParameterTables tables = tabulate(at, chain, AxisVector::Zero(6), options);
  const double left = missed(tables, at, chain, X, X);
  std::cout << left << " mm left, h^2/8 bend " << 400.0 / 8.0 * bend << " mm\n";
  EXPECT_NEAR(left, 400.0 / 8.0 * bend, 1e-12);
}

TEST(ParameterTables, SpacingWidensWhereTooManyPointsWouldBeNeeded) {
  const Chain chain = gantry();
  TableOptions options;
  EXPECT_EQ(table_positions(chain, X, options).size(), 121);
  options.spacing = 600.0 / 255.0 * (1.0 + 1e-15);
  EXPECT_EQ(table_positions(chain, X, options).size(), 256);
  options.spacing = 1e-300;
  EXPECT_EQ(table_positions(chain, X, options).size(), 256);
  options.max_points = 2;
  EXPECT_EQ(table_positions(chain, X, options), Vector2d(-300, 300));
  options.spacing = std::numeric_limits<double>::infinity();
  EXPECT_EQ(table_positions(chain, X, options).size(), 2);
}

TEST(ParameterTables, TheNoseAndAnAxisWithoutEndAreNotTabulated) {
  const Chain chain = gantry();
  const CorrectionFunction everywhere = [](const AxisState& state) -> AxisVector {
    return AxisVector::Constant(state.q.size(), 1e-3 * (1.0 + state.q.sum()));
  };
  const ParameterTables tables = tabulate(everywhere, chain, AxisVector::Zero(6));
  EXPECT_EQ(tables.tables.size(), 16u);
  for (const AxisTable& table : tables.tables)
    for (const int joint : {table.argument_joint, table.corrected_joint})
      EXPECT_TRUE(joint != C && joint != s);
  EXPECT_EQ(tables.offset[C], 0.0);
  EXPECT_EQ(tables.offset[s], 0.0);
  EXPECT_EQ(tables.offset[X], 1e-3);
}

TEST(ParameterTables, ARangeStandsForTheTravel) {
  const Chain chain = gantry();
  TableOptions options;
  options.range.emplace().setZero();
  options.range->col(C) << 0.0, 2.0 * pi;
  options.range->col(X) << -10.0, 10.0;
  const CorrectionFunction everywhere = [](const AxisState& state) -> AxisVector {
    return AxisVector::Constant(state.q.size(), 1e-3 * state.q.sum());
  };
  const ParameterTables tables = tabulate(everywhere, chain, AxisVector::Zero(6), options);
  EXPECT_EQ(tables.tables.size(), 10u) << "C and X are looked up, C X Y Z A corrected";
  for (const AxisTable& table : tables.tables) {
    EXPECT_TRUE(table.argument_joint == C || table.argument_joint == X);
    EXPECT_NE(table.corrected_joint, s);
    EXPECT_EQ(table.position[0], table.argument_joint == C ? 0.0 : -10.0);
    EXPECT_EQ(table.position[table.position.size() - 1],
              table.argument_joint == C ? 2.0 * pi : 10.0);
  }
}

TEST(ParameterTables, BacklashHasAColumnEachWay) {
  const Chain chain = gantry();
  const CorrectionFunction backlash = [](const AxisState& state) -> AxisVector {
    AxisVector c = AxisVector::Zero(state.q.size());
    c[X] = 3e-3 * state.direction[X] + 1e-5 * state.q[X];
    c[Y] = 1e-3 * state.direction[X];
    EXPECT_EQ(state.stroke[X], 0);
    return c;
  };
  TableOptions options;
  const ParameterTables tables = tabulate(backlash, chain, AxisVector::Zero(6), options);
  ASSERT_EQ(tables.tables.size(), 2u);
  AxisState state;
  state.q = AxisVector::Zero(6);
  state.q[X] = 123.4;
  for (const int direction : {1, -1, 0}) {
    state.direction[X] = std::int8_t(direction);
    EXPECT_NEAR(correction(tables, state)[X], 3e-3 * direction + 1.234e-3, 1e-15);
    EXPECT_NEAR(correction(tables, state)[Y], 1e-3 * direction, 1e-15);
  }
  options.has_direction_columns = false;
  const ParameterTables mean = tabulate(backlash, chain, AxisVector::Zero(6), options);
  ASSERT_EQ(mean.tables.size(), 1u) << "that of Y over X holds zeros only";
  state.direction[X] = 1;
  EXPECT_NEAR(correction(mean, state)[X], 1.234e-3, 1e-15);
}

TEST(ParameterTables, WhatDependsOnTwoAxesAtOnceIsLeft) {
  const Chain chain = gantry();
  const CorrectionFunction twisted = [](const AxisState& state) -> AxisVector {
    AxisVector c = AxisVector::Zero(state.q.size());
    c[Z] = 2e-3 + 1e-5 * state.q[X] - 2e-5 * state.q[Y] + 1e-7 * state.q[X] * state.q[Y];
    return c;
  };
  AxisVector reference = AxisVector::Zero(6);
  reference[X] = 50.0;
  reference[Y] = -30.0;
  const ParameterTables tables = tabulate(twisted, chain, reference);
  AxisState state;
  state.q = reference;
  EXPECT_NEAR(tables.offset[Z], twisted(state)[Z], 0.0);
  state.q[X] = -217.3;
  state.q[Y] = 144.4;
  const double left = twisted(state)[Z] - correction(tables, state)[Z];
  EXPECT_NEAR(left, 1e-7 * (-217.3 - 50.0) * (144.4 + 30.0), 1e-15);
  TableOptions own;
  own.cross = false;
  own.constant = false;
  const ParameterTables nothing = tabulate(twisted, chain, reference, own);
  EXPECT_TRUE(nothing.tables.empty());
  EXPECT_EQ(nothing.offset, AxisVector::Zero(6));
}

TEST(ParameterTables, ATableIsLinearBetweenPointsAndHeldOutside) {
  const AxisTable table{X, X, Vector3d(-1, 0, 4), Vector3d(1, 2, -2), Vector3d(0, 5, 6)};
  EXPECT_EQ(correction(table, -2, 1), 1.0);
  EXPECT_EQ(correction(table, -1, 1), 1.0);
  EXPECT_EQ(correction(table, -0.5, 1), 1.5);
  EXPECT_EQ(correction(table, 0, -1), 5.0);
  EXPECT_EQ(correction(table, 1, 1), 1.0);
  EXPECT_EQ(correction(table, 4, 1), -2.0);
  EXPECT_EQ(correction(table, 1e300, -1), 6.0);
  EXPECT_EQ(correction(table, 1, 0), 0.5 * (1.0 + 5.25));
}

TEST(ParameterTables, WhatCannotBeTabulatedIsRefused) {
  const Chain chain = gantry();
  const auto zero = along(X, X, [](double) { return 0.0; });
  const auto refused = [&](const auto& change) {
    TableOptions options;
    change(options);
    EXPECT_THROW(tabulate(zero, chain, AxisVector::Zero(6), options), std::invalid_argument);
  };
  refused([](TableOptions& o) { o.max_points = 1; });
  refused([](TableOptions& o) { o.spacing = 0.0; });
  refused([&](TableOptions& o) { o.spacing_rad = nan; });
  refused([](TableOptions& o) { o.range.emplace().setConstant(1.0), (*o.range)(1, X) = 0.0; });
  refused([&](TableOptions& o) { o.range.emplace().setConstant(nan); });
  EXPECT_THROW(tabulate(zero, chain, AxisVector::Zero(3)), std::invalid_argument);
  EXPECT_TRUE(tabulate(zero, chain, AxisVector::Zero(6)).tables.empty());
}

TEST(ParameterTables, TablesThatAreNoneAreRefused) {
  const Chain chain = gantry();
  const AxisTable good{X, Y, Vector2d(0, 1), Vector2d(0, 1), Vector2d(0, 1)};
  const auto refused = [&](const auto& change) {
    ParameterTables tables{{good}, AxisVector::Zero(6)};
    change(tables);
    EXPECT_THROW(validate(tables, chain), std::invalid_argument);
    EXPECT_THROW(to_control(tables, chain, ControlFormat::Siemens), std::invalid_argument);
  };
  validate({{good}, AxisVector::Zero(6)}, chain);
  refused([](ParameterTables& t) { t.offset = AxisVector::Zero(5); });
  refused([](ParameterTables& t) { t.offset[3] = std::nan(""); });
  refused([](ParameterTables& t) { t.tables[0].argument_joint = 6; });
  refused([](ParameterTables& t) { t.tables[0].corrected_joint = s; });
  refused([](ParameterTables& t) { t.tables[0].argument_joint = -1; });
  refused([](ParameterTables& t) { t.tables[0].position = Vector2d(1, 1); });
  refused([](ParameterTables& t) { t.tables[0].position = Vector3d(1, 2, 3); });
  refused([](ParameterTables& t) { t.tables[0].downward[1] = INFINITY; });
}

}  // namespace
}  // namespace abbe::sim::compensation
