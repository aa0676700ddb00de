#pragma once

#include <optional>
#include <variant>
#include <vector>

#include "cutting/stock/force.h"
#include "cutting/stock/stock.h"
#include "sim/scene/bodies.h"
#include "sim/scene/toml.h"
#include "sim/scene/tool.h"

namespace abbe::sim {

/// The blank, the cutting forces and the resolution of the cutting simulation.
struct CuttingDescription {
  struct OffsetBlank {       ///< of a milled design, raised along its normals
    double allowance = 0.0;  ///< mm
    double floor = 0.0;      ///< mm, z of the lower end in the part frame
  };
  struct TurnedBlank {  ///< radius over the spindle line, from the origin of the part
    Eigen::Matrix<double, Eigen::Dynamic, 2> profile;  ///< (n x 2) mm: along, radius
  };
  using Blank =
      std::variant<cutting::BoxBlank, cutting::CylinderBlank, OffsetBlank, MeshFile, TurnedBlank>;
  Blank blank;           ///< in the part frame
  double spacing = 0.5;  ///< mm, of dexels; of a turned blank along the line
  bool three_directions = true;
  std::size_t max_bytes = std::size_t(2) << 30;
  std::optional<cutting::CuttingCoefficients> material;  ///< none: material removal only, without
                                                         ///< forces
  cutting::Flutes flutes;
  double step = 0.5;        ///< mm of tip travel between two evaluations of the engagement
                            ///< (milling)
  double tolerance = 1e-6;  ///< mm, tolerance to which deflection and force agree
  int max_iterations = 30;  ///< per step
  double rest = 0.05;       ///< mm; a part with more material left than this is a finding
  double gouge = 0.05;      ///< mm; a deeper cut into the part than this is a finding
};

struct Key;

/// Reads and writes `[material]`, cutting coefficients with their source.
cutting::CuttingCoefficients read_material(const Node& table, InputErrors& input_errors);
Node::Table written_material(const cutting::CuttingCoefficients& material);
std::vector<Key> material_keys();

/// Reads and writes `[cutting]`: blank, flutes and resolution; the material is a separate section.
CuttingDescription read_cutting(const Node& table, const ToolDescription& tool,
                                InputErrors& input_errors);
Node::Table written_cutting(const CuttingDescription& cutting, const ToolDescription& tool);
std::vector<Key> cutting_keys();

}  // namespace abbe::sim
