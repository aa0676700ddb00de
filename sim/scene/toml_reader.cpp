#include "sim/scene/toml_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <system_error>

#include <fmt/format.h>
#include <toml++/toml.h>

#include "kinematics/escape.h"
#include "kinematics/units.h"

namespace abbe::sim {

namespace {

constexpr int max_depth = 100;
constexpr std::size_t max_faults = 200;

// In the unit of any key a number beyond is a mistake, and products of a few stay finite. Travel
// without an end is 1e9 rad.
constexpr double most_number = 1e12;
// What is nearer to zero is zero, or a mistake; what divides must not make infinities.
constexpr double least_number = 1e-100, least_divisor = 1e-12;

Place place_at(std::string_view text, std::size_t offset, const std::string& file) {
  const std::string_view before = text.substr(0, offset);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::size_t start = before.rfind('\n');
  const std::size_t column = start == std::string_view::npos ? offset + 1 : offset - start;
  return {std::make_shared<const std::string>(file), int(line), int(column)};
}

[[noreturn]] void refuse_text(const Place& place, const std::string& expected,
                              const std::string& seen) {
  throw BadInput(*place.file, place.line, place.column, expected, seen);
}

// The parser limits how deep brackets nest, but not how long a dotted key is, and destroys what a
// dotted key builds by recursion.
void refuse_deep_keys(std::string_view text, const std::string& file) {
  int dots = 0;
  bool name_since_dot = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '.') {
      if (name_since_dot && ++dots > 1000) {
        refuse_text(place_at(text, i, file), "a key of at most 100 parts", "a longer one");
      }
      name_since_dot = false;
    } else if (std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-') {
      name_since_dot = true;
    } else if (c != ' ' && c != '\t' && c != '"' && c != '\'') {
      dots = 0;
      name_since_dot = false;
    }
  }
}

class Converter {
 public:
  explicit Converter(std::shared_ptr<const std::string> file) : file_(std::move(file)) {}

  Node node(const ::toml::node& from, int depth) const {
    if (depth > max_depth) {
      const Place deep = place(from.source());
      refuse_text(deep, "at most 100 levels of tables and arrays", "more");
    }
    Node to;
    to.place = place(from.source());
    from.visit([&](const auto& value) { to.value = converted(value, depth); });
    return to;
  }

 private:
  using Value = decltype(Node::value);

  Place place(const ::toml::source_region& source) const {
    return {file_, int(source.begin.line), int(source.begin.column)};
  }
  Value converted(const ::toml::value<bool>& v, int) const { return *v; }
  Value converted(const ::toml::value<std::int64_t>& v, int) const { return *v; }
  Value converted(const ::toml::value<double>& v, int) const { return *v; }
  Value converted(const ::toml::value<std::string>& v, int) const { return *v; }
  template <typename Date>
  Value converted(const ::toml::value<Date>& v, int) const {
    std::ostringstream out;
    out << *v;
    return TomlDate{out.str()};
  }
  Value converted(const ::toml::array& from, int depth) const {
    Node::Array to;
    to.reserve(from.size());
    for (const ::toml::node& element : from) to.push_back(node(element, depth + 1));
    return to;
  }
  // toml++ keeps keys sorted by name; the order of the file is found again from their places.
  Value converted(const ::toml::table& from, int depth) const {
    Node::Table to;
    to.reserve(from.size());
    for (const auto& [key, element] : from) {
      to.push_back({std::string(key.str()), place(key.source()), node(element, depth + 1)});
    }
    std::stable_sort(to.begin(), to.end(), [](const Node::Entry& a, const Node::Entry& b) {
      return std::pair(a.place.line, a.place.column) < std::pair(b.place.line, b.place.column);
    });
    return to;
  }

  std::shared_ptr<const std::string> file_;
};

/// Marks of format beyond ASCII as TOML spells them: U+2028 is \u2028, a tag \U000E0041.
std::string with_marks_as_toml(const std::string& text) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const auto lead = static_cast<unsigned char>(text[at]);
    const std::size_t bytes = lead < 0x80 ? 1 : lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
    const std::string letter = text.substr(at, bytes), shown = escaped(letter);
    at += bytes;
    if (lead < 0x80 || shown == letter || shown.starts_with("\\x")) {
      out += letter;
    } else if (shown.size() == 6) {
      out += shown;
    } else {  // two halves of UTF-16
      const unsigned high = unsigned(std::stoul(shown.substr(2, 4), nullptr, 16));
      const unsigned low = unsigned(std::stoul(shown.substr(8, 4), nullptr, 16));
      out += fmt::format("\\U{:08X}", 0x10000 + ((high - 0xD800) << 10) + (low - 0xDC00));
    }
  }
  return out;
}

std::string quoted_text(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      out += fmt::format("\\u{:04X}", static_cast<unsigned char>(c));
    } else {
      out += c;
    }
  }
  return with_marks_as_toml(out) + '"';
}

std::string key_text(const std::string& key) {
  const bool bare = !key.empty() && std::all_of(key.begin(), key.end(), [](unsigned char c) {
    return (c < 0x80 && std::isalnum(c)) || c == '_' || c == '-';
  });
  return bare ? key : quoted_text(key);
}

std::string float_text(double value) {
  if (!std::isfinite(value)) return std::isnan(value) ? "nan" : value > 0 ? "inf" : "-inf";
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

bool is_list_of_tables(const Node& node) {
  const Node::Array* array = node.array();
  return array && !array->empty() &&
         std::all_of(array->begin(), array->end(), [](const Node& n) { return n.table(); });
}

void write_section(const Node& table, const std::string& path, std::string& out) {
  for (const Node::Entry& entry : *table.table()) {
    if (entry.node.table() || is_list_of_tables(entry.node)) continue;
    out += key_text(entry.key) + " = " + to_toml_value(entry.node) + "\n";
  }
  for (const Node::Entry& entry : *table.table()) {
    const std::string inner = path.empty() ? key_text(entry.key) : path + "." + key_text(entry.key);
    if (entry.node.table()) {
      out += fmt::format("\n[{}]\n", inner);
      write_section(entry.node, inner, out);
    } else if (is_list_of_tables(entry.node)) {
      for (const Node& element : *entry.node.array()) {
        out += fmt::format("\n[[{}]]\n", inner);
        write_section(element, inner, out);
      }
    }
  }
}

int edit_distance(std::string_view a, std::string_view b) {
  std::vector<int> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = int(j);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    int diagonal = row[0];
    row[0] = int(i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const int above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row.back();
}

struct Unit {
  std::string_view suffix;
  double factor;
};
// Longer suffixes first: "_mm_per_min" also ends in a unit of its own.
constexpr std::array known_units{
    Unit{"_Nm_per_rpm", 1e3},
    Unit{"_Nm_per_urad", 1e9},
    Unit{"_urad_per_m_K", 1e-9},
    Unit{"_urad_per_m", 1e-9},
    Unit{"_um_per_m_K", 1e-6},
    Unit{"_urad_per_K", units::urad},
    Unit{"_N_s_per_mm", 1.0},
    Unit{"_N_per_mm2", 1.0},
    Unit{"_um_per_K", units::um},
    Unit{"_um_per_N", units::um},
    Unit{"_um_urad", 1.0},  // each number as its element is: um or urad
    Unit{"_um_per_m", 1e-6},
    Unit{"_um_per_h", units::um / 3600.0},
    Unit{"_N_per_um", 1e3},
    Unit{"_Nm_per_A", 1e3},
    Unit{"_N_per_mm", 1.0},
    Unit{"_J_per_K", 1.0},
    Unit{"_W_per_K", 1.0},
    Unit{"_deg_per_min", units::deg / 60.0},
    Unit{"_mm_per_min", units::mm_per_min},
    Unit{"_mm_per_rev", 1.0},
    Unit{"_um_per_rev", units::um},
    Unit{"_deg_per_s", units::deg},
    Unit{"_mm_per_s", 1.0},
    Unit{"_arcsec", units::deg / 3600.0},
    Unit{"_urad", units::urad},
    Unit{"_mrad", 1e-3},
    Unit{"_rad", 1.0},
    Unit{"_GPa", 1e3},
    Unit{"_MPa", 1.0},
    Unit{"_deg", units::deg},
    Unit{"_rpm", units::rpm},
    Unit{"_inch", 25.4},
    Unit{"_min", 60.0},
    Unit{"_um", units::um},
    Unit{"_nm", units::nm},
    Unit{"_mm", 1.0},
    Unit{"_ms", 1e-3},
    Unit{"_kg", 1.0},
    Unit{"_Hz", 1.0},
    Unit{"_Nm_s", 1e3},
    Unit{"_Nm", 1e3},
    Unit{"_cm", 10.0},
    Unit{"_m", 1000.0},
    Unit{"_s", 1.0},
    Unit{"_h", 3600.0},
    Unit{"_W", 1.0},
    Unit{"_K", 1.0},
    Unit{"_C", 1.0},
    Unit{"_N", 1.0},
    Unit{"_A", 1.0},
};

const Unit* unit_at_end(std::string_view key) {
  for (const Unit& unit : known_units) {
    if (key.size() > unit.suffix.size() && key.ends_with(unit.suffix)) return &unit;
  }
  return nullptr;
}

std::string unit_name(std::string_view key) {
  const Unit* unit = unit_at_end(key);
  return unit ? std::string(unit->suffix.substr(1)) : std::string("no unit");
}

std::string range_text(const Range& range) {
  const double huge = std::numeric_limits<double>::max();
  std::string text;
  if (range.min > -huge) text += fmt::format(" {} {}", range.open_min ? ">" : ">=", range.min);
  if (range.max < huge) {
    text +=
        fmt::format("{} {} {}", text.empty() ? "" : " and", range.open_max ? "<" : "<=", range.max);
  }
  return text;
}

bool inside(double x, const Range& range) {
  return (range.open_min ? x > range.min : x >= range.min) &&
         (range.open_max ? x < range.max : x <= range.max);
}

bool is_beyond(double x, const Node& node, const std::string& name, Faults& faults) {
  if (std::abs(x) <= most_number) return false;
  faults.add(node.place, fmt::format("{} within +-{:g}", name, most_number), shown(node));
  return true;
}

std::string list_text(const std::set<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "\"" : ", \"") + word + "\"";
  return (words.size() == 1 ? "" : "one of ") + text;
}

}  // namespace

const Node* Node::find(std::string_view key) const {
  const Table* entries = table();
  if (!entries) return nullptr;
  for (const Entry& entry : *entries) {
    if (entry.key == key) return &entry.node;
  }
  return nullptr;
}

Node* Node::find(std::string_view key) { return const_cast<Node*>(std::as_const(*this).find(key)); }

Node parse_toml(std::string_view text, const std::string& file) {
  if (text.size() > max_toml_bytes) {
    throw BadInput(file, 0, 0, "at most 16 MiB", fmt::format("{} bytes", text.size()));
  }
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (const std::size_t nul = text.find('\0'); nul != std::string_view::npos) {
    refuse_text(place_at(text, nul, file), "text", "a NUL byte");
  }
  refuse_deep_keys(text, file);
  try {
    const ::toml::table table = ::toml::parse(text, std::string_view(file));
    Node node = Converter(std::make_shared<const std::string>(file)).node(table, 0);
    return node;
  } catch (const ::toml::parse_error& e) {
    const auto where = e.source().begin;
    std::string seen(e.description());  // "Error while parsing value: what it is about"
    if (const std::size_t colon = seen.find(": ");
        seen.starts_with("Error while") && colon != std::string::npos) {
      seen.erase(0, colon + 2);
    }
    throw BadInput(file, int(where.line), int(where.column), "valid TOML", seen);
  }
}

Node read_toml_file(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::error_code failure;
  if (!std::filesystem::is_regular_file(file, failure)) {
    throw BadInput(name, 0, 0, "a file that can be read",
                   std::filesystem::is_directory(file, failure) ? "a folder" : "no such file");
  }
  const std::uintmax_t size = std::filesystem::file_size(file, failure);
  if (!failure && size > max_toml_bytes) {
    throw BadInput(name, 0, 0, "at most 16 MiB", fmt::format("{} bytes", size));
  }
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw BadInput(name, 0, 0, "a file that can be read", "a failure while reading");
  return parse_toml(text.view(), name);
}

std::string to_toml_value(const std::string& text) {
  Node node;
  node.value = text;
  return to_toml_value(node);
}

std::string to_toml_value(const Node& node) {
  struct Writer {
    std::string operator()(bool v) const { return v ? "true" : "false"; }
    std::string operator()(std::int64_t v) const { return std::to_string(v); }
    std::string operator()(double v) const { return float_text(v); }
    std::string operator()(const std::string& v) const { return quoted_text(v); }
    std::string operator()(const TomlDate& v) const { return v.text; }
    std::string operator()(const Node::Array& v) const {
      std::string out = "[";
      for (const Node& element : v) out += (out.size() > 1 ? ", " : "") + to_toml_value(element);
      return out + "]";
    }
    std::string operator()(const Node::Table& v) const {
      std::string out = "{";
      for (const Node::Entry& entry : v) {
        out +=
            (out.size() > 1 ? ", " : " ") + key_text(entry.key) + " = " + to_toml_value(entry.node);
      }
      return out + " }";
    }
  };
  return std::visit(Writer{}, node.value);
}

std::string to_toml(const Node& table) {
  std::string out;
  write_section(table, "", out);
  return out;
}

std::string shown(const Node& node) {
  if (node.table()) return "a table";
  if (node.array()) return fmt::format("an array of {}", node.array()->size());
  std::string text = to_toml_value(node);
  if (text.size() > 60) {
    text.resize(57);
    while (!text.empty() && (static_cast<unsigned char>(text.back()) & 0xC0) == 0x80) {
      text.pop_back();
    }
    text += "...";
  }
  return text;
}

void Faults::add(const Place& place, const std::string& expected, const std::string& seen) {
  add(BadInput(place.file ? *place.file : "", place.line, place.column, expected, seen));
}

void Faults::add(const BadInput& fault) {
  const auto same = [&](const BadInput& other) {
    return std::string_view(other.what()) == std::string_view(fault.what());
  };
  if (list_.size() > max_faults || std::any_of(list_.begin(), list_.end(), same)) return;
  if (list_.size() == max_faults) {
    list_.emplace_back(fault.file, 0, 0, "fewer than 200 faults", "more, which are not listed");
    return;
  }
  list_.push_back(fault);
}

double unit_of(std::string_view key) {
  const Unit* unit = unit_at_end(key);
  return unit ? unit->factor : 1.0;
}

std::string_view stem_of(std::string_view key) {
  const Unit* unit = unit_at_end(key);
  return unit ? key.substr(0, key.size() - unit->suffix.size()) : key;
}

std::optional<std::string> nearest(std::string_view word, const std::set<std::string>& candidates) {
  if (word.size() > 80) return std::nullopt;
  std::optional<std::string> best;
  int best_distance = std::max(2, int(word.size()) / 2) + 1;
  for (const std::string& candidate : candidates) {
    const int distance = edit_distance(word, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

TableReader::TableReader(const Node& table, std::string where, Faults& faults)
    : table_(table), where_(std::move(where)), faults_(faults) {}

std::string TableReader::name_of(const std::string& key) const {
  return where_.empty() ? key : where_ + "." + key;
}

const Node* TableReader::know(const std::string& key) {
  known_.insert(key);
  return table_.find(key);
}

void TableReader::missing(const std::string& key, const std::string& kind) {
  known_.insert(key);
  missing_.emplace_back(key, kind);
}

void TableReader::refuse(const std::string& key, const std::string& expected,
                         const std::string& seen) {
  const Node* node = know(key);
  faults_.add(node ? node->place : table_.place, expected, seen);
}

std::optional<double> TableReader::finite(const Node& node, const std::string& key) {
  double value = 0.0;
  if (const double* real = std::get_if<double>(&node.value)) {
    value = *real;
  } else if (const std::int64_t* whole = std::get_if<std::int64_t>(&node.value)) {
    value = double(*whole);
  } else {
    faults_.add(node.place, "a number for " + name_of(key), shown(node));
    return std::nullopt;
  }
  if (!std::isfinite(value)) {
    faults_.add(node.place, "a finite number for " + name_of(key), shown(node));
    return std::nullopt;
  }
  return value;
}

std::optional<double> TableReader::number_as_written(const std::string& key, const Range& range) {
  const Node* node = know(key);
  if (!node) return std::nullopt;
  const std::optional<double> value = finite(*node, key);
  if (!value) return std::nullopt;
  if (!inside(*value, range)) {
    faults_.add(node->place, fmt::format("{}{}", name_of(key), range_text(range)), shown(*node));
    return std::nullopt;
  }
  if (is_beyond(*value, *node, name_of(key), faults_)) return std::nullopt;
  const bool divides = range.min == 0.0 && range.open_min;
  const double least = divides ? least_divisor : least_number;
  if (*value != 0.0 && std::abs(*value) < least) {
    faults_.add(node->place,
                fmt::format("{} of at least {:g}{}", name_of(key), least, divides ? "" : ", or 0"),
                shown(*node));
    return std::nullopt;
  }
  return value;
}

std::optional<double> TableReader::maybe_number(const std::string& key, const Range& range) {
  const std::optional<double> value = number_as_written(key, range);
  if (!value) return std::nullopt;
  return *value * unit_of(key);
}

double TableReader::number(const std::string& key, const Range& range) {
  const std::optional<double> value = maybe_number(key, range);
  if (!value && !has(key)) missing(key, "a number");
  return value.value_or(1.0);
}

double TableReader::number(const std::string& key, const Range& range, double fallback) {
  return maybe_number(key, range).value_or(fallback);
}

std::optional<std::int64_t> TableReader::maybe_integer(const std::string& key, std::int64_t min,
                                                       std::int64_t max) {
  const Node* node = know(key);
  if (!node) return std::nullopt;
  const std::int64_t* value = std::get_if<std::int64_t>(&node->value);
  if (!value || *value < min || *value > max) {
    faults_.add(node->place,
                fmt::format("a whole number from {} to {} for {}", min, max, name_of(key)),
                shown(*node));
    return std::nullopt;
  }
  return *value;
}

std::int64_t TableReader::integer(const std::string& key, std::int64_t min, std::int64_t max,
                                  std::int64_t fallback) {
  return maybe_integer(key, min, max).value_or(fallback);
}

bool TableReader::boolean(const std::string& key, bool fallback) {
  const Node* node = know(key);
  if (!node) return fallback;
  if (const bool* value = std::get_if<bool>(&node->value)) return *value;
  faults_.add(node->place, "true or false for " + name_of(key), shown(*node));
  return fallback;
}

std::string TableReader::text(const std::string& key, const std::string& fallback) {
  const Node* node = know(key);
  if (!node) return fallback;
  if (const std::string* value = node->text(); value && !value->empty()) return *value;
  faults_.add(node->place, "a text for " + name_of(key), shown(*node));
  return fallback;
}

std::string TableReader::text(const std::string& key) {
  if (!has(key)) missing(key, "a text");
  return text(key, "");
}

std::optional<Eigen::VectorXd> TableReader::numbers_as_written(const std::string& key, int size) {
  const Node* node = know(key);
  if (!node) return std::nullopt;
  const Node::Array* array = node->array();
  if (!array || array->empty() || (size > 0 && array->size() != std::size_t(size))) {
    const std::string wanted =
        size > 0 ? fmt::format("an array of {} numbers", size) : std::string("an array of numbers");
    faults_.add(node->place, wanted + " for " + name_of(key), shown(*node));
    return std::nullopt;
  }
  Eigen::VectorXd values(Eigen::Index(array->size()));
  bool good = true;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const Node& element = (*array)[std::size_t(i)];
    const std::optional<double> value = finite(element, key);
    good = good && value && !is_beyond(*value, element, name_of(key), faults_);
    values[i] = value.value_or(0.0);
  }
  if (!good) return std::nullopt;
  return values;
}

std::optional<Eigen::VectorXd> TableReader::maybe_numbers(const std::string& key, int size) {
  std::optional<Eigen::VectorXd> values = numbers_as_written(key, size);
  if (values) *values *= unit_of(key);
  return values;
}

Eigen::VectorXd TableReader::numbers(const std::string& key, int size) {
  const std::optional<Eigen::VectorXd> values = maybe_numbers(key, size);
  if (!values && !has(key)) missing(key, "an array of numbers");
  return values.value_or(Eigen::VectorXd::Zero(std::max(size, 1)));
}

Eigen::Vector3d TableReader::vector(const std::string& key) { return numbers(key, 3); }

Eigen::Vector3d TableReader::vector(const std::string& key, const Eigen::Vector3d& fallback) {
  return maybe_numbers(key, 3).value_or(fallback);
}

Eigen::Vector3d TableReader::direction(const std::string& key, const Eigen::Vector3d& fallback) {
  const std::optional<Eigen::VectorXd> values = maybe_numbers(key, 3);
  if (!values) return fallback;
  const double length = values->stableNorm();
  if (!(length > 1e-9)) {
    faults_.add(table_.find(key)->place, "a direction that is not zero for " + name_of(key),
                "length " + float_text(length));
    return fallback;
  }
  // Dividing a unit vector by a length of 1 - 1 ulp would change it: what is unit stays as it is.
  return std::abs(length - 1.0) < 1e-15 ? Eigen::Vector3d(*values)
                                        : Eigen::Vector3d(*values / length);
}

Eigen::Vector3d TableReader::direction(const std::string& key) {
  if (!has(key)) missing(key, "a direction of 3 numbers");
  return direction(key, Eigen::Vector3d::UnitX());
}

std::optional<std::string> TableReader::word_of(const std::string& key,
                                                const std::set<std::string>& words, bool required) {
  const Node* node = know(key);
  if (!node) {
    if (required) missing(key, list_text(words));
    return std::nullopt;
  }
  const std::string* word = node->text();
  if (word && words.contains(*word)) return *word;
  std::string seen = shown(*node);
  if (word) {
    if (const auto meant = nearest(*word, words)) seen += " (nearest: \"" + *meant + "\")";
  }
  faults_.add(node->place, list_text(words) + " for " + name_of(key), seen);
  return std::nullopt;
}

const Node* TableReader::section(const std::string& key) {
  const Node* node = know(key);
  if (!node || node->table()) return node;
  faults_.add(node->place, "a table for " + name_of(key), shown(*node));
  return nullptr;
}

std::vector<const Node*> TableReader::tables(const std::string& key) {
  const Node* node = know(key);
  if (!node) return {};
  if (node->table()) return {node};
  std::vector<const Node*> list;
  if (!node->array()) {
    faults_.add(node->place, "a list of tables for " + name_of(key), shown(*node));
    return list;
  }
  for (const Node& element : *node->array()) {
    if (element.table()) {
      list.push_back(&element);
    } else {
      faults_.add(element.place, "a table in " + name_of(key), shown(element));
    }
  }
  return list;
}

void TableReader::close() {
  std::set<std::string> explained;  // missing keys that an unknown one was meant to be
  const Node::Table* entries = table_.table();
  for (const Node::Entry& entry : entries ? *entries : Node::Table{}) {
    if (known_.contains(entry.key)) continue;
    const auto same_stem = std::find_if(known_.begin(), known_.end(), [&](const std::string& key) {
      return stem_of(key) == stem_of(entry.key) && !table_.find(key);
    });
    if (same_stem != known_.end()) {
      faults_.add(entry.place, fmt::format("{} in {}", name_of(*same_stem), unit_name(*same_stem)),
                  fmt::format("{} in {}", entry.key, unit_name(entry.key)));
      explained.insert(*same_stem);
    } else if (const auto meant = nearest(entry.key, known_)) {
      faults_.add(entry.place, "a known key (nearest: " + name_of(*meant) + ")", entry.key);
      if (edit_distance(entry.key, *meant) <= 2) explained.insert(*meant);
    } else {
      faults_.add(entry.place, where_.empty() ? "a known key" : "a known key of " + where_,
                  entry.key);
    }
  }
  for (const auto& [key, kind] : missing_) {
    if (!explained.contains(key))
      faults_.add(table_.place, kind + " for " + name_of(key), "nothing");
  }
  missing_.clear();
}

}  // namespace abbe::sim
