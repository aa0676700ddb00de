#include "sim/compensation/control_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/element.h"
#include "errors/element_table.h"
#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/compensation/control_file_formats.h"

namespace abbe::sim::compensation {

namespace control {

using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

namespace {

constexpr double same_position = 1e-9;  // mm or rad

bool is_slide(const Chain& chain, int joint) {
  return chain.joints()[std::size_t(joint)].motion == Motion::Linear;
}

/// Returns a text such as "0.12 um" or "3.4 urad".
std::string small(double value, const Chain& chain, int joint) {
  return is_slide(chain, joint) ? fmt::format("{:.4g} um", value / units::um)
                                : fmt::format("{:.4g} urad", value / units::urad);
}

/// Returns the largest difference of a table from another at its points.
double missed(const AxisTable& table, const AxisTable& by) {
  const AxisTable there = at_positions(by, table.position);
  return std::max((there.upward - table.upward).cwiseAbs().maxCoeff(),
                  (there.downward - table.downward).cwiseAbs().maxCoeff());
}

/// Returns all positions of some tables; positions that differ only by rounding become one.
Eigen::VectorXd positions_of(const std::vector<const AxisTable*>& tables) {
  std::vector<double> all;
  for (const AxisTable* table : tables)
    all.insert(all.end(), table->position.begin(), table->position.end());
  std::sort(all.begin(), all.end());
  const auto is_same = [](double a, double b) { return b - a <= same_position; };
  all.erase(std::unique(all.begin(), all.end(), is_same), all.end());
  return Eigen::Map<const Eigen::VectorXd>(all.data(), Eigen::Index(all.size()));
}

// Returns a table sampled at equidistant positions over its range.
AxisTable at_equidistant(const AxisTable& table, Eigen::Index points) {
  return at_positions(table, Eigen::VectorXd::LinSpaced(points, table.position[0],
                                                        table.position[table.position.size() - 1]));
}

}  // namespace

char axis_letter(const Chain& chain, int joint) { return chain.joints()[std::size_t(joint)].name; }

double unit_of(const Chain& chain, int joint) { return is_slide(chain, joint) ? 1.0 : units::deg; }

const char* unit_name(const Chain& chain, int joint) {
  return is_slide(chain, joint) ? "mm" : "deg";
}

std::string decimal(double value, int decimals) {
  std::string text = fmt::format("{:.{}f}", value, decimals);
  if (text.front() == '-' && text.find_first_not_of("-0.") == std::string::npos) text.erase(0, 1);
  return text;
}

std::string relation(const AxisTable& table, const Chain& chain) {
  if (table.of == table.moves) return std::string(1, axis_letter(chain, table.of));
  return fmt::format("{} over {}", axis_letter(chain, table.moves), axis_letter(chain, table.of));
}

std::vector<AxisTable> summed(const std::vector<AxisTable>& tables) {
  std::vector<AxisTable> sums;
  std::vector<char> is_done(tables.size(), 0);
  for (std::size_t i = 0; i < tables.size(); ++i) {
    if (is_done[i]) continue;
    std::vector<const AxisTable*> alike;
    for (std::size_t k = i; k < tables.size(); ++k) {
      if (tables[k].of != tables[i].of || tables[k].moves != tables[i].moves) continue;
      is_done[k] = 1;
      alike.push_back(&tables[k]);
    }
    // a single table keeps its own positions, and with them its bits
    AxisTable sum = alike.size() == 1 ? tables[i] : at_positions(tables[i], positions_of(alike));
    for (std::size_t k = 1; k < alike.size(); ++k) {
      const AxisTable part = at_positions(*alike[k], sum.position);
      sum.upward += part.upward;
      sum.downward += part.downward;
    }
    sums.push_back(std::move(sum));
  }
  return sums;
}

AxisTable at_positions(const AxisTable& table, const Eigen::VectorXd& positions) {
  AxisTable out{table.of, table.moves, positions, Eigen::VectorXd(positions.size()),
                Eigen::VectorXd(positions.size())};
  for (Eigen::Index k = 0; k < positions.size(); ++k) {
    out.upward[k] = correction(table, positions[k], 1);
    out.downward[k] = correction(table, positions[k], -1);
  }
  return out;
}

FittedTable fit_table(const AxisTable& table, const Chain& chain, const Capacity& capacity) {
  const Eigen::Index n = table.position.size();
  const auto gaps = table.position.tail(n - 1) - table.position.head(n - 1);
  const double least = capacity.min_spacing * unit_of(chain, table.of);
  if (n <= capacity.max_points && gaps.minCoeff() >= least) return {table, std::nullopt};
  const double width = table.position[n - 1] - table.position[0];
  const double room = std::min(double(capacity.max_points), std::floor(width / least) + 1.0);
  // A table narrower than its digits is a constant, which any two points hold.
  AxisTable out = at_equidistant(table, Eigen::Index(std::max(room, 2.0)));
  // its second point must stand apart by a digit, or the file would read two equal positions
  if (width < least) out.position[1] = out.position[0] + least;
  std::string words = fmt::format("{}: {} points, of which the control holds {}; misses them by {}",
                                  relation(table, chain), n, out.position.size(),
                                  small(missed(table, out), chain, table.moves));
  return {std::move(out), std::move(words)};
}

FittedTable equidistant(const AxisTable& table, const Chain& chain) {
  AxisTable out = at_equidistant(table, table.position.size());
  const double step = out.position[1] - out.position[0];
  // equidistant up to rounding: the values stay as they are, without interpolation
  if ((out.position - table.position).cwiseAbs().maxCoeff() <= 1e-9 * step) {
    out.upward = table.upward;
    out.downward = table.downward;
    return {std::move(out), std::nullopt};
  }
  std::string words = fmt::format(
      "{}: {} points that are not equidistant; equidistant ones miss them by {}",
      relation(table, chain), table.position.size(), small(missed(table, out), chain, table.moves));
  return {std::move(out), std::move(words)};
}

std::vector<std::string> offsets_left_out(const ParameterTables& tables, const Chain& chain) {
  std::vector<std::string> words;
  for (int i = 0; i < chain.size(); ++i)
    if (tables.offset[i] != 0.0)
      words.push_back(fmt::format("offset of {}, {}: set it as an origin or tool offset",
                                  axis_letter(chain, i), small(tables.offset[i], chain, i)));
  return words;
}

bool is_direction_independent(const AxisTable& table) { return table.upward == table.downward; }

void check_files(std::span<const ControlFile> files) {
  if (files.size() > max_files)
    throw BadInput("", 0, 0, fmt::format("at most {} files", max_files),
                   fmt::format("{}", files.size()));
  std::set<std::string> names;
  for (const ControlFile& file : files) {
    if (file.text.size() > most_bytes)
      throw BadInput(file.name, 0, 0, fmt::format("at most {} bytes", most_bytes),
                     fmt::format("{}", file.text.size()));
    if (!names.insert(base_name(file.name)).second)
      throw BadInput(file.name, 0, 0, "every file once", "the second of that name");
  }
}

std::optional<int> movable(char letter, const Chain& chain) {
  const auto joint = chain.find(letter);
  if (!joint || chain.joints()[std::size_t(*joint)].motion == Motion::Spindle) return std::nullopt;
  return joint;
}

std::string movable_letters(const Chain& chain) {
  std::string letters;
  for (const Joint& joint : chain.joints())
    if (joint.motion != Motion::Spindle)
      letters += std::string(letters.empty() ? "" : " ") + joint.name;
  return letters;
}

std::string base_name(const std::string& name) {
  // controls and their file systems ignore upper and lower case
  std::string base = name.substr(name.find_last_of("/\\") + 1);
  for (char& c : base)
    if (c >= 'a' && c <= 'z') c = char(c - 'a' + 'A');
  return base;
}

}  // namespace control

namespace {

[[noreturn]] void throw_isg_error() {
  throw std::invalid_argument(
      "control files: the ISG format holds deviations of carriages, not corrections of axes");
}

}  // namespace

const char* to_string(ControlFormat format) {
  switch (format) {
    case ControlFormat::LinuxCnc:
      return "linuxcnc";
    case ControlFormat::Isg:
      return "isg";
    case ControlFormat::Siemens:
      return "siemens";
    case ControlFormat::Heidenhain:
      return "heidenhain";
  }
  return "?";
}

Export to_control(const ParameterTables& tables, const kinematics::Chain& chain,
                  ControlFormat format) {
  validate(tables, chain);
  switch (format) {
    case ControlFormat::LinuxCnc:
      return control::to_linuxcnc(tables, chain);
    case ControlFormat::Siemens:
      return control::to_siemens(tables, chain);
    case ControlFormat::Heidenhain:
      return control::to_heidenhain(tables, chain);
    case ControlFormat::Isg:
      break;
  }
  throw_isg_error();
}

ParameterTables read_control_tables(std::span<const ControlFile> files,
                                    const kinematics::Chain& chain, ControlFormat format) {
  control::check_files(files);
  switch (format) {
    case ControlFormat::LinuxCnc:
      return control::read_linuxcnc_tables(files, chain);
    case ControlFormat::Siemens:
      return control::read_siemens_tables(files, chain);
    case ControlFormat::Heidenhain:
      return control::read_heidenhain_tables(files, chain);
    case ControlFormat::Isg:
      break;
  }
  throw_isg_error();
}

namespace {

using errors::Element;
using errors::ElementName;
using errors::ElementTable;
using errors::GeometricErrors;
using errors::GeometricModel;
using kinematics::AxisState;
using kinematics::Chain;
using kinematics::Deviation;
using kinematics::JointDeviation;

// Axes and directions of the format; the position errors of others cannot be written.
constexpr std::string_view letters = "XYZABC";
constexpr std::string_view directions = "XYZABC";
constexpr std::size_t max_blocks = 64;

bool is_isg_axis(char letter) { return letters.find(letter) != std::string_view::npos; }

/// Returns a state with every axis within its own range, so that no table of another axis is left.
AxisState standing(const Chain& chain, const TableOptions& options) {
  AxisState state;
  state.q.resize(chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const Eigen::VectorXd positions = table_positions(chain, i, options);
    const kinematics::Joint& joint = chain.joints()[std::size_t(i)];
    state.q[i] = positions.size() > 0 ? positions[positions.size() / 2]
                                      : std::clamp(0.0, joint.min, joint.max);
  }
  return state;
}

struct Sampled {
  ElementTable table;
  bool turns_back = false;  // some deviation depends on the direction
};

Sampled sampled(const GeometricModel& model, const Chain& chain, int joint, AxisState state,
                const Eigen::VectorXd& positions) {
  Sampled out;
  out.table.axis = chain.joints()[std::size_t(joint)].name;
  for (const char direction : directions)
    out.table.elements.push_back({direction, out.table.axis, false});
  out.table.q = positions;
  out.table.values.resize(positions.size(), 6);
  const auto motion = [&](int direction) -> Deviation {
    state.direction[std::size_t(joint)] = std::int8_t(direction);
    return errors::deviations(model, state)[std::size_t(joint)].motion;
  };
  for (Eigen::Index k = 0; k < positions.size(); ++k) {
    state.q[joint] = positions[k];
    const Deviation up = motion(1), down = motion(-1);
    out.table.values.row(k) = (0.5 * (up + down)).transpose();
    out.turns_back = out.turns_back || up != down;
  }
  return out;
}

std::vector<std::string> left_out_of(const GeometricModel& model, const Chain& chain) {
  std::vector<std::string> words;
  for (const GeometricModel::Bound& bound : model.elements) {
    const std::string name = to_string(bound.element.name);
    if (!is_isg_axis(chain.joints()[std::size_t(bound.joint)].name))
      words.push_back(name + ": no axis of the format");
    const auto& curves = bound.element.curves;
    if (std::any_of(curves.begin(), curves.end(), errors::is_random))
      words.push_back(name + ": its random part");
  }
  return words;
}

/// Returns a header and a row with the location errors that are not zero; empty if there are none.
std::string position_errors(const std::vector<JointDeviation>& deviations, const Chain& chain) {
  std::string head, row;
  for (int i = 0; i < chain.size(); ++i) {
    const char axis = chain.joints()[std::size_t(i)].name;
    if (!is_isg_axis(axis)) continue;
    for (std::size_t k = 0; k < directions.size(); ++k) {
      const double value = deviations[std::size_t(i)].location[Eigen::Index(k)];
      if (value == 0.0) continue;
      head += fmt::format("{}{}0{}", head.empty() ? "" : "\t", directions[k], axis);
      row += fmt::format("{}{}", row.empty() ? "" : "\t", value);
    }
  }
  return head.empty() ? "" : "// mm and rad\n" + head + "\n" + row + "\n";
}

/// Returns notes on position errors for which a control may displace the frame of their axis, which
/// is not what they state.
std::vector<std::string> position_notes(const std::vector<JointDeviation>& deviations,
                                        const Chain& chain) {
  std::vector<std::string> notes;
  for (int i = 0; i < chain.size(); ++i) {
    const kinematics::Joint& joint = chain.joints()[std::size_t(i)];
    if (!is_isg_axis(joint.name) || joint.squareness == kinematics::Squareness::Travel) continue;
    for (std::size_t k = 0; k < directions.size(); ++k)
      if (deviations[std::size_t(i)].location[Eigen::Index(k)] != 0.0 &&
          chain.location_rule(i)[k] != kinematics::DisplacedPart::Frame)
        notes.push_back(fmt::format(
            "{0}0{1} is stated against a slide that {1} carries (ISO 230-1: the angle between the "
            "two); a control that displaces the frame of {1} would take both along",
            directions[k], joint.name));
  }
  return notes;
}

/// Returns the blocks of a file between its breaks, without comments. Each is preceded by empty
/// lines, so that lines keep their numbers.
std::vector<std::string> blocks_of(const ControlFile& file) {
  std::vector<std::string> blocks(1);
  Lines lines(file.text);
  while (const auto line = lines.next()) {
    const std::string_view text = line->substr(0, line->find("//"));
    const std::size_t start = text.find_first_not_of(" \t");
    if (start != std::string_view::npos && text[start] == '#') {
      if (blocks.size() == max_blocks)
        throw BadInput(file.name, lines.number(), int(start) + 1,
                       fmt::format("at most {} heads", max_blocks), "more");
      blocks.emplace_back(std::size_t(lines.number()), '\n');
    } else {
      blocks.back() += text;
      blocks.back() += '\n';
    }
  }
  return blocks;
}

/// Reads all blocks of all files, which together must state every element once.
class VolumetricReader {
 public:
  explicit VolumetricReader(const Chain& chain) : chain_(chain) {}

  void read(const ControlFile& file) {
    for (const std::string& block : blocks_of(file)) read_block(block, file.name);
  }

  GeometricErrors take() { return std::move(errors_); }

 private:
  void read_block(const std::string& block, const std::string& file) {
    TableLines lines(block, file, std::nullopt);
    const auto head = lines.next();
    if (!head) return;
    const char separator = cell_separator(head->text);
    const std::vector<Cell> cells = cells_of(head->text, separator, 64);
    // a position error such as C0Y has the digit 0 in its name, a component error has none
    if (cells.front().text.find('0') != std::string_view::npos)
      read_position_errors(lines, cells, separator);
    else
      read_component_errors(lines, cells.front(), errors::read_element_table(block, file));
  }

  void read_component_errors(const TableLines& lines, const Cell& axis, const ElementTable& table) {
    check_axis(lines, axis, table.axis);
    errors::TableUse use;
    // held outside the rows, as assumed in parameter_tables.h
    use.outside = errors::Outside::Hold;
    for (Element& element : errors::elements_of(table, use)) add(lines, axis, std::move(element));
  }

  void read_position_errors(TableLines& lines, const std::vector<Cell>& heads, char separator) {
    std::vector<ElementName> names;
    for (const Cell& head : heads) names.push_back(location_name(lines, head));
    const auto row = lines.next();
    if (!row) lines.refuse(0, "a row of values", "none");
    const std::vector<Cell> cells = cells_of(row->text, separator, heads.size());
    if (cells.size() != heads.size())
      lines.refuse(1, fmt::format("{} cells, as the head has", heads.size()),
                   cells.size() > heads.size() ? "more" : fmt::format("{}", cells.size()));
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const double value = lines.number_in(cells[i]);
      if (value != 0.0) add(lines, cells[i], {names[i], {{errors::Constant{value}}}});
    }
    if (const auto more = lines.next())
      lines.refuse(1, "one row of position errors", in_quotes(more->text));
  }

  ElementName location_name(const TableLines& lines, const Cell& head) const {
    try {
      const ElementName name = errors::parse_element_name(head.text);
      if (name.location) {
        check_axis(lines, head, name.axis);
        return name;
      }
    } catch (const std::invalid_argument&) {
    }
    lines.refuse(head, "a position error such as C0Y");
  }

  void check_axis(const TableLines& lines, const Cell& cell, char axis) const {
    if (!is_isg_axis(axis) || !control::movable(axis, chain_))
      lines.refuse(cell,
                   fmt::format("an axis of the machine ({})", control::movable_letters(chain_)));
  }

  void add(const TableLines& lines, const Cell& cell, Element element) {
    for (const Element& other : errors_.elements)
      if (other.name == element.name)
        lines.refuse(cell, fmt::format("{} once", to_string(element.name)));
    try {
      errors::check_meaning(element.name, chain_, *chain_.find(element.name.axis));
    } catch (const std::invalid_argument& refusal) {
      lines.refuse(cell, refusal.what());
    }
    errors_.elements.push_back(std::move(element));
  }

  const Chain& chain_;
  GeometricErrors errors_;
};

}  // namespace

Export to_volumetric(const GeometricModel& believed, const Chain& chain,
                     const TableOptions& options) {
  Export out;
  // a table holds no chance; the random part was listed as left out
  out.left_out = left_out_of(believed, chain);
  const GeometricModel model = errors::without_random(believed);
  const AxisState state = standing(chain, options);
  for (int i = 0; i < chain.size(); ++i) {
    const char axis = chain.joints()[std::size_t(i)].name;
    const Eigen::VectorXd positions = table_positions(chain, i, options);
    if (!is_isg_axis(axis) || positions.size() == 0) continue;
    const Sampled samples = sampled(model, chain, i, state, positions);
    if (samples.turns_back)
      out.left_out.push_back(fmt::format("{}: the direction of motion; its mean is written", axis));
    if ((samples.table.values.array() == 0.0).all()) continue;
    out.files.push_back({fmt::format("{}.csv", axis),
                         fmt::format("// mm and rad over {}\n", control::unit_name(chain, i)) +
                             errors::write_element_table(samples.table, '\t')});
  }
  const std::vector<JointDeviation> deviations = errors::deviations(model, state);
  const std::string locations = position_errors(deviations, chain);
  if (!locations.empty()) out.files.push_back({"position_errors.csv", locations});
  if (!out.files.empty())
    out.notes.emplace_back(
        "values are actual minus nominal of each carriage over its command; whether "
        "the control's chain counts an axis the other way is for its `negate`");
  for (std::string& note : position_notes(deviations, chain)) out.notes.push_back(std::move(note));
  return out;
}

GeometricErrors read_volumetric_deviations(std::span<const ControlFile> files, const Chain& chain) {
  control::check_files(files);
  VolumetricReader reader(chain);
  for (const ControlFile& file : files) reader.read(file);
  return reader.take();
}

}  // namespace abbe::sim::compensation
