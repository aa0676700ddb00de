// Poses per second and thread of the gantry with 46 elements: the tip alone, with what every
// element does, with every Jacobian, and as lines of CSV.

#include <ctime>
#include <functional>
#include <random>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "sim/cut/pose_table.h"
#include "sim/scene/read_scene.h"

namespace {

using namespace abbe;

sim::PoseList any_poses(const sim::IdleMachine& idle, int count) {
  std::mt19937 random(1);
  sim::PoseList poses;
  poses.others = kinematics::AxisVector::Zero(idle.machine.nominal.size());
  for (int j = 0; j < idle.machine.nominal.size(); ++j) {
    const kinematics::Joint& joint = idle.machine.nominal.joints()[std::size_t(j)];
    if (sim::is_positioned(joint))
      poses.columns.push_back({fmt::format("{}", joint.name), j, sim::position_unit(joint)});
  }
  std::uniform_real_distribution<double> anywhere(-50.0, 50.0);
  for (int i = 0; i < count * int(poses.columns.size()); ++i)
    poses.numbers.push_back(anywhere(random));
  return poses;
}

void report(const char* what, int poses, const std::function<void()>& work) {
  const std::clock_t start = std::clock();  // of the processor: others may be at work too
  work();
  const double spent = double(std::clock() - start) / CLOCKS_PER_SEC;
  fmt::print("{:<34}{:>12.0f} poses/s\n", what, poses / spent);
}

}  // namespace

int main() {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const sim::IdleMachine idle =
      sim::idle_machine(sim::read_scene(std::string(ABBE_SOURCE_DIR) + "/scenes/gantry_dome.toml"));
  const int count = 200000;
  const sim::PoseList poses = any_poses(idle, count);
  double sum = 0.0;
  report("tip", count, [&] {
    for (int i = 0; i < count; ++i)
      sum += sim::tip_pose(idle, poses.state(std::size_t(i))).deviation().x();
  });
  const auto lines = [&](const char* what, const sim::PoseRequest& wishes, int share) {
    sim::PoseList some = poses;
    some.numbers.resize(some.numbers.size() / std::size_t(share));
    const sim::PoseTable table(idle, wishes);
    std::size_t bytes = 0;
    report(what, count / share, [&] {
      sim::write_poses(table, some, sim::TableFormat::Csv,
                       [&](std::string_view text) { bytes += text.size(); });
    });
    sum += double(bytes);
  };
  lines("CSV", {}, 1);
  lines("CSV with all elements", {{}, {"all"}}, 10);
  using enum sim::PoseJacobian;
  lines("CSV with all Jacobians", {{Axis, Motion, Location}, {}}, 10);
  return sum == 0.0;
}
