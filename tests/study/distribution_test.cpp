#include "sim/study/sampling.h"
#include "tests/study/openturns.h"
#include "tests/test.h"

namespace abbe::sim::study {
namespace {

using Kind = Distribution::Kind;

/// Shares of a kind that is not cut off, in long double by the C library.
struct Shares {
  long double below = 0;
  long double above = 0;
};
Shares uncut(const Distribution& d, long double value) {
  const long double c = d.centre;
  const long double s = d.spread;
  const long double z = d.kind != Kind::LogNormal ? (value - c) / s
                        : value > 0               ? std::log(value / c) / s
                                                  : -std::numeric_limits<long double>::infinity();
  if (d.kind == Kind::Normal || d.kind == Kind::LogNormal)
    return {std::erfc(-z / std::sqrt(2.0L)) / 2, std::erfc(z / std::sqrt(2.0L)) / 2};
  if (z <= -1) return {0, 1};
  if (z >= 1) return {1, 0};
  if (d.kind == Kind::Uniform) return {(1 + z) / 2, (1 - z) / 2};
  if (z < 0) return {(1 + z) * (1 + z) / 2, 1 - (1 + z) * (1 + z) / 2};
  return {1 - (1 - z) * (1 - z) / 2, (1 - z) * (1 - z) / 2};
}

long double share_between(const Distribution& d, long double a, long double b) {
  const Shares at_a = uncut(d, a);
  const Shares at_b = uncut(d, b);
  return at_a.below < 0.5L ? at_b.below - at_a.below : at_a.above - at_b.above;
}

/// By how much of the spread (of the logarithm) a p-quantile of a cut distribution is wrong.
double fault_of_quantile(const Distribution& d, double p, double value) {
  const long double all = share_between(d, d.low, d.high);
  // The smaller side has the digits.
  const long double error = p < 0.5 ? share_between(d, d.low, value) - p * all
                                    : (1.0L - p) * all - share_between(d, value, d.high);
  const long double step = 1e-7L;  // of the spread, for the density
  const bool logarithm = d.kind == Kind::LogNormal;
  const long double up = logarithm ? value * std::exp(step * d.spread) : value + step * d.spread;
  const long double down = logarithm ? value * std::exp(-step * d.spread) : value - step * d.spread;
  const long double density = share_between(d, down, up) / (2 * step);
  return double(std::abs(error) / density);
}

std::string parameters_of(const Distribution& d) {
  std::ostringstream out;
  out.precision(17);
  out << "kind " << int(d.kind) << " centre " << d.centre << " spread " << d.spread << " low "
      << d.low << " high " << d.high;
  return out.str();
}

/// What rounding of a value to a double is, in spreads.
double rounding(const Distribution& d, double value) {
  const double ulp = 4.0 * std::numeric_limits<double>::epsilon() * std::abs(value);
  return ulp / d.spread / (d.kind == Kind::LogNormal ? std::abs(value) : 1.0);
}

class AnyDistribution {
 public:
  explicit AnyDistribution(unsigned seed) : random_(seed) {}
  Distribution next() {
    Distribution d;
    d.kind = Kind(int(4 * unit()));
    d.centre = d.kind == Kind::LogNormal ? std::exp(4 * (unit() - 0.5)) : 20 * (unit() - 0.5);
    d.spread = d.kind == Kind::LogNormal ? 0.01 + 2 * unit() : std::exp(10 * (unit() - 0.5));
    const double reach = d.kind == Kind::Normal || d.kind == Kind::LogNormal ? 6.0 : 1.2;
    const auto value = [&](double z) {
      return d.kind == Kind::LogNormal ? d.centre * std::exp(d.spread * z)
                                       : d.centre + d.spread * z;
    };
    const double a = reach * (2 * unit() - 1);
    const double b = reach * (2 * unit() - 1);
    if (unit() < 0.7) d.low = value(std::min(a, b));
    if (unit() < 0.7) d.high = value(std::max(a, b));
    return d;
  }
  double unit() { return (double(random_() >> 11) + 0.5) * 0x1p-53; }

 private:
  std::mt19937_64 random_;
};

TEST(Distribution, ANormalQuantileIsExactInBothTails) {
  const Distribution standard;
  double worst = 0.0;
  for (const double p :
       {1e-300, 1e-100, 1e-12, 1e-3, 0.025, 0.3, 0.49999, 0.5, 0.7, 0.975, 1 - 1e-12, 1 - 0x1p-53})
    worst = std::max(worst, fault_of_quantile(standard, p, quantile(standard, p)));
  std::cout << "worst quantile " << worst << " standard deviations\n";
  EXPECT_LT(worst, 1e-13);
  EXPECT_NEAR(quantile(standard, 0.975), 1.959963984540054, 4e-16 * 2);
  EXPECT_EQ(quantile(standard, 0.5), 0.0);
}

TEST(Distribution, QuantilesOfAnyCutDistributionHoldTheirBound) {
  const unsigned seed = 20261121;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  AnyDistribution any(seed);
  double worst = 0.0;
  int tried = 0;
  for (int i = 0; i < 20000; ++i) {
    const Distribution d = any.next();
    if (distribution_error(d)) continue;
    ++tried;
    double before = d.low;
    const double middle = any.unit();
    for (const double p : {1e-300, 1e-12, 1e-4 * middle, middle, 1 - 1e-4 * (1 - middle)}) {
      const double value = quantile(d, p);
      ASSERT_GE(value, before) << parameters_of(d);
      ASSERT_LE(value, d.high) << parameters_of(d);
      before = value;
      const double fault = fault_of_quantile(d, p, value) - rounding(d, value);
      ASSERT_LT(fault, 1e-12) << parameters_of(d) << " p " << p;
      worst = std::max(worst, fault);
    }
  }
  std::cout << "worst quantile " << worst << " spreads of " << tried << " distributions\n";
  EXPECT_GT(tried, 15000);
}

TEST(Distribution, CumulativeSharesHoldTheirBoundAndUndoQuantiles) {
  const unsigned seed = 7;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  AnyDistribution any(seed);
  double worst = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const Distribution d = any.next();
    if (distribution_error(d)) continue;
    const auto all = double(share_between(d, d.low, d.high));
    const double p = any.unit();
    const double value = quantile(d, p);
    const double fault =
        std::abs(cumulative(d, value) - double(share_between(d, d.low, value) / all)) * all;
    ASSERT_LT(fault, 1e-14) << parameters_of(d);
    // A value rounded to a double moves its share by the density.
    const double rounded = rounding(d, value) / all;
    ASSERT_NEAR(cumulative(d, value), p, 1e-14 / all + rounded) << parameters_of(d);
    worst = std::max(worst, fault);
    EXPECT_EQ(cumulative(d, d.low), 0.0);
    EXPECT_EQ(cumulative(d, d.high), 1.0);
  }
  std::cout << "worst share " << worst << " of the uncut distribution\n";
}

TEST(Distribution, SharesOfNothingAndAllAreTheEnds) {
  EXPECT_EQ(quantile({}, 0.0), -infinity);
  EXPECT_EQ(quantile({}, 1.0), infinity);
  EXPECT_EQ(quantile({Kind::Normal, 5, 2, 0, 6}, 0.0), 0.0);
  EXPECT_EQ(quantile({Kind::Normal, 5, 2, 0, 6}, 1.0), 6.0);
  EXPECT_EQ(quantile({Kind::Uniform, 5, 2}, 0.0), 3.0);
  EXPECT_EQ(quantile({Kind::Uniform, 5, 2, 4}, 0.5), 5.5);
  EXPECT_EQ(quantile({Kind::Triangular, 5, 2}, 1.0), 7.0);
  EXPECT_EQ(quantile({Kind::Triangular, 5, 2}, 0.5), 5.0);
  EXPECT_EQ(quantile({Kind::LogNormal, 5, 2}, 0.0), 0.0);
  EXPECT_EQ(quantile({Kind::LogNormal, 5, 2}, 0.5), 5.0);
  EXPECT_EQ(quantile({Kind::LogNormal, 5, 2}, 1.0), infinity);
}

TEST(Distribution, ACutThirtySevenStandardDeviationsOutStillHasQuantiles) {
  for (const double side : {1.0, -1.0}) {
    Distribution d{Kind::Normal, 0, 1};
    (side > 0 ? d.low : d.high) = 37.0 * side;
    ASSERT_EQ(distribution_error(d), nullptr);
    for (const double p : {1e-6, 0.3, 0.999})
      EXPECT_LT(fault_of_quantile(d, p, quantile(d, p)), 1e-13) << p << " " << quantile(d, p);
    // The tail is all but exponential: its moments are series in 1/37
    const double r = 1.0 / 37.0;
    const double excess = r * (1 - 2 * std::pow(r, 2) + 10 * std::pow(r, 4) - 74 * std::pow(r, 6));
    EXPECT_NEAR(std::abs(moments(d).mean) - 37.0, excess, 1e-11);
    const double sd = std::sqrt(
        r * r *
        (1 - 6 * r * r + 50 * std::pow(r, 4) - 518 * std::pow(r, 6) + 6354 * std::pow(r, 8)));
    EXPECT_NEAR(moments(d).standard_deviation, sd, 1e-11);
  }
}

TEST(Distribution, AScoreHasTheSameShareBelowAsItsValue) {
  const Distribution cut{Kind::Normal, 3.0, 2.0, 0.0, 4.0};
  const Distribution triangle{Kind::Triangular, -1.0, 0.5};
  for (const Distribution& d : {cut, triangle, Distribution{Kind::LogNormal, 2, 0.3, 1.5, 8}})
    for (const double score : {-3.0, -0.7, 0.0, 0.4, 2.5})
      EXPECT_NEAR(value_at_score(d, score), quantile(d, 0.5 * std::erfc(-score / std::sqrt(2.0))),
                  1e-13);
  EXPECT_EQ(value_at_score({Kind::Normal, 3, 2}, 20.0), 43.0);  // where a share is rounded to 1
  EXPECT_DOUBLE_EQ(value_at_score({Kind::LogNormal, 3, 0.1}, 20.0), 3 * std::exp(2.0));
  EXPECT_NEAR(value_at_score({Kind::Triangular, 0, 1}, 12.0), 1.0, 1e-15);
  EXPECT_EQ(value_at_score(cut, 50.0), 4.0);
  EXPECT_EQ(normal_score(0.5), 0.0);
  EXPECT_EQ(normal_score(0.0), -infinity);
  EXPECT_EQ(normal_score(1.0), infinity);
}

TEST(Distribution, ManyAtOnceAreTheSameBits) {
  AnyDistribution any(5);
  const VectorXd p = VectorXd::LinSpaced(41, 0.0, 1.0);
  const VectorXd scores = VectorXd::LinSpaced(41, -9.0, 9.0);
  for (int i = 0; i < 500; ++i) {
    const Distribution d = any.next();
    if (distribution_error(d)) continue;
    const VectorXd values = quantiles(d, p);
    const VectorXd others = values_at_scores(d, scores);
    for (Index k = 0; k < p.size(); ++k) {
      ASSERT_EQ(values(k), quantile(d, p(k))) << parameters_of(d);
      ASSERT_EQ(others(k), value_at_score(d, scores(k))) << parameters_of(d);
    }
  }
}

/// Mean and standard deviation of a normal distribution between a and b standard deviations.
Moments textbook_normal(long double a, long double b) {
  const auto density = [](long double z) {
    return std::isfinite(z) ? std::exp(-z * z / 2) / std::sqrt(2 * std::acos(-1.0L)) : 0.0L;
  };
  const auto times = [](long double z, long double f) { return f > 0 ? z * f : 0.0L; };
  const Distribution standard;
  const long double all = share_between(standard, a, b);
  const long double mean = (density(a) - density(b)) / all;
  const long double variance =
      1 + (times(a, density(a)) - times(b, density(b))) / all - mean * mean;
  return {double(mean), double(std::sqrt(variance))};
}

TEST(Distribution, MomentsOfCutNormalsEqualTheClosedForm) {
  double worst = 0.0;
  for (const auto& [a, b] : {std::pair{-1.0, 2.0},
                             {-infinity, 0.0},
                             {-3.0, infinity},
                             {1.0, 1.5},
                             {-8.0, 3.0},
                             {4.0, infinity},
                             {-infinity, -5.0},
                             {-0.01, 0.01},
                             {-infinity, infinity},
                             {-40.0, 50.0}}) {
    const Moments expected = textbook_normal(a, b);
    const Moments seen = moments({Kind::Normal, 10.0, 3.0, 10 + 3 * a, 10 + 3 * b});
    EXPECT_NEAR(seen.mean, 10 + 3 * expected.mean, 3e-13) << a << " " << b;
    EXPECT_NEAR(seen.standard_deviation, 3 * expected.standard_deviation, 3e-13) << a << " " << b;
    worst =
        std::max(worst, std::abs(seen.standard_deviation / expected.standard_deviation / 3 - 1));
  }
  std::cout << "worst standard deviation, relative " << worst << "\n";
  EXPECT_LT(worst, 1e-10);
}

TEST(Distribution, MomentsOfCutLogNormalsEqualTheClosedForm) {
  for (const double s : {0.1, 1.0, 3.0})
    for (const auto& [a, b] :
         {std::pair{-1.0, 2.0}, {-infinity, 0.5}, {-2.0, infinity}, {1.0, 1.5}}) {
      const Distribution d{Kind::LogNormal, 2.0, s, 2 * std::exp(s * a), 2 * std::exp(s * b)};
      const Distribution standard;
      const auto power = [&](int k) {
        return std::pow(2.0L, k) * std::exp(k * k * s * s / 2.0L) *
               share_between(standard, a - k * s, b - k * s) / share_between(standard, a, b);
      };
      const auto mean = double(power(1));
      const auto deviation = double(std::sqrt(power(2) - power(1) * power(1)));
      EXPECT_NEAR(moments(d).mean / mean, 1.0, 1e-12) << s << " " << a << " " << b;
      EXPECT_NEAR(moments(d).standard_deviation / deviation, 1.0, 1e-10) << s << " " << a;
    }
  EXPECT_DOUBLE_EQ(moments({Kind::LogNormal, 2.0, 0.5}).mean, 2 * std::exp(0.125));
  // the widest that is taken, cut and not
  const Moments all = moments({Kind::LogNormal, 1.0, 10.0});
  const Moments nearly = moments({Kind::LogNormal, 1.0, 10.0, 1e-300});
  EXPECT_NEAR(nearly.mean / all.mean, 1.0, 1e-12);
  EXPECT_NEAR(nearly.standard_deviation / all.standard_deviation, 1.0, 1e-12);
}

TEST(Distribution, MomentsAreThoseOfTheValuesThatQuantilesGive) {
  const unsigned seed = 11;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  AnyDistribution any(seed);
  double worst = 0.0;
  for (int i = 0; i < 40; ++i) {
    Distribution d = any.next();
    if (!std::isfinite(d.low) && d.kind != Kind::LogNormal) d.low = d.centre - 3 * d.spread;
    if (!std::isfinite(d.high))
      d.high = d.kind == Kind::LogNormal ? 5 * d.centre : d.centre + 2.9 * d.spread;
    if (distribution_error(d)) continue;
    const int n = 200000;  // midpoints; p = t^2 (3 - 2 t) makes the ends, which are steep, harmless
    const double from = quantile(d, 0.5);
    double sum = 0.0;
    double squares = 0.0;
    for (int k = 0; k < n; ++k) {
      const double t = (k + 0.5) / n;
      const double value = quantile(d, t * t * (3 - 2 * t)) - from;
      sum += value * 6 * t * (1 - t) / n;
      squares += value * value * 6 * t * (1 - t) / n;
    }
    const double deviation = std::sqrt(squares - sum * sum);
    const Moments seen = moments(d);
    worst = std::max({worst, std::abs(seen.mean - from - sum) / deviation,
                      std::abs(seen.standard_deviation / deviation - 1)});
    ASSERT_LT(worst, 1e-6) << parameters_of(d);
  }
  std::cout << "worst of the midpoint rule " << worst << " standard deviations\n";
}

TEST(Distribution, ANarrowWindowIsUniform) {
  for (const Distribution& d : {Distribution{Kind::Normal, 0, 1, 1.0, 1.0 + 1e-9},
                                Distribution{Kind::Triangular, 1, 1, 0.5, 0.5 + 1e-9},
                                Distribution{Kind::LogNormal, 1, 1, 2.0, 2.0 + 1e-9}}) {
    ASSERT_EQ(distribution_error(d), nullptr);
    const double width = d.high - d.low;
    EXPECT_NEAR(moments(d).standard_deviation / width, std::sqrt(1.0 / 12.0), 1e-8);
    EXPECT_NEAR((moments(d).mean - d.low) / width, 0.5, 1e-6);
    EXPECT_GE(quantile(d, 1e-9), d.low);
    EXPECT_LE(quantile(d, 1 - 1e-9), d.high);
    EXPECT_NEAR((quantile(d, 0.25) - d.low) / width, 0.25, 1e-5);
  }
}

TEST(Distribution, AWholeOneHasItsTextbookMoments) {
  EXPECT_EQ(moments({Kind::Normal, 4, 3}).mean, 4.0);
  EXPECT_EQ(moments({Kind::Normal, 4, 3}).standard_deviation, 3.0);
  EXPECT_DOUBLE_EQ(moments({Kind::Uniform, 4, 3}).mean, 4.0);
  EXPECT_DOUBLE_EQ(moments({Kind::Uniform, 4, 3}).standard_deviation, std::sqrt(3.0));
  EXPECT_DOUBLE_EQ(moments({Kind::Triangular, 4, 3}).mean, 4.0);
  EXPECT_DOUBLE_EQ(moments({Kind::Triangular, 4, 3}).standard_deviation, std::sqrt(1.5));
}

TEST(Distribution, WhatIsNoneIsRefusedInWords) {
  const auto says = [](const Distribution& d, const std::string& text) {
    const char* fault = distribution_error(d);
    ASSERT_NE(fault, nullptr) << text;
    EXPECT_HAS(std::string(fault), text) << fault;
  };
  says({Kind::Normal, 0, 0}, "a spread above 0");
  says({Kind::Normal, 0, -1}, "a spread above 0");
  says({Kind::Normal, 0, NAN}, "a spread above 0");
  says({Kind::Normal, 0, infinity}, "a spread above 0");
  says({Kind::Normal, NAN, 1}, "a finite centre");
  says({Kind::Normal, infinity, 1}, "a finite centre");
  says({Kind::LogNormal, 0, 1}, "a median above 0");
  says({Kind::LogNormal, 1, 11}, "at most 10");
  says({Kind::Normal, 0, 1, 2, 1}, "a low limit below");
  says({Kind::Normal, 0, 1, 1, 1}, "a low limit below");
  says({Kind::Normal, 0, 1, NAN, 1}, "a low limit below");
  says({Kind::Normal, 0, 1, 1, NAN}, "a low limit below");
  says({Kind::Normal, 0, 1, 40, 41}, "low and high limits that contain part");
  says({Kind::Uniform, 0, 1, 1, 2}, "low and high limits that contain part");
  says({Kind::Triangular, 0, 1, -3, -2}, "low and high limits that contain part");
  says({Kind::LogNormal, 1, 1, -2, 0}, "low and high limits that contain part");
  says({Kind::Normal, 0, 1, infinity, infinity}, "a low limit below");
  says({Kind::Uniform, 1e308, 1e308}, "finite");
  EXPECT_EQ(distribution_error({}), nullptr);
  EXPECT_EQ(distribution_error({Kind::Normal, 0, 1e-12, 0}), nullptr);
  EXPECT_EQ(distribution_error({Kind::LogNormal, 1e-9, 0.1, -5, 1}), nullptr);
}

TEST(Distribution, OpenTurnsAgreesOnCutDistributions) {
  const auto theirs = oracle::openturns(R"(
import math
for base, low, high in (
    (ot.Normal(2, 3), 1.0, 9.0), (ot.Normal(2, 3), -5.0, 2.5),
    (ot.Uniform(-1, 5), 0.0, 3.0), (ot.Triangular(-1, 2, 5), 0.5, 4.0),
    (ot.LogNormal(math.log(2), 0.4, 0), 1.0, 3.0)):
  d = ot.TruncatedDistribution(base, low, high)
  print(d.getMean()[0], d.getStandardDeviation()[0], d.computeCDF(1.75))
  for p in (0.001, 0.3, 0.5, 0.9): print(d.computeQuantile(p)[0])
)");
  if (!theirs) GTEST_SKIP() << "OpenTURNS is not installed";
  const std::vector<Distribution> ours = {{Kind::Normal, 2, 3, 1, 9},
                                          {Kind::Normal, 2, 3, -5, 2.5},
                                          {Kind::Uniform, 2, 3, 0, 3},
                                          {Kind::Triangular, 2, 3, 0.5, 4},
                                          {Kind::LogNormal, 2, 0.4, 1, 3}};
  ASSERT_EQ(theirs->size(), 7 * ours.size());
  auto next = theirs->begin();
  double worst = 0.0;
  for (const Distribution& d : ours)
    for (const double mine :
         {moments(d).mean, moments(d).standard_deviation, cumulative(d, 1.75), quantile(d, 0.001),
          quantile(d, 0.3), quantile(d, 0.5), quantile(d, 0.9)}) {
      EXPECT_NEAR(mine, *next, 1e-12) << parameters_of(d);
      worst = std::max(worst, std::abs(mine - *next++));
    }
  std::cout << "worst difference " << worst << "\n";
}

}  // namespace
}  // namespace abbe::sim::study
