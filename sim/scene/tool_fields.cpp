#include <algorithm>
#include <set>

#include <fmt/format.h>

#include "sim/scene/bodies.h"
#include "sim/scene/compliance.h"
#include "sim/scene/cutting.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/tool.h"
#include "sim/scene/tool_forms.h"

namespace abbe::sim {

namespace {

using cutting::Cutter;
using cutting::Nose;
using cutting::NoseWave;

constexpr Range tool_size{0.0, 10'000.0, true, false};  // mm
constexpr Range tool_length{-10'000.0, 10'000.0};       // mm

void check_cutter(TableReader& reader, const Cutter& cutter) {
  if (cutter.corner_radius > cutter.radius) {
    reader.report_invalid("corner_radius_mm", "at most the radius for tool.corner_radius_mm",
                          "more");
  } else if (cutter.flank_length < cutter.corner_radius) {
    reader.report_invalid("flank_length_mm", "at least the corner radius for tool.flank_length_mm",
                          "less");
  }
}

Fields<Cutter> dimension_fields(const std::string& kind, ToolKeyFunction tool_key) {
  Fields<Cutter> fields;
  fields.number(tool_key("radius_mm"), &Cutter::radius, tool_size, "radius of the cutter");
  // The corner radius of a ball or flat end follows from its kind.
  if (kind == "ball") fields.derive([](Cutter& cutter) { cutter.corner_radius = cutter.radius; });
  if (kind == "flat") fields.derive([](Cutter& cutter) { cutter.corner_radius = 0.0; });
  if (kind == "bull")
    fields.number(tool_key("corner_radius_mm"), &Cutter::corner_radius, positive,
                  "corner radius of a bull nose, at most the radius");
  return fields.number(tool_key("flank_length_mm"), &Cutter::flank_length, tool_size,
                       "of a cutter: cutting length above the tip; above it the cutter continues "
                       "with the same radius as a shank");
}

/// Returns the fields of the dimensions and a check that they fit each other.
Fields<Cutter> cutter_fields(const std::string& kind, ToolKeyFunction tool_key) {
  const Fields<Cutter> dimensions = dimension_fields(kind, tool_key);
  return Fields<Cutter>().custom_field(
      dimensions.keys(),
      [dimensions](TableReader& reader, Cutter& cutter) {
        const std::size_t error_count = reader.input_errors().list().size();
        cutter = dimensions.read(reader, cutter);
        // A missing or invalid dimension has a default, for which the check would mislead.
        if (has_all_keys(reader, dimensions.keys()) &&
            reader.input_errors().list().size() == error_count)
          check_cutter(reader, cutter);
      },
      [dimensions](const Cutter& cutter, Node::Table& table) {
        append_entries(table, dimensions.to_table(cutter));
      });
}

Fields<Nose> nose_fields(ToolKeyFunction tool_key) {
  return Fields<Nose>().number(tool_key("radius_mm"), &Nose::radius, tool_size,
                               "radius of the edge of a turning tool");
}

Fields<NoseWave> wave_fields() {
  return Fields<NoseWave>()
      .integer(required_key("order"), &NoseWave::order, 1, 1000, "number of waves in a full turn")
      .number(required_key("amplitude_um"), &NoseWave::amplitude, any_number,
              "amplitude of the wave, outwards")
      .number("phase_deg", &NoseWave::phase, any_number,
              "phase of its cosine, from the tool's x to z");
}

bool is_form(const std::string& kind) {
  return kind == "apt" || kind == "form" || kind == "profile";
}

bool has_profile(const std::string& kind) { return kind == "insert" || kind == "edge"; }

Fields<ToolDescription> nominal_fields(const std::string& kind) {
  if (is_form(kind)) return form_cutter_fields(kind, nominal_selector);
  if (has_profile(kind)) return insert_fields(kind, nominal_selector);
  Fields<ToolDescription> fields;
  if (kind == "nose")
    return fields.derive([](ToolDescription& tool) { tool.nominal = Nose{}; })
        .include_fields(
            [](auto& tool) -> auto& { return std::get<Nose>(tool.nominal); },
            nose_fields(required_key));
  return fields.include_fields(
      [](auto& tool) -> auto& { return std::get<Cutter>(tool.nominal); },
      cutter_fields(kind, required_key));
}

Fields<ToolDescription> centring_fields() {
  return Fields<ToolDescription>()
      .number("centring_offset_mm", &ToolDescription::centring_offset, any_number,
              "turning: offset of the tip along the tool's x")
      .number("centring_height_mm", &ToolDescription::centring_height, any_number,
              "turning: offset of the tip along the tool's y");
}

Fields<ToolDescription> actual_fields(const std::string& kind) {
  Fields<ToolDescription> fields;
  fields.number(optional_actual("length_mm"), &ToolDescription::actual_length, tool_length,
                "length from the nose of the spindle");
  if (is_form(kind))
    return fields.include_fields(whole_struct, form_cutter_fields(kind, actual_selector));
  // The offset of the tip belongs to the setting of the tool and not to its form.
  if (has_profile(kind))
    return fields.include_fields(whole_struct, insert_fields(kind, actual_selector))
        .include_fields(whole_struct, centring_fields());
  if (kind != "nose")
    return fields.include_fields(
        [](auto& tool) -> auto& { return std::get<Cutter>(tool.actual); },
        cutter_fields(kind, optional_actual));
  return fields
      .include_fields(
          [](auto& tool) -> auto& { return std::get<Nose>(tool.actual); },
          nose_fields(optional_actual)
              .tables("wave", &Nose::waves, wave_fields(),
                      "waves of the edge, for `kind = \"nose\"` only"))
      .include_fields(whole_struct, centring_fields());
}

Fields<ToolWear> wear_fields() {
  return Fields<ToolWear>()
      .number(KeyName("time_min").in_exclusive_group("use"), &ToolWear::time_s, positive,
              "cutting time at feed after which the cutter has lost `radius_um` and `length_um`")
      .number(KeyName("way_mm").in_exclusive_group("use"), &ToolWear::distance, positive,
              "distance of the tip in the workpiece at feed, likewise")
      .number("radius_um", &ToolWear::radius, non_negative,
              "loss of radius by then; the tip stays in place")
      .number("length_um", &ToolWear::length, non_negative, "loss of length by then, at the tip")
      .check([](TableReader& reader, ToolWear& wear) {
        if (!wear.time_s && !wear.distance)
          reader.report_missing("time_min", "a time, or a way_mm,");
        if (wear.time_s && wear.distance)
          reader.report_invalid(
              "way_mm", "either way_mm or time_min, to which the wear is proportional", "both");
      });
}

/// A kind of tool, with the fields of the nominal and of the actual tool.
struct ToolKind {
  EnumChoice selector;
  Fields<ToolDescription> nominal, actual;
};

ToolKind make_tool_kind(const char* word, const char* sentence) {
  ToolKind kind{{word, sentence, {}}, nominal_fields(word), actual_fields(word)};
  kind.selector.keys = kind.nominal.keys();
  return kind;
}

const std::vector<ToolKind>& tool_kinds() {
  static const std::vector<ToolKind> kinds{
      make_tool_kind("ball", "hemispherical end"),
      make_tool_kind("bull", "flat end with a rounded corner"),
      make_tool_kind("flat", "flat end with a sharp corner"),
      make_tool_kind("apt",
                     "cutter described by the seven parameters of APT: taper, tapered ball, drill "
                     "point, dovetail"),
      make_tool_kind("form", "convex outline of lines and arcs about the axis: barrel, lens, oval"),
      make_tool_kind("profile",
                     "outline of lines and arcs about the axis that may be concave: step drill, "
                     "T-slot, dovetail on a shank, grooved form cutter, corner rounding"),
      make_tool_kind("nose", "a turning tool"),
      make_tool_kind("insert", "a turning tool with a nose and two straight edges"),
      make_tool_kind("edge", "a turning tool with a convex edge of lines and arcs")};
  return kinds;
}

/// Returns a kind by its name; the first kind if the name is unknown.
const ToolKind& tool_kind_by_name(const std::string& word) {
  for (const ToolKind& kind : tool_kinds())
    if (kind.selector.word == word) return kind;
  return tool_kinds().front();
}

const ToolKind& read_tool_kind(TableReader& reader) {
  std::set<std::string> choices;
  for (const ToolKind& kind : tool_kinds()) choices.insert(kind.selector.word);
  return tool_kind_by_name(reader.word("kind", choices, true).value_or(""));
}

/// Returns the kind of a tool. It is not stored, but follows from the forms of the nominal and the
/// actual tool.
const ToolKind& find_tool_kind(const ToolDescription& tool) {
  constexpr const char* form_kinds[] = {"",        "apt",    "form",
                                        "profile", "insert", "edge"};  // in the order of ToolForm
  static_assert(std::size(form_kinds) == std::variant_size_v<ToolForm>);
  if (tool.nominal_form.index() > 0)
    return tool_kind_by_name(form_kinds[tool.nominal_form.index()]);
  const auto* nominal = std::get_if<Cutter>(&tool.nominal);
  if (!nominal) return tool_kind_by_name("nose");
  const Cutter& actual = std::get<Cutter>(tool.actual);
  // Both tools have the same kind, so the more general kind is taken if their corners differ.
  if (nominal->corner_radius == 0.0 && actual.corner_radius == 0.0)
    return tool_kind_by_name("flat");
  const bool is_ball =
      nominal->corner_radius == nominal->radius && actual.corner_radius == actual.radius;
  return tool_kind_by_name(is_ball ? "ball" : "bull");
}

/// Checks that a tool with wear is a milling cutter whose wear is less than half its radius.
void check_wear(TableReader& reader, ToolDescription& tool) {
  const auto* cutter = std::get_if<Cutter>(&tool.actual);
  if (!tool.wear) return;
  if (cutter == nullptr)
    reader.report_invalid("wear", "a milling cutter with wear", "a turning tool");
  else if (cutter->outline)
    reader.report_invalid("wear", "a ball, bull-nosed or flat end with wear", "a form cutter");
  else if (!(tool.wear->radius < 0.5 * cutter->radius))
    reader.report_invalid("wear", "wear of less than half the radius", "more");
}

/// Checks that a turning tool states no shank; only the shank of a milling cutter is a cylinder.
void check_shank(TableReader& reader, ToolDescription& tool) {
  if (tool.shank_radius && std::holds_alternative<Nose>(tool.nominal))
    reader.report_invalid("shank_radius_mm", "a milling cutter with shank_radius_mm",
                          "a turning tool");
}

/// Checks that a flank is not longer than its tool.
/// @param table  table of the nominal or the actual tool
void check_flank(TableReader& reader, const Node& table, const std::string& section_name,
                 const ToolShape& shape, double length) {
  const auto* cutter = std::get_if<Cutter>(&shape);
  if (!cutter || length >= cutter->flank_length) return;
  const Node* flank = table.find("flank_length_mm");
  // The error is reported at the flank length if the table states it, else at the tool length.
  const Node* reported_node = flank ? flank : table.find("length_mm");
  if (!reported_node) return;
  reader.input_errors().add(
      reported_node->position,
      flank ? fmt::format("at most the length of the tool, {:g} mm, for {}.flank_length_mm", length,
                          section_name)
            : fmt::format("at least the length of the flank, {:g} mm, for {}.length_mm",
                          cutter->flank_length, section_name),
      fmt::format("{:g}", flank ? cutter->flank_length : length));
}

/// Checks that the flanks of the nominal and the actual cutter are not longer than the tool. Tables
/// with input errors are not checked, as their values are defaults.
void check_flanks(TableReader& reader, ToolDescription& tool) {
  const Node* actual = reader.node().find("actual");
  if (actual && !actual->table()) actual = nullptr;
  const auto has_input_errors = [&](const Node* table) {
    if (!table) return false;
    return std::ranges::any_of(*table->table(), [&](const Node::Entry& entry) {
      const SourcePosition& position = entry.node.position;
      return std::ranges::any_of(reader.input_errors().list(), [&](const BadInput& error) {
        return error.file == *position.file && error.line == position.line &&
               error.column == position.column;
      });
    });
  };
  if (has_input_errors(&reader.node()) || has_input_errors(actual) || !reader.has("length_mm") ||
      !has_all_keys(reader, read_tool_kind(reader).nominal.keys()))
    return;
  check_flank(reader, reader.node(), "tool", tool.nominal, tool.length);
  if (actual) check_flank(reader, *actual, "tool.actual", tool.actual, tool.actual_length);
}

/// Checks that the tip of a cutter lies outside of the holder.
void check_holder(TableReader& reader, ToolDescription& tool) {
  if (!tool.holder || tool.holder->rows() == 0 || std::holds_alternative<Nose>(tool.nominal))
    return;
  const double lower_end_mm = (*tool.holder)(0, 1);
  if (lower_end_mm > 0.0) return;
  const Node* heights_node = reader.node().find("holder")->find("heights_mm");
  reader.input_errors().add(
      heights_node->position,
      "heights above 0 for tool.holder.heights_mm, measured upwards from the tip: the tip is "
      "outside the holder",
      fmt::format("a holder that begins {}",
                  lower_end_mm < 0.0 ? fmt::format("{:g} mm below the tip", -lower_end_mm)
                                     : std::string("at the tip")));
}

Key tool_kind_key() {
  Key kind = make_key(required_key("kind"), Key::Kind::Text, "kind of tool");
  for (const ToolKind& tool_kind : tool_kinds()) kind.choices.push_back(tool_kind.selector);
  return kind;
}

Key actual_key() {
  // The bull nose has all keys of ball and flat ends; the other kinds add theirs.
  std::vector<Key> keys = tool_kind_by_name("bull").actual.keys();
  for (const char* kind : {"apt", "profile", "form", "nose", "insert", "edge"})
    for (Key& key : tool_kind_by_name(kind).actual.keys())
      // Kinds have keys in common; each appears once in the manual.
      if (std::ranges::none_of(keys, [&](const Key& other) { return other.name == key.name; }))
        keys.push_back(std::move(key));
  return make_key(KeyName("actual").with_fallback("as nominal"), Key::Kind::Table,
                  "the actual tool, where it differs", std::move(keys));
}

const Fields<ToolDescription>& tool_fields() {
  using Tool = ToolDescription;
  static const Fields<Tool> fields =
      Fields<Tool>()
          .text("name", &Tool::name, "name of the tool")
          .custom_field(
              {tool_kind_key()},
              [](TableReader& reader, Tool& tool) {
                tool = read_tool_kind(reader).nominal.read(reader, std::move(tool));
              },
              [](const Tool& tool, Node::Table& table) {
                put_value(table, "kind", find_tool_kind(tool).selector.word);
                append_entries(table, find_tool_kind(tool).nominal.to_table(tool));
              })
          .number(required_key("length_mm"), &Tool::length, tool_length,
                  "length from the nose of the spindle to the tip; for a turning tool, to the "
                  "centre of its edge")
          .number(KeyName("shank_radius_mm").with_fallback("that of the cutter"),
                  &Tool::shank_radius, tool_size,
                  "of a cutter: radius above its flank up to the holder, for collision checks and "
                  "for the warning of a shank in the design")
          .table(KeyName("holder").with_fallback("none"), &Tool::holder,
                 profile_fields("from the tip"), "a body of revolution, for collision checks")
          .integer(KeyName("number").with_fallback("none: a warning is given for every call"),
                   &Tool::number, 0, 999'999,
                   "T number by which a program calls it; a call of any other number is rejected")
          .derive([](Tool& tool) {
            // The table `actual` states differences from the nominal tool only.
            tool.actual = tool.nominal;
            tool.actual_form = tool.nominal_form;
            tool.actual_length = tool.length;
          })
          .custom_field(
              {actual_key()},
              [](TableReader& reader, Tool& tool) {
                if (const Node* node = reader.section("actual"))
                  tool = read_tool_kind(reader).actual.read_table(
                      *node, reader.qualified_name("actual"), reader.input_errors(),
                      std::move(tool));
              },
              [](const Tool& tool, Node::Table& table) {
                put_value(table, "actual", find_tool_kind(tool).actual.to_table(tool));
              })
          .table(KeyName("wear").with_fallback("none"), &Tool::wear, wear_fields(),
                 "wear of the actual cutter, proportional to its use")
          .table(KeyName("cutting_edges").with_fallback("those of `[cutting]`"), &Tool::flutes,
                 flutes_fields(), "flutes of this cutter, in place of those of `[cutting]`")
          .table(KeyName("material").with_fallback("`[material]`"), &Tool::material,
                 material_fields(),
                 "cutting coefficients of this tool, in place of those of `[material]`")
          .table(KeyName("compliance").with_fallback("`[compliance.tool]`"), &Tool::compliance,
                 tool_compliance_fields(),
                 "compliance of this tool from the spindle nose to the tip, at the tip in the tool "
                 "frame")
          .check(check_wear)
          .check(check_shank)
          .check(check_flanks)
          .check(check_holder);
  return fields;
}

ToolDescription read_tool(const Node& table, InputErrors& input_errors) {
  return tool_fields().read_table(table, "tool", input_errors);
}

bool turns_workpiece(const ToolDescription& tool) {
  return std::holds_alternative<Nose>(tool.nominal);
}

/// Checks the number and the type of one of several tools.
/// @param tools  the preceding tools
void check_tool_numbers(const std::vector<ToolDescription>& tools, const ToolDescription& tool,
                        const SourcePosition& position, InputErrors& input_errors) {
  if (!tool.number) {
    input_errors.add(position, "tool.number for each of several tools", "a tool without a number");
    return;
  }
  for (const ToolDescription& other : tools) {
    if (other.number == tool.number)
      input_errors.add(position, "a tool.number that no other tool has",
                       std::to_string(*tool.number) + " again");
    // Blank and simulation are either those of milling or those of turning.
    if (turns_workpiece(other) != turns_workpiece(tool))
      input_errors.add(position, "tools that are all for milling or all for turning",
                       "one of each kind");
  }
}

}  // namespace

KeyName optional_actual(KeyName key) { return key.with_fallback("as nominal"); }

ExpectedAndSeen parse_message(const std::string& message) {
  const std::string expected = "expected ", seen = ", seen ";
  const std::size_t begin = std::min(message.find(expected) + expected.size(), message.size());
  const std::size_t end = std::min(message.rfind(seen), message.size());
  return {message.substr(begin, end - begin),
          end < message.size() ? message.substr(end + seen.size()) : "other numbers"};
}

void report_point_error(TableReader& reader, const PointKeys& keys,
                        const std::vector<cutting::OutlinePoint>& points,
                        const cutting::OutlineError& error) {
  // The error states coordinates; the nearest point is the entry of the list.
  const auto nearest_point = std::ranges::min_element(
      points, {}, [&](const cutting::OutlinePoint& point) { return (point.at - error.at).norm(); });
  const std::size_t entry = std::size_t(nearest_point - points.begin());
  const std::string key = keys[std::size_t(error.number)];
  const Node* list = reader.node().find(key);
  const bool has_entry = list && list->array() && entry < list->array()->size();
  const ExpectedAndSeen message = parse_message(error.what());
  reader.input_errors().add(
      has_entry ? (*list->array())[entry].position : reader.position(),
      fmt::format("{} for {}, entry {}", message.expected, reader.qualified_name(key), entry + 1),
      message.seen);
}

KeyName optional_for_both(ToolKeyFunction tool_key, const KeyName& key) {
  return tool_key == required_key ? key : tool_key(key);
}

bool has_all_keys(const TableReader& reader, const std::vector<Key>& keys) {
  return std::ranges::none_of(
      keys, [&](const Key& key) { return key.required && !reader.has(key.name); });
}

std::vector<ToolDescription> read_tools(const Node& section, InputErrors& input_errors) {
  if (section.table()) return {read_tool(section, input_errors)};
  const Node::Array* list = section.array();
  if (!list || list->empty()) {
    input_errors.add(section.position, "a table, a file or a list of them for tool",
                     display_text(section));
    return {ToolDescription{}};
  }
  std::vector<ToolDescription> tools;
  for (const Node& node : *list) {
    if (node.text()) continue;  // the file is invalid, which is reported
    const std::size_t error_count = input_errors.list().size();
    if (!node.table()) {
      input_errors.add(node.position, "a table or a file for tool", display_text(node));
      continue;
    }
    ToolDescription tool = read_tool(node, input_errors);
    // A single tool needs no number.
    if (list->size() > 1 && input_errors.list().size() == error_count)
      check_tool_numbers(tools, tool, node.position, input_errors);
    tools.push_back(std::move(tool));
  }
  // Reading of the scene continues after an error, and later sections need a tool.
  if (tools.empty()) tools.emplace_back();
  return tools;
}

Node::Table tool_to_table(const ToolDescription& tool) { return tool_fields().to_table(tool); }

std::vector<Key> tool_keys() { return tool_fields().keys(); }

}  // namespace abbe::sim
