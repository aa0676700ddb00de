#include "sim/report/schema.h"

#include <map>
#include <set>
#include <sstream>

#include <nlohmann/json.hpp>

namespace abbe::sim {

namespace {

using Json = nlohmann::ordered_json;

Json object_of(const std::vector<Key>& keys);

void add_range(Json& to, const Range& range) {
  const double huge = std::numeric_limits<double>::max();
  const auto bound = [&](const char* name, double value) {
    if (std::abs(value) < 1e15 && value == std::round(value))
      to[name] = std::int64_t(value);
    else
      to[name] = value;
  };
  if (range.min > -huge) bound(range.open_min ? "exclusiveMinimum" : "minimum", range.min);
  if (range.max < huge) bound(range.open_max ? "exclusiveMaximum" : "maximum", range.max);
}

Json words_of_text(const Key& key) {
  Json words = Json::array(), sentences = Json::array();
  for (const Word& word : key.words) {
    words.push_back(word.word);
    sentences.push_back(word.sentence);
  }
  return {{"enum", words}, {"x-taplo", {{"docs", {{"enumValues", sentences}}}}}};
}

Json number_of(const Key& key, const char* type) {
  Json number{{"type", type}};
  add_range(number, key.range);
  return number;
}

Json numbers_of(const Key& key) {
  Json list{{"type", "array"}, {"items", {{"type", "number"}}}};
  list["minItems"] = std::max(key.size, 1);
  if (key.size > 0) list["maxItems"] = key.size;
  return list;
}

Json table_of(const Key& key) {
  const Json file{{"type", "string"}};
  const Json table = object_of(key.keys);
  if (key.kind == Key::Kind::Table) return key.or_file ? Json{{"anyOf", {file, table}}} : table;
  const Json one = key.or_file ? Json{{"anyOf", {file, table}}} : table;
  Json any = Json::array({table, {{"type", "array"}, {"items", one}}});
  if (key.or_file) any.push_back(file);
  return {{"anyOf", any}};
}

Json type_of(const Key& key) {
  using Kind = Key::Kind;
  const Json text{{"type", "string"}, {"minLength", 1}};
  switch (key.kind) {
    case Kind::Number:
      return number_of(key, "number");
    case Kind::Whole:
      return number_of(key, "integer");
    case Kind::Boolean:
      return {{"type", "boolean"}};
    case Kind::Text:
      return key.words.empty() ? text : words_of_text(key);
    case Kind::Numbers:
      return numbers_of(key);
    case Kind::NumberOrNumbers:
      return {{"anyOf", {number_of(key, "number"), numbers_of(key)}}};
    case Kind::Texts:
      return {{"anyOf", {text, {{"type", "array"}, {"items", text}}}}};
    case Kind::Table:
    case Kind::Tables:
      return table_of(key);
    case Kind::Any:
      break;
  }
  return Json::object();
}

Json property_of(const Key& key) {
  Json property = type_of(key);
  std::string sentence = key.sentence;
  if (!key.fallback.empty()) sentence += " (default " + key.fallback + ")";
  property["description"] = sentence;
  return property;
}

/// All keys of a table, those that words bring too.
void collect(const std::vector<Key>& keys, std::vector<const Key*>& all) {
  for (const Key& key : keys) {
    all.push_back(&key);
    for (const Word& word : key.words) collect(word.keys, all);
  }
}

std::vector<const Key*> collected(const std::vector<Key>& keys) {
  std::vector<const Key*> all;
  collect(keys, all);
  return all;
}

void add_property(Json& properties, const std::string& name, Json property) {
  if (!properties.contains(name)) {
    properties[name] = std::move(property);
  } else if (properties[name] != property) {
    Json& had = properties[name];
    if (!had.contains("x-alternatives"))
      had = Json{{"anyOf", Json::array({had})}, {"x-alternatives", true}};
    had["anyOf"].push_back(std::move(property));
  }
}

/// Names that a pattern such as "(um|urad)_per_K" has; the pattern itself if it has others.
std::vector<std::string> names_of(const std::string& pattern) {
  const std::size_t open = pattern.find('('), close = pattern.find(')');
  if (open == std::string::npos || close < open) return {pattern};
  std::vector<std::string> names;
  std::istringstream words(pattern.substr(open + 1, close - open - 1));
  for (std::string word; std::getline(words, word, '|');)
    for (const std::string& rest : names_of(pattern.substr(close + 1)))
      names.push_back(pattern.substr(0, open) + word + rest);
  return names;
}

/// That a key is there.
Json presence_of(const Key& key) {
  Json any = Json::array();
  for (const std::string& name : names_of(key.pattern.empty() ? key.name : key.pattern))
    any.push_back({{"required", {name}}});
  return any.size() == 1 ? any.front() : Json{{"anyOf", any}};
}

/// Required keys, exactly one of those that exclude each other, and what words ask.
void add_demands(Json& to, const std::vector<Key>& keys, const std::set<std::string>& shared) {
  Json required = Json::array(), all = Json::array();
  std::map<std::string, Json> either;
  for (const Key& key : keys) {
    if (key.required && key.pattern.empty()) required.push_back(key.name);
    if (!key.either.empty())
      either.try_emplace(key.either, Json::array()).first->second.push_back(presence_of(key));
    std::set<std::string> brought;
    for (const Word& word : key.words)
      for (const Key* one : collected(word.keys))
        if (one->pattern.empty()) brought.insert(one->name);
    for (const Word& word : key.words) {
      if (brought.empty()) break;
      std::set<std::string> known = shared;
      for (const Key& one : keys) known.insert(one.name);
      for (const Key* one : collected(word.keys)) known.insert(one->name);
      Json then = Json::object();
      for (const std::string& name : brought)
        if (!known.contains(name)) then["properties"][name] = false;
      add_demands(then, word.keys, known);
      if (!then.empty())
        all.push_back(
            {{"if",
              {{"properties", {{key.name, {{"const", word.word}}}}}, {"required", {key.name}}}},
             {"then", then}});
    }
  }
  for (const auto& [name, one_of] : either) all.push_back({{"oneOf", one_of}});
  if (!required.empty()) to["required"] = required;
  if (!all.empty()) to["allOf"] = all;
}

Json object_of(const std::vector<Key>& keys) {
  Json object{{"type", "object"}, {"additionalProperties", false}};
  object["properties"] = Json::object();
  for (const Key* key : collected(keys)) {
    const bool many = !key->pattern.empty();
    add_property(many ? object["patternProperties"] : object["properties"],
                 many ? "^(" + key->pattern + ")$" : key->name, property_of(*key));
  }
  for (auto& [name, property] : object["properties"].items()) property.erase("x-alternatives");
  add_demands(object, keys, {});
  return object;
}

}  // namespace

nlohmann::ordered_json schema(const std::vector<Key>& keys, const std::string& title) {
  Json root{{"$schema", "http://json-schema.org/draft-07/schema#"}, {"title", title}};
  root.update(object_of(keys));
  return root;
}

}  // namespace abbe::sim
