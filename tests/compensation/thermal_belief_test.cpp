#include "sim/compensation/machine_belief.h"

#include <cmath>
#include <iostream>
#include <limits>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "tests/kinematics/machines.h"

namespace abbe::sim::compensation {
namespace {

using namespace abbe::literals;
using Eigen::Vector3d;
using errors::identification::LinearLaw;
using errors::identification::ThermalModel;

/// constant + per_K . dT, trained from 0 to 20 K.
ThermalModel law(double constant, const std::vector<std::pair<std::string, double>>& per_K) {
  ThermalModel model;
  const auto m = Eigen::Index(per_K.size());
  LinearLaw linear;
  linear.constant = constant;
  linear.beta.resize(m);
  for (Eigen::Index k = 0; k < m; ++k) {
    model.names.push_back(per_K[std::size_t(k)].first);
    linear.beta[k] = per_K[std::size_t(k)].second;
  }
  model.lowest = Eigen::VectorXd::Zero(m);
  model.highest = Eigen::VectorXd::Constant(m, 20.0);
  model.margin = 0.1;
  model.law = linear;
  return model;
}

ThermalBelief::Term term(const std::string& name, bool slope, const ThermalModel& model) {
  return {errors::parse_element_name(name), slope, model};
}

ControlLog log_of(const std::vector<std::string>& names, const std::vector<double>& time_s,
                  const Eigen::MatrixXd& values) {
  return {names, Eigen::Map<const Eigen::VectorXd>(time_s.data(), Eigen::Index(time_s.size())),
          values};
}

std::string refusal_of(const std::string& text) {
  try {
    parse_thermal_belief(text, "day.txt");
    return "";
  } catch (const BadInput& fault) {
    return fault.what();
  }
}

// ---------------------------------------------------------------- text

ThermalBelief drawn(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto any = [&] { return std::ldexp(unit(random), int(40 * unit(random))); };
  ThermalBelief belief;
  belief.since_start = seed % 2 == 0;
  for (const char* name : {"EXX", "EZS", "EX0C", "EBY"})
    belief.terms.push_back(term(name, false, law(any(), {{"S01_nut", any()}, {"S 2", any()}})));
  belief.terms.push_back(term("EYY", true, law(any(), {{"S01_nut", any()}})));
  for (ThermalBelief::Term& one : belief.terms) {
    one.model.lowest.array() -= std::abs(any());
    one.model.sigma = std::abs(any());
  }
  return belief;
}

TEST(ThermalBelief, ComesBackFromItsTextBitForBit) {
  for (unsigned seed = 1; seed <= 50; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    const ThermalBelief belief = drawn(seed);
    const std::string text = to_text(belief, {"made of\nnothing", ""});
    const ThermalBelief back = parse_thermal_belief(text, "day.txt");
    EXPECT_EQ(to_text(back, {"made of nothing", ""}), text);
    EXPECT_EQ(back.since_start, belief.since_start);
    ASSERT_EQ(back.terms.size(), belief.terms.size());
    for (std::size_t k = 0; k < back.terms.size(); ++k) {
      const ThermalBelief::Term &is = back.terms[k], &was = belief.terms[k];
      EXPECT_EQ(is.name, was.name);
      EXPECT_EQ(is.slope, was.slope);
      EXPECT_EQ(is.model.names, was.model.names);
      EXPECT_EQ(is.model.lowest, was.model.lowest);
      EXPECT_EQ(is.model.sigma, was.model.sigma);
      EXPECT_EQ(std::get<LinearLaw>(is.model.law).beta, std::get<LinearLaw>(was.model.law).beta);
      EXPECT_EQ(std::get<LinearLaw>(is.model.law).constant,
                std::get<LinearLaw>(was.model.law).constant);
    }
  }
}

TEST(ThermalBelief, TextWithWindowsLineEndsReadsTheSame) {
  const std::string text = to_text(drawn(3), {"a head"});
  std::string windows = "\xEF\xBB\xBF";
  for (const char c : text) windows += c == '\n' ? "\r\n" : std::string(1, c);
  EXPECT_EQ(to_text(parse_thermal_belief(windows, "day.txt"), {"a head"}), text);
}

TEST(ThermalBelief, TextWithoutTermsBelievesInNothing) {
  EXPECT_TRUE(parse_thermal_belief(to_text({}), "day.txt").terms.empty());
}

TEST(ThermalBelief, RefusesWithTheLineWhatItWouldNotWrite) {
  const std::string head = "# made up\nabbe thermal belief 1\nsince_start 1\n";
  const std::string model = to_text(law(0.0, {{"S01", 1.0}}));
  EXPECT_EQ(refusal_of(head + "term EXX offset\n" + model), "");
  const std::pair<std::string, std::string> cases[] = {
      {"", "day.txt:1:"},
      {"abbe thermal model 1\n", "day.txt:1:"},
      {"abbe thermal belief 1\n", "day.txt:1:"},
      {"abbe thermal belief 1\nsince_start 2\n", "day.txt:2:"},
      {head + "EXX\n", "day.txt:4:"},
      {head + "term EXX\n" + model, "day.txt:4:"},
      {head + "term  offset\n" + model, "day.txt:4:"},
      {head + "term EXX tilt\n" + model, "day.txt:4:"},
      {head + "term EQQ offset\n" + model, "day.txt:4:"},
      {head + "term EZS slope\n" + model, "day.txt:4:"},
      {head + "term EC0Y slope\n" + model, "day.txt:4:"},
      {head + "term EXX offset\n", "day.txt:5:"},
      {head + "term EXX offset\nabbe thermal model 1\nkind magic\n", "day.txt:6:"},
      {head + "term EXX offset\n" + model + "term EXX offset\n" + model, "day.txt:17:"},
      {head + "term EXX offset\n" + model + "term EYY slope\nabbe\n", "day.txt:18:"},
      {head + "term EXX offset\n" + model.substr(0, model.find("beta")) + "beta nan\n",
       "day.txt:15:"},
  };
  for (const auto& [text, place] : cases) {
    const std::string refusal = refusal_of(text);
    EXPECT_NE(refusal.find(place), std::string::npos) << text << "\nsaid: " << refusal;
  }
}

TEST(ThermalBelief, AnyCutOrChangedByteIsReadOrRefusedButNeverWorse) {
  const unsigned seed = 20261130;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const std::string text = to_text(drawn(2), {"a head"});
  int refused = 0;
  for (std::size_t cut = 0; cut < text.size(); cut += 7)
    refused += !refusal_of(text.substr(0, cut)).empty();
  for (int i = 0; i < 2000; ++i) {
    std::string changed = text;
    changed[random() % changed.size()] = char(random() % 256);
    refused += !refusal_of(changed).empty();
  }
  std::cout << refused << " of " << text.size() / 7 + 2001 << " broken texts refused\n";
  EXPECT_GT(refused, 1000);
}

// ---------------------------------------------------------------- over a day

TEST(ThermalSeries, CountsFromTheFirstRowOrAsRead) {
  const auto chain = machines::gantry();
  Eigen::MatrixXd T(3, 2);
  T << 21.0, 5.0, 23.0, 6.0, 29.0, 4.0;
  const ControlLog log = log_of({"nut_C", "other"}, {-100.0, 0.0, 50.0}, T);
  ThermalBelief belief{{term("EZZ", false, law(1.0_um, {{"nut", 2.0_um}}))}, true};
  const ThermalSeries since = thermal_series(belief, log, chain);
  EXPECT_EQ(since.value.col(0), Eigen::Vector3d(1.0_um, 1.0_um + 2 * 2.0_um, 1.0_um + 8 * 2.0_um));
  EXPECT_EQ(since.limited_rows, 0);
  belief.since_start = false;
  belief.terms[0].model.highest[0] = 30.0;
  const ThermalSeries as_read = thermal_series(belief, log, chain);
  EXPECT_NEAR(as_read.value(2, 0), 1.0_um + 29 * 2.0_um, 1e-15);
}

TEST(ThermalSeries, HoldsWhatWasNeverTrainedAtTheEndOfItsRange) {
  const auto chain = machines::gantry();
  Eigen::MatrixXd T(4, 1);
  T << 20.0, 41.9, 60.0, 17.0;  // trained to 20 K above, 10 % more either way are let through
  const ThermalBelief belief{{term("EZZ", false, law(0.0, {{"nut", 1.0_um}})),
                              term("EYY", true, law(0.0, {{"nut", 1e-6}}))},
                             true};
  const ThermalSeries course = thermal_series(belief, log_of({"nut_C"}, {0, 1, 2, 3}, T), chain);
  EXPECT_EQ(course.limited_rows, 2);
  EXPECT_NEAR(course.value(1, 0), 21.9_um, 1e-15);
  EXPECT_NEAR(course.value(2, 0), 22.0_um, 1e-15);
  EXPECT_NEAR(course.value(3, 0), -2.0_um, 1e-15);
  EXPECT_NEAR(course.value(3, 1), -2.0e-6, 1e-18);
}

TEST(ThermalSeries, NamesWhatIsMissing) {
  const auto chain = machines::gantry();
  const auto error_text = [&](const ThermalBelief& belief, const ControlLog& log) {
    try {
      thermal_series(belief, log, chain);
      return std::string();
    } catch (const std::invalid_argument& fault) {
      return std::string(fault.what());
    }
  };
  const ControlLog log = log_of({"nut_C"}, {0}, Eigen::MatrixXd::Constant(1, 1, 20.0));
  const ThermalModel model = law(0.0, {{"nut", 1.0}});
  EXPECT_EQ(error_text({{term("EZZ", false, model)}, true}, log), "");
  EXPECT_NE(error_text({{term("EZZ", false, law(0.0, {{"screw", 1.0}}))}, true}, log).find("screw"),
            std::string::npos);
  EXPECT_NE(error_text({{term("EBB", false, model)}, true}, log).find("EBB"), std::string::npos);
  EXPECT_NE(error_text({{term("EZS", true, model)}, true}, log).find("EZS"), std::string::npos);
  const ControlLog empty = log_of({"nut_C"}, {}, Eigen::MatrixXd(0, 1));
  EXPECT_NE(error_text({{term("EZZ", false, model)}, true}, empty), "");
  const double none = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(error_text({{term("EZZ", false, model)}, true},
                       log_of({"nut_C"}, {0}, Eigen::MatrixXd::Constant(1, 1, none))),
            "");
}

// ---------------------------------------------------------------- on the chain

kinematics::AxisState state_at(const kinematics::AxisVector& q, double time_s) {
  kinematics::AxisState state;
  state.q = q;
  state.time_s = time_s;
  return state;
}

/// How far these deviations move the tip on the workpiece, along axes of the bed.
Vector3d moved_b(const kinematics::Chain& chain, const kinematics::AxisVector& q,
                 const std::vector<kinematics::JointDeviation>& joints) {
  return chain.workpiece_in_bed(q).linear() * (chain.tool_in_workpiece(q, joints).translation() -
                                               chain.tool_in_workpiece(q).translation());
}

TEST(ThermalDeviations, StandAsReadUntilTheNextReading) {
  const auto chain = machines::gantry();
  Eigen::MatrixXd T(2, 1);
  T << 20.0, 22.0;
  const ThermalSeries course =
      thermal_series({{term("EZZ", false, law(0.0, {{"nut", 1.0_um}}))}, true},
                     log_of({"nut_C"}, {0.0, 60.0}, T), chain);
  const int z = *chain.find('Z');
  const kinematics::AxisVector q = kinematics::AxisVector::Zero(chain.size());
  for (const auto& [time_s, value] :
       {std::pair{-1.0, 0.0}, {0.0, 0.0}, {59.999, 0.0}, {60.0, 2.0_um}, {1e9, 2.0_um}})
    EXPECT_EQ(deviations(course, state_at(q, time_s))[std::size_t(z)].motion[2], value) << time_s;
}

// By hand: a screw that has grown by 50 um/m carries a table that is commanded to go +100 mm in X,
// hence itself -100 mm, by 5 um farther; the tool then stands 5 um farther in +X on the table.
TEST(ThermalDeviations, SlopeCountsTheTravelOfThePrimedCarriageItself) {
  const auto chain = machines::moving_table();
  const int x = *chain.find('X');
  ASSERT_EQ(chain.joints()[std::size_t(x)].side, kinematics::Side::Workpiece);
  const ThermalSeries course =
      thermal_series({{term("EXX", true, law(0.0, {{"screw", 10e-6}}))}, true},
                     log_of({"screw_C"}, {0.0, 1.0}, Eigen::Vector2d(20.0, 25.0)), chain);
  kinematics::AxisVector q = kinematics::AxisVector::Zero(chain.size());
  q[x] = 100.0;
  const auto joints = deviations(course, state_at(q, 1.0));
  EXPECT_NEAR(joints[std::size_t(x)].motion[0], -5.0_um, 1e-15);
  const Vector3d moved = moved_b(chain, q, joints);
  EXPECT_LT((moved - Vector3d(5.0_um, 0, 0)).norm(), 1e-12);
}

// By hand: a spindle that has grown by 10 um towards the part, its head turned by A = 30 deg, moves
// the tip along the tool: (0, sin A, -cos A) times 10 um.
TEST(ThermalDeviations, SpindleGrowthGoesAlongTheTurnedTool) {
  const auto chain = machines::gantry();
  const ThermalSeries course =
      thermal_series({{term("EZS", false, law(0.0, {{"box", -2.0_um}}))}, true},
                     log_of({"box_C"}, {0.0, 1.0}, Eigen::Vector2d(20.0, 25.0)), chain);
  kinematics::AxisVector q = kinematics::AxisVector::Zero(chain.size());
  q[*chain.find('A')] = 30.0_deg;
  const Vector3d moved = moved_b(chain, q, deviations(course, state_at(q, 1.0)));
  EXPECT_LT((moved - 10.0_um * Vector3d(0, 0.5, -std::sqrt(0.75))).norm(), 1e-12);
}

TEST(ThermalDeviations, TermsOfOneElementAddUp) {
  const auto chain = machines::gantry();
  const ThermalSeries course =
      thermal_series({{term("EYY", false, law(3.0_um, {{"screw", 0.0}})),
                       term("EYY", true, law(0.0, {{"screw", 10e-6}})),
                       term("EX0C", false, law(0.0, {{"screw", 1.0_um}}))},
                      true},
                     log_of({"screw_C"}, {0.0, 1.0}, Eigen::Vector2d(20.0, 22.0)), chain);
  kinematics::AxisVector q = kinematics::AxisVector::Zero(chain.size());
  const int y = *chain.find('Y'), c = *chain.find('C');
  q[y] = -50.0;
  const auto joints = deviations(course, state_at(q, 5.0));
  EXPECT_NEAR(joints[std::size_t(y)].motion[1], 3.0_um - 50.0 * 20e-6, 1e-15);
  EXPECT_NEAR(joints[std::size_t(c)].location[0], 2.0_um, 1e-15);
  EXPECT_EQ(joints[std::size_t(c)].motion.norm(), 0.0);
}

}  // namespace
}  // namespace abbe::sim::compensation
