#pragma once

#include <string>
#include <variant>
#include <vector>

#include "sim/cut/pose.h"

namespace abbe::sim {

/// One cause of a deviation, alone.
struct ErrorSource {
  struct Tool {};           ///< as it is, against as ordered
  struct Clamping {};       ///< of the part, against where it should be
  struct Compliance {};     ///< under weight and clamping
  struct PartExpansion {};  ///< the part is judged at 20 deg C
  std::string name;         ///< "EXX", "EXX_heat", "X_expansion", "EXS_vibration", "tool",
                            ///< "clamping", "compliance", "part_expansion"
  std::variant<errors::GeometricModel, errors::ThermalModel, errors::VibrationModel, Tool, Clamping,
               Compliance, PartExpansion>
      what;
};

/// Every cause that the machine has: tool, clamping, geometric elements in the order of the scene,
/// vibrations, heat element by element and screw by screw, compliance, the part's expansion.
std::vector<ErrorSource> error_sources(const IdleMachine& idle);

/// Those of these names in their order; "all" stands for every one.
/// @throws BadInput for a name that the machine lacks, or twice
std::vector<ErrorSource> chosen_sources(std::vector<ErrorSource> all,
                                        const std::vector<std::string>& names);

/// What each source alone adds to the deviation of the tip and to that of the tool axis, in the
/// workpiece frame; tool and clamping exactly, all others to first order about the machine with
/// that tool and clamping.
/// Their sum over all sources misses the deviation of the tip by at most
/// (T^2 L / 2 + T D + G (T L + D)) (1 + 2 T), and that of the axis by T^2 / 2 (1 + T): T the sum of
/// the angles and D of the displacements of all joints, tool and part, L the longest arm from them
/// to the tip or the longest travel, G the growth of the part (100 urad, 30 um, 1 m: 8 nm).
/// @return (6 x sources) [tip mm | axis rad]
/// @throws std::out_of_range where a table that refuses is left
Eigen::Matrix<double, 6, Eigen::Dynamic> shares(const IdleMachine& idle,
                                                const std::vector<ErrorSource>& sources,
                                                const kinematics::AxisState& state);

}  // namespace abbe::sim
