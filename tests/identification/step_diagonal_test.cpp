#include "errors/identification/step_diagonal.h"
#include "errors/identification/model.h"
#include "tests/identification/measured.h"
#include "tests/test.h"

namespace abbe::errors::identification {
namespace {

using metrology::Instrument;
using metrology::Kind;
using metrology::Plan;
using metrology::Readings;

Plan stepped(const kinematics::Chain& chain, double noise, int runs = 1, int steps = 10) {
  Instrument instrument = metrology::typical_instrument(Kind::StepDiagonal);
  instrument.targets = steps;
  instrument.runs = runs;
  instrument.noise = noise;
  instrument.resolution = 0.0;
  instrument.rotation_sigma = instrument.scale_sigma = instrument.drift_sigma = 0.0;
  return metrology::plan(instrument, chain);
}

/// The places of an axis in a plan, from its lowest upwards.
VectorXd places_of(const kinematics::Chain& chain, char axis, int steps) {
  double low = 1e9, high = -1e9;
  for (const metrology::Measurement& measurement : stepped(chain, 0.0, 1, steps).measurements) {
    low = std::min(low, measurement.state.q[*chain.find(axis)]);
    high = std::max(high, measurement.state.q[*chain.find(axis)]);
  }
  return VectorXd::LinSpaced(steps + 1, low, high);
}

const Table& table_of(const GeometricErrors& belief, const std::string& name) {
  for (const Element& element : belief.elements)
    if (to_string(element.name) == name) return std::get<Table>(element.curves.at(0).shape);
  throw std::logic_error(name);
}

double constant_of(const GeometricErrors& belief, const std::string& name) {
  for (const Element& element : belief.elements)
    if (to_string(element.name) == name)
      return std::get<Constant>(element.curves.at(0).shape).value;
  throw std::logic_error(name);
}

/// A truth of the twelve in the form of the belief: random tables over the steps, positioning from
/// zero, straightness without its line.
GeometricErrors twelve(const kinematics::Chain& chain, int steps, std::uint64_t seed) {
  GeometricErrors truth;
  std::uint64_t counter = 0;
  for (const char axis : {'X', 'Y', 'Z'}) {
    const VectorXd q = places_of(chain, axis, steps);
    for (const char direction : {'X', 'Y', 'Z'}) {
      VectorXd value(q.size());
      for (double& v : value) v = 10.0_um * normal_deviate(seed, counter++);
      if (direction == axis) value.array() -= value[0];
      Table table = make_table(q, value, TableInterpolation::Linear, TableExtrapolation::Hold);
      if (direction != axis) table = detrend(table, Detrend::LeastSquares).table;
      truth.elements.push_back({{direction, axis, false}, {Curve{table}}});
    }
  }
  for (const char* name : {"EC0Y", "EB0Z", "EA0Z"})
    truth.elements.push_back(element(name, Constant{50.0_urad * normal_deviate(seed, counter++)}));
  return truth;
}

TEST(StepDiagonal, ReturnsTheTwelveElementsOfPureTranslations) {
  const std::uint64_t seed = 20261121;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  for (const kinematics::Chain& chain : {three_axes(), tool_side_axes()}) {
    const GeometricErrors truth = twelve(chain, 10, seed);
    const StepDiagonal found =
        step_diagonal(metrology::measure(stepped(chain, 0.0), chain, machine_of(truth, chain), 1));
    ASSERT_EQ(found.belief.elements.size(), 12u);
    const double worst = relative_difference(values(found.belief.elements), truth);
    std::cout << "step diagonal without noise: " << worst << " of the largest of its kind\n";
    EXPECT_LT(worst, 1e-9);
    EXPECT_TRUE(found.warnings.empty());
  }
}

TEST(StepDiagonal, ItsCovarianceIsTrueAndNoiseAloneSeldomWarns) {
  const std::uint64_t seed = 20261122;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const kinematics::Chain chain = three_axes();
  const Plan plan = stepped(chain, 0.1_um, 2);
  const GeometricErrors truth = twelve(chain, 10, seed);
  const metrology::MachineUnderTest machine = machine_of(truth, chain);
  const VectorXd expected = values(truth.elements);
  int inside = 0, all = 0, warned = 0;
  double chi_square = 0.0;
  const int repeats = 200;
  for (int i = 0; i < repeats; ++i) {
    const StepDiagonal found = step_diagonal(metrology::measure(plan, chain, machine, seed + i));
    const VectorXd off = values(found.belief.elements) - expected;
    for (Index k = 0; k < off.size(); ++k) {
      const double sigma = std::sqrt(found.belief.covariance.matrix(k, k));
      if (sigma == 0.0) continue;  // the first row of a positioning
      ++all;
      inside += std::abs(off[k]) <= 1.959964 * sigma;
    }
    warned += !found.warnings.empty();
    chi_square += found.reduced_chi_square / repeats;
  }
  std::cout << "95 % intervals cover " << 100.0 * inside / all << " %, reduced chi-square "
            << chi_square << ", " << warned << " warnings in " << repeats << "\n";
  EXPECT_NEAR(double(inside) / all, 0.95, 0.01);
  EXPECT_NEAR(chi_square, 1.0, 0.05);
  EXPECT_LE(warned, 4) << "a few in a thousand are chance";
}

constexpr double second_order = 2e-8;  // mm: (20 urad)^2 times a leg of 40 mm

/// One angle, growing by 20 urad from the lower end of its axis to the upper.
GeometricErrors turning(const std::string& name, const VectorXd& q) {
  const Polynomial line{(VectorXd(2) << 0.0, 20.0_urad).finished(), q[0], q[q.size() - 1] - q[0]};
  return {{element(name, line)}, {}};
}

// By hand. n = (s a, t b, c) is the diagonal with signs s and t, l a step's legs. The tool, turned
// by theta_k about Z at height number k, reads theta_k e_z . (n x r) more, r the way off the
// diagonal since the step began: after the leg of X -s t b l_x theta_k, after those of X and Y and
// at the end of the step nothing. Z's point is the tip, so nothing moves. Of the interval j of X
// the diagonals with s = + pass it at height j, those with s = - at n - 1 - j; with theta and
// theta' for these, the four equations s a dx + t b dy + c dz = -t b l_x theta_k give dy = -l_x
// (theta + theta') / 2 and contradict each other by the rest, -s t b l_x (theta - theta') / 2. Y
// likewise, with dx of Y being +l_y (theta + theta') / 2; Z gives nothing.
TEST(StepDiagonal, ARollMakesItFailByWhatTheTheorySaysAndWarns) {
  const kinematics::Chain chain = tool_side_axes();
  const int n = 10;
  const VectorXd x = places_of(chain, 'X', n), y = places_of(chain, 'Y', n),
                 z = places_of(chain, 'Z', n);
  const metrology::MachineUnderTest machine = machine_of(turning("ECZ", z), chain);
  const StepDiagonal exact =
      step_diagonal(metrology::measure(stepped(chain, 0.0, 1, n), chain, machine, 5));
  const StepDiagonal noisy =
      step_diagonal(metrology::measure(stepped(chain, 0.1_um, 1, n), chain, machine, 5));
  const double mean = 0.5 * 20.0_urad * (n - 1) / n;  // theta + theta' is the same for every j
  // slopes of -mean in EYX and +mean in EXY: squarenesses of +mean and -mean, which cancel
  EXPECT_NEAR(constant_of(exact.belief, "EC0Y"), 0.0, 1e-12);
  for (const Element& e : exact.belief.elements) {
    const auto* table = std::get_if<Table>(&e.curves[0].shape);
    if (!table) continue;
    EXPECT_LT(table->value.cwiseAbs().maxCoeff(), second_order) << to_string(e.name);
  }
  std::cout << "20 urad of roll of Z: slopes of EYX and EXY of -+" << mean / 1.0_urad
            << " urad, cancelling in EC0Y to " << constant_of(exact.belief, "EC0Y") / 1.0_urad
            << " urad; reduced chi-square " << noisy.reduced_chi_square << "\n";
  ASSERT_FALSE(noisy.warnings.empty());
  EXPECT_HAS(noisy.warnings[0], "angular errors");
}

// In the same way, turned about X: after the leg of Y the reading is -t c l_y theta_k more, after
// that of Z nothing. The leg of Y has -t c l_y theta_k, that of Z as much the other way, and with
// theta' as above for the diagonals that pass the interval of Y going down:
//   EZY -l_y (theta + theta') / 2, EYY -l_z (theta - theta') / 2, EYZ +l_z theta.
// The four equations agree: no evaluation of these readings can tell it from a translation.
TEST(StepDiagonal, APitchMakesItFailByWhatTheTheorySaysAndCannotBeSeen) {
  const kinematics::Chain chain = tool_side_axes();
  const int n = 10;
  const VectorXd y = places_of(chain, 'Y', n), z = places_of(chain, 'Z', n);
  const StepDiagonal found = step_diagonal(metrology::measure(
      stepped(chain, 0.0, 1, n), chain, machine_of(turning("EAZ", z), chain), 5));
  const double l_y = y[1] - y[0], l_z = z[1] - z[0];
  VectorXd ezy = VectorXd::Zero(n + 1), eyy = ezy, eyz = ezy;
  for (int k = 0; k < n; ++k) {
    const double theta = 20.0_urad * k / n, other = 20.0_urad * (n - 1 - k) / n;
    ezy[k + 1] = ezy[k] - 0.5 * (theta + other) * l_y;
    eyy[k + 1] = eyy[k] - 0.5 * (theta - other) * l_z;
    eyz[k + 1] = eyz[k] + theta * l_z;
  }
  const DetrendedTable line_y = detrend(make_table(y, ezy), Detrend::LeastSquares);
  const DetrendedTable line_z = detrend(make_table(z, eyz), Detrend::LeastSquares);
  const auto off = [&](const char* name, const VectorXd& expected) {
    return (table_of(found.belief, name).value - expected).cwiseAbs().maxCoeff();
  };
  const double worst =
      std::max({off("EZY", line_y.table.value), off("EYY", eyy), off("EYZ", line_z.table.value)});
  const auto height = [](const VectorXd& v) { return v.maxCoeff() - v.minCoeff(); };
  std::cout << "20 urad of pitch of Z: EYY wrong by " << height(eyy) / 1.0_um << " um, EYZ by "
            << height(line_z.table.value) / 1.0_um << " um, within " << worst / 1.0_um
            << " um of the theory\n";
  EXPECT_GT(height(eyy), 0.5_um);
  EXPECT_LT(worst, second_order);
  EXPECT_NEAR(constant_of(found.belief, "EA0Z"), -line_y.slope - line_z.slope, 1e-12);
  for (const char* name : {"EXX", "EZZ", "EYX", "EZX", "EXY", "EXZ"})
    EXPECT_LT(off(name, VectorXd::Zero(n + 1)), second_order) << name;
}

TEST(StepDiagonal, EveryAngleIsWarnedOfOrNamedAsOneThatCannotBeSeen) {
  for (const kinematics::Chain& chain : {tool_side_axes(), three_axes()}) {
    const metrology::Plan plan = stepped(chain, 0.01_um, 3);
    std::string warned;
    std::string caution;
    for (const std::string axis : {"X", "Y", "Z"})
      for (const std::string about : {"A", "B", "C"}) {
        const std::string name = "E" + about + axis;
        const StepDiagonal found = step_diagonal(metrology::measure(
            plan, chain, machine_of(turning(name, places_of(chain, axis[0], 10)), chain), 7));
        caution = found.caution;
        double largest = 0.0;
        for (const Element& e : found.belief.elements)
          if (!e.name.location)
            largest =
                std::max(largest, std::get<Table>(e.curves[0].shape).value.cwiseAbs().maxCoeff());
        const bool is_named = caution.find(name) != std::string::npos;
        EXPECT_EQ(is_named, found.warnings.empty() && largest > 0.1_um) << name;
        if (!found.warnings.empty()) warned += " " + name;
      }
    std::cout << "20 urad warned of:" << warned << "; " << caution << "\n";
    EXPECT_NE(warned, "");
    EXPECT_NE(caution, "");
  }
}

TEST(StepDiagonal, AMirrorOutOfLineMakesItFailAlikeAtEveryStepAndWarns) {
  const kinematics::Chain chain = tool_side_axes();
  Instrument instrument = metrology::typical_instrument(Kind::StepDiagonal);
  instrument.rotation_sigma = 100.0_urad;  // of the beam and of the mirror
  instrument.scale_sigma = 0.0;
  const StepDiagonal found = step_diagonal(metrology::measure(
      metrology::plan(instrument, chain), chain, machine_of({}, chain), 20261121));
  ASSERT_EQ(found.warnings.size(), 1u);
  EXPECT_HAS(found.warnings[0], "is the same at every step");
  EXPECT_HAS(found.warnings[0], "mirror");
  const double wrong = std::abs(constant_of(found.belief, "EC0Y")) +
                       std::abs(constant_of(found.belief, "EB0Z")) +
                       std::abs(constant_of(found.belief, "EA0Z"));
  std::cout << "100 urad of mirror and beam: squarenesses wrong by " << wrong / 1.0_urad
            << " urad together; reduced chi-square " << found.reduced_chi_square << "\n";
  EXPECT_GT(wrong, 10.0_urad);
}

TEST(StepDiagonal, AGrowthOverTemperatureIsFoundAndASetOfEqualTemperaturesRefused) {
  const kinematics::Chain chain = three_axes();
  const GeometricErrors cold = twelve(chain, 10, 8);
  const GeometricErrors warmth = twelve(chain, 10, 9);  // per 10 K
  std::vector<StepDiagonal> results;
  MatrixXd dT_K(4, 1);
  dT_K << 0.0, 2.0, 5.0, 9.0;
  for (Index i = 0; i < 4; ++i) {
    GeometricErrors warm = cold;
    warm.elements = with_values(cold.elements,
                                values(cold.elements) + 0.1 * dT_K(i, 0) * values(warmth.elements));
    results.push_back(
        step_diagonal(metrology::measure(stepped(chain, 0.0), chain, machine_of(warm, chain), 1)));
  }
  const StepDiagonalTrend trend = step_diagonal_trend(results, dT_K);
  ASSERT_EQ(trend.names.size(), 3u + 3u + 6u * 11u);
  double worst = 0.0;
  for (std::size_t i = 0; i < trend.names.size(); ++i) {
    const auto k = Index(i);
    if (trend.names[i] != "EC0Y" && trend.names[i] != "EZX[4]" && trend.names[i] != "EYY slope")
      continue;
    double expected = 0.1 * constant_of(warmth, "EC0Y");
    if (trend.names[i] == "EZX[4]") expected = 0.1 * table_of(warmth, "EZX").value[4];
    if (trend.names[i] == "EYY slope")
      expected = 0.1 * detrend(table_of(warmth, "EYY"), Detrend::LeastSquares).slope;
    worst = std::max(worst, std::abs(trend.per_K(k, 0) / expected - 1.0));
    EXPECT_GE(trend.per_K_sigma(k, 0), 0.0);
  }
  std::cout << "slopes over temperature: " << worst << " of each\n";
  EXPECT_LT(worst, 1e-8);
  EXPECT_THROW(step_diagonal_trend(results, MatrixXd::Ones(4, 1)), std::invalid_argument);
  EXPECT_THROW(step_diagonal_trend(results, MatrixXd::Ones(3, 1)), std::invalid_argument);
  EXPECT_THROW(step_diagonal_trend({results.data(), 1}, dT_K.topRows(1)), std::invalid_argument);
}

TEST(StepDiagonal, OtherReadingsAreRefusedInASentence) {
  const kinematics::Chain chain = three_axes();
  const Readings good = metrology::measure(stepped(chain, 0.0), chain, machine_of({}, chain), 1);
  const auto refusal = [](const Readings& readings) {
    return thrown_text<std::invalid_argument>([&] { step_diagonal(readings); });
  };
  EXPECT_EQ(refusal(good), "");
  Readings bad = good;
  bad.plan.set_ups.pop_back();
  EXPECT_EQ(refusal(bad), "step diagonal: expected four diagonals, seen 3");
  bad = good;
  bad.value[7] = std::nan("");
  EXPECT_HAS(refusal(bad), "finite reading");
  bad = good;
  bad.plan.measurements.erase(bad.plan.measurements.begin() + 5);
  bad.value = good.value.head(good.value.size() - 1);
  EXPECT_HAS(refusal(bad), "one step in X, Y or Z apart");
  bad = good;
  const auto quarter = Index(good.value.size() / 4);
  bad.plan.measurements.resize(std::size_t(3 * quarter));
  bad.value = good.value.head(3 * quarter);
  EXPECT_HAS(refusal(bad), "same steps on every diagonal");
  const kinematics::Chain other = platform();
  bad = Readings{good.plan, other, good.value, {}, {}};
  EXPECT_NE(refusal(bad), "");
}

}  // namespace
}  // namespace abbe::errors::identification
