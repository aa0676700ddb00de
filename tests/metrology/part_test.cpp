#include "errors/metrology/part.h"
#include "kinematics/pose.h"
#include "tests/metrology/machines.h"
#include "tests/test.h"

using namespace abbe;
using namespace abbe::errors::metrology;
using kinematics::AxisState;

namespace {

namespace machines = abbe::errors::metrology::machines;

/// A dome of radius R about (0, 0, low), with some waviness as its deviation.
PartSurface dome(double R, int rings) {
  std::vector<Vector3d> points, normals;
  for (int i = 0; i <= rings; ++i) {
    const double polar = 0.5 * i / rings;
    const int count = std::max(1, 6 * i);
    for (int k = 0; k < count; ++k) {
      const double round = 2.0 * pi * k / count;
      const Vector3d n(std::sin(polar) * std::cos(round), std::sin(polar) * std::sin(round),
                       std::cos(polar));
      points.push_back(R * n + Vector3d(0, 0, 60.0 - R));
      normals.push_back(n);
    }
  }
  PartSurface part;
  const Index n = Index(points.size());
  part.points_w.resize(n, 3);
  part.normals_w.resize(n, 3);
  part.deviation.resize(n);
  for (Index i = 0; i < n; ++i) {
    part.points_w.row(i) = points[std::size_t(i)];
    part.normals_w.row(i) = normals[std::size_t(i)];
    part.deviation[i] = 3.0_um * std::sin(0.1 * points[std::size_t(i)].x());
  }
  return part;
}

TouchProbe exact_probe(const machines::Chain& chain) {
  TouchProbe probe;
  probe.noise = 0.0;
  probe.q = VectorXd::Zero(chain.size());
  return probe;
}

MachineUnderTest bent(const machines::Chain& chain) {
  return machines::wrong(chain, [chain](const AxisState& state) {
    auto d = machines::none(chain);
    for (int j = 0; j < chain.size(); ++j)
      for (int k = 0; k < 6; ++k)
        d[std::size_t(j)].motion[k] =
            (k < 3 ? 8.0_um : 20.0_urad) * std::sin(0.01 * state.q[j] + 0.7 * j + k);
    return d;
  });
}

}  // namespace

TEST(Probe, APerfectMachineReadsThePartAsItIs) {
  const machines::Chain chain = machines::gantry();
  const PartSurface part = dome(90.0, 6);
  const PartReadings r = probe(part, chain, machines::perfect(chain), exact_probe(chain));
  ASSERT_EQ(r.deviation.size(), part.deviation.size());
  const double worst = (r.deviation - part.deviation).cwiseAbs().maxCoeff();
  std::cout << "largest difference " << worst << " mm\n";
  EXPECT_LT(worst, 1e-12);
  EXPECT_EQ(r.time_s[0], 0.0);
  for (Index i = 1; i < r.time_s.size(); ++i) EXPECT_GT(r.time_s[i], r.time_s[i - 1]);
}

TEST(Probe, ReadsDeviationLessTheErrorOfTheTipAlongTheNormal) {
  const machines::Chain chain = machines::trunnion();
  const PartSurface part = dome(90.0, 6);
  const auto machine = bent(chain);
  TouchProbe touch = exact_probe(chain);
  touch.q[*chain.find('A')] = 0.3;
  const PartReadings r = probe(part, chain, machine, touch);
  double worst = 0.0, largest = 0.0;
  for (Index i = 0; i < r.deviation.size(); ++i) {
    const Vector3d p = part.points_w.row(i), n = part.normals_w.row(i);
    AxisState state;
    state.q = touch.q;
    const Vector3d ball_w = p + touch.radius * n;
    // The slides by hand: the tip in the workpiece is linear in them.
    const auto tip = [&](const kinematics::AxisVector& q) -> Vector3d {
      return chain.tool_in_workpiece(q).translation();
    };
    Matrix3d slides;
    for (int k = 0; k < 3; ++k) {
      kinematics::AxisVector q = state.q;
      q[2 + k] += 1.0;
      slides.col(k) = tip(q) - tip(state.q);
    }
    state.q.segment<3>(2) += slides.inverse() * (ball_w - tip(state.q));
    const BodyPoses b = machine(state);
    const Vector3d error_w = (b.T_bw.inverse() * b.T_bt).translation() - tip(state.q);
    const double expected = part.deviation[i] - n.dot(error_w);
    worst = std::max(worst, std::abs(r.deviation[i] - expected));
    largest = std::max(largest, std::abs(n.dot(error_w)));
  }
  std::cout << "errors of up to " << largest << " mm, first order holds to " << worst << " mm\n";
  // The error changes by 8 um * 0.01 a mm over the deviation of some 30 um.
  EXPECT_GT(largest, 5.0_um);
  EXPECT_LT(worst, 0.01_um);
}

TEST(Probe, AMachineThatCutThePartInTheSamePoseReadsNothing) {
  const machines::Chain chain = machines::gantry();
  PartSurface part = dome(90.0, 6);
  const auto machine = bent(chain);
  const TouchProbe touch = exact_probe(chain);
  // Cut by a ball of the probe's radius commanded to touch the design: the surface that is left.
  for (Index i = 0; i < part.deviation.size(); ++i) {
    const Vector3d p = part.points_w.row(i), n = part.normals_w.row(i);
    AxisState state;
    state.q = touch.q;
    const Vector3d start = chain.tool_in_workpiece(state.q).translation();
    state.q.segment<3>(1) += p + touch.radius * n - start;  // X Y Z of a gantry with C at 0
    const BodyPoses b = machine(state);
    part.deviation[i] = n.dot((b.T_bw.inverse() * b.T_bt).translation() - p) - touch.radius;
  }
  const PartReadings r = probe(part, chain, machine, touch);
  std::cout << "part wrong by up to " << part.deviation.cwiseAbs().maxCoeff() << " mm, read as "
            << r.deviation.cwiseAbs().maxCoeff() << " mm\n";
  EXPECT_GT(part.deviation.cwiseAbs().maxCoeff(), 5.0_um);
  EXPECT_LT(r.deviation.cwiseAbs().maxCoeff(), 1e-11);
}

TEST(Probe, ApproachesAlongTheNormal) {
  const machines::Chain chain = machines::gantry();
  PartSurface part = dome(90.0, 4);
  part.deviation.setZero();
  const double half = 2.0_um;  // every slide lags
  const auto machine = machines::wrong(chain, [&](const AxisState& state) {
    auto d = machines::none(chain);
    for (int k = 0; k < 3; ++k)
      d[std::size_t(1 + k)].motion[k] = -half * state.direction[std::size_t(1 + k)];
    return d;
  });
  const PartReadings r = probe(part, chain, machine, exact_probe(chain));
  for (Index i = 1; i < r.deviation.size(); ++i) {
    // Every slide moves against the normal and lies behind: the tip is held back along the normal.
    const double behind = half * part.normals_w.row(i).cwiseAbs().sum();
    double expected = -behind;
    // A slide that the normal lies across of comes from the last touch as it likes.
    for (int k = 0; k < 3; ++k)
      if (std::abs(part.normals_w(i, k)) < 1e-9) expected = NAN;
    if (!std::isnan(expected)) {
      EXPECT_NEAR(r.deviation[i], expected, 1e-11);
    }
  }
}

TEST(Probe, SkipsWhatWasNotCutAndRefusesWhatCannotBe) {
  const machines::Chain chain = machines::gantry();
  PartSurface part = dome(90.0, 3);
  part.deviation[2] = NAN;
  const TouchProbe touch = exact_probe(chain);
  EXPECT_EQ(probe(part, chain, machines::perfect(chain), touch).deviation.size(),
            part.deviation.size() - 1);
  const auto refused = [&](PartSurface surface, TouchProbe with) {
    EXPECT_THROW(probe(surface, chain, machines::perfect(chain), with), std::invalid_argument);
  };
  PartSurface bad = part;
  bad.deviation[0] = INFINITY;
  refused(bad, touch);
  bad = part;
  bad.deviation[0] = 5.0;  // further off than the approach begins
  refused(bad, touch);
  bad = part;
  bad.normals_w.row(1) *= 1.1;
  refused(bad, touch);
  bad = part;
  bad.points_w(0, 0) = 4000.0;
  refused(bad, touch);
  bad = part;
  bad.deviation.conservativeResize(3);
  refused(bad, touch);
  TouchProbe with = touch;
  with.radius = 0.0;
  refused(part, with);
  with = touch;
  with.q.resize(2);
  refused(part, with);
  with = touch;
  with.noise = NAN;
  refused(part, with);
  const PartSurface nothing{Eigen::MatrixX3d(0, 3), Eigen::MatrixX3d(0, 3), VectorXd(0)};
  EXPECT_EQ(probe(nothing, chain, machines::perfect(chain), touch).deviation.size(), 0);
}

TEST(Probe, NoiseAndRoundingAreThoseStated) {
  const machines::Chain chain = machines::gantry();
  const PartSurface part = dome(90.0, 20);
  TouchProbe touch = exact_probe(chain);
  touch.noise = 0.5_um;
  touch.resolution = 0.1_um;
  touch.seed = 20250421;
  const PartReadings r = probe(part, chain, machines::perfect(chain), touch);
  const VectorXd left = r.deviation - part.deviation;
  const double sd = std::sqrt(left.squaredNorm() / double(left.size()));
  std::cout << "seed " << touch.seed << ": sd " << sd << " mm, stated " << r.sigma << " mm\n";
  EXPECT_NEAR(sd / r.sigma, 1.0, 4.0 / std::sqrt(2.0 * double(left.size())));
  EXPECT_EQ(r.deviation, probe(part, chain, machines::perfect(chain), touch).deviation);
}

TEST(CoordinateMeasuringMachine, ReadsOnePointACellAsItIs) {
  const PartSurface part = dome(90.0, 40);
  CoordinateMeasuringMachine machine;
  machine.noise = 0.0;
  machine.spacing = 10.0;
  const PartReadings r = measure_coordinates(part, machine);
  EXPECT_GT(r.deviation.size(), 40);
  EXPECT_LT(r.deviation.size(), part.deviation.size() / 4);
  double worst = 0.0;
  for (Index i = 0; i < r.deviation.size(); ++i)
    worst = std::max(worst, std::abs(r.deviation[i] - 3.0_um * std::sin(0.1 * r.points_w(i, 0))));
  EXPECT_LT(worst, 1e-13);
  EXPECT_EQ(r.time_s[1] - r.time_s[0], machine.interval_s);
}

TEST(CoordinateMeasuringMachine, ReadsAPartThatLiesWrongAsTheRigidMotionOfItsNormals) {
  PartSurface part = dome(90.0, 30);
  CoordinateMeasuringMachine machine;
  machine.noise = 0.0;
  kinematics::Deviation D;
  D << 5.0_um, -3.0_um, 2.0_um, 40.0_urad, -30.0_urad, 20.0_urad;
  machine.alignment = D;
  const PartReadings r = measure_coordinates(part, machine);
  const Vector3d middle = r.points_w.colwise().mean();
  double worst = 0.0;
  for (Index i = 0; i < r.deviation.size(); ++i) {
    const Vector3d p = r.points_w.row(i), n = r.normals_w.row(i);
    const double expected = 3.0_um * std::sin(0.1 * p.x()) + n.dot(D.head<3>()) +
                            n.dot(Vector3d(D.tail<3>()).cross(p - middle));
    worst = std::max(worst, std::abs(r.deviation[i] - expected));
  }
  std::cout << "first order holds to " << worst << " mm\n";
  EXPECT_LT(worst, 2e-6);
}

TEST(CoordinateMeasuringMachine, BestFitTakesTheLieOutAgain) {
  PartSurface plane;
  const int side = 21;
  plane.points_w.resize(side * side, 3);
  plane.normals_w.resize(side * side, 3);
  plane.deviation.resize(side * side);
  for (int i = 0; i < side * side; ++i) {
    plane.points_w.row(i) << 5.0 * (i % side), 5.0 * (i / side), 20.0;
    plane.normals_w.row(i) << 0, 0, 1;
    plane.deviation[i] = 2.0_um * ((i % side + i / side) % 2 ? 1.0 : -1.0);
  }
  CoordinateMeasuringMachine machine;
  machine.noise = 0.0;
  machine.spacing = 5.0;
  machine.alignment_sigma = 0.5;
  machine.alignment_sigma_rad = 2e-3;
  machine.best_fit = true;
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    machine.seed = seed;
    const PartReadings r = measure_coordinates(plane, machine);
    ASSERT_EQ(r.deviation.size(), side * side);
    // A chequerboard of odd sides has its own mean and no slope.
    const double mean = plane.deviation.mean();
    double worst = 0.0;
    for (Index i = 0; i < r.deviation.size(); ++i) {
      const int column = int(std::lround(r.points_w(i, 0) / 5.0)),
                row = int(std::lround(r.points_w(i, 1) / 5.0));
      worst = std::max(
          worst, std::abs(r.deviation[i] - (2.0_um * ((column + row) % 2 ? 1.0 : -1.0) - mean)));
    }
    std::cout << "seed " << seed << ": left " << worst << " mm\n";
    EXPECT_LT(worst, 1e-8);
  }
}

TEST(CoordinateMeasuringMachine, BothSidesOfAThinWallAreRead) {
  PartSurface wall;
  wall.points_w.resize(2, 3);
  wall.normals_w.resize(2, 3);
  wall.points_w << 0, 0, 0, 0, 1, 0;
  wall.normals_w << 0, -1, 0, 0, 1, 0;
  wall.deviation = Vector2d(1.0_um, 2.0_um);
  CoordinateMeasuringMachine machine;
  EXPECT_EQ(measure_coordinates(wall, machine).deviation.size(), 2);
  wall.deviation[0] = NAN;
  EXPECT_EQ(measure_coordinates(wall, machine).deviation.size(), 1);
  machine.spacing = 0.0;
  EXPECT_THROW(measure_coordinates(wall, machine), std::invalid_argument);
}
