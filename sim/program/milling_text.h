#pragma once

#include <stdexcept>
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

/// The machine reaches no point of what is to be cut.
struct NothingReached : std::invalid_argument {
  explicit NothingReached(const Unreached& all)
      : std::invalid_argument("no pose that the machine can reach"), unreached(all) {}
  Unreached unreached;
};

/// NC text of passes: G43.4 where the machine has rotary axes, positions of the slides where not.
/// @throws NothingReached; std::invalid_argument if the machine lacks X, Y or Z
MillingProgram milling_text(const std::vector<Pass>& passes, const MillingTextOptions& options,
                            const GenerateContext& context);

/// True if the machine can turn the tool against the workpiece.
bool has_rotary_axes(const kinematics::Chain& chain);

/// Every joint as the reader of programs wants it.
std::vector<ControlledAxis> controlled_axes(const kinematics::Chain& chain);

}  // namespace abbe::sim::program
