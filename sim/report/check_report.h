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

/// Summary of a scene after it was read: the contents of `abbe check`.
struct Description {
  std::string scene, machine;
  std::string structural_code;
  kinematics::BodyArray bodies;
  std::vector<kinematics::Joint> axes;

  /// An error motion at the zero of its axis, mm or rad.
  struct Element {
    errors::ElementName name;
    bool is_on_slide = true;      ///< the axis is a slide: the slope is per mm, else per rad
    std::optional<double> value;  ///< empty if a table does not contain zero
    std::optional<double> slope;  ///< the same; also empty for a location element
    std::string stated_at;        ///< line on which it was measured; empty for a location element
    std::optional<LocationEffect> location;  ///< of a location element
    std::vector<std::string> curves;         ///< names of its curves
  };
  std::vector<Element> elements;

  struct Heat {
    std::size_t nodes = 0, links = 0, sources = 0;
    double shortest_time_constant_s = 0.0, longest_time_constant_s = 0.0;
    double history_h = 0.0;  ///< duration of the temperature history before the program
    struct Element {
      std::string name;
      std::vector<std::string> nodes;  ///< nodes whose temperatures it depends on, or "node - node"
      std::string meaning;             ///< for a location element only
      std::string feedback;            ///< for the expansion of an axis only
    };
    std::vector<Element> elements;
    struct Sensor {
      std::string name, node;
    };
    std::vector<Sensor> sensors;
  };
  std::optional<Heat> heat;

  /// Stiffness at the tip along the axes of frame t at the middle sample of the program; empty for
  /// a rigid machine, and for each direction that is rigid.
  std::optional<std::array<std::optional<double>, 3>> stiffness_N_per_um;

  /// The program cut on the error-free machine.
  struct NominalCut {
    std::optional<cutting::CuttingCoefficients> material;  ///< empty if no forces are computed
    double spacing = 0.0;                                  ///< mm, of the stock's grid
    std::size_t steps = 0;
    ProcessTotals totals;
    std::vector<int> crash_lines;
  };
  std::optional<NominalCut> cut;

  struct Part {
    std::string name;
    Eigen::Index vertices = 0, triangles = 0;
    double area = 0.0;         ///< mm^2
    double facet_error = 0.0;  ///< mm, largest deviation of a facet from the exact surface
    std::vector<RegionCoverage> regions;
  } part;
  struct Program {
    int moves = 0;
    std::size_t samples = 0;
    double time_s = 0.0;
    std::string unreached_moves;  ///< message on moves outside the travel of the machine; empty if
                                  ///< there are none
    std::string dialect;          ///< dialect of the file, and how it was recognised
  } program;
  /// Segment of the program that one of several tools cuts.
  struct ToolSegment {
    int tool = 0;  ///< tool number
    std::string name;
    int first_line = 0, last_line = 0;  ///< of blocks with a move
    int moves = 0;
  };
  std::vector<ToolSegment> tool_segments;  ///< in the order of the program; empty with one tool
  std::vector<std::string> warnings;
  std::vector<program::Assumption> assumptions;  ///< that the reader of the program made about the
                                                 ///< control
  std::vector<std::string> files;  ///< files that the scene reads; library files by their names in
                                   ///< the library
  std::optional<std::vector<ProgramTrust>> programs;  ///< programs that the scene names, if
                                                      ///< requested
};

/// Returns the description of a job; `programs` stays empty.
Description describe(const Job& job);

/// Returns the output of `abbe check --json`. Units are mm, um, deg and urad; the key of each value
/// names its unit.
nlohmann::ordered_json to_json(const Description& description);

/// Returns the output of `abbe check` as text.
std::string to_text(const Description& description);

}  // namespace abbe::sim
