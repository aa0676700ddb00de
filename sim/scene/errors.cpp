#include "sim/scene/errors.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string_view>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Core>

#include "errors/element.h"
#include "errors/geometric.h"
#include "kinematics/hash.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/scene/error_tables.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

namespace {

using errors::Curve;
using errors::Element;
using errors::ElementName;

/// Appends a table to the others, without merging elements.
void append(errors::GeometricErrors& total, ErrorsSection table) {
  const auto first_element = int(total.elements.size());
  for (Element& element : table.geometric.elements) {
    for (Curve& curve : element.curves) curve.scale *= table.scale;
    total.elements.push_back(std::move(element));
  }
  for (const errors::MeasuringLine& line : table.geometric.measuring_lines)
    total.measuring_lines.push_back(line);
  const errors::Covariance& covariance = table.geometric.covariance;
  const auto m = Eigen::Index(total.covariance.of.size()), k = Eigen::Index(covariance.of.size());
  // No table states how its numbers are correlated with those of another; these blocks are zero.
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(m + k, m + k);
  matrix.topLeftCorner(m, m) = total.covariance.matrix;
  matrix.bottomRightCorner(k, k) = covariance.matrix;
  total.covariance.matrix = std::move(matrix);
  for (errors::Coefficient number : covariance.of) {
    number.element += first_element;
    total.covariance.of.push_back(number);
  }
}

}  // namespace

errors::GeometricErrors join_errors_tables(std::vector<ErrorsSection> tables,
                                           const MachineDescription& machine) {
  errors::GeometricErrors appended;
  for (ErrorsSection& table : tables) append(appended, std::move(table));
  const auto rank = [&](const ElementName& name) {
    std::size_t joint = 0;
    // The chain names the spindle nose 's'; elements name it 'S'.
    while (joint < machine.joints.size() && machine.joints[joint].name != name.axis &&
           !(machine.joints[joint].name == 's' && name.axis == 'S')) {
      ++joint;
    }
    return std::tuple(joint, name.location, name.component(), name.axis);
  };
  std::vector<std::size_t> order(appended.elements.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  // A stable sort keeps the curves of an element in the order of the file.
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return rank(appended.elements[a].name) < rank(appended.elements[b].name);
  });
  errors::GeometricErrors result = appended;
  result.elements.clear();
  for (const std::size_t index : order) {
    const Element& element = appended.elements[index];
    if (result.elements.empty() || !(result.elements.back().name == element.name))
      result.elements.push_back({element.name, {}});
    std::vector<Curve>& curves = result.elements.back().curves;
    for (std::size_t i = 0; i < appended.covariance.of.size(); ++i) {
      // The old indices are compared, because a new index in `result` could match a second time.
      if (appended.covariance.of[i].element != int(index)) continue;
      result.covariance.of[i].element = int(result.elements.size()) - 1;
      result.covariance.of[i].curve += int(curves.size());
    }
    curves.insert(curves.end(), element.curves.begin(), element.curves.end());
  }
  return result;
}

namespace {

using Eigen::Vector3d;
using kinematics::Joint;
using kinematics::Motion;

std::uint64_t mixed_seed(std::uint64_t x) { return split_mix::mixed(x + split_mix::golden); }

/// One errors table while it is read.
struct ErrorsTable {
  struct Origin {
    SourcePosition position;
    bool derived = false;  ///< from the slope of another element; such elements add up
  };
  ErrorsSection section;
  std::vector<Origin> origins;  ///< one per element
};

void add(ErrorsTable& table, Element element, const ErrorsTable::Origin& origin) {
  table.section.geometric.elements.push_back(std::move(element));
  table.origins.push_back(origin);
}

Element constant_element(const ElementName& name, double value,
                         const std::string& curve_name = "") {
  return {name, {Curve{errors::Constant{value}, curve_name, {}, false, 1.0}}};
}

/// Returns the joint of an element's axis, null if there is none. 'S' denotes the spindle nose
/// unless a joint has that name.
const Joint* find_joint(const MachineDescription& machine, char axis) {
  const Joint* nose = nullptr;
  for (const Joint& joint : machine.joints) {
    if (joint.name == axis) return &joint;
    if (joint.name == 's' && axis == 'S') nose = &joint;
  }
  return nose;
}

ElementUnits element_units(const ElementName& name, const MachineDescription& machine) {
  const Joint* joint = find_joint(machine, name.axis);
  // The manual has no machine; there the letter decides.
  const bool is_slide = joint
                            ? joint->motion == Motion::Linear
                            : std::string_view("XYZUVW").find(name.axis) != std::string_view::npos;
  return {name.is_angle() ? "_urad" : "_um", is_slide ? "_mm" : "_deg"};
}

// ---- elements

/// Returns the default seed of a curve.
std::uint64_t curve_seed(std::uint64_t scene_seed, const ElementName& name, std::size_t index) {
  std::uint64_t seed = mixed_seed(scene_seed);
  // The seed depends on the name, so that another element does not change the draws of this one.
  for (const char c : to_string(name)) seed = mixed_seed(seed ^ static_cast<unsigned char>(c));
  // TOML integers are signed, so the highest bit must be zero.
  return mixed_seed(seed ^ std::uint64_t(index)) >> 1;
}

// Straightness is a translation across the slide; along it, the translation is positioning.
bool is_straightness(const ElementName& name, const Joint* joint) {
  return joint && joint->motion == Motion::Linear && !name.location && !name.is_angle() &&
         joint->direction_b.cross(Vector3d(Vector3d::Unit(name.component()))).norm() >= 1e-9;
}

/// Removes the line from a straightness curve and adds its slope to the squareness of the slides.
void transfer_slope(ErrorsTable& table, Curve& curve, const ElementName& name,
                    errors::Detrend method, const SourcePosition& position,
                    const MachineDescription& machine, InputErrors& input_errors) {
  const Joint* slide = find_joint(machine, name.axis);
  if (!slide) return;  // check_against_machine() reports the unknown axis
  if (!is_straightness(name, slide)) {
    input_errors.add(position, "detrend for a straightness of a slide only", to_string(name));
    return;
  }
  const errors::DetrendedTable detrended =
      errors::detrend(std::get<errors::Table>(curve.shape), method);
  curve.shape = detrended.table;
  // A slide on the workpiece side moves against its command, which reverses the slope over the
  // command.
  const bool is_reversed =
      slide->side == kinematics::Side::Workpiece && curve.argument == errors::Argument::Command;
  const double factor = curve.scale * (curve.negate ? -1.0 : 1.0) * (is_reversed ? -1.0 : 1.0);
  const double slope = factor * detrended.slope;
  try {
    for (const auto& contribution : errors::to_squareness_errors(name, slope, machine.joints))
      add(table,
          constant_element(contribution.name, contribution.value, "slope of " + to_string(name)),
          {position, true});
  } catch (const std::invalid_argument& error) {
    input_errors.add(position, "a slope that is equivalent to a squareness of the machine",
                     error.what());
  }
}

/// The parts of the scene that reading an errors table needs.
struct ErrorsContext {
  MachineDescription machine;
  std::uint64_t seed = 0;
};

void read_curves(TableReader& reader, ErrorsTable& table, const Node::Entry& entry,
                 const ElementName& name, const ErrorsContext& context) {
  const ElementUnits units = element_units(name, context.machine);
  InputErrors& input_errors = reader.input_errors();
  Element element{name, {}};
  std::size_t index = 0;
  for (const Node* node : reader.tables(entry.key)) {
    const std::size_t error_count = input_errors.list().size();
    auto [curve, detrend] = curve_fields(name, units, curve_seed(context.seed, name, index++))
                                .read_table(*node, "errors." + to_string(name), input_errors);
    // An invalid curve may lack the table that detrending needs.
    if (input_errors.list().size() != error_count) continue;
    if (detrend)
      transfer_slope(table, curve, name, *detrend, node->find("detrend")->position, context.machine,
                     input_errors);
    element.curves.push_back(std::move(curve));
  }
  add(table, std::move(element), {entry.position});
}

/// Returns the number of an entry in the unit of another key, as ", which is EXX_um = 5"; empty if
/// the dimensions differ.
std::string conversion_text(const Node::Entry& entry, const std::string& key) {
  const auto is_angle = [](const std::string& name) {
    return name.ends_with("rad") || name.ends_with("deg") || name.ends_with("arcsec");
  };
  const auto* real = std::get_if<double>(&entry.node.value);
  const auto* integer = std::get_if<std::int64_t>(&entry.node.value);
  if ((!real && !integer) || is_angle(entry.key) != is_angle(key)) return {};
  const double value =
      (real ? *real : double(*integer)) * unit_factor(entry.key) / unit_factor(key);
  return fmt::format(", which is {} = {:.6g}", key, value);
}

void read_element(TableReader& reader, ErrorsTable& table, const Node::Entry& entry,
                  const ErrorsContext& context) {
  const std::string stem(key_without_unit(entry.key));
  ElementName name;
  try {
    name = errors::parse_element_name(stem);
  } catch (const std::invalid_argument&) {
    return;  // not an element; TableReader::close() reports an unknown key
  }
  reader.accept_key(entry.key);
  const std::string in_unit = stem + element_units(name, context.machine).value;
  // A key without a unit has curves, a key with a unit has a constant.
  if (stem == entry.key) {
    read_curves(reader, table, entry, name, context);
  } else if (entry.key == in_unit) {
    add(table, constant_element(name, reader.number(entry.key, any_number, 0.0)), {entry.position});
  } else {
    reader.input_errors().add(entry.position, in_unit + " for the element " + stem,
                              entry.key + conversion_text(entry, in_unit));
  }
}

void read_elements(TableReader& reader, ErrorsTable& table, const ErrorsContext& context) {
  for (const Joint& joint : context.machine.joints) {
    // All element names of the machine are made known, so that misspelt keys get a suggestion.
    const char axis = joint.name == 's' ? 'S' : joint.name;
    for (const char direction : std::string_view("XYZABC")) {
      for (const bool location : {false, true}) {
        const ElementName name{direction, axis, location};
        reader.accept_key(to_string(name));
        reader.accept_key(to_string(name) + element_units(name, context.machine).value);
      }
    }
  }
  for (const Node::Entry& entry : *reader.node().table())
    read_element(reader, table, entry, context);
}

bool is_plain(const Curve& curve) {
  return std::holds_alternative<errors::Constant>(curve.shape) && curve.name.empty() &&
         curve.argument == errors::Argument::Command && !curve.negate && curve.scale == 1.0;
}

void write_elements(const ErrorsTable& errors_table, Node::Table& table,
                    const MachineDescription& machine) {
  for (const Element& element : errors_table.section.geometric.elements) {
    const ElementUnits units = element_units(element.name, machine);
    const std::string key = to_string(element.name);
    // A plain constant is written in the short form that users write themselves.
    if (element.curves.size() == 1 && is_plain(element.curves.front())) {
      const double value = std::get<errors::Constant>(element.curves.front().shape).value;
      put_value(table, key + units.value, value / unit_factor(key + units.value));
      continue;
    }
    // Every curve is written with its seed, so the default seed does not matter.
    const Fields<CurveEntry> fields = curve_fields(element.name, units, 0);
    Node::Array curves;
    for (const Curve& curve : element.curves)
      curves.push_back(Node{{}, fields.to_table({curve, std::nullopt})});
    put_value(table, key, std::move(curves));
  }
}

std::vector<Key> element_keys() {
  const std::string axis_letters = "[XYZUVWABCS]";
  const auto constant_key = [&](const std::string& unit, const std::string& directions) {
    Key key = make_key("E.._" + unit, Key::Kind::Number, "constant value of an element");
    key.pattern = "(E" + directions + "0?|" + directions + "0)" + axis_letters + "_" + unit;
    return key;
  };
  Key curves =
      make_key("E..", Key::Kind::Tables,
               "element: a curve, or a list of curves that add up; location elements are constant");
  curves.pattern = "(E[XYZABC]0?|[XYZABC]0)" + axis_letters;
  curves.keys = curve_keys();
  return {constant_key("um", "[XYZ]"), constant_key("urad", "[ABC]"), curves};
}

// ---- whole tables

/// A file with the tables of all elements of one axis.
struct WholeTable {
  errors::ElementConversionOptions use;
  double scale = 1.0;
  std::optional<errors::Detrend> detrend;
  std::optional<errors::ElementTable> table;
};

Fields<WholeTable> whole_table_fields() {
  const auto use =
      interpolation_fields<errors::ElementConversionOptions>()
          .include_fields(whole_struct, argument_fields<errors::ElementConversionOptions>())
          .text("name", &errors::ElementConversionOptions::name,
                "name of every curve, used in reports");
  return Fields<WholeTable>()
      .include_fields(&WholeTable::use, use)
      .number("scale", &WholeTable::scale, any_number, "factor of every curve")
      .include_fields(whole_struct, detrend_fields<WholeTable>())
      .custom_field(
          {table_file_key()},
          [](TableReader& reader, WholeTable& whole) { whole.table = read_element_csv(reader); },
          [](const WholeTable&, Node::Table&) {});
}

void read_whole_table(ErrorsTable& table, const Node& node, const MachineDescription& machine,
                      InputErrors& input_errors) {
  const std::size_t error_count = input_errors.list().size();
  const WholeTable whole = whole_table_fields().read_table(node, "errors.tables", input_errors);
  if (!whole.table || input_errors.list().size() != error_count) return;
  const Joint* slide = find_joint(machine, whole.table->axis);
  for (Element& element : errors::to_elements(*whole.table, whole.use)) {
    Curve& curve = element.curves.front();
    curve.scale = whole.scale;
    // Only the slopes of straightness columns are squareness.
    if (whole.detrend && is_straightness(element.name, slide))
      transfer_slope(table, curve, element.name, *whole.detrend, node.find("detrend")->position,
                     machine, input_errors);
    add(table, std::move(element), {node.find("file")->position});
  }
}

// ---- measuring lines

Fields<errors::MeasuringLine> line_fields() {
  using errors::MeasuredBy;
  using errors::MeasuringLine;
  return Fields<MeasuringLine>()
      .vector(required_key("at_mm"), &MeasuringLine::at_b,
              "a point of the line in the bed frame, with all axes at zero")
      .choice(required_key("by"), &MeasuringLine::by,
              {{"tool", MeasuredBy::Tool, "the measured point is where the tool was"},
               {"carriage", MeasuredBy::Carriage, "the measured point travels with the carriage"}},
              "what carried the measured point");
}

void read_lines(TableReader& reader, ErrorsTable& table, const MachineDescription& machine) {
  const Node* section = reader.section("measured");
  if (!section) return;
  TableReader lines(*section, "errors.measured", reader.input_errors());
  for (const Joint& joint : machine.joints) {
    // Only for slides do the translations depend on the line of measurement.
    if (joint.motion != Motion::Linear) continue;
    const std::string axis(1, joint.name);
    const Node* node = lines.section(axis);
    if (!node) continue;
    errors::MeasuringLine line;
    line.axis = joint.name;
    table.section.geometric.measuring_lines.push_back(
        line_fields().read_table(*node, lines.qualified_name(axis), reader.input_errors(), line));
  }
  // If the machine is invalid, there are no joints, and every axis would be reported as unknown.
  if (!machine.joints.empty()) lines.close();
}

void write_lines(const ErrorsTable& errors_table, Node::Table& table) {
  Node::Table lines;
  for (const errors::MeasuringLine& line : errors_table.section.geometric.measuring_lines)
    put_value(lines, std::string(1, line.axis), line_fields().to_table(line));
  if (!lines.empty()) put_value(table, "measured", std::move(lines));
}

Key lines_key() {
  Key line = make_key("<axis>", Key::Kind::Table, "line of one slide");
  line.pattern = "[XYZUVW]";
  line.keys = line_fields().keys();
  Key lines = make_key(KeyName("measured").with_fallback("at the joint's point"), Key::Kind::Table,
                       "lines on which the translations of slides were measured");
  lines.keys = {line};
  return lines;
}

// ---- the section

void check_machine(TableReader& reader, const MachineDescription& machine) {
  const std::string stated_code = reader.text("machine", "");
  // An invalid machine is reported with its own section.
  if (stated_code.empty() || machine.joints.empty()) return;
  const std::string code = kinematics::to_string(kinematics::chain_topology(machine.joints));
  if (stated_code != code)
    reader.report_invalid("machine", "errors of the machine " + code, quoted_excerpt(stated_code));
}

Fields<ErrorsTable> errors_fields(const ErrorsContext& context) {
  Key tables = make_key("tables", Key::Kind::Tables, "error motions of one axis from a CSV file");
  tables.keys = whole_table_fields().keys();
  Key covariance =
      make_key(KeyName("covariance").with_fallback("none: the errors are taken as exact"),
               Key::Kind::Table, "uncertainty of the coefficients");
  covariance.keys = covariance_keys();
  const auto write_nothing = [](const ErrorsTable&, Node::Table&) {};
  return Fields<ErrorsTable>()
      .custom_field(
          {make_key("name", Key::Kind::Text, "name of the table")},
          [](TableReader& reader, ErrorsTable&) { reader.text("name", ""); }, write_nothing)
      .custom_field(
          {make_key(KeyName("machine").with_fallback("any"), Key::Kind::Text,
                    "structural code of the machine whose errors were identified, as written by "
                    "`abbe identify`; on any other machine these errors are an input error")},
          [context](TableReader& reader, ErrorsTable&) { check_machine(reader, context.machine); },
          write_nothing)
      .custom_field(
          {unidentified_key()},
          [](TableReader& reader, ErrorsTable&) { read_unidentified(reader); }, write_nothing)
      .number(
          "scale", [](auto& table) -> auto& { return table.section.scale; }, any_number,
          "factor of everything in this table")
      .custom_field(
          element_keys(),
          [context](TableReader& reader, ErrorsTable& errors_table) {
            read_elements(reader, errors_table, context);
          },
          [context](const ErrorsTable& errors_table, Node::Table& table) {
            write_elements(errors_table, table, context.machine);
          })
      .custom_field(
          {tables},
          [context](TableReader& reader, ErrorsTable& errors_table) {
            for (const Node* node : reader.tables("tables"))
              read_whole_table(errors_table, *node, context.machine, reader.input_errors());
          },
          write_nothing)  // written with the elements
      .custom_field(
          {lines_key()},
          [context](TableReader& reader, ErrorsTable& errors_table) {
            read_lines(reader, errors_table, context.machine);
          },
          write_lines)
      .custom_field(
          {covariance},  // read when all elements are known
          [](TableReader& reader, ErrorsTable&) { reader.accept_key("covariance"); },
          [](const ErrorsTable& errors_table, Node::Table& table) {
            const auto& [elements, lines, covariance_matrix] = errors_table.section.geometric;
            if (!covariance_matrix.of.empty())
              put_value(table, "covariance", covariance_to_table(covariance_matrix, elements));
          });
}

// Binds each element separately, so that an error is reported at the position of the element.
void check_against_machine(const ErrorsTable& table, const MachineDescription& machine,
                           InputErrors& input_errors) {
  if (machine.joints.empty()) return;
  std::optional<kinematics::Chain> chain;
  try {
    chain.emplace(machine.joints, machine.T_bw, machine.T_bs);
  } catch (const std::invalid_argument&) {
    return;  // an invalid machine is reported with its own section
  }
  for (std::size_t i = 0; i < table.origins.size(); ++i) {
    try {
      errors::bind({{table.section.geometric.elements[i]}, {}}, *chain);
    } catch (const std::invalid_argument& error) {
      input_errors.add(table.origins[i].position, "an element that fits the machine", error.what());
    }
  }
}

void report_repeated_name(const ErrorsTable& table, InputErrors& input_errors) {
  const std::vector<Element>& elements = table.section.geometric.elements;
  for (std::size_t i = 0; i < elements.size(); ++i) {
    // Elements derived from slopes add to a stated squareness, so they may repeat its name.
    for (std::size_t j = 0; j < i && !table.origins[i].derived; ++j) {
      if (table.origins[j].derived || !(elements[i].name == elements[j].name)) continue;
      input_errors.add(table.origins[i].position, "each element once (all its curves in one list)",
                       to_string(elements[i].name) + " again");
      break;
    }
  }
}

ErrorsSection read_errors_table(const Node& node, const ErrorsContext& context,
                                InputErrors& input_errors) {
  TableReader reader(node, "errors", input_errors);
  ErrorsTable table = errors_fields(context).read(reader);
  reader.close();
  report_repeated_name(table, input_errors);
  check_against_machine(table, context.machine, input_errors);
  errors::GeometricErrors& geometric = table.section.geometric;
  // The covariance names numbers of the elements, so it is read last.
  if (const Node* covariance = reader.section("covariance"))
    geometric.covariance = read_covariance(*covariance, geometric.elements, input_errors);
  return std::move(table.section);
}

}  // namespace

ErrorsSection read_errors(const Node& node, const MachineDescription& machine, std::uint64_t seed,
                          InputErrors& input_errors) {
  if (node.table()) {
    ErrorsSection table = read_errors_table(node, {machine, seed}, input_errors);
    // The scale of a single table becomes that of the section, so that a study can vary it.
    const double scale = std::exchange(table.scale, 1.0);
    return {join_errors_tables({std::move(table)}, machine), scale};
  }
  if (!node.array() && !node.text())
    input_errors.add(node.position, "a table, a file or a list of them for errors",
                     display_text(node));
  std::vector<ErrorsSection> tables;
  for (const Node& element : node.array() ? *node.array() : Node::Array{}) {
    if (element.text()) continue;  // the file is invalid, which is reported
    if (element.table())
      // Each table gets another seed, so that equal curves of two tables are not correlated.
      tables.push_back(read_errors_table(element, {machine, seed++}, input_errors));
    else
      input_errors.add(element.position, "a table or a file for errors", display_text(element));
  }
  return {join_errors_tables(std::move(tables), machine), 1.0};
}

Node::Table errors_to_table(const ErrorsSection& section, const MachineDescription& machine) {
  return errors_fields({machine, 0}).to_table({section, {}});
}

std::vector<Key> errors_keys() { return errors_fields({}).keys(); }

namespace {

using errors::Vibration;

/// Returns the fields of the amplitude and of its dependence on speed.
/// @param amplitude_key  with the unit of the element, um or urad
Fields<Vibration> harmonic_fields(const std::string& amplitude_key) {
  return Fields<Vibration>()
      .number("order", &Vibration::order, positive,
              "order per spindle revolution: 1, or the number of teeth")
      .number(required_key(amplitude_key), &Vibration::amplitude, any_number,
              "amplitude at the speed `at_rpm`")
      .number("exponent", &Vibration::exponent, any_number,
              "exponent of the speed, at least 0: 2 for unbalance, 0 for an amplitude that does "
              "not depend on the speed");
}

Fields<Vibration> speed_fields(bool required) {
  // An amplitude that does not depend on speed needs no reference speed.
  const KeyName at = KeyName("at_rpm").with_fallback("required unless `exponent` is 0");
  return Fields<Vibration>().number(required ? required_key(at) : at, &Vibration::reference_speed,
                                    positive, "spindle speed at which the amplitude is stated");
}

Fields<Vibration> resonance_fields() {
  Key resonance = make_key("resonance_Hz", Key::Kind::Number,
                           "resonance frequency, near which the amplitude is magnified");
  resonance.range = positive;
  return Fields<Vibration>()
      .number("phase_deg", &Vibration::phase, any_number, "phase at spindle angle 0")
      .custom_field(
          {resonance},
          [](TableReader& reader, Vibration& vibration) {
            if (const auto hertz = reader.maybe_number("resonance_Hz", positive))
              vibration.resonance = 2 * pi * *hertz;
          },
          [](const Vibration& vibration, Node::Table& table) {
            if (vibration.resonance)
              put_value(table, "resonance_Hz", *vibration.resonance / (2 * pi));
          })
      .number("damping", &Vibration::damping, positive,
              "damping of the resonance, as a fraction of critical damping");
}

std::string amplitude_key(const Vibration& vibration) {
  return vibration.name.is_angle() ? "amplitude_urad" : "amplitude_um";
}

}  // namespace

std::vector<Key> vibration_keys() {
  std::vector<Key> keys{
      make_key(required_key("element"), Key::Kind::Text,
               "an error motion of any axis or the spindle: `\"EXS\"`, `\"EAZ\"`")};
  for (const auto& fields :
       {harmonic_fields("amplitude_<unit>"), speed_fields(false), resonance_fields()})
    for (Key& key : fields.keys()) {
      // The unit depends on the element, so the manual states both.
      if (key.name == "amplitude_<unit>") key.pattern = "amplitude_(um|urad)";
      keys.push_back(std::move(key));
    }
  return keys;
}

errors::Vibration read_vibration(const Node& node, const MachineDescription& machine,
                                 InputErrors& input_errors) {
  TableReader reader(node, "vibration", input_errors);
  Vibration vibration;
  try {
    vibration.name = errors::parse_element_name(reader.text("element", "EXS"));
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("element", "an element such as EXS", error.what());
  }
  // The unit of the amplitude depends on the element; without one, reading continues with EXS.
  if (!reader.has("element")) reader.report_missing("element", "an element such as EXS");
  vibration = harmonic_fields(amplitude_key(vibration)).read(reader, vibration);
  vibration = speed_fields(vibration.exponent != 0.0).read(reader, vibration);
  vibration = resonance_fields().read(reader, vibration);
  reader.close();
  try {
    // Binding checks the axis and the component against the machine.
    errors::bind({vibration}, kinematics::Chain(machine.joints, machine.T_bw, machine.T_bs));
  } catch (const std::invalid_argument& error) {
    // Without joints the machine itself is invalid, which is reported already.
    if (!machine.joints.empty())
      reader.report_invalid("element", "a valid vibration", error.what());
  }
  return vibration;
}

Node::Table vibration_to_table(const Vibration& vibration) {
  Node::Table table;
  put_value(table, "element", errors::to_string(vibration.name));
  for (const auto& fields :
       {harmonic_fields(amplitude_key(vibration)), speed_fields(true), resonance_fields()})
    for (Node::Entry& entry : fields.to_table(vibration)) table.push_back(std::move(entry));
  return table;
}

}  // namespace abbe::sim
