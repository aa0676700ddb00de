// References: figures computed independently by numeric integration (typed below), closed forms of
// a slot, a plunge and a turned shaft, and the brute force of oracles/milling_force, which works in
// the textbook's frame. That frame is frame t with the tool fed along +x: its x, y, z are those of
// t, and its immersion phi, from +y clockwise, is pi/2 - the angle about z from x.

#include "cutting/stock/force.h"
#include "tests/oracles/milling_force.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

constexpr double full_turn = 2 * pi;
double of_textbook(double phi) { return 0.5 * pi - phi; }

/// A cylinder of so many slices up to `depth`, in material from entry to exit of the textbook.
Engagement flank(double radius, double depth, double entry, double exit, int slices) {
  Engagement e;
  for (int i = 0; i < slices; ++i) {
    const double length = depth / slices;
    e.slices.push_back({(i + 0.5) * length, radius, length, 0.5 * pi});
    e.arcs.push_back({i, of_textbook(exit), of_textbook(entry)});
  }
  return e;
}

/// A ball end in material up to its equator.
Engagement ball_end(double radius, double entry, double exit, int slices) {
  Engagement e;
  for (int i = 0; i < slices; ++i) {
    const double kappa = (i + 0.5) * 0.5 * pi / slices;
    e.slices.push_back({radius * (1 - std::cos(kappa)), radius * std::sin(kappa),
                        radius * 0.5 * pi / slices, kappa});
    e.arcs.push_back({i, of_textbook(exit), of_textbook(entry)});
  }
  return e;
}

/// The disc under a flat end mill.
Engagement bottom(double radius, int slices) {
  Engagement e;
  for (int i = 0; i < slices; ++i) {
    e.slices.push_back({0.0, (i + 0.5) * radius / slices, radius / slices, 0.0});
    e.arcs.push_back({i, 0.0, full_turn});
  }
  e.feed_t = -Vector3d::UnitZ();
  return e;
}

/// Numbers of a cut of the table, and what it says of it. Al6082-T6: a review of 2021, its [189];
/// Al7075: [190] and [156] there; the first: coefficients of a published calibration.
struct Row {
  const char* name;
  int teeth;
  double depth, feed, helix_deg, radius, entry, exit;
  CuttingCoefficients K;
  Vector3d average, most, least;
};

const CuttingCoefficients calibrated{"", "", 447.88, 374.21, 97.0, 70.298, 12.603, 0.0};
const CuttingCoefficients al6082{"", "", 631, 99, 273, 13, 10, 2.8};
const CuttingCoefficients al7075{"", "", 767.01, 168.8, 222, 27.7, 26.6, 0.7};
const CuttingCoefficients al7075_hss{"", "", 951.365, 262.597, 323.33, 11.115, 11.314, 1.105};

const std::vector<Row>& table() {
  static const std::vector<Row> rows{
      {"calibrated, quarter", 4, 5.08, 0.05, 30, 9.05, 0.0, 0.5 * pi, calibrated,
       Vector3d(-351.840278, 213.212886, 15.685038), Vector3d(-230.041, 435.496, 24.207),
       Vector3d(-412.595, -16.481, 3.960)},
      {"Al6082-T6 slot", 2, 2, 0.1, 30, 5, 0.0, pi, al6082,
       Vector3d(-22.632395, 79.652114, 40.359440), Vector3d(62.122, 154.390, 60.079),
       Vector3d(-105.313, -16.865, 8.749)},
      {"Al7075-T6 half up", 4, 3, 0.08, 30, 6, 0.0, 0.5 * pi, al7075,
       Vector3d(-182.556609, 81.246675, 36.019101), Vector3d(-115.897, 243.800, 54.640),
       Vector3d(-227.283, -67.471, 9.723)},
      {"Al7075-T6 half down", 4, 3, 0.08, 30, 6, 0.5 * pi, pi, al7075,
       Vector3d(40.440093, 208.641931, 36.019101), Vector3d(104.163, 281.209, 54.645),
       Vector3d(-80.422, 101.393, 9.760)},
      {"Al7075 HSS slot", 3, 1.5, 0.05, 30, 8, 0.0, pi, al7075_hss,
       Vector3d(-30.977192, 69.435346, 25.643055), Vector3d(5.457, 92.042, 27.553),
       Vector3d(-67.038, 52.381, 23.276)}};
  return rows;
}

TEST(Force, AveragesOfTheTableAreMetToItsDigits) {
  double worst = 0.0;
  for (const Row& row : table()) {
    const Engagement e = flank(row.radius, row.depth, row.entry, row.exit, 3);
    const Flutes flutes{row.teeth, row.helix_deg * units::deg};
    const Vector3d F = mean_force(e, row.K, flutes, row.feed).tool_wrench_t.head<3>();
    worst = std::max(worst, (F - row.average).lpNorm<Eigen::Infinity>());
    EXPECT_LT((F - row.average).lpNorm<Eigen::Infinity>(), 0.5e-6 * 1.0001)
        << row.name << ": " << F.transpose();
  }
  std::cout << "averages: off the table by at most " << worst << " N\n";
}

/// Largest and smallest of the three forces over a turn, in the table's own 7200 steps.
struct Extremes {
  Vector3d most = Vector3d::Constant(-1e9), least = Vector3d::Constant(1e9);
};
Extremes extremes(const std::function<Vector3d(double angle)>& force) {
  Extremes found;
  for (int i = 0; i < 7200; ++i) {
    const Vector3d F = force(of_textbook((i + 0.5) * full_turn / 7200));
    found.most = found.most.cwiseMax(F);
    found.least = found.least.cwiseMin(F);
  }
  return found;
}
double off(const Extremes& found, const Row& row) {
  return std::max((found.most - row.most).lpNorm<Eigen::Infinity>(),
                  (found.least - row.least).lpNorm<Eigen::Infinity>());
}

// The table was summed over straight discs, which enter and leave as a whole; 400 of them give its
// digits.
TEST(Force, ExtremesOfTheTableAreMetToItsDigitsByStraightDiscs) {
  double worst = 0.0;
  for (const Row& row : table()) {
    const int discs = 400;
    const Engagement e = flank(row.radius, row.depth / discs, row.entry, row.exit, 1);
    const Flutes straight{row.teeth, 0.0};
    const double lag = row.depth / discs * std::tan(row.helix_deg * units::deg) / row.radius;
    const Extremes found = extremes([&](double angle) {
      Vector3d F = Vector3d::Zero();
      for (int k = 0; k < discs; ++k)
        F += instantaneous_force(e, row.K, straight, row.feed, angle + (k + 0.5) * lag)
                 .tool_wrench_t.head<3>();
      return F;
    });
    worst = std::max(worst, off(found, row));
    EXPECT_LT(off(found, row), 0.5e-3 * 1.0001) << row.name;
  }
  std::cout << "extremes by discs: off the table by at most " << worst << " N\n";
}

// A helix without discs meets its corners a moment apart from the table: a disc of a 400th of the
// depth is up to 1 N there.
TEST(Force, ExtremesOfTheTableAreMetByTheHelixExceptForADisc) {
  for (const Row& row : table()) {
    const Engagement e = flank(row.radius, row.depth, row.entry, row.exit, 1);
    const Flutes flutes{row.teeth, row.helix_deg * units::deg};
    const Extremes found = extremes([&](double angle) -> Vector3d {
      return instantaneous_force(e, row.K, flutes, row.feed, angle).tool_wrench_t.head<3>();
    });
    std::cout << row.name << ": extremes of the helix off the table by " << off(found, row)
              << " N\n";
    EXPECT_LT(off(found, row), 0.2) << row.name;
  }
}

TEST(Force, SlotMeetsItsIdentities) {
  const double a = 2.0, c = 0.1, R = 5.0;
  for (const int N : {1, 2, 3, 7}) {
    const Engagement e = flank(R, a, 0.0, pi, 4);
    const CuttingCoefficients& K = al6082;
    const CuttingLoad load = mean_force(e, K, {N, 0.5}, c);
    const Vector3d expected(-N * a * (c * K.K_rc / 4 + K.K_re / pi),
                            N * a * (c * K.K_tc / 4 + K.K_te / pi),
                            N * a * (c * K.K_ac / pi + K.K_ae / 2));
    EXPECT_LT((load.tool_wrench_t.head<3>() - expected).norm(), 1e-12 * 500) << N;
    EXPECT_NEAR(load.torque, N * a * R * (c * K.K_tc / pi + K.K_te / 2), 1e-10) << N;
    EXPECT_NEAR(load.tool_wrench_t[5], load.torque, 1e-10)
        << N;  // clockwise: the cut turns it back
    EXPECT_NEAR(load.chip_volume, 2 * R * a * N * c, 1e-12) << N;
    EXPECT_NEAR(load.contact_t.z(), a / 2, 1e-12);
    EXPECT_NEAR(load.contact_t.y(), 0.0, 1e-12);
    EXPECT_GT(load.contact_t.x(), 2 * R / pi);  // more chip in front
    EXPECT_LT(load.contact_t.x(), R * pi / 4);
  }
}

TEST(Force, CuttingEnergyIsThatOfTheChip) {
  SeededRandom random(31);
  std::uniform_real_distribution<double> unit(0, 1);
  double worst = 0.0;
  for (int i = 0; i < 200; ++i) {
    Engagement e = ball_end(1 + 9 * unit(random), 0.0, full_turn * unit(random), 5);
    e.feed_t = Vector3d(unit(random) - 0.5, unit(random) - 0.5, unit(random) - 0.5).normalized();
    const CuttingCoefficients K{"", "", 1000 * unit(random), 200, -100, 0, 0, 0};
    const Flutes flutes{1 + i % 5, unit(random), i % 2 * 0.02, 6 * unit(random), i % 3 != 0};
    const CuttingLoad mean = mean_force(e, K, flutes, 0.1);
    const CuttingLoad now = instantaneous_force(e, K, flutes, 0.1, 100 * unit(random));
    for (const CuttingLoad& load : {mean, now}) {  // work per turn
      const double off = std::abs(full_turn * load.torque - K.K_tc * load.chip_volume);
      worst = std::max(worst, off / (1 + K.K_tc * load.chip_volume));
    }
  }
  std::cout << "energy: off by " << worst << " of itself\n";
  EXPECT_LT(worst, 1e-13);
}

TEST(Force, PlungePressesOnTheWholeBottom) {
  const double R = 4.0, c = 0.05;
  const Engagement e = bottom(R, 6);
  const CuttingCoefficients& K = al6082;
  for (const CuttingLoad& load :
       {mean_force(e, K, {3, 0.5}, c), instantaneous_force(e, K, {3, 0.5}, c, -0.7)}) {
    EXPECT_NEAR(load.tool_wrench_t[2], 3 * R * (K.K_rc * c + K.K_re), 1e-11);
    EXPECT_LT(load.tool_wrench_t.head<2>().norm(), 1e-11);
    EXPECT_NEAR(load.torque, 3 * R * R / 2 * (K.K_tc * c + K.K_te), 1e-11);
    EXPECT_NEAR(load.chip_volume, pi * R * R * 3 * c, 1e-11);
    EXPECT_TRUE(load.contact_t.isZero(1e-12));
  }
}

TEST(Force, NothingEngagedIsNoLoad) {
  const CuttingCoefficients nothing{};
  Engagement backwards = flank(5, 2, 0, pi, 2);
  backwards.feed_t = -Vector3d::UnitX();
  const auto none = [](const CuttingLoad& load) {
    return load.tool_wrench_t.isZero(0) && load.contact_t.isZero(0) && load.torque == 0 &&
           load.chip_volume == 0;
  };
  const Flutes out{3, 0.5, 0.01, 1.0};
  EXPECT_TRUE(none(mean_force({}, al6082, {}, 0.1)));
  EXPECT_TRUE(none(instantaneous_force({}, al6082, {}, 0.1, 1.0)));
  EXPECT_TRUE(none(instantaneous_force({}, al6082, out, 0.1, 1.0)));
  EXPECT_TRUE(none(mean_force(flank(5, 2, 0, pi, 2), al6082, {}, 0.0)));
  EXPECT_TRUE(none(instantaneous_force(flank(5, 2, 0, pi, 2), al6082, {}, 0.0, 1.0)));
  EXPECT_TRUE(none(turning_force({}, {}, al6082, 10.0)));
  EXPECT_TRUE(none(turning_force({{0.0, 1.0, 0.0}}, {}, al6082, 10.0)));
  EXPECT_TRUE(mean_force(flank(5, 2, 0, pi, 2), nothing, {}, 0.1).contact_t.isZero(0));
  // What is behind the feed meets no chip, but for the rounding at the two points beside it.
  EXPECT_LT(mean_force(backwards, al6082, {}, 0.1).tool_wrench_t.norm(), 1e-12);
  Engagement plunge = flank(5, 2, 0, pi, 2);
  plunge.feed_t = -Vector3d::UnitZ() + 1e-17 * Vector3d::UnitX();
  EXPECT_TRUE(none(mean_force(plunge, al6082, {}, 0.1)));  // a flank does not rub
}

TEST(Force, SidesBehindTheFeedAreLeftOut) {
  Engagement whole = flank(5, 2, 0, pi, 2), half = whole;
  for (EngagedArc& arc : whole.arcs) arc.from = -2.5, arc.to = -2.5 + full_turn;
  const CuttingLoad a = mean_force(whole, al6082, {}, 0.1), b = mean_force(half, al6082, {}, 0.1);
  EXPECT_LT((a.tool_wrench_t - b.tool_wrench_t).norm(), 1e-12 * b.tool_wrench_t.norm());
  for (const double angle : {0.0, 1.0, 2.0, -7.0}) {
    const CuttingLoad c = instantaneous_force(whole, al6082, {4, 0.5}, 0.1, angle);
    const CuttingLoad d = instantaneous_force(half, al6082, {4, 0.5}, 0.1, angle);
    EXPECT_LT((c.tool_wrench_t - d.tool_wrench_t).norm(), 1e-11 * d.tool_wrench_t.norm()) << angle;
  }
}

TEST(Force, SplitArcsAndTurnsMoreAreTheSame) {
  const Engagement one = flank(5, 2, 0.3, 2.0, 2);
  Engagement other = one;
  other.arcs.clear();
  for (const EngagedArc& arc : one.arcs) {
    other.arcs.push_back({arc.slice, arc.from - 3 * full_turn, -3 * full_turn + 0.4});
    other.arcs.push_back({arc.slice, 0.4 + full_turn, arc.to + full_turn});
  }
  for (const double helix : {0.0, 1e-13, 0.5, 1.4, -0.5}) {
    const Flutes flutes{3, helix, 0.01, 0.5};
    for (const double angle : {0.0, 0.41, 1.3, 50.0, -50.0}) {
      const CuttingLoad a = instantaneous_force(one, al6082, flutes, 0.1, angle);
      const CuttingLoad b = instantaneous_force(other, al6082, flutes, 0.1, angle);
      EXPECT_LT((a.tool_wrench_t - b.tool_wrench_t).norm(), 1e-9) << helix << " " << angle;
      EXPECT_LT((a.contact_t - b.contact_t).norm(), 1e-9) << helix << " " << angle;
    }
  }
}

TEST(Force, OneSliceOfAFlankSaysWhatManySay) {
  for (const double helix : {0.0, 0.5, 1.3}) {
    for (const double angle : {0.1, 0.9, 2.0}) {
      const Flutes flutes{3, helix, 0.01, 0.5};
      const CuttingLoad a =
          instantaneous_force(flank(5, 8, 0.3, 2.0, 1), al6082, flutes, 0.1, angle);
      const CuttingLoad b =
          instantaneous_force(flank(5, 8, 0.3, 2.0, 40), al6082, flutes, 0.1, angle);
      EXPECT_LT((a.tool_wrench_t - b.tool_wrench_t).norm(), 1e-12 * 1e5) << helix << " " << angle;
      EXPECT_LT((a.contact_t - b.contact_t).norm(), 1e-12 * 1e3) << helix << " " << angle;
    }
  }
}

TEST(Force, CounterClockwiseIsTheMirrorImage) {
  const Engagement e = flank(5, 2, 0.3, 2.0, 3);
  Engagement mirrored = e;  // y to -y
  for (EngagedArc& arc : mirrored.arcs) arc = {arc.slice, -arc.to, -arc.from};
  for (const double angle : {0.2, 1.0, 2.5}) {
    const CuttingLoad a = instantaneous_force(e, al6082, {3, 0.4, 0.02, 0.6}, 0.1, angle);
    const CuttingLoad b =
        instantaneous_force(mirrored, al6082, {3, -0.4, 0.02, -0.6, false}, 0.1, -angle);
    kinematics::Wrench image = a.tool_wrench_t;
    for (const int i : {1, 3, 5}) image[i] = -image[i];
    EXPECT_LT((b.tool_wrench_t - image).norm(), 1e-10) << angle;
    EXPECT_NEAR(a.torque, b.torque, 1e-10);
    EXPECT_GT(a.torque, 0.0);
  }
}

// ---- against brute force

oracles::MillingCut brute(const CuttingCoefficients& K, const Flutes& flutes, double feed) {
  oracles::MillingCut cut;
  cut.teeth = flutes.count;
  cut.helix = flutes.helix;
  cut.feed = feed;
  cut.run_out = flutes.run_out;
  cut.run_out_angle = -flutes.run_out_angle;  // the textbook counts clockwise
  cut.K_tc = K.K_tc, cut.K_rc = K.K_rc, cut.K_ac = K.K_ac;
  cut.K_te = K.K_te, cut.K_re = K.K_re, cut.K_ae = K.K_ae;
  return cut;
}

double apart(const CuttingLoad& load, const oracles::MillingForce& brute) {
  return std::max((load.tool_wrench_t.head<3>() - brute.force).norm() / brute.force.norm(),
                  (load.tool_wrench_t.tail<3>() - brute.moment).norm() / brute.moment.norm());
}

TEST(Force, HelixAgreesWithBruteForceAtAnyAngle) {
  SeededRandom random(7);
  std::uniform_real_distribution<double> unit(0, 1);
  double worst = 0.0;
  for (int i = 0; i < 60; ++i) {
    const double R = 2 + 8 * unit(random), depth = 1 + 9 * unit(random);
    const double entry = pi * unit(random), exit = entry + (pi - entry) * unit(random);
    const Flutes flutes{1 + i % 5, 1.2 * unit(random), i % 2 * 0.03, 6 * unit(random)};
    oracles::MillingCut cut = brute(al6082, flutes, 0.1);
    cut.radius = R, cut.top = depth, cut.entry = entry, cut.exit = exit, cut.discs = 4000;
    const Engagement e = flank(R, depth, entry, exit, 20);
    const double phi = full_turn * unit(random);
    const oracles::MillingForce expected = milling_force_at(cut, phi);
    const CuttingLoad load = instantaneous_force(e, al6082, flutes, 0.1, of_textbook(phi));
    const double scale = 50.0 * depth;  // N, a tooth in full cut
    const double off =
        std::max((load.tool_wrench_t.head<3>() - expected.force).norm() / scale,
                 (load.tool_wrench_t.tail<3>() - expected.moment).norm() / scale / 10);
    worst = std::max(worst, off);
    EXPECT_LT(off, 6e-4) << i;  // a disc at either end of every tooth: 1 / 4000 each
    EXPECT_NEAR(load.torque, load.tool_wrench_t[5], 1e-9);
  }
  std::cout << "any angle: off brute force by " << worst << " of a tooth in full cut\n";
}

TEST(Force, BallEndAgreesWithBruteForceAtSecondOrder) {
  oracles::MillingCut cut = brute(al6082, {2, 30.0_deg}, 0.1);
  cut.ball = true, cut.top = cut.radius, cut.entry = 0.2, cut.exit = 2.4, cut.discs = 2000;
  const oracles::MillingForce expected = mean_milling_force(cut, 2000);
  double before = 0.0;
  for (const int slices : {6, 12, 24, 48}) {
    const Engagement e = ball_end(cut.radius, cut.entry, cut.exit, slices);
    const double off = apart(mean_force(e, al6082, {2, 30.0_deg}, 0.1), expected);
    std::cout << "ball, " << slices << " slices: off brute force by " << off << "\n";
    if (before > 0.0) {
      EXPECT_LT(off, std::max(before / 3.5, 2e-4));
    }
    before = off;
  }
  EXPECT_LT(before, 6e-5);
}

TEST(Force, BallEndAgreesWithBruteForceAtAnyAngle) {
  oracles::MillingCut cut = brute(al6082, {3, 30.0_deg, 0.01, 0.8}, 0.1);
  cut.ball = true, cut.top = cut.radius, cut.entry = 0.2, cut.exit = 2.4, cut.discs = 4000;
  const Engagement e = ball_end(cut.radius, cut.entry, cut.exit, 400);
  for (const double phi : {0.3, 0.9, 1.7, 2.6, 4.0}) {
    const double off =
        apart(instantaneous_force(e, al6082, {3, 30.0_deg, 0.01, 0.8}, 0.1, of_textbook(phi)),
              milling_force_at(cut, phi));
    std::cout << "ball at " << phi << ": off brute force by " << off << "\n";
    EXPECT_LT(off, 2e-4) << phi;
  }
}

TEST(Force, MeanOverAllAnglesIsTheMean) {
  for (const double run_out : {0.0, 0.01}) {
    Engagement e = ball_end(6, 0.4, 2.6, 9);
    e.feed_t = Vector3d(3, 0.5, -1).normalized();
    for (EngagedArc& arc : e.arcs) arc.from = -0.9, arc.to = 0.8;  // in front of that feed
    const Flutes flutes{4, 40.0_deg, run_out, 0.3};
    const CuttingLoad mean = mean_force(e, al6082, flutes, 0.1);
    kinematics::Wrench sum = kinematics::Wrench::Zero();
    double torque = 0.0, volume = 0.0;
    const int n = 40000;
    for (int i = 0; i < n; ++i) {
      const CuttingLoad now =
          instantaneous_force(e, al6082, flutes, 0.1, -(i + 0.5) * full_turn / n);
      sum += now.tool_wrench_t / n;
      torque += now.torque / n;
      volume += now.chip_volume / n;
    }
    std::cout << "mean over angles, run-out " << run_out << ": off by "
              << (sum - mean.tool_wrench_t).norm() / mean.tool_wrench_t.norm() << " of it\n";
    EXPECT_LT((sum - mean.tool_wrench_t).norm(), 1e-7 * mean.tool_wrench_t.norm());
    EXPECT_NEAR(torque, mean.torque, 1e-6 * mean.torque);
    EXPECT_NEAR(volume, mean.chip_volume, 1e-6 * mean.chip_volume);
  }
}

/// Mean force of one slice by Simpson's rule on the definition.
kinematics::Wrench by_simpson(const EdgeSlice& slice, const EngagedArc& arc, const Vector3d& feed) {
  const int n = 4000;
  kinematics::Wrench sum = kinematics::Wrench::Zero();
  for (int i = 0; i <= n; ++i) {
    const double phi = arc.from + (arc.to - arc.from) * i / n;
    const double weight = (i == 0 || i == n ? 1 : i % 2 ? 4 : 2) * (arc.to - arc.from) / (3 * n);
    const double sine = std::sin(slice.kappa), cosine = std::cos(slice.kappa);
    const Vector3d out(std::cos(phi), std::sin(phi), 0), around(-std::sin(phi), std::cos(phi), 0);
    const Vector3d normal = sine * out - cosine * Vector3d::UnitZ();
    const Vector3d up = cosine * out + sine * Vector3d::UnitZ();
    const double h = feed.dot(normal);
    const Vector3d force = (al6082.K_tc * h + al6082.K_te) * around -
                           (al6082.K_rc * h + al6082.K_re) * normal +
                           (al6082.K_ac * h + al6082.K_ae) * up;
    sum.head<3>() += weight * force;
    sum.tail<3>() += weight * (slice.radius * out + slice.height * Vector3d::UnitZ()).cross(force);
  }
  return sum * slice.length / full_turn;
}

TEST(Force, MeanIsExactForAnyArcAndFeed) {
  SeededRandom random(20);
  std::uniform_real_distribution<double> unit(0, 1);
  double worst = 0.0;
  int tried = 0;
  while (tried < 300) {
    Engagement e;
    e.slices = {{10 * unit(random), 5 * unit(random), unit(random), 0.5 * pi * unit(random)}};
    const double from = 20 * unit(random) - 10;
    const double width = tried % 4 == 0 ? 1e-7 : 3 * unit(random);
    e.arcs = {{0, from, from + width}};
    e.feed_t = Vector3d(unit(random) - 0.5, unit(random) - 0.5, unit(random) - 0.5).normalized();
    bool in_front = true;
    for (int i = 0; i <= 1000; ++i) {
      const double phi = from + width * i / 1000;
      const Vector3d normal(std::sin(e.slices[0].kappa) * std::cos(phi),
                            std::sin(e.slices[0].kappa) * std::sin(phi),
                            -std::cos(e.slices[0].kappa));
      in_front = in_front && normal.dot(e.feed_t) > 1e-6;
    }
    if (!in_front) continue;
    ++tried;
    const kinematics::Wrench got = mean_force(e, al6082, {1}, 0.1).tool_wrench_t;
    const kinematics::Wrench expected = by_simpson(e.slices[0], e.arcs[0], 0.1 * e.feed_t);
    const double amounts = width / full_turn * e.slices[0].length * (100.3 + 25.8) *
                           (1 + e.slices[0].radius + e.slices[0].height);
    worst = std::max(worst, (got - expected).norm() / amounts);
  }
  std::cout << "mean: off Simpson's rule by " << worst << " of the sum of amounts\n";
  EXPECT_LT(worst, 1e-12);
}

// ---- run-out

TEST(Force, RunOutMovesChipFromToothToToothButNotTheirSum) {
  const double R = 5, a = 2, c = 0.05;
  const Engagement e = flank(R, a, 0, pi, 1);
  const CuttingCoefficients K{"", "", 631, 99, 273, 0, 0, 0};
  for (const double run_out : {0.0, 0.005, 0.02, 0.5}) {  // 0.5: most teeth never meet a chip
    const Flutes flutes{4, 0.0, run_out, 1.1};
    double most = 0.0, sum = 0.0;
    for (int k = 0; k < 4; ++k) {  // straight teeth, one after the other at 20 degrees
      const double torque = instantaneous_force(flank(R, a, 70.0_deg - 0.1, 70.0_deg + 0.1, 1), K,
                                                flutes, c, 20.0_deg - k * pi / 2)
                                .torque;
      most = std::max(most, torque);
      sum += torque;
    }
    const double share = K.K_tc * R * a * c * std::cos(20.0_deg);
    std::cout << "run-out " << run_out << " mm: the heaviest tooth has " << most / share
              << " of an even share\n";
    EXPECT_NEAR(sum, 4 * share, 1e-10 * share);
    const Vector3d F = mean_force(e, K, flutes, c).tool_wrench_t.head<3>();
    Vector3d mean = Vector3d::Zero();
    for (int i = 0; i < 7200; ++i)
      mean += instantaneous_force(e, K, flutes, c, -(i + 0.5) * full_turn / 7200)
                  .tool_wrench_t.head<3>() /
              7200;
    EXPECT_LT((mean - F).norm(), 1e-5 * F.norm());
  }
}

TEST(Force, LargeRunOutLeavesOneToothAllTheWork) {
  const Flutes flutes{2, 0.0, 0.5, 0.0};
  const Engagement e = flank(5, 2, 0, pi, 1);
  const CuttingCoefficients K{"", "", 1000, 0, 0, 0, 0, 0};
  EXPECT_NEAR(instantaneous_force(e, K, flutes, 0.1, 0.0).torque, 1000 * 5 * 2 * 0.2, 1e-9);
  EXPECT_NEAR(instantaneous_force(e, K, flutes, 0.1, pi).torque, 0.0,
              1e-9);  // the other tooth's turn
}

// ---- turning

TEST(Force, TurningIsTheChipSectionAndTheEdge) {
  const Nose nose{0.8, {}};
  const double r = 12.5;
  std::vector<EngagedEdge> edges;
  double section = 0.0, length = 0.0;
  for (int i = 0; i < 100; ++i) {
    edges.push_back({0.2 + 0.01 * i, 0.008, 0.0004 * i});
    section += edges.back().chip * edges.back().length;
    length += i > 0 ? edges.back().length : 0.0;
  }
  const CuttingCoefficients K{"", "", 2000, 800, 50, 30, 40, 5};
  const CuttingLoad load = turning_force(edges, nose, K, r);
  EXPECT_NEAR(load.tool_wrench_t[1], -(2000 * section + 30 * length), 1e-10);
  EXPECT_NEAR(load.torque, r * (2000 * section + 30 * length), 1e-9);
  EXPECT_NEAR(load.chip_volume, full_turn * r * section, 1e-10);
  Vector3d radial = Vector3d::Zero();
  for (const EngagedEdge& edge : edges)
    if (edge.chip > 0)
      radial -= (800 * edge.chip + 40) * edge.length *
                Vector3d(std::cos(edge.psi), 0, std::sin(edge.psi));
  EXPECT_NEAR(load.tool_wrench_t[0], radial.x(), 1e-10);
  EXPECT_NEAR(load.tool_wrench_t[2], radial.z(), 1e-10);
  const Vector3d at = load.contact_t;
  EXPECT_GT(at.norm(), 0.7);
  EXPECT_LT(at.norm(), 0.8);
  EXPECT_EQ(at.y(), 0.0);
  // the radial forces pass through the centre of the edge: the moment is the tangential force's
  EXPECT_NEAR(load.tool_wrench_t[4], 0.0, 1e-10);
  const CuttingLoad without = turning_force(edges, nose, {"", "", 2000, 800, 0, 0, 0, 0}, r);
  EXPECT_NEAR(full_turn * without.torque, 2000 * without.chip_volume, 1e-9);  // energy
}

// ---- refusals

std::string refusal(const std::function<void()>& act) {
  return thrown_text<std::invalid_argument>([&] { act(); }, "none");
}

TEST(Force, NonPhysicalNumbersAreRefusedByName) {
  const double inf = std::numeric_limits<double>::infinity();
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  const auto with = [](double CuttingCoefficients::*which, double value) {
    CuttingCoefficients K = al6082;
    K.*which = value;
    return refusal([&] { mean_force({}, K, {}, 0.1); });
  };
  EXPECT_PRED2(has, with(&CuttingCoefficients::K_tc, -1.0), "K_tc");
  EXPECT_PRED2(has, with(&CuttingCoefficients::K_rc, -1.0), "K_rc");
  EXPECT_PRED2(has, with(&CuttingCoefficients::K_te, -1.0), "K_te");
  EXPECT_PRED2(has, with(&CuttingCoefficients::K_re, nan), "K_re");
  EXPECT_PRED2(has, with(&CuttingCoefficients::K_ac, inf), "K_ac");
  EXPECT_PRED2(has, with(&CuttingCoefficients::K_ae, nan), "K_ae");
  EXPECT_EQ(with(&CuttingCoefficients::K_ac, -1.0), "none");
  const auto flutes = [](const Flutes& f) { return refusal([&] { validate(f); }); };
  EXPECT_PRED2(has, flutes({0}), "flutes");
  EXPECT_PRED2(has, flutes({-3}), "flutes");
  EXPECT_PRED2(has, flutes({101}), "flutes");
  EXPECT_PRED2(has, flutes({2, 0.5 * pi}), "helix");
  EXPECT_PRED2(has, flutes({2, nan}), "helix");
  EXPECT_PRED2(has, flutes({2, 0, -0.1}), "run-out");
  EXPECT_PRED2(has, flutes({2, 0, inf}), "run-out");
  EXPECT_PRED2(has, flutes({2, 0, 0, nan}), "angle");
  EXPECT_EQ(flutes({1, 0.0, 0.0, 0.0, false}), "none");
  const auto feed = [](double f) { return refusal([&] { mean_force({}, al6082, {}, f); }); };
  EXPECT_PRED2(has, feed(-0.1), "feed");
  EXPECT_PRED2(has, feed(nan), "feed");
  EXPECT_PRED2(has, refusal([&] { instantaneous_force({}, al6082, {}, 0.1, inf); }), "angle");
  EXPECT_PRED2(has, refusal([&] { turning_force({}, {}, al6082, -1.0); }), "radius");
}

}  // namespace
}  // namespace abbe::cutting
