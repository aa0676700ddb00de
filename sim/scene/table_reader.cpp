#include "sim/scene/table_reader.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace abbe::sim {

namespace {

// In the unit of any key a number beyond is a mistake, and products of a few stay finite. Travel
// without an end is 1e9 rad.
constexpr double most_number = 1e12;
// What is nearer to zero is zero, or a mistake; what divides must not make infinities.
constexpr double least_number = 1e-100, least_divisor = 1e-12;

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

std::vector<std::string> TableReader::texts(const std::string& key) {
  std::vector<std::string> all;
  const Node* list = know(key);
  if (!list) return all;
  if (list->text()) return {*list->text()};
  if (!list->array()) refuse(key, "a list of texts", shown(*list));
  for (const Node& one : list->array() ? *list->array() : Node::Array{}) {
    if (one.text())
      all.push_back(*one.text());
    else
      faults_.add(one.place, "a text", shown(one));
  }
  return all;
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
                "length " + to_toml_value(length));
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

std::optional<std::string> TableReader::word(const std::string& key,
                                             const std::set<std::string>& words, bool required) {
  const Node* node = know(key);
  if (!node) {
    if (required) missing(key, list_text(words));
    return std::nullopt;
  }
  const std::string* seen_word = node->text();
  if (seen_word && words.contains(*seen_word)) return *seen_word;
  std::string seen = shown(*node);
  if (seen_word) {
    if (const auto meant = nearest(*seen_word, words)) seen += " (nearest: \"" + *meant + "\")";
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
