#include "sim/scene/read_scene.h"

#include <algorithm>
#include <array>
#include <set>
#include <sstream>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/scene/cases.h"
#include "sim/scene/document.h"
#include "sim/scene/fields.h"
#include "sim/scene/part.h"
#include "sim/scene/scene.h"
#include "sim/scene/scene_fields.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

namespace {

using std::filesystem::path;

path plain(const path& file) { return std::filesystem::absolute(file).lexically_normal(); }

class NameCollector {
 public:
  explicit NameCollector(NamedFiles& named) : named_(named) {}

  void add_scene(const Node& tree, const path& file) {
    add_file(file);
    add_tree(tree);
    for (const Node* variant : tables(tree.find("variant"))) {
      const Node* set = variant->find("set");
      if (!set || !set->table()) continue;
      InputErrors reported_already;
      add_tree(changed(tree, set_changes(*set), file.parent_path(), reported_already));
    }
  }

 private:
  static std::vector<const Node*> tables(const Node* list) {
    if (!list) return {};
    if (list->table()) return {list};
    std::vector<const Node*> all;
    if (!list->array()) return all;
    for (const Node& one : *list->array())
      if (one.table()) all.push_back(&one);
    return all;
  }

  void add_tree(const Node& tree) {
    add_places(tree);
    add_program(tree.find("case"));
    if (const Node* compare = tree.find("compare"))
      if (const Node* cases = compare->find("cases"); cases && cases->array())
        for (const Node& one : *cases->array()) add_program(&one);
    for (const Node* instrument : tables(tree.find("instrument")))
      add_program(instrument->find("case"));
    const Node* at = &tree;
    for (const char* key : {"belief", "force", "training", "file"})
      at = at ? at->find(key) : nullptr;
    if (at && at->text()) add_training(plain(*at->text()));
  }

  /// The files from which nodes come, and those that they name.
  void add_places(const Node& node) {
    if (node.place.file && !node.place.typed && seen_.insert(*node.place.file).second)
      add_file(*node.place.file);
    if (const Node::Array* array = node.array())
      for (const Node& one : *array) add_places(one);
    if (const Node::Table* table = node.table())
      for (const Node::Entry& entry : *table) {
        if (entry.key == "file" && entry.node.text()) add_file(*entry.node.text());
        add_places(entry.node);
      }
  }

  void add_program(const Node* text) {
    const auto program = text ? named_program(*text) : std::nullopt;
    if (!program) return;
    add_file(program->program);
    const bool known = std::ranges::any_of(named_.programs, [&](const NamedProgram& one) {
      return one.program == program->program && one.file == program->file &&
             one.line == program->line && one.column == program->column;
    });
    if (!known) named_.programs.push_back(*program);
  }

  void add_training(const path& file) {
    if (!trainings_.insert(file).second) return;
    InputErrors reported_when_used;
    if (const auto tree = read_tree(file, reported_when_used)) add_scene(*tree, file);
  }

  void add_file(const path& file) {
    if (file.empty()) return;
    const path one = plain(file);
    if (std::ranges::find(named_.files, one) == named_.files.end()) named_.files.push_back(one);
  }

  NamedFiles& named_;
  std::set<std::string> seen_;
  std::set<path> trainings_;
};

}  // namespace

std::optional<NamedProgram> named_program(const Node& node) {
  const std::string* text = node.text();
  if (!text || text->find_first_of("./") == std::string::npos) return std::nullopt;
  try {
    return NamedProgram{plug_in_case(*text).plug_in, node.place.file ? *node.place.file : "",
                        node.place.line, node.place.column, node.place.typed};
  } catch (const std::invalid_argument&) {
    return std::nullopt;  // refused by the reader
  }
}

NamedFiles collect_named_files(const Node& tree, const path& file) {
  NamedFiles named;
  NameCollector(named).add_scene(tree, file);
  return named;
}

namespace {

// What several tools do not go with.
void check_several_tools(TableReader& scene, const Scene& result) {
  if (result.more_tools.empty()) return;
  const auto refuse = [&](const Node* section, const char* key, const std::string& expected) {
    const Node* node = section && key ? section->find(key) : section;
    if (node)
      scene.input_errors().add(node->place, expected,
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
      scene.input_errors().add(tools->place,
                               "tool.number of every tool, by which a tool table has it",
                               "a tool without");
  const Node* control = scene.know("control");
  const Node* length = control ? control->find("tool_length_mm") : nullptr;
  if (length)
    scene.input_errors().add(length->place, "either it or program.tools, which has every length",
                             "both");
}

// What tool, part and program ask of each other; the loop could report it too, but not where it
// stands.
void check_consistency(TableReader& scene, const Scene& result) {
  const Node* program = scene.know("program");
  const Node* generator = program ? program->find("generator") : nullptr;
  const Node* tool = scene.know("tool");
  const bool turning = std::holds_alternative<cutting::Nose>(result.tool.nominal);
  const auto& joints = result.machine.joints;
  if (turning && tool && !joints.empty() &&
      (joints.front().name != 'S' || joints.front().motion != kinematics::Motion::Rotary)) {
    scene.input_errors().add(tool->place,
                             "a milling cutter, or a machine with the spindle S' next to w",
                             "a turning tool");
  }
  check_several_tools(scene, result);
  check_tool_table(scene, result);
  if (!generator) return;
  const auto* primitive = std::get_if<cutting::Primitive>(&result.part.shape);
  const auto wants = [&](bool fits, const char* expected) {
    if (!fits) scene.input_errors().add(generator->place, expected, shown(*generator));
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

// Refuses a case whose belief the scene does not give, or cannot have from its sensors.
void check_beliefs(const Scene& scene, const std::vector<CaseDescription>& cases,
                   TableReader& reader) {
  using Belief = CaseDescription::Belief;
  using From = BeliefDescription::Force::From;
  const BeliefDescription& given = scene.belief;
  for (const CaseDescription& one : cases) {
    if (!one.plug_in.empty()) continue;
    const auto wants = [&](Belief kind, bool is, const char* what) {
      const bool named =
          one.belief == kind || (one.belief == Belief::Composite &&
                                 (kind == Belief::Identified || kind == Belief::Thermal));
      if (named && !is) reader.refuse("compare", fmt::format("{} for {}", what, one.name), "none");
    };
    wants(Belief::Identified, given.identified.has_value(), "belief.identified");
    wants(Belief::Thermal, given.thermal.has_value(), "[belief.thermal]");
    wants(Belief::Force, given.force.has_value(), "[belief.force]");
    wants(Belief::Part, given.part.has_value(), "[belief.part]");
    wants(Belief::Fused, given.identified || given.thermal || given.force || given.part,
          "something in [belief]");
    const bool probes =
        given.part &&
        std::any_of(scene.part_instruments.begin(), scene.part_instruments.end(),
                    [&](const PartInstrumentDescription& instrument) {
                      return instrument.name == given.part->instrument &&
                             std::holds_alternative<errors::metrology::TouchProbe>(instrument.how);
                    });
    if (one.belief == Belief::Fused && probes && (given.identified || given.thermal))
      reader.refuse("compare",
                    "a part measured apart (cmm) for " + one.name +
                        ": a probe on the machine that nothing corrects would undo the rest",
                    "a touch probe");
    const bool feels = given.force && (one.belief == Belief::Force || one.belief == Belief::Fused);
    if (!feels) continue;
    const bool cuts = scene.cutting && scene.cutting->material;
    if (!cuts) reader.refuse("compare", "[cutting] with a material for " + one.name, "none");
    if (given.force->from == From::Current && !scene.signals.current)
      reader.refuse("compare", "[signals.current] for " + one.name, "none");
    if (given.force->from == From::Dynamometer && !scene.signals.dynamometer)
      reader.refuse("compare", "[signals.dynamometer] for " + one.name, "none");
  }
}

Scene interpreted(const Node& tree, const std::filesystem::path& file, InputErrors& input_errors) {
  TableReader reader(tree, "", input_errors);
  Scene scene;
  scene.file = file;
  scene.title = file.stem().string();
  scene = title_scene_fields().read(reader, std::move(scene));
  const std::size_t before = input_errors.list().size();
  scene = cutting_scene_fields().read(reader, std::move(scene));
  if (input_errors.list().size() == before) check_consistency(reader, scene);
  scene = judging_scene_fields().read(reader, std::move(scene));
  if (input_errors.list().size() == before) check_beliefs(scene, scene.cases, reader);
  scene.variants = read_variants(reader);
  reader.close();
  return scene;
}

// A variant that cannot be read, or whose cases have no folder of their own, is refused with the
// scene, not an hour later when its turn comes.
void check_variants(const Scene& scene, const Node& tree, InputErrors& input_errors) {
  const std::filesystem::path& file = scene.file;
  ComparedNames names{scene.cases, {}};
  const Node* list = tree.find("variant");
  for (std::size_t i = 0; list && list->array() && i < list->array()->size(); ++i) {
    const Node* set = (*list->array())[i].find("set");
    if (!set || !set->table()) continue;
    const Scene variant = interpreted(
        changed(tree, set_changes(*set), file.parent_path(), input_errors), file, input_errors);
    names.variants.push_back({scene.variants[i].name, variant.cases});
  }
  if (input_errors.empty()) check_case_folders(tree, names, input_errors);
}

}  // namespace

Scene read_scene(const std::filesystem::path& file, const std::vector<Override>& overrides) {
  InputErrors input_errors;
  const std::optional<Node> as_written = read_tree(file, input_errors);
  if (!as_written) throw BadScene(input_errors.list());
  if (as_written->find("scene") && !as_written->find("machine"))
    throw BadScene({BadInput(file.string(), 0, 0, "a scene, which names its machine in `machine`",
                             "a study, which abbe study takes")});
  Scene scene = build_scene(*as_written, file, overrides, std::move(input_errors));
  NamedFiles named = collect_named_files(*scene.tree, file);
  scene.files = std::move(named.files);
  for (std::filesystem::path& file : material_files(scene.part))
    scene.files.push_back(std::filesystem::absolute(file).lexically_normal());
  scene.programs = std::move(named.programs);
  return scene;
}

Scene build_scene(const Node& as_written, const std::filesystem::path& file,
                  const std::vector<Override>& overrides, InputErrors input_errors) {
  Node tree = changed(as_written, overrides, file.parent_path(), input_errors);
  Scene scene = interpreted(tree, file, input_errors);
  if (input_errors.empty()) check_variants(scene, tree, input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  Node bare = tree;
  std::erase_if(*bare.table(), [](const Node::Entry& entry) { return entry.key == "case"; });
  scene.resolved = to_toml(bare);
  scene.tree = std::make_shared<const Node>(std::move(tree));
  return scene;
}

}  // namespace abbe::sim
