#include "sim/dialects/cl_table.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/dialects/cl_machine.h"
#include "sim/dialects/cursor.h"

namespace abbe::sim::dialects::cl {
namespace {

constexpr std::size_t n_columns = 7;
constexpr std::size_t most_cells = 100;

// The names that a head may give to x y z i j k and the feed.
constexpr std::array<std::array<std::string_view, 4>, n_columns> names = {{
    {"X", "X_MM", "", ""},
    {"Y", "Y_MM", "", ""},
    {"Z", "Z_MM", "", ""},
    {"I", "TX", "", ""},
    {"J", "TY", "", ""},
    {"K", "TZ", "", ""},
    {"FEED", "F", "FEED_MM_PER_MIN", "FEEDRATE"},
}};

/// A line without its comment and the blanks around.
bool says_something(std::string_view line) {
  const std::size_t at = line.find_first_not_of(" \t,;");
  return at != std::string_view::npos && line[at] != '#';
}

bool is(std::string_view cell, std::string_view word) {
  return !word.empty() && cell.size() == word.size() &&
         std::equal(cell.begin(), cell.end(), word.begin(),
                    [](char a, char b) { return upper(a) == b; });
}

/// Where each of x y z i j k feed stands in a row.
using Columns = std::array<std::optional<std::size_t>, n_columns>;

Item item_of(const Cell& cell, int line) {
  return {cell.text, number_of(cell.text), line, cell.column};
}

/// The columns that a head names, or those of a row of numbers.
class Table {
 public:
  explicit Table(ProgramRun& run) : run_(run), machine_(run) { machine_.count_in_mm(); }

  void row(std::string_view line, int number);
  void finish() { machine_.finish(); }

 private:
  void read_head(const std::vector<Cell>& cells);
  void take_order(const std::vector<Cell>& cells);
  double number(const std::vector<Cell>& cells, std::size_t which) const;
  void read_feed(const Cell& cell);
  [[noreturn]] void refuse(const Cell& cell, const std::string& expected) const {
    run_.canon.refuse({cell.column, cell.text}, expected, in_quotes(cell.text));
  }

  ProgramRun& run_;
  Machine machine_;
  std::optional<Columns> columns_;
  std::size_t width_ = 0;
  bool arrived_ = false, head_refused_ = false;
};

void Table::read_head(const std::vector<Cell>& cells) {
  Columns columns;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const auto named = std::find_if(names.begin(), names.end(), [&](const auto& some) {
      return std::any_of(some.begin(), some.end(),
                         [&](std::string_view one) { return is(cells[c].text, one); });
    });
    if (named == names.end()) {
      run_.unknown({cells[c].column, cells[c].text}, "a column x, y, z, i, j, k or feed");
      continue;
    }
    auto& column = columns[std::size_t(named - names.begin())];
    if (column) refuse(cells[c], "each column once");
    column = c;
  }
  for (std::size_t i = 0; i < 3; ++i)
    if (!columns[i]) run_.canon.refuse({1, {}}, fmt::format("a column {}", names[i][0]), "none");
  const int vectors =
      int(columns[3].has_value()) + int(columns[4].has_value()) + int(columns[5].has_value());
  if (vectors != 0 && vectors != 3)
    run_.canon.refuse({1, {}}, "columns i, j and k together", "some of them");
  columns_ = columns;
}

void Table::take_order(const std::vector<Cell>& cells) {
  Columns columns;
  const std::size_t n = cells.size();
  if (n != 3 && n != 4 && n != 6 && n != 7)
    run_.canon.refuse({1, {}}, "a head, or 3, 4, 6 or 7 columns: x y z, feed, i j k",
                      fmt::format("{} columns", n));
  for (std::size_t i = 0; i < n; ++i) columns[n == 4 && i == 3 ? 6 : i] = i;
  columns_ = columns;
}

double Table::number(const std::vector<Cell>& cells, std::size_t which) const {
  const Cell& cell = cells[*(*columns_)[which]];
  const auto value = number_of(cell.text);
  if (!value) refuse(cell, "a number within +-1e9, with a decimal point");
  return *value;
}

void Table::read_feed(const Cell& cell) {
  if (cell.text.empty()) return;
  if (is(cell.text, "RAPID")) return machine_.rapid_next();
  const auto value = number_of(cell.text);
  if (!value || !(*value > 0)) refuse(cell, "a feed above zero in mm/min, or rapid");
  machine_.set_feed({*value, 1.0});
}

void Table::row(std::string_view line, int number_of_line) {
  const std::vector<Cell> cells = cells_of(line, separator_of(line), most_cells);
  if (cells.size() > most_cells) run_.canon.refuse({1, {}}, "at most 100 columns", "more");
  if (head_refused_) return;  // what its rows mean is not known
  if (!columns_) {
    width_ = cells.size();
    if (!number_of(cells.front().text)) {
      head_refused_ = true;
      read_head(cells);
      head_refused_ = false;
      return;
    }
    take_order(cells);
  }
  if (cells.size() != width_)
    run_.canon.refuse({1, {}}, fmt::format("{} columns, as in the first row", width_),
                      fmt::format("{}", cells.size()));
  Location to{{number(cells, 0), number(cells, 1), number(cells, 2)}, machine_.direction()};
  if (const auto i = (*columns_)[3])
    to.direction = machine_.direction_of(item_of(cells[*i], number_of_line),
                                         {number(cells, 3), number(cells, 4), number(cells, 5)});
  if (!arrived_) machine_.rapid_next();
  if (const auto feed = (*columns_)[6]) read_feed(cells[*feed]);
  const Cell& first = cells[*(*columns_)[0]];
  machine_.go_to(to, {first.column, first.text}, true);
  arrived_ = true;
}

}  // namespace

bool is_table(std::string_view text) {
  Lines lines(text);
  while (const auto line = lines.next()) {
    if (!says_something(*line)) continue;
    const std::vector<Cell> cells = cells_of(*line, separator_of(*line), n_columns);
    return !cells.empty() &&
           (number_of(cells.front().text) ||
            (cells.size() > 1 && std::any_of(cells.begin(), cells.end(), [](const Cell& cell) {
               return is(cell.text, "X") || is(cell.text, "X_MM");
             })));
  }
  return false;
}

void read_table(std::string_view text, ProgramRun& run) {
  Table table(run);
  Lines lines(text);
  while (const auto line = lines.next()) {
    if (run.hopeless()) return;
    if (!says_something(*line)) continue;
    run.canon.stand_at(lines.number());
    run.attempt([&] {
      run.count_block();
      table.row(*line, lines.number());
    });
  }
  table.finish();
}

}  // namespace abbe::sim::dialects::cl
