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

constexpr double position_tolerance = 1e-9;  // mm or rad; closer positions count as one

bool is_slide(const Chain& chain, int joint) {
  return chain.joints()[std::size_t(joint)].motion == Motion::Linear;
}

/// Returns the text of a deviation of a joint, such as "0.12 um" or "3.4 urad".
std::string deviation_text(double value, const Chain& chain, int joint) {
  return is_slide(chain, joint) ? fmt::format("{:.4g} um", value / units::um)
                                : fmt::format("{:.4g} urad", value / units::urad);
}

/// Returns the largest difference of an approximation from a table at the points of the table.
double max_difference(const AxisTable& table, const AxisTable& approximation) {
  const AxisTable resampled = at_positions(approximation, table.position);
  return std::max((resampled.upward - table.upward).cwiseAbs().maxCoeff(),
                  (resampled.downward - table.downward).cwiseAbs().maxCoeff());
}

/// Returns the union of the positions of tables. Positions that differ only by rounding become one.
Eigen::VectorXd merge_positions(const std::vector<const AxisTable*>& tables) {
  std::vector<double> positions;
  for (const AxisTable* table : tables)
    positions.insert(positions.end(), table->position.begin(), table->position.end());
  std::sort(positions.begin(), positions.end());
  const auto is_same = [](double a, double b) { return b - a <= position_tolerance; };
  positions.erase(std::unique(positions.begin(), positions.end(), is_same), positions.end());
  return Eigen::Map<const Eigen::VectorXd>(positions.data(), Eigen::Index(positions.size()));
}

/// Returns a table resampled at equidistant positions over its range.
AxisTable resample_equidistant(const AxisTable& table, Eigen::Index points) {
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
  if (table.argument_joint == table.corrected_joint)
    return std::string(1, axis_letter(chain, table.argument_joint));
  return fmt::format("{} over {}", axis_letter(chain, table.corrected_joint),
                     axis_letter(chain, table.argument_joint));
}

std::vector<AxisTable> summed(const std::vector<AxisTable>& tables) {
  std::vector<AxisTable> sums;
  std::vector<char> is_summed(tables.size(), 0);
  for (std::size_t i = 0; i < tables.size(); ++i) {
    if (is_summed[i]) continue;
    std::vector<const AxisTable*> tables_of_pair;
    for (std::size_t k = i; k < tables.size(); ++k) {
      if (tables[k].argument_joint != tables[i].argument_joint ||
          tables[k].corrected_joint != tables[i].corrected_joint)
        continue;
      is_summed[k] = 1;
      tables_of_pair.push_back(&tables[k]);
    }
    // A single table keeps its positions, and with them its bits.
    AxisTable sum = tables_of_pair.size() == 1
                        ? tables[i]
                        : at_positions(tables[i], merge_positions(tables_of_pair));
    for (std::size_t k = 1; k < tables_of_pair.size(); ++k) {
      const AxisTable resampled = at_positions(*tables_of_pair[k], sum.position);
      sum.upward += resampled.upward;
      sum.downward += resampled.downward;
    }
    sums.push_back(std::move(sum));
  }
  return sums;
}

AxisTable at_positions(const AxisTable& table, const Eigen::VectorXd& positions) {
  AxisTable result{table.argument_joint, table.corrected_joint, positions,
                   Eigen::VectorXd(positions.size()), Eigen::VectorXd(positions.size())};
  for (Eigen::Index k = 0; k < positions.size(); ++k) {
    result.upward[k] = correction(table, positions[k], 1);
    result.downward[k] = correction(table, positions[k], -1);
  }
  return result;
}

FittedTable fit_table(const AxisTable& table, const Chain& chain, const Capacity& capacity) {
  const Eigen::Index n = table.position.size();
  const auto gaps = table.position.tail(n - 1) - table.position.head(n - 1);
  const double min_gap = capacity.min_spacing * unit_of(chain, table.argument_joint);
  if (n <= capacity.max_points && gaps.minCoeff() >= min_gap) return {table, std::nullopt};
  const double width = table.position[n - 1] - table.position[0];
  const double room = std::min(double(capacity.max_points), std::floor(width / min_gap) + 1.0);
  // A table narrower than the resolution of the file is a constant, which any two points represent.
  AxisTable result = resample_equidistant(table, Eigen::Index(std::max(room, 2.0)));
  // The second point must differ by a digit, or the file would have two equal positions.
  if (width < min_gap) result.position[1] = result.position[0] + min_gap;
  std::string words =
      fmt::format("{}: {} points, but the control holds only {}; they deviate by {}",
                  relation(table, chain), n, result.position.size(),
                  deviation_text(max_difference(table, result), chain, table.corrected_joint));
  return {std::move(result), std::move(words)};
}

FittedTable equidistant(const AxisTable& table, const Chain& chain) {
  AxisTable result = resample_equidistant(table, table.position.size());
  const double step = result.position[1] - result.position[0];
  // If positions are equidistant up to rounding, the values stay unchanged, without interpolation.
  if ((result.position - table.position).cwiseAbs().maxCoeff() <= 1e-9 * step) {
    result.upward = table.upward;
    result.downward = table.downward;
    return {std::move(result), std::nullopt};
  }
  std::string words =
      fmt::format("{}: {} points that are not equidistant; equidistant points deviate by {}",
                  relation(table, chain), table.position.size(),
                  deviation_text(max_difference(table, result), chain, table.corrected_joint));
  return {std::move(result), std::move(words)};
}

std::vector<std::string> offsets_left_out(const ParameterTables& tables, const Chain& chain) {
  std::vector<std::string> words;
  for (int i = 0; i < chain.size(); ++i)
    if (tables.offset[i] != 0.0)
      words.push_back(fmt::format("offset of {}, {}: set it as an origin or tool offset",
                                  axis_letter(chain, i),
                                  deviation_text(tables.offset[i], chain, i)));
  return words;
}

bool is_direction_independent(const AxisTable& table) { return table.upward == table.downward; }

void check_files(std::span<const ControlFile> files) {
  if (files.size() > max_files)
    throw BadInput("", 0, 0, fmt::format("at most {} files", max_files),
                   fmt::format("{}", files.size()));
  std::set<std::string> names;
  for (const ControlFile& file : files) {
    if (file.text.size() > max_file_bytes)
      throw BadInput(file.name, 0, 0, fmt::format("at most {} bytes", max_file_bytes),
                     fmt::format("{}", file.text.size()));
    if (!names.insert(base_name(file.name)).second)
      throw BadInput(file.name, 0, 0, "each file only once", "a second file of that name");
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
  // Controls and their file systems ignore case.
  std::string base = name.substr(name.find_last_of("/\\") + 1);
  for (char& c : base)
    if (c >= 'a' && c <= 'z') c = char(c - 'a' + 'A');
  return base;
}

}  // namespace control

namespace {

[[noreturn]] void throw_isg_error() {
  throw std::invalid_argument(
      "control files: the ISG format stores deviations of carriages, not corrections of axes");
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

ControlExport to_control(const ParameterTables& tables, const kinematics::Chain& chain,
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

// Axes and directions of the format; errors of other axes cannot be written.
constexpr std::string_view letters = "XYZABC";
constexpr std::string_view directions = "XYZABC";
constexpr std::size_t max_blocks = 64;

bool is_isg_axis(char letter) { return letters.find(letter) != std::string_view::npos; }

/// Returns a state with every axis in the middle of its range, where no table of the belief ends.
AxisState middle_state(const Chain& chain, const TableOptions& options) {
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

/// Deviations of a carriage at the positions of its joint.
struct SampledDeviations {
  ElementTable table;
  bool depends_on_direction = false;  // some deviation depends on the direction
};

/// Samples the deviations of a carriage for both directions of motion; the table holds their mean.
SampledDeviations sample_deviations(const GeometricModel& model, const Chain& chain, int joint,
                                    AxisState state, const Eigen::VectorXd& positions) {
  SampledDeviations result;
  result.table.axis = chain.joints()[std::size_t(joint)].name;
  for (const char direction : directions)
    result.table.elements.push_back({direction, result.table.axis, false});
  result.table.q = positions;
  result.table.values.resize(positions.size(), 6);
  const auto motion = [&](int direction) -> Deviation {
    state.direction[std::size_t(joint)] = std::int8_t(direction);
    return errors::deviations(model, state)[std::size_t(joint)].motion;
  };
  for (Eigen::Index k = 0; k < positions.size(); ++k) {
    state.q[joint] = positions[k];
    const Deviation up = motion(1), down = motion(-1);
    result.table.values.row(k) = (0.5 * (up + down)).transpose();
    result.depends_on_direction = result.depends_on_direction || up != down;
  }
  return result;
}

/// Returns a note for every element that the format cannot hold.
std::vector<std::string> omission_notes(const GeometricModel& model, const Chain& chain) {
  std::vector<std::string> words;
  for (const GeometricModel::Bound& bound : model.elements) {
    const std::string name = to_string(bound.element.name);
    if (!is_isg_axis(chain.joints()[std::size_t(bound.joint)].name))
      words.push_back(name + ": not an axis of the format");
    const auto& curves = bound.element.curves;
    if (std::any_of(curves.begin(), curves.end(), errors::is_random))
      words.push_back(name + ": its random part");
  }
  return words;
}

/// Returns the text of a header and a row with the location errors that are not zero; an empty text
/// if there are none.
std::string position_errors(const std::vector<JointDeviation>& deviations, const Chain& chain) {
  std::string header, row;
  for (int i = 0; i < chain.size(); ++i) {
    const char axis = chain.joints()[std::size_t(i)].name;
    if (!is_isg_axis(axis)) continue;
    for (std::size_t k = 0; k < directions.size(); ++k) {
      const double value = deviations[std::size_t(i)].location[Eigen::Index(k)];
      if (value == 0.0) continue;
      header += fmt::format("{}{}0{}", header.empty() ? "" : "\t", directions[k], axis);
      row += fmt::format("{}{}", row.empty() ? "" : "\t", value);
    }
  }
  return header.empty() ? "" : "// mm and rad\n" + header + "\n" + row + "\n";
}

/// Returns notes on position errors for which a control may displace the frame of an axis, although
/// they do not state such a displacement.
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
            "{0}0{1} is stated relative to a slide that {1} carries (ISO 230-1: the angle between "
            "the two); a control that displaces the frame of {1} would move both",
            directions[k], joint.name));
  }
  return notes;
}

/// Splits a file at its # lines into blocks without comments. Each block begins with empty lines,
/// so that its lines keep their numbers.
std::vector<std::string> split_blocks(const ControlFile& file) {
  std::vector<std::string> blocks(1);
  LineReader lines(file.text);
  while (const auto line = lines.next()) {
    const std::string_view text = line->substr(0, line->find("//"));
    const std::size_t start = text.find_first_not_of(" \t");
    if (start != std::string_view::npos && text[start] == '#') {
      if (blocks.size() == max_blocks)
        throw BadInput(file.name, lines.number(), int(start) + 1,
                       fmt::format("at most {} headers", max_blocks), "more");
      blocks.emplace_back(std::size_t(lines.number()), '\n');
    } else {
      blocks.back() += text;
      blocks.back() += '\n';
    }
  }
  return blocks;
}

/// Reads all blocks of all files. Together they must state every element at most once.
class VolumetricReader {
 public:
  explicit VolumetricReader(const Chain& chain) : chain_(chain) {}

  void read(const ControlFile& file) {
    for (const std::string& block : split_blocks(file)) read_block(block, file.name);
  }

  GeometricErrors take() { return std::move(errors_); }

 private:
  void read_block(const std::string& block, const std::string& file) {
    TableLineReader lines(block, file, std::nullopt);
    const auto header = lines.next();
    if (!header) return;
    const char separator = cell_separator(header->text);
    const std::vector<Cell> cells = split_cells(header->text, separator, 64);
    // Only names of position errors, such as C0Y, contain the digit 0.
    if (cells.front().text.find('0') != std::string_view::npos)
      read_position_errors(lines, cells, separator);
    else
      read_component_errors(lines, cells.front(), errors::read_element_table(block, file));
  }

  void read_component_errors(const TableLineReader& lines, const Cell& axis,
                             const ElementTable& table) {
    check_axis(lines, axis, table.axis);
    errors::ElementConversionOptions use;
    // parameter_tables.h assumes that values hold outside the rows.
    use.outside = errors::TableExtrapolation::Hold;
    for (Element& element : errors::to_elements(table, use)) add(lines, axis, std::move(element));
  }

  /// Reads the names and the single row of a block of position errors.
  void read_position_errors(TableLineReader& lines, const std::vector<Cell>& headers,
                            char separator) {
    std::vector<ElementName> names;
    for (const Cell& header : headers) names.push_back(location_name(lines, header));
    const auto row = lines.next();
    if (!row) lines.refuse(0, "a row of values", "none");
    const std::vector<Cell> cells = split_cells(row->text, separator, headers.size());
    if (cells.size() != headers.size())
      lines.refuse(1, fmt::format("{} cells, as in the header", headers.size()),
                   cells.size() > headers.size() ? "more" : fmt::format("{}", cells.size()));
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const double value = lines.number_in(cells[i]);
      if (value != 0.0) add(lines, cells[i], {names[i], {{errors::Constant{value}}}});
    }
    if (const auto next_row = lines.next())
      lines.refuse(1, "one row of position errors", quoted_excerpt(next_row->text));
  }

  ElementName location_name(const TableLineReader& lines, const Cell& header) const {
    try {
      const ElementName name = errors::parse_element_name(header.text);
      if (name.location) {
        check_axis(lines, header, name.axis);
        return name;
      }
    } catch (const std::invalid_argument&) {
    }
    lines.refuse(header, "a position error such as C0Y");
  }

  void check_axis(const TableLineReader& lines, const Cell& cell, char axis) const {
    if (!is_isg_axis(axis) || !control::movable(axis, chain_))
      lines.refuse(cell,
                   fmt::format("an axis of the machine ({})", control::movable_letters(chain_)));
  }

  void add(const TableLineReader& lines, const Cell& cell, Element element) {
    for (const Element& other : errors_.elements)
      if (other.name == element.name)
        lines.refuse(cell, fmt::format("{} only once", to_string(element.name)));
    try {
      errors::check_meaning(element.name, chain_, *chain_.find(element.name.axis));
    } catch (const std::invalid_argument& error) {
      lines.refuse(cell, error.what());
    }
    errors_.elements.push_back(std::move(element));
  }

  const Chain& chain_;
  GeometricErrors errors_;
};

}  // namespace

ControlExport to_volumetric(const GeometricModel& believed, const Chain& chain,
                            const TableOptions& options) {
  ControlExport result;
  // A table cannot hold random errors; they are listed as left out.
  result.omissions = omission_notes(believed, chain);
  const GeometricModel model = errors::without_random_errors(believed);
  const AxisState state = middle_state(chain, options);
  for (int i = 0; i < chain.size(); ++i) {
    const char axis = chain.joints()[std::size_t(i)].name;
    const Eigen::VectorXd positions = table_positions(chain, i, options);
    if (!is_isg_axis(axis) || positions.size() == 0) continue;
    const SampledDeviations samples = sample_deviations(model, chain, i, state, positions);
    if (samples.depends_on_direction)
      result.omissions.push_back(
          fmt::format("{}: dependence on direction is omitted; the mean is written", axis));
    if ((samples.table.values.array() == 0.0).all()) continue;
    result.files.push_back({fmt::format("{}.csv", axis),
                            fmt::format("// mm and rad over {}\n", control::unit_name(chain, i)) +
                                errors::write_element_table(samples.table, '\t')});
  }
  const std::vector<JointDeviation> deviations = errors::deviations(model, state);
  const std::string locations = position_errors(deviations, chain);
  if (!locations.empty()) result.files.push_back({"position_errors.csv", locations});
  if (!result.files.empty())
    result.notes.emplace_back(
        "values are actual minus nominal of each carriage over its command; use `negate` of the "
        "control if it counts an axis in the opposite direction");
  for (std::string& note : position_notes(deviations, chain))
    result.notes.push_back(std::move(note));
  return result;
}

GeometricErrors read_volumetric_deviations(std::span<const ControlFile> files, const Chain& chain) {
  control::check_files(files);
  VolumetricReader reader(chain);
  for (const ControlFile& file : files) reader.read(file);
  return reader.take();
}

}  // namespace abbe::sim::compensation
