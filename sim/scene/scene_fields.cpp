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

/// Return the fields of `[sampling]`, `[search]`, `[view]` and `[limits]`.
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

Key allow_file(Key key) {
  key.or_file = true;
  return key;
}

/// Returns the table of a section; null if it is missing or if its file is invalid. In the latter
/// case the value is still the name of the file, and the error is reported already.
const Node* section(TableReader& scene, const Key& key) {
  const Node* node = scene.accept_key(key.name);
  if (!node && key.required) scene.report_missing(key.name, "a table or a file");
  if (node && node->text()) return nullptr;
  return node ? scene.section(key.name) : nullptr;
}

/// Adds a section that may be stored in a file of its own.
/// @param read  (const Node&, Scene&, InputErrors&)
/// @param write  (const Scene&) -> optional<Node::Table>
template <typename Read, typename Write>
void add_section(Fields<Scene>& fields, Key key, Read read, Write write) {
  key = allow_file(std::move(key));
  fields.custom_field(
      {key},
      [key, read](TableReader& reader, Scene& scene) {
        if (const Node* node = section(reader, key)) read(*node, scene, reader.input_errors());
      },
      [key, write](const Scene& scene, Node::Table& table) {
        if (auto section = write(scene)) put_value(table, key.name, std::move(*section));
      });
}

/// Adds a section that is a list of tables.
/// @param read   (TableReader&, Scene&)
/// @param write  (const Scene&) -> vector<Node::Table>
template <typename Read, typename Write>
void add_list(Fields<Scene>& fields, Key key, Read read, Write write) {
  fields.custom_field({key}, read, [key, write](const Scene& scene, Node::Table& table) {
    Node::Array list;
    for (Node::Table& element : write(scene)) list.push_back(Node{{}, std::move(element)});
    if (!list.empty()) put_value(table, key.name, std::move(list));
  });
}

void add_errors(Fields<Scene>& fields) {
  Key key =
      allow_file(list_key("errors", errors_keys(),
                          "geometric errors: a table, a file, or a list of these, which add up"));
  fields.custom_field(
      {key},
      [](TableReader& reader, Scene& scene) {
        const Node* node = reader.accept_key("errors");
        if (!node) return;
        ErrorsSection errors = read_errors(*node, scene.machine, scene.seed, reader.input_errors());
        scene.geometric = std::move(errors.geometric);
        scene.error_scale = errors.scale;
      },
      [](const Scene& scene, Node::Table& table) {
        put_value(table, "errors",
                  errors_to_table({scene.geometric, scene.error_scale}, scene.machine));
      });
}

void add_tools(Fields<Scene>& fields) {
  Key key = allow_file(list_key(required_key("tool"), tool_keys(),
                                "cutter or turning tool: a table, a file, or a list of these, each "
                                "with its `number`, for a program that changes tools"));
  fields.custom_field(
      {key},
      [](TableReader& reader, Scene& scene) {
        const Node* node = reader.accept_key("tool");
        if (!node) reader.report_missing("tool", "a table or a file");
        if (!node || node->text()) return;  // the file is invalid, which is reported
        std::vector<ToolDescription> tools = read_tools(*node, reader.input_errors());
        scene.tool = std::move(tools.front());
        scene.additional_tools.assign(tools.begin() + 1, tools.end());
      },
      [](const Scene& scene, Node::Table& table) {
        // A single tool is written as a table and not as a list.
        if (scene.additional_tools.empty())
          return put_value(table, "tool", tool_to_table(scene.tool));
        Node::Array tools;
        for (const ToolDescription& tool : all_tools(scene))
          tools.push_back(Node{{}, tool_to_table(tool)});
        put_value(table, "tool", std::move(tools));
      });
}

void add_machine_to_program(Fields<Scene>& fields) {
  add_section(
      fields,
      table_key(required_key("machine"), machine_keys(), "axes, with their order and positions"),
      [](const Node& node, Scene& scene, InputErrors& input_errors) {
        scene.machine = read_machine(node, input_errors);
      },
      [](const Scene& scene) {
        return std::optional<Node::Table>(machine_to_table(scene.machine));
      });
  add_errors(fields);
  add_tools(fields);
  add_section(
      fields, table_key(required_key("part"), part_keys(), "the design, and where it is judged"),
      [](const Node& node, Scene& scene, InputErrors& input_errors) {
        scene.part = read_part(node, input_errors);
      },
      [](const Scene& scene) { return std::optional<Node::Table>(part_to_table(scene.part)); });
  add_section(
      fields,
      table_key(required_key("program"), program_keys(),
                "NC or PVT program, or the generator that writes it"),
      [](const Node& node, Scene& scene, InputErrors& input_errors) {
        scene.program = read_program(node, scene.machine.joints, input_errors);
      },
      [](const Scene& scene) {
        return std::optional<Node::Table>(program_to_table(scene.program, scene.machine.joints));
      });
}

/// Reads the section `thermal`. History and room temperature at the top level of the scene replace
/// those of the section.
std::optional<ThermalDescription> read_heat(TableReader& reader, const Key& thermal,
                                            const Scene& scene) {
  const Node* node = section(reader, thermal);
  std::optional<Node> merged_section;
  if (node) merged_section = *node;
  for (const std::string key : {"history", "room", "room_C"}) {
    const Node* scene_value = reader.accept_key(key);
    if (!scene_value) continue;
    if (!node) {
      // A section that is present but invalid is reported already.
      if (!reader.has("thermal"))
        reader.report_invalid(key, "a [thermal] section with " + key, "none");
      continue;
    }
    std::erase_if(*merged_section->table(), [&](const Node::Entry& entry) {
      // `room` and `room_C` exclude each other, so either one of the scene replaces both.
      const bool is_other_room = entry.key.starts_with("room") && !reader.has(entry.key);
      return entry.key == key || (key != "history" && is_other_room);
    });
    merged_section->table()->push_back({key, scene_value->position, *scene_value});
  }
  if (!merged_section) return std::nullopt;
  return read_thermal(*merged_section, scene.machine, scene.seed, reader.input_errors());
}

void add_thermal(Fields<Scene>& fields) {
  const Key thermal = allow_file(
      table_key("thermal", thermal_keys(), "thermal behaviour of the machine and its effects"));
  std::vector<Key> keys{thermal};
  for (Key key : thermal.keys) {
    if (key.name != "history" && key.name != "room" && key.name != "room_C") continue;
    key.sentence = "conditions of this scene, in place of those in `thermal`: " + key.sentence;
    // One of these keys is required in the section, but none at the top level.
    key.exclusive_group.clear();
    key.required = false;
    keys.push_back(std::move(key));
  }
  fields.custom_field(
      std::move(keys),
      [thermal](TableReader& reader, Scene& scene) {
        scene.thermal = read_heat(reader, thermal, scene);
      },
      [](const Scene& scene, Node::Table& table) {
        if (scene.thermal)
          put_value(table, "thermal", thermal_to_table(*scene.thermal, scene.machine, scene.seed));
      });
}

void add_compliance_and_vibration(Fields<Scene>& fields) {
  add_section(
      fields, table_key("compliance", compliance_keys(), "compliance of machine, tool and part"),
      [](const Node& node, Scene& scene, InputErrors& input_errors) {
        scene.compliance = read_compliance(node, scene.machine, input_errors);
      },
      [](const Scene& scene) -> std::optional<Node::Table> {
        if (!scene.compliance) return {};
        return compliance_to_table(*scene.compliance, scene.machine);
      });
  add_list(
      fields, list_key("vibration", vibration_keys(), "harmonics of the spindle, which add up"),
      [](TableReader& reader, Scene& scene) {
        for (const Node* node : reader.tables("vibration"))
          scene.vibrations.push_back(read_vibration(*node, scene.machine, reader.input_errors()));
      },
      [](const Scene& scene) {
        std::vector<Node::Table> tables;
        for (const errors::Vibration& vibration : scene.vibrations)
          tables.push_back(vibration_to_table(vibration));
        return tables;
      });
}

void add_stock(Fields<Scene>& fields) {
  fields.custom_field(
      {table_key("cutting", cutting_keys(),
                 "the blank, and the resolution of the cutting simulation")},
      [](TableReader& reader, Scene& scene) {
        if (const Node* node = reader.section("cutting"))
          scene.cutting = read_cutting(*node, scene.tool, reader.input_errors());
      },
      [](const Scene& scene, Node::Table& table) {
        if (scene.cutting)
          put_value(table, "cutting", cutting_to_table(*scene.cutting, scene.tool));
      });
  const Key material =
      allow_file(table_key(KeyName("material").with_fallback("none: no forces"), material_keys(),
                           "cutting coefficients, used with `[cutting]`"));
  fields.custom_field(
      {material},
      [material](TableReader& reader, Scene& scene) {
        const Node* node = section(reader, material);
        if (!node) return;
        const cutting::CuttingCoefficients coefficients =
            read_material(*node, reader.input_errors());
        if (scene.cutting)
          scene.cutting->material = coefficients;
        else
          reader.report_invalid("material", "a [cutting] section with the material", "none");
      },
      [](const Scene& scene, Node::Table& table) {
        if (scene.cutting && scene.cutting->material)
          put_value(table, "material", material_to_table(*scene.cutting->material));
      });
}

void add_instruments(Fields<Scene>& fields) {
  add_list(
      fields,
      list_key("instrument", instrument_keys(),
               "instruments that measure the machine or the finished part"),
      [](TableReader& reader, Scene& scene) {
        Instruments instruments =
            read_instruments(reader.tables("instrument"), scene.machine, reader.input_errors());
        scene.instruments = std::move(instruments.of_machine);
        scene.part_instruments = std::move(instruments.of_part);
      },
      [](const Scene& scene) {
        return instruments_to_tables({scene.instruments, scene.part_instruments}, scene.machine);
      });
  fields.custom_field(
      {table_key("sensor_choice", sensor_choice_keys(), "choice of temperature sensors")},
      [](TableReader& reader, Scene& scene) {
        const Node* node = reader.section("sensor_choice");
        if (!node) return;
        scene.sensor_choice = read_sensor_choice(*node, reader.input_errors());
        // The seed of the random subsets.
        scene.sensor_choice->study.seed = scene.seed;
        // Without heat there is no drift by which sensors could be rated.
        if (!scene.thermal && !reader.has("thermal"))
          reader.report_invalid("sensor_choice", "a [thermal] section with sensor_choice", "none");
      },
      [](const Scene& scene, Node::Table& table) {
        if (scene.sensor_choice)
          put_value(table, "sensor_choice", sensor_choice_to_table(*scene.sensor_choice));
      });
}

void add_control(Fields<Scene>& fields) {
  fields.custom_field(
      {table_key("control", control_keys(),
                 "what the control believes, where it differs from the nominal machine")},
      [](TableReader& reader, Scene& scene) {
        if (const Node* node = reader.section("control"))
          scene.control = read_control(*node, scene.machine.joints, reader.input_errors());
      },
      [](const Scene& scene, Node::Table& table) {
        Node::Table control = control_to_table(scene.control);
        // By default the control believes in the nominal machine.
        if (!control.empty()) put_value(table, "control", std::move(control));
      });
}

/// Adds a section whose fields set one member of the scene, or with `whole_struct` the scene.
template <typename U, typename M>
void add_member_section(Fields<Scene>& fields, const char* name, M member,
                        const Fields<U>& member_fields, const char* sentence) {
  const Key key = table_key(name, member_fields.keys(), sentence);
  fields.custom_field(
      {key},
      [key, member, member_fields](TableReader& reader, Scene& scene) {
        const Node* node = reader.section(key.name);
        if (!node) return;
        U& value = std::invoke(member, scene);
        value = member_fields.read_table(*node, key.name, reader.input_errors(), value);
      },
      [key, member, member_fields](const Scene& scene, Node::Table& table) {
        put_value(table, key.name, member_fields.to_table(std::invoke(member, scene)));
      });
}

void add_compensation(Fields<Scene>& fields) {
  fields.custom_field(
      {table_key("belief", belief_keys(), "knowledge that compensators are given")},
      [](TableReader& reader, Scene& scene) {
        if (const Node* node = reader.section("belief"))
          scene.belief = read_belief(*node, scene.machine, reader.input_errors());
      },
      [](const Scene& scene, Node::Table& table) {
        put_value(table, "belief", belief_to_table(scene.belief, scene.machine));
      });
  fields.custom_field(
      {table_key("compensation", compensation_keys(), "strategies and channels with their limits")},
      [](TableReader& reader, Scene& scene) {
        if (const Node* node = reader.section("compensation"))
          scene.compensation =
              read_compensation(*node, scene.machine.joints, reader.input_errors());
      },
      [](const Scene& scene, Node::Table& table) {
        put_value(table, "compensation",
                  compensation_to_table(scene.compensation, scene.machine.joints));
      });
}

void check_case(TableReader& reader, Scene& scene) {
  // The reference cases have no compensator, so parse_case() does not know their names.
  if (scene.case_name.empty() || scene.case_name == "error_free" ||
      scene.case_name == "uncompensated")
    return;
  try {
    parse_case(scene.case_name);
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("case", "a case that this version supports", error.what());
  }
}

}  // namespace

const Fields<Scene>& title_scene_fields() {
  static const Fields<Scene> fields =
      Fields<Scene>()
          .text(KeyName("title").with_fallback("name of the file"), &Scene::title,
                "title of pictures and tables")
          .integer("seed", &Scene::seed, 0, std::numeric_limits<std::int64_t>::max(),
                   "seed of all random numbers");
  return fields;
}

const Fields<Scene>& cutting_scene_fields() {
  static const Fields<Scene> fields = [] {
    Fields<Scene> scene_fields;
    add_machine_to_program(scene_fields);
    add_thermal(scene_fields);
    add_compliance_and_vibration(scene_fields);
    add_stock(scene_fields);
    scene_fields.tables(KeyName("fixture").with_fallback("none"), &Scene::fixtures, body_fields(),
                        "clamps of the part: bodies in the workpiece frame, for collision checks");
    scene_fields.check([](TableReader& reader, Scene& scene) {
      check_fixture_names(reader, scene.machine, scene.fixtures);
    });
    add_member_section(scene_fields, "signals", &Scene::signals, signals_fields(),
                       "signals that the control can read, and how often they are recorded");
    add_instruments(scene_fields);
    add_control(scene_fields);
    return scene_fields;
  }();
  return fields;
}

const Fields<Scene>& judging_scene_fields() {
  static const Fields<Scene> fields = [] {
    Fields<Scene> scene_fields;
    add_member_section(scene_fields, "setup", &Scene::setup, setup_fields(),
                       "clamping of the part");
    add_member_section(scene_fields, "datum", &Scene::datum, datum_fields(),
                       "how the control finds the part");
    scene_fields.choice("alignment", &Scene::alignment,
                        {{"none", Alignment::None},
                         {"offset", Alignment::Offset, "the mean"},
                         {"rigid", Alignment::Rigid, "a displacement and a rotation"}},
                        "part of the residual that is removed");
    add_member_section(scene_fields, "sampling", whole_struct, sampling_fields(),
                       "resolution of the path");
    add_member_section(scene_fields, "search", whole_struct, search_fields(),
                       "range in which the machined surface is sought");
    add_member_section(scene_fields, "collision", &Scene::collision, collision_fields(),
                       "collision check");
    scene_fields.check([](TableReader& reader, Scene& scene) {
      check_ignored_names(reader, scene.machine, scene.fixtures);
    });
    add_member_section(scene_fields, "view", &Scene::view, view_fields(), "settings of pictures");
    add_member_section(scene_fields, "limits", &Scene::limits, limits_fields(),
                       "limits above which `abbe` exits with 1");
    add_compensation(scene_fields);
    scene_fields.text(KeyName("case").with_fallback("uncompensated"), &Scene::case_name,
                      "case that `abbe run` cuts without `--case`, named as in `[compare]`; the "
                      "`scene.toml` of a result names its own");
    scene_fields.check(check_case);
    add_member_section(scene_fields, "compare", &Scene::cases, compare_fields(),
                       "compensators to compare");
    return scene_fields;
  }();
  return fields;
}

std::vector<Key> scene_keys() {
  std::vector<Key> keys;
  for (const auto* fields :
       {&title_scene_fields(), &cutting_scene_fields(), &judging_scene_fields()})
    for (Key& key : fields->keys()) keys.push_back(std::move(key));
  keys.push_back(list_key("variant", variant_keys(),
                          "the scene with changes, as a further case of `abbe compare`"));
  return keys;
}

Node to_table(const Scene& scene) {
  Node::Table table;
  // In the order in which the groups are read.
  for (const auto* fields :
       {&title_scene_fields(), &cutting_scene_fields(), &judging_scene_fields()})
    for (Node::Entry& entry : fields->to_table(scene)) table.push_back(std::move(entry));
  Node::Array variants;
  for (const Variant& variant : scene.variants)
    variants.push_back(Node{{}, variant_to_table(variant)});
  if (!variants.empty()) put_value(table, "variant", std::move(variants));
  return Node{{}, std::move(table)};
}

const Fields<Scene>& sampling_fields() {
  static const Fields<Scene> fields =
      Fields<Scene>()
          .number("chord_tolerance_nm", &Scene::chord_tolerance, {0.01, 1e6, false, false},
                  "largest deviation of the commanded tool from its path between two samples; "
                  "between_samples reports the variation of the errors in between: see max_step_mm")
          .number("max_step_mm", &Scene::max_step, positive,
                  "largest distance between two samples; the remaining deviation of an error of "
                  "amplitude a and period p is a (pi step / p)^2 / 2");
  return fields;
}

const Fields<Scene>& search_fields() {
  static const Fields<Scene> fields = Fields<Scene>().number(
      "band_mm", &Scene::band, positive,
      "distance along the normal within which the machined surface is sought; a deeper gouge is "
      "followed to ten times this distance, counted separately and left out of PV and RMS");
  return fields;
}

const Fields<ViewDescription>& view_fields() {
  static const Fields<ViewDescription> fields =
      Fields<ViewDescription>()
          .direction("from", &ViewDescription::from,
                     "direction from the part to the camera, in the part frame")
          .direction("up", &ViewDescription::up,
                     "upward direction in the picture, in the part frame")
          .number_as_written(KeyName("range_um").with_fallback("fitted"),
                             &ViewDescription::range_um, positive,
                             "the colour scale runs from -range to range")
          .check([](TableReader& reader, ViewDescription& view) {
            // If the camera looks along its up direction, its rotation is undefined.
            if (view.from.cross(view.up).norm() < 1e-6 * view.from.norm())
              reader.report_invalid("up", "a direction not parallel to view.from for view.up",
                                    "a parallel one");
          });
  return fields;
}

const Fields<Limits>& limits_fields() {
  static const Fields<Limits> fields =
      Fields<Limits>()
          .number_as_written("pv_um", &Limits::pv_um, non_negative,
                             "limit of the residual; if it is exceeded, `abbe` exits with 1, and a "
                             "gouge deeper than the band exceeds every limit")
          .number_as_written("rms_um", &Limits::rms_um, non_negative, "the same")
          .number_as_written("max_abs_um", &Limits::max_abs_um, non_negative, "the same")
          .number_as_written("form_pv_um", &Limits::form_pv_um, non_negative,
                             "the same for `form_um`, the residual after the areal filter")
          .number_as_written("form_rms_um", &Limits::form_rms_um, non_negative, "the same")
          .number_as_written("texture_sa_um", &Limits::texture_sa_um, non_negative,
                             "the same for `texture_um`, the part that this filter removes")
          .number_as_written("texture_sq_um", &Limits::texture_sq_um, non_negative, "the same")
          .number_as_written("texture_sz_um", &Limits::texture_sz_um, non_negative, "the same")
          .boolean("tolerance", &Limits::tolerance,
                   "true: a FAIL verdict (`part.tolerance_um`) also makes `abbe` exit with 1");
  return fields;
}

}  // namespace abbe::sim
