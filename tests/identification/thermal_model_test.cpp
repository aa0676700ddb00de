#include "errors/identification/thermal_model.h"
#include "kinematics/text.h"
#include "tests/identification/thermal_options.h"
#include "tests/test.h"

namespace {

using namespace abbe::errors::identification;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr ModelKind all_kinds[] = {ModelKind::Linear,      ModelKind::Ridge,
                                   ModelKind::Lasso,       ModelKind::SupportVectors,
                                   ModelKind::KernelRidge, ModelKind::Network};

/// Days on which three masses warm up; the drift follows two of them, plus noise and a shift of its
/// own every day.
struct Warmup {
  int days = 6;
  int rows = 60;
  double noise = 0.0;
  double day_shift = 0.0;
  unsigned seed = 1;
};
ThermalData warmup(const Warmup& of) {
  std::mt19937 random(of.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit;
  const int n = of.days * of.rows;
  ThermalData data{{"spindle", "nut", "bed"}, MatrixXd(n, 3), VectorXd(n), {}};
  for (int day = 0, i = 0; day < of.days; ++day) {
    const double room = 18 + 6 * unit(random), heat = 0.6 + 0.8 * unit(random);
    const double shift = of.day_shift * normal(random);
    for (int k = 0; k < of.rows; ++k, ++i) {
      const double t = double(k) / of.rows;
      data.T.row(i) << room + 15 * heat * (1 - std::exp(-6 * t)),
          room + 9 * heat * (1 - std::exp(-2.5 * t)) + 0.5 * std::sin(9 * t), room + 3 * heat * t;
      data.y(i) =
          2.0 * (data.T(i, 0) - 20) - 1.2 * (data.T(i, 2) - 20) + shift + of.noise * normal(random);
      data.run.push_back(day);
    }
  }
  return data;
}

/// What the reader says of a text.
std::string refusal(std::string_view text) {
  return abbe::thrown_text<abbe::BadInput>([&] { (void)parse_thermal_model(text, "model.txt"); },
                                           "accepted");
}

}  // namespace

TEST(ThermalModel, EveryKindLearnsAWarmUpAndPredictsADayThatItNeverSaw) {
  const ThermalData data = warmup({.days = 16});
  const double untouched = spread(data.y.array() - data.y.mean()).rms;
  for (const ModelKind kind : all_kinds) {
    const Validation left_out = cross_validate(data, options_of(kind));
    ASSERT_EQ(left_out.status, FitStatus::Ok) << to_string(kind);
    std::cout << to_string(kind) << ": rms " << left_out.overall.rms << " of " << untouched
              << " on days left out, " << left_out.outside << " of " << left_out.rows
              << " rows outside the trained range\n";
    const bool exact = kind == ModelKind::Linear;
    EXPECT_LT(left_out.overall.rms, exact ? 1e-12 : 0.25 * untouched) << to_string(kind);
    EXPECT_EQ(left_out.rows, 960);
  }
}

TEST(ThermalModel, TextReadsBackAsTheSameBits) {
  const ThermalData data = warmup({.noise = 0.3});
  for (const ModelKind kind : all_kinds) {
    ThermalModelOptions options = options_of(kind);
    options.sigma_from_runs = kind == ModelKind::Linear;
    const ThermalFit fitted = fit(data, options);
    ASSERT_TRUE(fitted.model) << to_string(kind);
    const std::string text = to_text(*fitted.model);
    const ThermalModel again = parse_thermal_model(text, "model.txt");
    EXPECT_EQ(to_text(again), text);
    EXPECT_EQ(values(again, data.T), values(*fitted.model, data.T)) << to_string(kind);
    for (int i = 0; i < data.T.rows(); i += 7) {
      const VectorXd T = data.T.row(i).transpose().array() + 0.123;
      const ThermalPrediction a = predict(*fitted.model, T), b = predict(again, T);
      EXPECT_EQ(a.value, b.value);
      EXPECT_EQ(a.sigma, b.sigma);
      EXPECT_EQ(a.status, b.status);
    }
  }
}

TEST(ThermalModel, LeavingTheTrainedRangeIsRefusedByName) {
  const ThermalData data = warmup({});
  ThermalModelOptions options = options_of(ModelKind::Ridge);
  options.margin = 0.2;
  const ThermalModel model = *fit(data, options).model;
  const VectorXd middle = (model.lowest + model.highest) / 2;
  EXPECT_EQ(predict(model, middle).status, PredictionStatus::Ok);
  const VectorXd range = model.highest - model.lowest;
  for (int input = 0; input < 3; ++input)
    for (const double side : {-1.0, 1.0}) {
      VectorXd T = middle;
      T(input) += side * range(input) * (0.5 + 0.1999);
      EXPECT_EQ(predict(model, T).status, PredictionStatus::Ok);
      T(input) += side * range(input) * 0.0002;
      const ThermalPrediction refused = predict(model, T);
      EXPECT_EQ(refused.status, PredictionStatus::OutsideTrainedRange);
      EXPECT_EQ(refused.input, input) << model.names[std::size_t(input)];
      EXPECT_EQ(refused.value, 0);
    }
  VectorXd far = model.highest + range;
  far(1) += range(1);
  EXPECT_EQ(predict(model, far).input, 1) << "the one farthest out";
  EXPECT_THROW((void)predict(model, middle.head(2)), std::invalid_argument);
  EXPECT_THROW((void)predict(model, VectorXd::Constant(3, NAN)), std::invalid_argument);
}

TEST(ThermalModel, AnInputThatStoodStillInTrainingMayNotMove) {
  ThermalData data = warmup({});
  data.T.col(2).setConstant(21.5);
  const ThermalModel model = *fit(data, options_of(ModelKind::Ridge)).model;
  VectorXd T = (model.lowest + model.highest) / 2;
  EXPECT_EQ(predict(model, T).status, PredictionStatus::Ok);
  T(2) += 1e-6;
  EXPECT_EQ(predict(model, T).input, 2);
  const ThermalFit linear = fit(data, options_of(ModelKind::Linear));
  EXPECT_EQ(linear.status, FitStatus::RankDeficient);
  EXPECT_FALSE(linear.model);
  EXPECT_FALSE(linear.confounded.empty());
}

TEST(ThermalModel, SigmaOfUnseenRunsCoversThemAndIsLargerThanTheScatterOfSeenRows) {
  // Every day has a shift of its own, larger than the noise of a row: rows of one day share it.
  const ThermalData training = warmup({.days = 12, .noise = 0.2, .day_shift = 1.0, .seed = 7});
  ThermalModelOptions options;
  const ThermalModel by_run = *fit(training, options).model;
  options.sigma_from_runs = false;
  const ThermalModel by_row = *fit(training, options).model;
  EXPECT_TRUE(by_run.sigma_from_runs);
  int days_inside = 0, rows_inside_by_row = 0, rows = 0;
  const int days = 200;
  const ThermalData unseen =
      warmup({.days = days, .rows = 5, .noise = 0.2, .day_shift = 1.0, .seed = 8});
  for (int i = 0; i < unseen.y.size(); ++i) {
    const VectorXd T = unseen.T.row(i);
    const double miss = std::abs(unseen.y(i) - values(by_run, unseen.T.row(i))(0));
    const ThermalPrediction run = predict(by_run, T), row = predict(by_row, T);
    if (run.status != PredictionStatus::Ok) continue;
    ++rows;
    days_inside += miss < 2 * run.sigma;
    rows_inside_by_row += miss < 2 * row.sigma;
    EXPECT_GE(run.sigma, by_run.sigma);
  }
  std::cout << "two sigma cover " << 100.0 * days_inside / rows << " % of unseen days' rows ("
            << 100.0 * rows_inside_by_row / rows << " % by the scatter of seen rows); sigma "
            << by_run.sigma << " and " << by_row.sigma << '\n';
  EXPECT_GT(double(days_inside) / rows, 0.90);
  EXPECT_GT(by_run.sigma, by_row.sigma);
}

TEST(ThermalModel, TextThatIsNoModelIsRefusedWithItsLine) {
  const ThermalData data = warmup({});
  EXPECT_EQ(refusal(""), "model.txt: expected a line \"abbe ...\", seen the end");
  for (const ModelKind kind : {ModelKind::Linear, ModelKind::KernelRidge, ModelKind::Network}) {
    const std::string text = to_text(*fit(data, options_of(kind)).model);
    EXPECT_EQ(refusal(text), "accepted");
    EXPECT_NE(refusal(text + "more\n"), "accepted");
    // Cut short after every line, and every number of every line spoiled in turn.
    std::vector<std::size_t> ends;
    for (std::size_t i = 0; i < text.size(); ++i)
      if (text[i] == '\n') ends.push_back(i);
    for (std::size_t k = 0; k + 1 < ends.size(); ++k)
      EXPECT_NE(refusal(text.substr(0, ends[k] + 1)), "accepted") << k;
    for (const char* bad : {"x", "inf", "nan", "1e999", "-"}) {
      const std::size_t at = text.find("margin ") + 7;
      std::string spoiled = text;
      spoiled.replace(at, text.find('\n', at) - at, bad);
      EXPECT_NE(refusal(spoiled), "accepted") << bad;
    }
  }
  const std::string text = to_text(*fit(data, options_of(ModelKind::KernelRidge)).model);
  std::string huge = text;
  const std::size_t at = huge.find("supports ") + 9;
  huge.replace(at, huge.find('\n', at) - at, "99999");
  EXPECT_HAS(refusal(huge), "expected 99999 finite numbers");
  huge.replace(at, 5, "99999999999");
  EXPECT_HAS(refusal(huge), "an integer from");
}

TEST(ThermalModel, RandomDamageToATextIsRefusedOrHarmless) {
  abbe::SeededRandom random(20240710);
  const ThermalData data = warmup({.days = 2, .rows = 10});
  int refused = 0;
  for (const ModelKind kind : all_kinds) {
    ThermalModelOptions options = options_of(kind);
    options.network.hidden = 2;
    const std::string text = to_text(*fit(data, options).model);
    for (int i = 0; i < 500; ++i) {
      std::string damaged = text;
      for (int k = 0; k < 3; ++k)
        damaged[random() % damaged.size()] = "0123456789.-e \nx\xff"[random() % 17];
      try {
        const ThermalModel model = parse_thermal_model(damaged, "damaged");
        (void)predict(model, (model.lowest + model.highest) / 2);
      } catch (const abbe::BadInput&) {
        ++refused;
      }
    }
  }
  std::cout << refused << " of 3000 refused\n";
  EXPECT_GT(refused, 300);
  EXPECT_LT(refused, 3000) << "the damage was too coarse to mean anything";
}

TEST(ThermalModel, LinearHasItsDiagnosticsAndNoMoreRowsThanNeededIsAnOutcome) {
  const ThermalData data = warmup({.noise = 0.1});
  const ThermalFit fitted = fit(data);
  ASSERT_TRUE(fitted.regression);
  EXPECT_EQ(fitted.regression->vif.size(), 3);
  EXPECT_NEAR(fitted.regression->beta(0), 2.0, 4 * fitted.regression->standard_error(1));
  ThermalData few = thin_runs(select_runs(data, {0}), 30);
  EXPECT_EQ(few.y.size(), 2);
  EXPECT_EQ(fit(few).status, FitStatus::TooFewRows);
  EXPECT_TRUE(fit(few, options_of(ModelKind::Ridge)).model);
}

TEST(CrossValidation, NeverSeesTheRunThatItPredicts) {
  // One day lies far from all others: a model that had seen it would not miss it by so much.
  ThermalData data = warmup({.days = 5});
  for (int i = 0; i < 60; ++i) data.y(2 * 60 + i) += 100;
  const Validation v = cross_validate(data, {});
  ASSERT_EQ(v.run, (std::vector<int>{0, 1, 2, 3, 4}));
  EXPECT_GT(v.run_spread[2].rms, 90);
  // The same by hand.
  const ThermalFit others = fit(exclude_run(data, 2), options_of(ModelKind::Linear));
  const ThermalData day = select_runs(data, {2});
  EXPECT_EQ(v.run_spread[2].rms, spread(day.y - values(*others.model, day.T)).rms);
  EXPECT_EQ(v.rows, 300);
  EXPECT_THROW((void)cross_validate(day, {}), std::invalid_argument);
}

TEST(Features, TakeNothingFromAnotherRunOrFromLater) {
  ThermalData data{{"T"}, MatrixXd(5, 1), VectorXd(5), {3, 3, 3, 9, 9}};
  data.T << 20, 24, 24, 30, 31;
  data.y << 1, 2, 4, 7, 8;
  const ThermalData made = with_features(data, {true, 1 / std::log(2.0)});  // halves each row
  EXPECT_EQ(made.names, (std::vector<std::string>{"T", "T lag"}));
  EXPECT_EQ(made.T.col(0), (VectorXd(5) << 0, 4, 4, 0, 1).finished());
  EXPECT_LT((made.T.col(1) - (VectorXd(5) << 0, 2, 3, 0, 0.5).finished()).norm(), 1e-15);
  EXPECT_EQ(thin_runs(data, 2).y, (VectorXd(3) << 1, 4, 7).finished());
  EXPECT_THROW(with_features(data, {false, -1}), std::invalid_argument);
}
