#include "errors/element_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"

namespace abbe::errors {
namespace {

constexpr double largest = 1e9;  // mm or deg; anything beyond is a slip, and sums of it stay finite
constexpr std::size_t most_cells = 7;

struct Cell {
  std::string_view text;
  int column = 1;
};

struct Line {
  std::string_view text;
  int number = 0;
};

/// Where refusals are made: they all name the file.
struct Source {
  const std::string& file;
  [[noreturn]] void refuse(int line, int column, const std::string& expected,
                           const std::string& seen) const {
    throw BadInput(file, line, column, expected, seen);
  }
};

std::string shown(std::string_view text) {
  if (text.empty()) return "nothing";
  std::string result = "'";
  for (const char c : text.substr(0, 40)) {
    if (c >= ' ' && c <= '~')
      result += c;
    else
      result += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
  }
  return result + (text.size() > 40 ? "...'" : "'");
}

bool is_blank(char c) { return c == ' ' || c == '\t'; }

Cell trimmed(std::string_view text, int column) {
  while (!text.empty() && is_blank(text.front())) {
    text.remove_prefix(1);
    ++column;
  }
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return {text, column};
}

/// The lines that say something, one at a time.
class Lines {
 public:
  Lines(std::string_view text, const Source& source) : rest_(text), source_(source) {
    if (rest_.starts_with("\xef\xbb\xbf")) rest_.remove_prefix(3);
  }

  std::optional<Line> next() {
    while (!rest_.empty()) {
      const std::size_t end = rest_.find('\n');
      std::string_view text = rest_.substr(0, end);
      rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
      ++number_;
      if (text.ends_with('\r')) text.remove_suffix(1);
      check(text);
      const std::string_view content = trimmed(text, 1).text;
      if (!content.empty() && content.front() != '#') return Line{text, number_};
    }
    return std::nullopt;
  }

  int number() const { return number_; }

 private:
  void check(std::string_view text) const {
    for (std::size_t i = 0; i < text.size(); ++i) {
      const auto c = static_cast<unsigned char>(text[i]);
      if ((c < ' ' && c != '\t') || c == 0x7f)
        source_.refuse(number_, int(i) + 1, "plain text", fmt::format("a byte 0x{:02x}", c));
    }
  }

  std::string_view rest_;
  const Source& source_;
  int number_ = 0;
};

char separator_of(std::string_view head) {
  for (const char c : {';', ','})
    if (head.find(c) != std::string_view::npos) return c;
  return ' ';
}

/// Cells of a line, but at most one more than a head can have, so that a line of nothing but
/// separators costs nothing.
std::vector<Cell> cells_of(std::string_view text, char separator) {
  std::vector<Cell> cells;
  cells.reserve(most_cells + 1);
  std::size_t at = 0;
  while (cells.size() <= most_cells) {
    if (separator == ' ') {
      at = std::min(text.find_first_not_of(" \t", at), text.size());
      if (at == text.size()) return cells;
    }
    const std::size_t end = std::min(
        separator == ' ' ? text.find_first_of(" \t", at) : text.find(separator, at), text.size());
    cells.push_back(trimmed(text.substr(at, end - at), int(at) + 1));
    if (end == text.size()) return cells;
    at = end + 1;
  }
  return cells;
}

/// A name of the head and what follows its underscore.
struct HeadCell {
  std::string_view name;
  std::optional<std::string_view> unit;
};

HeadCell head_cell(const Cell& cell) {
  const std::size_t at = cell.text.find('_');
  if (at == std::string_view::npos) return {cell.text, std::nullopt};
  return {cell.text.substr(0, at), cell.text.substr(at + 1)};
}

bool is_rotary(char axis) { return (axis >= 'A' && axis <= 'C') || axis == 'S'; }

struct Head {
  ElementTable table;         ///< without rows
  std::vector<double> units;  ///< (1 + m) mm or rad per unit of the column
  char separator = ' ';
};

/// Reader of a head's cells: one axis, then its elements.
class HeadReader {
 public:
  HeadReader(const Line& line, const Source& source) : line_(line), source_(source) {}

  Head read() {
    head_.separator = separator_of(line_.text);
    const std::vector<Cell> cells = cells_of(line_.text, head_.separator);
    read_axis(cells.front());
    for (std::size_t i = 1; i < cells.size(); ++i) read_element(cells[i]);
    if (cells.size() < 2) refuse({"", int(line_.text.size()) + 1}, "an element after the axis");
    return std::move(head_);
  }

 private:
  [[noreturn]] void refuse(const Cell& cell, const std::string& expected) const {
    source_.refuse(line_.number, cell.column, expected, shown(cell.text));
  }

  void read_axis(const Cell& cell) {
    const HeadCell head = head_cell(cell);
    constexpr std::string_view letters = "XYZUVWABCS";
    if (head.name.size() != 1 || letters.find(head.name.front()) == std::string_view::npos)
      refuse(cell, "a head such as X EXX EYX, first the letter of an axis");
    head_.table.axis = head.name.front();
    if (is_rotary(head_.table.axis)) {
      if (head.unit && *head.unit != "deg" && *head.unit != "rad")
        refuse(cell, "deg or rad as the unit of a rotary axis");
      head_.units.push_back(head.unit == "rad" ? 1.0 : units::deg);
    } else {
      if (head.unit && *head.unit != "mm") refuse(cell, "mm as the unit of a slide");
      head_.units.push_back(1.0);
    }
  }

  void read_element(const Cell& cell) {
    const HeadCell head = head_cell(cell);
    const ElementName name = element_name(cell, head.name);
    if (name.location || name.axis != head_.table.axis)
      refuse(cell, fmt::format("an error motion of {}, such as EX{}", head_.table.axis,
                               head_.table.axis));
    for (const ElementName& other : head_.table.elements)
      if (other == name) refuse(cell, "every element once");
    head_.table.elements.push_back(name);
    const std::string_view large = name.is_angle() ? "rad" : "mm";
    const std::string_view small = name.is_angle() ? "urad" : "um";
    if (head.unit && *head.unit != large && *head.unit != small)
      refuse(cell, fmt::format("{} or {} as the unit of {}", large, small, to_string(name)));
    const double small_unit = name.is_angle() ? units::urad : units::um;
    head_.units.push_back(head.unit == small ? small_unit : 1.0);
  }

  ElementName element_name(const Cell& cell, std::string_view text) const {
    try {
      return parse_element_name(text);
    } catch (const std::invalid_argument&) {
      refuse(cell, fmt::format("an element name, such as EX{}", head_.table.axis));
    }
  }

  const Line& line_;
  const Source& source_;
  Head head_;
};

double number(const Cell& cell, int line, const Source& source) {
  double x = 0.0;
  std::string_view digits = cell.text;
  if (digits.size() > 1 && digits[0] == '+' && digits[1] != '-') digits.remove_prefix(1);
  const auto [end, fault] = std::from_chars(digits.data(), digits.data() + digits.size(), x);
  if (fault != std::errc{} || end != digits.data() + digits.size() || !(std::abs(x) <= largest))
    source.refuse(line, cell.column, "a number within +-1e9", shown(cell.text));
  return x;
}

/// One row after another: 1 + m numbers each.
std::vector<double> read_rows(Lines& lines, const Head& head, const Source& source) {
  const std::size_t width = head.units.size();
  std::vector<double> numbers;
  while (const auto line = lines.next()) {
    const std::vector<Cell> cells = cells_of(line->text, head.separator);
    for (std::size_t i = 0; i < std::min(cells.size(), width); ++i)
      numbers.push_back(number(cells[i], line->number, source) * head.units[i]);
    const std::string wanted = fmt::format("{} cells, as the head has", width);
    if (cells.size() < width)
      source.refuse(line->number, int(line->text.size()) + 1, wanted,
                    fmt::format("{}", cells.size()));
    if (cells.size() > width) source.refuse(line->number, cells[width].column, wanted, "more");
    const std::size_t here = numbers.size() - width;
    if (here > 0 && !(numbers[here] > numbers[here - width]))
      source.refuse(line->number, cells[0].column, "positions that increase from row to row",
                    shown(cells[0].text));
  }
  return numbers;
}

}  // namespace

ElementTable read_element_table(std::string_view text, const std::string& file,
                                const ElementTableOptions& options) {
  const Source source{file};
  if (text.size() > options.max_bytes)
    source.refuse(0, 0, fmt::format("at most {} bytes", options.max_bytes),
                  fmt::format("{}", text.size()));
  Lines lines(text, source);
  const auto first = lines.next();
  if (!first) source.refuse(1, 1, "a head such as X EXX EYX", "an empty table");
  Head head = HeadReader(*first, source).read();
  const std::vector<double> numbers = read_rows(lines, head, source);
  const auto width = Eigen::Index(head.units.size());
  const Eigen::Index rows = Eigen::Index(numbers.size()) / width;
  if (rows < 2) source.refuse(lines.number(), 0, "at least 2 rows", fmt::format("{}", rows));
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const Rows> all(numbers.data(), rows, width);
  head.table.q = all.col(0);
  head.table.values = all.rightCols(width - 1);
  return std::move(head.table);
}

ElementTable read_element_table_file(const std::filesystem::path& file,
                                     const ElementTableOptions& options) {
  const std::string name = file.string();
  const Source source{name};
  std::error_code fault;
  if (!std::filesystem::is_regular_file(file, fault))
    source.refuse(0, 0, "a file", std::filesystem::exists(file, fault) ? "something else" : "none");
  const std::uintmax_t size = std::filesystem::file_size(file, fault);
  if (fault) source.refuse(0, 0, "a readable file", fault.message());
  if (size > options.max_bytes)
    source.refuse(0, 0, fmt::format("at most {} bytes", options.max_bytes),
                  fmt::format("{}", size));
  std::ifstream stream(file, std::ios::binary);
  std::string text(std::size_t(size), '\0');
  if (!stream.read(text.data(), std::streamsize(size)))
    source.refuse(0, 0, "a readable file", "one that cannot be read");
  return read_element_table(text, name, options);
}

std::string write_element_table(const ElementTable& table, char separator) {
  if (table.values.rows() != table.q.size() ||
      table.values.cols() != Eigen::Index(table.elements.size()))
    throw std::invalid_argument("element table: expected a value for every position and element");
  std::string text(1, table.axis);
  for (const ElementName& name : table.elements) text += separator + to_string(name);
  // the nearest number of degrees: if any reads back exactly, this one does
  const double unit = is_rotary(table.axis) ? units::deg : 1.0;
  for (Eigen::Index i = 0; i < table.q.size(); ++i) {
    fmt::format_to(std::back_inserter(text), "\n{}", table.q[i] / unit);
    for (Eigen::Index k = 0; k < table.values.cols(); ++k)
      fmt::format_to(std::back_inserter(text), "{}{}", separator, table.values(i, k));
  }
  return text + "\n";
}

std::vector<Element> elements_of(const ElementTable& table, const TableUse& use) {
  std::vector<Element> elements;
  for (std::size_t k = 0; k < table.elements.size(); ++k) {
    Table shape = make_table(table.q, table.values.col(Eigen::Index(k)), use.between, use.outside);
    elements.push_back(
        {table.elements[k], {Curve{std::move(shape), use.name, use.argument, use.negate, 1.0}}});
  }
  return elements;
}

}  // namespace abbe::errors
