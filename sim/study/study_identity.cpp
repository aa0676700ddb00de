#include "sim/study/study_identity.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/hash.h"
#include "kinematics/text.h"
#include "sim/files/program_file.h"
#include "sim/files/versions.h"
#include "sim/scene/case_name.h"
#include "sim/scene/part_materials.h"
#include "sim/scene/scene_tree.h"

namespace abbe::sim::study {
namespace {

std::uint64_t hash_of_file(const std::filesystem::path& file, std::uint64_t hash);

/// Of every data file that a tree names: another mesh under the old name is another study.
std::uint64_t hash_of_files(const Node& node, std::uint64_t hash) {
  if (const Node::Array* array = node.array())
    for (const Node& one : *array) hash = hash_of_files(one, hash);
  if (const Node::Table* table = node.table())
    for (const Node::Entry& entry : *table) {
      const std::string* name = entry.node.text();
      std::error_code failure;
      if (entry.key == "file" && name && std::filesystem::is_regular_file(*name, failure))
        hash = hash_of_file(*name, hash);
      else
        hash = hash_of_files(entry.node, hash);
    }
  return hash;
}

std::uint64_t hash_of_file(const std::filesystem::path& file, std::uint64_t hash) {
  hash = fnv_1a(read_text(file, std::size_t(1) << 31), hash);
  if (file.extension() != ".toml") return hash;
  Faults ignored;  // another scene, from which something is learnt: reported when it is used
  const std::optional<Node> tree = read_tree(file, ignored);
  return tree ? hash_of_files(*tree, fnv_1a(to_toml(*tree), hash)) : hash;
}

/// This very build: another one may give other bits.
std::string program() {
  const std::filesystem::path self = program_file();
  std::error_code failure;
  const bool known = std::filesystem::is_regular_file(self, failure);
  return versions().dump() +
         (known ? std::to_string(fnv_1a(read_text(self, std::size_t(1) << 31))) : "");
}

std::string identity_of_scene(const Scene& scene) {
  std::uint64_t files = hash_of_files(parse_toml(scene.resolved, "scene"), 0);
  for (const std::filesystem::path& file : material_files(scene.part))
    files = hash_of_file(file, files);
  return scene.resolved + std::to_string(files);
}

}  // namespace

std::string identity_of(const Study& study, const std::vector<Scene>& scenes) {
  std::string all = study.text + program();
  for (const Scene& scene : scenes) all += identity_of_scene(scene);
  for (const Arm& arm : study.arms) {
    if (arm.case_name == "uncompensated") continue;
    const std::filesystem::path plug_in = parse_case(arm.case_name).plug_in;
    if (!plug_in.empty()) all += std::to_string(hash_of_file(plug_in, fnv_1a_basis));
  }
  return fmt::format("{:016x}", fnv_1a(all));
}

}  // namespace abbe::sim::study
