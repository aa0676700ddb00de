#include "sim/dialects/turning_tool.h"

#include <array>

#include "sim/program/program_zero.h"

namespace abbe::sim::dialects {

using kinematics::AxisVector;
using kinematics::Chain;

const Chain* chain_to_tip(const program::NcOptions& control, int tool) {
  if (const auto own = control.control_of_h.find(tool); own != control.control_of_h.end())
    return &own->second;
  return control.control ? &*control.control : nullptr;
}

AxisVector measured_offset(const program::Canon& canon, const Chain& chain,
                           const program::Cause& cause) {
  auto shift = program::tip_shift(chain);
  if (!shift) canon.refuse(cause, "slides at right angles beside the offset of a turning tool");
  // the shift of a tool comes on top of what work offsets count from
  const Eigen::Vector3d more = canon.on_top_of_shift();
  for (int k = 0; k < 3; ++k)
    if (const int j = canon.joint_of("XYZ"[k]); j >= 0) (*shift)[j] -= more[k];
  return *shift;
}

AxisVector nose_from_tip(const program::Canon& canon, int tip, std::optional<double> radius) {
  struct Direction {
    int x, z;
  };
  // from the centre to the imaginary tip
  constexpr std::array<Direction, 10> tips = {
      {{0, 0}, {1, 1}, {1, -1}, {-1, -1}, {-1, 1}, {0, 1}, {1, 0}, {0, -1}, {-1, 0}, {0, 0}}};
  AxisVector displacement = AxisVector::Zero(canon.position().size());
  if (!radius) return displacement;
  const auto [x, z] = tips.at(std::size_t(tip));
  if (const int j = canon.joint_of('X'); j >= 0) displacement[j] = -x * *radius;
  if (const int j = canon.joint_of('Z'); j >= 0) displacement[j] = -z * *radius;
  return displacement;
}

}  // namespace abbe::sim::dialects
