#include "errors/metrology/test_results.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "errors/metrology/circular.h"
#include "errors/metrology/form.h"
#include "errors/metrology/machine_tests.h"
#include "errors/metrology/positioning.h"
#include "errors/metrology/readings.h"
#include "errors/metrology/surface_texture.h"
#include "kinematics/decompositions.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {

Figure figure(std::string name, const std::optional<double>& value, bool angle) {
  Figure result{std::move(name), angle ? "urad" : "um", {}};
  if (value) result.value = *value / (angle ? units::urad : units::um);
  return result;
}

namespace {

using Eigen::Index;

Figure estimated_figure(std::string name, const char* unit,
                        const std::optional<EstimatedValue>& estimate, double unit_size) {
  Figure figure{std::move(name), unit, {}};
  if (estimate) figure.value = EstimatedValue{estimate->value / unit_size, estimate->u / unit_size};
  return figure;
}

/// Returns the name of a cause with the letters of a plane instead of u and v.
std::string axis_cause_name(const std::string& cause, const std::string& plane) {
  if (cause == "scale") return fmt::format("scale_{}_minus_{}", plane[0], plane[1]);
  if (!cause.ends_with("_u") && !cause.ends_with("_v")) return cause;
  return cause.substr(0, cause.size() - 1) + plane[cause.back() == 'u' ? 0 : 1];
}

/// Returns the causes of a circle. All are undetermined if it has too few positions.
CircularCauses test_causes(const CircleTest& test, bool has_enough_positions) {
  if (has_enough_positions) return circular_causes(test.runs);
  CircularCauses causes;
  causes.undetermined.assign(cause_names.begin(), cause_names.end());
  return causes;
}

/// Returns a sentence with the undetermined causes and the reason.
std::string undetermined_reason(const std::vector<std::string>& names_of_causes, int position_total,
                                bool both_senses) {
  const std::string names = fmt::format("{}", fmt::join(names_of_causes, ", "));
  constexpr int min_positions = circular_cause_count + 1;
  if (position_total < min_positions)
    return fmt::format(
        "{} cannot be determined: {} causes require readings at {} or more different positions, "
        "counted separately per sense of rotation, seen {}",
        names, circular_cause_count, min_positions, position_total);
  return fmt::format(
      "{} cannot be determined: their effects are indistinguishable at the {} measured positions{}",
      names, position_total, both_senses ? "" : ", in one sense of rotation only");
}

/// Returns the causes of a circle, with the undetermined ones and the reason.
FigureGroup cause_figures(const CircleTest& test) {
  const int position_total = position_count(test.runs);
  const bool has_enough_positions = position_total > circular_cause_count;
  const CircularCauses causes = test_causes(test, has_enough_positions);
  const auto cause_name = [&](const char* cause) { return axis_cause_name(cause, test.plane); };
  std::vector<std::string> undetermined_names;
  for (const std::string& cause : causes.undetermined)
    undetermined_names.push_back(axis_cause_name(cause, test.plane));
  FigureGroup group{"causes"};
  group.figures = {
      estimated_figure("squareness", "urad", causes.squareness, units::urad),
      {"squareness_sign", "",
       fmt::format("{1} turned about {0} x {1}", test.plane[0], test.plane[1])},
      estimated_figure(cause_name("scale"), "um_per_m", causes.scale, 1e-6),
      estimated_figure(cause_name("reversal_u"), "um", causes.reversal_u, units::um),
      estimated_figure(cause_name("reversal_v"), "um", causes.reversal_v, units::um),
      estimated_figure(cause_name("centre_u"), "um", causes.centre_u, units::um),
      estimated_figure(cause_name("centre_v"), "um", causes.centre_v, units::um),
      figure("unexplained", has_enough_positions ? std::optional(causes.residual) : std::nullopt),
      {"undetermined", "", undetermined_names}};
  const bool both_senses =
      test.runs.anticlockwise.angle.size() > 0 && test.runs.clockwise.angle.size() > 0;
  if (!undetermined_names.empty())
    group.figures.push_back({"undetermined_because", "",
                             undetermined_reason(undetermined_names, position_total, both_senses)});
  return group;
}

/// Returns the results of ISO 230-4, with the causes estimated from the shape of the circle. A bar
/// that measures only changes of its length gives neither radius nor F.
/// @throws std::invalid_argument as `circular`
TestResult circle_result(const CircleTest& test) {
  const CircularResult c = circular(test.runs);
  const auto absolute_only = [&](double value) {
    return test.is_zero_known ? std::optional(value) : std::nullopt;
  };
  Figure radius{"radius", "mm", {}};
  if (test.is_zero_known) radius.value = c.circle.radius;
  TestResult result{test.name, "ISO 230-4:2005 circular test", {}, {cause_figures(test)}};
  std::vector<Figure>& f = result.figures;
  f = {{"plane", "", test.plane},
       {"readings", "", test.runs.anticlockwise.radius.size() + test.runs.clockwise.radius.size()},
       {"places", "", Index(position_count(test.runs))},
       {"nominal_radius", "mm", test.runs.nominal_radius},
       radius,
       figure(std::string("centre_") + test.plane[0], c.circle.centre.x()),
       figure(std::string("centre_") + test.plane[1], c.circle.centre.y())};
  const auto add_figures = [&](const std::string& label,
                               const std::optional<CircularFigures>& figures) {
    if (!figures) return;
    f.push_back(figure("G_" + label + "_lsq", figures->G_lsq));
    f.push_back(figure("G_" + label + "_minimum_zone", figures->G_minimum_zone));
    f.push_back(figure("F_max_" + label, absolute_only(figures->F_max)));
    f.push_back(figure("F_min_" + label, absolute_only(figures->F_min)));
  };
  add_figures("anticlockwise", c.anticlockwise);
  add_figures("clockwise", c.clockwise);
  add_figures("both", c.both);
  f.push_back({"F_from", "",
               c.centre_kind == CircleCentre::LeastSquares
                   ? "least-squares centre"
                   : "centre as set up, since this is not a full circle"});
  f.push_back(figure("D", absolute_only(c.D)));
  f.push_back(figure("H", c.H));
  return result;
}

using Eigen::VectorXd;

/// Returns the results of ISO 230-2.
TestResult positioning_result(const std::string& name, const PositionRuns& runs, bool angle) {
  const Positioning p = positioning(runs);
  TestResult result{name, "ISO 230-2:2014 positioning"};
  std::vector<Figure>& f = result.figures;
  f = {{"targets", "", runs.target.size()},
       {"runs_up", "", runs.up.cols()},
       {"runs_down", "", runs.down.cols()},
       figure("A", p.A, angle)};
  const auto add_direction = [&](const std::string& label,
                                 const std::optional<UnidirectionalPositioning>& direction) {
    if (!direction) return;
    f.push_back(figure("A_" + label, direction->A, angle));
    f.push_back(figure("E_" + label, direction->E, angle));
    f.push_back(figure("R_" + label, direction->R, angle));
  };
  add_direction("up", p.up);
  add_direction("down", p.down);
  f.push_back(figure("E", p.E, angle));
  f.push_back(figure("M", p.M, angle));
  f.push_back(figure("R", p.R, angle));
  f.push_back(figure("B", p.B, angle));
  f.push_back(figure("B_mean", p.B_mean, angle));
  return result;
}

/// Returns the slope of the least-squares line through the mean of all runs.
double mean_slope(const PositionRuns& runs) {
  const VectorXd from_middle = runs.target.array() - runs.target.mean();
  return from_middle.dot(run_mean(runs)) / from_middle.squaredNorm();
}

/// Returns the range of the mean of all runs about the line through its ends.
double end_line_range(const PositionRuns& runs) {
  const VectorXd mean = run_mean(runs), &t = runs.target;
  const Index last = t.size() - 1;
  return range(mean - (mean[last] - mean[0]) / (t[last] - t[0]) * t);
}

/// Returns synchronous and asynchronous error motion.
TestResult error_motion_result(const AxisTest& test) {
  const char* standard = !test.spindle ? "error motion over the angle"
                         : test.axial  ? "ISO 230-7:2015 axial error motion"
                                       : "ISO 230-7:2015 radial error motion";
  std::optional<double> synchronous, asynchronous;
  if (!is_hidden_by_centring(test)) synchronous = range(run_mean(form_runs(test)));
  for (const Eigen::MatrixXd* runs : {&test.runs.up, &test.runs.down})
    if (runs->cols() > 1)
      asynchronous = std::max(asynchronous.value_or(0.0),
                              (runs->rowwise().maxCoeff() - runs->rowwise().minCoeff()).maxCoeff());
  return {test.name,
          standard,
          {{"angles", "", test.runs.target.size()},
           figure("synchronous", synchronous),
           figure("asynchronous", asynchronous)}};
}

TestResult axis_result(const AxisTest& test) {
  if (test.test_kind == AxisTest::TestKind::ErrorMotion) return error_motion_result(test);
  if (test.test_kind == AxisTest::TestKind::Positioning)
    return positioning_result(test.name, test.runs, test.angle);
  const Positioning p = positioning(test.runs);
  const bool is_straightness = test.test_kind == AxisTest::TestKind::Straightness;
  TestResult result{
      test.name,
      is_straightness ? "ISO 230-1:2012 straightness" : "ISO 230-1:2012 angular error motion",
      {{"targets", "", test.runs.target.size()}}};
  std::vector<Figure>& f = result.figures;
  if (is_straightness) {
    f.push_back(figure("straightness_lsq", range(run_mean(form_runs(test))), test.angle));
    f.push_back(figure("straightness_ends", end_line_range(test.runs), test.angle));
    f.push_back({"slope", "urad", mean_slope(test.runs) / units::urad});
  } else {
    f.push_back(figure("range", range(run_mean(test.runs)), test.angle));
  }
  f.push_back(figure("R", p.R ? p.R : p.up ? p.up->R : p.down->R, test.angle));
  f.push_back(figure("B", p.B, test.angle));
  return result;
}

// A positive slope turns each axis towards the other, so the slopes reduce the angle between them.
TestResult square_result(const SquareTest& test) {
  const std::vector<std::string> axes{std::string(1, test.first.axis),
                                      std::string(1, test.second.axis)};
  return {test.name,
          "ISO 230-1:2012 squareness",
          {{"axes", "", axes},
           {"squareness", "urad",
            -(mean_slope(test.first.runs) + mean_slope(test.second.runs)) / units::urad},
           {"sign", "", "angle between the positive directions minus 90 degrees"}}};
}

bool is_face(const DiagonalTest& test) {
  const auto& signs = test.runs.signs;
  return std::count(signs.begin(), signs.end(), 0) > 0;
}

/// Returns body and face diagonals in separate sets. A repeated diagonal, e.g. of another start,
/// begins a new set.
std::vector<std::vector<DiagonalTest>> diagonal_sets(const std::vector<DiagonalTest>& tests) {
  std::vector<std::vector<DiagonalTest>> sets;
  for (const DiagonalTest& test : tests) {
    const auto can_contain = [&](const std::vector<DiagonalTest>& set) {
      return is_face(set.front()) == is_face(test) &&
             std::none_of(set.begin(), set.end(), [&](const DiagonalTest& other) {
               return other.runs.signs == test.runs.signs;
             });
    };
    const auto set = std::find_if(sets.begin(), sets.end(), can_contain);
    if (set == sets.end())
      sets.push_back({test});
    else
      set->push_back(test);
  }
  return sets;
}

TestResult diagonals_result(const std::vector<DiagonalTest>& tests) {
  std::vector<DiagonalRuns> set;
  for (const DiagonalTest& test : tests) set.push_back(test.runs);
  const Diagonals d = diagonals(set);
  TestResult result{is_face(tests.front()) ? "face diagonals" : "body diagonals",
                    "ISO 230-6:2002 diagonals",
                    {figure("E_d", d.E_d), figure("B_d", d.B_d)}};
  for (const DiagonalTest& test : tests)
    result.diagonals.push_back(positioning_result(test.name, test.runs.runs, false));
  return result;
}

/// Returns the drift over the whole log and, in a longer one, over its first hour.
TestResult drift_result(const DriftTest& test) {
  TestResult result{test.name, "ISO 230-3:2020 thermal drift"};
  const VectorXd& t = test.log.time_s;
  std::vector<DriftInterval> intervals{{"whole", t[0], t[t.size() - 1]}};
  if (t[t.size() - 1] - t[0] > 3600.0)
    intervals.insert(intervals.begin(), {"first_hour", t[0], t[0] + 3600.0});
  for (const DriftRange& drift_range : drift(test.log, intervals)) {
    const double hours = (drift_range.interval.to_s - drift_range.interval.from_s) / 3600.0;
    FigureGroup interval{drift_range.interval.name, {{"hours", "", hours}}};
    for (std::size_t c = 0; c < test.log.names.size(); ++c)
      interval.groups.push_back({test.log.names[c],
                                 {figure("range", drift_range.range[Index(c)], test.angle[c]),
                                  figure("change", drift_range.change[Index(c)], test.angle[c])}});
    result.groups.push_back(std::move(interval));
  }
  return result;
}

TestResult other_result(const OtherTest& test) {
  return {test.name,
          "range of the readings minus the nominal machine",
          {{"readings", "", test.deviation.size()},
           figure("range", range(test.deviation), test.angle),
           figure("rms", std::sqrt(test.weights.dot(test.deviation.cwiseAbs2())), test.angle)}};
}

}  // namespace

std::vector<TestResult> standard_results(const MachineTests& tests) {
  std::vector<TestResult> results;
  for (const AxisTest& test : tests.axes) results.push_back(axis_result(test));
  for (const SquareTest& test : tests.squares) results.push_back(square_result(test));
  for (const auto& set : diagonal_sets(tests.diagonals)) results.push_back(diagonals_result(set));
  for (const CircleTest& test : tests.circles) results.push_back(circle_result(test));
  for (const DriftTest& test : tests.drifts) results.push_back(drift_result(test));
  for (const OtherTest& test : tests.others) results.push_back(other_result(test));
  return results;
}

namespace {

using Eigen::MatrixX2d;
using Eigen::MatrixX3d;
using Eigen::Vector3d;

constexpr double point_tolerance = 1e-6;  // mm; closer points of a design coincide

/// Returns the points of the actual surface.
MatrixX3d machined_points(const PartReadings& r) {
  return r.points_w + (r.normals_w.array().colwise() * r.deviation.array()).matrix();
}

TestResult flatness_result(const PartReadings& r, const VectorXd& weights) {
  const MatrixX3d points = machined_points(r);
  const MinimumZonePlanes zone = minimum_zone_planes(points);
  return {"flatness",
          "ISO 12781-1:2011",
          {{"points", "", points.rows()},
           figure("flatness_lsq", least_squares_plane(points, weights).flatness),
           figure("flatness_minimum_zone", zone.flatness),
           {"minimum_zone_proven", "", zone.is_proven}}};
}

/// Returns the axis of a cylinder or a ring: the direction perpendicular to all normals, or nothing
/// if the normals do not span a plane.
std::optional<Vector3d> common_axis(const PartReadings& r) {
  const PrincipalAxes normals = principal_axes(r.normals_w);
  const Vector3d size = normals.size / normals.size[0];
  // 1e-9: the normals of a design are exact. 0.1 excludes normals of almost the same direction.
  if (size[2] > 1e-9 || size[1] < 0.1) return std::nullopt;
  Vector3d axis = normals.axes.col(2);
  Index largest = 0;
  axis.cwiseAbs().maxCoeff(&largest);
  return axis[largest] < 0.0 ? Vector3d(-axis) : axis;
}

/// Returns the indices of the points at each height along an axis, in ascending order.
std::vector<std::vector<Index>> rings_by_height(const MatrixX3d& points, const Vector3d& axis) {
  const VectorXd height = points * axis;
  std::vector<Index> order(static_cast<std::size_t>(height.size()));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return height[a] < height[b]; });
  std::vector<std::vector<Index>> rings;
  for (const Index i : order) {
    if (rings.empty() || height[i] - height[rings.back().front()] > point_tolerance)
      rings.emplace_back();
    rings.back().push_back(i);
  }
  return rings;
}

/// Returns the angles of points about a centre, rad.
VectorXd angles_around(const MatrixX2d& points, const Eigen::Vector2d& centre) {
  VectorXd angle(points.rows());
  for (Index i = 0; i < angle.size(); ++i)
    angle[i] = std::atan2(points(i, 1) - centre.y(), points(i, 0) - centre.x());
  return angle;
}

/// Returns the circularity of the points at one height, or nothing if the design is not a circle
/// there or the points do not cover a full turn.
std::optional<TestResult> circularity_result(const PartReadings& r, const std::vector<Index>& rows,
                                             const Vector3d& axis) {
  const Eigen::Matrix<double, 3, 2> plane = perpendicular_basis(axis);
  const MatrixX2d design = r.points_w(rows, Eigen::all) * plane;
  const Eigen::Vector2d design_mean = design.colwise().mean();
  // This also excludes points on a line.
  if (!is_full_turn(angles_around(design, design_mean))) return std::nullopt;
  const LeastSquaresCircle nominal = least_squares_circle(design);
  const VectorXd angle = angles_around(design, nominal.centre);
  if (nominal.circularity > point_tolerance || !is_full_turn(angle)) return std::nullopt;
  const MatrixX2d points = machined_points(r)(rows, Eigen::all) * plane;
  const auto circle = least_squares_circle(points, arc_weights(angle));
  const auto zone = minimum_zone_circles(points);
  const double height = r.points_w.row(rows.front()).dot(axis);
  const Vector3d centre = plane * circle.centre + height * axis;
  return TestResult{"circularity",
                    "ISO 12181-1:2011",
                    {{"points", "", Index(rows.size())},
                     {"centre", "mm", centre},
                     {"radius", "mm", circle.radius},
                     figure("circularity_lsq", circle.circularity),
                     figure("circularity_minimum_zone", zone.circularity),
                     {"minimum_zone_proven", "", zone.is_proven}}};
}

Figure shape(const char* name, const std::optional<double>& value) {
  Figure figure{name, "", {}};
  if (value) figure.value = *value;
  return figure;
}

/// Returns the height parameters. Heights of a part that is not a plane count from their mean,
/// along the design's normals.
TestResult heights_result(const PartReadings& r, const VectorXd& weights, bool is_plane) {
  ArealOptions options;
  options.reference = is_plane ? ArealReference::Plane : ArealReference::Mean;
  const ArealParameters heights =
      areal(r.points_w * perpendicular_basis(Vector3d(r.normals_w.row(0))), r.deviation, weights,
            options);
  return {"heights",
          "ISO 25178-2:2021 height parameters, unfiltered",
          {{"reference", "", is_plane ? "least-squares plane" : "mean, along the design's normals"},
           {"points", "", r.deviation.size()},
           figure("Sa", heights.Sa),
           figure("Sq", heights.Sq),
           figure("Sz", heights.Sz),
           figure("Sp", heights.Sp),
           figure("Sv", heights.Sv),
           shape("Ssk", heights.Ssk),
           shape("Sku", heights.Sku),
           figure("mean", weights.dot(r.deviation) / weights.sum()),
           figure("pv", r.deviation.maxCoeff() - r.deviation.minCoeff())}};
}

}  // namespace

std::vector<TestResult> standard_results(const PartReadings& r) {
  const VectorXd weights = position_weights(r.points_w, point_tolerance);
  // 1e-12: normals of a plane agree within 1.4 urad.
  const bool is_plane = (r.normals_w * r.normals_w.row(0).transpose()).minCoeff() > 1.0 - 1e-12;
  std::vector<TestResult> results;
  if (is_plane) results.push_back(flatness_result(r, weights));
  if (const auto axis = common_axis(r))
    for (const std::vector<Index>& rows : rings_by_height(r.points_w, *axis))
      if (auto ring = circularity_result(r, rows, *axis)) results.push_back(std::move(*ring));
  results.push_back(heights_result(r, weights, is_plane));
  return results;
}

}  // namespace abbe::errors::metrology
