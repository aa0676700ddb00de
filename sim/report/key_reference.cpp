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
std::string range_text(const Range& range) {
  const double unlimited = std::numeric_limits<double>::max();
  const bool has_min = range.min > -unlimited, has_max = range.max < unlimited;
  if (!has_min && !has_max) return "";
  if (has_min && has_max && !range.open_min && !range.open_max)
    return fmt::format("{:.12g} to {:.12g}", range.min, range.max);
  std::string text;
  if (has_min) text += fmt::format("{} {:.12g}", range.open_min ? ">" : "≥", range.min);
  if (has_max)
    text += fmt::format("{}{} {:.12g}", text.empty() ? "" : ", ", range.open_max ? "<" : "≤",
                        range.max);
  return text;
}

/// Returns quoted values joined by "or": "a", "b" or "c".
std::string or_joined(const std::vector<EnumChoice>& values) {
  std::string text;
  for (std::size_t i = 0; i < values.size(); ++i) {
    text += i == 0 ? "" : i + 1 == values.size() ? " or " : ", ";
    text += "\"" + values[i].word + "\"";
  }
  return text;
}

/// Returns the allowed values of a key as text.
std::string allowed_values(const Key& key) {
  using Kind = Key::Kind;
  const std::string file = key.or_file ? " or file" : "";
  const std::string range = range_text(key.range);
  switch (key.kind) {
    case Kind::Number:
      return range.empty() ? "number" : range;
    case Kind::Whole:
      // Limits of 2^53 or 2^63 are those of the number type, not of the key.
      return key.range.max > 1e15 ? fmt::format("integer ≥ {:.12g}", key.range.min)
                                  : "integer, " + range;
    case Kind::Boolean:
      return "true or false";
    case Kind::Text:
      return key.choices.empty() ? "string" : or_joined(key.choices);
    case Kind::Numbers:
      return key.size > 0 ? fmt::format("{} numbers", key.size) : "list of numbers";
    case Kind::NumberOrNumbers:
      return (range.empty() ? "number" : range) + fmt::format(", or {} numbers", key.size);
    case Kind::Texts:
      return "list of strings";
    case Kind::Table:
      return "table" + file;
    case Kind::Tables:
      return "list of tables" + file;
    case Kind::Any:
      break;
  }
  return "";
}

/// Returns the unit in the suffix of a key's name; empty if there is none.
std::string key_unit(const Key& key) {
  const bool is_numeric = key.kind == Key::Kind::Number || key.kind == Key::Kind::Numbers ||
                          key.kind == Key::Kind::NumberOrNumbers;
  return is_numeric && key_without_unit(key.name) != key.name ? unit_name(key.name) : "";
}

/// Returns the descriptions of the values of a key; empty if there are none.
std::string value_descriptions(const Key& key) {
  std::string text;
  for (const EnumChoice& choice : key.choices)
    if (!choice.sentence.empty())
      text += fmt::format("{}\"{}\": {}", text.empty() ? "" : "; ", choice.word, choice.sentence);
  return text;
}

/// Returns the dotted path of a key in the table at `path`.
std::string key_path(const std::string& path, const std::string& name) {
  return path.empty() ? name : path + "." + name;
}

/// Values of an enumeration that enable the same keys.
struct ValueGroup {
  std::vector<std::string> values;
  std::vector<Key> keys;
};

/// Returns true if two lists have the same keys with the same meaning.
bool are_equivalent(const std::vector<Key>& a, const std::vector<Key>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Key& x, const Key& y) {
    return x.name == y.name && x.sentence == y.sentence && x.fallback == y.fallback;
  });
}

/// Returns the values of a key, grouped by the keys that they enable.
std::vector<ValueGroup> value_groups(const Key& key) {
  std::vector<ValueGroup> groups;
  for (const EnumChoice& choice : key.choices) {
    const auto match = std::find_if(groups.begin(), groups.end(), [&](const ValueGroup& group) {
      return are_equivalent(group.keys, choice.keys);
    });
    if (match == groups.end())
      groups.push_back({{choice.word}, choice.keys});
    else
      match->values.push_back(choice.word);
  }
  return groups;
}

/// Returns the condition that enables the keys of a group: `kind = "a" or "b"`, or `kind other than
/// "c"` if fewer values are excluded. Empty if all values enable them.
std::string condition_text(const Key& key, const ValueGroup& group) {
  std::vector<EnumChoice> included, excluded;
  for (const EnumChoice& choice : key.choices) {
    const bool is_member =
        std::find(group.values.begin(), group.values.end(), choice.word) != group.values.end();
    (is_member ? included : excluded).push_back({choice.word, "", {}});
  }
  if (excluded.empty()) return "";
  return included.size() <= excluded.size() ? key.name + " = " + or_joined(included)
                                            : key.name + " other than " + or_joined(excluded);
}

/// Builds the rows of a reference table.
class RowBuilder {
 public:
  void add(const std::vector<Key>& keys, const std::string& path, const std::string& condition) {
    for (const Key& key : keys) add(key, path, condition);
  }
  std::vector<KeyRow> rows;

 private:
  static constexpr std::size_t max_values = 7;  // in one row; more values get a row each

  void add(const Key& key, const std::string& path, const std::string& condition) {
    const std::string own_path = key_path(path, key.name);
    const bool has_value_rows = key.choices.size() > max_values;
    const std::string descriptions = has_value_rows ? "" : value_descriptions(key);
    std::string sentence = key.sentence;
    if (!descriptions.empty()) sentence += (sentence.empty() ? "" : ": ") + descriptions;
    rows.push_back({own_path, condition, key.required, key_unit(key),
                    has_value_rows ? "one of these values" : allowed_values(key), key.fallback,
                    sentence});
    for (const EnumChoice& choice : key.choices)
      if (has_value_rows)
        rows.push_back({own_path + " = \"" + choice.word + "\"", condition, false, "", "", "",
                        choice.sentence});
    add(key.keys, own_path, "");
    for (const ValueGroup& group : value_groups(key))
      add(group.keys, path, condition_text(key, group));
  }
};

/// Returns true if a key has the name, or if its pattern matches the name.
bool has_key_name(const Key& key, const std::string& name) {
  if (key.name == name) return true;
  return !key.pattern.empty() && matches(name, key.pattern);
}

/// Splits a dotted path.
std::vector<std::string> path_parts(std::string_view path) {
  std::vector<std::string> parts;
  for (std::size_t from = 0; from <= path.size();) {
    const std::size_t dot = std::min(path.find('.', from), path.size());
    parts.emplace_back(path.substr(from, dot - from));
    from = dot + 1;
  }
  return parts;
}

/// A key that matches a query.
struct KeyMatch {
  Key key;
  std::string path;       ///< path of its table
  std::string condition;  ///< that enables it; empty: always enabled
};

/// Appends the keys with a name, including keys that a value enables.
/// @param table  path and condition of the table that has the keys
void find_named(const std::vector<Key>& keys, const std::string& name, const KeyMatch& table,
                std::vector<KeyMatch>& matches) {
  for (const Key& key : keys) {
    if (has_key_name(key, name)) matches.push_back({key, table.path, table.condition});
    for (const EnumChoice& choice : key.choices)
      find_named(choice.keys, name,
                 {{}, table.path, fmt::format("{} = \"{}\"", key.name, choice.word)}, matches);
  }
}

/// Returns all keys at a path; there may be several, since values of an enumeration may enable
/// different keys of the same name.
std::vector<KeyMatch> matches_at(const std::vector<Key>& keys, std::string_view path) {
  std::vector<KeyMatch> matches{{{}, "", ""}};
  matches.front().key.keys = keys;
  for (const std::string& part : path_parts(path)) {
    std::vector<KeyMatch> next_matches;
    for (const KeyMatch& match : matches)
      find_named(match.key.keys, part, {{}, key_path(match.path, match.key.name), ""},
                 next_matches);
    // A number that is not a key is the index of a list.
    const bool is_index = part.find_first_not_of("0123456789") == std::string::npos;
    if (!next_matches.empty() || !is_index) matches = std::move(next_matches);
  }
  return matches;
}

/// Appends the keys with a name at this or any lower level.
void find_anywhere(const std::vector<Key>& keys, const std::string& name, const KeyMatch& table,
                   std::vector<KeyMatch>& matches) {
  for (const Key& key : keys) {
    if (has_key_name(key, name)) matches.push_back({key, table.path, table.condition});
    find_anywhere(key.keys, name, {{}, key_path(table.path, key.name), ""}, matches);
    for (const EnumChoice& choice : key.choices)
      find_anywhere(choice.keys, name,
                    {{}, table.path, fmt::format("{} = \"{}\"", key.name, choice.word)}, matches);
  }
}

}  // namespace

std::vector<KeyRow> key_rows(const std::vector<Key>& keys, const std::string& path) {
  RowBuilder builder;
  builder.add(keys, path, "");
  return std::move(builder.rows);
}

std::string to_text(const std::vector<KeyRow>& rows) {
  std::string text;
  for (const KeyRow& row : rows) {
    text += row.path;
    if (!row.condition.empty()) text += "  with " + row.condition;
    text += "\n    " + row.value + (row.unit.empty() ? "" : " (" + row.unit + ")");
    if (row.required) text += "; required";
    if (!row.default_value.empty()) text += "; default " + row.default_value;
    text += "\n";
    if (!row.description.empty()) text += "    " + row.description + "\n";
  }
  return text;
}

std::vector<Key> keys_at(const std::vector<Key>& keys, std::string_view path) {
  for (const KeyMatch& match : matches_at(keys, path))
    if (!match.key.keys.empty()) return match.key.keys;
  return {};
}

std::vector<KeyRow> matching_key_rows(const std::vector<Key>& keys, std::string_view query) {
  std::vector<KeyMatch> matches = matches_at(keys, query);
  // A name without dots that is not a key at the top level may be one at a lower level.
  if (matches.empty() && query.find('.') == std::string_view::npos)
    find_anywhere(keys, std::string(query), {}, matches);
  std::vector<KeyRow> rows;
  for (const KeyMatch& match : matches) {
    std::vector<KeyRow> new_rows = key_rows({match.key}, match.path);
    const KeyRow& first = new_rows.front();
    new_rows.front().condition = match.condition;
    // If several values enable the same key, it gets one row with all its conditions.
    const auto same = std::find_if(rows.begin(), rows.end(), [&](const KeyRow& row) {
      return row.path == first.path && row.value == first.value &&
             row.default_value == first.default_value && row.description == first.description;
    });
    if (same == rows.end())
      rows.insert(rows.end(), new_rows.begin(), new_rows.end());
    else if (!match.condition.empty())
      same->condition += ", " + match.condition.substr(match.condition.find('"'));
  }
  return rows;
}

namespace {

using Json = nlohmann::ordered_json;

Json schema_object(const std::vector<Key>& keys);

/// Adds the limits of a number.
void add_range(Json& schema, const Range& range) {
  const double unlimited = std::numeric_limits<double>::max();
  const auto bound = [&](const char* name, double value) {
    // Integers are written without an exponent. 1e15 is near 2^53, above which a double cannot hold
    // every integer.
    if (std::abs(value) < 1e15 && value == std::round(value))
      schema[name] = std::int64_t(value);
    else
      schema[name] = value;
  };
  if (range.min > -unlimited) bound(range.open_min ? "exclusiveMinimum" : "minimum", range.min);
  if (range.max < unlimited) bound(range.open_max ? "exclusiveMaximum" : "maximum", range.max);
}

/// Returns the schema of an enumeration with the descriptions of its values.
Json enumeration_schema(const Key& key) {
  Json values = Json::array(), sentences = Json::array();
  for (const EnumChoice& choice : key.choices) {
    values.push_back(choice.word);
    sentences.push_back(choice.sentence);
  }
  // The Taplo language server shows the descriptions of the values in editors.
  return {{"enum", values}, {"x-taplo", {{"docs", {{"enumValues", sentences}}}}}};
}

/// Returns the schema of a number with its range.
Json number_schema(const Key& key, const char* type) {
  Json number{{"type", type}};
  add_range(number, key.range);
  return number;
}

/// Returns the schema of a list of numbers. A list of any length must not be empty.
Json number_list_schema(const Key& key) {
  Json list{{"type", "array"}, {"items", {{"type", "number"}}}};
  list["minItems"] = std::max(key.size, 1);
  if (key.size > 0) list["maxItems"] = key.size;
  return list;
}

/// Returns the schema of a table or a list of tables, or of a file that contains it.
Json table_schema(const Key& key) {
  const Json file{{"type", "string"}};
  const Json table = schema_object(key.keys);
  if (key.kind == Key::Kind::Table) return key.or_file ? Json{{"anyOf", {file, table}}} : table;
  const Json item = key.or_file ? Json{{"anyOf", {file, table}}} : table;
  // Like the readers, the schema accepts a single table in place of a list.
  Json alternatives = Json::array({table, {{"type", "array"}, {"items", item}}});
  if (key.or_file) alternatives.push_back(file);
  return {{"anyOf", alternatives}};
}

/// Returns the schema of the type of a key; without constraints for a key of any type.
Json schema_type(const Key& key) {
  using Kind = Key::Kind;
  const Json text{{"type", "string"}, {"minLength", 1}};
  switch (key.kind) {
    case Kind::Number:
      return number_schema(key, "number");
    case Kind::Whole:
      return number_schema(key, "integer");
    case Kind::Boolean:
      return {{"type", "boolean"}};
    case Kind::Text:
      return key.choices.empty() ? text : enumeration_schema(key);
    case Kind::Numbers:
      return number_list_schema(key);
    case Kind::NumberOrNumbers:
      return {{"anyOf", {number_schema(key, "number"), number_list_schema(key)}}};
    case Kind::Texts:
      return {{"anyOf", {text, {{"type", "array"}, {"items", text}}}}};
    case Kind::Table:
    case Kind::Tables:
      return table_schema(key);
    case Kind::Any:
      break;
  }
  return Json::object();
}

/// Returns the schema of a key with its description and default.
Json schema_property(const Key& key) {
  Json property = schema_type(key);
  std::string sentence = key.sentence;
  if (!key.fallback.empty()) sentence += " (default " + key.fallback + ")";
  property["description"] = sentence;
  return property;
}

/// Returns all keys of a table, including those that values enable.
std::vector<const Key*> all_table_keys(const std::vector<Key>& keys) {
  std::vector<const Key*> list;
  for (const Key& key : keys) {
    list.push_back(&key);
    for (const EnumChoice& choice : key.choices) {
      const std::vector<const Key*> enabled = all_table_keys(choice.keys);
      list.insert(list.end(), enabled.begin(), enabled.end());
    }
  }
  return list;
}

/// Adds a property. If a key exists already with another meaning, either one is allowed.
void add_property(Json& properties, const std::string& name, Json property) {
  if (!properties.contains(name)) {
    properties[name] = std::move(property);
  } else if (properties[name] != property) {
    Json& alternatives = properties[name];
    if (!alternatives.contains("x-alternatives"))
      alternatives = Json{{"anyOf", Json::array({alternatives})}, {"x-alternatives", true}};
    alternatives["anyOf"].push_back(std::move(property));
  }
}

/// Returns all names that a pattern such as "(um|urad)_per_K" matches; the pattern itself if it has
/// no alternatives.
std::vector<std::string> pattern_names(const std::string& pattern) {
  const std::size_t open = pattern.find('('), close = pattern.find(')');
  if (open == std::string::npos || close < open) return {pattern};
  std::vector<std::string> names;
  std::istringstream alternatives(pattern.substr(open + 1, close - open - 1));
  for (std::string alternative; std::getline(alternatives, alternative, '|');)
    for (const std::string& suffix : pattern_names(pattern.substr(close + 1)))
      names.push_back(pattern.substr(0, open) + alternative + suffix);
  return names;
}

/// Returns the condition that a key is present.
Json schema_presence(const Key& key) {
  Json conditions = Json::array();
  for (const std::string& name : pattern_names(key.pattern.empty() ? key.name : key.pattern))
    conditions.push_back({{"required", {name}}});
  return conditions.size() == 1 ? conditions.front() : Json{{"anyOf", conditions}};
}

/// Adds to a schema the required keys, the rule that exactly one key of a group of alternatives is
/// present, and the rules that depend on values of enumerations.
/// @param shared  names of keys that no value can forbid
void add_requirements(Json& schema, const std::vector<Key>& keys,
                      const std::set<std::string>& shared) {
  Json required = Json::array(), all_of = Json::array();
  std::map<std::string, Json> alternatives;
  for (const Key& key : keys) {
    if (key.required && key.pattern.empty()) required.push_back(key.name);
    if (!key.exclusive_group.empty())
      alternatives.try_emplace(key.exclusive_group, Json::array())
          .first->second.push_back(schema_presence(key));
    std::set<std::string> dependent;  // keys that some value enables
    for (const EnumChoice& choice : key.choices)
      for (const Key* enabled : all_table_keys(choice.keys))
        if (enabled->pattern.empty()) dependent.insert(enabled->name);
    for (const EnumChoice& choice : key.choices) {
      if (dependent.empty()) break;
      std::set<std::string> allowed = shared;
      for (const Key& sibling : keys) allowed.insert(sibling.name);
      for (const Key* enabled : all_table_keys(choice.keys)) allowed.insert(enabled->name);
      // A key that only another value enables must be absent.
      Json then = Json::object();
      for (const std::string& name : dependent)
        if (!allowed.contains(name)) then["properties"][name] = false;
      add_requirements(then, choice.keys, allowed);
      if (!then.empty())
        all_of.push_back(
            {{"if",
              {{"properties", {{key.name, {{"const", choice.word}}}}}, {"required", {key.name}}}},
             {"then", then}});
    }
  }
  for (const auto& [name, one_of] : alternatives) all_of.push_back({{"oneOf", one_of}});
  if (!required.empty()) schema["required"] = required;
  if (!all_of.empty()) schema["allOf"] = all_of;
}

/// Returns the schema of a table. As in the readers, unknown keys are errors.
Json schema_object(const std::vector<Key>& keys) {
  Json object{{"type", "object"}, {"additionalProperties", false}};
  object["properties"] = Json::object();
  for (const Key* key : all_table_keys(keys)) {
    const bool has_pattern = !key->pattern.empty();
    add_property(has_pattern ? object["patternProperties"] : object["properties"],
                 has_pattern ? "^(" + key->pattern + ")$" : key->name, schema_property(*key));
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
