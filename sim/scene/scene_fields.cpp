#include "sim/scene/scene_fields.h"

#include <stdexcept>
#include <vector>

#include "sim/scene/bodies.h"
#include "sim/scene/cases.h"
#include "sim/scene/compensation.h"
#include "sim/scene/compliance.h"
#include "sim/scene/cutting.h"
#include "sim/scene/errors.h"
#include "sim/scene/fields.h"
#include "sim/scene/instruments.h"
#include "sim/scene/machine.h"
#include "sim/scene/part.h"
#include "sim/scene/program.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/thermal.h"
#include "sim/scene/toml.h"
#include "sim/scene/tool.h"

namespace abbe::sim {

template <typename T>
class Fields;

/// Returns the fields of `[sampling]`, `[search]`, `[view]` and `[limits]`.
const Fields<Scene>& sampling_fields();
const Fields<Scene>& search_fields();
const Fields<ViewDescription>& view_fields();
const Fields<Limits>& limits_fields();

namespace {

Key table_key(const KeyName& name, std::vector<Key> keys, const char* sentence) {
  Key key = make_key(name, Key::Kind::Table, sentence);
  key.keys = std::move(keys);
  return key;
}

Key list_key(const KeyName& name, std::vector<Key> keys, const char* sentence) {
  Key key = table_key(name, std::move(keys), sentence);
  key.kind = Key::Kind::Tables;
  return key;
}

Key with_file(Key key) {
  key.or_file = true;
  return key;
}

/// Returns the table of a section; null if it is missing or is still the name of a file. The latter
/// could not be read, which has been reported already.
const Node* section(TableReader& scene, const Key& key) {
  const Node* node = scene.accept_key(key.name);
  if (!node && key.required) scene.missing(key.name, "a table or a file");
  if (node && node->text()) return nullptr;
  return node ? scene.section(key.name) : nullptr;
}

/// Adds a section that may be stored in a file of its own, with functions to read and write it.
/// @param read  (const Node&, Scene&, InputErrors&)
/// @param write  (const Scene&) -> optional<Node::Table>
template <typename Read, typename Write>
void add_section(Fields<Scene>& fields, Key key, Read read, Write write) {
  key = with_file(std::move(key));
  fields.custom(
      {key},
      [key, read](TableReader& reader, Scene& scene) {
        if (const Node* node = section(reader, key)) read(*node, scene, reader.input_errors());
      },
      [key, write](const Scene& scene, Node::Table& table) {
        if (auto own = write(scene)) put(table, key.name, std::move(*own));
      });
}

/// Adds a section that is a list of tables.
/// @param read   (TableReader&, Scene&)
/// @param write  (const Scene&) -> vector<Node::Table>
template <typename Read, typename Write>
void add_list(Fields<Scene>& fields, Key key, Read read, Write write) {
  fields.custom({key}, read, [key, write](const Scene& scene, Node::Table& table) {
    Node::Array all;
    for (Node::Table& own : write(scene)) all.push_back(Node{{}, std::move(own)});
    if (!all.empty()) put(table, key.name, std::move(all));
  });
}

void add_errors(Fields<Scene>& fields) {
  Key key =
      with_file(list_key("errors", errors_keys(),
                         "geometric errors: a table, a file, or a list of them, which add up"));
  fields.custom(
      {key},
      [](TableReader& reader, Scene& scene) {
        const Node* node = reader.accept_key("errors");
        if (!node) return;
        ErrorsSection read = read_errors(*node, scene.machine, scene.seed, reader.input_errors());
        scene.geometric = std::move(read.geometric);
        scene.error_scale = read.scale;
      },
      [](const Scene& scene, Node::Table& table) {
        put(table, "errors", written_errors({scene.geometric, scene.error_scale}, scene.machine));
      });
}

void add_tools(Fields<Scene>& fields) {
  Key key = with_file(list_key(must("tool"), tool_keys(),
                               "cutter or turning tool: a table, a file, or a list of them, each "
                               "with its `number`, for a program that changes tools"));
  fields.custom(
      {key},
      [](TableReader& reader, Scene& scene) {
        const Node* node = reader.accept_key("tool");
        if (!node) reader.missing("tool", "a table or a file");
        if (!node || node->text()) return;  // a file that could not be read
        std::vector<ToolDescription> tools = read_tools(*node, reader.input_errors());
        scene.tool = std::move(tools.front());
        scene.additional_tools.assign(tools.begin() + 1, tools.end());
      },
      [](const Scene& scene, Node::Table& table) {
        // Most scenes have one tool and write it as a table, so it is written back as one.
        if (scene.additional_tools.empty()) return put(table, "tool", written_tool(scene.tool));
        Node::Array all;
        for (const ToolDescription& tool : all_tools(scene))
          all.push_back(Node{{}, written_tool(tool)});
        put(table, "tool", std::move(all));
      });
}

void add_machine_to_program(Fields<Scene>& fields) {
  add_section(
      fields, table_key(must("machine"), machine_keys(), "axes, their order and where they are"),
      [](const Node& node, Scene& scene, InputErrors& input_errors) {
        scene.machine = read_machine(node, input_errors);
      },
      [](const Scene& scene) {
        return std::optional<Node::Table>(written_machine(scene.machine));
      });
  add_errors(fields);
  add_tools(fields);
  add_section(
      fields, table_key(must("part"), part_keys(), "the design, where it is judged"),
      [](const Node& node, Scene& scene, InputErrors& input_errors) {
        scene.part = read_part(node, input_errors);
      },
      [](const Scene& scene) { return std::optional<Node::Table>(written_part(scene.part)); });
  add_section(
      fields, table_key(must("program"), program_keys(), "NC, PVT, or what writes it"),
      [](const Node& node, Scene& scene, InputErrors& input_errors) {
        scene.program = read_program(node, scene.machine.joints, input_errors);
      },
      [](const Scene& scene) {
        return std::optional<Node::Table>(written_program(scene.program, scene.machine.joints));
      });
}

/// Reads the thermal section of the machine. History and room temperature at the top level of the
/// scene replace those of the section.
std::optional<ThermalDescription> read_heat(TableReader& reader, const Key& thermal,
                                            const Scene& scene) {
  const Node* node = section(reader, thermal);
  // Merged in a copy: the section may come from a file that other scenes use too.
  std::optional<Node> with_day;
  if (node) with_day = *node;
  for (const std::string key : {"history", "room", "room_C"}) {
    const Node* day = reader.accept_key(key);
    if (!day) continue;
    if (!node) {
      // If the section exists but could not be read, that has been reported.
      if (!reader.has("thermal")) reader.refuse(key, "a [thermal] section beside " + key, "none");
      continue;
    }
    std::erase_if(*with_day->table(), [&](const Node::Entry& entry) {
      // `room` and `room_C` exclude each other, so either one of the scene replaces both.
      const bool other_room = entry.key.starts_with("room") && !reader.has(entry.key);
      return entry.key == key || (key != "history" && other_room);
    });
    with_day->table()->push_back({key, day->place, *day});
  }
  if (!with_day) return std::nullopt;
  return read_thermal(*with_day, scene.machine, scene.seed, reader.input_errors());
}

void add_thermal(Fields<Scene>& fields) {
  const Key thermal = with_file(table_key("thermal", thermal_keys(), "heat, and what it does"));
  std::vector<Key> keys{thermal};
  for (Key key : thermal.keys) {
    if (key.name != "history" && key.name != "room" && key.name != "room_C") continue;
    key.sentence = "the day of this scene, in place of that of `thermal`: " + key.sentence;
    // Inside the section one of these keys is required; at the top level each is optional.
    key.either.clear();
    key.required = false;
    keys.push_back(std::move(key));
  }
  fields.custom(
      std::move(keys),
      [thermal](TableReader& reader, Scene& scene) {
        scene.thermal = read_heat(reader, thermal, scene);
      },
      [](const Scene& scene, Node::Table& table) {
        if (scene.thermal)
          put(table, "thermal", written_thermal(*scene.thermal, scene.machine, scene.seed));
      });
}

void add_force(Fields<Scene>& fields) {
  add_section(
      fields, table_key("compliance", compliance_keys(), "what gives way"),
      [](const Node& node, Scene& scene, InputErrors& input_errors) {
        scene.compliance = read_compliance(node, scene.machine, input_errors);
      },
      [](const Scene& scene) -> std::optional<Node::Table> {
        if (!scene.compliance) return {};
        return written_compliance(*scene.compliance, scene.machine);
      });
  add_list(
      fields, list_key("vibration", vibration_keys(), "harmonics of the spindle, which add up"),
      [](TableReader& reader, Scene& scene) {
        for (const Node* node : reader.tables("vibration"))
          scene.vibrations.push_back(read_vibration(*node, scene.machine, reader.input_errors()));
      },
      [](const Scene& scene) {
        std::vector<Node::Table> all;
        for (const auto& one : scene.vibrations) all.push_back(written_vibration(one));
        return all;
      });
}

void add_stock(Fields<Scene>& fields) {
  fields.custom(
      {table_key("cutting", cutting_keys(), "the blank, and how finely the cut is followed")},
      [](TableReader& reader, Scene& scene) {
        if (const Node* node = reader.section("cutting"))
          scene.cutting = read_cutting(*node, scene.tool, reader.input_errors());
      },
      [](const Scene& scene, Node::Table& table) {
        if (scene.cutting) put(table, "cutting", written_cutting(*scene.cutting, scene.tool));
      });
  const Key material =
      with_file(table_key(KeyName("material").otherwise("none: no forces"), material_keys(),
                          "cutting coefficients, beside `[cutting]`"));
  fields.custom(
      {material},
      [material](TableReader& reader, Scene& scene) {
        const Node* node = section(reader, material);
        if (!node) return;
        const cutting::CuttingCoefficients read = read_material(*node, reader.input_errors());
        if (scene.cutting)
          scene.cutting->material = read;
        else
          reader.refuse("material", "a [cutting] section beside the material", "none");
      },
      [](const Scene& scene, Node::Table& table) {
        if (scene.cutting && scene.cutting->material)
          put(table, "material", written_material(*scene.cutting->material));
      });
}

void add_instruments(Fields<Scene>& fields) {
  add_list(
      fields,
      list_key("instrument", instrument_keys(), "what measures the machine, or the finished part"),
      [](TableReader& reader, Scene& scene) {
        Instruments instruments =
            read_instruments(reader.tables("instrument"), scene.machine, reader.input_errors());
        scene.instruments = std::move(instruments.of_machine);
        scene.part_instruments = std::move(instruments.of_part);
      },
      [](const Scene& scene) {
        return written_instruments({scene.instruments, scene.part_instruments}, scene.machine);
      });
  fields.custom(
      {table_key("sensor_choice", sensor_choice_keys(),
                 "which temperature sensors are worth having")},
      [](TableReader& reader, Scene& scene) {
        const Node* node = reader.section("sensor_choice");
        if (!node) return;
        scene.sensor_choice = read_sensor_choice(*node, reader.input_errors());
        // The choice draws random subsets, from the seed of the scene.
        scene.sensor_choice->study.seed = scene.seed;
        // Without heat there is no drift by which sensors could be judged.
        if (!scene.thermal && !reader.has("thermal"))
          reader.refuse("sensor_choice", "a [thermal] section beside it", "none");
      },
      [](const Scene& scene, Node::Table& table) {
        if (scene.sensor_choice)
          put(table, "sensor_choice", written_sensor_choice(*scene.sensor_choice));
      });
}

void add_control(Fields<Scene>& fields) {
  fields.custom(
      {table_key("control", control_keys(), "what the control believes, where it differs")},
      [](TableReader& reader, Scene& scene) {
        if (const Node* node = reader.section("control"))
          scene.control = read_control(*node, scene.machine.joints, reader.input_errors());
      },
      [](const Scene& scene, Node::Table& table) {
        Node::Table own = written_control(scene.control);
        // Without entries the control believes in the nominal machine; the section may be omitted.
        if (!own.empty()) put(table, "control", std::move(own));
      });
}

/// Adds a section whose fields set one member of the scene, or with `itself` the scene.
template <typename U, typename M>
void add_own(Fields<Scene>& fields, const char* name, M member, const Fields<U>& own,
             const char* sentence) {
  const Key key = table_key(name, own.keys(), sentence);
  fields.custom(
      {key},
      [key, member, own](TableReader& reader, Scene& scene) {
        const Node* node = reader.section(key.name);
        if (!node) return;
        U& value = std::invoke(member, scene);
        value = own.read_table(*node, key.name, reader.input_errors(), value);
      },
      [key, member, own](const Scene& scene, Node::Table& table) {
        put(table, key.name, own.written(std::invoke(member, scene)));
      });
}

void add_compensation(Fields<Scene>& fields) {
  fields.custom(
      {table_key("belief", belief_keys(), "what compensators are given to believe")},
      [](TableReader& reader, Scene& scene) {
        if (const Node* node = reader.section("belief"))
          scene.belief = read_belief(*node, scene.machine, reader.input_errors());
      },
      [](const Scene& scene, Node::Table& table) {
        put(table, "belief", written_belief(scene.belief, scene.machine));
      });
  fields.custom(
      {table_key("compensation", compensation_keys(), "strategies and channels with their limits")},
      [](TableReader& reader, Scene& scene) {
        if (const Node* node = reader.section("compensation"))
          scene.compensation =
              read_compensation(*node, scene.machine.joints, reader.input_errors());
      },
      [](const Scene& scene, Node::Table& table) {
        put(table, "compensation", written_compensation(scene.compensation, scene.machine.joints));
      });
}

void check_case(TableReader& reader, Scene& scene) {
  // The two reference cases have no compensator that could be parsed.
  if (scene.case_name.empty() || scene.case_name == "error_free" ||
      scene.case_name == "uncompensated")
    return;
  try {
    parse_case(scene.case_name);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("case", "a case that this version has", fault.what());
  }
}

}  // namespace

const Fields<Scene>& title_scene_fields() {
  static const Fields<Scene> fields =
      Fields<Scene>()
          .text(KeyName("title").otherwise("name of the file"), &Scene::title,
                "of pictures and tables")
          .whole("seed", &Scene::seed, 0, std::numeric_limits<std::int64_t>::max(),
                 "of all that is random");
  return fields;
}

const Fields<Scene>& cutting_scene_fields() {
  static const Fields<Scene> fields = [] {
    Fields<Scene> all;
    add_machine_to_program(all);
    add_thermal(all);
    add_force(all);
    add_stock(all);
    all.tables(KeyName("fixture").otherwise("none"), &Scene::fixtures, body_fields(),
               "what clamps the part: bodies placed in the workpiece frame, for collisions");
    all.check([](TableReader& reader, Scene& scene) {
      check_fixture_names(reader, scene.machine, scene.fixtures);
    });
    add_own(all, "signals", &Scene::signals, signals_fields(),
            "what the control can read, and how often it is written");
    add_instruments(all);
    add_control(all);
    return all;
  }();
  return fields;
}

const Fields<Scene>& judging_scene_fields() {
  static const Fields<Scene> fields = [] {
    Fields<Scene> all;
    add_own(all, "setup", &Scene::setup, setup_fields(), "clamping of the part");
    add_own(all, "datum", &Scene::datum, datum_fields(), "how the control finds the part");
    all.word("alignment", &Scene::alignment,
             {{"none", Alignment::None},
              {"offset", Alignment::Offset, "the mean"},
              {"rigid", Alignment::Rigid, "a displacement and a rotation"}},
             "what is taken out of the residual");
    add_own(all, "sampling", itself, sampling_fields(), "how finely the path is followed");
    add_own(all, "search", itself, search_fields(), "where the machined surface is sought");
    add_own(all, "collision", &Scene::collision, collision_fields(),
            "what meets what, and how near is too near");
    all.check([](TableReader& reader, Scene& scene) {
      check_ignored_names(reader, scene.machine, scene.fixtures);
    });
    add_own(all, "view", &Scene::view, view_fields(), "of pictures");
    add_own(all, "limits", &Scene::limits, limits_fields(), "beyond which `abbe` exits with 1");
    add_compensation(all);
    all.text(KeyName("case").otherwise("uncompensated"), &Scene::case_name,
             "what `abbe run` cuts without `--case`, as in `[compare]`; a result's `scene.toml` "
             "names its own");
    all.check(check_case);
    add_own(all, "compare", &Scene::cases, compare_fields(), "compensators to compare");
    return all;
  }();
  return fields;
}

std::vector<Key> scene_keys() {
  std::vector<Key> keys;
  for (const auto* fields :
       {&title_scene_fields(), &cutting_scene_fields(), &judging_scene_fields()})
    for (Key& key : fields->keys()) keys.push_back(std::move(key));
  keys.push_back(list_key("variant", variant_keys(),
                          "the scene with changes, as another case of `abbe compare`"));
  return keys;
}

Node written(const Scene& scene) {
  Node::Table table;
  // Written in the order in which they are read.
  for (const auto* fields :
       {&title_scene_fields(), &cutting_scene_fields(), &judging_scene_fields()})
    for (Node::Entry& entry : fields->written(scene)) table.push_back(std::move(entry));
  Node::Array variants;
  for (const Variant& variant : scene.variants)
    variants.push_back(Node{{}, written_variant(variant)});
  if (!variants.empty()) put(table, "variant", std::move(variants));
  return Node{{}, std::move(table)};
}

const Fields<Scene>& sampling_fields() {
  static const Fields<Scene> fields =
      Fields<Scene>()
          .number(
              "chord_tolerance_nm", &Scene::chord_tolerance, {0.01, 1e6, false, false},
              "how far the commanded tool may be from its path between two samples of it; how far "
              "errors bend in between is reported, between_samples: see max_step_mm")
          .number(
              "max_step_mm", &Scene::max_step, positive,
              "between two samples at most; an error of amplitude a and period p is followed to "
              "a (pi step / p)^2 / 2");
  return fields;
}

const Fields<Scene>& search_fields() {
  static const Fields<Scene> fields = Fields<Scene>().number(
      "band_mm", &Scene::band, positive,
      "how far the machined surface is sought along the normal; a gouge deeper than it is followed "
      "to ten bands, counted apart and left out of PV and RMS");
  return fields;
}

const Fields<ViewDescription>& view_fields() {
  static const Fields<ViewDescription> fields =
      Fields<ViewDescription>()
          .direction("from", &ViewDescription::from,
                     "direction from the part to the camera, in the part frame")
          .direction("up", &ViewDescription::up, "what is up in the picture, in the part frame")
          .number_as_written(KeyName("range_um").otherwise("fitted"), &ViewDescription::range_um,
                             positive, "the colour scale runs from -range to range")
          .check([](TableReader& reader, ViewDescription& view) {
            // A camera that looks along its up direction could be rotated freely about it.
            if (view.from.cross(view.up).norm() < 1e-6 * view.from.norm())
              reader.refuse("up", "a direction across view.from for view.up", "one along it");
          });
  return fields;
}

const Fields<Limits>& limits_fields() {
  static const Fields<Limits> fields =
      Fields<Limits>()
          .number_as_written("pv_um", &Limits::pv_um, non_negative,
                             "of the residual; exceeded, `abbe` exits with 1, and a gouge deeper "
                             "than the band exceeds each limit")
          .number_as_written("rms_um", &Limits::rms_um, non_negative, "the same")
          .number_as_written("max_abs_um", &Limits::max_abs_um, non_negative, "the same")
          .number_as_written("form_pv_um", &Limits::form_pv_um, non_negative,
                             "the same of `form_um`, the residual through the areal filter")
          .number_as_written("form_rms_um", &Limits::form_rms_um, non_negative, "the same")
          .number_as_written("texture_sa_um", &Limits::texture_sa_um, non_negative,
                             "the same of `texture_um`, what that filter leaves out")
          .number_as_written("texture_sq_um", &Limits::texture_sq_um, non_negative, "the same")
          .number_as_written("texture_sz_um", &Limits::texture_sz_um, non_negative, "the same")
          .boolean("tolerance", &Limits::tolerance,
                   "whether a verdict of FAIL (`part.tolerance_um`) makes `abbe` exit with 1, too");
  return fields;
}

}  // namespace abbe::sim
