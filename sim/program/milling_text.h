#pragma once

#include <string>
#include <vector>

#include "sim/program/generate.h"

namespace abbe::sim::program {

/// Where a milling cutter is put.
struct Posture {
  Eigen::Vector3d tip_w;
  Eigen::Vector3d direction_w;  ///< unit, from the tip to the spindle
  Eigen::Vector3d retreat_w;    ///< unit, the way out of the cut
};
using Pass = std::vector<Posture>;

struct MillingTextOptions {
  std::string title;
  double feed = 1000.0 / 60.0;  ///< mm/s of the tip
  double clearance = 5.0;       ///< mm
  double speed_rpm = 10000.0;   ///< of the spindle
  double cutter_radius = 5.0;   ///< mm, how much a turning tool may dip below its tip
  double neighbour = 0.0;  ///< mm, passes this near are linked at clearance, others above the part
  bool whole = false;  ///< a posture out of reach is refused; else it ends its pass, and is counted
  NcFormat format;
};

/// NC text of passes: G43.4 where the machine has rotary axes, positions of the slides where not.
/// @throws std::invalid_argument if nothing is reachable
MillingProgram milling_text(const std::vector<Pass>& passes, const MillingTextOptions& options,
                            const GenerateContext& context);

/// True if the machine can turn the tool against the workpiece.
bool has_rotary_axes(const kinematics::Chain& chain);

/// Every joint as the reader of programs wants it.
std::vector<ControlledAxis> controlled_axes(const kinematics::Chain& chain);

}  // namespace abbe::sim::program
