#include "errors/identification/regression.h"
#include "kinematics/decompositions.h"
#include "tests/errors/numbers.h"
#include "tests/test.h"

namespace {

using namespace abbe::errors::identification;
using abbe::errors::numbers;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A reference set of NIST StRD, linear least squares (public domain,
/// https://www.itl.nist.gov/div898/strd/lls/lls.shtml): data and certified values, computed there
/// with 500 digits and printed to 15.
struct Reference {
  const char* name;
  MatrixXd A;
  VectorXd y;
  VectorXd estimate;  ///< (q) constant first
  VectorXd standard_error;
  double residual_sd;
  double r_squared;
};

MatrixXd powers(const VectorXd& x, int degree) {
  MatrixXd A(x.size(), degree);
  // Powers in long double, rounded once: a power built up in double is itself off in the last
  // digit.
  for (int i = 0; i < x.size(); ++i)
    for (int k = 1; k <= degree; ++k) A(i, k - 1) = double(std::pow((long double)x(i), k));
  return A;
}

Reference norris() {
  const VectorXd x =
      numbers({0.2, 337.4, 118.2, 884.6, 10.1,  226.5, 666.3, 996.3, 448.6, 777.0, 558.2, 0.4,
               0.6, 775.5, 666.9, 338.0, 447.5, 11.6,  556.0, 228.1, 995.8, 887.6, 120.2, 0.3,
               0.3, 556.8, 339.1, 887.2, 999.0, 779.0, 11.1,  118.3, 229.2, 669.1, 448.9, 0.5});
  const VectorXd y =
      numbers({0.1, 338.8, 118.1, 888.0, 9.2,   228.1, 668.5, 998.5, 449.1, 778.9, 559.2, 0.3,
               0.1, 778.1, 668.8, 339.3, 448.9, 10.8,  557.7, 228.3, 998.0, 888.8, 119.6, 0.3,
               0.6, 557.6, 339.3, 888.0, 998.5, 778.9, 10.2,  117.6, 228.9, 668.4, 449.2, 0.2});
  return {"Norris",
          x,
          y,
          numbers({-0.262323073774029, 1.00211681802045}),
          numbers({0.232818234301152, 0.429796848199937E-03}),
          0.884796396144373,
          0.999993745883712};
}

Reference pontius() {
  VectorXd x(40);
  for (int i = 0; i < 40; ++i) x(i) = 150000.0 * (i % 20 + 1);
  const VectorXd y = numbers(
      {.11019,  .21956,  .32949,  .43899,  .54803,  .65694,  .76562,  .87487,  .98292,  1.09146,
       1.20001, 1.30822, 1.41599, 1.52399, 1.63194, 1.73947, 1.84646, 1.95392, 2.06128, 2.16844,
       .11052,  .22018,  .32939,  .43886,  .54798,  .65739,  .76596,  .87474,  .98300,  1.09150,
       1.20004, 1.30818, 1.41613, 1.52408, 1.63159, 1.73965, 1.84696, 1.95445, 2.06177, 2.16829});
  return {"Pontius",
          powers(x, 2),
          y,
          numbers({0.673565789473684E-03, 0.732059160401003E-06, -0.316081871345029E-14}),
          numbers({0.107938612033077E-03, 0.157817399981659E-09, 0.486652849992036E-16}),
          0.205177424076185E-03,
          0.999999900178537};
}

Reference longley() {
  MatrixXd A(16, 6);
  A << 83.0, 234289, 2356, 1590, 107608, 1947,  //
      88.5, 259426, 2325, 1456, 108632, 1948,   //
      88.2, 258054, 3682, 1616, 109773, 1949,   //
      89.5, 284599, 3351, 1650, 110929, 1950,   //
      96.2, 328975, 2099, 3099, 112075, 1951,   //
      98.1, 346999, 1932, 3594, 113270, 1952,   //
      99.0, 365385, 1870, 3547, 115094, 1953,   //
      100.0, 363112, 3578, 3350, 116219, 1954,  //
      101.2, 397469, 2904, 3048, 117388, 1955,  //
      104.6, 419180, 2822, 2857, 118734, 1956,  //
      108.4, 442769, 2936, 2798, 120445, 1957,  //
      110.8, 444546, 4681, 2637, 121950, 1958,  //
      112.6, 482704, 3813, 2552, 123366, 1959,  //
      114.2, 502601, 3931, 2514, 125368, 1960,  //
      115.7, 518173, 4806, 2572, 127852, 1961,  //
      116.9, 554894, 4007, 2827, 130081, 1962;
  return {"Longley",
          A,
          numbers({60323, 61122, 60171, 61187, 63221, 63639, 64989, 63761, 66019, 67857, 68169,
                   66513, 68655, 69564, 69331, 70551}),
          numbers({-3482258.63459582, 15.0618722713733, -0.358191792925910E-01, -2.02022980381683,
                   -1.03322686717359, -0.511041056535807E-01, 1829.15146461355}),
          numbers({890420.383607373, 84.9149257747669, 0.334910077722432E-01, 0.488399681651699,
                   0.214274163161675, 0.226073200069370, 455.478499142212}),
          304.854073561965,
          0.995479004577296};
}

/// Wampler's quintics on x = 0 .. 20; 1 and 2 are met exactly.
Reference wampler(const char* name, VectorXd y, VectorXd estimate, double sd, double r_squared) {
  // Standard errors of Wampler 3; those of 4 and 5 are 100 and 10 000 times as large.
  const VectorXd unit = numbers({2152.32624678170, 2363.55173469681, 779.343524331583,
                                 101.475507550350, 5.64566512170752, 0.112324854679312});
  return {name,
          powers(VectorXd::LinSpaced(21, 0, 20), 5),
          std::move(y),
          std::move(estimate),
          unit * (sd / 2360.14502379268),
          sd,
          r_squared};
}

std::vector<Reference> wamplers() {
  const VectorXd one = VectorXd::Ones(6);
  return {
      wampler("Wampler1", numbers({1,      6,      63,      364,     1365,    3906,    9331,
                                   19608,  37449,  66430,   111111,  177156,  271453,  402234,
                                   579195, 813616, 1118481, 1508598, 2000719, 2613660, 3368421}),
              one, 0, 1),
      wampler("Wampler2",
              numbers({1.00000,  1.11111,  1.24992,  1.42753,  1.65984,  1.96875,  2.38336,
                       2.94117,  3.68928,  4.68559,  6.00000,  7.71561,  9.92992,  12.75603,
                       16.32384, 20.78125, 26.29536, 33.05367, 41.26528, 51.16209, 63.00000}),
              numbers({1, 0.1, 0.01, 0.001, 0.0001, 0.00001}), 0, 1),
      wampler("Wampler3", numbers({760,    -2042,  2111,    -1684,   3888,    1858,    11379,
                                   17560,  39287,  64382,   113159,  175108,  273291,  400186,
                                   581243, 811568, 1121004, 1506550, 2002767, 2611612, 3369180}),
              one, 2360.14502379268, 0.999995559025820),
      wampler("Wampler4", numbers({75901,   -204794, 204863,  -204436, 253665,  -200894, 214131,
                                   -185192, 221249,  -138370, 315911,  -27644,  455253,  197434,
                                   783995,  608816,  1370781, 1303798, 2205519, 2408860, 3444321}),
              one, 236014.502379268, 0.957478440825662),
      wampler("Wampler5",
              numbers({7590001,   -20479994, 20480063,  -20479636, 25231365,  -20476094, 20489331,
                       -20460392, 18417449,  -20413570, 20591111,  -20302844, 18651453,  -20077766,
                       21059195,  -19666384, 26348481,  -18971402, 22480719,  -17866340, 10958421}),
              one, 23601450.2379268, 0.224668921574940E-02)};
}

Reference filip() {
  const VectorXd x =
      numbers({-6.860120914, -4.324130045, -4.358625055, -4.358426747, -6.955852379, -6.661145254,
               -6.355462942, -6.118102026, -7.115148017, -6.815308569, -6.519993057, -6.204119983,
               -5.853871964, -6.109523091, -5.79832982,  -5.482672118, -5.171791386, -4.851705903,
               -4.517126416, -4.143573228, -3.709075441, -3.499489089, -6.300769497, -5.953504836,
               -5.642065153, -5.031376979, -4.680685696, -4.329846955, -3.928486195, -8.56735134,
               -8.363211311, -8.107682739, -7.823908741, -7.522878745, -7.218819279, -6.920818754,
               -6.628932138, -6.323946875, -5.991399828, -8.781464495, -8.663140179, -8.473531488,
               -8.247337057, -7.971428747, -7.676129393, -7.352812702, -7.072065318, -6.774174009,
               -6.478861916, -6.159517513, -6.835647144, -6.53165267,  -6.224098421, -5.910094889,
               -5.598599459, -5.290645224, -4.974284616, -4.64454848,  -4.290560426, -3.885055584,
               -3.408378962, -3.13200249,  -8.726767166, -8.66695597,  -8.511026475, -8.165388579,
               -7.886056648, -7.588043762, -7.283412422, -6.995678626, -6.691862621, -6.392544977,
               -6.067374056, -6.684029655, -6.378719832, -6.065855188, -5.752272167, -5.132414673,
               -4.811352704, -4.098269308, -3.66174277,  -3.2644011});
  const VectorXd y = numbers(
      {0.8116, 0.9072, 0.9052, 0.9039, 0.8053, 0.8377, 0.8667, 0.8809, 0.7975, 0.8162, 0.8515,
       0.8766, 0.8885, 0.8859, 0.8959, 0.8913, 0.8959, 0.8971, 0.9021, 0.909,  0.9139, 0.9199,
       0.8692, 0.8872, 0.89,   0.891,  0.8977, 0.9035, 0.9078, 0.7675, 0.7705, 0.7713, 0.7736,
       0.7775, 0.7841, 0.7971, 0.8329, 0.8641, 0.8804, 0.7668, 0.7633, 0.7678, 0.7697, 0.77,
       0.7749, 0.7796, 0.7897, 0.8131, 0.8498, 0.8741, 0.8061, 0.846,  0.8751, 0.8856, 0.8919,
       0.8934, 0.894,  0.8957, 0.9047, 0.9129, 0.9209, 0.9219, 0.7739, 0.7681, 0.7665, 0.7703,
       0.7702, 0.7761, 0.7809, 0.7961, 0.8253, 0.8602, 0.8809, 0.8301, 0.8664, 0.8834, 0.8898,
       0.8964, 0.8963, 0.9074, 0.9119, 0.9228});
  return {"Filip",
          powers(x, 10),
          y,
          numbers({-1467.48961422980, -2772.17959193342, -2316.37108160893, -1127.97394098372,
                   -354.478233703349, -75.1242017393757, -10.8753180355343, -1.06221498588947,
                   -0.670191154593408E-01, -0.246781078275479E-02, -0.402962525080404E-04}),
          numbers({298.084530995537, 559.779865474950, 466.477572127796, 227.204274477751,
                   71.6478660875927, 15.2897178747400, 2.23691159816033, 0.221624321934227,
                   0.142363763154724E-01, 0.535617408889821E-03, 0.896632837373868E-05}),
          0.334801051324544E-02,
          0.996727416185620};
}

double digits(double value, double certified) {
  const double off = certified == 0 ? std::abs(value) : std::abs(value / certified - 1);
  return off == 0 ? 15 : std::min(15.0, -std::log10(off));
}

double digits(const VectorXd& value, const VectorXd& certified) {
  double least = 15;
  for (int i = 0; i < value.size(); ++i) least = std::min(least, digits(value(i), certified(i)));
  return least;
}

MatrixXd random_matrix(std::mt19937& random, int rows, int columns) {
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(rows, columns, [&] { return normal(random); });
}

}  // namespace

TEST(Regression, NistReferenceSetsComeOutToTheDigitsPromised) {
  std::vector<Reference> sets = {norris(), pontius(), longley(), filip()};
  for (Reference& w : wamplers()) sets.push_back(std::move(w));
  for (const Reference& set : sets) {
    const Regression fit = fit_regression(set.A, set.y);
    ASSERT_EQ(fit.status, RegressionStatus::Ok) << set.name;
    VectorXd estimate(set.estimate.size());
    estimate << fit.constant, fit.beta;
    const double of_estimate = digits(estimate, set.estimate);
    const bool exact = set.residual_sd == 0;
    const double of_error = exact ? 15 : digits(fit.standard_error, set.standard_error);
    const double of_sd = exact ? 15 : digits(fit.residual_sd, set.residual_sd);
    std::cout << set.name << ": digits of estimates " << of_estimate << ", standard errors "
              << of_error << ", residual sd " << of_sd << ", R^2 "
              << digits(fit.r_squared, set.r_squared) << ", condition " << fit.condition << '\n';
    // The design of Filip has a condition of 5e9: its powers, rounded to doubles, leave 7 digits.
    const bool is_filip = set.estimate.size() == 11;
    const double promised = is_filip ? 7 : 12;
    EXPECT_GE(of_estimate, promised) << set.name;
    EXPECT_GE(of_error, promised) << set.name;
    EXPECT_GE(of_sd, promised) << set.name;
    EXPECT_GE(digits(fit.r_squared, set.r_squared), is_filip ? 11 : 12) << set.name;
    if (exact) {
      EXPECT_LT(fit.residual_sd, 1e-14 * set.y.cwiseAbs().maxCoeff());
    }
  }
}

TEST(Regression, OneColumnWithoutConstantIsTheTextbookRatio) {
  const VectorXd x = numbers({60, 61, 62, 63, 64, 65, 66, 67, 68, 69, 70});
  const VectorXd y = x.array() + 70;
  // NIST StRD NoInt1, certified.
  RegressionOptions options;
  options.constant = false;
  const Regression fit = fit_regression(x, y, options);
  ASSERT_EQ(fit.status, RegressionStatus::Ok);
  EXPECT_GE(digits(fit.beta(0), 2.07438016528926), 13);
  EXPECT_GE(digits(fit.standard_error(0), 0.165289256198347E-01), 13);
  EXPECT_GE(digits(fit.residual_sd, 3.56753034006338), 13);
  EXPECT_GE(digits(fit.r_squared, 0.999365492298663), 13);
  EXPECT_EQ(fit.constant, 0);
}

TEST(Regression, PressIsTheRmsOfRowsLeftOutOneByOne) {
  abbe::SeededRandom random(20240701);
  const MatrixXd A = random_matrix(random, 25, 3);
  const VectorXd y = random_matrix(random, 25, 1);
  double sum = 0;
  for (int out = 0; out < 25; ++out) {
    RegressionOptions options;
    options.weight = VectorXd::Ones(25);
    options.weight(out) = 0;
    const Regression fit = fit_regression(A, y, options);
    ASSERT_EQ(fit.status, RegressionStatus::Ok);
    sum += std::pow(fit.residual(out), 2);  // its weight is 0: a prediction
  }
  EXPECT_NEAR(fit_regression(A, y).press_rms, std::sqrt(sum / 25), 1e-13);
}

TEST(Regression, VarianceInflationIsThatOfTheColumnOnTheOthers) {
  abbe::SeededRandom random(20240702);
  MatrixXd A = random_matrix(random, 40, 4);
  A.col(2) += 5 * A.col(0) - 2 * A.col(1);
  A.array() += 20;  // temperatures are far from 0
  const VectorXd y = random_matrix(random, 40, 1);
  const Regression fit = fit_regression(A, y);
  for (int j = 0; j < 4; ++j) {
    MatrixXd others(40, 3);
    for (int k = 0, at = 0; k < 4; ++k)
      if (k != j) others.col(at++) = A.col(k);
    const double r_squared = fit_regression(others, A.col(j)).r_squared;
    EXPECT_NEAR(fit.vif(j) * (1 - r_squared), 1, 1e-12);
  }
  EXPECT_GT(fit.vif(2), 10);
}

TEST(Regression, CovarianceAndLeverageAreThoseOfTheNormalEquations) {
  abbe::SeededRandom random(20240703);
  const MatrixXd A = random_matrix(random, 30, 3);
  const VectorXd y = random_matrix(random, 30, 1);
  RegressionOptions options;
  options.weight = random_matrix(random, 30, 1).cwiseAbs().array() + 0.1;
  const Regression fit = fit_regression(A, y, options);
  MatrixXd X(30, 4);
  X << VectorXd::Ones(30), A;
  const MatrixXd W = options.weight.asDiagonal();
  const MatrixXd inverse = abbe::full_pivot_inverse(X.transpose() * W * X);
  VectorXd b(4);
  b << fit.constant, fit.beta;
  EXPECT_LT((b - inverse * X.transpose() * W * y).norm(), 1e-13);
  const double variance = (y - X * b).dot(W * (y - X * b)) / 26;
  EXPECT_LT((fit.covariance - variance * inverse).norm(), 1e-13);
  const VectorXd hat = (X * inverse * X.transpose() * W).diagonal();
  EXPECT_LT((fit.leverage - hat).norm(), 1e-13);
  EXPECT_NEAR(fit.leverage.sum(), 4, 1e-13);
  EXPECT_EQ(fit.degrees_of_freedom, 26);
}

TEST(Regression, AWeightOfTwoIsTheRowTwice) {
  const MatrixXd A = numbers({0, 1, 2, 3});
  const VectorXd y = numbers({1, 0, 4, 2});
  RegressionOptions options;
  options.weight = numbers({1, 2, 1, 1});
  const Regression weighted = fit_regression(A, y, options);
  const Regression twice = fit_regression(numbers({0, 1, 1, 2, 3}), numbers({1, 0, 0, 4, 2}));
  EXPECT_NEAR(weighted.beta(0), twice.beta(0), 1e-15);
  EXPECT_NEAR(weighted.constant, twice.constant, 1e-15);
}

TEST(Regression, ConfoundedColumnsAreNamedAndNothingIsReturned) {
  abbe::SeededRandom random(20240704);
  MatrixXd A = random_matrix(random, 20, 4);
  A.col(3) = 2 * A.col(0) - 0.5 * A.col(2);
  const Regression fit = fit_regression(A, A.col(1));
  ASSERT_EQ(fit.status, RegressionStatus::RankDeficient);
  EXPECT_EQ(fit.beta.size(), 0);
  ASSERT_EQ(fit.confounded.size(), 1u);
  const Dependence& one = fit.confounded.front();
  VectorXd rebuilt = VectorXd::Zero(20);
  for (std::size_t i = 0; i < one.with.size(); ++i) {
    EXPECT_NE(one.with[i], 1) << "column 1 has no part in it";
    rebuilt +=
        one.factor[i] * (one.with[i] < 0 ? VectorXd::Ones(20).eval() : A.col(one.with[i]).eval());
  }
  EXPECT_LT((rebuilt - A.col(one.column)).norm(), 1e-12);
  const std::string text = describe(fit.confounded, {"nut", "motor", "bed", "oil"});
  std::cout << text << '\n';
  EXPECT_HAS(text, "oil");
  EXPECT_EQ(text.find("motor"), std::string::npos);
}

TEST(Regression, AConstantColumnIsConfoundedWithTheConstantAndAZeroColumnWithNothing) {
  MatrixXd A(4, 2);
  A << 21, 1, 21, 2, 21, 3, 21, 5;
  Regression fit = fit_regression(A, A.col(1));
  ASSERT_EQ(fit.status, RegressionStatus::RankDeficient);
  EXPECT_TRUE(describe(fit.confounded, {"T1", "T2"}) == "constant = 0.047619 T1" ||
              describe(fit.confounded, {"T1", "T2"}) == "T1 = 21 constant")
      << describe(fit.confounded, {"T1", "T2"});
  A.col(0).setZero();
  fit = fit_regression(A, A.col(1));
  ASSERT_EQ(fit.status, RegressionStatus::RankDeficient);
  EXPECT_EQ(describe(fit.confounded, {"T1", "T2"}), "T1 = 0");
}

TEST(Regression, FewRowsAndBadShapesAreOutcomesAndRefusals) {
  EXPECT_EQ(fit_regression(MatrixXd::Ones(2, 2), VectorXd::Ones(2)).status,
            RegressionStatus::TooFewRows);
  EXPECT_EQ(fit_regression(MatrixXd::Ones(0, 2), VectorXd::Ones(0)).status,
            RegressionStatus::TooFewRows);
  const Regression line = fit_regression(numbers({1, 2}), numbers({3, 5}));
  EXPECT_EQ(line.status, RegressionStatus::Ok);
  EXPECT_NEAR(line.beta(0), 2, 1e-15);
  EXPECT_EQ(line.residual_sd, 0);
  EXPECT_THROW((void)fit_regression(MatrixXd::Ones(3, 1), VectorXd::Ones(2)),
               std::invalid_argument);
  EXPECT_THROW((void)fit_regression(numbers({1, 2, NAN}), VectorXd::Ones(3)),
               std::invalid_argument);
  RegressionOptions options;
  options.weight = numbers({1, 1, -1});
  EXPECT_THROW((void)fit_regression(numbers({1, 2, 3}), VectorXd::Ones(3), options),
               std::invalid_argument);
}

TEST(Regression, IntervalsOfTwoStandardErrorsCoverNinetyFivePerCent) {
  abbe::SeededRandom random(20240705);
  const MatrixXd A = random_matrix(random, 40, 2);
  int inside = 0;
  for (int repeat = 0; repeat < 2000; ++repeat) {
    const VectorXd y =
        3 + (A * numbers({1, -2})).array() + 0.3 * random_matrix(random, 40, 1).array();
    const Regression fit = fit_regression(A, y);
    // Student's t with 37 degrees of freedom, two-sided 95 %.
    inside += std::abs(fit.beta(0) - 1) < 2.02619 * fit.standard_error(1);
  }
  std::cout << "covered " << inside / 20.0 << " %\n";
  // 99 % band of a binomial of 2000 trials: 95 +- 2.576 sqrt(0.95 0.05 / 2000) = 95 +- 1.255 %
  EXPECT_NEAR(inside / 20.0, 95, 1.255);
}

TEST(Ridge, IsLeastSquaresOfTheDesignWithRowsOfThePenaltyBelow) {
  abbe::SeededRandom random(20240706);
  MatrixXd A = random_matrix(random, 30, 3).array() + 20;
  A.col(1) *= 4;
  const VectorXd y = random_matrix(random, 30, 1);
  const double penalty = 0.3;
  const ShrunkFit fit = fit_ridge(A, y, penalty);
  const Eigen::RowVectorXd mean = A.colwise().mean();
  MatrixXd Z = A.rowwise() - mean;
  const Eigen::RowVectorXd sd = (Z.colwise().squaredNorm() / 30).cwiseSqrt();
  MatrixXd below(33, 3);
  below << Z * sd.cwiseInverse().asDiagonal(), MatrixXd::Identity(3, 3) * std::sqrt(30 * penalty);
  VectorXd right(33);
  right << y.array() - y.mean(), 0, 0, 0;
  RegressionOptions options;
  options.constant = false;
  const VectorXd b = fit_regression(below, right, options).beta.cwiseQuotient(sd.transpose());
  EXPECT_LT((fit.beta - b).norm(), 1e-13);
  EXPECT_NEAR(fit.constant, y.mean() - mean.dot(b), 1e-12);
}

TEST(Ridge, SharesBetweenTwinsWhatLeastSquaresCannotPart) {
  MatrixXd A(4, 2);
  A << 1, 1, 2, 2, 3, 3, 4, 4;
  const ShrunkFit fit = fit_ridge(A, numbers({2, 4, 6, 8}), 1e-3);
  // Twins of length 1 act as one column of length sqrt 2: the sum shrinks by 2 / (2 + penalty).
  EXPECT_NEAR(fit.beta(0), 2 / 2.001, 1e-12);
  EXPECT_NEAR(fit.beta(1), 2 / 2.001, 1e-12);
}

TEST(Lasso, KeepsItsOptimalityBoundAndEndsAtLeastSquaresAndAtNothing) {
  abbe::SeededRandom random(20240707);
  double worst = 0;
  for (int repeat = 0; repeat < 50; ++repeat) {
    MatrixXd A = random_matrix(random, 40, 8).array() + 20;
    for (int j = 1; j < 8; ++j) A.col(j) += 3 * A.col(0);  // sensors move together
    const VectorXd y = A.col(2) - A.col(5) + random_matrix(random, 40, 1);
    const double most = max_penalty(A, y);
    MatrixXd Z = A.rowwise() - A.colwise().mean();
    Z.array().rowwise() /= (Z.colwise().squaredNorm() / 40).cwiseSqrt().array();
    for (const double part : {1.0, 0.5, 0.1, 0.01}) {
      const ShrunkFit fit = fit_lasso(A, y, part * most);
      ASSERT_TRUE(fit.converged) << part;
      const VectorXd residual = y - A * fit.beta - VectorXd::Constant(40, fit.constant);
      const VectorXd gradient = Z.transpose() * residual / 40;
      for (int j = 0; j < 8; ++j) {
        const double off = fit.beta(j) == 0
                               ? std::max(std::abs(gradient(j)) - part * most, 0.0)
                               : std::abs(gradient(j) - std::copysign(part * most, fit.beta(j)));
        worst = std::max(worst, off / most);
      }
    }
    EXPECT_EQ(fit_lasso(A, y, most * (1 + 1e-12)).beta.cwiseAbs().maxCoeff(), 0);
    EXPECT_LT((fit_lasso(A, y, 0).beta - fit_regression(A, y).beta).norm(), 1e-5);
  }
  std::cout << "worst violation " << worst << " of the largest penalty\n";
  EXPECT_LT(worst, 1.1e-9);  // the promise, and rounding of this second evaluation
}

TEST(Lasso, OfOrthogonalColumnsIsTheSoftThreshold) {
  MatrixXd A(4, 2);
  A << 1, 1, 1, -1, -1, 1, -1, -1;
  const ShrunkFit fit = fit_lasso(A, 3 * A.col(0) - 0.2 * A.col(1), 0.5);
  EXPECT_NEAR(fit.beta(0), 2.5, 1e-12);
  EXPECT_EQ(fit.beta(1), 0);
}

TEST(ShrunkFit, AColumnThatStandsStillGetsNothing) {
  MatrixXd A(4, 2);
  A << 21.3, 1, 21.3, 2, 21.3, 3, 21.3, 4;
  for (const ShrunkFit& fit : {fit_ridge(A, A.col(1), 1e-3), fit_lasso(A, A.col(1), 1e-3)}) {
    EXPECT_EQ(fit.beta(0), 0);
    EXPECT_NEAR(fit.beta(1), 1, 2e-3);
  }
}
