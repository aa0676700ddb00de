#include "sim/report/pose_report.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "kinematics/units.h"
#include "sim/report/json_numbers.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

ordered_json rows(const kinematics::Pose& T) {
  ordered_json all = ordered_json::array();
  for (int i = 0; i < 4; ++i)
    all.push_back({T.matrix()(i, 0), T.matrix()(i, 1), T.matrix()(i, 2), T.matrix()(i, 3)});
  return all;
}

std::string rows_text(const char* name, const kinematics::Pose& T) {
  std::string text = fmt::format("{}\n", name);
  for (int i = 0; i < 4; ++i)
    text += fmt::format("  {:16.9f} {:16.9f} {:16.9f} {:16.9f}\n", T.matrix()(i, 0),
                        T.matrix()(i, 1), T.matrix()(i, 2), T.matrix()(i, 3));
  return text;
}

kinematics::Pose error_of(const TipPose& pose) {
  return kinematics::error_transform(pose.nominal, pose.actual);
}

}  // namespace

ordered_json to_json(const PoseAt& at) {
  ordered_json columns = ordered_json::object();
  for (std::size_t i = 0; i < at.heads.size(); ++i) columns[at.heads[i]] = at.numbers[i];
  return {{"T_wt_nominal", rows(at.pose.nominal)},
          {"T_wt_actual", rows(at.pose.actual)},
          {"deviation_mm", numbers(at.pose.deviation())},
          {"direction_rad", numbers(at.pose.direction())},
          {"E", rows(error_of(at.pose))},
          {"columns", columns},
          {"warnings", at.warnings}};
}

std::string to_text(const PoseAt& at) {
  const Eigen::Vector3d d = at.pose.deviation() / units::um, u = at.pose.direction() / units::urad;
  std::string text = rows_text("T_wt_nominal", at.pose.nominal) +
                     rows_text("T_wt_actual", at.pose.actual) + rows_text("E", error_of(at.pose));
  text += fmt::format("deviation of the tip    {:10.4f} {:10.4f} {:10.4f} um, workpiece frame\n",
                      d.x(), d.y(), d.z());
  text +=
      fmt::format("deviation of direction  {:10.4f} {:10.4f} {:10.4f} urad\n", u.x(), u.y(), u.z());
  for (std::size_t k = 0; k < at.wished.size(); ++k) {
    const std::string name = escaped(at.wished[k].name);
    text += fmt::format("{:<22}", at.wished[k].derivative ? "d/d" + name : name + ", um, urad");
    for (std::size_t i = 6 * k; i < 6 * k + 6; ++i) text += fmt::format(" {:12.6g}", at.numbers[i]);
    text += "\n";
  }
  return text;
}

}  // namespace abbe::sim
