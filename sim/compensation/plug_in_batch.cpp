#include "sim/compensation/plug_in_batch.h"

#include <array>
#include <cmath>

#include <fmt/format.h>

namespace abbe::sim::compensation {
namespace {

using Eigen::Index;

constexpr std::array<const char*, 6> deviation_columns = {"EX", "EY", "EZ", "EA", "EB", "EC"};
constexpr double rpm_per_rad_per_s = 9.549296585513721;  // 30 / pi

bool is_angle(const Expected& expected, Index column) {
  if (expected.answers == Answers::Deviation) return column >= 3;
  return expected.task.joints[std::size_t(column)].motion != kinematics::Motion::Linear;
}

}  // namespace

Index readings(const PlugInTask& task) {
  return task.log.time_s.size() > 0 ? task.log.values.cols() : 0;
}

PlugInBatch batch_of(const PlugInTask& task, const PlugInQuestion& question, Samples samples) {
  const Index n = samples.count, joints = Index(task.joints.size()), m = readings(task);
  PlugInBatch batch{Eigen::VectorXd(n), PlugInBatch::Rows(n, joints), PlugInBatch::Rows(n, joints),
                    Eigen::VectorXd(n), PlugInBatch::Rows(n, 12),     PlugInBatch::Rows(n, m)};
  for (Index i = 0; i < n; ++i) {
    const kinematics::AxisState& state = question.commands[std::size_t(samples.first + i)];
    const kinematics::Pose& T_wt = question.T_wt[std::size_t(samples.first + i)];
    batch.time_s[i] = state.time_s;
    batch.q.row(i) = state.q.transpose();
    for (Index j = 0; j < joints; ++j)
      batch.direction(i, j) = double(state.direction[std::size_t(j)]);
    batch.spindle_rpm[i] = state.spindle_speed * rpm_per_rad_per_s;
    for (Index k = 0; k < 12; ++k) batch.T_wt(i, k) = T_wt.matrix()(k / 4, k % 4);
    if (m > 0) batch.readings.row(i) = task.log.values.row(row_at(task.log, state.time_s));
  }
  return batch;
}

Index columns(Answers answers, const PlugInTask& task) {
  return answers == Answers::Deviation ? 6 : Index(task.joints.size());
}

std::string column_name(const Expected& expected, Index column) {
  if (expected.answers == Answers::Deviation) return deviation_columns[std::size_t(column)];
  return std::string(1, expected.task.joints[std::size_t(column)].name);
}

std::optional<std::string> expected_instead(double number, const Expected& expected, Index column) {
  if (!std::isfinite(number)) return "a finite number";
  const bool angle = is_angle(expected, column);
  const double most = angle ? expected.options.most_rad : expected.options.most_mm;
  if (std::abs(number) <= most) return std::nullopt;
  return fmt::format("at most {} {} (units are mm and rad)", most, angle ? "rad" : "mm");
}

std::string name_of_batch(long id, Samples samples) {
  return fmt::format("batch {} (samples {} to {})", id, samples.first + 1,
                     samples.first + samples.count);
}

}  // namespace abbe::sim::compensation
