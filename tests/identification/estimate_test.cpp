#include "errors/identification/estimate.h"
#include "errors/identification/design.h"
#include "errors/identification/model.h"
#include "errors/identification/regression.h"
#include "errors/identification/thermal_epochs.h"
#include "tests/identification/measured.h"
#include "tests/test.h"

namespace abbe::errors::identification {
namespace {

using metrology::Instrument;
using metrology::Kind;
using metrology::Readings;

std::vector<Kind> kinds_with_readings() {
  std::vector<Kind> result;
  for (int k = 0; k <= int(Kind::Spindle); ++k) result.push_back(Kind(k));
  return result;
}

ModelOptions small_model(Kind kind = Kind::Laser) {
  ModelOptions options;
  options.order = 3;
  options.harmonics = 2;
  options.spindle_harmonics = kind == Kind::Spindle ? 2 : 0;
  return options;
}

metrology::Plan plan_of(Kind kind, const kinematics::Chain& chain, int runs = 1) {
  Instrument instrument = metrology::typical_instrument(kind);
  instrument.runs = runs;
  return metrology::plan(instrument, chain);
}

/// Index of a number of the model, -1 for an unknown of a set-up.
Index place_of(const Estimate& estimate, const std::string& name) {
  const auto at = std::find(estimate.names.begin(), estimate.names.end(), name);
  return at == estimate.names.end() ? -1 : at - estimate.names.begin();
}

std::set<std::string> confounded_names(const Estimate& estimate) {
  std::set<std::string> names;
  for (const ConfoundedCoefficient& c : estimate.confounded) names.insert(c.name);
  return names;
}

/// The model with every confounded number at its true value: known by other means.
GeometricErrors with_known(const GeometricErrors& model, const GeometricErrors& truth,
                           const Estimate& estimate) {
  VectorXd v = values(model.elements);
  for (const ConfoundedCoefficient& c : estimate.confounded)
    if (const Index i = place_of(estimate, c.name); i >= 0) v[i] = values(truth.elements)[i];
  GeometricErrors result = model;
  result.elements = with_values(model.elements, v);
  return result;
}

/// The values found less what the confounded numbers put into them, and those as they truly are.
VectorXd freed(const Estimate& estimate, const GeometricErrors& truth) {
  const VectorXd expected = values(truth.elements);
  VectorXd v = estimate.value;
  for (const ConfoundedCoefficient& c : estimate.confounded) {
    const Index i = place_of(estimate, c.name);
    if (i < 0) continue;
    v[i] = expected[i];
    for (const auto& [name, amount] : c.with)
      if (const Index k = place_of(estimate, name); k >= 0) v[k] -= amount * expected[i];
  }
  return v;
}

// ---- the design matrix

constexpr double step = 1e-4;         // mm or rad, of a difference
constexpr double third_order = 1e-6;  // step^2 / 6 times an arm of 600 mm

/// Largest difference of the design matrix from central differences of the exact readings, over
/// the largest change that the number makes.
double off_differences(const GeometricErrors& model, const std::vector<Readings>& readings) {
  const Design d = design(model, readings);
  const VectorXd x = start(model, d.unknowns);
  double worst = 0.0;
  for (Index j = 0; j < x.size(); ++j) {
    VectorXd up = x, down = x;
    up[j] += step;
    down[j] -= step;
    const VectorXd difference = (predicted_readings(model, readings, d, up) -
                                 predicted_readings(model, readings, d, down)) /
                                (2.0 * step);
    const VectorXd column = d.A.col(j).cwiseProduct(d.sigma);
    const double size = std::max(1.0, column.cwiseAbs().maxCoeff());
    worst = std::max(worst, (difference - column).cwiseAbs().maxCoeff() / size);
  }
  return worst;
}

TEST(Design, IsTheDerivativeOfTheExactReadingsForEveryInstrument) {
  const kinematics::Chain chain = measured_gantry();
  for (const Kind kind : kinds_with_readings()) {
    GeometricErrors model = error_model(chain, small_model(kind));
    model.measuring_lines = {{'X', Vector3d(20, -300, 100), MeasuredBy::Tool},
                             {'Z', Vector3d(-50, 30, 0), MeasuredBy::Carriage}};
    const GeometricErrors nothing{};
    Readings readings = noise_free(plan_of(kind, chain), chain, nothing);
    for (metrology::SetUp& set_up : readings.plan.set_ups)  // every unknown that there is
      set_up.rotation_sigma = set_up.point_of_sigma = set_up.point_in_sigma =
          set_up.eccentricity_sigma = set_up.scale_sigma = set_up.drift_sigma = 1e-3;
    const double worst = off_differences(model, {readings});
    std::cout << to_string(kind) << ": design matrix off central differences by " << worst << "\n";
    EXPECT_LT(worst, third_order) << to_string(kind);
  }
}

TEST(Design, HoldsForPrimedSlidesMeasuringLinesAndTurningAxes) {
  kinematics::Chain other = turned_gantry();
  std::vector<kinematics::Joint> joints = other.joints();
  for (kinematics::Joint& j : joints) {
    j.min = j.motion == kinematics::Motion::Linear ? -150.0 : -1.0;
    j.max = -j.min;
    if (j.motion == kinematics::Motion::Rotary)
      j.deviation_axes = kinematics::DeviationAxes::Turning;
    if (j.name == 'Y') j.squareness = kinematics::Squareness::Travel;
  }
  const kinematics::Chain chain(joints, other.T_bw_home(), other.T_bt_home());
  GeometricErrors model = error_model(chain, small_model());
  model.measuring_lines = {{'X', Vector3d(20, -300, 100), MeasuredBy::Tool},
                           {'Z', Vector3d(-50, 30, 0), MeasuredBy::Carriage}};
  for (const Kind kind : {Kind::Laser, Kind::Tracker, Kind::BallBarRotary}) {
    Instrument instrument = metrology::typical_instrument(kind);
    instrument.runs = 1;
    if (kind == Kind::BallBarRotary) instrument.axes = {'C'};
    const metrology::Plan plan = metrology::plan(instrument, chain);
    const double worst = off_differences(model, {noise_free(plan, chain, GeometricErrors{})});
    std::cout << "turned gantry, " << to_string(kind) << ": " << worst << "\n";
    EXPECT_LT(worst, third_order);
  }
}

// ---- without noise

// A number with a standard deviation above the largest of its kind (millimetres of positioning,
// from a step diagonal) is settled by what was known of the set-ups beforehand, not by the
// readings: rounding moves it by parts of that deviation.
TEST(Estimate, EveryInstrumentReturnsWhatItCanSeeAndNamesTheRest) {
  const std::uint64_t seed = 20261121;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const kinematics::Chain chain = measured_gantry();
  for (const Kind kind : kinds_with_readings()) {
    const GeometricErrors model = error_model(chain, small_model(kind));
    const GeometricErrors truth = drawn_truth(model, seed);
    const Readings readings = noise_free(plan_of(kind, chain), chain, truth);
    const Estimate first = estimate(model, {&readings, 1});
    const Estimate second = estimate(with_known(model, truth, first), {&readings, 1});
    const VectorXd sigma = standard_deviations(second);
    const double worst = relative_difference(second.value, truth, sigma);
    double worst_of_sigma = 0.0;
    int found = 0;
    for (Index k = 0; k < sigma.size(); ++k)
      if (sigma[k] > 0.0) {
        ++found;
        worst_of_sigma = std::max(worst_of_sigma,
                                  std::abs(second.value[k] - values(truth.elements)[k]) / sigma[k]);
      }
    std::cout << to_string(kind) << ": " << found << " numbers found, " << first.confounded.size()
              << " named as confounded, condition " << first.condition << "; once those are known, "
              << worst << " of the largest of its kind, " << worst_of_sigma
              << " of its own standard deviation\n";
    EXPECT_TRUE(first.converged && second.converged) << to_string(kind);
    EXPECT_LT(worst, 1e-9) << to_string(kind);
    EXPECT_LT(worst_of_sigma, 1e-5) << to_string(kind);
    EXPECT_EQ(confounded_names(first), confounded_names(second)) << to_string(kind);
    EXPECT_LT(second.reduced_chi_square, 1e-6);
    EXPECT_GT(found, 0);
  }
}

// What a confounded number puts into the others is linear; what is left falls with the square.
TEST(Estimate, WhatConfoundedNumbersHideBehindIsTakenOutToSecondOrder) {
  const std::uint64_t seed = 20261121;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const kinematics::Chain chain = measured_gantry();
  for (const Kind kind : kinds_with_readings()) {
    const GeometricErrors model = error_model(chain, small_model(kind));
    double off[2] = {0, 0};
    for (int half = 0; half < 2; ++half) {
      const double size = half ? 0.005 : 0.010;
      const GeometricErrors truth = drawn_truth(model, seed, size, 3e-3 * size);
      const Readings readings = noise_free(plan_of(kind, chain), chain, truth);
      const Estimate found = estimate(model, {&readings, 1});
      off[half] = relative_difference(freed(found, truth), truth, standard_deviations(found), 0.1);
    }
    std::cout << to_string(kind) << ": freed of what is confounded to " << off[0]
              << ", of half the deviations to " << off[1] << "\n";
    EXPECT_LT(off[0], 0.05) << to_string(kind);
    EXPECT_LT(off[1], 0.55 * off[0]) << to_string(kind) << ": of the largest, so half or less";
  }
}

TEST(Estimate, ALaserAlongOneAxisSeesItsPositioningAndNoRoll) {
  const kinematics::Chain chain = tool_side_axes();
  ModelOptions options = small_model();
  options.only = {"EXX", "EYX", "EAX", "EBX", "ECX", "EYY"};
  const GeometricErrors model = error_model(chain, options);
  Instrument laser = metrology::typical_instrument(Kind::Laser);
  laser.axes = {'X'};
  laser.runs = 1;
  const Readings readings = noise_free(metrology::plan(laser, chain), chain, {});
  const Estimate found = estimate(model, {&readings, 1});
  for (const char* name : {"EXX[1]", "EXX[2]", "EXX[3]", "EXX backlash"})
    EXPECT_FALSE(confounded_names(found).count(name)) << name;
  for (const ConfoundedCoefficient& c : found.confounded) {
    const bool is_slope_of_yaw = c.name.rfind("EBX", 0) == 0 || c.name.rfind("ECX", 0) == 0;
    EXPECT_EQ(c.with.empty(), !is_slope_of_yaw) << c.name;
    if (is_slope_of_yaw) {
      EXPECT_EQ(c.with.at(0).first, "EXX" + c.name.substr(3));
    }
  }
  EXPECT_EQ(found.names.size(), coefficients(model.elements).size());
}

// With C's centre stated as the joint's point and the nest's zero unknown, a shift of C on the
// table and the first harmonic of its radial motion are the same; by hand: EXC = d cos C, EYC = d
// sin C is a workpiece moved by d, which a nest's zero hides.
TEST(Estimate, AConfoundedNumberIsNamedWithTheAmountsThatHideIt) {
  const kinematics::Chain chain = measured_gantry();
  ModelOptions options = small_model();
  options.only = {"EXC", "EYC", "EX0C"};
  options.harmonics = 1;
  const GeometricErrors model = error_model(chain, options);
  Instrument nest = metrology::typical_instrument(Kind::RTest);
  nest.axes = {'C'};
  nest.position_sigma = nest.rotation_sigma = nest.scale_sigma = nest.drift_sigma = 0.0;
  const Readings readings = noise_free(metrology::plan(nest, chain), chain, {});
  const Estimate found = estimate(model, {&readings, 1});
  std::map<std::string, std::map<std::string, double>> hidden;
  for (const ConfoundedCoefficient& c : found.confounded)
    for (const auto& [name, amount] : c.with) hidden[c.name][name] = amount;
  ASSERT_EQ(hidden.size(), 2u);
  // a workpiece carried round: EXC cos 1 = 1 reads as EYC sin 1 = -1 with the zero of X, and so on
  ASSERT_TRUE(hidden.count("EXC sin 1") || hidden.count("EYC sin 1"));
  for (const auto& [name, with] : hidden) {
    double largest = 0.0;
    for (const auto& one : with) largest = std::max(largest, std::abs(one.second));
    EXPECT_NEAR(largest, 1.0, 1e-9) << name;
  }
}

TEST(Estimate, TheResultDoesNotDependOnTheScaleOfACurve) {
  const kinematics::Chain chain = measured_gantry();
  const GeometricErrors model = error_model(chain, small_model());
  const GeometricErrors truth = drawn_truth(model, 5);
  const Readings readings = noise_free(plan_of(Kind::RTest, chain), chain, truth);
  GeometricErrors scaled_model = model;
  for (Element& element : scaled_model.elements)
    for (Curve& curve : element.curves) curve.scale = element.name.is_angle() ? 1e-3 : 1.0;
  const Estimate plain = estimate(model, {&readings, 1});
  const Estimate scaled = estimate(scaled_model, {&readings, 1});
  EXPECT_EQ(confounded_names(plain), confounded_names(scaled)) << "urad and um, or rad and mm";
  EXPECT_NEAR(plain.condition / scaled.condition, 1.0, 0.05);
}

// ---- a campaign

struct Campaign {
  std::vector<metrology::Plan> plans;
  double hours = 0.0;
};

/// What a person with a laser, its optics, a level, a square, an R-test nest and a spindle analyser
/// does in two days.
Campaign practical_campaign(const kinematics::Chain& chain) {
  Campaign campaign;
  const auto add = [&](Kind kind, const auto& adapt) {
    Instrument instrument = metrology::typical_instrument(kind);
    adapt(instrument);
    campaign.plans.push_back(metrology::plan(instrument, chain));
    campaign.hours += campaign.plans.back().duration_s / 3600.0;
  };
  const auto runs = [](int count) { return [count](Instrument& i) { i.runs = count; }; };
  const auto ball = [](const char* name, char axis, const Vector3d& reflector_t) {
    return [=](Instrument& i) {
      i.name = name;
      i.axes = {axis};
      i.reflector_t = reflector_t;
    };
  };
  add(Kind::Laser, runs(2));
  add(Kind::Straightness, runs(2));
  add(Kind::AngleOptics, runs(2));
  add(Kind::Level, runs(2));
  add(Kind::RollLines, [](Instrument& i) { i.axes = {'Z'}; });
  add(Kind::Square, runs(1));
  add(Kind::RTest, runs(1));
  add(Kind::RTest, [](Instrument& i) {
    i.name = "nest on a stand";
    i.axes = {'C'};
    i.location_w = Vector3d(100, 0, 250);
  });
  add(Kind::RTest, ball("long ball", 'A', Vector3d(0, 60, -80)));
  add(Kind::RTest, ball("ball aside", 'A', Vector3d(60, 0, 0)));
  add(Kind::Spindle, runs(3));
  return campaign;
}

TEST(Campaign, FindsTheFortyTwoAndFourLessEightNumbersThatNothingCanTell) {
  const std::uint64_t seed = 20261121;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const kinematics::Chain chain = measured_gantry();
  ModelOptions options;
  options.spindle_harmonics = 2;
  const GeometricErrors model = error_model(chain, options);
  const GeometricErrors truth = drawn_truth(model, seed);
  const Campaign campaign = practical_campaign(chain);
  std::vector<Readings> readings;
  for (const metrology::Plan& plan : campaign.plans)
    readings.push_back(noise_free(plan, chain, truth));

  const Estimate found = estimate(model, readings);
  const Estimate known = estimate(with_known(model, truth, found), readings);
  const double worst = relative_difference(known.value, truth);
  const double second_order = relative_difference(freed(found, truth), truth);
  std::cout << "campaign of " << campaign.hours << " h, " << found.fit_residual.size()
            << " readings, " << found.names.size() - model.covariance.of.size()
            << " numbers sought, condition " << found.condition << "; with the confounded known, "
            << worst << " of the largest; freed of them, " << second_order << "; not found:\n";
  for (const ConfoundedCoefficient& c : found.confounded) {
    std::cout << "  " << c.name << " =";
    for (const auto& [name, amount] : c.with)
      if (place_of(found, name) >= 0) std::cout << " " << amount << " " << name;
    std::cout << " and " << c.with.size() << " in all\n";
  }
  EXPECT_TRUE(found.converged);
  EXPECT_LT(worst, 1e-9);
  EXPECT_LT(second_order, 1e-2);
  // where a workpiece stands on the table, where a tool stands in the spindle and how it is turned
  // there, and the height from table to head: no reading of the machine itself knows them
  EXPECT_EQ(confounded_names(found), (std::set<std::string>{"EXC cos 1", "EYC cos 1", "EXS", "EYS",
                                                            "EZS", "EBS", "EY0A", "EZ0A"}));
  EXPECT_EQ(model.elements.size(), 46u);
  EXPECT_LT(campaign.hours, 16.0);

  // the difference from the truth lies in a null space of eight: with the set-ups taking their
  // part, no reading would show it
  const Design d = design(model, readings);
  const MatrixXd A = (MatrixXd(d.A.rows() + d.prior.rows(), d.A.cols()) << d.A, d.prior).finished();
  const std::vector<int> alike(d.is_sought.size(), 0);
  EXPECT_EQ(factor(A, d.is_sought, alike, 1e-9).left_out.size(), 8u);
  const Index p = found.value.size();
  const VectorXd shown = A.leftCols(p) * (found.value - values(truth.elements));
  std::vector<char> of_set_ups = d.is_sought;
  std::fill_n(of_set_ups.begin(), p, char(0));
  const Factor zeros = factor(A, of_set_ups, alike, 1e-9);
  const double seen = (shown - A(Eigen::all, zeros.determined) * solve(zeros, shown)).norm();
  std::cout << "the difference from the truth shows in the readings as " << seen / shown.norm()
            << " of itself\n";
  EXPECT_LT(seen, 1e-3 * shown.norm()) << "second order";
}

// ---- priors, outliers, noise

Readings noisy_laser(const kinematics::Chain& chain, const GeometricErrors& truth,
                     std::uint64_t seed, int runs = 3) {
  Instrument laser = metrology::typical_instrument(Kind::Laser);
  laser.axes = {'X'};
  laser.runs = runs;
  return metrology::measure(metrology::plan(laser, chain), chain, machine_of(truth, chain), seed);
}

GeometricErrors positioning_of_x(const kinematics::Chain& chain) {
  ModelOptions options;
  options.only = {"EXX"};
  return error_model(chain, options);
}

TEST(Estimate, ABeliefIsThePriorOfTheNextReadings) {
  const kinematics::Chain chain = tool_side_axes();
  const GeometricErrors model = positioning_of_x(chain);
  const GeometricErrors truth = drawn_truth(model, 4);
  const std::vector<Readings> both = {noisy_laser(chain, truth, 1), noisy_laser(chain, truth, 2)};
  const Estimate together = estimate(model, both);
  const Estimate first = estimate(model, {both.data(), 1});
  const Estimate then = estimate(first.belief, {both.data() + 1, 1});
  const VectorXd off = then.value - together.value;
  std::cout << "one after the other against together: " << off.cwiseAbs().maxCoeff() << " mm\n";
  EXPECT_LT(off.cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT(
      (then.belief.covariance.matrix - together.belief.covariance.matrix).cwiseAbs().maxCoeff(),
      1e-6 * together.belief.covariance.matrix.cwiseAbs().maxCoeff());
  EXPECT_LT(then.belief.covariance.matrix(0, 0), first.belief.covariance.matrix(0, 0));
}

TEST(Estimate, NumbersOfZeroVarianceStayAndAreNotConfounded) {
  const kinematics::Chain chain = tool_side_axes();
  GeometricErrors model = positioning_of_x(chain);
  const GeometricErrors truth = drawn_truth(model, 4);
  VectorXd v = values(model.elements);
  v[1] = 3.0_um;
  model.elements = with_values(model.elements, v);
  model.covariance.of.push_back({0, 0, 1});
  model.covariance.matrix = MatrixXd::Zero(2, 2);
  const Readings readings = noisy_laser(chain, truth, 1);
  const Estimate found = estimate(model, {&readings, 1});
  EXPECT_EQ(found.value[1], 3.0_um);
  EXPECT_TRUE(found.confounded.empty());
}

/// A laser, straightness and angles of every slide of a gantry, and no square: what joins the
/// slides is known as well as the instruments stand.
std::vector<Readings> readings_without_square(const GeometricErrors& truth, std::uint64_t seed) {
  const kinematics::Chain chain = measured_gantry();
  std::vector<Readings> result;
  for (const Kind kind : {Kind::Laser, Kind::Straightness, Kind::AngleOptics})
    result.push_back(
        metrology::measure(plan_of(kind, chain), chain, machine_of(truth, chain), seed++));
  return result;
}

TEST(Estimate, WhatReadingsKnowWorseThanMachinesDifferStaysAsIfItWereHeld) {
  const kinematics::Chain chain = measured_gantry();
  ModelOptions of_model;
  of_model.order = 2;
  of_model.harmonics = 2;
  of_model.placement = false;
  const GeometricErrors model = error_model(chain, of_model);
  const GeometricErrors truth = drawn_truth(model, 6, 0.005, 15e-6);
  const std::vector<Readings> readings = readings_without_square(truth, 6);
  const Estimate all = estimate(model, readings);
  EstimateOptions options;
  options.weak_limit = 1.0;
  const Estimate found = estimate(model, readings, options);

  GeometricErrors held = model;
  const std::vector<Coefficient> numbers = coefficients(model.elements);
  int weak = 0;
  for (const ConfoundedCoefficient& one : found.confounded) {
    const Index i = place_of(found, one.name);
    if (i < 0) continue;
    held.covariance.of.push_back(numbers[std::size_t(i)]);
    if (!one.standard_deviation) continue;
    ++weak;
    std::cout << one.name << " known to " << *one.standard_deviation << ", found " << all.value[i]
              << ", true " << values(truth.elements)[i] << "\n";
    EXPECT_GE(*one.standard_deviation, typical_deviation(one.name));
    EXPECT_LT(std::abs(all.value[i]), 5.0 * *one.standard_deviation);
    EXPECT_EQ(found.value[i], 0.0);
  }
  EXPECT_GE(weak, 3) << "squareness of three slides";
  const auto size = Index(held.covariance.of.size());
  held.covariance.matrix = MatrixXd::Zero(size, size);
  const Estimate expected = estimate(held, readings);
  EXPECT_LT((found.value - expected.value).cwiseAbs().maxCoeff(), 1e-9);
  const auto variance = [](const Estimate& of, const Coefficient& number) {
    const auto& all = of.belief.covariance.of;
    const auto k = std::ranges::find(all, number) - all.begin();
    return k < std::ssize(all) ? of.belief.covariance.matrix(k, k) : 0.0;
  };
  // both are linearised at a first solution, and these differ by weak angles of 1e-3 rad
  for (const Coefficient& number : numbers)
    EXPECT_NEAR(variance(found, number), variance(expected, number),
                1e-2 * variance(expected, number))
        << name_of(number, model.elements);
}

TEST(Estimate, AWeakNumberIsHiddenByWhatItsReadingsAreTakenFor) {
  const kinematics::Chain chain = measured_gantry();
  ModelOptions of_model;
  of_model.order = 2;
  of_model.harmonics = 2;
  of_model.placement = false;
  const GeometricErrors model = error_model(chain, of_model);
  EstimateOptions options;
  options.weak_limit = 1.0;
  const Estimate zero = estimate(model, readings_without_square(model, 6), options);
  const VectorXd variance = zero.belief.covariance.matrix.diagonal();
  for (const ConfoundedCoefficient& one : zero.confounded) {
    if (!one.standard_deviation) continue;
    const Index i = place_of(zero, one.name);
    VectorXd v = values(model.elements);
    v[i] = typical_deviation(one.name);
    GeometricErrors truth = model;
    truth.elements = with_values(model.elements, v);
    // the same noise, so that it leaves the difference
    const Estimate moved = estimate(model, readings_without_square(truth, 6), options);
    VectorXd expected = zero.value;
    for (const auto& [name, amount] : one.with)
      if (const Index k = place_of(zero, name); k >= 0) expected[k] += amount * v[i];
    const std::vector<Coefficient> numbers = coefficients(model.elements);
    for (std::size_t c = 0; c < zero.belief.covariance.of.size(); ++c) {
      const auto k = std::ranges::find(numbers, zero.belief.covariance.of[c]) - numbers.begin();
      if (variance[Index(c)] == 0.0) continue;
      EXPECT_NEAR(moved.value[k], expected[k], 0.03 * std::sqrt(variance[Index(c)]))
          << zero.names[std::size_t(k)] << " beside " << one.name;
    }
  }
}

TEST(Estimate, LeavesOutReadingsThatCannotBeTrueAndThoseAlone) {
  const std::uint64_t seed = 20261121;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const kinematics::Chain chain = tool_side_axes();
  const GeometricErrors model = positioning_of_x(chain);
  const GeometricErrors truth = drawn_truth(model, seed);
  Readings readings = noisy_laser(chain, truth, seed);
  for (const Index i : {3, 30, 31}) readings.value[i] += 5.0_um;
  readings.value[12] -= 1.0_um;  // masked by the others until they are gone
  EstimateOptions options;
  const Estimate spoilt = estimate(model, {&readings, 1}, options);
  options.outlier_limit = 5.0;
  const Estimate clean = estimate(model, {&readings, 1}, options);
  EXPECT_EQ(clean.outliers, (std::vector<int>{3, 12, 30, 31}));
  EXPECT_TRUE(spoilt.outliers.empty());
  EXPECT_EQ(clean.degrees_of_freedom, spoilt.degrees_of_freedom - 4);
  EXPECT_GT(spoilt.reduced_chi_square, 100.0);
  EXPECT_NEAR(clean.reduced_chi_square, 1.0, 0.6);
  EXPECT_GT(std::abs(clean.fit_residual[3]), 50.0)
      << "outliers are listed with how far off they are";
}

TEST(Estimate, NeverLeavesOutWhatAloneDeterminesANumber) {
  const kinematics::Chain chain = tool_side_axes();
  GeometricErrors model{
      {element("EXX", Table(make_table(VectorXd::LinSpaced(2, 0, 400), VectorXd::Zero(2),
                                       TableInterpolation::Linear, TableExtrapolation::Hold)))},
      {}};
  Readings readings = noisy_laser(chain, {}, 1, 1);
  readings.value.setConstant(readings.value[0]);  // nonsense: the axis stands still
  EstimateOptions options;
  options.outlier_limit = 3.0;
  const Estimate found = estimate(model, {&readings, 1}, options);
  const Estimate all = estimate(model, {&readings, 1});
  EXPECT_EQ(found.confounded.size(), all.confounded.size());
  EXPECT_GE(found.degrees_of_freedom, 0);
}

TEST(Estimate, TakesTheNoiseFromTheResidualsWhenAsked) {
  const kinematics::Chain chain = tool_side_axes();
  const GeometricErrors model = positioning_of_x(chain);
  Readings readings = noisy_laser(chain, drawn_truth(model, 4), 1);
  for (metrology::SetUp& set_up : readings.plan.set_ups)
    for (metrology::Channel& channel : set_up.channels) channel.noise /= 10.0;
  EstimateOptions options;
  const Estimate stated = estimate(model, {&readings, 1}, options);
  options.noise_from_residuals = true;
  const Estimate scaled = estimate(model, {&readings, 1}, options);
  EXPECT_GT(stated.reduced_chi_square, 30.0);
  EXPECT_EQ(stated.reduced_chi_square, scaled.reduced_chi_square);
  EXPECT_NEAR(scaled.belief.covariance.matrix(0, 0) / stated.belief.covariance.matrix(0, 0),
              stated.reduced_chi_square, 1e-9 * stated.reduced_chi_square);
}

TEST(Estimate, ReadingsWithoutNoiseWeighAsOneNanometre) {
  const kinematics::Chain chain = tool_side_axes();
  const GeometricErrors model = positioning_of_x(chain);
  const GeometricErrors truth = drawn_truth(model, 4);
  Readings readings = noise_free(plan_of(Kind::Laser, chain), chain, truth);
  readings.plan = quiet(readings.plan);
  const Estimate found = estimate(model, {&readings, 1});
  EXPECT_TRUE(found.converged);
  EXPECT_LT(relative_difference(found.value, truth), 1e-9);
  const double sigma = std::sqrt(found.belief.covariance.matrix(0, 0));
  EXPECT_GT(sigma, 1e-7);
  EXPECT_LT(sigma, 2e-6);
}

TEST(Estimate, RefusesWhatItCannotFindInASentence) {
  const kinematics::Chain chain = tool_side_axes();
  const GeometricErrors model = positioning_of_x(chain);
  const Readings good = noisy_laser(chain, {}, 1);
  const auto refusal = [&](const GeometricErrors& m, std::vector<Readings> readings,
                           const EstimateOptions& options = {}) {
    return thrown_text<std::invalid_argument>([&] { estimate(m, readings, options); });
  };
  EXPECT_EQ(refusal(model, {good}), "");
  EXPECT_EQ(refusal({}, {good}), "nothing to identify: the model has no coefficients");
  EXPECT_EQ(refusal(model, {}), "there are no readings");
  const Readings other = noise_free(plan_of(Kind::Laser, three_axes()), three_axes(), {});
  EXPECT_EQ(refusal(model, {good, other}),
            "readings of laser and of laser come from different machines");
  Readings bad = good;
  bad.value[4] = std::nan("");
  EXPECT_EQ(refusal(model, {bad}), "reading 5 of laser: expected a finite number");
  bad = good;
  bad.value.conservativeResize(3);
  EXPECT_HAS(refusal(model, {bad}), "values, seen 3");
  bad = good;
  bad.plan.measurements[2].channel = 9;
  EXPECT_EQ(refusal(model, {bad}), "reading 3 of laser: channel 9 does not exist");
  bad = good;
  bad.value.resize(0);
  EXPECT_HAS(refusal(model, {bad}), "the readings hold no values");
  EXPECT_EQ(refusal({{element("EXX", Repeatability{1e-3, 1})}, {}}, {good}),
            "EXX: a random error cannot be identified");
  EXPECT_HAS(refusal({{element("EXB", Constant{})}, {}}, {good}), "EXB");
  EstimateOptions options;
  options.rank_tolerance = 0.0;
  EXPECT_NE(refusal(model, {good}, options), "");
  GeometricErrors wrong = model;
  wrong.covariance.matrix = MatrixXd::Identity(3, 3);
  EXPECT_HAS(refusal(wrong, {good}), "covariance");
  wrong = model;
  wrong.covariance.of = {{0, 0, 1}};
  wrong.covariance.matrix = -MatrixXd::Identity(1, 1);
  EXPECT_HAS(refusal(wrong, {good}), "positive definite");
}

// Readings of several starts, taken apart by the names of their set-ups.

/// Set-ups a and b from two starts, read in turns; value and temperature are the number of the
/// look.
Readings two_starts() {
  Readings readings{{}, tool_side_axes(), {}, {}, {}};
  readings.plan.instrument = "laser";
  readings.plan.set_ups.resize(4);
  for (std::size_t s = 0; s < 4; ++s) readings.plan.set_ups[s].name = s % 2 == 0 ? "a" : "b";
  readings.sensors = {"room", "nut"};
  readings.plan.measurements.resize(8);
  for (std::size_t i = 0; i < 8; ++i) readings.plan.measurements[i].set_up = int(i) / 2;
  readings.value = VectorXd::LinSpaced(8, 0.0, 7.0);
  readings.T_C.resize(8, 2);
  readings.T_C.col(0).setConstant(20.0);
  readings.T_C.col(1) = readings.value;
  return readings;
}

TEST(Epochs, AStartIsHowOftenTheNameOfItsSetUpCameBefore) {
  Readings readings = two_starts();
  EXPECT_EQ(start_indices(readings.plan), (std::vector<int>{0, 0, 1, 1}));
  EXPECT_EQ(day_log(readings).start_count, 2);
  readings.plan.set_ups[1].name = "c";
  EXPECT_EQ(start_indices(readings.plan), (std::vector<int>{0, 0, 1, 0}));
}

TEST(Epochs, EveryStartAloneHasItsOwnSetUpsReadingsAndTemperatures) {
  const std::vector<Readings> start_count = split_by_start(two_starts());
  ASSERT_EQ(start_count.size(), 2u);
  for (const Readings& one : start_count) {
    EXPECT_EQ(one.plan.instrument, "laser");
    ASSERT_EQ(one.plan.set_ups.size(), 2u);
    EXPECT_EQ(one.plan.set_ups[0].name, "a");
    EXPECT_EQ(one.plan.set_ups[1].name, "b");
    ASSERT_EQ(one.plan.measurements.size(), 4u);
    for (int i = 0; i < 4; ++i) EXPECT_EQ(one.plan.measurements[std::size_t(i)].set_up, i / 2);
  }
  EXPECT_EQ(start_count[0].value, Eigen::Vector4d(0, 1, 2, 3));
  EXPECT_EQ(start_count[1].value, Eigen::Vector4d(4, 5, 6, 7));
  EXPECT_EQ(start_count[1].T_C.col(1), start_count[1].value);
  const MatrixXd dT_K = temperature_rise_K(start_count, {"nut"});
  EXPECT_EQ(dT_K, Vector2d(0, 4));
}

TEST(Epochs, ASensorThatWasNotLoggedIsNamed) {
  EXPECT_EQ(sensor_columns({"nut", "room"}, {"room", "nut"}), (std::vector<Index>{1, 0}));
  const std::string said =
      thrown_text<std::invalid_argument>([&] { (void)sensor_columns({"oven"}, {"room"}); });
  EXPECT_EQ(said, "expected a logged sensor, seen oven");
}

}  // namespace
}  // namespace abbe::errors::identification
