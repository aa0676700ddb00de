#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "sim/compensation/control_file_formats.h"

namespace abbe::sim::compensation::control {
namespace {

using kinematics::Chain;

constexpr int most_rows = 5000;  // of a table; machine data set how many a control has room for
constexpr int max_tables = 200;
constexpr int value_decimals = 8;
constexpr int step_decimals = 12;  // the control adds the step up thousands of times

// A positive $AA_ENC_COMP is subtracted from the axis position, $AN_CEC is added to the set-point.
constexpr double encoder_sign = -1.0;
constexpr double cross_sign = 1.0;

std::string axis_name(const Chain& chain, int joint) {
  return std::string(1, chain.joints()[std::size_t(joint)].name) + "1";
}

struct EvenGrid {
  double min = 0.0;
  double max = 0.0;
  double step = 0.0;
};

/// Returns range and step in the units of the file. The step is such that the points end at the
/// printed end.
EvenGrid grid_of(const AxisTable& table, double unit) {
  const Eigen::Index last = table.position.size() - 1;
  const double digit = std::pow(10.0, value_decimals);
  EvenGrid grid{std::round(table.position[0] / unit * digit) / digit,
                std::round(table.position[last] / unit * digit) / digit, 0.0};
  grid.step = (grid.max - grid.min) / double(last);
  return grid;
}

std::string encoder_table(const AxisTable& table, const Chain& chain) {
  const double unit = unit_of(chain, table.of);
  const std::string name = axis_name(chain, table.of);
  const EvenGrid grid = grid_of(table, unit);
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

/// Returns a cross table of one direction.
/// @param direction  0 both, 1 up, -1 down
std::string cross_table(const AxisTable& table, const Chain& chain, int index, int direction) {
  const double unit = unit_of(chain, table.moves);
  const EvenGrid grid = grid_of(table, unit_of(chain, table.of));
  const Eigen::VectorXd& value = direction < 0 ? table.downward : table.upward;
  std::string text;
  for (Eigen::Index k = 0; k < table.position.size(); ++k)
    text += fmt::format("$AN_CEC[{},{}]={}\n", index, k,
                        decimal(cross_sign * value[k] / unit, value_decimals));
  text += fmt::format("$AN_CEC_INPUT_AXIS[{}]=({})\n", index, axis_name(chain, table.of));
  text += fmt::format("$AN_CEC_OUTPUT_AXIS[{}]=({})\n", index, axis_name(chain, table.moves));
  text += fmt::format("$AN_CEC_STEP[{}]={}\n", index, decimal(grid.step, step_decimals));
  text += fmt::format("$AN_CEC_MIN[{}]={}\n", index, decimal(grid.min, value_decimals));
  text += fmt::format("$AN_CEC_MAX[{}]={}\n", index, decimal(grid.max, value_decimals));
  text += fmt::format("$AN_CEC_DIRECTION[{}]={}\n", index, direction);
  text += fmt::format("$AN_CEC_MULT_BY_TABLE[{}]=0\n", index);
  text += fmt::format("$AN_CEC_IS_MODULO[{}]=0\n", index);
  return text;
}

ControlFile program(const std::string& name, const std::string& body) {
  std::string head = name;
  std::replace(head.begin(), head.end(), '.', '_');
  return {name, "%_N_" + head + "\nCHANDATA(1)\n" + body + "M17\n"};
}

/// A table while it is read.
struct Draft {
  int line = 0;  // line that first names it
  std::vector<std::optional<double>> values;
  std::optional<double> step, min, max;
  std::optional<int> of, moves, direction, product, modulo;
};

/// The tables of one program.
struct Program {
  std::string file;
  std::map<int, Draft> encoder;  // by joint
  std::map<int, Draft> cross;    // by index
};

/// An assignment `$NAME[index, index]=value`, in cells.
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
    bool ended = false;
    // a semicolon begins a comment
    while (const auto line = lines_.next()) {
      const std::string_view text = line->text.substr(0, line->text.find(';'));
      const std::size_t start = text.find_first_not_of(" \t");
      if (start == std::string_view::npos) continue;
      const Cell whole = cells_of(text, '\n', 1).front();
      if (ended) lines_.refuse(whole, "nothing after M17");
      if (whole.text.front() == '$')
        assign(assignment(text, whole));
      else if (whole.text == "M17")
        ended = true;
      else if (whole.text.front() != '%' && !whole.text.starts_with("CHANDATA("))
        lines_.refuse(whole, "an assignment such as $AN_CEC[0,0]=0, CHANDATA(1) or M17");
    }
    if (!ended) lines_.refuse(0, "M17 at the end", "none");
    return std::move(program_);
  }

 private:
  Assignment assignment(std::string_view text, const Cell& whole) const {
    const std::size_t open = text.find('['), close = text.find(']'), equals = text.find('=');
    if (open == std::string_view::npos || close == std::string_view::npos ||
        equals == std::string_view::npos || close < open || equals < close)
      lines_.refuse(whole, "an assignment such as $AN_CEC[0,0]=0");
    Assignment out;
    out.name = cells_of(text.substr(0, open), '\n', 1).front();
    out.index = cells_of(text.substr(open + 1, close - open - 1), ',', 4);
    for (Cell& cell : out.index) cell.column += int(open) + 1;
    const std::vector<Cell> between = cells_of(text.substr(close + 1, equals - close - 1), ' ', 1);
    if (!between.empty())
      lines_.refuse(int(close) + 1 + between.front().column, "= after the index",
                    in_quotes(between.front().text));
    const std::string_view rest = text.substr(equals + 1);
    out.value = rest.empty() ? Cell{"", 1} : cells_of(rest, '\n', 1).front();
    out.value.column += int(equals) + 1;
    return out;
  }

  void assign(const Assignment& a) {
    constexpr std::string_view encoder = "$AA_ENC_COMP", cross = "$AN_CEC";
    if (a.name.text.starts_with(encoder))
      assign_encoder(a, a.name.text.substr(encoder.size()));
    else if (a.name.text.starts_with(cross))
      assign_cross(a, a.name.text.substr(cross.size()));
    else
      lines_.refuse(a.name, "$AA_ENC_COMP... or $AN_CEC...");
  }

  void expect_indices(const Assignment& a, std::size_t count) const {
    if (a.index.size() != count)
      lines_.refuse(a.index.empty() ? a.value.column - 2 : a.index.front().column,
                    fmt::format("{} indices of {}", count, a.name.text),
                    fmt::format("{}", a.index.size()));
  }

  void assign_encoder(const Assignment& a, std::string_view what) {
    expect_indices(a, what.empty() ? 3 : 2);
    lines_.whole_number_in(a.index.front(), 0, 0);  // the first measuring system
    const int joint = axis_in(a.index.back());
    Draft& draft = program_.encoder[joint];
    begin(draft);
    draft.of = draft.moves = joint;
    if (what.empty())
      set_value(draft, a.index[1], a.value);
    else
      set_common(draft, a, what);
  }

  void assign_cross(const Assignment& a, std::string_view what) {
    expect_indices(a, what.empty() ? 2 : 1);
    Draft& draft = program_.cross[lines_.whole_number_in(a.index.front(), 0, max_tables - 1)];
    begin(draft);
    if (what.empty())
      set_value(draft, a.index[1], a.value);
    else if (what == "_INPUT_AXIS")
      set(draft.of, axis_in(bracketed(a.value)), a);
    else if (what == "_OUTPUT_AXIS")
      set(draft.moves, axis_in(bracketed(a.value)), a);
    else if (what == "_DIRECTION")
      set(draft.direction, lines_.whole_number_in(a.value, -1, 1), a);
    else if (what == "_MULT_BY_TABLE")
      set(draft.product, lines_.whole_number_in(a.value, 0, 0), a);
    else
      set_common(draft, a, what);
  }

  void begin(Draft& draft) const {
    if (draft.line == 0) draft.line = lines_.number();
  }

  void set_common(Draft& draft, const Assignment& a, std::string_view what) const {
    if (what == "_STEP")
      set(draft.step, lines_.number_in(a.value), a);
    else if (what == "_MIN")
      set(draft.min, lines_.number_in(a.value), a);
    else if (what == "_MAX")
      set(draft.max, lines_.number_in(a.value), a);
    else if (what == "_IS_MODULO")
      set(draft.modulo, lines_.whole_number_in(a.value, 0, 0), a);
    else
      lines_.refuse(a.name, "a variable of a compensation table");
  }

  template <typename T>
  void set(std::optional<T>& target, T value, const Assignment& a) const {
    if (target) lines_.refuse(a.value, fmt::format("{} once", a.name.text));
    target = value;
  }

  void set_value(Draft& draft, const Cell& index, const Cell& value) const {
    const auto k = std::size_t(lines_.whole_number_in(index, 0, most_rows - 1));
    if (draft.values.size() <= k) draft.values.resize(k + 1);
    if (draft.values[k]) lines_.refuse(index, "every point once");
    draft.values[k] = lines_.number_in(value);
  }

  Cell bracketed(const Cell& cell) const {
    if (cell.text.size() < 2 || cell.text.front() != '(' || cell.text.back() != ')')
      lines_.refuse(cell, "a machine axis such as (X1)");
    return {cell.text.substr(1, cell.text.size() - 2), cell.column + 1};
  }

  int axis_in(const Cell& cell) const {
    const std::string_view text = cell.text;
    if (text.size() == 1 || (text.size() == 2 && text[1] == '1'))
      if (const auto joint = movable(text[0], chain_)) return *joint;
    lines_.refuse(cell, fmt::format("a machine axis such as X1 ({})", movable_letters(chain_)));
  }

  TableLines lines_;
  const Chain& chain_;
  Program program_;
};

/// Makes tables of the assignments of a program.
class Finisher {
 public:
  Finisher(const Program& program, const Chain& chain) : program_(program), chain_(chain) {}

  std::vector<AxisTable> tables() const {
    std::vector<AxisTable> tables;
    for (const auto& [joint, draft] : program_.encoder)
      tables.push_back(table_of(draft, encoder_sign));
    std::vector<std::pair<int, AxisTable>> halves;  // direction, and a table that may still find
                                                    // its other direction
    for (const auto& [index, draft] : program_.cross) {
      AxisTable table = table_of(draft, cross_sign);
      const int direction = draft.direction.value_or(0);
      if (direction > 0) table.downward.setZero();
      if (direction < 0) table.upward.setZero();
      const auto other = std::find_if(halves.begin(), halves.end(), [&](const auto& half) {
        return half.first * direction < 0 && half.second.of == table.of &&
               half.second.moves == table.moves && half.second.position == table.position;
      });
      // a pair of opposite directions over the same points is one table with two columns
      if (other == halves.end()) {
        halves.emplace_back(direction, std::move(table));
      } else {
        other->second.upward += table.upward;
        other->second.downward += table.downward;
        other->first = 0;
      }
    }
    for (auto& [direction, table] : halves) tables.push_back(std::move(table));
    return tables;
  }

 private:
  [[noreturn]] void refuse(const Draft& draft, const std::string& expected,
                           const std::string& seen) const {
    throw BadInput(program_.file, draft.line, 1, expected, seen);
  }

  AxisTable table_of(const Draft& draft, double sign) const {
    if (!draft.of || !draft.moves)
      refuse(draft, "a table with INPUT_AXIS and OUTPUT_AXIS", "one without");
    if (!draft.step || !draft.min || !draft.max)
      refuse(draft, "a table with STEP, MIN and MAX", "one without");
    if (!(*draft.step > 0.0) || !(*draft.max > *draft.min))
      refuse(draft, "STEP above 0 and MAX above MIN",
             fmt::format("{} and {} to {}", *draft.step, *draft.min, *draft.max));
    const double steps = (*draft.max - *draft.min) / *draft.step;
    // MIN, MAX and STEP state the number of points a second time
    const double last = std::round(steps);
    // 1e-4 of a step: the printed step is rounded
    if (!(last >= 1.0) || last > most_rows - 1 || std::abs(steps - last) > 1e-4)
      refuse(draft, fmt::format("1 to {} whole steps from MIN to MAX", most_rows - 1),
             fmt::format("{:.6g}", steps));
    if (draft.values.size() != std::size_t(last) + 1)
      refuse(draft, fmt::format("points 0 to {}, as MIN, MAX and STEP say", last),
             fmt::format("0 to {}", int(draft.values.size()) - 1));
    return filled(draft, sign, Eigen::Index(last) + 1);
  }

  AxisTable filled(const Draft& draft, double sign, Eigen::Index n) const {
    AxisTable table{*draft.of, *draft.moves, Eigen::VectorXd(n), Eigen::VectorXd(n), {}};
    const double of_unit = unit_of(chain_, *draft.of), unit = unit_of(chain_, *draft.moves);
    for (Eigen::Index k = 0; k < n; ++k) {
      const auto& value = draft.values[std::size_t(k)];
      if (!value) refuse(draft, fmt::format("a value of point {}", k), "none");
      table.position[k] = (*draft.min + double(k) * *draft.step) * of_unit;
      table.upward[k] = sign * *value * unit;
      // a step below the rounding of the positions
      if (k > 0 && !(table.position[k] > table.position[k - 1]))
        refuse(draft, "a STEP that keeps its points apart", fmt::format("{}", *draft.step));
    }
    table.downward = table.upward;
    return table;
  }

  const Program& program_;
  const Chain& chain_;
};

/// Throws BadInput if a program writes a table again, which would replace the first.
void expect_new(const Program& program, const std::vector<Program>& before) {
  for (const Program& other : before) {
    for (const auto& [joint, draft] : program.encoder)
      if (other.encoder.contains(joint))
        throw BadInput(program.file, draft.line, 1, "a table that " + other.file + " leaves free",
                       "one that it writes");
    for (const auto& [index, draft] : program.cross)
      if (other.cross.contains(index))
        throw BadInput(program.file, draft.line, 1, "a table that " + other.file + " leaves free",
                       "one that it writes");
  }
}

}  // namespace

Export to_siemens(const ParameterTables& tables, const Chain& chain) {
  Export out;
  out.left_out = offsets_left_out(tables, chain);
  std::string encoder, cross;
  int index = 0;
  for (const AxisTable& sum : summed(tables.tables)) {
    const FittedTable fitting = fit_table(sum, chain, {most_rows, 1e-6});
    if (fitting.left_out) out.left_out.push_back(*fitting.left_out);
    // Siemens tables state only their first position and step.
    const FittedTable even = equidistant(fitting.table, chain);
    if (even.left_out) out.left_out.push_back(*even.left_out);
    const bool both = is_direction_independent(even.table);
    if (both && sum.of == sum.moves) {
      // an encoder table has one value for both directions
      encoder += encoder_table(even.table, chain);
      continue;
    }
    cross += cross_table(even.table, chain, index++, both ? 0 : 1);
    if (!both) cross += cross_table(even.table, chain, index++, -1);
  }
  if (!encoder.empty()) {
    out.files.push_back(program("AX_EEC.INI", encoder));
    out.notes.push_back(
        "AX_EEC.INI: MD32700 ENC_COMP_ENABLE must be 0 while it is read and 1 to "
        "act; MD38000 MM_ENC_COMP_MAX_POINTS at least the points of a table");
  }
  if (!cross.empty()) {
    out.files.push_back(program("NC_CEC.INI", cross));
    out.notes.push_back(
        "NC_CEC.INI: MD32710 CEC_ENABLE must be 0 while it is read and 1 to act; "
        "MD18342 MM_CEC_MAX_POINTS at least the points of each table");
    out.notes.push_back(
        "assumed: a positive $AN_CEC is added to the set-point of the axis; try it "
        "on one axis first");
  }
  return out;
}

ParameterTables read_siemens_tables(std::span<const ControlFile> files, const Chain& chain) {
  ParameterTables tables;
  tables.offset = kinematics::AxisVector::Zero(chain.size());
  std::vector<Program> programs;
  for (const ControlFile& file : files) {
    Program program = ProgramReader(file, chain).read();
    expect_new(program, programs);
    for (AxisTable& table : Finisher(program, chain).tables())
      tables.tables.push_back(std::move(table));
    programs.push_back(std::move(program));
  }
  return tables;
}

}  // namespace abbe::sim::compensation::control
