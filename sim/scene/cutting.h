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
  struct OffsetBlank {       ///< surface of a milled design, offset along its normals
    double allowance = 0.0;  ///< mm
    double floor = 0.0;      ///< mm, z of the lower end in the part frame
  };
  struct TurnedBlank {  ///< radius over the position on the spindle line
    Eigen::Matrix<double, Eigen::Dynamic, 2> profile;  ///< (n x 2) mm: position from the origin of
                                                       ///< the part, radius
  };
  using Blank =
      std::variant<cutting::BoxBlank, cutting::CylinderBlank, OffsetBlank, MeshFile, TurnedBlank>;
  Blank blank;                   ///< in the part frame
  double spacing = 0.5;          ///< mm, of dexels; of a turned blank along the spindle line
  bool three_directions = true;  ///< dexels along x, y and z; else along z only
  std::size_t max_bytes = std::size_t(2) << 30;
  std::optional<cutting::CuttingCoefficients> material;  ///< none: material removal only, without
                                                         ///< forces
  cutting::Flutes flutes;
  double step = 0.5;        ///< mm of tip travel between two evaluations of the engagement
                            ///< (milling)
  double tolerance = 1e-6;  ///< mm, to which deflection and force agree
  int max_iterations = 30;  ///< per step
  double rest = 0.05;       ///< mm; material left beyond this is reported as a finding
  double gouge = 0.05;      ///< mm; a cut into the part deeper than this is reported as a finding
};

struct Key;
template <typename T>
class Fields;

/// Returns the fields of the flutes of a milling cutter, and those of `[material]`.
const Fields<cutting::Flutes>& flutes_fields();
const Fields<cutting::CuttingCoefficients>& material_fields();

/// Reads and writes `[material]`, cutting coefficients with their source.
cutting::CuttingCoefficients read_material(const Node& table, InputErrors& input_errors);
Node::Table material_to_table(const cutting::CuttingCoefficients& material);
std::vector<Key> material_keys();

/// Reads and writes `[cutting]`: blank, flutes and resolution. The material has its own section.
CuttingDescription read_cutting(const Node& table, const ToolDescription& tool,
                                InputErrors& input_errors);
Node::Table cutting_to_table(const CuttingDescription& cutting, const ToolDescription& tool);
std::vector<Key> cutting_keys();

}  // namespace abbe::sim
