#include "errors/metrology/stand.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "kinematics/jacobian.h"
#include "kinematics/least_squares.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

constexpr double longest_travel = 1e6;  // mm; beyond it a limit is not meant as one
constexpr double reached = 1e-9;        // mm
constexpr int most_places = 100'000;

bool is_spindle(const Joint& joint) { return joint.motion == Motion::Spindle || joint.name == 'S'; }

double waiting_place(const Joint& joint) {
  if (is_spindle(joint)) return 0.0;
  if (joint.motion == Motion::Rotary && joint.min <= 0.0 && joint.max >= 0.0) return 0.0;
  return 0.5 * (joint.min + joint.max);
}

void check_chosen(const Instrument& instrument, const Chain& nominal) {
  for (const char axis : instrument.axes)
    if (!nominal.find(axis))
      refuse(instrument, fmt::format("expected axes of the machine, seen {}", axis));
}

void check_limits(const Instrument& instrument, const Joint& joint) {
  if (!(joint.max - joint.min <= longest_travel) || !(joint.min < joint.max))
    refuse(instrument, fmt::format("expected limits of travel of {}, seen {} to {} mm", joint.name,
                                   joint.min, joint.max));
}

bool chosen(const Instrument& instrument, char axis) {
  return instrument.axes.empty() ||
         std::find(instrument.axes.begin(), instrument.axes.end(), axis) != instrument.axes.end();
}

}  // namespace

Stand stand(const Instrument& instrument, const Chain& nominal) {
  check_chosen(instrument, nominal);
  Stand result;
  result.q.resize(nominal.size());
  for (int j = 0; j < nominal.size(); ++j) {
    const Joint& joint = nominal.joints()[std::size_t(j)];
    if (joint.motion == Motion::Linear) check_limits(instrument, joint);
    result.q[j] = waiting_place(joint);
  }
  const Eigen::MatrixXd J_w = kinematics::axis_jacobian(nominal, result.q);
  for (int j = 0; j < nominal.size(); ++j) {
    const Joint& joint = nominal.joints()[std::size_t(j)];
    if (is_spindle(joint) || !chosen(instrument, joint.name)) continue;
    const bool slides = joint.motion == Motion::Linear;
    const Vector3d direction_w = slides ? J_w.col(j).head<3>() : J_w.col(j).tail<3>();
    (slides ? result.slides : result.rotary).push_back({j, joint.name, direction_w.normalized()});
  }
  const auto by_letter = [](const StandAxis& a, const StandAxis& b) { return a.name < b.name; };
  std::sort(result.slides.begin(), result.slides.end(), by_letter);
  std::sort(result.rotary.begin(), result.rotary.end(), by_letter);
  return result;
}

Range travel(const Instrument& instrument, const Joint& slide) {
  const double room = instrument.margin * (slide.max - slide.min);
  return {slide.min + room, slide.max - room, 0.5 * room};
}

Range arc(const Instrument& instrument, const Joint& rotary) {
  double from = instrument.from_rad, to = instrument.to_rad;
  const bool whole = to - from >= 2.0 * pi - 1e-9;
  if (whole && rotary.max - rotary.min < to - from) {
    from = rotary.min;
    to = rotary.max;
  }
  from = std::max(from, rotary.min);
  to = std::min(to, rotary.max);
  if (!(to - from > 0.0))
    refuse(instrument,
           fmt::format("expected an arc within the travel of {}, seen {} to {} deg", rotary.name,
                       instrument.from_rad / units::deg, instrument.to_rad / units::deg));
  const double room = instrument.margin * (to - from);
  return {std::max(from, rotary.min + room), std::min(to, rotary.max - room), 0.5 * room};
}

Eigen::VectorXd targets(const Range& range, int count) {
  return Eigen::VectorXd::LinSpaced(count, range.from, range.to);
}

Across across(const Chain& nominal, const AxisVector& q, const Vector3d& direction_w) {
  const Eigen::Matrix3d R_wb = nominal.workpiece_in_bed(q).linear().transpose();
  int along = 0;
  (R_wb.transpose() * direction_w).cwiseAbs().maxCoeff(&along);
  Across result;
  for (int k = 0, n = 0; k < 3; ++k) {
    if (k == along) continue;
    Vector3d e = R_wb.col(k) - R_wb.col(k).dot(direction_w) * direction_w;
    if (n == 1) e -= e.dot(result.direction_w[0]) * result.direction_w[0];
    result.direction_w[n] = e.normalized();
    result.letter[n++] = char('X' + k);
  }
  return result;
}

Vector3d reflector_w(const Instrument& instrument, const Chain& nominal, const AxisVector& q) {
  return nominal.tool_in_workpiece(q) * instrument.reflector_t;
}

// The line is where turning the axis moves nothing: half a turn takes the place across it.
Vector3d on_axis(const Chain& nominal, const AxisVector& q, int joint, const Vector3d& place_w) {
  AxisVector turned = q;
  turned[joint] += pi;
  const Vector3d opposite_w =
      nominal.tool_in_workpiece(turned) * (nominal.tool_in_workpiece(q).inverse() * place_w);
  return 0.5 * (place_w + opposite_w);
}

std::optional<AxisVector> slides_for_reflector(const Instrument& instrument, const Chain& nominal,
                                               const AxisVector& q, const Vector3d& place_w,
                                               std::vector<int> slides) {
  const Eigen::MatrixXd J_w = kinematics::axis_jacobian(nominal, q);
  const bool every = slides.empty();
  for (int j = 0; every && j < nominal.size(); ++j)
    if (nominal.joints()[std::size_t(j)].motion == Motion::Linear) slides.push_back(j);
  Eigen::MatrixXd directions_w(3, Eigen::Index(slides.size()));
  for (std::size_t k = 0; k < slides.size(); ++k)
    directions_w.col(Eigen::Index(k)) = J_w.col(slides[k]).head<3>();

  AxisVector there = q;
  for (int pass = 0; pass < 2; ++pass) {  // the second takes up rounding
    const Eigen::VectorXd left_w = place_w - reflector_w(instrument, nominal, there);
    const Eigen::VectorXd way = least_squares(directions_w, left_w).x;
    for (std::size_t k = 0; k < slides.size(); ++k) there[slides[k]] += way[Eigen::Index(k)];
  }
  if (!((place_w - reflector_w(instrument, nominal, there)).norm() <= reached)) return std::nullopt;
  return there;
}

std::vector<AxisVector> grid(const Instrument& instrument, const AxisVector& q,
                             const std::vector<GridLine>& lines) {
  std::vector<AxisVector> places = {q};
  for (const GridLine& line : lines) {
    if (double(places.size()) * double(line.at.size()) > most_places)
      refuse(instrument, fmt::format("expected a grid of at most {} places", most_places));
    std::vector<AxisVector> finer;
    for (std::size_t i = 0; i < places.size(); ++i) {
      for (Eigen::Index k = 0; k < line.at.size(); ++k) {
        finer.push_back(places[i]);  // every other line is gone back, so that nothing is jumped
        finer.back()[line.joint] = line.at[i % 2 == 0 ? k : line.at.size() - 1 - k];
      }
    }
    places = std::move(finer);
  }
  return places;
}

bool within_travel(const Chain& nominal, const AxisVector& q) {
  for (int j = 0; j < nominal.size(); ++j) {
    const Joint& joint = nominal.joints()[std::size_t(j)];
    if (!(q[j] >= joint.min && q[j] <= joint.max)) return false;
  }
  return true;
}

bool cross(const StandAxis& one, const StandAxis& other) {
  constexpr double least = 0.1;  // sine of the angle between them
  return one.direction_w.cross(other.direction_w).norm() > least;
}

std::vector<std::array<StandAxis, 2>> pairs_across(const Instrument& instrument,
                                                   const Stand& stand) {
  std::vector<std::array<StandAxis, 2>> pairs;
  std::string names;
  for (std::size_t a = 0; a < stand.slides.size(); ++a) {
    names += fmt::format(" {}", stand.slides[a].name);
    for (std::size_t b = a + 1; b < stand.slides.size(); ++b)
      if (cross(stand.slides[a], stand.slides[b]))
        pairs.push_back({stand.slides[a], stand.slides[b]});
  }
  if (pairs.empty())
    refuse(instrument, fmt::format("expected two slides across each other, seen{}", names));
  return pairs;
}

void expect_slides(const Instrument& instrument, const Stand& stand, int count) {
  if (int(stand.slides.size()) < count)
    refuse(instrument, fmt::format("expected at least {} slide{} to measure, seen {}", count,
                                   count == 1 ? "" : "s", stand.slides.size()));
}

void expect_rotary(const Instrument& instrument, const Stand& stand) {
  if (stand.rotary.empty()) refuse(instrument, "expected a rotary axis to measure, seen none");
}

void refuse(const Instrument& instrument, const std::string& sentence) {
  throw std::invalid_argument(
      (instrument.name.empty() ? to_string(instrument.kind) : instrument.name) + ": " + sentence);
}

}  // namespace abbe::errors::metrology
