#include "sim/cut/turning.h"

#include <cmath>
#include <stdexcept>
#include <variant>

#include "kinematics/units.h"
#include "sim/cut/milling_looks.h"

namespace abbe::sim {
namespace {

using kinematics::Pose;

/// A blank's profile over the part's z as one over the spindle line, in rising order.
Eigen::Matrix<double, Eigen::Dynamic, 2> profile_along(
    const SpindleLine& line, const Pose& T_wm,
    const Eigen::Matrix<double, Eigen::Dynamic, 2>& profile_m) {
  Eigen::Matrix<double, Eigen::Dynamic, 2> profile = profile_m;
  if (line.direction_w.dot(T_wm.linear().col(2)) < 0.0) {
    profile = profile_m.colwise().reverse().eval();
    profile.col(0) *= -1.0;
  }
  profile.col(0).array() += line.direction_w.dot(T_wm.translation() - line.point_w);
  return profile;
}

}  // namespace

cutting::TurnedStock turned_blank(const Scene& scene, const SpindleLine& line) {
  const auto* blank = std::get_if<CuttingDescription::TurnedBlank>(&scene.cutting->blank);
  if (blank == nullptr) throw std::invalid_argument("a turned blank for a turning tool");
  return cutting::make_turned_stock(profile_along(line, scene.part.T_wm, blank->profile),
                                    scene.cutting->spacing, line.point_w, line.direction_w);
}

std::vector<std::size_t> turning_looks(const program::Samples& samples, const program::Path& path,
                                       const std::vector<Pose>& T_wt, int spindle,
                                       const SpindleLine& line) {
  constexpr double step = 0.1;  // mm
  const auto& states = samples.states;
  const auto place = [&](std::size_t i) -> Eigen::Vector3d {
    return slow_pose(line, states[i].q[spindle], T_wt[i]).translation();
  };
  const auto rapid = [&](std::size_t i) { return is_rapid(samples, path, i); };
  std::vector<std::size_t> at{0};
  double turned = 0.0, travel = 0.0;
  for (std::size_t i = 1; i < states.size(); ++i) {
    turned += std::abs(states[i].q[spindle] - states[i - 1].q[spindle]);
    travel += (place(i) - place(i - 1)).norm();
    const bool last = i + 1 == states.size();
    const bool by_travel = rapid(i) || !(states[i].spindle_speed > 0.0);
    const bool due = by_travel ? travel >= step : turned >= 2 * pi * (1 - 1e-9);
    if (!due && !last && rapid(i) == rapid(i + 1)) continue;
    at.push_back(i);
    turned = travel = 0.0;
  }
  return at;
}

}  // namespace abbe::sim
