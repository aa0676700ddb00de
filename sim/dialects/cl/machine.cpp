#include "sim/dialects/cl/cl.h"

namespace abbe::sim::dialects::cl {

using program::CutterData;

namespace {

// Limits of a statement, which bound its memory.
constexpr std::size_t max_items = 1000;
constexpr std::size_t max_lines = 200;
// Major words of statements with text up to the end of the line, including any $.
constexpr std::array<std::string_view, 9> text_words = {
    "PARTNO", "PPRINT", "REMARK", "INSERT", "TITLES", "LETTER", "PRINT", "TPRINT", "TOOL"};

bool is_word_byte(char c) { return is_letter(c) || is_digit(c) || c == '-' || c == '_'; }

/// Returns the position after the blanks from `at` on.
std::size_t skip_blanks_from(std::string_view text, std::size_t at) {
  while (at < text.size() && is_blank(text[at])) ++at;
  return at;
}

/// Reads the major word at `at` into the statement. Returns the position after it.
std::size_t read_major_word(std::string_view line, std::size_t at, Statement& statement) {
  const std::size_t from = at;
  statement.major.clear();
  if (at < line.size() && is_letter(line[at]))
    for (; at < line.size() && is_word_byte(line[at]); ++at) statement.major += upper(line[at]);
  statement.cause = {int(from) + 1, line.substr(from, at - from)};
  // Without a word the message quotes the whole line.
  if (statement.major.empty()) statement.cause.text = line.substr(from);
  return at;
}

bool is_text_statement(const std::string& major) {
  return std::find(text_words.begin(), text_words.end(), major) != text_words.end();
}

/// Removes the comment of a line, which begins with $$. Returns true if a single $ continues the
/// statement on the next line.
bool remove_comment(std::string_view& line) {
  const std::size_t dollar = line.find('$');
  if (dollar == std::string_view::npos) return false;
  const bool is_continued = dollar + 1 >= line.size() || line[dollar + 1] != '$';
  line = line.substr(0, dollar);
  return is_continued;
}

/// Returns the position after "$$->" or "$$ ->", or npos.
std::size_t skip_arrow(std::string_view line, std::size_t at) {
  if (line.substr(at, 2) != "$$") return std::string_view::npos;
  at = skip_blanks_from(line, at + 2);
  return line.substr(at, 2) == "->" ? skip_blanks_from(line, at + 2) : std::string_view::npos;
}

}  // namespace

bool Item::is_word(std::string_view word) const {
  return text.size() == word.size() && std::equal(text.begin(), text.end(), word.begin(),
                                                  [](char a, char b) { return upper(a) == b; });
}

bool Statements::next(Statement& statement) {
  statement.items.clear();
  statement.lines.clear();
  while (const auto next_line = lines_.next()) {
    std::string_view line = *next_line;
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
    at = read_major_word(line, at, statement);
    if (is_text_statement(statement.major)) {
      statement.lines.push_back({line, lines_.number(), at});
      return true;
    }
    if (statement.in_comment && at >= line.size()) return true;
    std::string_view item_text = line.substr(at);
    bool is_continued = remove_comment(item_text);
    line = line.substr(0, at + item_text.size());
    at = skip_blanks_from(line, at);
    // The slash may be missing, as in "GOTO 1,2,3".
    if (at < line.size() && line[at] == '/') ++at;
    statement.lines.push_back({line, lines_.number(), at});
    while (is_continued) {
      auto continuation = lines_.next();
      if (!continuation) break;
      is_continued = remove_comment(*continuation);
      // Lines beyond the limit are skipped; `read_items` reports them.
      if (statement.lines.size() <= max_lines)
        statement.lines.push_back({*continuation, lines_.number(), 0});
    }
    if (statement.major.empty() && statement.cause.text.starts_with('$')) continue;
    return true;
  }
  return false;
}

void read_items(Statement& statement, const program::Canon& canon) {
  if (statement.lines.size() > max_lines)
    canon.throw_input_error(statement.cause, "a statement of at most 200 lines", "more");
  bool is_separated = true;  // after a comma, or before the first item
  bool is_behind_comma = false;
  Item last_comma;
  for (const Statement::StatementLine& line : statement.lines)
    for (std::size_t at = skip_blanks_from(line.text, line.from); at < line.text.size();
         at = skip_blanks_from(line.text, at)) {
      Item item{{}, {}, line.line, int(at) + 1};
      if (line.text[at] == ',') {
        item.text = line.text.substr(at, 1);
        // Blanks and commas separate items, but an empty item between commas is an error.
        if (is_separated) throw_input_error(canon, item, "a value between the commas");
        is_separated = is_behind_comma = true;
        last_comma = item;
        ++at;
        continue;
      }
      const std::size_t end = std::min(line.text.find_first_of(" \t,", at), line.text.size());
      item.text = line.text.substr(at, end - at);
      item.number = number_of(item.text);
      if (statement.items.size() == max_items)
        throw_input_error(canon, item, "at most 1000 values in a statement");
      statement.items.push_back(item);
      is_separated = is_behind_comma = false;
      at = end;
    }
  if (is_behind_comma) throw_input_error(canon, last_comma, "a value after the last comma", "none");
}

// The item may be on another line than the statement.
void throw_input_error(const program::Canon& canon, const Item& item, std::string expected,
                       std::optional<std::string> seen) {
  program::throw_input_error({canon.place().file, item.line}, item.cause(), std::move(expected),
                             std::move(seen));
}

namespace {

/// Returns the items of a statement as text, for comparisons.
std::string item_text(const Statement& statement) {
  std::string text;
  for (const Item& item : statement.items) text += std::string(item.text) + ",";
  return text;
}

}  // namespace

double Machine::unit() const { return is_inch_ ? units::inch : 1.0; }

double Machine::number(const Statement& statement, std::size_t i, const char* what) const {
  if (i >= statement.items.size())
    throw_input_error(statement.cause, fmt::format("{} after {}", what, statement.major),
                      "too few values");
  if (!statement.items[i].number)
    throw_input_error(statement.items[i], fmt::format("{}, a number within +-1e9", what));
  return *statement.items[i].number;
}

Eigen::Vector3d Machine::vector(const Statement& statement, std::size_t i, const char* what) const {
  return {number(statement, i, what), number(statement, i + 1, what),
          number(statement, i + 2, what)};
}

int Machine::whole_number(const Item& item, int max, const char* what) const {
  const double value = item.number.value_or(-1.0);
  if (!(value >= 0 && value <= max) || value != std::floor(value))
    throw_input_error(item, fmt::format("{}, an integer from 0 to {}", what, max));
  return int(value);
}

/// Handles a minor word that the statement cannot have.
void Machine::handle_unknown_item(const Statement& statement, const Item& item,
                                  const std::string& expected) {
  const std::string word = statement.major + "/" + std::string(item.text);
  // The word, which may be on a continuation line, is counted at its own line.
  if (item.line != canon_.line()) canon_.set_line(item.line);
  run_.handle_unknown_word({item.column, word}, expected);
  canon_.set_line(statement.line);
}

void Machine::execute(Statement& statement) {
  canon_.set_line(statement.line);
  // Behind "$$->" Creo writes the cutter; everything else there is a comment.
  if (statement.in_comment && statement.major != "CUTTER") return;
  if (statement.major.empty())
    throw_input_error(statement.cause, "a word at the start of the statement");
  const WordEntry* entry = find_entry(statement.major);
  if (entry == nullptr) {
    const auto& first = statement.lines.front();
    // A definition such as "L1 = LINE/..." is APT source that has not been processed.
    if (first.text.find('=', first.from) != std::string_view::npos)
      throw_input_error(
          statement.cause,
          "processed statements: an APT source with definitions must be processed first",
          "a definition");
    run_.handle_unknown_word(statement.cause, "a cutter location statement");
    return;
  }
  if (entry->use == WordTreatment::Refused)
    throw_input_error(statement.cause, std::string(entry->sentence));
  if (entry->handler == nullptr) return;
  read_items(statement, canon_);
  (this->*entry->handler)(statement);
}

void Machine::fini(const Statement&) { has_ended_ = true; }

void Machine::units(const Statement& statement) {
  if (statement.items.size() != 1) throw_input_error(statement.cause, "MM or INCHES after UNITS/");
  const Item& item = statement.items.front();
  if (item.is_word("INCHES") || item.is_word("INCH") || item.is_word("IN"))
    is_inch_ = true;
  else if (item.is_word("MM"))
    is_inch_ = false;
  else
    throw_input_error(item, "MM or INCHES");
  are_units_stated_ = true;
  // The canon needs the unit for rewriting and for comments.
  canon_.set_inch(is_inch_);
}

void Machine::multax(const Statement& statement) {
  if (statement.items.empty() || statement.items.front().is_word("ON")) {
    is_upright_ = false;
  } else if (statement.items.front().is_word("OFF")) {
    is_upright_ = true;
    direction_ = Eigen::Vector3d::UnitZ();
  } else {
    throw_input_error(statement.items.front(), "ON or OFF");
  }
}

void Machine::rapid(const Statement& statement) {
  for (const Item& item : statement.items) throw_input_error(item, "nothing after RAPID");
  is_next_rapid_ = true;
}

/// Sets the feed. Both orders occur: FEDRAT/250,MMPM and FEDRAT/MMPM,250.
void Machine::feedrate(const Statement& statement) {
  std::optional<double> value;
  FeedMode mode = FeedMode::PerMinute;
  // Without IPM or MMPM the feed is in the unit of the program.
  double unit_mm = unit();
  for (const Item& item : statement.items) {
    if (item.number) {
      if (value) throw_input_error(item, "only one feed");
      if (!(*item.number >= min_feed)) throw_input_error(item, "a feed greater than zero");
      value = item.number;
    } else if (item.is_word("MMPM") || item.is_word("MMPR")) {
      unit_mm = 1.0;
      if (item.is_word("MMPR")) mode = FeedMode::PerRevolution;
    } else if (item.is_word("IPM") || item.is_word("IPR")) {
      unit_mm = units::inch;
      has_inch_feed_ = true;
      if (item.is_word("IPR")) mode = FeedMode::PerRevolution;
    } else if (item.is_word("PERREV")) {
      mode = FeedMode::PerRevolution;
    } else if (item.is_word("INVERS")) {
      mode = FeedMode::InverseTime;
    } else if (!item.is_word("PERMIN")) {
      handle_unknown_item(statement, item, "MMPM, MMPR, IPM, IPR, PERMIN, PERREV or INVERS");
    }
  }
  if (!value) throw_input_error(statement.cause, "a feed after FEDRAT/", "none");
  canon_.set_feed_mode(mode);
  canon_.set_feed(Feed{*value, unit_mm});
}

/// Dwells for seconds, or with REV for spindle revolutions.
void Machine::delay(const Statement& statement) {
  double seconds = number(statement, 0, "the dwell in seconds");
  if (statement.items.size() > 1) {
    if (!statement.items[1].is_word("REV"))
      return handle_unknown_item(statement, statement.items[1], "REV, or nothing for seconds");
    if (canon_.spindle_direction() == 0 || !(canon_.spindle_speed() > 0))
      throw_input_error(statement.items[1], "a running spindle with REV", "a stopped spindle");
    seconds *= 60.0 / canon_.spindle_speed();
  }
  canon_.dwell(seconds, statement.items.front().cause());
}

void Machine::stop(const Statement& statement) {
  canon_.record_auxiliary_word(statement.major == "STOP" ? "M0" : "M1");
}

/// Checks that there is only one MSYS, the system in which the points count: nothing states the
/// position of a second system relative to the first.
void Machine::msys(const Statement& statement) {
  const std::string text = item_text(statement);
  if (msys_text_ && *msys_text_ != text)
    throw_input_error(
        statement.cause,
        "one MSYS in the whole program: the position of the part in a second one is not defined");
  msys_text_ = text;
}

void Machine::origin(const Statement& statement) {
  for (const Item& item : statement.items)
    if (item.number.value_or(1.0) != 0.0)
      throw_input_error(item, "0,0,0: the work offset sets the program zero");
}

/// Throws BadInput for CUTCOM and OPSKIP with anything but OFF, which would change the path.
void Machine::require_off(const Statement& statement) {
  if (statement.items.size() == 1 && statement.items.front().is_word("OFF")) return;
  throw_input_error(statement.cause,
                    statement.major == "CUTCOM"
                        ? "CUTCOM/OFF, with points of the tool tip: paths that a control shifts by "
                          "a radius are not supported"
                        : statement.major + "/OFF, as no statement may be left out");
}

void Machine::auxiliary(const Statement& statement) {
  run_.warn_once(fmt::format("AUXFUN/ (line {}) is an M code of the control: it has no effect here",
                             statement.line));
}

void Machine::finish() {
  if (!are_units_stated_ && canon_.blocks() > 0)
    // A feed in inches suggests that the points are in inches too, so it has a warning of its own.
    run_.warn_once(has_inch_feed_ ? "the program states no UNITS/, and its feed is in IPM or IPR: "
                                    "its points are nevertheless taken as mm"
                                  : "the program states no UNITS/: its points are taken as mm");
  vector_lines_.finish();
  if (axis_deviation_.angle > min_axis_deviation)
    run_.warn_once(
        fmt::format("between two points the tool axis deviates from the great circle of their "
                    "vectors by up to {:.3g} deg (line {}), because the rotary axes interpolate "
                    "linearly: closer points reduce this",
                    axis_deviation_.angle / units::deg, axis_deviation_.line));
}

namespace {

constexpr int max_tool = 1'000'000;
constexpr double max_rpm = 1e7;

/// Words with a tool number. They have no effect, because points are the tip whatever the length.
constexpr std::array<std::string_view, 13> tool_words = {
    "LENGTH", "OSETNO", "ADJUST", "RADIUS", "MANUAL", "AUTO",  "HOLDER",
    "MINUS",  "PLUS",   "LARGE",  "SMALL",  "CLW",    "MAGAZN"};

template <typename List>
bool is_one_of(const Item& item, const List& list) {
  return std::any_of(list.begin(), list.end(),
                     [&](std::string_view word) { return item.is_word(word); });
}

}  // namespace

/// Changes the tool, for example LOADTL/n,LENGTH,l,OSETNO,k.
void Machine::load_tool(const Statement& statement) {
  if (statement.items.empty())
    throw_input_error(statement.cause, "a tool number after LOADTL/", "none");
  const int tool = whole_number(statement.items.front(), max_tool, "a tool number");
  for (std::size_t i = 1; i < statement.items.size(); ++i)
    if (!statement.items[i].number && !is_one_of(statement.items[i], tool_words))
      handle_unknown_item(statement, statement.items[i],
                          "LENGTH, OSETNO, ADJUST, RADIUS, MANUAL, AUTO or HOLDER");
  canon_.record_tool_call(tool, true);
  canon_.record_auxiliary_word(fmt::format("T{} M6", tool));
  const auto& lengths = canon_.options().tool_length;
  tool_ = tool;
  // The only length of the scene applies, whatever the number of the tool in the program.
  if (canon_.options().control_by_h.empty() && !lengths.count(tool) && !lengths.empty())
    tool_ = lengths.begin()->first;
  canon_.select_length(tool_, statement.cause);
}

/// Changes the tool by LOAD/TOOL,n, which is the same as LOADTL/n.
void Machine::load(const Statement& statement) {
  if (statement.items.size() < 2 || !statement.items.front().is_word("TOOL"))
    throw_input_error(statement.cause, "LOAD/TOOL and a number");
  Statement loadtl = statement;
  loadtl.items.erase(loadtl.items.begin());
  load_tool(loadtl);
}

/// Selects the tool of the next change: SELECT/TOOL,n or SELCTL/n.
void Machine::select(const Statement& statement) {
  const std::size_t i = !statement.items.empty() && statement.items.front().is_word("TOOL") ? 1 : 0;
  if (i >= statement.items.size()) throw_input_error(statement.cause, "a tool number", "none");
  const int tool = whole_number(statement.items[i], max_tool, "a tool number");
  canon_.record_tool_call(tool, false);
  canon_.record_auxiliary_word(fmt::format("T{}", tool));
}

/// Sets the spindle, for example SPINDL/1000,RPM,CLW, SPINDL/RPM,1000,CLW, SPINDL/ON or SPINDL/OFF.
void Machine::spindle(const Statement& statement) {
  int direction = spindle_direction_;
  for (std::size_t i = 0; i < statement.items.size(); ++i) {
    const Item& item = statement.items[i];
    const auto skip_value = [&] {
      i += i + 1 < statement.items.size() && statement.items[i + 1].number;
    };
    if (item.number) {
      if (!(*item.number >= 0 && *item.number <= max_rpm))
        throw_input_error(item, "a spindle speed from 0 to 1e7 rpm");
      speed_rpm_ = *item.number;
    } else if (item.is_word("CLW") || item.is_word("CCLW")) {
      direction = spindle_direction_ = item.is_word("CLW") ? 1 : -1;
    } else if (item.is_word("OFF") || item.is_word("STOP")) {
      direction = 0;
    } else if (item.is_word("SFM") || item.is_word("SMM") || item.is_word("SFPM")) {
      // A surface speed needs a diameter, which a milling tool path does not state.
      throw_input_error(item, "a speed in RPM: surface speeds are not supported");
    } else if (item.is_word("RANGE") || item.is_word("MAXRPM")) {
      skip_value();
    } else if (item.is_word("ORIENT")) {
      return;
    } else if (!item.is_word("RPM") && !item.is_word("ON") && !item.is_word("LOW") &&
               !item.is_word("MEDIUM") && !item.is_word("HIGH")) {
      handle_unknown_item(statement, item, "RPM, CLW, CCLW, ON, OFF, RANGE or ORIENT");
    }
  }
  if (statement.items.empty())
    throw_input_error(statement.cause, "a speed, ON or OFF after SPINDL/", "none");
  canon_.set_spindle_speed(speed_rpm_);
  canon_.turn_spindle(direction);
}

void Machine::coolant(const Statement& statement) {
  if (statement.items.empty())
    throw_input_error(statement.cause, "ON, OFF, FLOOD, MIST or another coolant", "none");
  const Item& item = statement.items.front();
  canon_.record_auxiliary_word(item.is_word("OFF") ? "M9" : item.is_word("MIST") ? "M7" : "M8");
}

/// Compares the cutter, CUTTER/diameter,corner radius, with the tool of the scene.
void Machine::cutter(const Statement& statement) {
  CutterData words;
  words.diameter = number(statement, 0, "the cutter diameter") * unit();
  words.unit_mm = unit();
  if (statement.items.size() > 1)
    words.corner_radius = number(statement, 1, "the corner radius") * unit();
  if (words.diameter > 0) canon_.cutter("CUTTER/", words);
}

/// Compares the cutter, TLDATA/MILL,diameter,corner radius, with the tool of the scene. Ignores
/// other types of tools.
void Machine::tool_data(const Statement& statement) {
  if (statement.items.empty() || !statement.items.front().is_word("MILL")) return;
  CutterData words;
  words.diameter = number(statement, 1, "the cutter diameter") * unit();
  words.unit_mm = unit();
  if (statement.items.size() > 2)
    words.corner_radius = number(statement, 2, "the corner radius") * unit();
  if (words.diameter > 0) canon_.cutter("TLDATA/MILL", words);
}

namespace {

constexpr std::size_t column_count = 7;
// More cells than columns are read only to report the width of the table.
constexpr std::size_t max_cells = 100;

// Names of x y z i j k and the feed in a header.
constexpr std::array<std::array<std::string_view, 4>, column_count> column_names = {{
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

bool is_same_word(std::string_view cell, std::string_view word) {
  return !word.empty() && cell.size() == word.size() &&
         std::equal(cell.begin(), cell.end(), word.begin(),
                    [](char a, char b) { return upper(a) == b; });
}

/// Column indices of x y z i j k and the feed.
using Columns = std::array<std::optional<std::size_t>, column_count>;

Item make_item(const Cell& cell, int line) {
  return {cell.text, number_of(cell.text), line, cell.column};
}

/// Reader of a table of locations. Its header names the columns, or its width implies them.
class Table {
 public:
  explicit Table(ProgramRun& run) : run_(run), machine_(run) { machine_.assume_mm(); }

  void read_row(std::string_view line, int line_number) {
    const std::vector<Cell> cells = split_cells(line, cell_separator(line), max_cells);
    if (cells.size() > max_cells)
      run_.canon.throw_input_error({1, {}}, "at most 100 columns", "more");
    // Rows have no meaning without a valid header.
    if (is_header_invalid_) return;
    if (!columns_) {
      width_ = cells.size();
      if (!number_of(cells.front().text)) {
        // The flag stays set if `read_header` throws.
        is_header_invalid_ = true;
        read_header(cells);
        is_header_invalid_ = false;
        return;
      }
      assume_columns(cells);
    }
    if (cells.size() != width_)
      run_.canon.throw_input_error({1, {}}, fmt::format("{} columns, as in the first row", width_),
                                   fmt::format("{}", cells.size()));
    Location to{{number(cells, 0), number(cells, 1), number(cells, 2)}, machine_.direction()};
    if (const auto i = (*columns_)[3])
      to.direction =
          machine_.unit_direction(make_item(cells[*i], line_number),
                                  {number(cells, 3), number(cells, 4), number(cells, 5)});
    // The tool moves to the first row at rapid, because nothing states where it comes from.
    if (!has_first_location_) machine_.request_rapid();
    if (const auto feed = (*columns_)[6]) read_feed(cells[*feed]);
    const Cell& first = cells[*(*columns_)[0]];
    machine_.go_to(to, {first.column, first.text}, true);
    has_first_location_ = true;
  }

  void finish() { machine_.finish(); }

 private:
  void read_header(const std::vector<Cell>& cells) {
    Columns columns;
    for (std::size_t c = 0; c < cells.size(); ++c) {
      // An unknown column is treated like an unknown word.
      const auto names = std::ranges::find_if(column_names, [&](const auto& aliases) {
        return std::ranges::any_of(
            aliases, [&](std::string_view name) { return is_same_word(cells[c].text, name); });
      });
      if (names == column_names.end()) {
        run_.handle_unknown_word({cells[c].column, cells[c].text},
                                 "a column x, y, z, i, j, k or feed");
        continue;
      }
      auto& column = columns[std::size_t(names - column_names.begin())];
      if (column) throw_input_error(cells[c], "each column only once");
      column = c;
    }
    for (std::size_t i = 0; i < 3; ++i)
      if (!columns[i])
        run_.canon.throw_input_error({1, {}}, fmt::format("a column {}", column_names[i][0]),
                                     "none");
    // A vector needs all three components.
    const int component_count =
        int(columns[3].has_value()) + int(columns[4].has_value()) + int(columns[5].has_value());
    if (component_count != 0 && component_count != 3)
      run_.canon.throw_input_error({1, {}}, "columns i, j and k together", "only some of them");
    columns_ = columns;
  }

  void assume_columns(const std::vector<Cell>& cells) {
    Columns columns;
    const std::size_t width = cells.size();
    if (width != 3 && width != 4 && width != 6 && width != 7)
      run_.canon.throw_input_error({1, {}}, "a head, or 3, 4, 6 or 7 columns: x y z, feed, i j k",
                                   fmt::format("{} columns", width));
    // The fourth of four columns is the feed and not i.
    for (std::size_t i = 0; i < width; ++i) columns[width == 4 && i == 3 ? 6 : i] = i;
    columns_ = columns;
  }

  double number(const std::vector<Cell>& cells, std::size_t column) const {
    const Cell& cell = cells[*(*columns_)[column]];
    const auto value = number_of(cell.text);
    if (!value) throw_input_error(cell, "a number within +-1e9, with a decimal point");
    return *value;
  }

  void read_feed(const Cell& cell) {
    if (cell.text.empty()) return;
    if (is_same_word(cell.text, "RAPID")) return machine_.request_rapid();
    const auto value = number_of(cell.text);
    if (!value || !(*value > 0))
      throw_input_error(cell, "a feed greater than zero in mm/min, or rapid");
    machine_.set_feed({*value, 1.0});
  }

  [[noreturn]] void throw_input_error(const Cell& cell, const std::string& expected) const {
    run_.canon.throw_input_error({cell.column, cell.text}, expected, quoted_excerpt(cell.text));
  }

  ProgramRun& run_;
  Machine machine_;
  std::optional<Columns> columns_;
  std::size_t width_ = 0;
  bool has_first_location_ = false, is_header_invalid_ = false;
};

}  // namespace

bool is_table(std::string_view text) {
  LineReader lines(text);
  while (const auto line = lines.next()) {
    if (!is_not_blank(*line)) continue;
    const std::vector<Cell> cells = split_cells(*line, cell_separator(*line), column_count);
    return !cells.empty() &&
           (number_of(cells.front().text) ||
            (cells.size() > 1 && std::any_of(cells.begin(), cells.end(), [](const Cell& cell) {
               return is_same_word(cell.text, "X") || is_same_word(cell.text, "X_MM");
             })));
  }
  return false;
}

void read_table(std::string_view text, ProgramRun& run) {
  Table table(run);
  LineReader lines(text);
  while (const auto line = lines.next()) {
    if (run.is_aborted()) return;
    if (!is_not_blank(*line)) continue;
    run.canon.set_line(lines.number());
    run.try_block([&] {
      run.count_block();
      table.read_row(*line, lines.number());
    });
  }
  table.finish();
}

}  // namespace abbe::sim::dialects::cl
