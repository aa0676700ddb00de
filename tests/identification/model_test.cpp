#include "errors/identification/model.h"
#include "tests/identification/measured.h"
#include "tests/test.h"

namespace abbe::errors::identification {
namespace {

using metrology::Kind;

std::set<std::string> names_of(const GeometricErrors& model) {
  std::set<std::string> names;
  for (const Element& element : model.elements) names.insert(to_string(element.name));
  return names;
}

kinematics::Chain limited_platform() {
  using enum kinematics::Side;
  using enum kinematics::Motion;
  const Vector3d ex(1, 0, 0), ez(0, 0, 1);
  return kinematics::Chain({joint('S', Workpiece, Rotary, ex, {0, 0, 0}),
                            within(joint('X', Workpiece, Linear, ex, {-80, -60, 0}), -20, 80),
                            within(joint('Z', Tool, Linear, ez, {100, -60, -40}), -20, 80)},
                           at(0, 0, 0), at(0, 0, 0));
}

TEST(Model, TheGantryHasItsFortyTwoAndFourElements) {
  const GeometricErrors model = error_model(measured_gantry());
  EXPECT_EQ(model.elements.size(), 46u);
  const std::set<std::string> names = names_of(model);
  EXPECT_EQ(names.size(), 46u);
  for (const char* name : {"EXX", "ECZ", "ECC", "EAA", "EXS", "EBS", "EC0Y", "EB0Z", "EA0Z", "EB0A",
                           "EC0A", "EA0C", "EB0C", "EY0A", "EZ0A", "EX0C", "EY0C"})
    EXPECT_TRUE(names.count(name)) << name;
  EXPECT_NO_THROW(bind(model, measured_gantry()));
  EXPECT_EQ(values(model.elements).cwiseAbs().maxCoeff(), 0.0);
}

TEST(Model, ThePlatformHasPengsThirteenBesideItsSpindle) {
  std::set<std::string> names = names_of(error_model(limited_platform()));
  std::erase_if(names, [](const std::string& name) { return name.back() == 'S'; });
  EXPECT_EQ(names, (std::set<std::string>{"EXX", "EYX", "EZX", "EAX", "EBX", "ECX", "EXZ", "EYZ",
                                          "EZZ", "EAZ", "EBZ", "ECZ", "EB0Z"}));
}

TEST(Model, ConstantsAndSlopesOfStraightnessStayZeroUnlessAskedFor) {
  const kinematics::Chain chain = measured_gantry();
  for (const Basis basis : {Basis::Legendre, Basis::Polynomial, Basis::Spline}) {
    ModelOptions options;
    options.slides = basis;
    const auto held = [&](const char* name) {
      options.only = {name};
      const GeometricErrors model = error_model(chain, options);
      std::vector<int> numbers;
      for (const Coefficient& c : model.covariance.of) numbers.push_back(c.number);
      return numbers;
    };
    const int last = basis == Basis::Spline ? 4 : 1;
    EXPECT_EQ(held("EXX"), std::vector<int>{0});
    EXPECT_EQ(held("EAX"), std::vector<int>{0});
    EXPECT_EQ(held("EYX"), (std::vector<int>{0, last}));
    EXPECT_EQ(held("EC0Y"), std::vector<int>{});
    options.straightness_slopes = options.constants = true;
    EXPECT_EQ(held("EYX"), std::vector<int>{});
  }
}

TEST(Model, AnElementWithoutANumberToFindIsLeftOut) {
  ModelOptions options;
  options.order = 1;
  options.harmonics = 0;
  options.backlash = options.locations = false;
  EXPECT_EQ(names_of(error_model(measured_gantry(), options)),
            (std::set<std::string>{"EXX", "EAX", "EBX", "ECX", "EYY", "EAY", "EBY", "ECY", "EZZ",
                                   "EAZ", "EBZ", "ECZ", "EXS", "EYS", "EZS", "EAS", "EBS"}));
  options.orders = {{"EYX", 2}, {"ECC", 1}};
  options.only = {"EYX", "ECC", "EXX"};
  EXPECT_EQ(names_of(error_model(measured_gantry(), options)),
            (std::set<std::string>{"EXX", "EYX", "ECC"}));
}

TEST(Model, WhatCannotBeMeantIsRefusedByName) {
  const auto refusal = [](const kinematics::Chain& chain, const ModelOptions& options) {
    return thrown_text<std::invalid_argument>([&] { error_model(chain, options); });
  };
  ModelOptions options;
  options.only = {"EXB"};
  EXPECT_EQ(refusal(measured_gantry(), options),
            "expected an element that applies to this machine, seen EXB");
  options.only = {};
  options.orders = {{"EXX", -1}};
  EXPECT_EQ(refusal(measured_gantry(), options), "EXX: expected an order from 0 to 60, seen -1");
  options.orders = {{"nonsense", 1}};
  EXPECT_HAS(refusal(measured_gantry(), options), "seen nonsense");
  options.orders = {};
  options.order = 61;
  EXPECT_HAS(refusal(measured_gantry(), options), "from 0 to 60");
  EXPECT_EQ(refusal(gantry(), {}), "EXX: the travel of its axis is not stated");
}

// ---- orders

/// Readings of a laser along X and Y over many targets, and of straightness, with noise.
std::vector<metrology::Readings> long_lines(const GeometricErrors& truth, std::uint64_t seed) {
  std::vector<metrology::Readings> readings;
  const kinematics::Chain chain = measured_gantry();
  for (const Kind kind : {Kind::Laser, Kind::Straightness, Kind::AngleOptics}) {
    metrology::Instrument instrument = metrology::typical_instrument(kind);
    instrument.targets = 31;
    instrument.runs = 2;
    instrument.axes = {'X', 'C'};
    if (kind != Kind::AngleOptics) instrument.axes = {'X'};
    readings.push_back(metrology::measure(metrology::plan(instrument, chain), chain,
                                          machine_of(truth, chain), seed++));
  }
  return readings;
}

TEST(ChooseOrders, FindsTheOrderOfEveryCurveThatIsSeen) {
  const std::uint64_t seed = 20261121;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  ModelOptions options;
  options.orders = {{"EXX", 5}, {"EYX", 3}, {"EZX", 2}, {"EBX", 4}, {"ECX", 1}, {"ECC", 2}};
  const std::map<std::string, int> truth_orders = options.orders;
  options.only = {"EXX", "EYX", "EZX", "EBX", "ECX", "ECC"};
  const GeometricErrors truth = drawn_truth(error_model(measured_gantry(), options), seed);
  const OrderChoice choice = choose_orders(long_lines(truth, seed), options);
  for (const auto& [name, order] : choice.orders) {
    std::cout << name << ": order " << order << " of " << truth_orders.at(name) << ", prediction "
              << choice.rms.at(name)[order] << " standard deviations\n";
    EXPECT_EQ(order, truth_orders.at(name)) << name;
    // the others, at their highest order, add to the noise of what is predicted
    EXPECT_LT(choice.rms.at(name)[order], 2.5) << name;
    EXPECT_GT(choice.rms.at(name)[order - 1], 1.2 * choice.rms.at(name)[order]) << name;
    EXPECT_GT(choice.rms.at(name)[0], 5.0) << name;
  }
  EXPECT_EQ(choice.orders.size(), 6u);
}

TEST(ChooseOrders, AnElementThatNoReadingSeesGetsNoOrder) {
  ModelOptions options;
  options.only = {"EXX", "EYY", "EXA"};
  const GeometricErrors truth = drawn_truth(error_model(measured_gantry(), options), 3);
  const std::vector<metrology::Readings> readings = long_lines(truth, 4);
  const OrderChoice choice = choose_orders({readings.data(), 1}, options);
  EXPECT_TRUE(choice.orders.count("EXX"));
  EXPECT_FALSE(choice.orders.count("EYY"));
}

TEST(ChooseOrders, RefusesWhatHasNoNestedOrdersAndTooFewTargets) {
  const GeometricErrors truth = drawn_truth(error_model(measured_gantry()), 3);
  const std::vector<metrology::Readings> readings = long_lines(truth, 4);
  ModelOptions spline;
  spline.slides = Basis::Spline;
  EXPECT_THROW(choose_orders(readings, spline), std::invalid_argument);
  OrderOptions options;
  options.folds = 1;
  EXPECT_THROW(choose_orders(readings, {}, options), std::invalid_argument);
  options.folds = 100000;
  EXPECT_THROW(choose_orders(readings, {}, options), std::invalid_argument);
  EXPECT_THROW(choose_orders({}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::errors::identification
