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

path absolute_path(const path& file) { return std::filesystem::absolute(file).lexically_normal(); }

/// Collects the files and programs that a scene and its training scenes name.
class NameCollector {
 public:
  explicit NameCollector(NamedFiles& named) : named_(named) {}

  void add_scene(const Node& tree, const path& file) {
    add_file(file);
    add_tree(tree);
    for (const Node* variant : tables(tree.find("variant"))) {
      const Node* set = variant->find("set");
      if (!set || !set->table()) continue;
      // Errors of a variant are reported by check_variants().
      InputErrors ignored_errors;
      add_tree(apply_changes(tree, changes_from_set(*set), file.parent_path(), ignored_errors));
    }
  }

 private:
  static std::vector<const Node*> tables(const Node* list) {
    if (!list) return {};
    if (list->table()) return {list};
    std::vector<const Node*> tables;
    if (!list->array()) return tables;
    for (const Node& element : *list->array())
      if (element.table()) tables.push_back(&element);
    return tables;
  }

  void add_tree(const Node& tree) {
    add_node_files(tree);
    add_program(tree.find("case"));
    if (const Node* compare = tree.find("compare"))
      if (const Node* cases = compare->find("cases"); cases && cases->array())
        for (const Node& name : *cases->array()) add_program(&name);
    for (const Node* instrument : tables(tree.find("instrument")))
      add_program(instrument->find("case"));
    const Node* node = &tree;
    for (const char* key : {"belief", "force", "training", "file"})
      node = node ? node->find(key) : nullptr;
    if (node && node->text()) add_training_scene(absolute_path(*node->text()));
  }

  /// Adds the files from which nodes were read, and the data files that they name.
  void add_node_files(const Node& node) {
    // Values from the command line have no file.
    if (node.position.file && !node.position.from_command_line &&
        source_files_.insert(*node.position.file).second)
      add_file(*node.position.file);
    if (const Node::Array* array = node.array())
      for (const Node& element : *array) add_node_files(element);
    if (const Node::Table* table = node.table())
      for (const Node::Entry& entry : *table) {
        if (entry.key == "file" && entry.node.text()) add_file(*entry.node.text());
        add_node_files(entry.node);
      }
  }

  void add_program(const Node* text) {
    const auto program = text ? named_program(*text) : std::nullopt;
    if (!program) return;
    add_file(program->program);
    // Every variant of the scene has the same program at the same position.
    const bool is_known = std::ranges::any_of(named_.programs, [&](const ProgramReference& other) {
      return other.program == program->program && other.file == program->file &&
             other.line == program->line && other.column == program->column;
    });
    if (!is_known) named_.programs.push_back(*program);
  }

  void add_training_scene(const path& file) {
    // Training scenes may name each other, which must not lead to endless recursion.
    if (!training_scenes_.insert(file).second) return;
    // Errors of a training scene are reported when it is used.
    InputErrors ignored_errors;
    if (const auto tree = read_tree(file, ignored_errors)) add_scene(*tree, file);
  }

  void add_file(const path& file) {
    if (file.empty()) return;
    const path absolute_file = absolute_path(file);
    if (std::ranges::find(named_.files, absolute_file) == named_.files.end())
      named_.files.push_back(absolute_file);
  }

  NamedFiles& named_;
  std::set<std::string> source_files_;
  std::set<path> training_scenes_;
};

}  // namespace

std::optional<ProgramReference> named_program(const Node& node) {
  const std::string* text = node.text();
  if (!text || text->find_first_of("./") == std::string::npos) return std::nullopt;
  try {
    return ProgramReference{plug_in_case(*text).plug_in,
                            node.position.file ? *node.position.file : "", node.position.line,
                            node.position.column, node.position.from_command_line};
  } catch (const std::invalid_argument&) {
    return std::nullopt;  // the reader of the cases reports the error
  }
}

NamedFiles collect_named_files(const Node& tree, const path& file) {
  NamedFiles named;
  NameCollector(named).add_scene(tree, file);
  return named;
}

namespace {

// Reports sections that do not work with several tools.
void check_several_tools(TableReader& reader, const Scene& scene) {
  if (scene.additional_tools.empty()) return;
  const auto report_if_present = [&](const Node* section, const char* key,
                                     const std::string& expected) {
    const Node* node = section ? section->find(key) : nullptr;
    if (node)
      reader.input_errors().add(node->position, expected,
                                fmt::format("{} tools", 1 + scene.additional_tools.size()));
  };
  report_if_present(reader.accept_key("program"), "generator",
                    "one tool for a generator; several tools need a program file");
  report_if_present(
      reader.accept_key("control"), "tool_length_mm",
      "one tool with tool_length_mm; with several, actual.length_mm states the error of each");
}

// Checks that the scene has the tool for which the tables of the control are made.
void check_tool_of_tables(TableReader& reader, const Scene& scene) {
  const std::optional<int>& number = scene.compensation.table.tool;
  if (!number || std::ranges::any_of(all_tools(scene), [&](const ToolDescription& tool) {
        return tool.number == number;
      }))
    return;
  const Node& table = *reader.accept_key("compensation")->find("table");
  reader.input_errors().add(table.find("tool")->position, "the tool.number of a tool of the scene",
                            std::to_string(*number));
}

// Checks that the tools can be used with a tool table, which has the lengths that the control
// believes, by tool number.
void check_tool_table(TableReader& reader, const Scene& scene) {
  const Node* program = reader.accept_key("program");
  const Node* tools = program ? program->find("tools") : nullptr;
  if (!tools || !scene.program.tools) return;
  for (const ToolDescription& tool : all_tools(scene))
    if (!tool.number)
      reader.input_errors().add(tools->position, "tool.number of every tool, as in the tool table",
                                "a tool without a number");
  const Node* control = reader.accept_key("control");
  const Node* length = control ? control->find("tool_length_mm") : nullptr;
  if (length)
    reader.input_errors().add(
        length->position, "either tool_length_mm or program.tools, which has every length", "both");
}

// Checks that a generator can make a program for the tool and the part.
void check_generator(const Node& generator, const Scene& scene, InputErrors& input_errors) {
  const bool is_turning = std::holds_alternative<cutting::Nose>(scene.tool.nominal);
  const auto* primitive = std::get_if<cutting::Primitive>(&scene.part.shape);
  const auto require = [&](bool condition, const char* expected) {
    if (!condition) input_errors.add(generator.position, expected, display_text(generator));
  };
  if (std::holds_alternative<program::Spiral>(scene.program.source)) {
    require(is_turning, "a turning tool for this generator");
    // The spiral follows a profile about z, which a rectangle does not have.
    require(primitive && !std::holds_alternative<cutting::RectanglePlane>(*primitive),
            "a declared surface of revolution for this generator");
  } else {
    require(!is_turning, "a milling cutter for this generator");
  }
  if (std::holds_alternative<program::Flank>(scene.program.source)) {
    require(primitive && std::holds_alternative<cutting::Cone>(*primitive),
            "a cone as the part of this generator");
  }
}

// Checks that tool, part and program fit each other. The simulation would report such errors too,
// but without a position in the scene.
void check_consistency(TableReader& reader, const Scene& scene) {
  const Node* program = reader.accept_key("program");
  const Node* generator = program ? program->find("generator") : nullptr;
  const Node* tool = reader.accept_key("tool");
  const auto& joints = scene.machine.joints;
  // A turning tool cuts only if a spindle next to w turns the workpiece.
  if (std::holds_alternative<cutting::Nose>(scene.tool.nominal) && tool && !joints.empty() &&
      (joints.front().name != 'S' || joints.front().motion != kinematics::Motion::Rotary)) {
    reader.input_errors().add(tool->position,
                              "a milling cutter, or a machine with the spindle S' next to w",
                              "a turning tool");
  }
  check_several_tools(reader, scene);
  check_tool_table(reader, scene);
  if (generator) check_generator(*generator, scene, reader.input_errors());
}

// Reports cases whose belief the scene does not state, or whose sensors it does not describe.
void check_beliefs(const Scene& scene, const std::vector<CaseDescription>& cases,
                   TableReader& reader) {
  using Belief = CaseDescription::Belief;
  using From = BeliefDescription::Force::From;
  const BeliefDescription& belief = scene.belief;
  for (const CaseDescription& description : cases) {
    // A plug-in has beliefs of its own.
    if (!description.plug_in.empty()) continue;
    const auto require = [&](Belief kind, bool is_stated, const char* section) {
      const bool is_used =
          description.belief == kind || (description.belief == Belief::Composite &&
                                         (kind == Belief::Identified || kind == Belief::Thermal));
      if (is_used && !is_stated)
        reader.report_invalid("compare", fmt::format("{} for {}", section, description.name),
                              "none");
    };
    require(Belief::Identified, belief.identified.has_value(), "belief.identified");
    require(Belief::Thermal, belief.thermal.has_value(), "[belief.thermal]");
    require(Belief::Force, belief.force.has_value(), "[belief.force]");
    require(Belief::Part, belief.part.has_value(), "[belief.part]");
    require(Belief::Fused, belief.identified || belief.thermal || belief.force || belief.part,
            "an entry in [belief]");
    const bool uses_touch_probe =
        belief.part && std::any_of(scene.part_instruments.begin(), scene.part_instruments.end(),
                                   [&](const PartInstrumentDescription& instrument) {
                                     return instrument.name == belief.part->instrument &&
                                            std::holds_alternative<errors::metrology::TouchProbe>(
                                                instrument.device);
                                   });
    // The probe would measure the part relative to a machine that the other beliefs do not correct.
    if (description.belief == Belief::Fused && uses_touch_probe &&
        (belief.identified || belief.thermal))
      reader.report_invalid(
          "compare",
          "a part measured off the machine (cmm) for " + description.name +
              ": a probe on the uncorrected machine would undo the other corrections",
          "a touch probe");
    const bool uses_force = belief.force && (description.belief == Belief::Force ||
                                             description.belief == Belief::Fused);
    if (!uses_force) continue;
    if (!has_cutting_force(scene))
      reader.report_invalid("compare", "[cutting] with a material for " + description.name, "none");
    if (belief.force->from == From::Current && !scene.signals.current)
      reader.report_invalid("compare", "[signals.current] for " + description.name, "none");
    if (belief.force->from == From::Dynamometer && !scene.signals.dynamometer)
      reader.report_invalid("compare", "[signals.dynamometer] for " + description.name, "none");
  }
}

/// Reads a scene from its tree, without its variants being applied.
Scene interpret_tree(const Node& tree, const std::filesystem::path& file,
                     InputErrors& input_errors) {
  TableReader reader(tree, "", input_errors);
  Scene scene;
  scene.file = file;
  scene.title = file.stem().string();
  scene = title_scene_fields().read(reader, std::move(scene));
  const std::size_t error_count = input_errors.list().size();
  scene = cutting_scene_fields().read(reader, std::move(scene));
  if (scene.additional_tools.empty()) scene = apply_tool_sections(std::move(scene));
  // After an input error a section may hold defaults, for which these checks would mislead.
  if (input_errors.list().size() == error_count) check_consistency(reader, scene);
  scene = judging_scene_fields().read(reader, std::move(scene));
  if (input_errors.list().size() == error_count) {
    check_tool_of_tables(reader, scene);
    check_beliefs(scene, scene.cases, reader);
  }
  scene.variants = read_variants(reader);
  reader.close();
  return scene;
}

// Checks all variants together with the scene, so that an invalid variant is reported at once and
// not after an hour of comparison.
void check_variants(const Scene& scene, const Node& tree, InputErrors& input_errors) {
  const std::filesystem::path& file = scene.file;
  ComparedNames names{scene.cases, {}};
  const Node* list = tree.find("variant");
  for (std::size_t i = 0; list && list->array() && i < list->array()->size(); ++i) {
    const Node* set = (*list->array())[i].find("set");
    if (!set || !set->table()) continue;
    const Scene variant = interpret_tree(
        apply_changes(tree, changes_from_set(*set), file.parent_path(), input_errors), file,
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
  // A file with the key `scene` is a study.
  if (as_written->find("scene") && !as_written->find("machine"))
    throw BadScene({BadInput(file.string(), 0, 0, "a scene with the key `machine`",
                             "a study, which is run by abbe study")});
  Scene scene = scene_from_tree(*as_written, file, overrides, std::move(input_errors));
  NamedFiles named = collect_named_files(*scene.tree, file);
  scene.files = std::move(named.files);
  // Material libraries are named by the mesh and not by the scene.
  for (const path& material_file : material_files(scene.part))
    scene.files.push_back(absolute_path(material_file));
  scene.programs = std::move(named.programs);
  return scene;
}

Scene scene_from_tree(const Node& as_written, const std::filesystem::path& file,
                      const std::vector<Override>& overrides, InputErrors input_errors) {
  Node tree = apply_changes(as_written, overrides, file.parent_path(), input_errors);
  Scene scene = interpret_tree(tree, file, input_errors);
  if (input_errors.empty()) check_variants(scene, tree, input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  Node resolved_tree = tree;
  // The case belongs to one run; the resolved scene serves all cases of a comparison.
  std::erase_if(*resolved_tree.table(),
                [](const Node::Entry& entry) { return entry.key == "case"; });
  scene.resolved = to_toml(resolved_tree);
  scene.tree = std::make_shared<const Node>(std::move(tree));
  return scene;
}

}  // namespace abbe::sim
