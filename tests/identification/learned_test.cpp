#include "errors/identification/learned.h"
#include <tbb/parallel_for.h>
#include <Eigen/LU>
#include "errors/identification/sensor_choice.h"
#include "errors/identification/thermal_epochs.h"
#include "errors/identification/thermal_model.h"
#include "kinematics/text.h"
#include "tests/errors/numbers.h"
#include "tests/identification/thermal_options.h"
#include "tests/test.h"

namespace {

using namespace abbe::errors::identification;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Two inputs on a grid of 8 x 8 in [-1.5, 1.5], and a smooth function of them.
struct Smooth {
  MatrixXd Z{64, 2};
  VectorXd y{64};
};
double truth(double a, double b) { return std::sin(a) + 0.5 * a * b; }
Smooth smooth() {
  Smooth s;
  for (int i = 0; i < 64; ++i) {
    s.Z.row(i) << -1.5 + 3.0 * (i % 8) / 7, -1.5 + 3.0 * (i / 8) / 7;
    s.y(i) = truth(s.Z(i, 0), s.Z(i, 1));
  }
  return s;
}

/// Largest miss between the points of training.
template <typename Model>
double worst_between(const Model& model) {
  double worst = 0;
  for (int i = 0; i < 49; ++i) {
    const double a = -1.2 + 2.4 * (i % 7) / 6, b = -1.2 + 2.4 * (i / 7) / 6;
    worst = std::max(worst, std::abs(value(model, Eigen::Vector2d(a, b)) - truth(a, b)));
  }
  return worst;
}

}  // namespace

TEST(Learned, KernelRidgeIsTheClosedForm) {
  Smooth s = smooth();
  s.y.array() += 2;  // so that the bias counts
  KernelRidgeOptions options;
  options.gamma = 0.7;
  options.penalty = 1e-3;
  const KernelSum fit = fit_kernel_ridge(s.Z, s.y, options);
  // min |y - K a - b|^2 + n penalty (a'Ka + b^2): (K + 1 + n penalty) a = y, b = sum a.
  MatrixXd system(64, 64);
  for (int i = 0; i < 64; ++i)
    for (int j = 0; j < 64; ++j)
      system(i, j) =
          1 + std::exp(-0.7 * (s.Z.row(i) - s.Z.row(j)).squaredNorm()) + (i == j ? 64 * 1e-3 : 0);
  const VectorXd a = system.fullPivLu().solve(s.y);
  const KernelSum closed{s.Z, a, a.sum(), 0.7};
  double worst = 0;
  for (double t = -2; t < 2; t += 0.25)
    worst = std::max(worst, std::abs(value(fit, Eigen::Vector2d(t, 0.3 - t)) -
                                     value(closed, Eigen::Vector2d(t, 0.3 - t))));
  std::cout << "kernel ridge against its closed form: " << worst << " with " << fit.weight.size()
            << " of 64 rows\n";
  EXPECT_LT(worst, 5e-3);  // rows that nearly depend on others carry no kernel
}

TEST(Learned, SupportVectorsStayInTheTubeWhereTheCostIsHigh) {
  const Smooth s = smooth();
  SupportVectorOptions options;
  options.gamma = 0.5;
  options.cost = 1e4;
  options.epsilon = 0.02;
  const KernelSum fit = fit_support_vectors(s.Z, s.y, options);
  double worst = 0;
  for (int i = 0; i < 64; ++i)
    worst = std::max(worst, std::abs(value(fit, s.Z.row(i).transpose()) - s.y(i)));
  std::cout << "worst row " << worst << " with a tube of 0.02; " << fit.weight.size()
            << " of 64 rows are support vectors; between them " << worst_between(fit) << '\n';
  EXPECT_LT(worst, 0.02 + 2e-3);
  EXPECT_LT(fit.weight.size(), 64);
  EXPECT_LT(worst_between(fit), 0.05);
}

TEST(Learned, TheNetworkEndsWhereItsLossIsFlat) {
  const Smooth s = smooth();
  NetworkOptions options;
  options.decay = 1e-4;
  options.max_iterations = 5000;
  Network fit = fit_network(s.Z, s.y, options);
  const auto loss = [&](const Network& n) {
    double sum = 0;
    for (int i = 0; i < 64; ++i) sum += std::pow(value(n, s.Z.row(i).transpose()) - s.y(i), 2) / 64;
    return sum + options.decay * (n.in.squaredNorm() + n.out.squaredNorm());
  };
  const double end = loss(fit);
  const double between = worst_between(fit);
  double steepest = 0;
  const auto slope = [&](double& weight) {
    const double w = weight, step = 1e-5;
    weight = w + step;
    const double above = loss(fit);
    weight = w - step;
    steepest = std::max(steepest, std::abs(above - loss(fit)) / (2 * step));
    weight = w;
  };
  for (int i = 0; i < fit.in.size(); ++i) slope(fit.in.data()[i]);
  for (int i = 0; i < fit.out.size(); ++i) slope(fit.out(i)), slope(fit.in_bias(i));
  slope(fit.out_bias);
  std::cout << "loss " << end << ", steepest slope " << steepest << ", between the points "
            << between << '\n';
  EXPECT_LT(end, 0.01);
  EXPECT_LT(steepest, 1e-4);
  EXPECT_LT(between, 0.15);
}

TEST(Learned, TheSameSeedGivesTheSameBitsAndAnotherSeedOthers) {
  const Smooth s = smooth();
  NetworkOptions options;
  options.max_iterations = 50;
  const Network a = fit_network(s.Z, s.y, options), b = fit_network(s.Z, s.y, options);
  EXPECT_EQ(a.in, b.in);
  EXPECT_EQ(a.out_bias, b.out_bias);
  options.seed = 2;
  EXPECT_NE(fit_network(s.Z, s.y, options).in, a.in);
}

TEST(Learned, ConstantReadingsAndOneRowGiveAConstant) {
  const Smooth s = smooth();
  const VectorXd y = VectorXd::Constant(64, 0.3);
  const Eigen::Vector2d z(0.1, 0.2);
  // The bias of kernel ridge is shrunk a little too.
  EXPECT_NEAR(value(fit_kernel_ridge(s.Z, y), z), 0.3, 1e-3);
  EXPECT_NEAR(value(fit_support_vectors(s.Z, y), z), 0.3, 0.0501);
  EXPECT_NEAR(value(fit_network(s.Z, y), z), 0.3, 1e-3);
  EXPECT_NEAR(value(fit_kernel_ridge(s.Z.topRows(1), y.head(1)), s.Z.row(0).transpose()), 0.3,
              1e-3);
  EXPECT_NEAR(value(fit_support_vectors(s.Z.topRows(1), y.head(1)), z), 0.3, 0.0501);
}

TEST(Learned, RefusesWhatHasNoMeaning) {
  const Smooth s = smooth();
  EXPECT_THROW(fit_kernel_ridge(s.Z, s.y.head(3)), std::invalid_argument);
  EXPECT_THROW(fit_support_vectors(MatrixXd(0, 2), VectorXd(0)), std::invalid_argument);
  EXPECT_THROW(fit_network(s.Z, VectorXd::Constant(64, NAN)), std::invalid_argument);
  KernelRidgeOptions options;
  options.penalty = 0;
  EXPECT_THROW(fit_kernel_ridge(s.Z, s.y, options), std::invalid_argument);
}

namespace {

using abbe::errors::numbers;

GreyOptions grey_options(GreyKind kind, Image image = Image::Initial) {
  GreyOptions options;
  options.kind = kind;
  options.image = image;
  return options;
}

/// The output of an economy and of its three sectors, six years: a published worked example.
MatrixXd economy() {
  MatrixXd data(6, 4);
  data << 1988, 386, 839, 763, 2061, 408, 846, 808, 2335, 422, 960, 953, 2750, 482, 1258, 1010,
      3356, 511, 1577, 1268, 3806, 561, 1893, 1352;
  return data;
}

}  // namespace

TEST(Grey, DengOfTheWorkedExampleIsWhatWasPublished) {
  const MatrixXd data = economy();
  const GreyDegrees degrees =
      grey_degrees(data.col(0), data.rightCols(3), grey_options(GreyKind::Deng, Image::Mean));
  ASSERT_EQ(degrees.status, GreyStatus::Ok);
  const VectorXd published = numbers({0.5084, 0.6243, 0.7573});
  EXPECT_LT((degrees.degree - published).cwiseAbs().maxCoeff(), 0.5e-4) << degrees.degree;
}

TEST(Grey, DengAgreesWithWholeFractions) {
  const MatrixXd data = economy();
  // in whole fractions, rounded once
  const VectorXd mean = numbers({0.5084324125959361, 0.6242958335060429, 0.7572996249999108});
  const VectorXd initial = numbers({0.6684738902446069, 0.7313950723612371, 0.8296948136967913});
  for (const auto& [expected, image] : {std::pair(mean, Image::Mean), {initial, Image::Initial}}) {
    const GreyDegrees degrees =
        grey_degrees(data.col(0), data.rightCols(3), grey_options(GreyKind::Deng, image));
    const double off = (degrees.degree - expected).cwiseAbs().maxCoeff();
    std::cout << "worst degree off by " << off << '\n';
    EXPECT_LT(off, 1e-15);
  }
}

TEST(Grey, LiusDegreesTakeAreasAndNotFirstDifferences) {
  const VectorXd x1 = numbers({30.5, 34.7, 35.9, 38.2, 41});
  const VectorXd x2 = numbers({22.1, 25.4, 27.1, 28.3, 31.5});
  const auto degree = [&](GreyKind kind) {
    return grey_degrees(x1, x2, grey_options(kind)).degree(0);
  };
  // By hand: areas from the start 4.2 + 5.4 + 7.7 + 10.5 / 2 = 22.55 and 3.3 + 5 + 6.2 + 9.4 / 2 =
  // 19.2, so (1 + 41.75) / (1 + 41.75 + 3.35).
  EXPECT_NEAR(degree(GreyKind::Absolute), 42.75 / 46.1, 1e-14);
  EXPECT_NEAR(degree(GreyKind::Absolute), 0.927332, 0.5e-6);
  EXPECT_NEAR(degree(GreyKind::Relative), 0.952719, 0.5e-6);
  EXPECT_NEAR(degree(GreyKind::Comprehensive), 0.940026, 0.5e-6);
  GreyOptions options = grey_options(GreyKind::Comprehensive);
  options.theta = 0.25;
  EXPECT_NEAR(grey_degrees(x1, x2, options).degree(0),
              0.25 * degree(GreyKind::Absolute) + 0.75 * degree(GreyKind::Relative), 1e-15);
}

TEST(Grey, ASeriesWithoutAnImageIsNamed) {
  MatrixXd series(3, 2);
  series << 1, 0, 2, 1, 3, -1;
  const VectorXd reference = numbers({1, 2, 4});
  const GreyDegrees start = grey_degrees(reference, series, grey_options(GreyKind::Deng));
  EXPECT_EQ(start.status, GreyStatus::StartsAtZero);
  EXPECT_EQ(start.series, 1);
  EXPECT_EQ(start.degree.size(), 0);
  EXPECT_EQ(grey_degrees(reference, series, grey_options(GreyKind::Relative)).series, 1);
  EXPECT_EQ(grey_degrees(reference, series, grey_options(GreyKind::Absolute)).status,
            GreyStatus::Ok);
  const GreyDegrees mean =
      grey_degrees(reference, series, grey_options(GreyKind::Deng, Image::Mean));
  EXPECT_EQ(mean.status, GreyStatus::MeanIsZero);
  EXPECT_EQ(mean.series, 1);
  const GreyDegrees error =
      grey_degrees(numbers({0, 1, 2}), series.leftCols(1), grey_options(GreyKind::Deng));
  EXPECT_EQ(error.status, GreyStatus::StartsAtZero);
  EXPECT_EQ(error.series, -1) << "the reference";
  const GreyDegrees still =
      grey_degrees(numbers({5, 5, 5}), series, grey_options(GreyKind::Deng, Image::Interval));
  EXPECT_EQ(still.status, GreyStatus::ConstantSeries);
  EXPECT_EQ(still.series, -1);
  EXPECT_EQ(mutual_degrees(series, grey_options(GreyKind::Deng)).series, 1);
}

TEST(Grey, SeriesLikeTheReferenceHaveDegreeOne) {
  const VectorXd x = numbers({1, 2, 5});
  MatrixXd twins(3, 2);
  twins << x, 3 * x;
  for (const Image image : {Image::Initial, Image::Mean, Image::Interval}) {
    const GreyDegrees degrees = grey_degrees(x, twins, grey_options(GreyKind::Deng, image));
    EXPECT_NEAR(degrees.degree.minCoeff(), 1, 1e-12);
  }
  const GreyDegrees same =
      grey_degrees(x, twins.leftCols(1), grey_options(GreyKind::Deng, Image::None));
  EXPECT_EQ(same.degree(0), 1);
}

TEST(Grey, DengIsTheDefinitionTermByTerm) {
  abbe::SeededRandom random(20240708);
  std::uniform_real_distribution<double> any(10, 40);
  for (int repeat = 0; repeat < 100; ++repeat) {
    const MatrixXd x = MatrixXd::NullaryExpr(12, 5, [&] { return any(random); });
    GreyOptions options;
    options.rho = 0.3;
    double least = 1e9, most = 0;
    const auto delta = [&](int i, int k) {
      return std::abs(x(k, 0) / x(0, 0) - x(k, i) / x(0, i));
    };
    for (int i = 1; i < 5; ++i)
      for (int k = 0; k < 12; ++k) {
        least = std::min(least, delta(i, k));
        most = std::max(most, delta(i, k));
      }
    const GreyDegrees degrees = grey_degrees(x.col(0), x.rightCols(4), options);
    for (int i = 1; i < 5; ++i) {
      double sum = 0;
      for (int k = 0; k < 12; ++k) sum += (least + 0.3 * most) / (delta(i, k) + 0.3 * most);
      EXPECT_NEAR(degrees.degree(i - 1), sum / 12, 1e-14);
    }
  }
}

TEST(Grey, TheMutualMatrixIsSymmetricWithOnesOnItsDiagonal) {
  const MatrixXd data = economy();
  for (const GreyKind kind :
       {GreyKind::Deng, GreyKind::Absolute, GreyKind::Relative, GreyKind::Comprehensive}) {
    const MutualDegrees mutual = mutual_degrees(data, grey_options(kind));
    ASSERT_EQ(mutual.status, GreyStatus::Ok);
    EXPECT_EQ(mutual.degree, mutual.degree.transpose());
    EXPECT_EQ(mutual.degree.diagonal(), VectorXd::Ones(4));
    EXPECT_GT(mutual.degree.minCoeff(), 0);
    EXPECT_LE(mutual.degree.maxCoeff(), 1);
  }
  const MutualDegrees liu_degree = mutual_degrees(data, grey_options(GreyKind::Absolute));
  EXPECT_EQ(liu_degree.degree.col(0).tail(3),
            grey_degrees(data.col(0), data.rightCols(3), grey_options(GreyKind::Absolute)).degree);
}

TEST(Grey, RefusesWhatHasNoMeaning) {
  const VectorXd x = numbers({1, 2, 3});
  EXPECT_THROW((void)grey_degrees(x, MatrixXd::Ones(2, 1)), std::invalid_argument);
  EXPECT_THROW((void)grey_degrees(x.head(1), MatrixXd::Ones(1, 1)), std::invalid_argument);
  EXPECT_THROW((void)grey_degrees(x, MatrixXd(3, 0)), std::invalid_argument);
  EXPECT_THROW((void)grey_degrees(numbers({1, NAN, 3}), x), std::invalid_argument);
  GreyOptions options;
  options.rho = 0;
  EXPECT_THROW((void)grey_degrees(x, x, options), std::invalid_argument);
}

// Eighteen days of a real lathe: six temperatures and one displacement, unit and sampling interval
// unstated. The data are not part of the project; these tests skip without them. No figure below
// comes from a day that chose or trained its model; the list of candidates, however, was drawn up
// by people who had looked at all eighteen days.
namespace {

std::optional<std::filesystem::path> validation_file(const char* name) {
  const char* folder = std::getenv("ABBE_VALIDATION");
  if (!folder) return std::nullopt;
  const std::filesystem::path file = std::filesystem::path(folder) / name;
  return std::filesystem::exists(file) ? std::optional(file) : std::nullopt;
}

std::optional<ThermalData> ace() {
  const auto file = validation_file("ace_thermal.csv");
  if (!file) return std::nullopt;
  // day, sample, temperatures and dia_disp, in the order of the heads
  const std::string text = abbe::read_text(*file, 10'000'000);
  abbe::LineReader lines(text);
  std::vector<std::string> heads;
  ThermalData data;
  std::vector<double> temperatures, displacements;
  while (const auto line = lines.next()) {
    if (line->empty() || line->front() == '#') continue;
    const auto cells = abbe::split_cells(*line, abbe::cell_separator(*line), 100);
    if (heads.empty()) {
      for (const abbe::Cell& cell : cells) heads.emplace_back(cell.text);
      continue;
    }
    for (std::size_t i = 0; i < heads.size(); ++i) {
      const double value = abbe::number_of(cells.at(i).text).value();
      if (heads[i] == "day")
        data.run.push_back(int(value));
      else if (heads[i] == "dia_disp")
        displacements.push_back(value);
      else if (heads[i] != "sample")
        temperatures.push_back(value);
    }
  }
  for (const std::string& head : heads)
    if (head != "day" && head != "dia_disp" && head != "sample") data.names.push_back(head);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  data.y = VectorXd::Map(displacements.data(), Eigen::Index(displacements.size()));
  data.T = RowMajor::Map(temperatures.data(), data.y.size(), Eigen::Index(data.names.size()));
  return data;
}

std::vector<int> days(int first, int last) {
  std::vector<int> result(std::size_t(last - first + 1));
  std::iota(result.begin(), result.end(), first);
  return result;
}

ThermalModelOptions support_vectors(double gamma) {
  ThermalModelOptions options = options_of(ModelKind::SupportVectors);
  options.support.gamma = gamma;
  options.max_rows = 260;
  return options;
}

/// Everything that a choice may take: temperatures as they are or since the start of the day, alone
/// or with a lagged copy, plain, shrunk, chosen or learned.
std::vector<Recipe> recipes() {
  std::vector<Recipe> result;
  for (const bool since_start : {false, true}) {
    result.push_back({{since_start, 0}, options_of(ModelKind::Linear)});
    for (const double lag : {0.0, 80.0}) {
      for (const double penalty : {1e-2, 0.1})
        result.push_back({{since_start, lag}, options_of(ModelKind::Ridge, penalty)});
      result.push_back({{since_start, lag}, options_of(ModelKind::Lasso, 5e-2)});
    }
  }
  for (const double gamma : {0.03, 0.1, 0.3})
    result.push_back({{false, 0}, support_vectors(gamma)});
  return result;
}

std::string name_of(const Recipe& recipe) {
  std::string name = to_string(recipe.model.kind);
  if (recipe.model.kind == ModelKind::Ridge || recipe.model.kind == ModelKind::Lasso)
    name += fmt::format(" {}", recipe.model.penalty);
  if (recipe.model.kind == ModelKind::SupportVectors)
    name += fmt::format(" gamma {}", recipe.model.support.gamma);
  name += recipe.features.since_start ? ", dT since start" : ", T";
  if (recipe.features.lag_rows > 0) name += fmt::format(", lag {} rows", recipe.features.lag_rows);
  return name;
}

double mean_rms(const Validation& v) {
  double sum = 0;
  for (const Spread& run : v.run_spread) sum += run.rms;
  return sum / double(v.run_spread.size());
}

void print(const std::string& what, const Validation& v) {
  std::cout << fmt::format(
      "  {:58} rms {:7.3f}  mean of days {:7.3f}  max {:7.2f}  outside {}/{}\n", what,
      v.overall.rms, mean_rms(v), v.overall.max, v.outside, v.rows);
}

/// Kinds as they come, nothing tuned to these data.
std::vector<Recipe> untuned() {
  std::vector<Recipe> result;
  for (const ModelKind kind :
       {ModelKind::Linear, ModelKind::SupportVectors, ModelKind::KernelRidge, ModelKind::Network}) {
    result.push_back({{false, 0}, options_of(kind)});
    result.back().model.max_rows = 260;
  }
  result.push_back({{true, 0}, options_of(ModelKind::Linear)});
  return result;
}

/// How a choice divides the days: each predicted by all others, or all later ones by the first k,
/// for every k from half of them on, each with the same weight.
enum class Split { LeaveOneDayOut, Forward };

/// RMS of a recipe over days that did not train it, from every 32nd row.
double rms_of(const Recipe& recipe, const ThermalData& data, Split split) {
  const ThermalData thin = thin_runs(with_features(data, recipe.features), 32);
  if (split == Split::LeaveOneDayOut) {
    const Validation v = cross_validate(thin, recipe.model);
    return v.status == FitStatus::Ok ? v.overall.rms : INFINITY;
  }
  const std::vector<int> all = runs(thin);
  double squares = 0;
  int parts = 0;
  for (std::size_t k = (all.size() + 1) / 2; k < all.size(); ++k, ++parts) {
    const auto next = all.begin() + std::ptrdiff_t(k);
    const Validation v = validate_on(select_runs(thin, {all.begin(), next}),
                                     select_runs(thin, {next, all.end()}), {{}, recipe.model});
    if (v.status != FitStatus::Ok) return INFINITY;
    squares += v.overall.rms * v.overall.rms;
  }
  return std::sqrt(squares / parts);
}

/// The recipe of the least RMS.
std::size_t choose(const std::vector<Recipe>& recipes, const ThermalData& data, Split split) {
  std::vector<double> rms;
  for (const Recipe& recipe : recipes) rms.push_back(rms_of(recipe, data, split));
  return std::size_t(std::min_element(rms.begin(), rms.end()) - rms.begin());
}

/// Each day predicted by the recipe that the other days choose.
struct NestedValidation {
  Validation validation;
  std::vector<std::size_t> chosen;  ///< recipe of each day
};
NestedValidation nested_validation(const ThermalData& data, const std::vector<Recipe>& recipes) {
  const std::vector<int> all = runs(data);
  std::vector<Validation> parts(all.size());
  NestedValidation nested{{}, std::vector<std::size_t>(all.size())};
  tbb::parallel_for(std::size_t(0), all.size(), [&](std::size_t i) {
    const ThermalData others = exclude_run(data, all[i]);
    nested.chosen[i] = choose(recipes, others, Split::LeaveOneDayOut);
    parts[i] = validate_on(others, select_runs(data, {all[i]}), recipes[nested.chosen[i]]);
  });
  double squares = 0;
  for (const Validation& part : parts) {
    Validation& sum = nested.validation;
    sum.run.push_back(part.run.at(0));
    sum.run_spread.push_back(part.run_spread.at(0));
    sum.overall.max = std::max(sum.overall.max, part.overall.max);
    sum.rows += part.rows;
    sum.outside += part.outside;
    squares += part.rows * part.overall.rms * part.overall.rms;
  }
  nested.validation.overall.rms = std::sqrt(squares / nested.validation.rows);
  return nested;
}

/// Leave one day out for the untuned kinds, and for a choice nested inside.
NestedValidation table_of_days_left_out(const ThermalData& data) {
  for (const Recipe& recipe : untuned())
    print(name_of(recipe), cross_validate(with_features(data, recipe.features), recipe.model));
  const std::vector<Recipe> all = recipes();
  const NestedValidation nested = nested_validation(data, all);
  print("chosen by the other days, nested", nested.validation);
  std::map<std::size_t, int> times;
  for (const std::size_t chosen : nested.chosen) ++times[chosen];
  for (const auto& [recipe, count] : times)
    std::cout << "    " << count << " x " << name_of(all[recipe]) << '\n';
  return nested;
}

/// Days 1-12 choose and train, days 13-18 test: the worse of two ways to choose.
double table_of_later_days(const ThermalData& data) {
  const ThermalData early = select_runs(data, days(1, 12)), late = select_runs(data, days(13, 18));
  for (const Recipe& recipe : untuned()) print(name_of(recipe), validate_on(early, late, recipe));
  const std::vector<Recipe> all = recipes();
  double worse = 0;
  for (const Split split : {Split::LeaveOneDayOut, Split::Forward}) {
    const Recipe& recipe = all[choose(all, early, split)];
    const Validation v = validate_on(early, late, recipe);
    print((split == Split::Forward ? "chosen forward: " : "chosen leaving out: ") + name_of(recipe),
          v);
    worse = std::max(worse, v.overall.rms);
  }
  return worse;
}

}  // namespace

TEST(Ace, PlainRegressionHasThePublishedCoefficients) {
  const auto data = ace();
  const auto file = validation_file("ace_mlr_expected.csv");
  if (!data || !file) GTEST_SKIP() << "no validation data";
  const auto coefficients = [&](const ThermalData& some) {
    const Regression fit = fit_regression(some.T, some.y);
    std::vector<double> result = {fit.constant};
    result.insert(result.end(), fit.beta.begin(), fit.beta.end());
    return result;
  };
  const std::vector<double> all = coefficients(*data);
  const std::vector<double> early = coefficients(select_runs(*data, days(1, 12)));
  std::size_t of_all = 0, of_early = 0;
  double worst = 0;
  std::ifstream in(*file);
  for (std::string line; std::getline(in, line);) {
    const double expected = std::atof(line.substr(line.rfind(',') + 1).c_str());
    if (line.starts_with("all-days beta"))
      worst = std::max(worst, std::abs(all.at(of_all++) / expected - 1));
    if (line.starts_with("days1-12 beta"))
      worst = std::max(worst, std::abs(early.at(of_early++) / expected - 1));
    if (line.starts_with("all-days RMSE")) {
      EXPECT_NEAR(spread(fit_regression(data->T, data->y).residual).rms, expected, 1e-12);
    }
    if (line.starts_with("days13-18 test RMSE")) {
      const Validation late =
          validate_on(select_runs(*data, days(1, 12)), select_runs(*data, days(13, 18)),
                      {{}, options_of(ModelKind::Linear)});
      EXPECT_NEAR(late.overall.rms, expected, 1e-9);
    }
  }
  ASSERT_EQ(of_all, 7u);
  ASSERT_EQ(of_early, 7u);
  std::cout << "worst coefficient off by " << worst << " of itself\n";
  EXPECT_LT(worst, 1e-10);
}

TEST(Ace, DisplacementAsItIs) {
  const auto data = ace();
  if (!data) GTEST_SKIP() << "no validation data";
  std::cout << "Leave one day out (untouched, about its mean: rms "
            << spread(data->y.array() - data->y.mean()).rms << ")\n";
  const NestedValidation nested = table_of_days_left_out(*data);
  std::cout << "Days 1-12 train, 13-18 test\n";
  const double later = table_of_later_days(*data);
  EXPECT_LT(later, 0.65 * 26.0) << "the plain regression scores 26.0 there";
  EXPECT_LT(nested.validation.overall.rms,
            0.5 * cross_validate(*data, options_of(ModelKind::Linear)).overall.rms);
}

TEST(Ace, ZeroSetEveryMorningIsAnotherProblem) {
  const auto data = ace();
  if (!data) GTEST_SKIP() << "no validation data";
  ThermalData zero = *data;
  double start = 0;
  for (Eigen::Index i = 0; i < zero.y.size(); ++i) {
    if (i == 0 || zero.run[std::size_t(i)] != zero.run[std::size_t(i - 1)]) start = data->y(i);
    zero.y(i) -= start;
  }
  double untouched = 0;
  for (const int day : runs(zero)) untouched += spread(select_runs(zero, {day}).y).rms / 18;
  std::cout << "Leave one day out (untouched: rms " << spread(zero.y).rms << ", mean of days "
            << untouched << ")\n";
  const NestedValidation nested = table_of_days_left_out(zero);
  std::cout << "Days 1-12 train, 13-18 test\n";
  table_of_later_days(zero);
  // The figures to beat, 15.4 -> 8.0, are these: the mean of the days.
  const Validation plain =
      cross_validate(with_features(zero, {true, 0}), options_of(ModelKind::Linear));
  EXPECT_NEAR(untouched, 15.4391, 1e-4);
  EXPECT_NEAR(mean_rms(plain), 7.9754, 1e-4);
  std::cout << fmt::format("Reduction of the mean of days: plain {:.1f} %, chosen {:.1f} %\n",
                           100 * (1 - mean_rms(plain) / untouched),
                           100 * (1 - mean_rms(nested.validation) / untouched));
  EXPECT_LT(mean_rms(nested.validation), 0.7 * mean_rms(plain));
}

namespace {

using Eigen::Vector2d;

/// The X axis of yang2012, x in cm and delta in um: a cold quartic and the slope
/// -0.027523 - 0.0049600 dT7 + 0.033601 dT8.
constexpr double quartic[] = {0.29717, -6.2218e-3, 9.0575e-4, 8.9455e-5, 1.1192e-6};
constexpr double slope_constant = -0.027523, per_K7 = -0.0049600, per_K8 = 0.033601;

double yang(double x, double dT7, double dT8) {
  double g = 0;
  for (int k = 4; k >= 0; --k) g = g * x + quartic[k];
  return g + (slope_constant + per_K7 * dT7 + per_K8 * dT8) * x;
}

/// His 18 runs: the first cold, then screw and nut warm up and cool down at their own pace.
std::vector<CompositeRun> yang_runs() {
  std::vector<CompositeRun> runs;
  for (int i = 0; i < 18; ++i) {
    const double t = i / 17.0;
    CompositeRun run{VectorXd::LinSpaced(17, -40, 40), VectorXd(17),
                     Vector2d(6 * (1 - std::exp(-3 * t)), 9 * std::sin(2 * t)), i == 0};
    for (int k = 0; k < 17; ++k) run.delta(k) = yang(run.p(k), run.dT_K(0), run.dT_K(1));
    runs.push_back(run);
  }
  return runs;
}

}  // namespace

TEST(Composite, YangsAxisComesApartIntoItsCoefficients) {
  const CompositeFit fit = fit_composite(yang_runs());
  ASSERT_EQ(fit.status, CompositeStatus::Ok);
  // The constant of the slope stands at dT = 0 too, so it belongs to the cold curve.
  const double expected[] = {quartic[0], quartic[1] + slope_constant, quartic[2], quartic[3],
                             quartic[4]};
  double worst = 0;
  for (int k = 0; k <= 4; ++k)
    worst = std::max(worst, std::abs(fit.geometric(k) / expected[k] - 1));
  worst = std::max(
      {worst, std::abs(fit.thermal(0) / per_K7 - 1), std::abs(fit.thermal(1) / per_K8 - 1)});
  std::cout << "worst coefficient off by " << worst << " of itself; rms " << fit.rms << " um\n";
  EXPECT_LT(worst, 1e-11);
  EXPECT_EQ(fit.thermal_constant, 0);
  EXPECT_LT(fit.offset.cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT(fit.rms, 1e-13);
  EXPECT_NEAR(value(fit, 25, Vector2d(2, 3)), yang(25, 2, 3), 1e-12);
}

/// The least-squares slope of a run including its geometric part, as regressed in the paper.
double run_slope(const CompositeRun& run) { return fit_regression(run.p, run.delta).beta(0); }

TEST(Composite, AddingAPublishedConstantToTheColdCurveCountsTheColdSlopeTwice) {
  const std::vector<CompositeRun> runs = yang_runs();
  // As published: slopes of whole runs on the temperatures, with a constant.
  Eigen::MatrixXd dT(18, 2);
  VectorXd slopes(18);
  for (int i = 0; i < 18; ++i) {
    dT.row(i) = runs[std::size_t(i)].dT_K;
    slopes(i) = run_slope(runs[std::size_t(i)]);
  }
  const Regression published = fit_regression(dT, slopes);
  ASSERT_EQ(published.status, RegressionStatus::Ok);
  EXPECT_NEAR(published.beta(1), per_K8, 1e-12);
  EXPECT_NEAR(published.constant, run_slope(runs.front()), 1e-12) << "the cold run's own slope";
  const CompositeFit fit = fit_composite(runs);
  const double twice = value(fit, 40, Vector2d(0, 0)) + published.constant * 40;
  std::cout << "counted twice, the cold end of the axis is off by " << twice - yang(40, 0, 0)
            << " um\n";
  EXPECT_NEAR(twice - yang(40, 0, 0), 40 * run_slope(runs.front()), 1e-11);
  EXPECT_NEAR(value(fit, 40, Vector2d(0, 0)), yang(40, 0, 0), 1e-12);
}

TEST(Composite, AnOffsetOfAWholeRunIsReportedAndKeptOutOfTheSlope) {
  std::vector<CompositeRun> runs = yang_runs();
  for (CompositeRun& run : runs) {
    run.p.array() += 40;  // positions from one end, where an offset would tilt a bound line
    if (!run.cold) run.delta.array() += 0.7;
  }
  const CompositeFit free = fit_composite(runs);
  ASSERT_EQ(free.status, CompositeStatus::Ok);
  EXPECT_NEAR(free.thermal(1), per_K8, 1e-12);
  // The law's slope acts about p = 0, now an end of the axis: each run is lower by 40 slopes there.
  for (int i = 0; i < free.offset.size(); ++i)
    EXPECT_NEAR(free.offset(i), 0.7 - 40 * free.slope(i), 1e-11);
  CompositeOptions bound;
  bound.free_offset = false;
  EXPECT_GT(std::abs(fit_composite(runs, bound).thermal(1) / per_K8 - 1), 0.1);
}

TEST(Composite, NoiseMovesTheCoefficientsByTheirStandardErrors) {
  abbe::SeededRandom random(20240709);
  std::normal_distribution<double> noise(0, 0.1);
  double squares = 0;
  const int repeats = 400;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    std::vector<CompositeRun> runs = yang_runs();
    // Forty cold runs, so that the cold curve's own noise, common to all slopes, does not count.
    for (int i = 1; i < 40; ++i) runs.push_back(runs.front());
    for (CompositeRun& run : runs)
      for (double& delta : run.delta) delta += noise(random);
    const CompositeFit fit = fit_composite(runs);
    ASSERT_EQ(fit.status, CompositeStatus::Ok);
    squares += std::pow((fit.thermal(1) - per_K8) / fit.slope_fit.standard_error(1), 2);
  }
  const double ratio = std::sqrt(squares / repeats);
  std::cout << "rms of deviation over standard error " << ratio << '\n';
  EXPECT_NEAR(ratio, 1.0, 0.15);
}

TEST(Composite, OutcomesAreNamed) {
  std::vector<CompositeRun> runs = yang_runs();
  EXPECT_EQ(fit_composite({runs[0]}).status, CompositeStatus::NoLaterRun);
  EXPECT_EQ(fit_composite({runs[1], runs[2]}).status, CompositeStatus::NoColdRun);
  runs[3].cold = true;
  EXPECT_EQ(fit_composite(runs).status, CompositeStatus::ColdRunNotCold);
  EXPECT_EQ(fit_composite(runs).run, 3);
  runs = yang_runs();
  for (CompositeRun& run : runs) run.dT_K(1) = 2 * run.dT_K(0);
  const CompositeFit together = fit_composite(runs);
  EXPECT_EQ(together.status, CompositeStatus::SlopeNotDetermined);
  EXPECT_EQ(together.run, -1);
  EXPECT_EQ(together.slope_fit.status, RegressionStatus::RankDeficient);
  EXPECT_EQ(together.slope.size(), 17) << "the slopes themselves are known";
  CompositeOptions options;
  options.degree = 12;
  runs.front().p.conservativeResize(5);
  runs.front().delta.conservativeResize(5);
  EXPECT_EQ(fit_composite(runs, options).status, CompositeStatus::CurveNotDetermined);
  runs = yang_runs();
  runs[2].delta(0) = NAN;
  EXPECT_THROW((void)fit_composite(runs), std::invalid_argument);
  EXPECT_THROW((void)fit_composite({}), std::invalid_argument);
}
