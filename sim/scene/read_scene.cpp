#include "sim/scene/read_scene.h"

#include <algorithm>
#include <array>
#include <sstream>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/escape.h"
#include "kinematics/units.h"
#include "sim/scene/case_folders.h"
#include "sim/scene/scene_names.h"
#include "sim/scene/scene_sections.h"
#include "sim/scene/scene_tree.h"

namespace abbe::sim {

namespace {

constexpr std::size_t max_variants = 1000;

// A section whose file was refused is still the name of that file; it is reported already.
const Node* section(TableReader& scene, const std::string& key, bool required) {
  const Node* node = scene.know(key);
  if (!node && required) scene.missing(key, "a table or a file");
  if (node && node->text()) return nullptr;
  return node ? scene.section(key) : nullptr;
}

kinematics::Deviation read_setup(TableReader& scene) {
  kinematics::Deviation setup = kinematics::Deviation::Zero();
  const Node* node = scene.section("setup");
  if (!node) return setup;
  TableReader reader(*node, "setup", scene.faults());
  const std::array keys{"EX_um", "EY_um", "EZ_um", "EA_urad", "EB_urad", "EC_urad"};
  for (std::size_t i = 0; i < keys.size(); ++i) {
    setup[Eigen::Index(i)] = reader.number(keys[i], any_number, 0.0);
  }
  reader.close();
  return setup;
}

/// An instant, negative in the thermal history before the program.
double read_time(TableReader& datum) {
  const double time_s = datum.number("time_s", any_number, 0.0);
  if (!datum.has("time_h")) return time_s;
  if (datum.has("time_s")) datum.refuse("time_h", "one of time_s and time_h", "both");
  return datum.number("time_h", any_number);
}

DatumDescription read_datum(TableReader& scene) {
  using Kind = DatumDescription::Kind;
  DatumDescription datum;
  const Node* node = scene.section("datum");
  if (!node) return datum;
  TableReader reader(*node, "datum", scene.faults());
  datum.kind = reader.choice<Kind>(
      "kind", {{"none", Kind::None}, {"ideal", Kind::Ideal}, {"touch_off", Kind::TouchOff}});
  if (datum.kind == Kind::Ideal) datum.point_w = reader.vector("point_mm", datum.point_w);
  if (datum.kind != Kind::None) datum.time_s = read_time(reader);
  if (datum.kind == Kind::TouchOff) {
    if (!reader.has("touch")) reader.missing("touch", "a list of tables");
    for (const Node* touch : reader.tables("touch")) {
      TableReader one(*touch, "datum.touch", scene.faults());
      datum.touches.push_back({one.vector("point_mm"), one.direction("direction")});
      one.close();
    }
  }
  reader.close();
  return datum;
}

errors::Vibration read_vibration(const Node& node, const MachineDescription& machine,
                                 Faults& faults) {
  TableReader reader(node, "vibration", faults);
  errors::Vibration vibration;
  try {
    vibration.name = errors::parse_element_name(reader.text("element", "EXS"));
  } catch (const std::invalid_argument& fault) {
    reader.refuse("element", "an element such as EXS", fault.what());
  }
  if (!reader.has("element")) reader.missing("element", "an element such as EXS");
  vibration.order = reader.number("order", positive, 1.0);
  vibration.amplitude =
      reader.number(vibration.name.is_angle() ? "amplitude_urad" : "amplitude_um", any_number);
  vibration.exponent = reader.number("exponent", any_number, 0.0);
  vibration.reference_speed = vibration.exponent == 0.0 ? reader.number("at_rpm", positive, 1.0)
                                                        : reader.number("at_rpm", positive);
  vibration.phase = reader.number("phase_deg", any_number, 0.0);
  if (const auto hertz = reader.maybe_number("resonance_Hz", positive))
    vibration.resonance = 2 * pi * *hertz;
  vibration.damping = reader.number("damping", positive, vibration.damping);
  reader.close();
  try {
    errors::bind({vibration}, kinematics::Chain(machine.joints, machine.T_bw, machine.T_bs));
  } catch (const std::invalid_argument& fault) {
    if (!machine.joints.empty())
      reader.refuse("element", "a vibration that the machine can have", fault.what());
  }
  return vibration;
}

/// The heat of the machine with the day that the scene gives it: its history and its room, which
/// stand for those of the machine's own file.
std::optional<ThermalDescription> read_heat(TableReader& scene, const MachineDescription& machine,
                                            std::uint64_t seed) {
  const Node* node = section(scene, "thermal", false);
  std::optional<Node> with_day;
  if (node) with_day = *node;
  for (const std::string key : {"history", "room", "room_C"}) {
    const Node* day = scene.know(key);
    if (!day) continue;
    if (!node) {
      if (!scene.has("thermal")) scene.refuse(key, "a [thermal] section beside " + key, "none");
      continue;
    }
    std::erase_if(*with_day->table(), [&](const Node::Entry& entry) {
      const bool other_room = entry.key.starts_with("room") && !scene.has(entry.key);
      return entry.key == key || (key != "history" && other_room);
    });
    with_day->table()->push_back({key, day->place, *day});
  }
  if (!with_day) return std::nullopt;
  return read_thermal(*with_day, machine, seed, scene.faults());
}

/// Heat, force, what the control reads of them and what others measure.
void read_sources(TableReader& reader, Scene& scene) {
  Faults& faults = reader.faults();
  scene.thermal = read_heat(reader, scene.machine, scene.seed);
  if (const Node* node = section(reader, "compliance", false))
    scene.compliance = read_compliance(*node, scene.machine, faults);
  for (const Node* node : reader.tables("vibration"))
    scene.vibrations.push_back(read_vibration(*node, scene.machine, faults));
  if (const Node* node = reader.section("cutting"))
    scene.cutting = read_cutting(*node, scene.tool, faults);
  if (const Node* node = section(reader, "material", false)) {
    const cutting::CuttingCoefficients material = read_material(*node, faults);
    if (scene.cutting)
      scene.cutting->material = material;
    else
      reader.refuse("material", "a [cutting] section beside the material", "none");
  }
  if (const Node* node = reader.section("signals"))
    scene.signals = signals_fields().read_table(*node, "signals", faults);
  Instruments instruments = read_instruments(reader.tables("instrument"), scene.machine, faults);
  scene.instruments = std::move(instruments.of_machine);
  scene.part_instruments = std::move(instruments.of_part);
  if (const Node* node = reader.section("sensor_choice")) {
    scene.sensor_choice = read_sensor_choice(*node, faults);
    scene.sensor_choice->study.seed = scene.seed;
    if (!scene.thermal && !reader.has("thermal"))
      reader.refuse("sensor_choice", "a [thermal] section beside it", "none");
  }
}

void read_numerics(TableReader& scene, Scene& result) {
  if (const Node* node = scene.section("sampling")) {
    TableReader reader(*node, "sampling", scene.faults());
    result.chord_tolerance =
        reader.number("chord_tolerance_nm", {0.01, 1e6, false, false}, result.chord_tolerance);
    result.max_step = reader.number("max_step_mm", positive, result.max_step);
    reader.close();
  }
  if (const Node* node = scene.section("search")) {
    TableReader reader(*node, "search", scene.faults());
    result.band = reader.number("band_mm", positive, result.band);
    reader.close();
  }
}

ViewDescription read_view(TableReader& scene) {
  ViewDescription view;
  const Node* node = scene.section("view");
  if (!node) return view;
  TableReader reader(*node, "view", scene.faults());
  view.from = reader.direction("from", view.from);
  view.up = reader.direction("up", view.up);
  view.range_um = reader.number_as_written("range_um", positive);
  if (view.from.cross(view.up).norm() < 1e-6 * view.from.norm()) {
    reader.refuse("up", "a direction across view.from for view.up", "one along it");
  }
  reader.close();
  return view;
}

Limits read_limits(TableReader& scene) {
  Limits limits;
  const Node* node = scene.section("limits");
  if (!node) return limits;
  TableReader reader(*node, "limits", scene.faults());
  limits.pv_um = reader.number_as_written("pv_um", non_negative);
  limits.rms_um = reader.number_as_written("rms_um", non_negative);
  limits.max_abs_um = reader.number_as_written("max_abs_um", non_negative);
  reader.close();
  return limits;
}

std::vector<CaseDescription> read_cases(TableReader& scene) {
  std::vector<CaseDescription> cases;
  const Node* node = scene.section("compare");
  if (!node) return cases;
  TableReader reader(*node, "compare", scene.faults());
  const Node* list = reader.know("cases");
  if (list && !list->array()) reader.refuse("cases", "a list of case names", shown(*list));
  for (const Node& name : list && list->array() ? *list->array() : Node::Array{}) {
    if (!name.text()) {
      scene.faults().add(name.place, "a case name such as \"perfect-iterated-ideal\"", shown(name));
      continue;
    }
    try {
      const CaseDescription one = parse_case(*name.text());
      const bool twice = std::any_of(cases.begin(), cases.end(),
                                     [&](const auto& other) { return other.name == one.name; });
      if (twice) scene.faults().add(name.place, "each case once", shown(name) + " again");
      cases.push_back(one);
    } catch (const std::invalid_argument& fault) {
      scene.faults().add(name.place, "a case that this version has", fault.what());
    }
  }
  reader.close();
  return cases;
}

std::vector<Variant> read_variants(TableReader& scene) {
  std::vector<Variant> variants;
  const std::vector<const Node*> list = scene.tables("variant");
  if (list.size() > max_variants) {
    scene.refuse("variant", fmt::format("at most {} variants", max_variants),
                 std::to_string(list.size()));
    return variants;
  }
  for (const Node* node : list) {
    TableReader reader(*node, "variant", scene.faults());
    Variant variant;
    variant.name = reader.text("name");
    const bool taken = variant.name == "error_free" || variant.name == "uncompensated" ||
                       std::any_of(variants.begin(), variants.end(), [&](const Variant& other) {
                         return other.name == variant.name;
                       });
    if (reader.has("name") && !names_a_folder(variant.name)) {
      reader.refuse("name", "a name of letters, digits, blanks, _ - . for a variant's folder",
                    "\"" + variant.name + "\"");
    } else if (taken) {
      reader.refuse("name", "a name that no other case has", "\"" + variant.name + "\" again");
    }
    if (const Node* set = reader.section("set")) {
      for (const Change& change : changes_of_set(*set)) {
        variant.set.push_back(override_of(change));
        if (change.path.starts_with("variant")) {
          scene.faults().add(change.value.place, "a path outside of variants", change.path);
        }
      }
    } else if (!reader.has("set")) {
      reader.missing("set", "a table of changes");
    }
    reader.close();
    variants.push_back(std::move(variant));
  }
  return variants;
}

// What tool, part and program ask of each other; the loop could tell it too, but not where.
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
  scene.title = reader.text("title", file.stem().string());
  scene.seed =
      std::uint64_t(reader.integer("seed", 0, std::numeric_limits<std::int64_t>::max(), 1));
  const std::size_t before = faults.list().size();
  if (const Node* node = section(reader, "machine", true))
    scene.machine = read_machine(*node, faults);
  if (const Node* node = reader.know("errors")) {
    ErrorsSection read = read_errors(*node, scene.machine, scene.seed, faults);
    scene.geometric = std::move(read.geometric);
    scene.error_scale = read.scale;
  }
  if (const Node* node = section(reader, "tool", true)) scene.tool = read_tool(*node, faults);
  if (const Node* node = section(reader, "part", true)) scene.part = read_part(*node, faults);
  if (const Node* node = section(reader, "program", true)) {
    scene.program = read_program(*node, scene.machine.joints, faults);
  }
  read_sources(reader, scene);
  if (const Node* node = reader.section("control")) {
    scene.control = read_control(*node, scene.machine.joints, faults);
  }
  if (faults.list().size() == before) check_together(reader, scene);
  scene.setup = read_setup(reader);
  scene.datum = read_datum(reader);
  scene.alignment = reader.choice<Alignment>(
      "alignment",
      {{"none", Alignment::None}, {"offset", Alignment::Offset}, {"rigid", Alignment::Rigid}},
      Alignment::None);
  read_numerics(reader, scene);
  scene.view = read_view(reader);
  scene.limits = read_limits(reader);
  if (const Node* node = reader.section("belief"))
    scene.belief = read_belief(*node, scene.machine, faults);
  if (const Node* node = reader.section("compensation"))
    scene.compensation = read_compensation(*node, scene.machine.joints, faults);
  scene.case_name = reader.text("case", "");
  if (!scene.case_name.empty() && scene.case_name != "error_free" &&
      scene.case_name != "uncompensated") {
    try {
      parse_case(scene.case_name);
    } catch (const std::invalid_argument& fault) {
      reader.refuse("case", "a case that this version has", fault.what());
    }
  }
  scene.cases = read_cases(reader);
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
  Scene scene = scene_of_tree(*as_written, file, overrides, std::move(faults));
  Named named = named_by(*scene.tree, file);
  scene.files = std::move(named.files);
  scene.programs = std::move(named.programs);
  return scene;
}

Scene scene_of_tree(const Node& as_written, const std::filesystem::path& file,
                    const std::vector<Override>& overrides, Faults faults) {
  std::vector<Change> changes;
  for (const Override& override : overrides) {
    try {
      changes.push_back(parse_override(override));
    } catch (const BadInput& fault) {
      faults.add(fault);
    }
  }
  Node tree = changed(as_written, changes, file.parent_path(), faults);
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
