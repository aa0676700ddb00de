#include "sim/scene/read_scene.h"

#include <algorithm>
#include <array>
#include <sstream>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/escape.h"
#include "kinematics/units.h"
#include "sim/scene/case_folders.h"
#include "sim/scene/part_materials.h"
#include "sim/scene/scene_fields.h"
#include "sim/scene/scene_names.h"
#include "sim/scene/scene_sections.h"
#include "sim/scene/scene_tools.h"
#include "sim/scene/scene_tree.h"

namespace abbe::sim {

namespace {

// What several tools do not go with.
void check_several_tools(TableReader& scene, const Scene& result) {
  if (result.more_tools.empty()) return;
  const auto refuse = [&](const Node* section, const char* key, const std::string& expected) {
    const Node* node = section && key ? section->find(key) : section;
    if (node)
      scene.faults().add(node->place, expected,
                         fmt::format("{} tools", 1 + result.more_tools.size()));
  };
  refuse(scene.know("cutting"), nullptr,
         "one tool beside [cutting], which follows the stock and the force of one");
  refuse(scene.know("program"), "generator",
         "one tool for a generator; several want a program file");
  refuse(scene.know("control"), "tool_length_mm",
         "one tool beside it; of several, actual.length_mm says what each is wrong by");
}

// A tool table has tools by their numbers, and the length that the control believes.
void check_tool_table(TableReader& scene, const Scene& result) {
  const Node* program = scene.know("program");
  const Node* tools = program ? program->find("tools") : nullptr;
  if (!tools || !result.program.tools) return;
  for (const ToolDescription& tool : tools_of(result))
    if (!tool.number)
      scene.faults().add(tools->place, "tool.number of every tool, by which a tool table has it",
                         "a tool without");
  const Node* control = scene.know("control");
  const Node* length = control ? control->find("tool_length_mm") : nullptr;
  if (length)
    scene.faults().add(length->place, "either it or program.tools, which has every length", "both");
}

// What tool, part and program ask of each other; the loop could report it too, but not where it
// stands.
void check_together(TableReader& scene, const Scene& result) {
  const Node* program = scene.know("program");
  const Node* generator = program ? program->find("generator") : nullptr;
  const Node* tool = scene.know("tool");
  const bool turning = std::holds_alternative<cutting::Nose>(result.tool.nominal);
  const auto& joints = result.machine.joints;
  if (turning && tool && !joints.empty() &&
      (joints.front().name != 'S' || joints.front().motion != kinematics::Motion::Rotary)) {
    scene.faults().add(tool->place, "a milling cutter, or a machine with the spindle S' next to w",
                       "a turning tool");
  }
  check_several_tools(scene, result);
  check_tool_table(scene, result);
  if (!generator) return;
  const auto* primitive = std::get_if<cutting::Primitive>(&result.part.shape);
  const auto wants = [&](bool fits, const char* expected) {
    if (!fits) scene.faults().add(generator->place, expected, shown(*generator));
  };
  if (std::holds_alternative<program::Spiral>(result.program.source)) {
    wants(turning, "a turning tool for this generator");
    wants(primitive && !std::holds_alternative<cutting::RectanglePlane>(*primitive),
          "a declared surface of revolution for this generator");
  } else {
    wants(!turning, "a milling cutter for this generator");
  }
  if (std::holds_alternative<program::Flank>(result.program.source)) {
    wants(primitive && std::holds_alternative<cutting::Cone>(*primitive),
          "a cone as the part of this generator");
  }
}

Scene interpreted(const Node& tree, const std::filesystem::path& file, Faults& faults) {
  TableReader reader(tree, "", faults);
  Scene scene;
  scene.file = file;
  scene.title = file.stem().string();
  scene = title_scene_fields().read(reader, std::move(scene));
  const std::size_t before = faults.list().size();
  scene = cutting_scene_fields().read(reader, std::move(scene));
  if (faults.list().size() == before) check_together(reader, scene);
  scene = judging_scene_fields().read(reader, std::move(scene));
  if (faults.list().size() == before) check_beliefs(scene, scene.cases, reader);
  scene.variants = read_variants(reader);
  reader.close();
  return scene;
}

// A variant that cannot be read, or whose cases have no folder of their own, is refused with the
// scene, not an hour later when its turn comes.
void check_variants(const Scene& scene, const Node& tree, Faults& faults) {
  const std::filesystem::path& file = scene.file;
  ComparedNames names{scene.cases, {}};
  const Node* list = tree.find("variant");
  for (std::size_t i = 0; list && list->array() && i < list->array()->size(); ++i) {
    const Node* set = (*list->array())[i].find("set");
    if (!set || !set->table()) continue;
    const Scene variant =
        interpreted(changed(tree, changes_of_set(*set), file.parent_path(), faults), file, faults);
    names.variants.push_back({scene.variants[i].name, variant.cases});
  }
  if (faults.empty()) check_case_folders(tree, names, faults);
}

}  // namespace

bool names_a_folder(const std::string& name) {
  return !name.empty() && name.size() <= 80 && name.front() != '.' && escaped(name) == name &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return c >= 0x80 || std::isalnum(c) || c == '_' || c == '-' || c == '.' || c == ' ';
         });
}

Scene read_scene(const std::filesystem::path& file, const std::vector<Override>& overrides) {
  Faults faults;
  const std::optional<Node> as_written = read_tree(file, faults);
  if (!as_written) throw BadScene(faults.list());
  if (as_written->find("scene") && !as_written->find("machine"))
    throw BadScene({BadInput(file.string(), 0, 0, "a scene, which names its machine in `machine`",
                             "a study, which abbe study takes")});
  Scene scene = scene_of_tree(*as_written, file, overrides, std::move(faults));
  Named named = named_by(*scene.tree, file);
  scene.files = std::move(named.files);
  for (std::filesystem::path& file : material_files(scene.part))
    scene.files.push_back(std::filesystem::absolute(file).lexically_normal());
  scene.programs = std::move(named.programs);
  return scene;
}

Scene scene_of_tree(const Node& as_written, const std::filesystem::path& file,
                    const std::vector<Override>& overrides, Faults faults) {
  Node tree = changed(as_written, overrides, file.parent_path(), faults);
  Scene scene = interpreted(tree, file, faults);
  if (faults.empty()) check_variants(scene, tree, faults);
  if (!faults.empty()) throw BadScene(faults.list());
  Node bare = tree;
  std::erase_if(*bare.table(), [](const Node::Entry& entry) { return entry.key == "case"; });
  scene.resolved = to_toml(bare);
  scene.tree = std::make_shared<const Node>(std::move(tree));
  return scene;
}

}  // namespace abbe::sim
