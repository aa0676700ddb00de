#include "sim/scene/part_materials.h"

#include <algorithm>
#include <variant>

#include "cutting/mesh_words.h"
#include "cutting/read_obj.h"

namespace abbe::sim {

std::vector<std::filesystem::path> material_files(const PartDescription& part) {
  const auto* mesh = std::get_if<MeshFile>(&part.shape);
  const bool asks = std::ranges::any_of(
      part.regions, [](const PartRegion& region) { return region.colour.has_value(); });
  if (mesh == nullptr || !asks || cutting::lower(mesh->file.extension().string()) != ".obj")
    return {};
  return cutting::material_files(mesh->file);
}

}  // namespace abbe::sim
