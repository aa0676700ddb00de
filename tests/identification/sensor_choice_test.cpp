#include "errors/identification/sensor_choice.h"
#include "tests/test.h"

namespace {

using namespace abbe::errors::identification;
using Eigen::MatrixXd;
using Eigen::VectorXd;

SensorChoice choose_sensors(const ThermalData& error, const SensorChoiceOptions& options = {}) {
  return choose_sensors(std::span(&error, 1), options);
}
ThermalStudy study_sensors(const ThermalData& training, const ThermalData& test,
                           const ThermalStudyOptions& options = {}) {
  return study_sensors(std::span(&training, 1), std::span(&test, 1), options);
}

/// A machine of four masses with eighteen sensors: each mass has a true one and copies with gain,
/// delay and noise of their own; some sit on nothing that matters. The drift follows the masses.
ThermalData machine(const std::vector<int>& days, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit;
  const int rows = 120, n = rows * int(days.size());
  ThermalData data{{}, MatrixXd(n, 18), VectorXd(n), {}};
  for (int s = 0; s < 18; ++s) data.names.push_back("S" + std::to_string(s + 1));
  const double pace[] = {8, 4, 2, 1};
  int row = 0;
  for (const int day : days) {
    const double room = 20 + 4 * (2 * unit(random) - 1), speed = 0.5 + unit(random);
    const double rest = 0.4 + 0.3 * unit(random);
    double mass[4] = {0, 0, 0, 0};
    for (int k = 0; k < rows; ++k, ++row) {
      const double t = double(k) / rows;
      const double heat = t < rest || t > rest + 0.15 ? speed : 0;
      for (int i = 0; i < 4; ++i)
        mass[i] +=
            pace[i] / rows * ((i == 0 ? 20 * heat : 0.8 * mass[i > 0 ? i - 1 : 0]) - mass[i]);
      for (int s = 0; s < 18; ++s) {
        const double gain = s < 16 ? 1.0 - 0.12 * (s / 4) : 0.0;  // 17 and 18 feel the room alone
        data.T(row, s) = room + gain * mass[s % 4] + 0.05 * normal(random);
      }
      data.y(row) = 1.5 * mass[0] - 0.9 * mass[1] + 1.1 * mass[2] + 2.0 * mass[3] +
                    0.2 * (room - 20) + 0.1 * normal(random);
      data.run.push_back(day);
    }
  }
  return data;
}

}  // namespace

TEST(SensorChoice, TwinsShareAGroupAndTheBetterOneLeads) {
  ThermalData data{{"a", "twin of a", "b", "still"}, MatrixXd(6, 4), VectorXd(6), {}};
  data.run.assign(6, 1);
  data.y << 0, 1, 2, 3, 4, 5;
  data.T.col(0) << 20, 21, 22, 23, 24, 25.3;
  data.T.col(1) << 20, 21, 22, 23, 24, 25.1;
  data.T.col(2) << 20, 19, 23, 19, 24, 20;
  data.T.col(3).setConstant(22);
  SensorChoiceOptions options;
  options.count = 2;
  options.threshold = 0.9;
  for (const SimilarityMeasure similarity_measure :
       {SimilarityMeasure::Grey, SimilarityMeasure::Correlation}) {
    options.similarity_measure = similarity_measure;
    options.screening = Screening::Degree;
    const SensorChoice choice = choose_sensors(data, options);
    ASSERT_EQ(choice.status, GreyStatus::Ok);
    EXPECT_EQ(choice.constant_inputs, (std::vector<int>{3}));
    EXPECT_EQ(choice.groups, (std::vector<std::vector<int>>{{1, 0}, {2}}));
    EXPECT_EQ(choice.chosen, (std::vector<int>{1, 2}));
  }
}

TEST(SensorChoice, ASensorThatFallsWhileTheErrorRisesIsAsGoodAsOneThatRises) {
  ThermalData data{{"up", "down"}, MatrixXd(5, 2), VectorXd(5), std::vector<int>(5, 1)};
  data.y << 0, 1, 2, 4, 5;
  data.T.col(0) = data.y.array() + 20;
  data.T.col(1) = 40 - data.y.array();
  SensorChoiceOptions options;
  options.count = 1;
  const SensorChoice choice = choose_sensors(data, options);
  EXPECT_NEAR(choice.degree(0), 1, 1e-12);
  EXPECT_NEAR(choice.degree(1), 1, 1e-12);
}

// ---- degrees that divide by a first value

SensorChoiceOptions by_degree(GreyKind kind, Image image = Image::Interval) {
  SensorChoiceOptions options;
  options.grey.kind = kind;
  options.grey.image = image;
  options.screening = Screening::Degree;
  return options;
}

TEST(SensorChoice, ADriftThatStartsAtZeroIsGradedFromItsFirstValueBeyondNoise) {
  const ThermalData whole = machine({1}, 3);
  for (SensorChoiceOptions options :
       {by_degree(GreyKind::Deng, Image::Initial), by_degree(GreyKind::Relative),
        by_degree(GreyKind::Comprehensive)}) {
    ASSERT_TRUE(is_divided_by_start(options));
    options.min_start = {0.01};
    for (const int late : {0, 1, 5}) {
      ThermalData data = whole;
      for (int k = 0; k < late; ++k) data.y(k) = k % 2 ? -0.009 : 0.0;  // noise
      const SensorChoice choice = choose_sensors(data, options);
      ASSERT_EQ(choice.status, GreyStatus::Ok);
      ASSERT_EQ(choice.first_row.size(), 1u);
      EXPECT_EQ(choice.first_row[0], std::optional(late));
      const auto rows = data.y.size() - late;
      const GreyDegrees by_hand =
          grey_degrees(data.y.tail(rows), data.T.bottomRows(rows), options.grey);
      EXPECT_EQ(choice.degree, by_hand.degree) << late;
    }
    ThermalData constant_inputs = whole;
    constant_inputs.y.setConstant(0.005);
    constant_inputs.y(0) = 0.0;
    const SensorChoice none = choose_sensors(constant_inputs, options);
    EXPECT_EQ(none.status, GreyStatus::StartsAtZero) << "it never leaves its noise";
    EXPECT_EQ(none.input, -1);
    EXPECT_TRUE(none.chosen.empty());
    // beside one that does it takes no part
    const std::vector<ThermalData> two{whole, constant_inputs};
    options.min_start = {0.01, 0.01};
    const SensorChoice one = choose_sensors(two, options);
    ASSERT_EQ(one.status, GreyStatus::Ok);
    EXPECT_FALSE(one.first_row[1]);
    options.min_start = {0.01};
    EXPECT_EQ(one.degree, choose_sensors(whole, options).degree);
  }
}

// The right values of the widely copied example, with a reading of zero before the first.
TEST(SensorChoice, LiusDegreesOfTheWorkedExampleStandBehindAZero) {
  ThermalData data{{"x2"}, MatrixXd(6, 1), VectorXd(6), std::vector<int>(6, 1)};
  data.y << 0, 30.5, 34.7, 35.9, 38.2, 41;
  data.T << 21.8, 22.1, 25.4, 27.1, 28.3, 31.5;
  for (const auto& [kind, right] :
       {std::pair(GreyKind::Relative, 0.952719), {GreyKind::Comprehensive, 0.940026}}) {
    SensorChoiceOptions options = by_degree(kind);
    options.count = 1;
    EXPECT_NEAR(choose_sensors(data, options).degree(0), right, 0.5e-6);
  }
}

TEST(SensorChoice, FixedSensorsAreTakenAsTheyAre) {
  const ThermalData data = machine({1}, 3);
  SensorChoiceOptions options;
  options.fixed = {"S7", "S2"};
  EXPECT_EQ(choose_sensors(data, options).chosen, (std::vector<int>{6, 1}));
  EXPECT_FALSE(is_divided_by_start(options));
  options.fixed = {"S99"};
  EXPECT_THROW((void)choose_sensors(data, options), std::invalid_argument);
}

TEST(SensorChoice, ChensGradesRankHisSensorsAsHePrintsThem) {
  const char* folder = std::getenv("ABBE_VALIDATION");
  std::ifstream in(std::string(folder ? folder : "") + "/chen2013_grey_grades.csv");
  VectorXd degree = VectorXd::Zero(13);
  std::string line;
  int read = 0;
  std::getline(in, line);
  while (folder && std::getline(in, line)) {
    const int sensor = std::stoi(line);
    degree(sensor - 1) = std::stod(line.substr(line.rfind(',') + 1));
    ++read;
  }
  if (read != 13) {
    // As printed, three digits: 6, 7 and 9 are equal there, as are 8, 12 and 13 in pairs.
    degree << 0.588, 0.584, 0.600, 0.583, 0.596, 0.586, 0.591, 0.690, 0.586, 0.608, 0.584, 0.650,
        0.650;
    const std::vector<int> order = ranking(degree);
    EXPECT_EQ(order.front(), 7);
    EXPECT_EQ((std::set<int>{order[1], order[2]}), (std::set<int>{11, 12}));
    EXPECT_EQ(order[3], 9);
    return;
  }
  const std::vector<int> printed = {8, 13, 12, 10, 3, 5, 7, 1, 6, 9, 2, 11, 4};
  std::vector<int> order = ranking(degree);
  for (int& index : order) ++index;
  EXPECT_EQ(order, printed);
}

TEST(SensorChoice, ASubsetIsDrawnFairlyAndRepeatably) {
  const auto subsets = random_subsets(6, 2, 15000, 4);
  EXPECT_EQ(subsets, random_subsets(6, 2, 15000, 4));
  EXPECT_NE(subsets, random_subsets(6, 2, 15000, 5));
  std::map<std::vector<int>, int> count;
  for (const auto& subset : subsets) {
    ASSERT_LT(subset[0], subset[1]);
    ++count[subset];
  }
  ASSERT_EQ(count.size(), 15u);
  // Each of 15 pairs 1000 times; four sigma of the binomial are 122.
  for (const auto& [subset, times] : count) EXPECT_NEAR(times, 1000, 122);
  EXPECT_EQ(random_subsets(3, 3, 1, 1).front(), (std::vector<int>{0, 1, 2}));
  EXPECT_TRUE(random_subsets(3, 0, 1, 1).front().empty());
  EXPECT_THROW(random_subsets(3, 4, 1, 1), std::invalid_argument);
}

TEST(ThermalStudy, FourOfEighteenSensorsPredictAnotherDayAndBeatMostRandomFours) {
  const ThermalStudy study = study_sensors(machine({1, 2, 3}, 11), machine({4}, 12));
  ASSERT_EQ(study.choice.status, GreyStatus::Ok);
  ASSERT_TRUE(study.errors.front().fitted.model);
  std::cout << "chosen";
  for (const std::string& name : study.chosen) std::cout << ' ' << name;
  std::cout << " of " << study.choice.groups.size() << " groups; in cycle "
            << study.errors.front().training_residual.rms << ", left out "
            << study.errors.front().left_out->overall.rms << ", another day "
            << study.errors.front().test.overall.rms << " (" << 100 * study.rms_over_range
            << " % of the drift of " << study.errors.front().drift_range << "); random fours "
            << 100 * study.random.p05 << " .. " << 100 * study.random.p50 << " .. "
            << 100 * study.random.p95 << " %, beaten " << 100 * study.random.fraction_beaten
            << " %\n";
  EXPECT_EQ(study.chosen.size(), 4u);
  EXPECT_LT(study.rms_over_range, 0.15);
  EXPECT_LT(study.rms_over_range, study.random.p50);
  EXPECT_EQ(study.random.rms_over_range.size() + std::size_t(study.random.failed_fit_count), 200u);
  EXPECT_LE(study.errors.front().training_residual.rms, study.errors.front().left_out->overall.rms);
}

TEST(ThermalStudy, OneTrainingDayDoesNotKnowTheRoomUnlessTemperaturesCountFromItsStart) {
  // In one day the room stands still, so no fit can tell what another room does to the sensors.
  double as_they_are = 0, from_start = 0;
  int beats_median = 0;
  const int machines = 10;
  for (unsigned seed = 100; seed < 100 + 2 * machines; seed += 2) {
    const ThermalData training = machine({1}, seed), test = machine({2}, seed + 1);
    ThermalStudyOptions options;
    as_they_are += study_sensors(training, test, options).rms_over_range / machines;
    options.features.since_start = true;
    const ThermalStudy study = study_sensors(training, test, options);
    ASSERT_TRUE(study.errors.front().fitted.model);
    EXPECT_FALSE(study.errors.front().left_out);
    EXPECT_EQ(study.chosen.size(), 4u);
    from_start += study.rms_over_range / machines;
    beats_median += study.rms_over_range < study.random.p50;
  }
  std::cout << "another day, mean of " << machines << ": " << 100 * as_they_are
            << " % of the drift with temperatures as they are, " << 100 * from_start
            << " % counted from the start; the median of random fours beaten " << beats_median
            << " times\n";
  EXPECT_LT(from_start, 0.15);
  EXPECT_GT(as_they_are, 2 * from_start);
  EXPECT_GE(beats_median, 9);
}

TEST(ThermalStudy, RefusesATestRunThatItTrainedOnAndOtherSensors) {
  const ThermalData day = machine({1}, 21);
  EXPECT_THROW((void)study_sensors(day, day), std::invalid_argument);
  ThermalData other = machine({2}, 22);
  other.names[3] = "another";
  EXPECT_THROW((void)study_sensors(day, other), std::invalid_argument);
}

TEST(ThermalStudy, IsTheSameForTheSameSeedAndWithoutTestDrift) {
  const ThermalData training = machine({1, 2}, 31);
  ThermalData test = machine({3}, 32);
  const ThermalStudy a = study_sensors(training, test), b = study_sensors(training, test);
  EXPECT_EQ(a.random.rms_over_range, b.random.rms_over_range);
  EXPECT_EQ(a.rms_over_range, b.rms_over_range);
  test.y.setConstant(3);
  const ThermalStudy flat = study_sensors(training, test);
  EXPECT_EQ(flat.errors.front().drift_range, 0);
  EXPECT_EQ(flat.rms_over_range, 0);
  EXPECT_TRUE(flat.random.rms_over_range.empty());
}
