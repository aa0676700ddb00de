#include "errors/metrology/part.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "errors/curve.h"
#include "errors/metrology/plan_builder.h"
#include "errors/metrology/readings.h"
#include "kinematics/decompositions.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Chain;

// A picometre: far below any reading, above the rounding of positions of 1 m.
constexpr double contact = 1e-12;  // mm

[[noreturn]] void refuse(const std::string& sentence) {
  throw std::invalid_argument("reading of a part: " + sentence);
}

void expect(bool holds, const char* what, double seen) {
  if (!holds) refuse(fmt::format("expected {}, seen {}", what, seen));
}

void check(const PartSurface& part) {
  const Index n = part.points_w.rows();
  if (part.normals_w.rows() != n || part.deviation.size() != n)
    refuse(fmt::format("expected as many normals and deviations as points, seen {}, {} and {}",
                       part.normals_w.rows(), part.deviation.size(), n));
  for (Index i = 0; i < n; ++i) {
    if (!part.points_w.row(i).allFinite() || std::isinf(part.deviation[i]))
      refuse(fmt::format("expected finite numbers at point {}", i + 1));
    if (!(std::abs(part.normals_w.row(i).norm() - 1.0) <= 1e-9))
      refuse(fmt::format("expected a unit normal at point {}, seen one of length {}", i + 1,
                         part.normals_w.row(i).norm()));
  }
}

PartReadings blank(const PartSurface& part, const std::vector<Index>& chosen, double noise,
                   double resolution) {
  const Index n = Index(chosen.size());
  PartReadings r{Eigen::MatrixX3d(n, 3), Eigen::MatrixX3d(n, 3), Eigen::VectorXd(n),
                 std::sqrt(noise * noise + resolution * resolution / 12.0), Eigen::VectorXd(n)};
  for (Index i = 0; i < n; ++i) {
    r.points_w.row(i) = part.points_w.row(chosen[std::size_t(i)]);
    r.normals_w.row(i) = part.normals_w.row(chosen[std::size_t(i)]);
  }
  return r;
}

// Touch probe on the machine

void check(const TouchProbe& options, const Chain& nominal) {
  expect(options.radius > 0.0 && std::isfinite(options.radius), "a ball above 0 mm",
         options.radius);
  expect(options.noise >= 0.0 && std::isfinite(options.noise), "a noise of 0 or more",
         options.noise);
  expect(options.resolution >= 0.0 && std::isfinite(options.resolution),
         "a resolution of 0 or more", options.resolution);
  expect(options.clearance > 0.0 && std::isfinite(options.clearance), "a clearance above 0 mm",
         options.clearance);
  expect(options.speed > 0.0 && std::isfinite(options.speed), "a speed above 0", options.speed);
  expect(options.dwell_s >= 0.0 && std::isfinite(options.dwell_s), "a dwell of 0 s or more",
         options.dwell_s);
  expect(std::isfinite(options.start_s), "a finite start", options.start_s);
  expect(options.centre_t.allFinite(), "a finite centre of the ball", options.centre_t.norm());
  expect(options.q.size() == nominal.size(), "a position for each axis", double(options.q.size()));
  expect(options.q.allFinite(), "finite positions of the axes", options.q.norm());
}

/// A machine with its probe; carries its state from touch to touch.
struct ProbingMachine {
  const Chain& nominal;
  const MachineUnderTest& machine;
  const TouchProbe& options;
  AxisState state;

  Instrument ball() const {
    Instrument i;
    i.name = "touch probe";
    i.reflector_t = options.centre_t;
    return i;
  }
  AxisVector at(const Vector3d& centre_w) const {
    const auto q = slides_for_reflector(ball(), nominal, options.q, centre_w);
    if (!q || !within_travel(nominal, *q))
      refuse(fmt::format("expected points within the travel, seen [{:.6g}, {:.6g}, {:.6g}]",
                         centre_w.x(), centre_w.y(), centre_w.z()));
    return *q;
  }
  void go(const AxisVector& q) {
    AxisState next = moved(state, q);
    next.time_s += (q - state.q).norm() / options.speed;
    state = next;
  }
  double touch(const Vector3d& point_w, const Vector3d& normal_w, double deviation);
};

/// Returns the commanded height above the design at which the ball meets the surface.
double ProbingMachine::touch(const Vector3d& point_w, const Vector3d& normal_w, double deviation) {
  const auto centre_w = [&](double height) -> Vector3d {
    return point_w + (options.radius + height) * normal_w;
  };
  go(at(centre_w(options.clearance)));
  const AxisState before = state;
  const double approach_s = options.clearance / options.speed + options.dwell_s;
  double height = 0.0;
  // Each pass corrects the height by the whole gap; errors change by 1e-3 of a motion at most, so a
  // few passes converge, and 60 mark a machine on which they do not.
  for (int k = 0; k < 60; ++k) {
    AxisState there = moved(before, at(centre_w(height)));
    there.time_s = before.time_s + approach_s;
    const Bodies actual = machine(there);
    const Vector3d ball_w = actual.T_bw.inverse() * (actual.T_bt * options.centre_t);
    const double gap = normal_w.dot(ball_w - point_w) - options.radius - deviation;
    height -= gap;
    if (!(std::abs(height) < options.clearance)) break;
    if (std::abs(gap) <= contact) {
      state = there;
      return height;
    }
  }
  refuse(fmt::format("expected contact within {:.6g} mm of [{:.6g}, {:.6g}, {:.6g}], seen none",
                     options.clearance, point_w.x(), point_w.y(), point_w.z()));
}

// Coordinate measuring machine

void check(const CoordinateMachine& options) {
  expect(options.spacing > 0.0 && std::isfinite(options.spacing), "a spacing above 0 mm",
         options.spacing);
  const double not_negative[] = {options.noise, options.resolution, options.alignment_sigma,
                                 options.alignment_sigma_rad, options.interval_s};
  for (const double x : not_negative)
    expect(x >= 0.0 && std::isfinite(x), "noise, resolution, sigmas and interval of 0 or more", x);
  expect(std::isfinite(options.start_s), "a finite start", options.start_s);
  if (options.alignment)
    expect(options.alignment->allFinite(), "a finite alignment", options.alignment->norm());
}

/// Returns the side of the part to which a normal belongs: index of its largest component, plus 3
/// if negative.
int side_of(const Vector3d& normal) {
  int k = 0;
  normal.cwiseAbs().maxCoeff(&k);
  return normal[k] < 0.0 ? k + 3 : k;
}

/// Returns the machined point nearest to the centre of each cell, separately for each side of the
/// part.
std::vector<Index> grid_points(const PartSurface& part, double spacing) {
  Vector3d low = Vector3d::Constant(INFINITY);
  for (Index i = 0; i < part.points_w.rows(); ++i)
    low = low.cwiseMin(part.points_w.row(i).transpose());
  struct Nearest {
    double distance;
    Index point;
  };
  std::map<std::array<double, 4>, Nearest> cells;
  for (Index i = 0; i < part.points_w.rows(); ++i) {
    if (std::isnan(part.deviation[i])) continue;
    const Vector3d cell =
        ((part.points_w.row(i).transpose() - low) / spacing).array().floor().matrix();
    const Vector3d middle = low + spacing * (cell + Vector3d::Constant(0.5));
    const double distance = (part.points_w.row(i).transpose() - middle).norm();
    const auto [place, is_new] =
        cells.try_emplace({double(side_of(part.normals_w.row(i))), cell.z(), cell.y(), cell.x()},
                          Nearest{distance, i});
    if (!is_new && distance < place->second.distance) place->second = {distance, i};
  }
  std::vector<Index> chosen;
  for (const auto& [cell, nearest] : cells) chosen.push_back(nearest.point);
  return chosen;
}

kinematics::Deviation random_alignment(const CoordinateMachine& options) {
  if (options.alignment) return *options.alignment;
  kinematics::Deviation D;
  for (int k = 0; k < 6; ++k)
    D[k] = (k < 3 ? options.alignment_sigma : options.alignment_sigma_rad) *
           normal_deviate(options.seed ^ 0xa119ull, std::uint64_t(k));
  return D;
}

/// Returns the deviations after the rigid motion that minimises their squares. Motions that do not
/// change the deviations (three of six for a plane) are left alone by the minimum-norm step.
Eigen::VectorXd best_fit_deviation(const PartReadings& r, const Vector3d& middle_w) {
  const Index n = r.deviation.size();
  Eigen::MatrixX3d read_w = r.points_w;
  for (Index i = 0; i < n; ++i) read_w.row(i) += r.deviation[i] * r.normals_w.row(i);
  const double size =
      std::max(1.0, (r.points_w.rowwise() - middle_w.transpose()).rowwise().norm().maxCoeff());
  Eigen::VectorXd left = r.deviation;
  for (int pass = 0; pass < 5; ++pass) {  // Gauss-Newton: the error of each pass is the square of
                                          // the previous one
    Eigen::MatrixXd A(n, 6);
    for (Index i = 0; i < n; ++i) {
      const Vector3d normal = r.normals_w.row(i), arm = read_w.row(i).transpose() - middle_w;
      // Angles are scaled by the size of the part, so that the threshold 1e-9 means the same for
      // all six.
      A.row(i) << normal.transpose(), arm.cross(normal).transpose() / size;
    }
    kinematics::Deviation D = -shortest_least_squares(A, left, 1e-9);
    D.tail<3>() /= size;
    const kinematics::Pose back = kinematics::motion(D, middle_w);
    for (Index i = 0; i < n; ++i) {
      read_w.row(i) = (back * Vector3d(read_w.row(i).transpose())).transpose();
      left[i] = r.normals_w.row(i).dot(read_w.row(i) - r.points_w.row(i));
    }
  }
  return left;
}

}  // namespace

PartReadings probe(const PartSurface& part, const Chain& nominal, const MachineUnderTest& machine,
                   const TouchProbe& options) {
  check(part);
  check(options, nominal);
  std::vector<Index> chosen;
  for (Index i = 0; i < part.deviation.size(); ++i)
    if (!std::isnan(part.deviation[i])) chosen.push_back(i);
  PartReadings r = blank(part, chosen, options.noise, options.resolution);
  ProbingMachine probing{nominal, machine, options, {}};
  for (Index i = 0; i < r.deviation.size(); ++i) {
    const Vector3d point_w = r.points_w.row(i), normal_w = r.normals_w.row(i);
    if (i == 0) {
      probing.state.q = probing.at(point_w + (options.radius + options.clearance) * normal_w);
      // The first touch is to happen at start_s, so the approach begins earlier.
      probing.state.time_s = options.start_s - options.clearance / options.speed - options.dwell_s;
    }
    const double height = probing.touch(point_w, normal_w, part.deviation[chosen[std::size_t(i)]]) +
                          options.noise * normal_deviate(options.seed, std::uint64_t(i));
    r.deviation[i] = rounded(height, options.resolution);
    r.time_s[i] = probing.state.time_s;
    probing.go(probing.at(point_w + (options.radius + options.clearance) * normal_w));
  }
  return r;
}

PartReadings measure_coordinates(const PartSurface& part, const CoordinateMachine& options) {
  check(part);
  check(options);
  const std::vector<Index> chosen = grid_points(part, options.spacing);
  PartReadings r = blank(part, chosen, options.noise, options.resolution);
  const Index n = r.deviation.size();
  if (n == 0) return r;
  const Vector3d middle_w = r.points_w.colwise().mean();
  const kinematics::Pose lie = kinematics::motion(random_alignment(options), middle_w);
  for (Index i = 0; i < n; ++i) {
    // The lie of the part is drawn once: it is an error of the alignment, not noise.
    const Vector3d point = r.points_w.row(i), normal = r.normals_w.row(i);
    const Vector3d machined = lie * (point + part.deviation[chosen[std::size_t(i)]] * normal);
    const Vector3d stands = lie.linear() * normal;
    const double height = stands.dot(machined - point) / stands.dot(normal) +
                          options.noise * normal_deviate(options.seed, std::uint64_t(i));
    r.deviation[i] = rounded(height, options.resolution);
    r.time_s[i] = options.start_s + double(i) * options.interval_s;
  }
  if (options.best_fit) r.deviation = best_fit_deviation(r, middle_w);
  return r;
}

}  // namespace abbe::errors::metrology
