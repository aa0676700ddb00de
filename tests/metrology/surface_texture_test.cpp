#include "errors/metrology/surface_texture.h"
#include "tests/oracles/profile_oracle.h"
#include "tests/oracles/rippled_wave.h"
#include "tests/test.h"

namespace abbe::errors::metrology {
namespace {

constexpr double A = 0.001;  // mm

Profile wave_of(double wave, double step, Index n) {
  Profile profile{step, VectorXd(n)};
  for (Index i = 0; i < n; ++i) profile.z[i] = A * std::sin(2.0 * pi * double(i) * step / wave);
  return profile;
}

/// The share of a wave that passes in the middle of a long profile, where that is highest.
double transmission(double wave, double step, double index) {
  const Profile in = wave_of(wave, step, Index(3.0 * index / step) + Index(4.0 * wave / step));
  const VectorXd out = mean_line(in, index);
  const Index reach = Index(index / step) + 1;
  Index highest = 0;
  in.z.segment(reach, in.z.size() - 2 * reach).maxCoeff(&highest);
  return out[reach + highest] / in.z[reach + highest];
}

std::vector<double> plain(const VectorXd& v) { return {v.begin(), v.end()}; }

/// Heights without any order, on a wave and a slope.
Profile rough(Index n, double step, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, 0.3 * A);
  Profile profile = wave_of(17.3 * step, step, n);
  for (Index i = 0; i < n; ++i) profile.z[i] += normal(random) + 1e-5 * double(i);
  return profile;
}

TEST(MeanLine, PassesWavesAsTheGaussianDoes) {
  double worst = 0.0;
  for (const double n : {5.0, 6.0, 10.0, 50.0})
    for (const double r : {2.2, 2.0, 1.0, 0.5, 0.125}) {
      const double exact = std::exp2(-r * r), got = transmission(0.8 / r, 0.8 / n, 0.8);
      EXPECT_NEAR(got, exact, std::exp2(-(n - r) * (n - r)) + 2e-7) << n << " steps, N / " << r;
      if (n > 5.0 && r < 2.0) worst = std::max(worst, std::abs(got - exact));
    }
  std::cout << "transmission " << worst << " off at most, of N and longer at 6 steps and more\n";
  EXPECT_NEAR(transmission(0.8, 0.016, 0.8), 0.5, 1e-6);
  EXPECT_NEAR(transmission(0.4, 0.016, 0.8), 0.0625, 1e-6);
  EXPECT_NEAR(transmission(1.6, 0.016, 0.8), 0.8409, 1e-4);
}

TEST(MeanLine, LeavesAStraightLineAsItIs) {
  for (const double index : {0.03, 0.5, 1.3, 80.0}) {
    const Profile line{0.02, VectorXd::LinSpaced(100, -0.01, 0.03)};
    EXPECT_LT((mean_line(line, index) - line.z).cwiseAbs().maxCoeff(), 1e-15) << index;
  }
}

TEST(MeanLine, IsThatOfBruteForceUpToTheEnds) {
  double worst = 0.0;
  for (const Index n : {1, 2, 3, 40, 301})
    for (const double index : {0.004, 0.02, 0.2, 3.0, 500.0}) {
      const Profile profile = rough(n, 0.01, 20240611);
      const VectorXd line = mean_line(profile, index);
      const auto brute = test::brute_mean_line(plain(profile.z), profile.step, index);
      for (Index i = 0; i < n; ++i) {
        const double off = std::abs(line[i] - brute[std::size_t(i)]);
        worst = std::max(worst, off);
        EXPECT_LT(off, 1e-15) << n << " places, N " << index << ", place " << i;  // 1 am a mm: ulp
      }
    }
  std::cout << "mean line " << worst << " mm off brute force at most\n";
}

TEST(MeanLine, RefusesWhatIsNoProfile) {
  const Profile good = wave_of(1.0, 0.1, 20);
  EXPECT_THROW(mean_line(good, 0.0), std::invalid_argument);
  EXPECT_THROW(mean_line(good, infinity), std::invalid_argument);
  EXPECT_THROW(mean_line({0.0, good.z}, 1.0), std::invalid_argument);
  EXPECT_THROW(mean_line({0.1, VectorXd()}, 1.0), std::invalid_argument);
  Profile holed = good;
  holed.z[3] = none;
  EXPECT_THROW(mean_line(holed, 1.0), std::invalid_argument);
}

TEST(ProfileParametersOf, ASineAreTheClosedForms) {
  for (const int m : {10, 40, 400}) {
    const double wave = 0.5, step = wave / m;
    const Profile sine = wave_of(wave, step, 22 * m);
    const ProfileParameters p = parameters(sine, {wave, 4.0 * wave, 5});
    const double loss = 0.4 * std::pow(pi / m, 2);
    EXPECT_NEAR(p.a / (2.0 * A / pi), 1.0, loss);
    EXPECT_NEAR(p.q / (A / std::sqrt(2.0)), 1.0, 1e-12);
    EXPECT_NEAR(*p.sk, 0.0, 1e-12);
    EXPECT_NEAR(*p.ku, 1.5, 1e-12);
    for (const double height : {p.t, p.z, p.zx, 2.0 * p.p, 2.0 * p.v})
      EXPECT_NEAR(height / (2.0 * A), 1.0, 0.5 * std::pow(pi / m, 2));
    EXPECT_NEAR(*p.sm, wave, step / 18.0);
    const double exact = std::sqrt(2.0) * pi * A / wave;
    EXPECT_NEAR(p.dq / exact, 1.0, std::pow(2.0 * pi / m, 6) / 140.0 + 1e-12);
    std::cout << m << " places a wave: a " << p.a / (2.0 * A / pi) - 1.0 << ", sm "
              << *p.sm / wave - 1.0 << ", dq " << p.dq / exact - 1.0 << " off, relative\n";
  }
}

TEST(ProfileParametersOf, AnythingAreThoseOfBruteForce) {
  double worst = 0.0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const int sections = 1 + int(seed % 5), a_section = 60;
    Profile profile = rough(sections * a_section + 20, 0.01, seed);
    profile.z -= straight_line(profile);
    const int first = 10, last = first + sections * a_section;
    const ProfileParameters p = parameters(profile, {0.1, 0.6, sections});
    const test::BruteProfile b =
        test::brute_parameters(plain(profile.z), profile.step, first, last, sections);
    const std::array<std::array<double, 2>, 11> pairs = {{{p.a, b.a},
                                                          {p.q, b.q},
                                                          {*p.sk, b.sk},
                                                          {*p.ku, b.ku},
                                                          {p.t, b.t},
                                                          {p.p, b.p},
                                                          {p.v, b.v},
                                                          {p.z, b.z},
                                                          {p.zx, b.zx},
                                                          {p.sm.value_or(none), b.sm},
                                                          {p.dq, b.dq}}};
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      const double off = std::abs(pairs[k][0] - pairs[k][1]) / (1e-9 + std::abs(pairs[k][1]));
      worst = std::max(worst, off);
      EXPECT_LT(off, 1e-10) << "seed " << seed << ", parameter " << k;
    }
  }
  std::cout << "parameters " << worst << " off brute force at most, relative\n";
}

TEST(ProfileParametersOf, SmallHillsCountWithTheirNeighbours) {
  // twenty waves, each with a ripple of a hundredth that crosses the mean line several times
  const int m = 400;
  Profile profile = wave_of(1.0, 1.0 / m, 20 * m);
  for (Index i = 0; i < profile.z.size(); ++i)
    profile.z[i] += 0.02 * A * std::sin(2.0 * pi * 50.0 * double(i) / m + 1.0);
  const ProfileParameters p = parameters(profile, {0.0, 20.0, 1});
  EXPECT_NEAR(*p.sm, 1.0, 1e-3);
}

TEST(ProfileParametersOf, ALevelProfileHaveNoShape) {
  const ProfileParameters p = parameters({0.1, VectorXd::Zero(50)}, {0.0, 5.0, 1});
  EXPECT_EQ(p.q, 0.0);
  EXPECT_FALSE(p.sk || p.ku || p.sm);
  EXPECT_THROW(parameters({0.1, VectorXd::Zero(50)}, {7.0, 5.0, 1}), std::invalid_argument);
}

/// A wave along a line whose places lie irregularly.
ProfileTexture texture_of(double length, double wave, const TextureOptions& options) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> part(0.2, 1.0);
  std::vector<double> at = {3.0};
  while (at.back() < 3.0 + length)
    at.push_back(std::min(3.0 + length, at.back() + 2e-3 * part(random)));
  const Eigen::Map<const VectorXd> s(at.data(), Index(at.size()));
  const VectorXd z = s.unaryExpr([&](double x) {
    return A * std::sin(2.0 * pi * x / wave) + 1e-3 * x +
           0.5 * A * std::sin(2.0 * pi * (x - 3.0) / 20.0);
  });
  return profile_texture(s, z, options);
}

TEST(ProfileTextureOf, AWaveOnAWaveAreThatOfEach) {
  const double wave = 0.2;
  const ProfileTexture t = texture_of(40.0, wave, {.Nic = 0.8, .sections = 5});
  EXPECT_DOUBLE_EQ(t.Nis, 2.5e-3);  // of Sc3
  EXPECT_EQ(t.sections.sections, 5);
  EXPECT_NEAR(t.sections.from, 18.0, 1e-9);
  const double passes = std::exp2(-std::pow(2.5e-3 / wave, 2)) - std::exp2(-16.0);
  EXPECT_NEAR(t.R.a / (2.0 * A / pi * passes), 1.0, 2e-3);
  EXPECT_NEAR(t.R.q / (A / std::sqrt(2.0) * passes), 1.0, 2e-3);
  EXPECT_NEAR(t.R.z / (2.0 * A * passes), 1.0, 2e-3);
  EXPECT_NEAR(*t.R.sm, wave, 1e-3);
  // two whole waves of 20 mm: the least-squares line takes 3 / (2 pi)^2 of their mean square 1 / 2
  const double left = std::sqrt(0.5 - 3.0 / std::pow(2.0 * pi, 2));
  EXPECT_NEAR(t.W.q / (0.5 * A * left), 1.0, 5e-3);
  EXPECT_LT((t.primary.z - t.waviness - t.roughness).cwiseAbs().maxCoeff(), 1e-18);
}

TEST(ProfileTextureOf, AShortLineHasFewerSections) {
  EXPECT_EQ(texture_of(3.0, 0.2, {.Nic = 0.8, .sections = 5}).sections.sections, 3);
  const ProfileTexture one = texture_of(0.5, 0.2, {.Nic = 0.8, .sections = 5});
  EXPECT_EQ(one.sections.sections, 1);
  EXPECT_NEAR(one.sections.section, 0.5, 1e-9);
}

TEST(ProfileTextureOf, ALongLineHasItsNisRaised) {
  const ProfileTexture t =
      texture_of(10.0, 0.2, {.Nic = 0.8, .Nis = 2.5e-3, .sections = 5, .places = 1001});
  EXPECT_EQ(t.primary.z.size(), 1001);
  EXPECT_NEAR(t.Nis, 0.05, 1e-9);
  EXPECT_DOUBLE_EQ(t.requested_Nis, 2.5e-3);
}

TEST(ProfileTextureOf, RefusesWhatIsNoLine) {
  const VectorXd two = VectorXd::LinSpaced(2, 0.0, 1.0);
  EXPECT_THROW(profile_texture(two, VectorXd::Zero(3), {}), std::invalid_argument);
  EXPECT_THROW(profile_texture(-two, two, {}), std::invalid_argument);
  EXPECT_THROW(profile_texture(0.0 * two, two, {}), std::invalid_argument);
  EXPECT_THROW(profile_texture(two, two, {.Nic = -1.0}), std::invalid_argument);
  EXPECT_THROW(profile_texture(two, two, {.Nis = none}), std::invalid_argument);
  EXPECT_THROW(profile_texture(two, two, {.sections = 0}), std::invalid_argument);
}

TEST(SettingClasses, AreThoseOfTheStandard) {
  EXPECT_STREQ(setting_class(0.8).name, "Sc3");
  EXPECT_STREQ(setting_class(2.5).name, "Sc4");
  EXPECT_STREQ(setting_class(1e-9).name, "Sc1");
  EXPECT_STREQ(setting_class(1e9).name, "Sc5");
  for (const double Nic : {0.08, 0.25, 0.8, 2.5, 8.0}) {
    const SettingClass& setting = setting_class(Nic);
    EXPECT_EQ(setting.Nic, Nic);
    EXPECT_DOUBLE_EQ(setting.section, Nic);
    EXPECT_DOUBLE_EQ(setting.evaluation, 5.0 * Nic);
  }
}

struct Grid {
  Eigen::MatrixX2d xy;
  VectorXd z;
  VectorXd weights;
};

/// Cells of a square of side 1, heights at their middles.
template <typename Height>
Grid grid(int n, const Height& height) {
  Grid g{Eigen::MatrixX2d(n * n, 2), VectorXd(n * n), VectorXd::Ones(n * n)};
  for (int i = 0; i < n * n; ++i) {
    const double x = (i % n + 0.5) / n, y = (i / n + 0.5) / n;
    g.xy.row(i) << x, y;
    g.z[i] = height(x, y);
  }
  return g;
}

ArealParameters of(const Grid& g, ArealReference reference = ArealReference::Plane) {
  return areal(g.xy, g.z, g.weights, {reference});
}

TEST(ArealParameters, OfASineAreItsClosedForms) {
  const double A = 0.003;
  // ten whole waves; what is sampled at 500 points a wave misses 1e-5 of the closed forms
  const Grid g = grid(1000, [&](double x, double) { return A * std::sin(20.0 * pi * x); });
  const ArealParameters a = of(g, ArealReference::None);
  EXPECT_NEAR(a.Sa / (2.0 * A / pi), 1.0, 2e-4);  // midpoint sums of |sin|: (pi/n)^2/6, n = 100
  EXPECT_NEAR(a.Sq / (A / std::sqrt(2.0)), 1.0, 1e-12);
  EXPECT_NEAR(a.Sz / (2.0 * A), 1.0, 5e-4);
  EXPECT_NEAR(*a.Ssk, 0.0, 1e-11);  // rounding of a million terms
  EXPECT_NEAR(*a.Sku, 1.5, 1e-11);
  std::cout << "Sa " << a.Sa / (2.0 * A / pi) - 1.0 << ", Sq " << a.Sq / (A / std::sqrt(2.0)) - 1.0
            << " off, relative\n";
}

TEST(ArealParameters, OfAPublishedSurfaceAreThoseOfSurfalize) {
  const test::RippledWave wave = test::rippled_wave();
  const ArealParameters a =
      areal(wave.xy, wave.z, VectorXd::Ones(wave.z.size()), {ArealReference::Mean});
  // tests/test_parameters.py there, which holds these to 1e-6
  EXPECT_NEAR(a.Sa, 0.653132, 1e-6);
  EXPECT_NEAR(a.Sq, 0.745961, 1e-6);
  EXPECT_NEAR(a.Sp, 1.854956, 1e-6);
  EXPECT_NEAR(a.Sv, 1.998661, 1e-6);
  EXPECT_NEAR(a.Sz, 3.853617, 1e-6);
  EXPECT_NEAR(*a.Ssk, -0.08144, 1e-6);
  EXPECT_NEAR(*a.Sku, 1.818014, 1e-6);
  std::cout.precision(9);
  std::cout << "Sa " << a.Sa << ", Sq " << a.Sq << ", Sp " << a.Sp << ", Sv " << a.Sv << ", Ssk "
            << *a.Ssk << ", Sku " << *a.Sku << "\n";
}

TEST(ArealParameters, OfAnEggBoxAreItsClosedForms) {
  const Grid g = grid(400, [](double x, double y) {
    return 0.001 * std::sin(8.0 * pi * x) * std::sin(8.0 * pi * y);
  });
  const ArealParameters a = of(g);
  EXPECT_NEAR(a.Sq, 0.0005, 1e-9);
  EXPECT_NEAR(a.Sa, 0.001 * 4.0 / (pi * pi), 1e-6);
  EXPECT_NEAR(*a.Sku, 2.25, 1e-3);
}

TEST(ArealParameters, OfAParaboloidCutOffAtItsMean) {
  // z = x^2 on (0, 1): mean 1/3, variance 4/45, third moment 16/945
  const Grid g = grid(1000, [](double x, double) { return x * x; });
  const ArealParameters a = of(g, ArealReference::Mean);
  EXPECT_NEAR(a.Sq, std::sqrt(4.0 / 45.0), 1e-6);
  EXPECT_NEAR(*a.Ssk, (16.0 / 945.0) / std::pow(4.0 / 45.0, 1.5), 1e-5);
  EXPECT_NEAR(a.Sp, 2.0 / 3.0, 2e-3);
  EXPECT_NEAR(a.Sv, 1.0 / 3.0, 2e-3);
}

TEST(ArealParameters, APlaneIsNoRoughness) {
  SeededRandom random(20250604);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Grid g{Eigen::MatrixX2d(5000, 2), VectorXd(5000), VectorXd(5000)};
  for (int i = 0; i < 5000; ++i) {
    g.xy.row(i) << 1000.0 + 50.0 * unit(random), -2000.0 + 30.0 * unit(random);
    g.weights[i] = 1.0 + unit(random);
    g.z[i] = 0.002 * unit(random);
  }
  const ArealParameters rough = of(g);
  g.z += 0.01 * g.xy.col(0) - 0.003 * g.xy.col(1) + VectorXd::Constant(5000, 77.0);
  const ArealParameters tilted = of(g);
  std::cout << "a tilt changes Sq by " << std::abs(tilted.Sq - rough.Sq) << " mm\n";
  EXPECT_NEAR(tilted.Sa, rough.Sa, 1e-13);
  EXPECT_NEAR(tilted.Sq, rough.Sq, 1e-13);
  EXPECT_NEAR(tilted.Sz, rough.Sz, 1e-12);
  EXPECT_NEAR(*tilted.Ssk, *rough.Ssk, 1e-9);
}

TEST(ArealParameters, APointOfTwiceTheAreaCountsTwice) {
  Grid g = grid(3, [](double x, double y) { return x * y * (x - y); });
  g.weights[4] = 2.0;
  Grid twice = g;
  twice.xy.conservativeResize(10, 2);
  twice.xy.row(9) = g.xy.row(4);
  twice.z.conservativeResize(10);
  twice.z[9] = g.z[4];
  twice.weights = VectorXd::Ones(10);
  EXPECT_NEAR(of(g).Sq, of(twice).Sq, 1e-15);
  EXPECT_NEAR(*of(g).Sku, *of(twice).Sku, 1e-12);
}

TEST(ArealParameters, AFlatSurfaceHasNoShape) {
  const ArealParameters a = of(grid(4, [](double, double) { return 0.0; }));
  EXPECT_EQ(a.Sq, 0.0);
  EXPECT_FALSE(a.Ssk || a.Sku);
}

TEST(ArealParameters, RefusesWhatIsNoSurface) {
  const Grid good = grid(3, [](double x, double) { return x; });
  Grid g = good;
  g.z[0] = std::nan("");
  EXPECT_THROW(of(g), std::invalid_argument);
  g = good;
  g.weights[0] = -1.0;
  EXPECT_THROW(of(g), std::invalid_argument);
  g = good;
  g.weights.setZero();
  EXPECT_THROW(of(g), std::invalid_argument);
  g = good;
  g.xy.col(1) = 2.0 * g.xy.col(0);
  EXPECT_THROW(of(g), std::invalid_argument);
  EXPECT_NO_THROW(of(g, ArealReference::Mean));
  g.z.conservativeResize(8);
  EXPECT_THROW(of(g), std::invalid_argument);
  EXPECT_THROW(of(Grid{}), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::errors::metrology
