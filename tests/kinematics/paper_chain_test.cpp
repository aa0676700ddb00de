#include "tests/oracles/paper_chain.h"
#include "kinematics/chain.h"
#include "tests/kinematics/machines.h"
#include "tests/test.h"

// The second chain knows the papers' body order only and takes rotations axis by axis; it is
// independent of ours but for Eigen's matrix products. Its linearised form is not rigid: it is the
// papers' own approximation and is trusted to second order only.
namespace abbe::kinematics {
namespace {

using oracles::SixErrors;

class Any {
 public:
  explicit Any(unsigned seed) : random_(seed) {}
  double operator()(double size) { return size * unit_(random_); }
  Vector3d point(double size) { return {(*this)(size), (*this)(size), (*this)(size)}; }
  SixErrors six(double mm, double rad) {
    return {(*this)(mm), (*this)(mm), (*this)(mm), (*this)(rad), (*this)(rad), (*this)(rad)};
  }

 private:
  std::mt19937 random_;
  std::uniform_real_distribution<double> unit_{-1, 1};
};

Deviation deviation(const SixErrors& e) {
  Deviation D;
  D << e.dx, e.dy, e.dz, e.alpha, e.beta, e.gamma;
  return D;
}

double angles(const SixErrors& e) { return Vector3d(e.alpha, e.beta, e.gamma).norm(); }

oracles::Gantry any_gantry(Any& any, double mm, double rad) {
  oracles::Gantry g;
  for (SixErrors* six : {&g.x, &g.y, &g.z, &g.a, &g.c, &g.spindle}) *six = any.six(mm, rad);
  g.spindle.gamma = 0;
  for (double* angle :
       {&g.gamma_xy, &g.beta_xz, &g.alpha_yz, &g.beta_a, &g.gamma_a, &g.alpha_c, &g.beta_c})
    *angle = any(rad);
  for (double* offset : {&g.dy_a, &g.dz_a, &g.dx_c, &g.dy_c}) *offset = any(mm);
  return g;
}

oracles::GantryPlaces any_places(Any& any) {
  oracles::GantryPlaces places;
  for (Vector3d* place : {&places.c, &places.x, &places.y, &places.z, &places.a, &places.spindle,
                          &places.workpiece, &places.tool})
    *place = any.point(400);
  return places;
}

// The same gantry, the deviations under their ISO 230-1 names.
Chain our_gantry(const oracles::GantryPlaces& places, DeviationAxes axes) {
  using machines::placed;
  const Chain chain(
      {machines::turn('C', Side::Workpiece, machines::z, places.c),
       machines::slide('X', Side::Tool, machines::x, places.x),
       machines::slide('Y', Side::Tool, machines::y, places.y),
       machines::slide('Z', Side::Tool, machines::z, places.z),
       machines::turn('A', Side::Tool, machines::x, places.a), machines::nose(places.spindle)},
      placed(places.workpiece), placed(places.tool));
  return machines::with_options(chain, axes, Squareness::Frame);
}

std::vector<JointDeviation> our_deviations(const oracles::Gantry& g) {
  std::vector<JointDeviation> d(6);
  d[0].motion = deviation(g.c);                                // EXC .. ECC
  d[0].location << g.dx_c, g.dy_c, 0, g.alpha_c, g.beta_c, 0;  // EX0C EY0C EA0C EB0C
  d[1].motion = deviation(g.x);                                // EXX .. ECX
  d[2].motion = deviation(g.y);                                // EXY .. ECY
  d[2].location << 0, 0, 0, 0, 0, g.gamma_xy;                  // EC0Y
  d[3].motion = deviation(g.z);                                // EXZ .. ECZ
  d[3].location << 0, 0, 0, g.alpha_yz, g.beta_xz, 0;          // EA0Z EB0Z
  d[4].motion = deviation(g.a);                                // EXA .. ECA
  d[4].location << 0, g.dy_a, g.dz_a, 0, g.beta_a, g.gamma_a;  // EY0A EZ0A EB0A EC0A
  d[5].motion = deviation(g.spindle);                          // EXS EYS EZS EAS EBS
  return d;
}

struct Difference {
  double mm = 0;
  double rad = 0;
};

Difference difference(const Pose& a, const Eigen::Matrix4d& b) {
  const Matrix3d turned = a.linear().transpose() * b.topLeftCorner<3, 3>();
  return {(a.translation() - b.topRightCorner<3, 1>()).norm(), rotation_vector(turned).norm()};
}

TEST(PaperChain, EqualsOursOnTheGantryInFixedAndTurningAxes) {
  const unsigned seed = 20250313;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  for (const bool turning : {false, true})
    for (const double rad : {0.0, 50e-6, 0.05, 1.0}) {
      Any any(seed);
      Difference worst;
      for (int i = 0; i < 2000; ++i) {
        const oracles::Gantry g = any_gantry(any, 0.02, rad);
        const oracles::GantryPlaces places = any_places(any);
        AxisVector q(6);
        q << any(pi), any(500), any(500), any(500), any(pi), any(pi);
        const Chain chain =
            our_gantry(places, turning ? DeviationAxes::Turning : DeviationAxes::Fixed);
        const oracles::GantryForm form{oracles::Angles::Exact, turning};
        const Eigen::Matrix4d second =
            oracles::gantry_tool_in_workpiece(g, places, {-q[0], q[1], q[2], q[3], q[4]}, form);
        const Difference d = difference(chain.tool_in_workpiece(q, our_deviations(g)), second);
        worst = {std::max(worst.mm, d.mm), std::max(worst.rad, d.rad)};
      }
      std::cout << (turning ? "turning" : "fixed") << ", angles to " << rad
                << " rad: chains differ by " << worst.mm << " mm, " << worst.rad << " rad\n";
      EXPECT_LE(worst.mm, 1e-9);
      EXPECT_LE(worst.rad, 1e-12);
    }
}

TEST(PaperChain, LinearisedAsThePaperPrintsItIsOursToSecondOrder) {
  // 50 urad, 0.02 mm: sum of 17 angles at most 1.5e-3 rad, levers to 3 m
  const unsigned seed = 20250314;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  double last = 0;
  for (const double scale : {4.0, 2.0, 1.0}) {
    Any any(seed);
    double worst = 0;
    for (int i = 0; i < 2000; ++i) {
      const oracles::Gantry g = any_gantry(any, 0.02 * scale, 50e-6 * scale);
      const oracles::GantryPlaces places = any_places(any);
      AxisVector q(6);
      q << any(pi), any(500), any(500), any(500), any(pi), 0;
      const Eigen::Matrix4d second = oracles::gantry_tool_in_workpiece(
          g, places, {-q[0], q[1], q[2], q[3], q[4]}, {oracles::Angles::Linearised, true});
      const Chain chain = our_gantry(places, DeviationAxes::Turning);
      const Pose ours = chain.tool_in_workpiece(q, our_deviations(g));
      worst = std::max(worst, (ours.translation() - second.topRightCorner<3, 1>()).norm());
    }
    std::cout << "angles to " << 50 * scale << " urad: " << 1e6 * worst << " nm\n";
    if (last > 0) {
      EXPECT_NEAR(std::log2(last / worst), 2.0, 0.05);
    }
    last = worst;
  }
}

oracles::Platform any_platform(Any& any, double mm, double rad) {
  oracles::Platform p;
  p.x = any.six(mm, rad);
  p.z = any.six(mm, rad);
  p.squareness = any(rad);
  p.x_position = any(100);
  p.z_position = any(100);
  return p;
}

TEST(Platform, FormulasOfPengAreHisLinearisedMatricesMultipliedOut) {
  const unsigned seed = 20250315;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Any any(seed);
  double worst = 0;
  for (int i = 0; i < 20000; ++i) {
    const oracles::Platform p = any_platform(any, 0.02, i % 2 ? 1e-3 : 50e-6);
    const Vector3d p_w = any.point(200);
    const Vector3d p_t = any.point(200);
    const Vector3d product = platform_error(p, p_w, p_t, oracles::Angles::Linearised);
    worst = std::max(worst, (product - platform_formula(p, p_w, p_t)).norm());
  }
  std::cout << "formula minus product: " << worst << " mm\n";
  EXPECT_LE(worst, 1e-9);
}

// Ours, with the frames of his X and Z carriages both in the bed's origin at zero.
Chain our_platform(const Vector3d& p_w_home, const Vector3d& p_t) {
  return Chain({machines::turn('S', Side::Workpiece, machines::x),
                machines::slide('X', Side::Workpiece, machines::x),
                machines::slide('Z', Side::Tool, machines::z)},
               machines::placed(p_w_home), machines::placed(p_t));
}

TEST(Platform, OursIsMinusPengsWithinTheSecondOrder) {
  const unsigned seed = 20250316;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  for (const double rad : {50e-6, 1e-3}) {
    Any any(seed);
    double worst_share = 0;
    double worst_mm = 0;
    double worst_bound = 0;
    for (int i = 0; i < 20000; ++i) {
      oracles::Platform p = any_platform(any, 0.02, rad);
      const Vector3d p_t = any.point(200);
      // the point of the workpiece that the tool should touch, in the X carriage
      const Vector3d p_w = p_t + Vector3d(-p.x_position, 0, p.z_position);
      AxisVector q(3);
      q << 0, -p.x_position, p.z_position;  // his X is the carriage, the primed axis minus it
      const Chain chain = our_platform(Vector3d::Zero(), p_t);
      std::vector<JointDeviation> wrong(3);
      wrong[1].motion = deviation(p.x);
      wrong[2].motion = deviation(p.z);
      wrong[2].location[4] = p.squareness;  // EB0Z
      const Vector3d ours = chain.tool_in_workpiece(q, wrong).translation() -
                            chain.tool_in_workpiece(q).translation();
      const Vector3d e = platform_formula(p, p_w, p_t);
      const double sum = angles(p.x) + angles(p.z) + std::abs(p.squareness);
      const double L = std::max(p_w.norm(), p_t.norm() + std::abs(p.z_position));
      const double bound = sum * sum * L + angles(p.x) * e.norm();
      const double gap = (ours + e).norm();
      ASSERT_LE(gap, bound + 1e-12);
      if (gap / bound > worst_share) worst_share = gap / bound;
      if (gap > worst_mm) worst_mm = gap, worst_bound = bound;
    }
    std::cout << "angles to " << 1e6 * rad << " urad: ours plus his differ by at most "
              << 1e6 * worst_mm << " nm (bound there " << 1e6 * worst_bound << " nm), at most "
              << worst_share << " of the bound\n";
  }
}

TEST(Platform, OursEqualsTheExactMatricesSeenFromTheCarriage) {
  const unsigned seed = 20250317;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Any any(seed);
  double worst = 0;
  for (int i = 0; i < 5000; ++i) {
    const oracles::Platform p = any_platform(any, 0.02, 0.1);
    const Vector3d p_t = any.point(200);
    const Vector3d p_w = p_t + Vector3d(-p.x_position, 0, p.z_position);
    AxisVector q(3);
    q << 0, -p.x_position, p.z_position;
    const Chain chain = our_platform(Vector3d::Zero(), p_t);
    std::vector<JointDeviation> wrong(3);
    wrong[1].motion = deviation(p.x);
    wrong[2].motion = deviation(p.z);
    wrong[2].location[4] = p.squareness;
    const Vector3d ours =
        chain.tool_in_workpiece(q, wrong).translation() - chain.tool_in_workpiece(q).translation();
    // his E stands in the bed; the carriage that sees it has turned by its own angles
    const Matrix3d R_bX = chain.workpiece_in_bed(q, wrong).linear();
    const Vector3d E = platform_error(p, p_w, p_t, oracles::Angles::Exact);
    worst = std::max(worst, (ours + R_bX.transpose() * E).norm());
  }
  std::cout << "largest difference: " << worst << " mm\n";
  EXPECT_LE(worst, 1e-9);
}

TEST(Platform, BodiesAreInPengsOrder) {
  const BodyArray array = low_order_body_array(parse_structural_code("w S' X' b Z s t"));
  EXPECT_EQ(array.parent, (std::vector<int>{0, 1, 2, 0, 4, 5}));
}

}  // namespace
}  // namespace abbe::kinematics
