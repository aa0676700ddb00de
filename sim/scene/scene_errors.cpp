#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <stdexcept>
#include <string_view>
#include <tuple>

#include <fmt/format.h>
#include <Eigen/Core>

#include "errors/coefficients.h"
#include "errors/element_table.h"
#include "errors/geometric.h"
#include "errors/squareness.h"
#include "kinematics/hash.h"
#include "kinematics/symmetric.h"
#include "kinematics/units.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {

namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using errors::Curve;
using errors::Element;
using errors::ElementName;
using kinematics::Joint;
using kinematics::Motion;

/// Units in which an element is written: "_um" or "_urad" of its value, "_mm" or "_deg" of its
/// axis.
struct Units {
  std::string value;
  std::string position;
};

std::uint64_t mixed(std::uint64_t x) { return split_mix::mixed(x + split_mix::golden); }

errors::Argument read_argument(TableReader& curve) {
  return curve.choice<errors::Argument>(
      "argument",
      {{"command", errors::Argument::Command}, {"carriage", errors::Argument::Carriage}},
      errors::Argument::Command);
}

/// Reads what one errors table says; the pieces of the section are joined afterwards.
class ErrorsReader {
 public:
  ErrorsReader(const Node& table, const MachineDescription& machine, std::uint64_t seed,
               Faults& faults)
      : reader_(table, "errors", faults), machine_(machine), seed_(seed), faults_(faults) {}

  ErrorsSection read();

 private:
  struct Written {  ///< an element with the place where it was written
    Element element;
    Place place;
    bool derived = false;  ///< from another element's slope, so it adds up
  };
  struct Detrending {
    std::optional<errors::Detrend> how;
    Place place;
  };

  const Joint* joint(char axis) const;
  Units units(const ElementName& name) const;
  void know_elements();
  void read_element_key(const Node::Entry& entry);
  void read_constant(const Node::Entry& entry, const ElementName& name);
  void read_curves(const Node::Entry& entry, const ElementName& name);
  std::optional<Curve> read_curve(const Node& table, const ElementName& name, int index);
  errors::Shape read_shape(TableReader& curve, const ElementName& name, int index);
  std::uint64_t read_seed(TableReader& curve, const ElementName& name, int index);
  errors::Shape read_asynchronous(TableReader& curve, const ElementName& name, int index);
  errors::Shape read_series(TableReader& curve, const Units& unit, bool legendre);
  errors::Shape read_fourier(TableReader& curve, const Units& unit);
  errors::Table read_table(TableReader& curve, const ElementName& name);
  errors::Table read_side(TableReader& curve, const std::string& key, const ElementName& name);
  std::optional<errors::ElementTable> read_table_file(TableReader& curve);
  void read_whole_table(const Node& table);
  void read_measuring_lines();
  errors::Covariance read_covariance(const std::vector<Element>& elements);
  Detrending read_detrend(TableReader& curve);
  void move_slope(Curve& curve, const ElementName& name, const Detrending& detrending);
  void add_location(const ElementName& name, double value, const std::string& from,
                    const Place& place);
  void check_against_machine();
  void refuse_twice();

  TableReader reader_;
  const MachineDescription& machine_;
  std::uint64_t seed_;
  Faults& faults_;
  std::vector<Written> elements_;
  std::vector<errors::MeasuringLine> lines_;
};

const Joint* ErrorsReader::joint(char axis) const {
  const Joint* nose = nullptr;
  for (const Joint& one : machine_.joints) {
    if (one.name == axis) return &one;
    if (one.name == 's' && axis == 'S') nose = &one;
  }
  return nose;
}

Units ErrorsReader::units(const ElementName& name) const {
  const Joint* one = joint(name.axis);
  const bool slide = one ? one->motion == Motion::Linear
                         : std::string_view("XYZUVW").find(name.axis) != std::string_view::npos;
  return {name.is_angle() ? "_urad" : "_um", slide ? "_mm" : "_deg"};
}

void ErrorsReader::know_elements() {
  for (const Joint& one : machine_.joints) {
    const char axis = one.name == 's' ? 'S' : one.name;
    for (const char direction : std::string_view("XYZABC")) {
      for (const bool location : {false, true}) {
        const ElementName name{direction, axis, location};
        reader_.know(to_string(name));
        reader_.know(to_string(name) + units(name).value);
      }
    }
  }
}

void ErrorsReader::read_element_key(const Node::Entry& entry) {
  const std::string stem(stem_of(entry.key));
  ElementName name;
  try {
    name = errors::parse_element_name(stem);
  } catch (const std::invalid_argument&) {
    return;  // an unknown key, which `close` refuses
  }
  reader_.know(entry.key);
  if (stem == entry.key) {
    read_curves(entry, name);
  } else if (entry.key == stem + units(name).value) {
    read_constant(entry, name);
  } else {
    faults_.add(entry.place, stem + units(name).value + " for the element " + stem, entry.key);
  }
}

void ErrorsReader::read_constant(const Node::Entry& entry, const ElementName& name) {
  const double value = reader_.number(entry.key, any_number, 0.0);
  elements_.push_back({{name, {Curve{errors::Constant{value}, {}, {}, false, 1.0}}}, entry.place});
}

void ErrorsReader::read_curves(const Node::Entry& entry, const ElementName& name) {
  Element element{name, {}};
  int index = 0;
  for (const Node* table : reader_.tables(entry.key)) {
    if (auto curve = read_curve(*table, name, index++)) element.curves.push_back(std::move(*curve));
  }
  elements_.push_back({std::move(element), entry.place});
}

std::optional<Curve> ErrorsReader::read_curve(const Node& table, const ElementName& name,
                                              int index) {
  TableReader reader(table, "errors." + to_string(name), faults_);
  const std::size_t before = faults_.list().size();
  Curve curve;
  curve.name = reader.text("name", "");
  curve.argument = read_argument(reader);
  curve.negate = reader.boolean("negate", false);
  curve.scale = reader.number("scale", any_number, 1.0);
  curve.shape = read_shape(reader, name, index);
  const bool is_table = std::holds_alternative<errors::Table>(curve.shape);
  const Detrending detrending = is_table ? read_detrend(reader) : Detrending{};
  reader.close();
  if (faults_.list().size() != before) return std::nullopt;
  if (detrending.how) move_slope(curve, name, detrending);
  return curve;
}

errors::Shape ErrorsReader::read_shape(TableReader& curve, const ElementName& name, int index) {
  enum class Kind {
    Constant,
    Polynomial,
    Legendre,
    Fourier,
    Table,
    Backlash,
    UpDown,
    Repeatability,
    Asynchronous
  };
  const Units unit = units(name);
  const Kind kind = curve.choice<Kind>("kind", {{"constant", Kind::Constant},
                                                {"polynomial", Kind::Polynomial},
                                                {"legendre", Kind::Legendre},
                                                {"fourier", Kind::Fourier},
                                                {"table", Kind::Table},
                                                {"backlash", Kind::Backlash},
                                                {"up_down", Kind::UpDown},
                                                {"repeatability", Kind::Repeatability},
                                                {"asynchronous", Kind::Asynchronous}});
  switch (kind) {
    case Kind::Constant:
      return errors::Constant{curve.number("value" + unit.value, any_number)};
    case Kind::Polynomial:
      return read_series(curve, unit, false);
    case Kind::Legendre:
      return read_series(curve, unit, true);
    case Kind::Fourier:
      return read_fourier(curve, unit);
    case Kind::Table:
      return read_table(curve, name);
    case Kind::Backlash:
      return errors::Backlash{curve.number("half" + unit.value, any_number)};
    case Kind::UpDown:
      return errors::UpDown{read_side(curve, "up", name), read_side(curve, "down", name)};
    case Kind::Repeatability:
      return errors::Repeatability{curve.number("sigma" + unit.value, non_negative),
                                   read_seed(curve, name, index)};
    case Kind::Asynchronous:
      break;
  }
  return read_asynchronous(curve, name, index);
}

/// The curve's own seed, or one from that of the scene.
std::uint64_t ErrorsReader::read_seed(TableReader& curve, const ElementName& name, int index) {
  std::uint64_t seed = mixed(seed_);
  for (const char c : to_string(name)) seed = mixed(seed ^ static_cast<unsigned char>(c));
  seed = mixed(seed ^ std::uint64_t(index)) >> 1;
  const auto own = curve.maybe_integer("seed", 0, std::numeric_limits<std::int64_t>::max());
  return own ? std::uint64_t(*own) : seed;
}

errors::Shape ErrorsReader::read_asynchronous(TableReader& curve, const ElementName& name,
                                              int index) {
  const Units unit = units(name);
  errors::Asynchronous shape;
  shape.rms = curve.number("rms" + unit.value, non_negative);
  shape.seed = read_seed(curve, name, index);
  shape.lowest_order = curve.number("lowest_order", positive, shape.lowest_order);
  shape.highest_order = curve.number("highest_order", positive, shape.highest_order);
  if (unit.position != "_deg")
    curve.refuse("kind", "\"asynchronous\" on an axis that turns", to_string(name));
  return shape;
}

errors::Shape ErrorsReader::read_series(TableReader& curve, const Units& unit, bool legendre) {
  const VectorXd c = curve.numbers("coefficients" + unit.value);
  const double centre = curve.number("centre" + unit.position, any_number, 0.0);
  const double half_range = curve.number("half_range" + unit.position, positive);
  if (legendre) return errors::Legendre{c, centre, half_range};
  return errors::Polynomial{c, centre, half_range};
}

errors::Shape ErrorsReader::read_fourier(TableReader& curve, const Units& unit) {
  // shorter than a thousandth of a mm or a degree no sampling follows
  const double period = curve.number("period" + unit.position, {1e-3, 1e9});
  const auto a = curve.maybe_numbers("a" + unit.value);
  const auto b = curve.maybe_numbers("b" + unit.value);
  if (!curve.has("a" + unit.value) && !curve.has("b" + unit.value)) {
    curve.missing("a" + unit.value, "an array of numbers, or b" + unit.value + ",");
  }
  const Eigen::Index n = std::max(a ? a->size() : 0, b ? b->size() : 0);
  errors::Fourier fourier{VectorXd::Zero(n), VectorXd::Zero(n), period};
  if (a) fourier.a.head(a->size()) = *a;
  if (b) fourier.b.head(b->size()) = *b;
  return fourier;
}

std::optional<errors::ElementTable> ErrorsReader::read_table_file(TableReader& curve) {
  const std::string file = curve.text("file");
  if (file.empty()) return std::nullopt;
  try {
    return errors::read_element_table_file(file);
  } catch (const BadInput& fault) {
    if (fault.line == 0) {
      curve.refuse("file", fault.expected, file + ": " + fault.seen);
    } else {
      faults_.add(fault);
    }
    return std::nullopt;
  }
}

errors::Table ErrorsReader::read_table(TableReader& curve, const ElementName& name) {
  const Units unit = units(name);
  const auto between = read_between(curve);
  const auto outside = read_outside(curve);
  VectorXd q, value;
  std::string key = "q" + unit.position;
  if (curve.has("file")) {
    key = "file";
    ElementName column = name;
    const std::string wanted = curve.text("column", to_string(name));
    try {
      column = errors::parse_element_name(wanted);
    } catch (const std::invalid_argument& fault) {
      curve.refuse("column", "a column named as an element", fault.what());
    }
    const auto table = read_table_file(curve);
    if (!table) return {};
    const auto found = std::find(table->elements.begin(), table->elements.end(), column);
    if (found == table->elements.end()) {
      curve.refuse(curve.has("column") ? "column" : "file", "a table with the column " + wanted,
                   "none");
      return {};
    }
    q = table->q;
    value = table->values.col(found - table->elements.begin());
  } else {
    q = curve.numbers(key);
    value = curve.numbers("value" + unit.value);
    if (q.size() != value.size()) {
      curve.refuse("value" + unit.value, fmt::format("as many values as positions, {}", q.size()),
                   fmt::format("{}", value.size()));
      return {};
    }
  }
  if (q.isZero() && value.isZero() && !curve.has(key)) return {};  // missing, which is reported
  try {
    return errors::make_table(std::move(q), std::move(value), between, outside);
  } catch (const std::invalid_argument& fault) {
    curve.refuse(key, "a table with rising positions and at least 2 rows", fault.what());
    return {};
  }
}

errors::Table ErrorsReader::read_side(TableReader& curve, const std::string& key,
                                      const ElementName& name) {
  if (!curve.has(key)) curve.missing(key, "a table");
  const Node* node = curve.section(key);
  if (!node) return {};
  TableReader side(*node, "errors." + to_string(name) + "." + key, faults_);
  errors::Table table = read_table(side, name);
  side.close();
  return table;
}

ErrorsReader::Detrending ErrorsReader::read_detrend(TableReader& curve) {
  const Node* node = curve.know("detrend");
  if (!node) return {};
  const auto how = curve.choice<errors::Detrend>(
      "detrend", {{"ends", errors::Detrend::Ends}, {"lsq", errors::Detrend::LeastSquares}},
      errors::Detrend::Ends);
  return {how, node->place};
}

void ErrorsReader::move_slope(Curve& curve, const ElementName& name, const Detrending& detrending) {
  const Joint* slide = joint(name.axis);
  if (!slide) return;  // refused when bound
  const bool across =
      !name.is_angle() && slide->direction_b.cross(Vector3d::Unit(name.component())).norm() >= 1e-9;
  if (slide->motion != Motion::Linear || name.location || !across) {
    faults_.add(detrending.place, "detrend on a straightness of a slide only", to_string(name));
    return;
  }
  const errors::Detrended detrended =
      errors::detrend(std::get<errors::Table>(curve.shape), *detrending.how);
  curve.shape = detrended.table;
  const bool against =
      slide->side == kinematics::Side::Workpiece && curve.argument == errors::Argument::Command;
  const double factor = curve.scale * (curve.negate ? -1.0 : 1.0) * (against ? -1.0 : 1.0);
  const std::string from = "slope of " + to_string(name);
  const double slope = factor * detrended.slope;
  try {
    for (const auto& share : errors::squareness_shares(name, slope, machine_.joints))
      add_location(share.name, share.value, from, detrending.place);
  } catch (const std::invalid_argument& fault) {
    faults_.add(detrending.place, "a slope that is a squareness of the machine", fault.what());
  }
}

void ErrorsReader::add_location(const ElementName& name, double value, const std::string& from,
                                const Place& place) {
  elements_.push_back(
      {{name, {Curve{errors::Constant{value}, from, {}, false, 1.0}}}, place, true});
}

void ErrorsReader::read_whole_table(const Node& node) {
  TableReader reader(node, "errors.tables", faults_);
  const std::size_t before = faults_.list().size();
  errors::TableUse use;
  use.between = read_between(reader);
  use.outside = read_outside(reader);
  use.argument = read_argument(reader);
  use.negate = reader.boolean("negate", false);
  use.name = reader.text("name", "");
  const double scale = reader.number("scale", any_number, 1.0);
  const Detrending detrending = read_detrend(reader);
  const auto table = read_table_file(reader);
  const Node* file = reader.know("file");
  reader.close();
  if (!table || faults_.list().size() != before) return;
  const Joint* slide = joint(table->axis);
  for (Element& element : errors::elements_of(*table, use)) {
    Curve& curve = element.curves.front();
    curve.scale = scale;
    const bool straightness =
        slide && slide->motion == Motion::Linear && !element.name.is_angle() &&
        slide->direction_b.cross(Vector3d(Vector3d::Unit(element.name.component()))).norm() > 1e-9;
    if (detrending.how && straightness) move_slope(curve, element.name, detrending);
    elements_.push_back({std::move(element), file->place});
  }
}

void ErrorsReader::read_measuring_lines() {
  const Node* section = reader_.section("measured");
  if (!section) return;
  TableReader lines(*section, "errors.measured", faults_);
  for (const Joint& one : machine_.joints) {
    if (one.motion != Motion::Linear) continue;
    const std::string axis(1, one.name);
    const Node* node = lines.section(axis);
    if (!node) continue;
    TableReader line(*node, "errors.measured." + axis, faults_);
    lines_.push_back(
        {one.name, line.vector("at_mm"),
         line.choice<errors::MeasuredBy>("by", {{"tool", errors::MeasuredBy::Tool},
                                                {"carriage", errors::MeasuredBy::Carriage}})});
    line.close();
  }
  if (!machine_.joints.empty()) lines.close();
}

std::vector<errors::Coefficient> known_numbers(TableReader& reader, const Node& of,
                                               const std::vector<Element>& elements) {
  std::map<std::string, errors::Coefficient> known;
  std::set<std::string> names;
  for (const errors::Coefficient& one : errors::coefficients(elements)) {
    known.emplace(errors::name_of(one, elements), one);
    names.insert(errors::name_of(one, elements));
  }
  std::vector<errors::Coefficient> numbers;
  if (!of.array()) reader.refuse("of", "a list of names such as \"EXX[1]\"", shown(of));
  for (const Node& name : of.array() ? *of.array() : Node::Array{}) {
    const auto found = name.text() ? known.find(*name.text()) : known.end();
    if (found == known.end()) {
      const auto meant = name.text() ? nearest(*name.text(), names) : std::nullopt;
      reader.faults().add(name.place, "a number of this file's curves such as \"EXX[1]\"",
                          shown(name) + (meant ? " (did you mean " + *meant + "?)" : ""));
      continue;
    }
    if (std::find(numbers.begin(), numbers.end(), found->second) != numbers.end())
      reader.faults().add(name.place, "each number once", shown(name) + " again");
    numbers.push_back(found->second);
  }
  return numbers;
}

// A belief says how well it knows its numbers: uncertainties, and the lower triangle of their
// correlation row by row.
errors::Covariance ErrorsReader::read_covariance(const std::vector<Element>& elements) {
  const Node* node = reader_.section("covariance");
  if (!node) return {};
  TableReader reader(*node, "errors.covariance", faults_);
  const std::size_t before = faults_.list().size();
  const Node* of = reader.know("of");
  if (!of) reader.missing("of", "a list of names such as \"EXX[1]\"");
  errors::Covariance result;
  if (of) result.of = known_numbers(reader, *of, elements);
  const auto m = Eigen::Index(result.of.size());
  VectorXd sigma = reader.numbers("standard_uncertainty_um_urad", int(m));
  const auto correlation =
      m > 1 ? reader.maybe_numbers("correlation", int(m * (m - 1) / 2)) : std::nullopt;
  reader.close();
  if (faults_.list().size() != before) return {};
  if ((sigma.array() < 0.0).any())
    reader.refuse("standard_uncertainty_um_urad", "numbers >= 0", "a negative one");
  for (Eigen::Index i = 0; i < m; ++i)
    sigma[i] *= elements[std::size_t(result.of[std::size_t(i)].element)].name.is_angle()
                    ? units::urad
                    : units::um;
  Eigen::MatrixXd R = Eigen::MatrixXd::Identity(m, m);
  Eigen::Index at = 0;
  for (Eigen::Index i = 0; i < m && correlation; ++i)
    for (Eigen::Index k = 0; k < i; ++k) R(i, k) = R(k, i) = (*correlation)[at++];
  if (eigenvalues(R)[0] < -1e-9 * double(m))
    reader.refuse("correlation", "a correlation that can be (no negative variance)", "another");
  result.matrix = sigma.asDiagonal() * R * sigma.asDiagonal();
  return result;
}

// Each element is bound alone, so that a refusal is reported where the element stands.
void ErrorsReader::check_against_machine() {
  if (machine_.joints.empty()) return;
  std::optional<kinematics::Chain> chain;
  try {
    chain.emplace(machine_.joints, machine_.T_bw, machine_.T_bs);
  } catch (const std::invalid_argument&) {
    return;  // reported with the machine
  }
  for (const Written& written : elements_) {
    try {
      errors::bind({{written.element}, {}}, *chain);
    } catch (const std::invalid_argument& fault) {
      faults_.add(written.place, "an element that fits the machine", fault.what());
    }
  }
}

void ErrorsReader::refuse_twice() {
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    for (std::size_t j = 0; j < i && !elements_[i].derived; ++j) {
      if (elements_[j].derived || !(elements_[i].element.name == elements_[j].element.name))
        continue;
      faults_.add(elements_[i].place, "each element once (its curves are one list)",
                  to_string(elements_[i].element.name) + " again");
      break;
    }
  }
}

ErrorsSection ErrorsReader::read() {
  ErrorsSection section;
  reader_.text("name", "");
  section.scale = reader_.number("scale", any_number, 1.0);
  know_elements();
  for (const Node::Entry& entry : *reader_.node().table()) read_element_key(entry);
  for (const Node* table : reader_.tables("tables")) read_whole_table(*table);
  read_measuring_lines();
  reader_.know("covariance");
  reader_.close();
  refuse_twice();
  check_against_machine();
  for (Written& written : elements_)
    section.geometric.elements.push_back(std::move(written.element));
  section.geometric.measuring_lines = lines_;
  section.geometric.covariance = read_covariance(section.geometric.elements);
  return section;
}

// Elements of one name become one; their order is that of the machine, whatever the files' order
// was.
errors::GeometricErrors joined(const errors::GeometricErrors& all,
                               const MachineDescription& machine) {
  const auto rank = [&](const ElementName& name) {
    std::size_t joint = 0;
    while (joint < machine.joints.size() && machine.joints[joint].name != name.axis &&
           !(machine.joints[joint].name == 's' && name.axis == 'S')) {
      ++joint;
    }
    return std::tuple(joint, name.location, name.component(), name.axis);
  };
  errors::GeometricErrors result = all;
  result.elements.clear();
  std::vector<std::size_t> order(all.elements.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return rank(all.elements[a].name) < rank(all.elements[b].name);
  });
  for (const std::size_t from : order) {
    const Element& element = all.elements[from];
    if (result.elements.empty() || !(result.elements.back().name == element.name))
      result.elements.push_back({element.name, {}});
    std::vector<Curve>& curves = result.elements.back().curves;
    for (std::size_t i = 0; i < all.covariance.of.size(); ++i) {
      if (all.covariance.of[i].element != int(from)) continue;
      result.covariance.of[i].element = int(result.elements.size()) - 1;
      result.covariance.of[i].curve += int(curves.size());
    }
    curves.insert(curves.end(), element.curves.begin(), element.curves.end());
  }
  return result;
}

/// Adds a part's elements, lines and covariance, which is not correlated with that of others.
void append(errors::GeometricErrors& all, ErrorsSection part) {
  const auto base = int(all.elements.size());
  for (Element& element : part.geometric.elements) {
    for (Curve& curve : element.curves) curve.scale *= part.scale;
    all.elements.push_back(std::move(element));
  }
  for (const errors::MeasuringLine& line : part.geometric.measuring_lines)
    all.measuring_lines.push_back(line);
  const errors::Covariance& one = part.geometric.covariance;
  const auto m = Eigen::Index(all.covariance.of.size()), k = Eigen::Index(one.of.size());
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(m + k, m + k);
  matrix.topLeftCorner(m, m) = all.covariance.matrix;
  matrix.bottomRightCorner(k, k) = one.matrix;
  all.covariance.matrix = std::move(matrix);
  for (errors::Coefficient number : one.of) {
    number.element += base;
    all.covariance.of.push_back(number);
  }
}

}  // namespace

errors::Between read_between(TableReader& curve) {
  return curve.choice<errors::Between>(
      "between", {{"linear", errors::Between::Linear}, {"spline", errors::Between::Spline}},
      errors::Between::Linear);
}

errors::Outside read_outside(TableReader& curve) {
  return curve.choice<errors::Outside>(
      "outside", {{"refuse", errors::Outside::Refuse}, {"hold", errors::Outside::Hold}},
      errors::Outside::Refuse);
}

ErrorsSection read_errors(const Node& node, const MachineDescription& machine, std::uint64_t seed,
                          Faults& faults) {
  ErrorsSection section;
  if (node.table()) {
    section = ErrorsReader(node, machine, seed, faults).read();
  } else if (node.array()) {
    for (const Node& part : *node.array()) {
      if (part.text()) continue;  // a file that was refused
      if (!part.table()) {
        faults.add(part.place, "a table or a file for errors", shown(part));
        continue;
      }
      append(section.geometric, ErrorsReader(part, machine, seed++, faults).read());
    }
  } else if (!node.text()) {
    faults.add(node.place, "a table, a file or a list of them for errors", shown(node));
  }
  section.geometric = joined(section.geometric, machine);
  return section;
}

}  // namespace abbe::sim
