#include "sim/dialects/cl/machine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/cursor.h"

namespace abbe::sim::dialects::cl {

using program::CutterData;
using program::Feed;
using program::FeedMode;

namespace {

// Both limits bound the memory of a statement that is continued without end.
constexpr std::size_t max_items = 1000;
constexpr std::size_t most_lines = 200;  // of one statement
// Statements whose items are text up to the end of the line, including any $.
constexpr std::array<std::string_view, 9> text_words = {
    "PARTNO", "PPRINT", "REMARK", "INSERT", "TITLES", "LETTER", "PRINT", "TPRINT", "TOOL"};

bool is_word_byte(char c) { return is_letter(c) || is_digit(c) || c == '-' || c == '_'; }

/// Returns the position behind the blanks from `at` on.
std::size_t skip_blanks_from(std::string_view text, std::size_t at) {
  while (at < text.size() && is_blank(text[at])) ++at;
  return at;
}

/// Reads the first word of a line into the statement. Returns the position behind it.
std::size_t take_major(std::string_view line, std::size_t at, Statement& statement) {
  const std::size_t from = at;
  statement.major.clear();
  if (at < line.size() && is_letter(line[at]))
    for (; at < line.size() && is_word_byte(line[at]); ++at) statement.major += upper(line[at]);
  statement.cause = {int(from) + 1, line.substr(from, at - from)};
  // Without a word the rest of the line is the cause, for the message.
  if (statement.major.empty()) statement.cause.text = line.substr(from);
  return at;
}

bool takes_text(const std::string& major) {
  return std::find(text_words.begin(), text_words.end(), major) != text_words.end();
}

/// Removes the comment of a line. Returns true if the statement continues on the next line: one $
/// continues, $$ begins a comment.
bool cut_comment(std::string_view& line) {
  const std::size_t dollar = line.find('$');
  if (dollar == std::string_view::npos) return false;
  const bool goes_on = dollar + 1 >= line.size() || line[dollar + 1] != '$';
  line = line.substr(0, dollar);
  return goes_on;
}

/// Returns the position behind "$$->" or "$$ ->", or npos.
std::size_t skip_arrow(std::string_view line, std::size_t at) {
  if (line.substr(at, 2) != "$$") return std::string_view::npos;
  at = skip_blanks_from(line, at + 2);
  return line.substr(at, 2) == "->" ? skip_blanks_from(line, at + 2) : std::string_view::npos;
}

}  // namespace

bool Item::is(std::string_view word) const {
  return text.size() == word.size() && std::equal(text.begin(), text.end(), word.begin(),
                                                  [](char a, char b) { return upper(a) == b; });
}

bool Statements::next(Statement& statement) {
  statement.items.clear();
  statement.pieces.clear();
  while (const auto whole = lines_.next()) {
    std::string_view line = *whole;
    std::size_t at = skip_blanks_from(line, 0);
    if (at == line.size()) continue;
    const std::size_t arrow = skip_arrow(line, at);
    statement.in_comment = arrow != std::string_view::npos;
    if (statement.in_comment) {
      at = arrow;
    } else if (line.substr(at, 2) == "$$") {
      continue;
    }
    statement.line = lines_.number();
    at = take_major(line, at, statement);
    if (takes_text(statement.major)) {
      statement.pieces.push_back({line, lines_.number(), at});
      return true;
    }
    bool goes_on = false;
    if (statement.in_comment && at >= line.size()) return true;
    std::string_view rest = line.substr(at);
    goes_on = cut_comment(rest);
    line = line.substr(0, at + rest.size());
    at = skip_blanks_from(line, at);
    // The slash may be missing, as in "GOTO 1,2,3".
    if (at < line.size() && line[at] == '/') ++at;
    statement.pieces.push_back({line, lines_.number(), at});
    while (goes_on) {
      auto more = lines_.next();
      if (!more) break;
      goes_on = cut_comment(*more);
      // Lines beyond the limit are read on but not stored; `read_items` reports them.
      if (statement.pieces.size() <= most_lines)
        statement.pieces.push_back({*more, lines_.number(), 0});
    }
    if (statement.major.empty() && statement.cause.text.starts_with('$')) continue;
    return true;
  }
  return false;
}

void read_items(Statement& statement, const program::Canon& canon) {
  if (statement.pieces.size() > most_lines)
    canon.refuse(statement.cause, "a statement of at most 200 lines", "more");
  bool separated = true;  // a comma, or no item yet
  bool comma = false;
  Item last;
  for (const Statement::Piece& piece : statement.pieces)
    for (std::size_t at = skip_blanks_from(piece.text, piece.from); at < piece.text.size();
         at = skip_blanks_from(piece.text, at)) {
      Item item{{}, {}, piece.line, int(at) + 1};
      if (piece.text[at] == ',') {
        item.text = piece.text.substr(at, 1);
        // Blanks separate items as commas do, but an empty item between commas is an error.
        if (separated) refuse(canon, item, "a value between the commas");
        separated = comma = true;
        last = item;
        ++at;
        continue;
      }
      const std::size_t end = std::min(piece.text.find_first_of(" \t,", at), piece.text.size());
      item.text = piece.text.substr(at, end - at);
      item.number = number_of(item.text);
      if (statement.items.size() == max_items)
        refuse(canon, item, "at most 1000 values in a statement");
      statement.items.push_back(item);
      separated = comma = false;
      at = end;
    }
  if (comma) refuse(canon, last, "a value behind the last comma", "none");
}

// The item may be on another line than the statement.
void refuse(const program::Canon& canon, const Item& item, std::string expected,
            std::optional<std::string> seen) {
  program::refuse({canon.place().file, item.line}, item.cause(), std::move(expected),
                  std::move(seen));
}

namespace {

constexpr double smallest_feed = 1e-9;  // per minute; keeps every duration finite

/// Text of a statement without blanks and comments, to compare two of them.
std::string text_of(const Statement& s) {
  std::string text;
  for (const Item& item : s.items) text += std::string(item.text) + ",";
  return text;
}

}  // namespace

double Machine::unit() const { return inch_ ? units::inch : 1.0; }

double Machine::number(const Statement& s, std::size_t i, const char* what) const {
  if (i >= s.items.size())
    refuse(s.cause, fmt::format("{} behind {}", what, s.major), "too few values");
  if (!s.items[i].number) refuse(s.items[i], fmt::format("{}, a number within +-1e9", what));
  return *s.items[i].number;
}

Eigen::Vector3d Machine::vector(const Statement& s, std::size_t i, const char* what) const {
  return {number(s, i, what), number(s, i + 1, what), number(s, i + 2, what)};
}

int Machine::whole(const Item& item, int most, const char* what) const {
  const double value = item.number.value_or(-1.0);
  if (!(value >= 0 && value <= most) || value != std::floor(value))
    refuse(item, fmt::format("{}, a whole number of 0 to {}", what, most));
  return int(value);
}

/// Handles a minor word that the statement does not have.
void Machine::unknown(const Statement& s, const Item& item, const std::string& expected) {
  const std::string word = s.major + "/" + std::string(item.text);
  // The word may be on a continuation line, which the count of unknown words should name.
  if (item.line != canon_.line()) canon_.set_line(item.line);
  run_.handle_unknown_word({item.column, word}, expected);
  canon_.set_line(s.line);
}

void Machine::execute(Statement& s) {
  canon_.set_line(s.line);
  // Creo writes the cutter behind "$$->"; everything else there is a comment.
  if (s.in_comment && s.major != "CUTTER") return;
  if (s.major.empty()) refuse(s.cause, "a word at the beginning of the statement");
  const WordEntry* fact = find_entry(s.major);
  if (fact == nullptr) {
    const auto& first = s.pieces.front();
    // A definition such as "L1 = LINE/..." is APT source that has not been processed.
    if (first.text.find('=', first.from) != std::string_view::npos)
      refuse(s.cause, "posted statements: an APT source with definitions is processed first",
             "a definition");
    run_.handle_unknown_word(s.cause, "a word of cutter locations");
    return;
  }
  if (fact->use == Use::Refused) refuse(s.cause, std::string(fact->sentence));
  if (fact->does == nullptr) return;
  read_items(s, canon_);
  (this->*fact->does)(s);
}

void Machine::fini(const Statement&) { ended_ = true; }

void Machine::units(const Statement& s) {
  if (s.items.size() != 1) refuse(s.cause, "MM or INCHES behind UNITS/");
  const Item& item = s.items.front();
  if (item.is("INCHES") || item.is("INCH") || item.is("IN"))
    inch_ = true;
  else if (item.is("MM"))
    inch_ = false;
  else
    refuse(item, "MM or INCHES");
  units_stated_ = true;
  // Also recorded for rewriting and for comments.
  canon_.set_inch(inch_);
}

void Machine::multax(const Statement& s) {
  if (s.items.empty() || s.items.front().is("ON")) {
    upright_ = false;
  } else if (s.items.front().is("OFF")) {
    upright_ = true;
    direction_ = Eigen::Vector3d::UnitZ();
  } else {
    refuse(s.items.front(), "ON or OFF");
  }
}

void Machine::rapid(const Statement& s) {
  for (const Item& item : s.items) refuse(item, "nothing behind RAPID");
  rapid_ = true;
}

/// Reads the feed in both orders, FEDRAT/250,MMPM and FEDRAT/MMPM,250.
void Machine::feedrate(const Statement& s) {
  std::optional<double> value;
  FeedMode mode = FeedMode::PerMinute;
  // Without IPM or MMPM the feed is in the unit of the program.
  double mm = unit();
  for (const Item& item : s.items) {
    if (item.number) {
      if (value) refuse(item, "one feed");
      if (!(*item.number >= smallest_feed)) refuse(item, "a feed above zero");
      value = item.number;
    } else if (item.is("MMPM") || item.is("MMPR")) {
      mm = 1.0;
      if (item.is("MMPR")) mode = FeedMode::PerRevolution;
    } else if (item.is("IPM") || item.is("IPR")) {
      mm = units::inch;
      inches_seen_ = true;
      if (item.is("IPR")) mode = FeedMode::PerRevolution;
    } else if (item.is("PERREV")) {
      mode = FeedMode::PerRevolution;
    } else if (item.is("INVERS")) {
      mode = FeedMode::InverseTime;
    } else if (!item.is("PERMIN")) {
      unknown(s, item, "MMPM, MMPR, IPM, IPR, PERMIN, PERREV or INVERS");
    }
  }
  if (!value) refuse(s.cause, "a feed behind FEDRAT/", "none");
  canon_.set_feed_mode(mode);
  canon_.set_feed(Feed{*value, mm});
}

/// Reads a dwell in seconds, or in spindle turns with REV.
void Machine::delay(const Statement& s) {
  double seconds = number(s, 0, "the seconds of a dwell");
  if (s.items.size() > 1) {
    if (!s.items[1].is("REV")) return unknown(s, s.items[1], "REV, or nothing for seconds");
    if (canon_.spindle_direction() == 0 || !(canon_.spindle_speed() > 0))
      refuse(s.items[1], "a spindle that turns beside REV", "one that stands");
    seconds *= 60.0 / canon_.spindle_speed();
  }
  canon_.dwell(seconds, s.items.front().cause());
}

void Machine::stop(const Statement& s) { canon_.aside(s.major == "STOP" ? "M0" : "M1"); }

/// Points count from the system in which the program was made. The position of a second system
/// relative to the first one is not stated anywhere.
void Machine::msys(const Statement& s) {
  const std::string text = text_of(s);
  if (system_ && *system_ != text)
    refuse(s.cause, "one MSYS for the whole program: nothing says how the part lies in a second");
  system_ = text;
}

void Machine::origin(const Statement& s) {
  for (const Item& item : s.items)
    if (item.number.value_or(1.0) != 0.0)
      refuse(item, "0,0,0: a work offset says where the points count from");
}

/// Accepts statements of which only OFF has no consequences.
void Machine::require_off(const Statement& s) {
  if (s.items.size() == 1 && s.items.front().is("OFF")) return;
  refuse(s.cause, s.major == "CUTCOM"
                      ? "CUTCOM/OFF, the points being those of the tip: paths that a control "
                        "shifts by a radius are not read"
                      : s.major + "/OFF, as nothing may be left out");
}

void Machine::auxiliary(const Statement& s) {
  run_.warn_once(
      fmt::format("AUXFUN/ (line {}) is an M code of the control: it does nothing here", s.line));
}

void Machine::finish() {
  if (!units_stated_ && canon_.blocks() > 0)
    // A feed in inches suggests that the points are inches too, so it gets a warning of its own.
    run_.warn_once(inches_seen_ ? "the program states no UNITS/, and IPM or IPR as its feed: its "
                                  "points are taken as mm all the same"
                                : "the program states no UNITS/: its points are taken as mm");
  vector_lines_.finish();
  // The threshold keeps the warning silent for deviations that no tool makes visible: 2 um at 20 mm
  // above the tip.
  if (axis_deviation_.angle > min_bulge)
    run_.warn_once(fmt::format(
        "between two points the tool axis leaves the great circle of their vectors by up to {:.3g} "
        "deg (line {}), as the rotary axes turn in proportion: nearer points make it less",
        axis_deviation_.angle / units::deg, axis_deviation_.line));
}

namespace {

constexpr int max_tool = 1'000'000;
constexpr double most_rpm = 1e7;

/// Words beside a tool number that have no effect: the point is the tip whatever the length.
constexpr std::array<std::string_view, 13> beside_tools = {
    "LENGTH", "OSETNO", "ADJUST", "RADIUS", "MANUAL", "AUTO",  "HOLDER",
    "MINUS",  "PLUS",   "LARGE",  "SMALL",  "CLW",    "MAGAZN"};

template <typename List>
bool is_one_of(const Item& item, const List& list) {
  return std::any_of(list.begin(), list.end(),
                     [&](std::string_view word) { return item.is(word); });
}

}  // namespace

/// Example: LOADTL/n,LENGTH,l,OSETNO,k.
void Machine::load_tool(const Statement& s) {
  if (s.items.empty()) refuse(s.cause, "the number of a tool behind LOADTL/", "none");
  const int tool = whole(s.items.front(), max_tool, "the number of a tool");
  for (std::size_t i = 1; i < s.items.size(); ++i)
    if (!s.items[i].number && !is_one_of(s.items[i], beside_tools))
      unknown(s, s.items[i], "LENGTH, OSETNO, ADJUST, RADIUS, MANUAL, AUTO or HOLDER");
  canon_.call_tool(tool, true);
  canon_.aside(fmt::format("T{} M6", tool));
  const auto& lengths = canon_.options().tool_length;
  tool_ = tool;
  // With one tool in the scene its only length applies, whatever its number in the program.
  if (canon_.options().control_of_h.empty() && !lengths.count(tool) && !lengths.empty())
    tool_ = lengths.begin()->first;
  canon_.select_length(tool_, s.cause);
}

/// LOAD/TOOL,n is LOADTL/n.
void Machine::load(const Statement& s) {
  if (s.items.size() < 2 || !s.items.front().is("TOOL")) refuse(s.cause, "LOAD/TOOL and a number");
  Statement rest = s;
  rest.items.erase(rest.items.begin());
  load_tool(rest);
}

/// SELECT/TOOL,n and SELCTL/n select the tool of the next change.
void Machine::select(const Statement& s) {
  const std::size_t i = !s.items.empty() && s.items.front().is("TOOL") ? 1 : 0;
  if (i >= s.items.size()) refuse(s.cause, "the number of a tool", "none");
  const int tool = whole(s.items[i], max_tool, "the number of a tool");
  canon_.call_tool(tool, false);
  canon_.aside(fmt::format("T{}", tool));
}

/// Examples: SPINDL/1000,RPM,CLW, SPINDL/RPM,1000,CLW, SPINDL/ON and SPINDL/OFF.
void Machine::spindle(const Statement& s) {
  int turns = spindle_turns_;
  for (std::size_t i = 0; i < s.items.size(); ++i) {
    const Item& item = s.items[i];
    const auto skip_value = [&] { i += i + 1 < s.items.size() && s.items[i + 1].number; };
    if (item.number) {
      if (!(*item.number >= 0 && *item.number <= most_rpm))
        refuse(item, "a spindle speed of 0 to 1e7 rpm");
      speed_rpm_ = *item.number;
    } else if (item.is("CLW") || item.is("CCLW")) {
      turns = spindle_turns_ = item.is("CLW") ? 1 : -1;
    } else if (item.is("OFF") || item.is("STOP")) {
      turns = 0;
    } else if (item.is("SFM") || item.is("SMM") || item.is("SFPM")) {
      // A surface speed needs a diameter, which a milling tool path does not state.
      refuse(item, "a speed in RPM: surface speeds are not read");
    } else if (item.is("RANGE") || item.is("MAXRPM")) {
      skip_value();
    } else if (item.is("ORIENT")) {
      return;
    } else if (!item.is("RPM") && !item.is("ON") && !item.is("LOW") && !item.is("MEDIUM") &&
               !item.is("HIGH")) {
      unknown(s, item, "RPM, CLW, CCLW, ON, OFF, RANGE or ORIENT");
    }
  }
  if (s.items.empty()) refuse(s.cause, "a speed, ON or OFF behind SPINDL/", "none");
  canon_.set_spindle_speed(speed_rpm_);
  canon_.turn_spindle(turns);
}

void Machine::coolant(const Statement& s) {
  if (s.items.empty()) refuse(s.cause, "ON, OFF, FLOOD, MIST or another coolant", "none");
  const Item& item = s.items.front();
  canon_.aside(item.is("OFF") ? "M9" : item.is("MIST") ? "M7" : "M8");
}

/// CUTTER/diameter,corner radius: compared with the tool of the scene.
void Machine::cutter(const Statement& s) {
  CutterData words;
  words.diameter = number(s, 0, "the diameter of a cutter") * unit();
  words.unit_mm = unit();
  if (s.items.size() > 1) words.corner_radius = number(s, 1, "its corner radius") * unit();
  if (words.diameter > 0) canon_.cutter("CUTTER/", words);
}

/// TLDATA/MILL,diameter,corner radius. Data of other tool types is ignored.
void Machine::tool_data(const Statement& s) {
  if (s.items.empty() || !s.items.front().is("MILL")) return;
  CutterData words;
  words.diameter = number(s, 1, "the diameter of a cutter") * unit();
  words.unit_mm = unit();
  if (s.items.size() > 2) words.corner_radius = number(s, 2, "its corner radius") * unit();
  if (words.diameter > 0) canon_.cutter("TLDATA/MILL", words);
}

namespace {

constexpr std::size_t n_columns = 7;
// A table has seven columns of meaning; more cells are read only to report the width.
constexpr std::size_t max_cells = 100;

// Names that a header may give to x y z i j k and the feed.
constexpr std::array<std::array<std::string_view, 4>, n_columns> names = {{
    {"X", "X_MM", "", ""},
    {"Y", "Y_MM", "", ""},
    {"Z", "Z_MM", "", ""},
    {"I", "TX", "", ""},
    {"J", "TY", "", ""},
    {"K", "TZ", "", ""},
    {"FEED", "F", "FEED_MM_PER_MIN", "FEEDRATE"},
}};

/// Returns true unless the line is blank or a comment.
bool is_not_blank(std::string_view line) {
  const std::size_t at = line.find_first_not_of(" \t,;");
  return at != std::string_view::npos && line[at] != '#';
}

bool is(std::string_view cell, std::string_view word) {
  return !word.empty() && cell.size() == word.size() &&
         std::equal(cell.begin(), cell.end(), word.begin(),
                    [](char a, char b) { return upper(a) == b; });
}

/// Column of each of x y z i j k feed.
using Columns = std::array<std::optional<std::size_t>, n_columns>;

Item make_item(const Cell& cell, int line) {
  return {cell.text, number_of(cell.text), line, cell.column};
}

/// A table of locations, with the columns that its header names or that its width implies.
class Table {
 public:
  explicit Table(ProgramRun& run) : run_(run), machine_(run) { machine_.assume_mm(); }

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
    // Several names are accepted for each column; unknown columns are handled like unknown words.
    const auto named = std::find_if(names.begin(), names.end(), [&](const auto& some) {
      return std::any_of(some.begin(), some.end(),
                         [&](std::string_view one) { return is(cells[c].text, one); });
    });
    if (named == names.end()) {
      run_.handle_unknown_word({cells[c].column, cells[c].text}, "a column x, y, z, i, j, k or feed");
      continue;
    }
    auto& column = columns[std::size_t(named - names.begin())];
    if (column) refuse(cells[c], "each column once");
    column = c;
  }
  for (std::size_t i = 0; i < 3; ++i)
    if (!columns[i]) run_.canon.refuse({1, {}}, fmt::format("a column {}", names[i][0]), "none");
  // A vector needs all three components.
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
  // Four columns are x y z feed, so the fourth one is the feed and not i.
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
  const std::vector<Cell> cells = cells_of(line, cell_separator(line), max_cells);
  if (cells.size() > max_cells) run_.canon.refuse({1, {}}, "at most 100 columns", "more");
  if (head_refused_) return;  // without a header the rows cannot be interpreted
  if (!columns_) {
    width_ = cells.size();
    if (!number_of(cells.front().text)) {
      // Set while the header is read: if that throws, the flag stays.
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
    to.direction = machine_.direction_of(make_item(cells[*i], number_of_line),
                                         {number(cells, 3), number(cells, 4), number(cells, 5)});
  // The first row is reached at rapid, since nothing says where the tool comes from.
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
    if (!is_not_blank(*line)) continue;
    const std::vector<Cell> cells = cells_of(*line, cell_separator(*line), n_columns);
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
    if (run.is_aborted()) return;
    if (!is_not_blank(*line)) continue;
    run.canon.set_line(lines.number());
    run.try_block([&] {
      run.count_block();
      table.row(*line, lines.number());
    });
  }
  table.finish();
}

}  // namespace abbe::sim::dialects::cl
