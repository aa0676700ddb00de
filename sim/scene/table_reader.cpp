#include "sim/scene/table_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <regex>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim {

bool matches(const std::string& text, const std::string& pattern) {
  return std::regex_match(text, std::regex(pattern));
}

int edit_distance(std::string_view a, std::string_view b) {
  // One row of the distance matrix is enough, since each row depends only on the one above.
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

std::optional<std::string> nearest(std::string_view word, const std::set<std::string>& candidates) {
  // The edit distance takes quadratic time, and no key has more than 80 characters.
  if (word.size() > 80) return std::nullopt;
  // A word that begins a candidate is more likely an abbreviation than a misspelling, so that
  // candidate is preferred.
  constexpr std::size_t min_abbreviation = 2;
  if (word.size() >= min_abbreviation)
    for (const std::string& candidate : candidates)
      if (candidate.starts_with(word)) return candidate;
  std::optional<std::string> nearest_candidate;
  // Up to half of the letters may differ; beyond that, the words are unrelated.
  int min_distance = std::max(2, int(word.size()) / 2) + 1;
  for (const std::string& candidate : candidates) {
    const int distance = edit_distance(word, candidate);
    if (distance < min_distance) {
      min_distance = distance;
      nearest_candidate = candidate;
    }
  }
  return nearest_candidate;
}

std::string missing_file_text(const std::filesystem::path& file) {
  // The limit keeps a folder with very many files from delaying the message.
  constexpr std::size_t max_compared = 1000;
  namespace fs = std::filesystem;
  std::set<std::string> names;
  std::error_code error_code;
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  for (fs::directory_iterator entry(folder, error_code), end; !error_code && entry != end;
       entry.increment(error_code)) {
    if (entry->is_regular_file(error_code)) names.insert(entry->path().filename().string());
    if (names.size() == max_compared) break;
  }
  const auto suggestion = nearest(file.filename().string(), names);
  return "no file " + file.string() + (suggestion ? " (nearest: \"" + *suggestion + "\")" : "");
}

namespace {

struct Unit {
  std::string_view suffix;
  double factor;  // of the unit in mm, rad, s, N, K, kg, W or A
};
// A suffix must precede every shorter suffix with which it ends: "_mm_per_min" precedes "_min".
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
    Unit{"_um_urad", 1.0},  // um or urad, according to the element of each number
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
    Unit{"_inch", units::inch},
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

/// Returns the unit in which a key ends; null if there is none.
const Unit* trailing_unit(std::string_view key) {
  for (const Unit& unit : known_units) {
    // A key that is nothing but a unit has no stem, so it counts as a key without unit.
    if (key.size() > unit.suffix.size() && key.ends_with(unit.suffix)) return &unit;
  }
  return nullptr;
}

}  // namespace

double unit_factor(std::string_view key) {
  const Unit* unit = trailing_unit(key);
  return unit ? unit->factor : 1.0;
}

std::string_view key_without_unit(std::string_view key) {
  const Unit* unit = trailing_unit(key);
  return unit ? key.substr(0, key.size() - unit->suffix.size()) : key;
}

std::string unit_name(std::string_view key) {
  const Unit* unit = trailing_unit(key);
  return unit ? std::string(unit->suffix.substr(1)) : std::string("no unit");
}

namespace {

// Larger numbers are mistakes in any unit, and products of a few numbers up to this bound stay
// finite. An endless rotary axis has a travel of 1e9 rad.
constexpr double max_number = 1e12;
// Smaller numbers are mistakes, and a division by them could give infinity.
constexpr double min_number = 1e-100, min_divisor = 1e-12;

/// Returns a range as text for messages, such as " >= 0 and < 5".
std::string range_text(const Range& range) {
  // A bound at the limit of double means that there is none.
  const double no_bound = std::numeric_limits<double>::max();
  std::string text;
  if (range.min > -no_bound) text += fmt::format(" {} {}", range.open_min ? ">" : ">=", range.min);
  if (range.max < no_bound) {
    text +=
        fmt::format("{} {} {}", text.empty() ? "" : " and", range.open_max ? "<" : "<=", range.max);
  }
  return text;
}

bool contains(const Range& range, double x) {
  return (range.open_min ? x > range.min : x >= range.min) &&
         (range.open_max ? x < range.max : x <= range.max);
}

/// Returns true if a number is within +-max_number; otherwise adds an input error.
bool check_magnitude(double x, const Node& node, const std::string& name,
                     InputErrors& input_errors) {
  if (std::abs(x) <= max_number) return true;
  input_errors.add(node.position, fmt::format("{} within +-{:g}", name, max_number),
                   display_text(node));
  return false;
}

std::string list_text(const std::set<std::string>& choices) {
  std::string text;
  for (const std::string& word : choices) text += (text.empty() ? "\"" : ", \"") + word + "\"";
  return (choices.size() == 1 ? "" : "one of ") + text;
}

}  // namespace

TableReader::TableReader(const Node& table, std::string section_name, InputErrors& input_errors)
    : table_(table), section_name_(std::move(section_name)), input_errors_(input_errors) {}

std::string TableReader::qualified_name(const std::string& key) const {
  return section_name_.empty() ? key : section_name_ + "." + key;
}

const Node* TableReader::accept_key(const std::string& key) {
  known_keys_.insert(key);
  return table_.find(key);
}

void TableReader::report_missing(const std::string& key, const std::string& kind) {
  known_keys_.insert(key);
  missing_keys_.emplace_back(key, kind);
}

void TableReader::report_invalid(const std::string& key, const std::string& expected,
                                 const std::string& seen) {
  const Node* node = accept_key(key);
  input_errors_.add(node ? node->position : table_.position, expected, seen);
}

std::optional<double> TableReader::finite_number(const Node& node, const std::string& key) {
  double value = 0.0;
  if (const double* real = std::get_if<double>(&node.value)) {
    value = *real;
  } else if (const std::int64_t* whole = std::get_if<std::int64_t>(&node.value)) {
    // TOML distinguishes integers from real numbers, but users write 5 for 5.0.
    value = double(*whole);
  } else {
    input_errors_.add(node.position, "a number for " + qualified_name(key), display_text(node));
    return std::nullopt;
  }
  if (!std::isfinite(value)) {
    input_errors_.add(node.position, "a finite number for " + qualified_name(key),
                      display_text(node));
    return std::nullopt;
  }
  return value;
}

std::optional<double> TableReader::number_as_written(const std::string& key, const Range& range) {
  const Node* node = accept_key(key);
  if (!node) return std::nullopt;
  const std::optional<double> value = finite_number(*node, key);
  if (!value) return std::nullopt;
  if (!contains(range, *value)) {
    input_errors_.add(node->position, fmt::format("{}{}", qualified_name(key), range_text(range)),
                      display_text(*node));
    return std::nullopt;
  }
  if (!check_magnitude(*value, *node, qualified_name(key), input_errors_)) return std::nullopt;
  // The models divide by quantities whose range excludes zero.
  const bool is_divisor = range.min == 0.0 && range.open_min;
  const double min_magnitude = is_divisor ? min_divisor : min_number;
  if (*value != 0.0 && std::abs(*value) < min_magnitude) {
    input_errors_.add(node->position,
                      fmt::format("{} of at least {:g}{}", qualified_name(key), min_magnitude,
                                  is_divisor ? "" : ", or 0"),
                      display_text(*node));
    return std::nullopt;
  }
  return value;
}

std::optional<double> TableReader::maybe_number(const std::string& key, const Range& range) {
  const std::optional<double> value = number_as_written(key, range);
  if (!value) return std::nullopt;
  return *value * unit_factor(key);
}

double TableReader::number(const std::string& key, const Range& range) {
  const std::optional<double> value = maybe_number(key, range);
  // A key that is present but invalid is reported already.
  if (!value && !has(key)) report_missing(key, "a number");
  // 1 is harmless as a factor, a divisor and a length until the input error is thrown.
  return value.value_or(1.0);
}

double TableReader::number(const std::string& key, const Range& range, double fallback) {
  return maybe_number(key, range).value_or(fallback);
}

std::optional<std::int64_t> TableReader::maybe_integer(const std::string& key, std::int64_t min,
                                                       std::int64_t max) {
  const Node* node = accept_key(key);
  if (!node) return std::nullopt;
  const std::int64_t* value = std::get_if<std::int64_t>(&node->value);
  if (!value || *value < min || *value > max) {
    input_errors_.add(node->position,
                      fmt::format("an integer from {} to {} for {}", min, max, qualified_name(key)),
                      display_text(*node));
    return std::nullopt;
  }
  return *value;
}

std::int64_t TableReader::integer(const std::string& key, std::int64_t min, std::int64_t max,
                                  std::int64_t fallback) {
  return maybe_integer(key, min, max).value_or(fallback);
}

bool TableReader::boolean(const std::string& key, bool fallback) {
  const Node* node = accept_key(key);
  if (!node) return fallback;
  if (const bool* value = std::get_if<bool>(&node->value)) return *value;
  input_errors_.add(node->position, "true or false for " + qualified_name(key),
                    display_text(*node));
  return fallback;
}

std::string TableReader::text(const std::string& key, const std::string& fallback) {
  const Node* node = accept_key(key);
  if (!node) return fallback;
  if (const std::string* value = node->text(); value && !value->empty()) return *value;
  input_errors_.add(node->position, "a string for " + qualified_name(key), display_text(*node));
  return fallback;
}

std::string TableReader::text(const std::string& key) {
  if (!has(key)) report_missing(key, "a string");
  return text(key, "");
}

std::vector<std::string> TableReader::texts(const std::string& key) {
  const Node* list = accept_key(key);
  if (!list) return {};
  if (list->text()) return {*list->text()};
  if (!list->array()) report_invalid(key, "a list of strings", display_text(*list));
  std::vector<std::string> texts;
  for (const Node& element : list->array() ? *list->array() : Node::Array{}) {
    if (element.text())
      texts.push_back(*element.text());
    else
      input_errors_.add(element.position, "a string", display_text(element));
  }
  return texts;
}

std::optional<Eigen::VectorXd> TableReader::numbers_as_written(const std::string& key, int size) {
  const Node* node = accept_key(key);
  if (!node) return std::nullopt;
  const Node::Array* array = node->array();
  if (!array || array->empty() || (size > 0 && array->size() != std::size_t(size))) {
    const std::string expected =
        size > 0 ? fmt::format("an array of {} numbers", size) : std::string("an array of numbers");
    input_errors_.add(node->position, expected + " for " + qualified_name(key),
                      display_text(*node));
    return std::nullopt;
  }
  Eigen::VectorXd values(Eigen::Index(array->size()));
  bool are_valid = true;
  // All elements are examined, so that every invalid number is reported.
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const Node& element = (*array)[std::size_t(i)];
    const std::optional<double> value = finite_number(element, key);
    are_valid =
        are_valid && value && check_magnitude(*value, element, qualified_name(key), input_errors_);
    values[i] = value.value_or(0.0);
  }
  if (!are_valid) return std::nullopt;
  return values;
}

std::optional<Eigen::VectorXd> TableReader::maybe_numbers(const std::string& key, int size) {
  std::optional<Eigen::VectorXd> values = numbers_as_written(key, size);
  if (values) *values *= unit_factor(key);
  return values;
}

Eigen::VectorXd TableReader::numbers(const std::string& key, int size) {
  const std::optional<Eigen::VectorXd> values = maybe_numbers(key, size);
  if (!values && !has(key)) report_missing(key, "an array of numbers");
  return values.value_or(Eigen::VectorXd::Zero(std::max(size, 1)));
}

Eigen::Vector3d TableReader::vector(const std::string& key) { return numbers(key, 3); }

Eigen::Vector3d TableReader::vector(const std::string& key, const Eigen::Vector3d& fallback) {
  return maybe_numbers(key, 3).value_or(fallback);
}

Eigen::Vector3d TableReader::direction(const std::string& key, const Eigen::Vector3d& fallback) {
  const std::optional<Eigen::VectorXd> values = maybe_numbers(key, 3);
  if (!values) return fallback;
  // stableNorm() avoids the underflow of the square of a very small number.
  const double length = values->stableNorm();
  if (!(length > 1e-9)) {
    input_errors_.add(table_.find(key)->position, "a nonzero direction for " + qualified_name(key),
                      "length " + to_toml_value(length));
    return fallback;
  }
  // A unit vector may have a computed length of 1 - 1 ulp and must keep its bits.
  return std::abs(length - 1.0) < 1e-15 ? Eigen::Vector3d(*values)
                                        : Eigen::Vector3d(*values / length);
}

Eigen::Vector3d TableReader::direction(const std::string& key) {
  if (!has(key)) report_missing(key, "a direction of 3 numbers");
  return direction(key, Eigen::Vector3d::UnitX());
}

std::optional<std::string> TableReader::word(const std::string& key,
                                             const std::set<std::string>& choices, bool required) {
  const Node* node = accept_key(key);
  if (!node) {
    if (required) report_missing(key, list_text(choices));
    return std::nullopt;
  }
  const std::string* text = node->text();
  if (text && choices.contains(*text)) return *text;
  std::string seen = display_text(*node);
  if (text) {
    if (const auto suggestion = nearest(*text, choices))
      seen += " (nearest: \"" + *suggestion + "\")";
  }
  input_errors_.add(node->position, list_text(choices) + " for " + qualified_name(key), seen);
  return std::nullopt;
}

const Node* TableReader::section(const std::string& key) {
  const Node* node = accept_key(key);
  if (!node || node->table()) return node;
  input_errors_.add(node->position, "a table for " + qualified_name(key), display_text(*node));
  return nullptr;
}

std::vector<const Node*> TableReader::tables(const std::string& key) {
  const Node* node = accept_key(key);
  if (!node) return {};
  if (node->table()) return {node};
  std::vector<const Node*> list;
  if (!node->array()) {
    input_errors_.add(node->position, "a list of tables for " + qualified_name(key),
                      display_text(*node));
    return list;
  }
  for (const Node& element : *node->array()) {
    if (element.table()) {
      list.push_back(&element);
    } else {
      input_errors_.add(element.position, "a table in " + qualified_name(key),
                        display_text(element));
    }
  }
  return list;
}

void TableReader::close() {
  std::set<std::string> misspelled;  // missing keys that probably appear as unknown keys
  const Node::Table* entries = table_.table();
  for (const Node::Entry& entry : entries ? *entries : Node::Table{}) {
    if (known_keys_.contains(entry.key)) continue;
    // A key with the same stem is probably the right quantity in a wrong unit.
    const auto key_with_same_stem =
        std::find_if(known_keys_.begin(), known_keys_.end(), [&](const std::string& key) {
          return key_without_unit(key) == key_without_unit(entry.key) && !table_.find(key);
        });
    if (key_with_same_stem != known_keys_.end()) {
      input_errors_.add(entry.position,
                        fmt::format("{} in {}", qualified_name(*key_with_same_stem),
                                    unit_name(*key_with_same_stem)),
                        fmt::format("{} in {}", entry.key, unit_name(entry.key)));
      misspelled.insert(*key_with_same_stem);
    } else if (const auto suggestion = nearest(entry.key, known_keys_)) {
      input_errors_.add(entry.position,
                        "a known key (nearest: " + qualified_name(*suggestion) + ")", entry.key);
      // An unknown key within two edits is a misspelling; the missing key is not reported as well.
      if (edit_distance(entry.key, *suggestion) <= 2) misspelled.insert(*suggestion);
    } else {
      input_errors_.add(entry.position,
                        section_name_.empty() ? "a known key" : "a known key of " + section_name_,
                        entry.key);
    }
  }
  for (const auto& [key, kind] : missing_keys_) {
    if (!misspelled.contains(key))
      input_errors_.add(table_.position, kind + " for " + qualified_name(key), "nothing");
  }
  missing_keys_.clear();
}

}  // namespace abbe::sim
