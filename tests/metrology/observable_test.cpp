#include "errors/metrology/instrument.h"
#include "errors/metrology/readings.h"
#include "kinematics/decompositions.h"
#include "tests/metrology/machines.h"
#include "tests/test.h"

using namespace abbe;
using namespace abbe::errors::metrology;
using kinematics::AxisState;
using kinematics::Deviation;
using kinematics::Pose;

namespace {

namespace metrology = abbe::errors::metrology;
namespace machines = metrology::machines;

/// An instrument without noise, rounding, misalignment or drift.
Instrument exact(Kind kind) {
  Instrument i;
  i.kind = kind;
  i.name = to_string(kind);
  i.dwell_s = 0.0;
  return i;
}

/// Everything random, from one seed.
struct Draw {
  std::mt19937 random;
  std::uniform_real_distribution<double> unit{-1.0, 1.0};
  explicit Draw(unsigned seed) : random(seed) {}
  double number(double size) { return size * unit(random); }
  Vector3d vector(double size) { return {number(size), number(size), number(size)}; }
  Vector3d direction() {
    Vector3d v;
    do v = vector(1.0);
    while (v.norm() < 0.1);
    return v.normalized();
  }
  Pose pose(double reach) {
    Pose T = Pose::Identity();
    T.linear() = kinematics::rotation(vector(3.0));
    T.translation() = vector(reach);
    return T;
  }
  BodyPoses bodies(double reach) { return {pose(reach), pose(reach)}; }
  Body body() { return Body(std::uniform_int_distribution<int>(0, 2)(random)); }
};

/// A random channel between two different bodies; a mirror faces its beam within 60 degrees.
Channel any_channel(Draw& draw, Quantity quantity, const BodyPoses& bodies) {
  Channel c;
  c.quantity = quantity;
  do {
    c.of = draw.body();
    c.in = draw.body();
  } while (c.of == c.in);
  c.point_of = draw.vector(300.0);
  c.point_in = draw.vector(300.0);
  c.direction_in = draw.direction();
  const auto R_b = [&](Body body) -> Matrix3d {
    if (body == Body::Bed) return Matrix3d::Identity();
    return (body == Body::Tool ? bodies.T_bt : bodies.T_bw).linear();
  };
  do c.normal_of = draw.direction();
  while ((R_b(c.of) * c.normal_of).dot(R_b(c.in) * c.direction_in) < 0.5);
  return c;
}

constexpr Quantity quantities[] = {Quantity::Length, Quantity::Displacement, Quantity::Mirror,
                                   Quantity::Angle};

SetUp alone(const Channel& channel) {
  SetUp s;
  s.channels = {channel};
  return s;
}

Pose pushed(const Pose& T, const Deviation& D) {
  return kinematics::motion(D, Vector3d::Zero()) * T;
}

double change(const std::function<double(double)>& f, double step) {
  return (f(step) - f(-step)) / (2.0 * step);
}

}  // namespace

// ---- closed forms

TEST(Observable, BallBarReadsSquarenessAsAnEllipseOfWidthRadiusTimesAngle) {
  const double S = 50.0_urad, R = 100.0;
  const machines::Chain chain = machines::three_axis();
  Instrument bar = exact(Kind::BallBar);
  bar.axes = {'X', 'Y'};
  bar.targets = 360;
  bar.radius = R;
  const auto machine = machines::wrong(chain, [&](const AxisState&) {
    auto d = machines::none(chain);
    d[0].location[5] = S;  // Y' carries X': what turns X turns nothing else
    return d;
  });
  const Readings r = measure(plan(bar, chain), chain, machine, 1);
  MatrixXd A(r.value.size(), 3);
  for (Index i = 0; i < r.value.size(); ++i) {
    const double angle = 2.0 * pi * r.plan.measurements[std::size_t(i)].target / 360.0;
    A.row(i) << 1.0, std::cos(angle), std::sin(angle);
  }
  const VectorXd left = r.value - A * least_squares(A, r.value).x;
  const double form = left.maxCoeff() - left.minCoeff();
  std::cout << "LSC form " << form << " mm, R|S| = " << R * S << "\n";
  EXPECT_NEAR(form, R * S, 1e-6);  // second order: S^2 R = 2.5e-7, and a target every degree
}

TEST(Observable, AnglesReadThroughAnArmAsAbbeSays) {
  const double theta = 100.0_urad, h = 200.0;
  const machines::Chain chain = machines::gantry();
  const Pose T_bt = chain.tool_in_bed(VectorXd::Zero(chain.size()));
  Channel laser;
  laser.point_of = {0, 0, -h};
  laser.point_in = {0, 0, T_bt.translation().z() - h};
  const BodyPoses ideal{Pose::Identity(), T_bt};
  BodyPoses actual = ideal;
  Deviation turn = Deviation::Zero();
  turn[4] = theta;
  actual.T_bt = kinematics::motion(turn, T_bt.translation()) * T_bt;
  const double read = reading(alone(laser), 0, {}, actual, ideal);
  EXPECT_NEAR(read, -h * std::sin(theta), 1e-13);
}

TEST(Observable, BeamThatIsTurnedReadsShortByTheCosine) {
  const double L = 500.0, theta = 1e-4;
  Channel laser;
  BodyPoses bodies;
  bodies.T_bt = Pose(Eigen::Translation3d(L, 0, 0));
  Misalignment m;
  m.rotation = {0, 0, theta};
  const double lost = L - reading(alone(laser), 0, m, bodies, bodies);
  std::cout << "cosine error " << lost << " mm, L theta^2 / 2 = " << 0.5 * L * theta * theta
            << "\n";
  EXPECT_NEAR(lost, L * (1.0 - std::cos(theta)), 2e-13);
}

TEST(Observable, CentreOffsetOfATableIsACircleOfItsLengthOnTheRTest) {
  const Vector3d d(20.0_um, -10.0_um, 0.0);
  const machines::Chain chain = machines::gantry();
  Instrument nest = exact(Kind::RTest);
  nest.axes = {'C'};
  nest.targets = 36;
  const auto machine = machines::wrong(chain, [&](const AxisState&) {
    auto e = machines::none(chain);
    e[0].location.head<3>() = d;
    return e;
  });
  const Plan p = plan(nest, chain);
  const Readings r = measure(p, chain, machine, 1);
  double most = 0.0, radius_least = 1.0, radius_most = 0.0;
  for (std::size_t i = 0; i < p.measurements.size(); i += 3) {
    const Vector3d read = r.value.segment<3>(Index(i));
    most = std::max(most, read.norm());
    const double radius = (read - d).norm();  // zeroed at C = 0, so that the centre is at d
    radius_least = std::min(radius_least, radius);
    radius_most = std::max(radius_most, radius);
  }
  std::cout << "radius " << radius_least << " to " << radius_most << ", |d| = " << d.norm()
            << "; furthest " << most << "\n";
  EXPECT_NEAR(radius_least, d.norm(), 1e-12);
  EXPECT_NEAR(radius_most, d.norm(), 1e-12);
  EXPECT_NEAR(most, 2.0 * d.norm(), 1e-12);
}

TEST(Observable, MirrorThatLeansReadsWhereTheBeamMeetsIt) {
  const double theta = 1e-3, h = 30.0, L = 400.0;
  Channel laser;
  laser.quantity = Quantity::Mirror;
  BodyPoses bodies;
  bodies.T_bt = Pose(Eigen::Translation3d(L, h, 0));
  Misalignment m;
  m.normal = {0, 0, theta};
  // The plane through (L, h) with normal (cos, sin) meets the line y = 0 at L + h tan theta.
  EXPECT_NEAR(reading(alone(laser), 0, m, bodies, bodies), L + h * std::tan(theta), 2e-13);
}

TEST(Observable, StepDiagonalAddsUpToTheBodyDiagonalForErrorsOfTranslation) {
  const machines::Chain chain = machines::trunnion();
  const auto machine = machines::wrong(chain, [&](const AxisState& state) {
    auto d = machines::none(chain);
    for (const int j : {2, 3, 4})
      for (int k = 0; k < 3; ++k)
        d[std::size_t(j)].motion[k] = 5.0_um * std::sin(0.01 * (j + k) * state.q[j] + k);
    return d;
  });
  Instrument steps = exact(Kind::StepDiagonal);
  steps.targets = 5;
  Instrument whole = exact(Kind::Diagonals);
  whole.bidirectional = false;
  const Readings a = measure(plan(steps, chain), chain, machine, 1);
  const Readings b = measure(plan(whole, chain), chain, machine, 1);
  double worst = 0.0;
  for (int diagonal = 0; diagonal < 4; ++diagonal) {
    const auto rise = [&](const Readings& r) {
      double first = NAN, last = NAN;
      for (std::size_t i = 0; i < r.plan.measurements.size(); ++i) {
        if (r.plan.measurements[i].set_up != diagonal) continue;
        if (std::isnan(first)) first = r.value[Index(i)];
        last = r.value[Index(i)];
      }
      return last - first;
    };
    worst = std::max(worst, std::abs(rise(a) - rise(b)));
  }
  std::cout << "sum of steps against the diagonal: " << worst << " mm\n";
  EXPECT_LT(worst, 1e-12);
}

TEST(Observable, LevelFeelsNoTurnAboutThePlumbLineAndRollLinesDo) {
  const machines::Chain chain = machines::gantry();
  const double roll = 30.0_urad;
  const auto turning = [&](int axis, int component) {
    return machines::wrong(chain, [&chain, axis, component, roll](const AxisState& state) {
      auto d = machines::none(chain);
      d[std::size_t(axis)].motion[component] = roll * state.q[axis] / 100.0;
      return d;
    });
  };
  const auto span = [&](Kind kind, char axis, const MachineUnderTest& machine) {
    Instrument i = exact(kind);
    i.axes = {axis};
    const Readings r = measure(plan(i, chain), chain, machine, 1);
    VectorXd spans(2);
    for (int channel = 0; channel < 2; ++channel) {
      double low = INFINITY, high = -INFINITY;
      for (std::size_t k = 0; k < r.plan.measurements.size(); ++k) {
        if (r.plan.measurements[k].channel != channel) continue;
        low = std::min(low, r.value[Index(k)]);
        high = std::max(high, r.value[Index(k)]);
      }
      spans[channel] = high - low;
    }
    return spans;
  };
  // X rolls about X, which is level; Z rolls about Z, which is plumb.
  const double travel_X = 0.96 * 600.0, travel_Z = 0.96 * 400.0;
  EXPECT_NEAR(span(Kind::Level, 'X', turning(1, 3))[0], roll * travel_X / 100.0, 1e-12);
  EXPECT_LT(span(Kind::Level, 'Z', turning(3, 5)).maxCoeff(), 1e-15);
  const VectorXd lines = span(Kind::RollLines, 'Z', turning(3, 5));
  // Each of the two lines, 100 mm to either side, moves by half the lever times the roll.
  EXPECT_NEAR(lines[0], 100.0 * roll * travel_Z / 100.0, 1e-10);
  EXPECT_NEAR(lines[1], lines[0], 1e-10);
}

// ---- the bounds of the header

namespace {

using Long = long double;
using Long3 = Eigen::Matrix<Long, 3, 1>;

/// The same reading in extended precision from the same poses, misalignments left out.
Long extended(const Channel& c, const BodyPoses& bodies) {
  const auto R = [&](Body b) {
    const Pose T = b == Body::Bed ? Pose::Identity() : b == Body::Tool ? bodies.T_bt : bodies.T_bw;
    return Eigen::Matrix<Long, 3, 4>(T.matrix().topRows<3>().cast<Long>());
  };
  const auto of = R(c.of), in = R(c.in);
  const Long3 p_b = of.leftCols<3>() * c.point_of.cast<Long>() + of.col(3);
  const Long3 apart = in.leftCols<3>().transpose() * (p_b - in.col(3)) - c.point_in.cast<Long>();
  if (c.quantity == Quantity::Length) return apart.norm();
  const Long3 u = c.direction_in.cast<Long>();
  if (c.quantity == Quantity::Displacement) return u.dot(apart);
  const Long3 n = in.leftCols<3>().transpose() * (of.leftCols<3>() * c.normal_of.cast<Long>());
  return n.dot(apart) / n.dot(u);
}

}  // namespace

TEST(Observable, ReadingsKeepTheirBoundAgainstExtendedPrecision) {
  const unsigned seed = 20250401;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Draw draw(seed);
  double worst = 0.0, worst_ulp = 0.0;
  for (int i = 0; i < 60000; ++i) {
    const double reach = std::pow(10.0, i % 4);  // 1 mm to 1 m
    const BodyPoses bodies = draw.bodies(reach);
    const Channel c = any_channel(draw, quantities[i % 3], bodies);
    const Long read = reading(alone(c), 0, {}, bodies, bodies);
    const double off = double(std::abs(read - extended(c, bodies)));
    const double sum = bodies.T_bw.translation().norm() + bodies.T_bt.translation().norm() +
                       c.point_of.norm() + c.point_in.norm();
    const double facing = c.quantity == Quantity::Mirror ? 0.5 : 1.0;
    worst = std::max(worst, off);
    worst_ulp = std::max(worst_ulp, off * facing / (sum * 2.220446049250313e-16));
  }
  std::cout << "largest difference " << worst << " mm, " << worst_ulp
            << " ulp of the summed distances\n";
  EXPECT_LT(worst_ulp, 2.0);
}

TEST(Observable, AnglesKeepTheirBound) {
  const unsigned seed = 20250402;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Draw draw(seed);
  double worst = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const BodyPoses ideal = draw.bodies(500.0);
    BodyPoses actual = ideal;
    const double size = std::pow(10.0, -12.0 + 0.5 * (i % 20));  // 1e-12 to 3e-3
    const Vector3d turn = draw.direction() * size;
    Channel c;
    c.quantity = Quantity::Angle;
    c.direction_in = draw.direction();
    // Turned in the frame of the workpiece, so that the rotation vector is `turn` itself.
    const Pose T_wt = ideal.T_bw.inverse() * ideal.T_bt;
    Pose turned = T_wt;
    turned.linear() = kinematics::rotation(turn) * T_wt.linear();
    actual.T_bt = ideal.T_bw * turned;
    worst = std::max(worst,
                     std::abs(reading(alone(c), 0, {}, actual, ideal) - c.direction_in.dot(turn)));
  }
  std::cout << "largest difference " << worst << " rad\n";
  EXPECT_LT(worst, 1e-15);
}

// ---- derivatives

TEST(Observable, GradientIsThatOfTheReading) {
  const unsigned seed = 20250403;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Draw draw(seed);
  double worst = 0.0;
  for (int i = 0; i < 4000; ++i) {
    const BodyPoses bodies = draw.bodies(500.0);
    const Channel c = any_channel(draw, quantities[i % 4], bodies);
    const ReadingGradient g = gradient(c, bodies);
    for (int k = 0; k < 6; ++k) {
      const double step = k < 3 ? 1e-2 : 1e-5;
      const auto read = [&](Body which, double s) {
        Deviation D = Deviation::Zero();
        D[k] = s;
        BodyPoses moved = bodies;
        Pose& T = which == Body::Tool ? moved.T_bt : moved.T_bw;
        T = pushed(T, D);
        return reading(alone(c), 0, {}, moved, bodies);
      };
      // Sizes of up to 1000 mm a radian are compared as parts of that.
      const double scale = k < 3 || c.is_angle() ? 1.0 : 1000.0;
      for (const Body which : {Body::Tool, Body::Workpiece}) {
        const double by_hand = change([&](double s) { return read(which, s); }, step);
        const double reported = (which == Body::Tool ? g.tool : g.workpiece)[k];
        worst = std::max(worst, std::abs(by_hand - reported) / scale);
        ASSERT_NEAR(by_hand / scale, reported / scale, 2e-7) << "quantity " << i % 4 << " of " << k;
      }
    }
  }
  std::cout << "largest difference " << worst << " (mm/mm, or m/rad)\n";
}

TEST(Observable, GradientOfUnknownsIsThatOfTheReading) {
  const unsigned seed = 20250404;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Draw draw(seed);
  double worst = 0.0;
  for (int i = 0; i < 4000; ++i) {
    const BodyPoses bodies = draw.bodies(500.0);
    metrology::SetUp s = alone(any_channel(draw, quantities[i % 4], bodies));
    s.channels.push_back(s.channels[0]);
    s.channels[1].direction_in = draw.direction();
    s.rotation_sigma = s.point_of_sigma = s.point_in_sigma = s.normal_sigma = 1.0;
    s.eccentricity_sigma = s.scale_sigma = s.drift_sigma = 1.0;
    const int channel = 0;
    const double angle = draw.number(4.0), since = 10.0;
    const VectorXd g = unknowns_gradient(s, channel, bodies, angle, since);
    const std::vector<SetUpUnknown> list = unknowns(s);
    ASSERT_EQ(g.size(), Index(list.size()));
    ASSERT_EQ(g.size(), 2 + 3 + 3 + 3 + 2 + 2 + 1 + 1);
    for (Index k = 0; k < g.size(); ++k) {
      const bool turns = list[std::size_t(k)].name.find("turn") != std::string::npos ||
                         list[std::size_t(k)].name.find("rotation") != std::string::npos ||
                         list[std::size_t(k)].name == "scale";
      const double by_hand = change(
          [&](double step) {
            VectorXd v = VectorXd::Zero(g.size());
            v[k] = step;
            return reading(s, channel, misalignment(s, v), bodies, bodies, angle, since);
          },
          turns ? 1e-5 : 1e-2);
      const double scale = turns && !s.channels[0].is_angle() ? 1000.0 : 1.0;
      worst = std::max(worst, std::abs(by_hand - g[k]) / scale);
      ASSERT_NEAR(by_hand / scale, g[k] / scale, 2e-7)
          << "quantity " << i % 4 << ", " << list[std::size_t(k)].name;
    }
  }
  std::cout << "largest difference " << worst << "\n";
}

TEST(Observable, UnknownsComeBackFromAMisalignment) {
  Draw draw(20250405);
  const BodyPoses bodies = draw.bodies(500.0);
  metrology::SetUp s = alone(any_channel(draw, Quantity::Mirror, bodies));
  EXPECT_EQ(values(s, {}).size(), 1);  // a zero alone
  s.is_zero_unknown = false;
  EXPECT_EQ(values(s, {}).size(), 0);
  s.is_zero_unknown = true;
  s.rotation_sigma = s.point_in_sigma = s.normal_sigma = s.eccentricity_sigma = s.drift_sigma =
      1e-3;
  VectorXd v(Index(unknowns(s).size()));
  for (double& x : v) x = draw.number(1.0);
  EXPECT_LT((values(s, misalignment(s, v)) - v).norm(), 1e-15);
  EXPECT_TRUE(std::isinf(unknowns(s)[0].sigma));
  EXPECT_EQ(misalignment(s, v).scale, 0.0);
  EXPECT_LT(std::abs(misalignment(s, v).normal.dot(s.channels[0].normal_of)), 1e-15);
}

TEST(Observable, EccentricBallGoesRoundWithTheSpindle) {
  Channel sensor;
  metrology::SetUp s = alone(sensor);
  s.eccentricity_sigma = 1.0;
  Misalignment m;
  m.eccentricity = {3.0_um, 4.0_um};
  const BodyPoses still;
  for (const double angle : {0.0, 0.5 * pi, pi, 1.0})
    EXPECT_NEAR(reading(s, 0, m, still, still, angle),
                3.0_um * std::cos(angle) - 4.0_um * std::sin(angle), 1e-17);
}

TEST(Observable, TrackerReadsThreeComponentsOfTheErrorAtEveryPlace) {
  const machines::Chain chain = machines::gantry();
  const Vector3d d(7.0_um, -4.0_um, 9.0_um);
  const auto machine = machines::wrong(chain, [&](const AxisState& state) {
    auto e = machines::none(chain);
    e[1].motion.head<3>() = d * (1.0 + state.q[1] / 300.0);
    return e;
  });
  Instrument i = exact(Kind::Tracker);
  i.targets = 3;
  i.bidirectional = false;
  const Plan p = plan(i, chain);
  const Readings r = measure(p, chain, machine, 1);
  double worst = 0.0;
  for (std::size_t k = 0; k < p.measurements.size(); k += 3) {
    Vector3d error = Vector3d::Zero();
    const AxisState& state = p.measurements[k].state;
    const BodyPoses ideal = nominal_bodies(chain, state.q);
    for (std::size_t j = k; j < k + 3; ++j) {
      const Channel& c = p.set_ups[0].channels[std::size_t(p.measurements[j].channel)];
      const Vector3d beam = (ideal.T_bw.inverse() * ideal.T_bt).translation() - c.point_in;
      const Vector3d u = c.quantity == Quantity::Length ? beam.normalized() : c.direction_in;
      error += u * (r.value[Index(j)] -
                    reading(p.set_ups[0], p.measurements[j].channel, {}, ideal, ideal));
    }
    worst = std::max(worst, (error - d * (1.0 + state.q[1] / 300.0)).norm());
  }
  std::cout << "largest difference " << worst << " mm\n";
  EXPECT_LT(worst, 1e-6);  // |d|^2 / 2 range
}
