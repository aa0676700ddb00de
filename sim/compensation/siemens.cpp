#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "sim/compensation/control_file_formats.h"

namespace abbe::sim::compensation::control {
namespace {

using kinematics::Chain;

constexpr int max_rows = 5000;  // of a table; machine data of a control may allow fewer
constexpr int max_tables = 200;
constexpr int value_decimals = 8;
constexpr int step_decimals = 12;  // the control adds up the step thousands of times

// A positive $AA_ENC_COMP moves the axis in the negative direction; $AN_CEC is added to the
// set-point.
constexpr double encoder_sign = -1.0;
constexpr double cross_sign = 1.0;

std::string axis_name(const Chain& chain, int joint) {
  return std::string(1, chain.joints()[std::size_t(joint)].name) + "1";
}

/// The positions of a table in the units of the file.
struct EquidistantGrid {
  double min = 0.0;
  double max = 0.0;
  double step = 0.0;
};

/// Returns range and step in the units of the file. The step is computed from the rounded range, so
/// that the last point is at the printed end.
EquidistantGrid equidistant_grid(const AxisTable& table, double unit) {
  const Eigen::Index last_index = table.position.size() - 1;
  const double digit_scale = std::pow(10.0, value_decimals);
  EquidistantGrid grid{std::round(table.position[0] / unit * digit_scale) / digit_scale,
                       std::round(table.position[last_index] / unit * digit_scale) / digit_scale,
                       0.0};
  grid.step = (grid.max - grid.min) / double(last_index);
  return grid;
}

/// Returns the text of an encoder table, which has one value for both directions.
std::string encoder_table(const AxisTable& table, const Chain& chain) {
  const double unit = unit_of(chain, table.argument_joint);
  const std::string name = axis_name(chain, table.argument_joint);
  const EquidistantGrid grid = equidistant_grid(table, unit);
  std::string text;
  for (Eigen::Index k = 0; k < table.position.size(); ++k)
    text += fmt::format("$AA_ENC_COMP[0,{},{}]={}\n", k, name,
                        decimal(encoder_sign * table.upward[k] / unit, value_decimals));
  text += fmt::format("$AA_ENC_COMP_STEP[0,{}]={}\n", name, decimal(grid.step, step_decimals));
  text += fmt::format("$AA_ENC_COMP_MIN[0,{}]={}\n", name, decimal(grid.min, value_decimals));
  text += fmt::format("$AA_ENC_COMP_MAX[0,{}]={}\n", name, decimal(grid.max, value_decimals));
  text += fmt::format("$AA_ENC_COMP_IS_MODULO[0,{}]=0\n", name);
  return text;
}

/// Returns the text of a cross table for one direction.
/// @param direction  0: both, 1: up, -1: down
std::string cross_table(const AxisTable& table, const Chain& chain, int index, int direction) {
  const double unit = unit_of(chain, table.corrected_joint);
  const EquidistantGrid grid = equidistant_grid(table, unit_of(chain, table.argument_joint));
  const Eigen::VectorXd& value = direction < 0 ? table.downward : table.upward;
  std::string text;
  for (Eigen::Index k = 0; k < table.position.size(); ++k)
    text += fmt::format("$AN_CEC[{},{}]={}\n", index, k,
                        decimal(cross_sign * value[k] / unit, value_decimals));
  text +=
      fmt::format("$AN_CEC_INPUT_AXIS[{}]=({})\n", index, axis_name(chain, table.argument_joint));
  text +=
      fmt::format("$AN_CEC_OUTPUT_AXIS[{}]=({})\n", index, axis_name(chain, table.corrected_joint));
  text += fmt::format("$AN_CEC_STEP[{}]={}\n", index, decimal(grid.step, step_decimals));
  text += fmt::format("$AN_CEC_MIN[{}]={}\n", index, decimal(grid.min, value_decimals));
  text += fmt::format("$AN_CEC_MAX[{}]={}\n", index, decimal(grid.max, value_decimals));
  text += fmt::format("$AN_CEC_DIRECTION[{}]={}\n", index, direction);
  text += fmt::format("$AN_CEC_MULT_BY_TABLE[{}]=0\n", index);
  text += fmt::format("$AN_CEC_IS_MODULO[{}]=0\n", index);
  return text;
}

ControlFile program_file(const std::string& name, const std::string& body) {
  std::string program_name = name;
  std::replace(program_name.begin(), program_name.end(), '.', '_');
  return {name, "%_N_" + program_name + "\nCHANDATA(1)\n" + body + "M17\n"};
}

/// The assignments of a table read so far.
struct TableDraft {
  int line = 0;  // line of its first assignment
  std::vector<std::optional<double>> values;
  std::optional<double> step, min, max;
  std::optional<int> argument_joint, corrected_joint, direction, product, modulo;
};

/// The tables of one program.
struct Program {
  std::string file;
  std::map<int, TableDraft> encoder;  // by joint
  std::map<int, TableDraft> cross;    // by index
};

/// The cells of an assignment `$NAME[index, index]=value`.
struct Assignment {
  Cell name;
  std::vector<Cell> index;
  Cell value;
};

/// Reads one program, statement by statement.
class ProgramReader {
 public:
  ProgramReader(const ControlFile& file, const Chain& chain)
      : lines_(file.text, file.name, ';'), chain_(chain), program_{file.name, {}, {}} {}

  Program read() {
    bool has_ended = false;
    // A semicolon begins a comment.
    while (const auto line = lines_.next()) {
      const std::string_view text = line->text.substr(0, line->text.find(';'));
      const std::size_t start = text.find_first_not_of(" \t");
      if (start == std::string_view::npos) continue;
      const Cell statement = split_cells(text, '\n', 1).front();
      if (has_ended) lines_.refuse(statement, "nothing after M17");
      if (statement.text.front() == '$')
        store_assignment(parse_assignment(text, statement));
      else if (statement.text == "M17")
        has_ended = true;
      else if (statement.text.front() != '%' && !statement.text.starts_with("CHANDATA("))
        lines_.refuse(statement, "an assignment such as $AN_CEC[0,0]=0, CHANDATA(1) or M17");
    }
    if (!has_ended) lines_.refuse(0, "M17 at the end", "none");
    return std::move(program_);
  }

 private:
  /// Splits a statement into the name, the indices and the value, with their columns.
  Assignment parse_assignment(std::string_view text, const Cell& statement) const {
    const std::size_t open = text.find('['), close = text.find(']'), equals = text.find('=');
    if (open == std::string_view::npos || close == std::string_view::npos ||
        equals == std::string_view::npos || close < open || equals < close)
      lines_.refuse(statement, "an assignment such as $AN_CEC[0,0]=0");
    Assignment result;
    result.name = split_cells(text.substr(0, open), '\n', 1).front();
    result.index = split_cells(text.substr(open + 1, close - open - 1), ',', 4);
    for (Cell& cell : result.index) cell.column += int(open) + 1;
    const std::vector<Cell> middle_cells =
        split_cells(text.substr(close + 1, equals - close - 1), ' ', 1);
    if (!middle_cells.empty())
      lines_.refuse(int(close) + 1 + middle_cells.front().column, "= after the index",
                    quoted_excerpt(middle_cells.front().text));
    const std::string_view value_text = text.substr(equals + 1);
    result.value = value_text.empty() ? Cell{"", 1} : split_cells(value_text, '\n', 1).front();
    result.value.column += int(equals) + 1;
    return result;
  }

  void store_assignment(const Assignment& assignment) {
    constexpr std::string_view encoder = "$AA_ENC_COMP", cross = "$AN_CEC";
    if (assignment.name.text.starts_with(encoder))
      assign_encoder(assignment, assignment.name.text.substr(encoder.size()));
    else if (assignment.name.text.starts_with(cross))
      assign_cross(assignment, assignment.name.text.substr(cross.size()));
    else
      lines_.refuse(assignment.name, "$AA_ENC_COMP... or $AN_CEC...");
  }

  void check_index_count(const Assignment& assignment, std::size_t count) const {
    if (assignment.index.size() != count)
      lines_.refuse(
          assignment.index.empty() ? assignment.value.column - 2 : assignment.index.front().column,
          fmt::format("{} indices for {}", count, assignment.name.text),
          fmt::format("{}", assignment.index.size()));
  }

  /// Stores an assignment to $AA_ENC_COMP; `suffix` is the rest of its name.
  void assign_encoder(const Assignment& assignment, std::string_view suffix) {
    check_index_count(assignment, suffix.empty() ? 3 : 2);
    lines_.read_whole_number(assignment.index.front(), 0, 0);  // the first measuring system
    const int joint = parse_axis(assignment.index.back());
    TableDraft& draft = program_.encoder[joint];
    record_first_line(draft);
    draft.argument_joint = draft.corrected_joint = joint;
    if (suffix.empty())
      set_value(draft, assignment.index[1], assignment.value);
    else
      set_common(draft, assignment, suffix);
  }

  /// Stores an assignment to $AN_CEC; `suffix` is the rest of its name.
  void assign_cross(const Assignment& assignment, std::string_view suffix) {
    check_index_count(assignment, suffix.empty() ? 2 : 1);
    TableDraft& draft =
        program_.cross[lines_.read_whole_number(assignment.index.front(), 0, max_tables - 1)];
    record_first_line(draft);
    if (suffix.empty())
      set_value(draft, assignment.index[1], assignment.value);
    else if (suffix == "_INPUT_AXIS")
      set(draft.argument_joint, parse_axis(without_brackets(assignment.value)), assignment);
    else if (suffix == "_OUTPUT_AXIS")
      set(draft.corrected_joint, parse_axis(without_brackets(assignment.value)), assignment);
    else if (suffix == "_DIRECTION")
      set(draft.direction, lines_.read_whole_number(assignment.value, -1, 1), assignment);
    else if (suffix == "_MULT_BY_TABLE")
      set(draft.product, lines_.read_whole_number(assignment.value, 0, 0), assignment);
    else
      set_common(draft, assignment, suffix);
  }

  void record_first_line(TableDraft& draft) const {
    if (draft.line == 0) draft.line = lines_.number();
  }

  void set_common(TableDraft& draft, const Assignment& assignment, std::string_view suffix) const {
    if (suffix == "_STEP")
      set(draft.step, lines_.number_in(assignment.value), assignment);
    else if (suffix == "_MIN")
      set(draft.min, lines_.number_in(assignment.value), assignment);
    else if (suffix == "_MAX")
      set(draft.max, lines_.number_in(assignment.value), assignment);
    else if (suffix == "_IS_MODULO")
      set(draft.modulo, lines_.read_whole_number(assignment.value, 0, 0), assignment);
    else
      lines_.refuse(assignment.name, "a variable of a compensation table");
  }

  template <typename T>
  void set(std::optional<T>& target, T value, const Assignment& assignment) const {
    if (target) lines_.refuse(assignment.value, fmt::format("{} only once", assignment.name.text));
    target = value;
  }

  void set_value(TableDraft& draft, const Cell& index, const Cell& value) const {
    const auto k = std::size_t(lines_.read_whole_number(index, 0, max_rows - 1));
    if (draft.values.size() <= k) draft.values.resize(k + 1);
    if (draft.values[k]) lines_.refuse(index, "each point only once");
    draft.values[k] = lines_.number_in(value);
  }

  Cell without_brackets(const Cell& cell) const {
    if (cell.text.size() < 2 || cell.text.front() != '(' || cell.text.back() != ')')
      lines_.refuse(cell, "a machine axis such as (X1)");
    return {cell.text.substr(1, cell.text.size() - 2), cell.column + 1};
  }

  int parse_axis(const Cell& cell) const {
    const std::string_view text = cell.text;
    if (text.size() == 1 || (text.size() == 2 && text[1] == '1'))
      if (const auto joint = movable(text[0], chain_)) return *joint;
    lines_.refuse(cell, fmt::format("a machine axis such as X1 ({})", movable_letters(chain_)));
  }

  TableLineReader lines_;
  const Chain& chain_;
  Program program_;
};

/// Builds the tables of a program from its assignments.
class TableBuilder {
 public:
  TableBuilder(const Program& program, const Chain& chain) : program_(program), chain_(chain) {}

  std::vector<AxisTable> tables() const {
    std::vector<AxisTable> tables;
    for (const auto& [joint, draft] : program_.encoder)
      tables.push_back(build_table(draft, encoder_sign));
    std::vector<std::pair<int, AxisTable>> cross_tables;  // with their direction; 0: complete
    for (const auto& [index, draft] : program_.cross) {
      AxisTable table = build_table(draft, cross_sign);
      const int direction = draft.direction.value_or(0);
      if (direction > 0) table.downward.setZero();
      if (direction < 0) table.upward.setZero();
      const auto opposite =
          std::find_if(cross_tables.begin(), cross_tables.end(), [&](const auto& entry) {
            return entry.first * direction < 0 &&
                   entry.second.argument_joint == table.argument_joint &&
                   entry.second.corrected_joint == table.corrected_joint &&
                   entry.second.position == table.position;
          });
      // Two tables of opposite directions over the same points become one table with two columns.
      if (opposite == cross_tables.end()) {
        cross_tables.emplace_back(direction, std::move(table));
      } else {
        opposite->second.upward += table.upward;
        opposite->second.downward += table.downward;
        opposite->first = 0;
      }
    }
    for (auto& [direction, table] : cross_tables) tables.push_back(std::move(table));
    return tables;
  }

 private:
  [[noreturn]] void throw_input_error(const TableDraft& draft, const std::string& expected,
                                      const std::string& seen) const {
    throw BadInput(program_.file, draft.line, 1, expected, seen);
  }

  AxisTable build_table(const TableDraft& draft, double sign) const {
    if (!draft.argument_joint || !draft.corrected_joint)
      throw_input_error(draft, "a table with INPUT_AXIS and OUTPUT_AXIS", "a table without them");
    if (!draft.step || !draft.min || !draft.max)
      throw_input_error(draft, "a table with STEP, MIN and MAX", "a table without them");
    if (!(*draft.step > 0.0) || !(*draft.max > *draft.min))
      throw_input_error(draft, "STEP above 0 and MAX above MIN",
                        fmt::format("{} and {} to {}", *draft.step, *draft.min, *draft.max));
    const double step_count = (*draft.max - *draft.min) / *draft.step;
    // MIN, MAX and STEP imply the number of points, which must match the values.
    const double last_index = std::round(step_count);
    // 1e-4 of a step absorbs the rounding of the printed step.
    if (!(last_index >= 1.0) || last_index > max_rows - 1 ||
        std::abs(step_count - last_index) > 1e-4)
      throw_input_error(
          draft, fmt::format("an integer number of steps, 1 to {}, from MIN to MAX", max_rows - 1),
          fmt::format("{:.6g}", step_count));
    if (draft.values.size() != std::size_t(last_index) + 1)
      throw_input_error(draft,
                        fmt::format("points 0 to {}, as given by MIN, MAX and STEP", last_index),
                        fmt::format("0 to {}", int(draft.values.size()) - 1));
    return fill_table(draft, sign, Eigen::Index(last_index) + 1);
  }

  AxisTable fill_table(const TableDraft& draft, double sign, Eigen::Index n) const {
    AxisTable table{
        *draft.argument_joint, *draft.corrected_joint, Eigen::VectorXd(n), Eigen::VectorXd(n), {}};
    const double of_unit = unit_of(chain_, *draft.argument_joint),
                 unit = unit_of(chain_, *draft.corrected_joint);
    for (Eigen::Index k = 0; k < n; ++k) {
      const auto& value = draft.values[std::size_t(k)];
      if (!value) throw_input_error(draft, fmt::format("a value for point {}", k), "none");
      table.position[k] = (*draft.min + double(k) * *draft.step) * of_unit;
      table.upward[k] = sign * *value * unit;
      // The step may be below the rounding of the positions.
      if (k > 0 && !(table.position[k] > table.position[k - 1]))
        throw_input_error(draft, "a STEP with distinct points", fmt::format("{}", *draft.step));
    }
    table.downward = table.upward;
    return table;
  }

  const Program& program_;
  const Chain& chain_;
};

/// Throws BadInput if a program writes a table of an earlier program, which it would replace.
void check_new_tables(const Program& program, const std::vector<Program>& earlier_programs) {
  for (const Program& earlier : earlier_programs) {
    for (const auto& [joint, draft] : program.encoder)
      if (earlier.encoder.contains(joint))
        throw BadInput(program.file, draft.line, 1,
                       "a table that " + earlier.file + " does not write",
                       "a table that it writes");
    for (const auto& [index, draft] : program.cross)
      if (earlier.cross.contains(index))
        throw BadInput(program.file, draft.line, 1,
                       "a table that " + earlier.file + " does not write",
                       "a table that it writes");
  }
}

}  // namespace

ControlExport to_siemens(const ParameterTables& tables, const Chain& chain) {
  ControlExport result;
  result.omissions = offsets_left_out(tables, chain);
  std::string encoder, cross;
  int index = 0;
  for (const AxisTable& table : summed(tables.tables)) {
    const FittedTable fitted = fit_table(table, chain, {max_rows, 1e-6});
    if (fitted.omissions) result.omissions.push_back(*fitted.omissions);
    // Siemens tables state only their first position and step.
    const FittedTable even_fitted = equidistant(fitted.table, chain);
    if (even_fitted.omissions) result.omissions.push_back(*even_fitted.omissions);
    const bool is_symmetric = is_direction_independent(even_fitted.table);
    if (is_symmetric && table.argument_joint == table.corrected_joint) {
      // An encoder table has one value for both directions.
      encoder += encoder_table(even_fitted.table, chain);
      continue;
    }
    cross += cross_table(even_fitted.table, chain, index++, is_symmetric ? 0 : 1);
    if (!is_symmetric) cross += cross_table(even_fitted.table, chain, index++, -1);
  }
  if (!encoder.empty()) {
    result.files.push_back(program_file("AX_EEC.INI", encoder));
    result.notes.push_back(
        "AX_EEC.INI: MD32700 ENC_COMP_ENABLE must be 0 while the file is read and 1 for the table "
        "to act; MD38000 MM_ENC_COMP_MAX_POINTS must be at least the number of points of a table");
  }
  if (!cross.empty()) {
    result.files.push_back(program_file("NC_CEC.INI", cross));
    result.notes.push_back(
        "NC_CEC.INI: MD32710 CEC_ENABLE must be 0 while the file is read and 1 for the tables to "
        "act; MD18342 MM_CEC_MAX_POINTS must be at least the number of points of each table");
    result.notes.push_back(
        "assumed: a positive $AN_CEC is added to the set-point of the axis; try it "
        "on one axis first");
  }
  return result;
}

ParameterTables read_siemens_tables(std::span<const ControlFile> files, const Chain& chain) {
  ParameterTables tables;
  tables.offset = kinematics::AxisVector::Zero(chain.size());
  std::vector<Program> programs;
  for (const ControlFile& file : files) {
    Program program = ProgramReader(file, chain).read();
    check_new_tables(program, programs);
    for (AxisTable& table : TableBuilder(program, chain).tables())
      tables.tables.push_back(std::move(table));
    programs.push_back(std::move(program));
  }
  return tables;
}

}  // namespace abbe::sim::compensation::control
