#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/cut/cut.h"
#include "sim/cut/part_regions.h"
#include "sim/machine/machine.h"
#include "sim/scene/trust.h"

namespace abbe::sim {

/// How a scene was understood: what `abbe check` says of it.
struct Description {
  std::string scene, machine;
  std::string structural_code;
  kinematics::BodyArray bodies;
  std::vector<kinematics::Joint> axes;

  /// An element with its axis at zero, mm or rad.
  struct Element {
    errors::ElementName name;
    bool is_on_slide = true;      ///< the axis is one: the slope is per mm, not per rad
    std::optional<double> value;  ///< none where a table does not reach zero
    std::optional<double> slope;  ///< the same; not of a location element
    std::string stated_at;        ///< the line on which it was measured; not of a location element
    std::optional<LocationEffect> location;
    std::vector<std::string> parts;  ///< names of its curves
  };
  std::vector<Element> elements;

  struct Heat {
    std::size_t nodes = 0, links = 0, sources = 0;
    double shortest_time_constant_s = 0.0, longest_time_constant_s = 0.0;
    double history_h = 0.0;  ///< before the program
    struct Element {
      std::string name;
      std::vector<std::string> follows;  ///< nodes, or "node - node"
      std::string meaning;               ///< of a location element alone
      std::string feedback;              ///< of the expansion of an axis alone
    };
    std::vector<Element> elements;
    struct Sensor {
      std::string name, node;
    };
    std::vector<Sensor> sensors;
  };
  std::optional<Heat> heat;

  /// At the tip along the axes of frame t, half way through the program; none where nothing
  /// gives way.
  std::optional<std::array<std::optional<double>, 3>> stiffness_N_per_um;

  /// The cut of the nominal machine.
  struct NominalCut {
    std::optional<cutting::CuttingCoefficients> material;  ///< none: the stock alone is followed
    double spacing = 0.0;                                  ///< mm, of the stock
    std::size_t steps = 0;
    ProcessTotals totals;
    std::vector<int> crash_lines;
  };
  std::optional<NominalCut> cut;

  struct Part {
    std::string name;
    Eigen::Index vertices = 0, triangles = 0;
    double area = 0.0;         ///< mm^2
    double facet_error = 0.0;  ///< mm, the largest
    std::vector<RegionCoverage> regions;
  } part;
  struct Program {
    int moves = 0;
    std::size_t samples = 0;
    double time_s = 0.0;
    std::string unreached_moves;  ///< what the machine does not reach of it; or empty
    std::string read_as;          ///< dialect of a file, and by which sign
  } program;
  /// What one of several tools runs, in the order of the program; empty with one tool.
  struct Stretch {
    int tool = 0;  ///< its number
    std::string name;
    int first_line = 0, last_line = 0;  ///< of blocks that move
    int moves = 0;
  };
  std::vector<Stretch> stretches;
  std::vector<std::string> warnings;
  std::vector<program::Assumption> assumptions;  ///< about the control, of the program's reader
  std::vector<std::string> files;  ///< that the scene reads; of the library by their name in it
  std::optional<std::vector<ProgramTrust>> programs;  ///< that the scene names, if asked for
};

/// All but `programs`.
Description describe(const Job& job);

/// What `abbe check --json` prints; lengths in mm and um, angles in deg and urad, as keys say.
nlohmann::ordered_json to_json(const Description& description);

/// The same as text for people.
std::string to_text(const Description& description);

}  // namespace abbe::sim
