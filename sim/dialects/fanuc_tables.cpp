#include "sim/dialects/fanuc_tables.h"

#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim::dialects {

namespace {

constexpr std::string_view listed_axes = "XYZABCUVW";
constexpr std::size_t most_words = 64;  // of a block

struct ListedWord {
  char letter = ' ';
  double value = 0.0;
  bool point = false;    // it has a decimal point
  std::size_t from = 0;  // where it begins
};

/// Words of a block, its comments left out.
std::vector<ListedWord> listed_words(Cursor& line) {
  std::vector<ListedWord> words;
  for (line.skip_blanks(); !line.at_end(); line.skip_blanks()) {
    const std::size_t from = line.at;
    const char c = upper(line.here());
    if (c == '(') {
      const std::size_t close = line.text.find(')', from);
      if (close == std::string_view::npos) line.refuse(from, "a ) that closes the comment");
      line.at = close + 1;
      continue;
    }
    if (c == ';' || c == '%' || c == '/') {
      ++line.at;
      continue;
    }
    if (!is_letter(c)) line.refuse(from, "a letter and a number");
    ++line.at;
    const auto value = line.number();
    if (!value) line.refuse(from, "a number behind the letter");
    const bool point = line.text.substr(from, line.at - from).find('.') != std::string_view::npos;
    words.push_back({c, *value, point, from});
    if (words.size() > most_words) line.refuse(from, "at most 64 words in a block");
  }
  return words;
}

/// A block that sets something.
struct Setting {
  bool sets = false;
  std::optional<ListedWord> l, p, r;
  std::vector<ListedWord> axes;
};

void put_once(std::optional<ListedWord>& to, const ListedWord& word, const Cursor& line) {
  if (to) line.refuse(word.from, fmt::format("{} once in a block", word.letter));
  to = word;
}

void take_code(TableReading& reading, const ListedWord& word, const Cursor& line,
               Setting& setting) {
  if (word.value == 10.0)
    setting.sets = true;
  else if (word.value == 20.0)
    reading.state_unit(units::inch, line, word.from);
  else if (word.value == 21.0)
    reading.state_unit(1.0, line, word.from);
  else if (word.value != 11.0 && word.value != 90.0)
    line.refuse(word.from, "G10 G11 G20 G21 or G90 in a listing of a control's memory");
}

Setting setting_of(TableReading& reading, Cursor& line) {
  Setting setting;
  for (const ListedWord& word : listed_words(line)) {
    if (word.letter == 'G')
      take_code(reading, word, line, setting);
    else if (word.letter == 'L')
      put_once(setting.l, word, line);
    else if (word.letter == 'P')
      put_once(setting.p, word, line);
    else if (word.letter == 'R')
      put_once(setting.r, word, line);
    else if (listed_axes.find(word.letter) != std::string_view::npos)
      setting.axes.push_back(word);
    else if (word.letter != 'O' && word.letter != 'N' && word.letter != 'M')
      line.refuse(word.from, "G10 with L, P, and R or axis words");
  }
  return setting;
}

int whole_of(const ListedWord& word, int least, int most, const Cursor& line) {
  if (word.value != int(word.value) || word.value < least || word.value > most)
    line.refuse(word.from, fmt::format("{} from {} to {}", word.letter, least, most));
  return int(word.value);
}

void check_point(const ListedWord& word, const Cursor& line) {
  if (!word.point && word.value != 0.0)
    line.refuse(word.from, "a value with a decimal point: without one it counts increments");
  if (!(word.value <= 1e6 && word.value >= -1e6)) line.refuse(word.from, "a value within 1e6");
}

void listed_tool(TableReading& reading, const Setting& setting, int kind, const Cursor& line) {
  const ListedWord& r = *setting.r;
  if (!setting.axes.empty()) line.refuse(setting.axes.front().from, "R beside G10 of a tool");
  const int number = whole_of(*setting.p, 1, 999, line);
  if (reading.kind != TableKind::Tools) return reading.leave_out("G10 L10 to L13");
  check_point(r, line);
  const double mm = r.value == 0.0 ? 0.0 : r.value * reading.unit_at(line, r.from);
  TableTool& tool = reading.table.tools.try_emplace(number).first->second;
  if (tool.line == 0) tool.line = line.place.line;
  // geometry is kept without wear until the end of the listing
  if (kind == 10) tool.length = mm;
  if (kind == 11) tool.length_wear = mm;
  if (kind == 12) tool.radius = mm;
  if (kind == 13) tool.radius_wear = mm;
}

void listed_offset(TableReading& reading, const Setting& setting, bool additional,
                   const Cursor& line) {
  if (setting.r) line.refuse(setting.r->from, "axis words beside G10 L2 and L20");
  const int p = whole_of(*setting.p, additional ? 1 : 0, additional ? 300 : 6, line);
  if (reading.kind != TableKind::Offsets) return reading.leave_out("G10 L2 and L20");
  TableOffset& offset = reading.table.offsets[additional ? 100 + p : p];
  for (const ListedWord& word : setting.axes) {
    check_point(word, line);
    const bool turns = word.letter >= 'A' && word.letter <= 'C';
    const double unit = turns || word.value == 0.0 ? 1.0 : reading.unit_at(line, word.from);
    offset.axes[word.letter] = {word.value * unit, line.place.line, int(word.from) + 1};
  }
}

bool listed_block(TableReading& reading, Cursor& line) {
  const Setting setting = setting_of(reading, line);
  const bool empty = !setting.l && !setting.p && !setting.r && setting.axes.empty();
  if (!setting.sets) {
    if (!empty) line.refuse(0, "G10 in a block that sets something", "none");
    return true;
  }
  if (empty) return true;
  if (!setting.l) line.refuse(0, "L2 L10 L11 L12 L13 or L20 beside G10", "none");
  if (!setting.p) line.refuse(0, "P (number) beside G10", "none");
  const int kind = int(setting.l->value);
  if (kind != setting.l->value || (kind != 2 && kind != 20 && (kind < 10 || kind > 13)))
    line.refuse(setting.l->from, "L2 L10 L11 L12 L13 or L20 beside G10");
  if (kind == 2 || kind == 20) {
    listed_offset(reading, setting, kind == 20, line);
    return true;
  }
  if (!setting.r) line.refuse(0, "R (value) beside G10 of a tool", "none");
  listed_tool(reading, setting, kind, line);
  return true;
}

}  // namespace

void read_fanuc_table(TableReading& reading) {
  each_line(reading, [&](Cursor& line) { return listed_block(reading, line); });
  for (auto& [number, tool] : reading.table.tools) {
    if (tool.length) *tool.length += tool.length_wear;
    if (tool.radius) *tool.radius += tool.radius_wear;
  }
}

}  // namespace abbe::sim::dialects
