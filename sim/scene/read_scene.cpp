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
  explicit NameCollector(Named& named) : named_(named) {}

  void add_scene(const Node& tree, const path& file) {
    add_file(file);
    add_tree(tree);
    for (const Node* variant : tables(tree.find("variant"))) {
      const Node* set = variant->find("set");
      if (!set || !set->table()) continue;
      // The variant is read again with its errors when the scene is checked.
      InputErrors reported_already;
      add_tree(changed(tree, changes_from_set(*set), file.parent_path(), reported_already));
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
    // The training scene lies deep in the belief; every step may be missing.
    const Node* at = &tree;
    for (const char* key : {"belief", "force", "training", "file"})
      at = at ? at->find(key) : nullptr;
    if (at && at->text()) add_training(plain(*at->text()));
  }

  /// Adds the files from which nodes come, and the files that they name.
  void add_places(const Node& node) {
    // Values typed by the user have no file.
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
    // Several variants name the same program at the same position, which counts once.
    const bool known = std::ranges::any_of(named_.programs, [&](const NamedProgram& one) {
      return one.program == program->program && one.file == program->file &&
             one.line == program->line && one.column == program->column;
    });
    if (!known) named_.programs.push_back(*program);
  }

  void add_training(const path& file) {
    // Training scenes may refer to each other, so each is read once.
    if (!trainings_.insert(file).second) return;
    // Errors of a training scene are reported when it is used.
    InputErrors reported_when_used;
    if (const auto tree = read_tree(file, reported_when_used)) add_scene(*tree, file);
  }

  void add_file(const path& file) {
    if (file.empty()) return;
    const path one = plain(file);
    if (std::ranges::find(named_.files, one) == named_.files.end()) named_.files.push_back(one);
  }

  Named& named_;
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
    return std::nullopt;  // rejected by the reader
  }
}

Named collect_named_files(const Node& tree, const path& file) {
  Named named;
  NameCollector(named).add_scene(tree, file);
  return named;
}

namespace {

// Rejects sections that do not work with several tools.
void check_several_tools(TableReader& scene, const Scene& result) {
  if (result.additional_tools.empty()) return;
  const auto refuse = [&](const Node* section, const char* key, const std::string& expected) {
    const Node* node = section && key ? section->find(key) : section;
    if (node)
      scene.input_errors().add(node->place, expected,
                               fmt::format("{} tools", 1 + result.additional_tools.size()));
  };
  refuse(scene.accept_key("cutting"), nullptr,
         "one tool beside [cutting], which follows the stock and the force of one");
  refuse(scene.accept_key("program"), "generator",
         "one tool for a generator; several want a program file");
  refuse(scene.accept_key("control"), "tool_length_mm",
         "one tool beside it; of several, actual.length_mm says what each is wrong by");
}

// Checks the tools against a tool table, which lists tools by number with the length that the
// control believes.
void check_tool_table(TableReader& scene, const Scene& result) {
  const Node* program = scene.accept_key("program");
  const Node* tools = program ? program->find("tools") : nullptr;
  if (!tools || !result.program.tools) return;
  for (const ToolDescription& tool : all_tools(result))
    // Without a number a tool cannot be found in the table.
    if (!tool.number)
      scene.input_errors().add(tools->place,
                               "tool.number of every tool, by which a tool table has it",
                               "a tool without");
  const Node* control = scene.accept_key("control");
  const Node* length = control ? control->find("tool_length_mm") : nullptr;
  if (length)
    scene.input_errors().add(length->place, "either it or program.tools, which has every length",
                             "both");
}

// Checks the requirements between tool, part and program. The simulation would report them too, but
// without a position in the scene.
void check_consistency(TableReader& scene, const Scene& result) {
  const Node* program = scene.accept_key("program");
  const Node* generator = program ? program->find("generator") : nullptr;
  const Node* tool = scene.accept_key("tool");
  const bool turning = std::holds_alternative<cutting::Nose>(result.tool.nominal);
  const auto& joints = result.machine.joints;
  // A turning tool cuts only if the workpiece spins, so the chain must begin with that spindle.
  if (turning && tool && !joints.empty() &&
      (joints.front().name != 'S' || joints.front().motion != kinematics::Motion::Rotary)) {
    scene.input_errors().add(tool->place,
                             "a milling cutter, or a machine with the spindle S' next to w",
                             "a turning tool");
  }
  check_several_tools(scene, result);
  check_tool_table(scene, result);
  // A program file makes no assumptions about the shape of the part.
  if (!generator) return;
  const auto* primitive = std::get_if<cutting::Primitive>(&result.part.shape);
  const auto wants = [&](bool fits, const char* expected) {
    if (!fits) scene.input_errors().add(generator->place, expected, shown(*generator));
  };
  if (std::holds_alternative<program::Spiral>(result.program.source)) {
    wants(turning, "a turning tool for this generator");
    // The spiral follows a profile about z, which a rectangle does not have.
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

// Rejects a case whose belief the scene does not state, or whose sensors the scene lacks.
void check_beliefs(const Scene& scene, const std::vector<CaseDescription>& cases,
                   TableReader& reader) {
  using Belief = CaseDescription::Belief;
  using From = BeliefDescription::Force::From;
  const BeliefDescription& given = scene.belief;
  for (const CaseDescription& one : cases) {
    // A plug-in has beliefs of its own.
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
    // The probe would measure the part relative to a machine that the other beliefs do not correct.
    if (one.belief == Belief::Fused && probes && (given.identified || given.thermal))
      reader.refuse("compare",
                    "a part measured apart (cmm) for " + one.name +
                        ": a probe on the machine that nothing corrects would undo the rest",
                    "a touch probe");
    const bool feels = given.force && (one.belief == Belief::Force || one.belief == Belief::Fused);
    if (!feels) continue;
    const bool cuts = scene.cutting && scene.cutting->material;
    if (!cuts) reader.refuse("compare", "[cutting] with a material for " + one.name, "none");
    // The signals are simulated only if the scene describes their sensors.
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
  // Consistency is checked only for sections without errors, as their defaults would give
  // misleading messages.
  if (input_errors.list().size() == before) check_consistency(reader, scene);
  scene = judging_scene_fields().read(reader, std::move(scene));
  if (input_errors.list().size() == before) check_beliefs(scene, scene.cases, reader);
  scene.variants = read_variants(reader);
  reader.close();
  return scene;
}

// Checks all variants with the scene itself. A variant that cannot be read, or whose cases share a
// folder, is rejected at once and not an hour later during the comparison.
void check_variants(const Scene& scene, const Node& tree, InputErrors& input_errors) {
  const std::filesystem::path& file = scene.file;
  ComparedNames names{scene.cases, {}};
  const Node* list = tree.find("variant");
  for (std::size_t i = 0; list && list->array() && i < list->array()->size(); ++i) {
    const Node* set = (*list->array())[i].find("set");
    if (!set || !set->table()) continue;
    const Scene variant =
        interpreted(changed(tree, changes_from_set(*set), file.parent_path(), input_errors), file,
                    input_errors);
    names.variants.push_back({scene.variants[i].name, variant.cases});
  }
  if (input_errors.empty()) check_case_folders(tree, names, input_errors);
}

}  // namespace

Scene read_scene(const std::filesystem::path& file, const std::vector<Override>& overrides) {
  InputErrors input_errors;
  const std::optional<Node> as_written = read_tree(file, input_errors);
  if (!as_written) throw BadScene(input_errors.list());
  // A study names its scene in `scene`, so it gets a specific message.
  if (as_written->find("scene") && !as_written->find("machine"))
    throw BadScene({BadInput(file.string(), 0, 0, "a scene, which names its machine in `machine`",
                             "a study, which abbe study takes")});
  Scene scene = scene_from_tree(*as_written, file, overrides, std::move(input_errors));
  Named named = collect_named_files(*scene.tree, file);
  scene.files = std::move(named.files);
  // The mesh and not the scene names these files.
  for (std::filesystem::path& file : material_files(scene.part))
    scene.files.push_back(std::filesystem::absolute(file).lexically_normal());
  scene.programs = std::move(named.programs);
  return scene;
}

Scene scene_from_tree(const Node& as_written, const std::filesystem::path& file,
                      const std::vector<Override>& overrides, InputErrors input_errors) {
  Node tree = changed(as_written, overrides, file.parent_path(), input_errors);
  Scene scene = interpreted(tree, file, input_errors);
  if (input_errors.empty()) check_variants(scene, tree, input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  Node bare = tree;
  // The case belongs to one run, whereas the resolved scene serves all cases of a comparison.
  std::erase_if(*bare.table(), [](const Node::Entry& entry) { return entry.key == "case"; });
  scene.resolved = to_toml(bare);
  scene.tree = std::make_shared<const Node>(std::move(tree));
  return scene;
}

}  // namespace abbe::sim
