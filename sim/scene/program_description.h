#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <variant>

#include "kinematics/chain.h"
#include "sim/program/generate.h"
#include "sim/program/nc.h"

namespace abbe::sim {

/// A program: a file, or a generator that writes one.
struct ProgramDescription {
  struct File {
    std::filesystem::path file;  ///< .ngc .nc .tap are NC, .csv .pvt are PVT
  };
  std::variant<File, program::Raster, program::Flank, program::Spiral> source;
  std::map<int, double> tool_length;  ///< mm by H number; H of the tool in use is there already
  std::array<kinematics::AxisVector, 6> work_offset{};
};

}  // namespace abbe::sim
