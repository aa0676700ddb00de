#include "sim/compensation/machine_belief.h"
#include "tests/kinematics/machines.h"
#include "tests/test.h"

namespace abbe::sim::compensation {
namespace {

using Eigen::MatrixX3d;
using errors::identification::LinearLaw;
using errors::identification::ThermalModel;

/// constant + per_K . dT, trained from 0 to 20 K.
ThermalModel law(double constant, const std::vector<std::pair<std::string, double>>& per_K) {
  ThermalModel model;
  const auto m = Index(per_K.size());
  LinearLaw linear;
  linear.constant = constant;
  linear.beta.resize(m);
  for (Index k = 0; k < m; ++k) {
    model.names.push_back(per_K[std::size_t(k)].first);
    linear.beta[k] = per_K[std::size_t(k)].second;
  }
  model.lowest = VectorXd::Zero(m);
  model.highest = VectorXd::Constant(m, 20.0);
  model.margin = 0.1;
  model.law = linear;
  return model;
}

ThermalBelief::Term term(const std::string& name, bool slope, const ThermalModel& model) {
  return {errors::parse_element_name(name), slope, model};
}

ControlLog log_of(const std::vector<std::string>& names, const std::vector<double>& time_s,
                  const MatrixXd& values) {
  return {names, Eigen::Map<const VectorXd>(time_s.data(), Index(time_s.size())), values};
}

std::string refusal_of(const std::string& text) {
  return thrown_text<BadInput>([&] { parse_thermal_belief(text, "day.txt"); });
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
    EXPECT_HAS(refusal, place) << text;
  }
}

TEST(ThermalBelief, AnyCutOrChangedByteIsReadOrRefusedButNeverWorse) {
  SeededRandom random(20261130);
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
  MatrixXd T(3, 2);
  T << 21.0, 5.0, 23.0, 6.0, 29.0, 4.0;
  const ControlLog log = log_of({"nut_C", "other"}, {-100.0, 0.0, 50.0}, T);
  ThermalBelief belief{{term("EZZ", false, law(1.0_um, {{"nut", 2.0_um}}))}, true};
  const ThermalSeries since = thermal_series(belief, log, chain);
  EXPECT_EQ(since.value.col(0), Vector3d(1.0_um, 1.0_um + 2 * 2.0_um, 1.0_um + 8 * 2.0_um));
  EXPECT_EQ(since.limited_rows, 0);
  belief.since_start = false;
  belief.terms[0].model.highest[0] = 30.0;
  const ThermalSeries as_read = thermal_series(belief, log, chain);
  EXPECT_NEAR(as_read.value(2, 0), 1.0_um + 29 * 2.0_um, 1e-15);
}

TEST(ThermalSeries, HoldsWhatWasNeverTrainedAtTheEndOfItsRange) {
  const auto chain = machines::gantry();
  MatrixXd T(4, 1);
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
    return thrown_text<std::invalid_argument>([&] { thermal_series(belief, log, chain); });
  };
  const ControlLog log = log_of({"nut_C"}, {0}, MatrixXd::Constant(1, 1, 20.0));
  const ThermalModel model = law(0.0, {{"nut", 1.0}});
  EXPECT_EQ(error_text({{term("EZZ", false, model)}, true}, log), "");
  EXPECT_HAS(error_text({{term("EZZ", false, law(0.0, {{"screw", 1.0}}))}, true}, log), "screw");
  EXPECT_HAS(error_text({{term("EBB", false, model)}, true}, log), "EBB");
  EXPECT_HAS(error_text({{term("EZS", true, model)}, true}, log), "EZS");
  const ControlLog empty = log_of({"nut_C"}, {}, MatrixXd(0, 1));
  EXPECT_NE(error_text({{term("EZZ", false, model)}, true}, empty), "");
  const double none = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(error_text({{term("EZZ", false, model)}, true},
                       log_of({"nut_C"}, {0}, MatrixXd::Constant(1, 1, none))),
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
  MatrixXd T(2, 1);
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
                     log_of({"screw_C"}, {0.0, 1.0}, Vector2d(20.0, 25.0)), chain);
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
                     log_of({"box_C"}, {0.0, 1.0}, Vector2d(20.0, 25.0)), chain);
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
                     log_of({"screw_C"}, {0.0, 1.0}, Vector2d(20.0, 22.0)), chain);
  kinematics::AxisVector q = kinematics::AxisVector::Zero(chain.size());
  const int y = *chain.find('Y'), c = *chain.find('C');
  q[y] = -50.0;
  const auto joints = deviations(course, state_at(q, 5.0));
  EXPECT_NEAR(joints[std::size_t(y)].motion[1], 3.0_um - 50.0 * 20e-6, 1e-15);
  EXPECT_NEAR(joints[std::size_t(c)].location[0], 2.0_um, 1e-15);
  EXPECT_EQ(joints[std::size_t(c)].motion.norm(), 0.0);
}

/// One second in air, then six depths of cut of a second each.
ControlLog log_of_steps(double noise_A, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  ControlLog log{{"spindle_rpm", "current_A"}, VectorXd(701), MatrixXd(701, 2)};
  for (Index i = 0; i <= 700; ++i) {
    log.time_s[i] = 0.01 * double(i);
    const double depth = std::min(6.0, std::floor(log.time_s[i] + 1e-9));
    log.values(i, 0) = 2500.0;
    log.values(i, 1) = 1.1 + 0.8 * depth + noise_A * noise(random);
  }
  return log;
}

double bent(double x) { return 4e-3 * x - 0.3e-3 * x * x; }

CurrentTraining training_of_steps() {
  CurrentTraining part{VectorXd(6), VectorXd(6)};
  for (Index i = 0; i < 6; ++i) {
    part.time_s[i] = 1.9 + double(i);
    part.deviation[i] = bent(0.8 * double(i + 1));
  }
  return part;
}

TEST(ForceBelief, CurrentOfATrainingPartTeachesHowFarItBends) {
  const ControlLog log = log_of_steps(0.0, 1);
  const CurrentLaw law = fit_current_law(log, training_of_steps());
  EXPECT_NEAR(law.air_A, 1.1, 1e-12);
  EXPECT_NEAR(law.c[0], 4e-3, 1e-12);
  EXPECT_NEAR(law.c[1], -0.3e-3, 1e-12);
  const TimeSeries course = current_deflection(law, log);
  EXPECT_EQ(value_at(course, 0.5)[0], 0.0) << "in air nothing bends";
  EXPECT_NEAR(value_at(course, 3.5)[0], bent(2.4), 1e-12);
}

TEST(ForceBelief, LawIsHeldBeyondWhatItWasTrainedWith) {
  CurrentLaw law = fit_current_law(log_of_steps(0.0, 1), training_of_steps());
  ControlLog log = log_of_steps(0.0, 1);
  log.values(700, 1) = 100.0;
  EXPECT_NEAR(current_deflection(law, log).value(700, 0), bent(4.8), 1e-12);
}

TEST(ForceBelief, NoiseOfTheCurrentIsTakenDownByAMean) {
  SCOPED_TRACE("seed 20261121");
  const ControlLog log = log_of_steps(0.02, 20261121);
  const CurrentLaw law = fit_current_law(log, training_of_steps(), 0.5);
  const TimeSeries course = current_deflection(law, log);
  double sum = 0.0;
  for (Index k = 2; k <= 6; ++k)
    sum += std::pow(value_at(course, double(k) + 0.95)[0] - bent(0.8 * double(k)), 2);
  RecordProperty("rms_um", std::to_string(1e3 * std::sqrt(sum / 5)));
  EXPECT_LT(std::sqrt(sum / 5), 0.05e-3);
}

TEST(ForceBelief, TrainingThatTeachesNothingIsRefused) {
  const ControlLog log = log_of_steps(0.0, 1);
  CurrentTraining part = training_of_steps();
  part.time_s.setConstant(3.9);  // one depth alone
  EXPECT_THROW(fit_current_law(log, part), std::invalid_argument);
  part = training_of_steps();
  part.time_s.setZero();  // never in air before
  EXPECT_THROW(fit_current_law(log, part), std::invalid_argument);
  EXPECT_THROW(fit_current_law(log, {VectorXd(1), VectorXd(1)}), std::invalid_argument);
  ControlLog blind = log;
  blind.names[1] = "torque";
  EXPECT_THROW(fit_current_law(blind, training_of_steps()), std::invalid_argument);
}

TEST(ForceBelief, DynamometerGivesTheForceAtTheTip) {
  ControlLog log{
      {"FX_dynamometer_N", "FY_dynamometer_N", "FZ_dynamometer_N"}, VectorXd(2), MatrixXd(2, 3)};
  log.time_s << 0.0, 1.0;
  log.values << 0, 0, 0, 10, -20, 40;
  const LoadSeries course = dynamometer_load(log);
  EXPECT_EQ(load_at(course, 0.5).tool_wrench_t[2], 20.0);
  EXPECT_TRUE(load_at(course, 1.5).tool_wrench_t.isZero(0.0)) << "nothing after the last reading";
  EXPECT_TRUE(load_at({}, 0.0).tool_wrench_t.isZero(0.0));
}

TEST(Mirror, ReadingsThatAreLinearOverThePartAreMetEverywhere) {
  std::mt19937_64 random(20261121);
  std::uniform_real_distribution<double> place(-20, 20);
  MatrixX3d read_at(300, 3), points(500, 3);
  for (Index i = 0; i < read_at.rows(); ++i) read_at.row(i) << place(random), place(random), 3.0;
  for (Index i = 0; i < points.rows(); ++i)
    points.row(i) << 0.8 * place(random), 0.8 * place(random), 3.0;
  const auto linear = [](const auto& p) { return 4e-3 + 1e-4 * p[0] - 2e-4 * p[1]; };
  VectorXd deviation(300);
  for (Index i = 0; i < 300; ++i) deviation[i] = linear(read_at.row(i));
  const VectorXd between = interpolate_readings(read_at, deviation, points, 50.0);
  double worst = 0.0;
  for (Index i = 0; i < 500; ++i)
    worst = std::max(worst, std::abs(between[i] - linear(points.row(i))));
  std::cout << "largest error between readings " << worst << " mm\n";
  EXPECT_LT(worst, 1e-12);
}

TEST(Mirror, ReadingsOwnPlaceHasItsOwnValueAndFarPlacesHaveNone) {
  MatrixX3d read_at(2, 3), points(3, 3);
  read_at << 0, 0, 0, 10, 0, 0;
  points << 0, 0, 0, 10, 0, 0, 200, 0, 0;
  const VectorXd between = interpolate_readings(read_at, Vector2d(0.5, -0.25), points, 20.0);
  EXPECT_EQ(between[0], 0.5);
  EXPECT_EQ(between[1], -0.25);
  EXPECT_EQ(between[2], 0.0);
  EXPECT_THROW(interpolate_readings(MatrixX3d(0, 3), VectorXd(0), points, 1.0),
               std::invalid_argument);
}

/// A part whose points are cut one after another by a tool that is displaced by `move(t)`.
template <typename Move, typename Normal>
PartDeviations cut_by(Index n, const Move& move, const Normal& normal) {
  PartDeviations part{MatrixX3d(n, 3), VectorXd(n), VectorXd(n)};
  for (Index i = 0; i < n; ++i) {
    const double t = 0.01 * double(i);
    const Vector3d n_w = normal(i);
    part.normals.row(i) = n_w.transpose();
    part.deviation[i] = n_w.dot(move(t));
    part.time_s[i] = t;
  }
  return part;
}

TEST(Mirror, DisplacementOfTheToolIsFoundWhereNormalsSeeIt) {
  const auto move = [](double t) { return Vector3d(2e-3 + 1e-4 * t, -1e-3, 3e-3); };
  const auto normal = [](Index i) {
    const double a = 2.4 * double(i);
    return Vector3d(std::sin(0.7) * std::cos(a), std::sin(0.7) * std::sin(a), std::cos(0.7));
  };
  DisplacementOptions exact;
  exact.damping = 0.0;
  const DisplacementSeries course = displacement_from_deviations(cut_by(1000, move, normal), exact);
  double worst = 0.0;
  for (double t = 0.1; t < 9.9; t += 0.01)
    worst = std::max(worst, (displacement_at(course, t) - move(t)).norm());
  std::cout << "largest error of the displacement " << worst << " mm\n";
  EXPECT_LT(worst, 1e-6);
}

TEST(Mirror, WhatIsLinearAlongAPassIsMetToItsEndsAndPassesAreKeptApart) {
  // passes that follow one another without a pause, each with a line of its own
  const double slope[] = {3e-3, -5e-3, 0.0, 8e-3}, level[] = {1e-3, -4e-3, 2e-3, 0.0};
  for (const Index in_a_pass : {3, 8, 41, 100}) {
    PartDeviations part{MatrixX3d(4 * in_a_pass, 3), VectorXd(4 * in_a_pass),
                        VectorXd(4 * in_a_pass), Eigen::VectorXi(4 * in_a_pass)};
    for (Index i = 0; i < 4 * in_a_pass; ++i) {
      const Index pass = i / in_a_pass;
      part.normals.row(i) << 0, -0.6, 0.8;
      part.time_s[i] = 0.02 * double(i);
      part.pass[i] = int(pass);
      part.deviation[i] = level[pass] + slope[pass] * part.time_s[i];
    }
    DisplacementOptions exact;
    exact.damping = 1e-6;
    const DisplacementSeries course = displacement_from_deviations(part, exact);
    double worst = 0.0;
    for (Index i = 0; i < part.time_s.size(); ++i)
      worst = std::max(worst,
                       std::abs(part.normals.row(i).dot(displacement_at(course, part.time_s[i])) -
                                part.deviation[i]));
    // a pass of less than two groups has one displacement: half its length is not met
    const double bound = in_a_pass < 16 ? 8e-3 * 0.02 * double(in_a_pass - 1) / 2 + 1e-12 : 1e-12;
    std::cout << in_a_pass << " points a pass: off by " << worst << " mm, bound " << bound << '\n';
    EXPECT_LT(worst, bound);
    for (Index i = 1; i < course.time_s.size(); ++i)
      EXPECT_GT(course.time_s[i], course.time_s[i - 1]);
  }
}

TEST(Mirror, PointsOfOneInstantHaveOneDisplacement) {
  PartDeviations part{MatrixX3d(40, 3), VectorXd(40), VectorXd(40)};
  for (Index i = 0; i < 40; ++i) {
    part.normals.row(i) << 1, 0, 0;
    part.deviation[i] = i % 2 == 0 ? 1e-3 : 3e-3;
    part.time_s[i] = i < 20 ? 1.0 : 2.0;
  }
  DisplacementOptions nearly;
  nearly.damping = 1e-6;
  const DisplacementSeries course = displacement_from_deviations(part, nearly);
  ASSERT_EQ(course.time_s.size(), 2);
  EXPECT_NEAR(displacement_at(course, 1.0).x(), 2e-3, 1e-12);
  EXPECT_NEAR(displacement_at(course, 2.0).x(), 2e-3, 1e-12);
}

TEST(Mirror, DirectionThatNoNormalSeesStaysUnmoved) {
  const auto move = [](double) { return Vector3d(1.0, 1.0, 1e-3); };
  const auto up = [](Index) { return Vector3d(0, 0, 1); };
  const DisplacementSeries course = displacement_from_deviations(cut_by(100, move, up));
  const Vector3d found = displacement_at(course, 0.5);
  EXPECT_EQ(found.x(), 0.0);
  EXPECT_EQ(found.y(), 0.0);
  EXPECT_NEAR(found.z(), 1e-3,
              1e-3 * DisplacementOptions{}.damping * DisplacementOptions{}.damping);
}

TEST(Mirror, GapInTimePartsNeighbours) {
  PartDeviations part{MatrixX3d(20, 3), VectorXd(20), VectorXd(20)};
  for (Index i = 0; i < 20; ++i) {
    part.normals.row(i) << 0, 0, 1;
    part.deviation[i] = i < 12 ? 1e-3 : -1e-3;
    part.time_s[i] = 0.01 * double(i) + (i < 12 ? 0.0 : 100.0);
  }
  DisplacementOptions exact;
  exact.damping = 0.0;
  const DisplacementSeries course = displacement_from_deviations(part, exact);
  EXPECT_NEAR(displacement_at(course, 0.1).z(), 1e-3, 1e-15);
  EXPECT_NEAR(displacement_at(course, 100.15).z(), -1e-3, 1e-15);
  EXPECT_EQ(displacement_at({}, 1.0), Vector3d::Zero());
}

}  // namespace
}  // namespace abbe::sim::compensation
