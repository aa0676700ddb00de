#include "sim/report/key_reference.h"

#include <algorithm>
#include <map>
#include <set>
#include <sstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/scene/table_reader.h"

namespace abbe::sim {

namespace {

/// Returns a range as text; empty if it is unlimited.
std::string range_of(const Range& range) {
  const double huge = std::numeric_limits<double>::max();
  const bool below = range.min > -huge, above = range.max < huge;
  if (!below && !above) return "";
  if (below && above && !range.open_min && !range.open_max)
    return fmt::format("{:.12g} to {:.12g}", range.min, range.max);
  std::string text;
  if (below) text += fmt::format("{} {:.12g}", range.open_min ? ">" : "≥", range.min);
  if (above)
    text += fmt::format("{}{} {:.12g}", text.empty() ? "" : ", ", range.open_max ? "<" : "≤",
                        range.max);
  return text;
}

/// Returns values as "a", "b" or "c".
std::string or_joined(const std::vector<Word>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    text += i == 0 ? "" : i + 1 == words.size() ? " or " : ", ";
    text += "\"" + words[i].word + "\"";
  }
  return text;
}

/// Returns the allowed values of a key as text.
std::string value_of(const Key& key) {
  using Kind = Key::Kind;
  const std::string file = key.or_file ? " or file" : "";
  const std::string range = range_of(key.range);
  switch (key.kind) {
    case Kind::Number:
      return range.empty() ? "number" : range;
    case Kind::Whole:
      // Ranges up to 2^53 or 2^63 only state what a number can hold.
      return key.range.max > 1e15 ? fmt::format("whole number ≥ {:.12g}", key.range.min)
                                  : "whole number, " + range;
    case Kind::Boolean:
      return "true or false";
    case Kind::Text:
      return key.words.empty() ? "text" : or_joined(key.words);
    case Kind::Numbers:
      return key.size > 0 ? fmt::format("{} numbers", key.size) : "list of numbers";
    case Kind::NumberOrNumbers:
      return (range.empty() ? "number" : range) + fmt::format(", or {} numbers", key.size);
    case Kind::Texts:
      return "list of texts";
    case Kind::Table:
      return "table" + file;
    case Kind::Tables:
      return "list of tables" + file;
    case Kind::Any:
      break;
  }
  return "";
}

/// Returns the unit that the name of a key ends in.
std::string key_unit(const Key& key) {
  const bool has_one = key.kind == Key::Kind::Number || key.kind == Key::Kind::Numbers ||
                       key.kind == Key::Kind::NumberOrNumbers;
  return has_one && key_stem(key.name) != key.name ? unit_name(key.name) : "";
}

/// Returns the meanings of the values of a key, if they are stated.
std::string words_text(const Key& key) {
  std::string text;
  for (const Word& word : key.words)
    if (!word.sentence.empty())
      text += fmt::format("{}\"{}\": {}", text.empty() ? "" : "; ", word.word, word.sentence);
  return text;
}

std::string joined(const std::string& path, const std::string& name) {
  return path.empty() ? name : path + "." + name;
}

/// Values of an enumeration that enable the same keys.
struct ValueGroup {
  std::vector<std::string> words;
  std::vector<Key> keys;
};

/// Returns true if two lists have the same keys with the same meaning.
bool are_equivalent(const std::vector<Key>& a, const std::vector<Key>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Key& x, const Key& y) {
    return x.name == y.name && x.sentence == y.sentence && x.fallback == y.fallback;
  });
}

/// Returns the values of a key, grouped by the keys that they enable.
std::vector<ValueGroup> groups_of(const Key& key) {
  std::vector<ValueGroup> groups;
  for (const Word& word : key.words) {
    const auto like = std::find_if(groups.begin(), groups.end(), [&](const ValueGroup& group) {
      return are_equivalent(group.keys, word.keys);
    });
    if (like == groups.end())
      groups.push_back({{word.word}, word.keys});
    else
      like->words.push_back(word.word);
  }
  return groups;
}

/// Returns `kind = "a" or "b"`, or the values that it must not have if these are fewer.
std::string condition_text(const Key& key, const ValueGroup& group) {
  std::vector<Word> own, others;
  for (const Word& word : key.words) {
    const bool in =
        std::find(group.words.begin(), group.words.end(), word.word) != group.words.end();
    (in ? own : others).push_back({word.word, "", {}});
  }
  if (others.empty()) return "";
  return own.size() <= others.size() ? key.name + " = " + or_joined(own)
                                     : key.name + " other than " + or_joined(others);
}

class Rows {
 public:
  void add(const std::vector<Key>& keys, const std::string& path, const std::string& when) {
    for (const Key& key : keys) add(key, path, when);
  }
  std::vector<KeyRow> rows;

 private:
  static constexpr std::size_t max_in_a_row = 7;  // values in one row; more get rows of their own

  void add(const Key& key, const std::string& path, const std::string& when) {
    const std::string own = joined(path, key.name);
    const bool apart = key.words.size() > max_in_a_row;
    const std::string words = apart ? "" : words_text(key);
    std::string sentence = key.sentence;
    if (!words.empty()) sentence += (sentence.empty() ? "" : ": ") + words;
    rows.push_back({own, when, key.required, key_unit(key), apart ? "a word" : value_of(key),
                    key.fallback, sentence});
    for (const Word& word : key.words)
      if (apart)
        rows.push_back({own + " = \"" + word.word + "\"", when, false, "", "", "", word.sentence});
    add(key.keys, own, "");
    for (const ValueGroup& group : groups_of(key))
      add(group.keys, path, condition_text(key, group));
  }
};

/// Returns true if a key has the name, or its pattern matches it.
bool has_key_name(const Key& key, const std::string& name) {
  if (key.name == name) return true;
  return !key.pattern.empty() && matches(name, key.pattern);
}

std::vector<std::string> parts_of(std::string_view path) {
  std::vector<std::string> parts;
  for (std::size_t from = 0; from <= path.size();) {
    const std::size_t dot = std::min(path.find('.', from), path.size());
    parts.emplace_back(path.substr(from, dot - from));
    from = dot + 1;
  }
  return parts;
}

struct Found {
  Key key;
  std::string path;  ///< path of its table
  std::string when;
};

/// Finds keys of a name, including keys that a value enables.
void find(const std::vector<Key>& keys, const std::string& name, const Found& in,
          std::vector<Found>& found) {
  for (const Key& key : keys) {
    if (has_key_name(key, name)) found.push_back({key, in.path, in.when});
    for (const Word& word : key.words)
      find(word.keys, name, {{}, in.path, fmt::format("{} = \"{}\"", key.name, word.word)}, found);
  }
}

/// Returns all keys at a path: values of an enumeration may enable different keys of one name.
std::vector<Found> found_at(const std::vector<Key>& keys, std::string_view path) {
  std::vector<Found> here{{{}, "", ""}};
  here.front().key.keys = keys;
  for (const std::string& part : parts_of(path)) {
    std::vector<Found> next;
    for (const Found& one : here) {
      const std::string own = joined(one.path, one.key.name);
      find(one.key.keys, part, {{}, own, ""}, next);
    }
    // A number that is no key is the index of a list.
    const bool index = part.find_first_not_of("0123456789") == std::string::npos;
    if (!next.empty() || !index) here = std::move(next);
  }
  return here;
}

/// Finds keys of a name at any level below.
void find_anywhere(const std::vector<Key>& keys, const std::string& name, const Found& in,
                   std::vector<Found>& found) {
  for (const Key& key : keys) {
    if (has_key_name(key, name)) found.push_back({key, in.path, in.when});
    find_anywhere(key.keys, name, {{}, joined(in.path, key.name), ""}, found);
    for (const Word& word : key.words)
      find_anywhere(word.keys, name, {{}, in.path, fmt::format("{} = \"{}\"", key.name, word.word)},
                    found);
  }
}

}  // namespace

std::vector<KeyRow> key_rows(const std::vector<Key>& keys, const std::string& path) {
  Rows rows;
  rows.add(keys, path, "");
  return std::move(rows.rows);
}

std::string to_text(const std::vector<KeyRow>& rows) {
  std::string text;
  for (const KeyRow& row : rows) {
    text += row.path;
    if (!row.when.empty()) text += "  where " + row.when;
    text += "\n    " + row.value + (row.unit.empty() ? "" : " (" + row.unit + ")");
    if (row.required) text += "; must be given";
    if (!row.fallback.empty()) text += "; default " + row.fallback;
    text += "\n";
    if (!row.sentence.empty()) text += "    " + row.sentence + "\n";
  }
  return text;
}

std::vector<Key> keys_at(const std::vector<Key>& keys, std::string_view path) {
  for (const Found& one : found_at(keys, path))
    if (!one.key.keys.empty()) return one.key.keys;
  return {};
}

std::vector<KeyRow> explained(const std::vector<Key>& keys, std::string_view question) {
  std::vector<Found> found = found_at(keys, question);
  // A bare name that is no key at the top may be one at any level.
  if (found.empty() && question.find('.') == std::string_view::npos)
    find_anywhere(keys, std::string(question), {}, found);
  std::vector<KeyRow> rows;
  for (const Found& one : found) {
    std::vector<KeyRow> own = key_rows({one.key}, one.path);
    own.front().when = one.when;
    // The same key of several values becomes one row with all its conditions.
    const auto like = std::find_if(rows.begin(), rows.end(), [&](const KeyRow& row) {
      return row.path == own.front().path && row.value == own.front().value &&
             row.fallback == own.front().fallback && row.sentence == own.front().sentence;
    });
    if (like == rows.end())
      rows.insert(rows.end(), own.begin(), own.end());
    else if (!one.when.empty())
      like->when += ", " + one.when.substr(one.when.find('"'));
  }
  return rows;
}

namespace {

using Json = nlohmann::ordered_json;

Json schema_object(const std::vector<Key>& keys);

/// Adds the limits of a number.
void add_range(Json& to, const Range& range) {
  const double huge = std::numeric_limits<double>::max();
  const auto bound = [&](const char* name, double value) {
    // Integers are written without exponent; beyond 1e15 a double no longer has every integer.
    if (std::abs(value) < 1e15 && value == std::round(value))
      to[name] = std::int64_t(value);
    else
      to[name] = value;
  };
  if (range.min > -huge) bound(range.open_min ? "exclusiveMinimum" : "minimum", range.min);
  if (range.max < huge) bound(range.open_max ? "exclusiveMaximum" : "maximum", range.max);
}

/// Returns the schema of an enumeration with the descriptions of its values.
Json enumeration_schema(const Key& key) {
  Json words = Json::array(), sentences = Json::array();
  for (const Word& word : key.words) {
    words.push_back(word.word);
    sentences.push_back(word.sentence);
  }
  // Taplo shows the descriptions of the values.
  return {{"enum", words}, {"x-taplo", {{"docs", {{"enumValues", sentences}}}}}};
}

Json number_of(const Key& key, const char* type) {
  Json number{{"type", type}};
  add_range(number, key.range);
  return number;
}

/// Returns the schema of a list of numbers; a list of any length has at least one.
Json numbers_of(const Key& key) {
  Json list{{"type", "array"}, {"items", {{"type", "number"}}}};
  list["minItems"] = std::max(key.size, 1);
  if (key.size > 0) list["maxItems"] = key.size;
  return list;
}

Json table_of(const Key& key) {
  const Json file{{"type", "string"}};
  const Json table = schema_object(key.keys);
  if (key.kind == Key::Kind::Table) return key.or_file ? Json{{"anyOf", {file, table}}} : table;
  const Json one = key.or_file ? Json{{"anyOf", {file, table}}} : table;
  // A list of tables may be a single table, as in the readers.
  Json any = Json::array({table, {{"type", "array"}, {"items", one}}});
  if (key.or_file) any.push_back(file);
  return {{"anyOf", any}};
}

Json schema_type(const Key& key) {
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
      return key.words.empty() ? text : enumeration_schema(key);
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

Json schema_property(const Key& key) {
  Json property = schema_type(key);
  std::string sentence = key.sentence;
  if (!key.fallback.empty()) sentence += " (default " + key.fallback + ")";
  property["description"] = sentence;
  return property;
}

/// Collects all keys of a table, including those that values enable.
void collect(const std::vector<Key>& keys, std::vector<const Key*>& all) {
  for (const Key& key : keys) {
    all.push_back(&key);
    for (const Word& word : key.words) collect(word.keys, all);
  }
}

/// Returns all keys of a table in one list.
std::vector<const Key*> collected(const std::vector<Key>& keys) {
  std::vector<const Key*> all;
  collect(keys, all);
  return all;
}

/// Adds a property. A key with different meanings for different values allows each of them.
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

/// Returns the names that match a pattern such as "(um|urad)_per_K"; the pattern itself if it has
/// no alternatives.
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

/// Returns the condition that a key is present.
Json schema_presence(const Key& key) {
  Json any = Json::array();
  for (const std::string& name : names_of(key.pattern.empty() ? key.name : key.pattern))
    any.push_back({{"required", {name}}});
  return any.size() == 1 ? any.front() : Json{{"anyOf", any}};
}

/// Adds required keys, exactly one key of a group of alternatives, and the requirements of values.
void add_requirements(Json& to, const std::vector<Key>& keys, const std::set<std::string>& shared) {
  Json required = Json::array(), all = Json::array();
  std::map<std::string, Json> either;
  for (const Key& key : keys) {
    if (key.required && key.pattern.empty()) required.push_back(key.name);
    if (!key.either.empty())
      either.try_emplace(key.either, Json::array()).first->second.push_back(schema_presence(key));
    std::set<std::string> brought;
    for (const Word& word : key.words)
      for (const Key* one : collected(word.keys))
        if (one->pattern.empty()) brought.insert(one->name);
    for (const Word& word : key.words) {
      if (brought.empty()) break;
      std::set<std::string> known = shared;
      for (const Key& one : keys) known.insert(one.name);
      for (const Key* one : collected(word.keys)) known.insert(one->name);
      // A key that only another value enables must be absent.
      Json then = Json::object();
      for (const std::string& name : brought)
        if (!known.contains(name)) then["properties"][name] = false;
      add_requirements(then, word.keys, known);
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

/// Returns the schema of a table. Keys that are not listed are errors, as in the readers.
Json schema_object(const std::vector<Key>& keys) {
  Json object{{"type", "object"}, {"additionalProperties", false}};
  object["properties"] = Json::object();
  for (const Key* key : collected(keys)) {
    const bool many = !key->pattern.empty();
    add_property(many ? object["patternProperties"] : object["properties"],
                 many ? "^(" + key->pattern + ")$" : key->name, schema_property(*key));
  }
  for (auto& [name, property] : object["properties"].items()) property.erase("x-alternatives");
  add_requirements(object, keys, {});
  return object;
}

}  // namespace

nlohmann::ordered_json schema(const std::vector<Key>& keys, const std::string& title) {
  Json root{{"$schema", "http://json-schema.org/draft-07/schema#"}, {"title", title}};
  root.update(schema_object(keys));
  return root;
}

}  // namespace abbe::sim
