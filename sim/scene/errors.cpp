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

/// Appends a table to the others.
void append(errors::GeometricErrors& all, ErrorsSection table) {
  const auto base = int(all.elements.size());
  for (Element& element : table.geometric.elements) {
    for (Curve& curve : element.curves) curve.scale *= table.scale;
    all.elements.push_back(std::move(element));
  }
  for (const errors::MeasuringLine& line : table.geometric.measuring_lines)
    all.measuring_lines.push_back(line);
  const errors::Covariance& one = table.geometric.covariance;
  const auto m = Eigen::Index(all.covariance.of.size()), k = Eigen::Index(one.of.size());
  // Separate tables state nothing about each other, so the cross blocks are zero.
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(m + k, m + k);
  matrix.topLeftCorner(m, m) = all.covariance.matrix;
  matrix.bottomRightCorner(k, k) = one.matrix;
  all.covariance.matrix = std::move(matrix);
  for (errors::Coefficient number : one.of) {
    // Coefficients refer to elements by index, which shifts by the number of elements before them.
    number.element += base;
    all.covariance.of.push_back(number);
  }
}

}  // namespace

errors::GeometricErrors joined(std::vector<ErrorsSection> tables,
                               const MachineDescription& machine) {
  errors::GeometricErrors all;
  for (ErrorsSection& table : tables) append(all, std::move(table));
  const auto rank = [&](const ElementName& name) {
    std::size_t joint = 0;
    // The kinematics calls the spindle 's', elements call it 'S'.
    while (joint < machine.joints.size() && machine.joints[joint].name != name.axis &&
           !(machine.joints[joint].name == 's' && name.axis == 'S')) {
      ++joint;
    }
    return std::tuple(joint, name.location, name.component(), name.axis);
  };
  std::vector<std::size_t> order(all.elements.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  // A stable sort keeps the curves of one element in the order in which the user wrote them.
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return rank(all.elements[a].name) < rank(all.elements[b].name);
  });
  errors::GeometricErrors result = all;
  result.elements.clear();
  for (const std::size_t from : order) {
    const Element& element = all.elements[from];
    if (result.elements.empty() || !(result.elements.back().name == element.name))
      result.elements.push_back({element.name, {}});
    std::vector<Curve>& curves = result.elements.back().curves;
    for (std::size_t i = 0; i < all.covariance.of.size(); ++i) {
      // The loop changes `result` and tests `all`, because an index that was just renumbered could
      // match again.
      if (all.covariance.of[i].element != int(from)) continue;
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

std::uint64_t mixed(std::uint64_t x) { return split_mix::mixed(x + split_mix::golden); }

/// The contents of one errors table; the tables of the section are joined afterwards.
struct ErrorsTable {
  struct Origin {
    Place place;
    bool derived = false;  ///< derived from the slope of another element, so it adds up
  };
  ErrorsSection section;
  std::vector<Origin> origins;  ///< one per element
};

void add(ErrorsTable& table, Element element, const ErrorsTable::Origin& origin) {
  table.section.geometric.elements.push_back(std::move(element));
  table.origins.push_back(origin);
}

Element constant(const ElementName& name, double value, const std::string& named = "") {
  return {name, {Curve{errors::Constant{value}, named, {}, false, 1.0}}};
}

/// Returns the joint of an element's axis; 'S' may denote the spindle nose.
const Joint* joint_of(const MachineDescription& machine, char axis) {
  const Joint* nose = nullptr;
  for (const Joint& one : machine.joints) {
    if (one.name == axis) return &one;
    if (one.name == 's' && axis == 'S') nose = &one;
  }
  return nose;
}

ElementUnits units_of(const ElementName& name, const MachineDescription& machine) {
  const Joint* one = joint_of(machine, name.axis);
  // Without a machine, as in the manual, the letter alone decides.
  const bool slide = one ? one->motion == Motion::Linear
                         : std::string_view("XYZUVW").find(name.axis) != std::string_view::npos;
  return {name.is_angle() ? "_urad" : "_um", slide ? "_mm" : "_deg"};
}

// ---- elements

/// Returns the seed of a curve that states none.
std::uint64_t seed_of_curve(std::uint64_t scene, const ElementName& name, std::size_t index) {
  std::uint64_t seed = mixed(scene);
  // The name enters the seed, so that a further element does not change the draws of the others.
  for (const char c : to_string(name)) seed = mixed(seed ^ static_cast<unsigned char>(c));
  // The shift keeps the seed within the signed integers of TOML.
  return mixed(seed ^ std::uint64_t(index)) >> 1;
}

// A component along the slide is positioning and not straightness, so the direction must lie across
// it.
bool is_straightness(const ElementName& name, const Joint* joint) {
  return joint && joint->motion == Motion::Linear && !name.location && !name.is_angle() &&
         joint->direction_b.cross(Vector3d(Vector3d::Unit(name.component()))).norm() >= 1e-9;
}

void transfer_slope(ErrorsTable& table, Curve& curve, const ElementName& name, errors::Detrend how,
                    const Place& place, const MachineDescription& machine,
                    InputErrors& input_errors) {
  const Joint* slide = joint_of(machine, name.axis);
  if (!slide) return;  // rejected when bound
  if (!is_straightness(name, slide)) {
    input_errors.add(place, "detrend on a straightness of a slide only", to_string(name));
    return;
  }
  const errors::DetrendedTable detrended =
      errors::detrend(std::get<errors::Table>(curve.shape), how);
  curve.shape = detrended.table;
  // A slide on the workpiece side moves against its command, which reverses the slope over the
  // command.
  const bool against =
      slide->side == kinematics::Side::Workpiece && curve.argument == errors::Argument::Command;
  const double factor = curve.scale * (curve.negate ? -1.0 : 1.0) * (against ? -1.0 : 1.0);
  const double slope = factor * detrended.slope;
  try {
    for (const auto& share : errors::squareness_contributions(name, slope, machine.joints))
      add(table, constant(share.name, share.value, "slope of " + to_string(name)), {place, true});
  } catch (const std::invalid_argument& fault) {
    input_errors.add(place, "a slope that is a squareness of the machine", fault.what());
  }
}

/// Data needed to read elements.
struct Setting {
  MachineDescription machine;
  std::uint64_t seed = 0;
};

void read_curves(TableReader& reader, ErrorsTable& table, const Node::Entry& entry,
                 const ElementName& name, const Setting& setting) {
  const ElementUnits units = units_of(name, setting.machine);
  InputErrors& input_errors = reader.input_errors();
  Element element{name, {}};
  std::size_t index = 0;
  for (const Node* node : reader.tables(entry.key)) {
    const std::size_t before = input_errors.list().size();
    auto [curve, detrend] = curve_fields(name, units, seed_of_curve(setting.seed, name, index++))
                                .read_table(*node, "errors." + to_string(name), input_errors);
    // A curve with errors may lack its table, which detrending needs.
    if (input_errors.list().size() != before) continue;
    if (detrend)
      transfer_slope(table, curve, name, *detrend, node->find("detrend")->place, setting.machine,
                     input_errors);
    element.curves.push_back(std::move(curve));
  }
  add(table, std::move(element), {entry.place});
}

/// Returns ", which is EXX_um = 5" for a number of equal dimension, in the unit of a key; else an
/// empty text.
std::string converted(const Node::Entry& entry, const std::string& key) {
  const auto is_angle = [](const std::string& name) {
    return name.ends_with("rad") || name.ends_with("deg") || name.ends_with("arcsec");
  };
  const auto* real = std::get_if<double>(&entry.node.value);
  const auto* whole = std::get_if<std::int64_t>(&entry.node.value);
  if ((!real && !whole) || is_angle(entry.key) != is_angle(key)) return {};
  const double value = (real ? *real : double(*whole)) * unit_of(entry.key) / unit_of(key);
  return fmt::format(", which is {} = {:.6g}", key, value);
}

void read_element(TableReader& reader, ErrorsTable& table, const Node::Entry& entry,
                  const Setting& setting) {
  const std::string stem(key_stem(entry.key));
  ElementName name;
  try {
    name = errors::parse_element_name(stem);
  } catch (const std::invalid_argument&) {
    return;  // an unknown key, which `close` reports
  }
  reader.accept_key(entry.key);
  const std::string in_unit = stem + units_of(name, setting.machine).value;
  // A bare name holds curves, a name with a unit holds a constant.
  if (stem == entry.key) {
    read_curves(reader, table, entry, name, setting);
  } else if (entry.key == in_unit) {
    add(table, constant(name, reader.number(entry.key, any_number, 0.0)), {entry.place});
  } else {
    reader.input_errors().add(entry.place, in_unit + " for the element " + stem,
                              entry.key + converted(entry, in_unit));
  }
}

void read_elements(TableReader& reader, ErrorsTable& table, const Setting& setting) {
  for (const Joint& one : setting.machine.joints) {
    // All names that the machine allows are made known, so that the suggestion for a misspelt key
    // can find them.
    const char axis = one.name == 's' ? 'S' : one.name;
    for (const char direction : std::string_view("XYZABC")) {
      for (const bool location : {false, true}) {
        const ElementName name{direction, axis, location};
        reader.accept_key(to_string(name));
        reader.accept_key(to_string(name) + units_of(name, setting.machine).value);
      }
    }
  }
  for (const Node::Entry& entry : *reader.node().table())
    read_element(reader, table, entry, setting);
}

bool is_plain(const Curve& curve) {
  return std::holds_alternative<errors::Constant>(curve.shape) && curve.name.empty() &&
         curve.argument == errors::Argument::Command && !curve.negate && curve.scale == 1.0;
}

void write_elements(const ErrorsTable& from, Node::Table& to, const MachineDescription& machine) {
  for (const Element& element : from.section.geometric.elements) {
    const ElementUnits units = units_of(element.name, machine);
    const std::string key = to_string(element.name);
    // A plain constant is written in the short form that users write themselves.
    if (element.curves.size() == 1 && is_plain(element.curves.front())) {
      const double value = std::get<errors::Constant>(element.curves.front().shape).value;
      put(to, key + units.value, value / unit_of(key + units.value));
      continue;
    }
    // Every curve is written with its own seed, so the seed of the fields is irrelevant.
    const Fields<CurveEntry> fields = curve_fields(element.name, units, 0);
    Node::Array curves;
    for (const Curve& curve : element.curves)
      curves.push_back(Node{{}, fields.written({curve, std::nullopt})});
    put(to, key, std::move(curves));
  }
}

std::vector<Key> element_keys() {
  const std::string axes = "[XYZUVWABCS]";
  const auto constant_key = [&](const std::string& unit, const std::string& directions) {
    Key key = make_key("E.._" + unit, Key::Kind::Number, "constant element");
    key.pattern = "(E" + directions + "0?|" + directions + "0)" + axes + "_" + unit;
    return key;
  };
  Key curves = make_key("E..", Key::Kind::Tables,
                        "element, a curve or a list of curves that add up; location elements are "
                        "constant");
  curves.pattern = "(E[XYZABC]0?|[XYZABC]0)" + axes;
  curves.keys = curve_keys();
  return {constant_key("um", "[XYZ]"), constant_key("urad", "[ABC]"), curves};
}

// ---- whole tables

struct WholeTable {
  errors::TableUse use;
  double scale = 1.0;
  std::optional<errors::Detrend> detrend;
  std::optional<errors::ElementTable> table;
};

Fields<WholeTable> whole_table_fields() {
  const auto use = interpolation_fields<errors::TableUse>()
                       .all_of(std::identity{}, argument_fields<errors::TableUse>())
                       .text("name", &errors::TableUse::name, "of every curve, for reports");
  return Fields<WholeTable>()
      .all_of(&WholeTable::use, use)
      .number("scale", &WholeTable::scale, any_number, "factor of every curve")
      .all_of(std::identity{}, detrend_fields<WholeTable>())
      .custom(
          {table_file_key()},
          [](TableReader& reader, WholeTable& to) { to.table = read_table_file(reader); },
          [](const WholeTable&, Node::Table&) {});
}

void read_whole_table(ErrorsTable& to, const Node& node, const MachineDescription& machine,
                      InputErrors& input_errors) {
  const std::size_t before = input_errors.list().size();
  const WholeTable whole = whole_table_fields().read_table(node, "errors.tables", input_errors);
  if (!whole.table || input_errors.list().size() != before) return;
  const Joint* slide = joint_of(machine, whole.table->axis);
  for (Element& element : errors::elements_of(*whole.table, whole.use)) {
    Curve& curve = element.curves.front();
    curve.scale = whole.scale;
    // Only the straightness columns contain a slope that is a squareness; the others stay
    // untouched.
    if (whole.detrend && is_straightness(element.name, slide))
      transfer_slope(to, curve, element.name, *whole.detrend, node.find("detrend")->place, machine,
                     input_errors);
    add(to, std::move(element), {node.find("file")->place});
  }
}

// ---- measuring lines

Fields<errors::MeasuringLine> line_fields() {
  using errors::MeasuredBy;
  using errors::MeasuringLine;
  return Fields<MeasuringLine>()
      .vector(must("at_mm"), &MeasuringLine::at_b, "in the bed frame with all axes at zero")
      .word(must("by"), &MeasuringLine::by,
            {{"tool", MeasuredBy::Tool, "the measured point is where the tool was"},
             {"carriage", MeasuredBy::Carriage, "the measured point travels with the carriage"}},
            "who carried the measured point");
}

void read_lines(TableReader& reader, ErrorsTable& table, const MachineDescription& machine) {
  const Node* section = reader.section("measured");
  if (!section) return;
  TableReader lines(*section, "errors.measured", reader.input_errors());
  for (const Joint& one : machine.joints) {
    // Only translations of slides depend on the line of measurement.
    if (one.motion != Motion::Linear) continue;
    const std::string axis(1, one.name);
    const Node* node = lines.section(axis);
    if (!node) continue;
    errors::MeasuringLine line;
    line.axis = one.name;
    table.section.geometric.measuring_lines.push_back(
        line_fields().read_table(*node, lines.name_of(axis), reader.input_errors(), line));
  }
  // With an unreadable machine every axis would look unknown.
  if (!machine.joints.empty()) lines.close();
}

void write_lines(const ErrorsTable& from, Node::Table& to) {
  Node::Table lines;
  for (const errors::MeasuringLine& line : from.section.geometric.measuring_lines)
    put(lines, std::string(1, line.axis), line_fields().written(line));
  if (!lines.empty()) put(to, "measured", std::move(lines));
}

Key lines_key() {
  Key line = make_key("<axis>", Key::Kind::Table, "of one slide");
  line.pattern = "[XYZUVW]";
  line.keys = line_fields().keys();
  Key lines = make_key(KeyName("measured").otherwise("at the joint's point"), Key::Kind::Table,
                       "lines on which the translations of slides were measured");
  lines.keys = {line};
  return lines;
}

// ---- the section

void check_machine(TableReader& reader, const MachineDescription& machine) {
  const std::string stated = reader.text("machine", "");
  // An unreadable machine is reported with its own section.
  if (stated.empty() || machine.joints.empty()) return;
  const std::string code = kinematics::to_string(kinematics::chain_topology(machine.joints));
  if (stated != code) reader.refuse("machine", "errors of the machine " + code, in_quotes(stated));
}

Fields<ErrorsTable> errors_fields(const Setting& setting) {
  Key tables = make_key("tables", Key::Kind::Tables, "error motions of one axis from a CSV file");
  tables.keys = whole_table_fields().keys();
  Key covariance = make_key(KeyName("covariance").otherwise("none: they are taken as they stand"),
                            Key::Kind::Table, "how well the numbers are known");
  covariance.keys = covariance_keys();
  const auto nothing = [](const ErrorsTable&, Node::Table&) {};
  return Fields<ErrorsTable>()
      .custom(
          {make_key("name", Key::Kind::Text, "of the table, for people")},
          [](TableReader& reader, ErrorsTable&) { reader.text("name", ""); }, nothing)
      .custom(
          {make_key(KeyName("machine").otherwise("any"), Key::Kind::Text,
                    "structural code of the machine of which the errors were identified, as `abbe "
                    "identify` writes it; on another machine they are an input error")},
          [setting](TableReader& reader, ErrorsTable&) { check_machine(reader, setting.machine); },
          nothing)
      .custom(
          {unidentified_key()},
          [](TableReader& reader, ErrorsTable&) { read_unidentified(reader); }, nothing)
      .number(
          "scale", [](auto& table) -> auto& { return table.section.scale; }, any_number,
          "factor of everything in this table")
      .custom(
          element_keys(),
          [setting](TableReader& reader, ErrorsTable& to) { read_elements(reader, to, setting); },
          [setting](const ErrorsTable& from, Node::Table& to) {
            write_elements(from, to, setting.machine);
          })
      .custom(
          {tables},
          [setting](TableReader& reader, ErrorsTable& to) {
            for (const Node* table : reader.tables("tables"))
              read_whole_table(to, *table, setting.machine, reader.input_errors());
          },
          nothing)  // written with the elements
      .custom(
          {lines_key()},
          [setting](TableReader& reader, ErrorsTable& to) {
            read_lines(reader, to, setting.machine);
          },
          write_lines)
      .custom(
          {covariance},  // read when all elements are known
          [](TableReader& reader, ErrorsTable&) { reader.accept_key("covariance"); },
          [](const ErrorsTable& from, Node::Table& to) {
            const auto& [elements, lines, known] = from.section.geometric;
            if (!known.of.empty()) put(to, "covariance", written_covariance(known, elements));
          });
}

// Binds each element alone, so that an error is reported at the position of the element.
void check_against_machine(const ErrorsTable& table, const MachineDescription& machine,
                           InputErrors& input_errors) {
  if (machine.joints.empty()) return;
  std::optional<kinematics::Chain> chain;
  try {
    chain.emplace(machine.joints, machine.T_bw, machine.T_bs);
  } catch (const std::invalid_argument&) {
    return;  // reported with the machine
  }
  for (std::size_t i = 0; i < table.origins.size(); ++i) {
    try {
      errors::bind({{table.section.geometric.elements[i]}, {}}, *chain);
    } catch (const std::invalid_argument& fault) {
      input_errors.add(table.origins[i].place, "an element that fits the machine", fault.what());
    }
  }
}

void report_repeated_name(const ErrorsTable& table, InputErrors& input_errors) {
  const std::vector<Element>& elements = table.section.geometric.elements;
  for (std::size_t i = 0; i < elements.size(); ++i) {
    // Slopes add up with the stated squareness, so derived elements may repeat a name.
    for (std::size_t j = 0; j < i && !table.origins[i].derived; ++j) {
      if (table.origins[j].derived || !(elements[i].name == elements[j].name)) continue;
      input_errors.add(table.origins[i].place, "each element once (its curves are one list)",
                       to_string(elements[i].name) + " again");
      break;
    }
  }
}

ErrorsSection read_errors_table(const Node& node, const Setting& setting,
                                InputErrors& input_errors) {
  TableReader reader(node, "errors", input_errors);
  ErrorsTable table = errors_fields(setting).read(reader);
  reader.close();
  report_repeated_name(table, input_errors);
  check_against_machine(table, setting.machine, input_errors);
  errors::GeometricErrors& geometric = table.section.geometric;
  // The covariance names numbers of the elements, which are complete only now.
  if (const Node* covariance = reader.section("covariance"))
    geometric.covariance = read_covariance(*covariance, geometric.elements, input_errors);
  return std::move(table.section);
}

}  // namespace

ErrorsSection read_errors(const Node& node, const MachineDescription& machine, std::uint64_t seed,
                          InputErrors& input_errors) {
  if (node.table()) {
    ErrorsSection table = read_errors_table(node, {machine, seed}, input_errors);
    // A single table keeps its scale as the scale of the section, which a study can vary.
    const double scale = std::exchange(table.scale, 1.0);
    return {joined({std::move(table)}, machine), scale};
  }
  if (!node.array() && !node.text())
    input_errors.add(node.place, "a table, a file or a list of them for errors", shown(node));
  std::vector<ErrorsSection> tables;
  for (const Node& part : node.array() ? *node.array() : Node::Array{}) {
    if (part.text()) continue;  // a file that was rejected
    if (part.table())
      // Each table gets another seed, so that equal curves of two tables do not move together.
      tables.push_back(read_errors_table(part, {machine, seed++}, input_errors));
    else
      input_errors.add(part.place, "a table or a file for errors", shown(part));
  }
  return {joined(std::move(tables), machine), 1.0};
}

Node::Table written_errors(const ErrorsSection& section, const MachineDescription& machine) {
  return errors_fields({machine, 0}).written({section, {}});
}

std::vector<Key> errors_keys() { return errors_fields({}).keys(); }

namespace {

using errors::Vibration;

/// Returns the fields of speed dependence and amplitude, in um or urad as the element requires.
Fields<Vibration> harmonic_fields(const std::string& amplitude) {
  return Fields<Vibration>()
      .number("order", &Vibration::order, positive,
              "per turn of the spindle: 1, or the number of teeth")
      .number(must(amplitude), &Vibration::amplitude, any_number, "at the speed `at_rpm`")
      .number("exponent", &Vibration::exponent, any_number,
              "of the speed, at least 0: 2 for unbalance, 0 for an amplitude that does not change "
              "with speed");
}

Fields<Vibration> speed_fields(bool required) {
  // An amplitude that is independent of speed needs no reference speed.
  const KeyName at = KeyName("at_rpm").otherwise("must be given unless `exponent` is 0");
  return Fields<Vibration>().number(required ? must(at) : at, &Vibration::reference_speed, positive,
                                    "speed of the spindle at which the amplitude is stated");
}

Fields<Vibration> resonance_fields() {
  Key resonance = make_key("resonance_Hz", Key::Kind::Number, "near it the amplitude is magnified");
  resonance.range = positive;
  return Fields<Vibration>()
      .number("phase_deg", &Vibration::phase, any_number, "at the spindle's angle 0")
      .custom(
          {resonance},
          [](TableReader& reader, Vibration& vibration) {
            if (const auto hertz = reader.maybe_number("resonance_Hz", positive))
              vibration.resonance = 2 * pi * *hertz;
          },
          [](const Vibration& vibration, Node::Table& table) {
            if (vibration.resonance) put(table, "resonance_Hz", *vibration.resonance / (2 * pi));
          })
      .number("damping", &Vibration::damping, positive, "of the resonance, as a part of critical");
}

std::string amplitude_key(const Vibration& vibration) {
  return vibration.name.is_angle() ? "amplitude_urad" : "amplitude_um";
}

}  // namespace

std::vector<Key> vibration_keys() {
  std::vector<Key> keys{
      make_key(must("element"), Key::Kind::Text,
               "an error motion of any axis or the spindle: `\"EXS\"`, `\"EAZ\"`")};
  for (const auto& fields :
       {harmonic_fields("amplitude_<unit>"), speed_fields(false), resonance_fields()})
    for (Key& key : fields.keys()) {
      // The unit depends on the element, which the manual does not know.
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
  } catch (const std::invalid_argument& fault) {
    reader.refuse("element", "an element such as EXS", fault.what());
  }
  // The element decides the unit of the amplitude, so reading continues with the spindle's radial
  // motion.
  if (!reader.has("element")) reader.missing("element", "an element such as EXS");
  vibration = harmonic_fields(amplitude_key(vibration)).read(reader, vibration);
  vibration = speed_fields(vibration.exponent != 0.0).read(reader, vibration);
  vibration = resonance_fields().read(reader, vibration);
  reader.close();
  try {
    // Binding tests the axis and the component against the machine.
    errors::bind({vibration}, kinematics::Chain(machine.joints, machine.T_bw, machine.T_bs));
  } catch (const std::invalid_argument& fault) {
    // Without joints the machine itself was rejected, and its error is reported there.
    if (!machine.joints.empty())
      reader.refuse("element", "a vibration that the machine can have", fault.what());
  }
  return vibration;
}

Node::Table written_vibration(const Vibration& vibration) {
  Node::Table table;
  put(table, "element", errors::to_string(vibration.name));
  for (const auto& fields :
       {harmonic_fields(amplitude_key(vibration)), speed_fields(true), resonance_fields()})
    for (Node::Entry& entry : fields.written(vibration)) table.push_back(std::move(entry));
  return table;
}

}  // namespace abbe::sim
