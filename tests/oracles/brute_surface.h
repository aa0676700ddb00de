#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

/// Machined surfaces by brute force, in long double, from the definition of a sweep alone: no
/// closest approach, no derivative of the motion, no azimuths. A stretch of motion is enclosed by
/// one pose in its middle of a tool made thicker by the farthest that any of its points moves in
/// that stretch; the entry of the ray into that tool is never later than into the sweep. Stretches
/// are halved, the earliest first, until nothing is earlier than a tool really on the way by more
/// than the tolerance. So the result comes with a bound that is proved, not estimated: the surface
/// lies in [s - bound, s].
namespace abbe::oracles {

struct Ray {
  Eigen::Vector3d origin;     ///< mm
  Eigen::Vector3d direction;  ///< unit
};

struct BruteOptions {
  double band = 2.0;           ///< mm, the ray is searched from -band to +band
  double tolerance = 1e-8;     ///< mm, wanted bound
  std::size_t most = 4000000;  ///< stretches looked at before the bound is reported as it is
};

struct BruteHit {
  bool cut = false;             ///< something was removed within the band
  bool begins_removed = false;  ///< the ray's start at -band is removed already
  double s = 0.0;               ///< mm, a place on the ray that is removed; meaningless if not cut
  double bound = 0.0;   ///< mm, the first such place lies in [s - bound, s]; if not cut, how
                        ///< near the search came to ruling all of the band out (0: ruled out)
  double time_s = 0.0;  ///< an instant at which s is removed
  std::size_t looked_at = 0;
};

/// A milling cutter of revolution: flat, torus corner, cylinder; no more than three numbers, mm.
struct BruteCutter {
  double radius, corner_radius, flank_length;
};
/// A convex cutter of revolution by its radius over its height: from a flat bottom at height 0 and
/// `bottom` mm across through points, each reached by a line or an arc that bulges outwards, to a
/// flat top.
struct BruteForm {
  struct Point {
    double x, z;          ///< mm, rising
    double radius = 0.0;  ///< mm, of an arc
  };
  double bottom;
  std::vector<Point> points;
};
/// One of the convex layers of which a hollow cutter is made up.
struct BruteLayer {
  double base;  ///< mm above the tip, of its bottom
  BruteForm form;
};
struct BrutePose {
  Eigen::Vector3d tip;   ///< mm
  Eigen::Vector3d axis;  ///< unit
  double time_s;
};
/// Tip on lines, axis on great circles between the poses. Axes may not be opposite.
BruteHit brute_milled(const Ray& ray, const BruteCutter& cutter,
                      const std::vector<BrutePose>& motion, const BruteOptions& options = {});
BruteHit brute_milled(const Ray& ray, const BruteForm& form, const std::vector<BrutePose>& motion,
                      const BruteOptions& options = {});
/// Of layers on one axis.
BruteHit brute_milled(const Ray& ray, const std::vector<BruteLayer>& layers,
                      const std::vector<BrutePose>& motion, const BruteOptions& options = {});

/// A disc of `radius` about the origin of its frame in y = 0, whose slow pose moves on lines and at
/// constant rates of turn, turned by a spindle about a line. Of the disc is left what lies below
/// every side, normal . (x, z) <= reach.
struct BruteTurning {
  struct Side {
    Eigen::Vector2d normal;  ///< unit, of (x, z)
    double reach;            ///< mm
  };
  struct Pose {
    Eigen::Matrix3d R;
    Eigen::Vector3d centre;  ///< mm
    double spindle;          ///< rad
    double time_s;
  };
  double radius;
  std::vector<Pose> poses;
  Eigen::Vector3d spindle_point;
  Eigen::Vector3d spindle_direction;
  std::vector<Side> sides = {};
  Eigen::Vector2d middle = {0, 0};  ///< mm, (x, z) of the disc
};
BruteHit brute_turned(const Ray& ray, const BruteTurning& turning,
                      const BruteOptions& options = {});

}  // namespace abbe::oracles
