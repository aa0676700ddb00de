#include "kinematics/pose.h"
#include "tests/test.h"

namespace abbe::kinematics::screw_tests {
namespace {

constexpr double pi = std::numbers::pi;

double apart(const Pose& a, const Pose& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

Pose pose(const Vector3d& turn, const Vector3d& at) {
  Pose T(rotation(turn));
  T.pretranslate(at);
  return T;
}

TEST(Screw, LeadsFromOnePoseToTheOther) {
  std::mt19937 random(17);
  std::normal_distribution<double> any;
  const auto vector = [&] { return Vector3d(any(random), any(random), any(random)); };
  double worst = 0.0;
  for (const double angle : {0.0, 1e-300, 1e-12, 1e-9, 1e-6, 1e-3, 9.999e-3, 0.01, 0.010001, 0.5,
                             pi / 2, 3.0, pi - 1e-6, pi - 1e-12, pi})
    for (int n = 0; n < 50; ++n) {
      const Pose from = pose(vector(), 500 * vector());
      const Pose to = from * pose(angle * vector().normalized(), 500 * vector());
      const Screw screw = screw_between(from, to);
      EXPECT_EQ(apart(pose_at(screw, 0.0), from), 0.0);
      worst = std::max(worst, apart(pose_at(screw, 1.0), to));
      // a constant rate: two halves are the whole, and so is the way back
      const Screw half = screw_between(from, pose_at(screw, 0.5));
      worst = std::max(worst, apart(pose_at(half, 2.0), to));
    }
  std::cout << "ends within " << worst << " mm of poses 1 m away\n";
  EXPECT_LT(worst, 1e-11);
}

TEST(Screw, OfOneJointIsItsMotion) {
  const Vector3d axis = Vector3d(1, -2, 0.5).normalized(), point(300, -200, 100);
  const auto turned = [&](double angle) {
    return Pose(Eigen::Translation3d(point) * Eigen::AngleAxisd(angle, axis) *
                Eigen::Translation3d(-point) * Eigen::Translation3d(10, 20, 30));
  };
  for (const double end : {1e-9, 1e-3, 0.3, 3.1}) {
    const Screw screw = screw_between(turned(0.0), turned(end));
    for (const double u : {0.1, 0.25, 0.5, 0.9})
      EXPECT_LT(apart(pose_at(screw, u), turned(u * end)), 1e-12) << end;
  }
  const Screw slide = screw_between(Pose::Identity(), pose(Vector3d::Zero(), Vector3d(1, 2, 3)));
  EXPECT_EQ(apart(pose_at(slide, 0.25), pose(Vector3d::Zero(), Vector3d(0.25, 0.5, 0.75))), 0.0);
}

TEST(Screw, NoPointIsFasterThanTheFastest) {
  std::mt19937 random(18);
  std::normal_distribution<double> any;
  const auto vector = [&] { return Vector3d(any(random), any(random), any(random)); };
  double nearest = 0.0;
  for (int n = 0; n < 2000; ++n) {
    const Screw screw =
        screw_between(pose(vector(), 100 * vector()), pose(vector(), 100 * vector()));
    const Vector3d centre = 50 * vector();
    const double radius = 20.0, bound = max_speed(screw, centre, radius);
    const Vector3d point = centre + radius * vector().normalized();
    for (const double u : {0.0, 0.4, 1.0}) {
      constexpr double h = 1e-5;
      const double speed =
          (pose_at(screw, u + h) * point - pose_at(screw, u - h) * point).norm() / (2 * h);
      EXPECT_LE(speed, bound * (1 + 1e-7));
      nearest = std::max(nearest, speed / bound);
    }
  }
  std::cout << "speeds up to " << nearest << " of the bound\n";
  EXPECT_GT(nearest, 0.95);
}

}  // namespace
}  // namespace abbe::kinematics::screw_tests
