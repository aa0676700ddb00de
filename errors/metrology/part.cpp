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

// mm; a picometre is far below any reading and above the rounding of positions of 1 m
constexpr double contact_tolerance = 1e-12;

[[noreturn]] void throw_input_error(const std::string& sentence) {
  throw std::invalid_argument("reading of a part: " + sentence);
}

void expect(bool holds, const char* what, double seen) {
  if (!holds) throw_input_error(fmt::format("expected {}, seen {}", what, seen));
}

void check(const PartSurface& part) {
  const Index n = part.points_w.rows();
  if (part.normals_w.rows() != n || part.deviation.size() != n)
    throw_input_error(
        fmt::format("expected equally many normals, deviations and points, seen {}, {} and {}",
                    part.normals_w.rows(), part.deviation.size(), n));
  for (Index i = 0; i < n; ++i) {
    if (!part.points_w.row(i).allFinite() || std::isinf(part.deviation[i]))
      throw_input_error(fmt::format("expected finite numbers at point {}", i + 1));
    if (!(std::abs(part.normals_w.row(i).norm() - 1.0) <= 1e-9))
      throw_input_error(
          fmt::format("expected a unit normal at point {}, seen a normal of length {}", i + 1,
                      part.normals_w.row(i).norm()));
  }
}

/// Returns readings of selected points whose deviations and times are still to be filled in.
PartReadings empty_readings(const PartSurface& part, const std::vector<Index>& point_indices,
                            double noise, double resolution) {
  const Index n = Index(point_indices.size());
  PartReadings r{Eigen::MatrixX3d(n, 3), Eigen::MatrixX3d(n, 3), Eigen::VectorXd(n),
                 std::sqrt(noise * noise + resolution * resolution / 12.0), Eigen::VectorXd(n)};
  for (Index i = 0; i < n; ++i) {
    r.points_w.row(i) = part.points_w.row(point_indices[std::size_t(i)]);
    r.normals_w.row(i) = part.normals_w.row(point_indices[std::size_t(i)]);
  }
  return r;
}

void check(const TouchProbe& options, const Chain& nominal) {
  expect(options.radius > 0.0 && std::isfinite(options.radius), "a ball radius above 0 mm",
         options.radius);
  expect(options.noise >= 0.0 && std::isfinite(options.noise), "a noise of at least 0",
         options.noise);
  expect(options.resolution >= 0.0 && std::isfinite(options.resolution),
         "a resolution of at least 0", options.resolution);
  expect(options.clearance > 0.0 && std::isfinite(options.clearance), "a clearance above 0 mm",
         options.clearance);
  expect(options.speed > 0.0 && std::isfinite(options.speed), "a speed above 0", options.speed);
  expect(options.dwell_s >= 0.0 && std::isfinite(options.dwell_s), "a dwell of at least 0 s",
         options.dwell_s);
  expect(std::isfinite(options.start_s), "a finite start time", options.start_s);
  expect(options.centre_t.allFinite(), "a finite centre of the ball", options.centre_t.norm());
  expect(options.q.size() == nominal.size(), "one position per axis", double(options.q.size()));
  expect(options.q.allFinite(), "finite axis positions", options.q.norm());
}

/// Machine with a touch probe. Its state continues from touch to touch.
struct ProbingMachine {
  const Chain& nominal;
  const MachineUnderTest& machine;
  const TouchProbe& options;
  AxisState state;

  /// Returns an instrument with the stylus ball as its reflector.
  Instrument ball_instrument() const {
    Instrument i;
    i.name = "touch probe";
    i.reflector_t = options.centre_t;
    return i;
  }
  /// Returns the axis positions at which a perfect machine has the ball at a point.
  AxisVector axis_positions(const Vector3d& centre_w) const {
    const auto q = axes_with_reflector_at(ball_instrument(), nominal, options.q, centre_w);
    if (!q || !is_within_travel(nominal, *q))
      throw_input_error(
          fmt::format("expected points within the travel, seen [{:.6g}, {:.6g}, {:.6g}]",
                      centre_w.x(), centre_w.y(), centre_w.z()));
    return *q;
  }
  void move_to(const AxisVector& q) {
    AxisState next_state = state_after_move(state, q);
    next_state.time_s += (q - state.q).norm() / options.speed;
    state = next_state;
  }
  double touch(const Vector3d& point_w, const Vector3d& normal_w, double deviation);
};

/// Returns the commanded height above the design at which the ball meets the surface.
double ProbingMachine::touch(const Vector3d& point_w, const Vector3d& normal_w, double deviation) {
  const auto centre_w = [&](double height) -> Vector3d {
    return point_w + (options.radius + height) * normal_w;
  };
  move_to(axis_positions(centre_w(options.clearance)));
  const AxisState at_clearance = state;
  const double approach_s = options.clearance / options.speed + options.dwell_s;
  double height = 0.0;
  // Each iteration corrects the height by the whole gap. The errors of a machine change by 1e-3 of
  // a motion at most, so a few iterations converge; 60 without convergence mean that there is no
  // contact.
  for (int k = 0; k < 60; ++k) {
    AxisState at_contact = state_after_move(at_clearance, axis_positions(centre_w(height)));
    at_contact.time_s = at_clearance.time_s + approach_s;
    const BodyPoses actual = machine(at_contact);
    const Vector3d ball_w = actual.T_bw.inverse() * (actual.T_bt * options.centre_t);
    const double gap = normal_w.dot(ball_w - point_w) - options.radius - deviation;
    height -= gap;
    if (!(std::abs(height) < options.clearance)) break;
    if (std::abs(gap) <= contact_tolerance) {
      state = at_contact;
      return height;
    }
  }
  throw_input_error(
      fmt::format("expected contact within {:.6g} mm of [{:.6g}, {:.6g}, {:.6g}], seen none",
                  options.clearance, point_w.x(), point_w.y(), point_w.z()));
}

void check(const CoordinateMeasuringMachine& options) {
  expect(options.spacing > 0.0 && std::isfinite(options.spacing), "a spacing above 0 mm",
         options.spacing);
  const double not_negative[] = {options.noise, options.resolution, options.alignment_sigma,
                                 options.alignment_sigma_rad, options.interval_s};
  for (const double x : not_negative)
    expect(x >= 0.0 && std::isfinite(x), "noise, resolution, sigmas and interval of at least 0", x);
  expect(std::isfinite(options.start_s), "a finite start time", options.start_s);
  if (options.alignment)
    expect(options.alignment->allFinite(), "a finite alignment", options.alignment->norm());
}

/// Returns the side of the part to which a normal belongs: the index of its largest component, plus
/// 3 if that is negative.
int part_side(const Vector3d& normal) {
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
  struct NearestPoint {
    double distance;
    Index point;
  };
  std::map<std::array<double, 4>, NearestPoint> cells;
  for (Index i = 0; i < part.points_w.rows(); ++i) {
    if (std::isnan(part.deviation[i])) continue;
    const Vector3d cell =
        ((part.points_w.row(i).transpose() - low) / spacing).array().floor().matrix();
    const Vector3d cell_centre = low + spacing * (cell + Vector3d::Constant(0.5));
    const double distance = (part.points_w.row(i).transpose() - cell_centre).norm();
    const auto [entry, is_new] =
        cells.try_emplace({double(part_side(part.normals_w.row(i))), cell.z(), cell.y(), cell.x()},
                          NearestPoint{distance, i});
    if (!is_new && distance < entry->second.distance) entry->second = {distance, i};
  }
  std::vector<Index> point_indices;
  for (const auto& [cell, nearest] : cells) point_indices.push_back(nearest.point);
  return point_indices;
}

/// Returns the stated displacement of the part, or a random one.
kinematics::Deviation random_alignment(const CoordinateMeasuringMachine& options) {
  if (options.alignment) return *options.alignment;
  kinematics::Deviation D;
  for (int k = 0; k < 6; ++k)
    D[k] = (k < 3 ? options.alignment_sigma : options.alignment_sigma_rad) *
           normal_deviate(options.seed ^ 0xa119ull, std::uint64_t(k));
  return D;
}

/// Returns the deviations after the rigid motion that minimises their sum of squares. The
/// minimum-norm step contains no motion that does not change the deviations (three of six for a
/// plane).
Eigen::VectorXd best_fit_deviation(const PartReadings& r, const Vector3d& middle_w) {
  const Index n = r.deviation.size();
  Eigen::MatrixX3d read_w = r.points_w;
  for (Index i = 0; i < n; ++i) read_w.row(i) += r.deviation[i] * r.normals_w.row(i);
  const double size =
      std::max(1.0, (r.points_w.rowwise() - middle_w.transpose()).rowwise().norm().maxCoeff());
  Eigen::VectorXd residuals = r.deviation;
  // Gauss-Newton: the error after each iteration is the square of the previous one.
  for (int iteration = 0; iteration < 5; ++iteration) {
    Eigen::MatrixXd A(n, 6);
    for (Index i = 0; i < n; ++i) {
      const Vector3d normal = r.normals_w.row(i), arm = read_w.row(i).transpose() - middle_w;
      // Angles are scaled by the size of the part, so that the threshold 1e-9 applies equally to
      // all six motions.
      A.row(i) << normal.transpose(), arm.cross(normal).transpose() / size;
    }
    kinematics::Deviation D = -shortest_least_squares(A, residuals, 1e-9);
    D.tail<3>() /= size;
    const kinematics::Pose correction = kinematics::motion(D, middle_w);
    for (Index i = 0; i < n; ++i) {
      read_w.row(i) = (correction * Vector3d(read_w.row(i).transpose())).transpose();
      residuals[i] = r.normals_w.row(i).dot(read_w.row(i) - r.points_w.row(i));
    }
  }
  return residuals;
}

}  // namespace

PartReadings probe(const PartSurface& part, const Chain& nominal, const MachineUnderTest& machine,
                   const TouchProbe& options) {
  check(part);
  check(options, nominal);
  std::vector<Index> point_indices;
  for (Index i = 0; i < part.deviation.size(); ++i)
    if (!std::isnan(part.deviation[i])) point_indices.push_back(i);
  PartReadings r = empty_readings(part, point_indices, options.noise, options.resolution);
  ProbingMachine prober{nominal, machine, options, {}};
  for (Index i = 0; i < r.deviation.size(); ++i) {
    const Vector3d point_w = r.points_w.row(i), normal_w = r.normals_w.row(i);
    if (i == 0) {
      prober.state.q =
          prober.axis_positions(point_w + (options.radius + options.clearance) * normal_w);
      // The first touch is at start_s, so its approach begins earlier.
      prober.state.time_s = options.start_s - options.clearance / options.speed - options.dwell_s;
    }
    const double height =
        prober.touch(point_w, normal_w, part.deviation[point_indices[std::size_t(i)]]) +
        options.noise * normal_deviate(options.seed, std::uint64_t(i));
    r.deviation[i] = round_to_resolution(height, options.resolution);
    r.time_s[i] = prober.state.time_s;
    prober.move_to(
        prober.axis_positions(point_w + (options.radius + options.clearance) * normal_w));
  }
  return r;
}

PartReadings measure_coordinates(const PartSurface& part,
                                 const CoordinateMeasuringMachine& options) {
  check(part);
  check(options);
  const std::vector<Index> point_indices = grid_points(part, options.spacing);
  PartReadings r = empty_readings(part, point_indices, options.noise, options.resolution);
  const Index n = r.deviation.size();
  if (n == 0) return r;
  const Vector3d middle_w = r.points_w.colwise().mean();
  // The displacement of the part is drawn once for all points: it is an error of alignment, not
  // noise.
  const kinematics::Pose displacement = kinematics::motion(random_alignment(options), middle_w);
  for (Index i = 0; i < n; ++i) {
    const Vector3d point = r.points_w.row(i), normal = r.normals_w.row(i);
    const Vector3d actual_point =
        displacement * (point + part.deviation[point_indices[std::size_t(i)]] * normal);
    const Vector3d actual_normal = displacement.linear() * normal;
    const double height = actual_normal.dot(actual_point - point) / actual_normal.dot(normal) +
                          options.noise * normal_deviate(options.seed, std::uint64_t(i));
    r.deviation[i] = round_to_resolution(height, options.resolution);
    r.time_s[i] = options.start_s + double(i) * options.interval_s;
  }
  if (options.best_fit) r.deviation = best_fit_deviation(r, middle_w);
  return r;
}

}  // namespace abbe::errors::metrology
