#include "sim/scene/fields.h"

#include <cmath>
#include <cstdlib>
#include <limits>

#include <fmt/format.h>

#include "kinematics/numbers.h"

namespace abbe::sim {

KeyName KeyName::otherwise(std::string text) const {
  KeyName with = *this;
  with.fallback = std::move(text);
  return with;
}

KeyName KeyName::one_of(std::string group) const {
  KeyName with = *this;
  with.either = std::move(group);
  return with;
}

KeyName must(KeyName key) {
  key.required = true;
  return key;
}

Key key_of(const KeyName& name, Key::Kind kind, const char* sentence, std::vector<Key> keys) {
  Key key;
  key.name = name.name;
  key.sentence = sentence;
  key.kind = kind;
  key.required = name.required;
  key.fallback = name.fallback;
  key.either = name.either;
  key.keys = std::move(keys);
  return key;
}

Key key_of_numbers(const KeyName& name, int size, const char* sentence) {
  Key key = key_of(name, Key::Kind::Numbers, sentence);
  key.size = size;
  return key;
}

std::set<std::string> words_of(const Key& key) {
  std::set<std::string> words;
  for (const Word& one : key.words) words.insert(one.word);
  return words;
}

double in_unit(double value, double unit) {
  const double divided = value / unit;
  const double few = std::strtod(fmt::format("{:.15g}", divided).c_str(), nullptr);
  for (const double number :
       {few, divided, std::nextafter(divided, infinity), std::nextafter(divided, -infinity)})
    if (number * unit == value) return number;
  return divided;
}

std::vector<Key> with_other_unit(std::vector<Key> keys, const std::string& unit,
                                 const std::string& other) {
  const std::string either = "_(" + unit + "|" + other + ")_";
  for (Key& key : keys) {
    std::string names = "_" + (key.pattern.empty() ? key.name : key.pattern) + "_";
    if (const std::size_t at = names.find("_" + unit + "_"); at != std::string::npos) {
      names.replace(at, unit.size() + 2, either);
      key.pattern = names.substr(1, names.size() - 2);
    }
    key.keys = with_other_unit(std::move(key.keys), unit, other);
    for (Word& word : key.words) word.keys = with_other_unit(std::move(word.keys), unit, other);
  }
  return keys;
}

void know_all(TableReader& reader, const std::vector<Word>& words) {
  for (const Word& word : words)
    for (const Key& key : word.keys) {
      reader.know(key.name);
      know_all(reader, key.words);
    }
}

void put_numbers(Node::Table& table, const std::string& key, const Eigen::VectorXd& values,
                 double unit) {
  Node::Array numbers;
  for (const double value : values) numbers.push_back(Node{{}, in_unit(value, unit)});
  put(table, key, std::move(numbers));
}

void put_all(Node::Table& table, Node::Table entries) {
  for (Node::Entry& entry : entries) table.push_back(std::move(entry));
}

std::string shown_default(double value) {
  return std::abs(value) < 1e300 ? fmt::format("{:.12g}", value) : "";
}

std::string shown_default(const Eigen::VectorXd& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ", ") + shown_default(value);
  return "[" + text + "]";
}

}  // namespace abbe::sim
