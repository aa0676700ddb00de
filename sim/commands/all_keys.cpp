#include "sim/commands/all_keys.h"

#include <algorithm>
#include <regex>
#include <set>

#include "sim/commands/exit_code.h"
#include "sim/report/key_rows.h"
#include "sim/scene/scene_fields.h"
#include "sim/study/study_fields.h"

namespace abbe::sim {
namespace {

/// The part of a prefix behind the path of a table, where another follows it; else empty.
std::string part_after(const std::string& table, const std::string& prefix) {
  if (!prefix.starts_with(table)) return "";
  const std::size_t end = prefix.find('.', table.size());
  return end == std::string::npos ? "" : prefix.substr(table.size(), end - table.size());
}

bool has_key(const std::vector<Key>& keys, const std::string& name) {
  return std::ranges::any_of(keys, [&](const Key& key) {
    return key.name == name || std::ranges::any_of(key.words, [&](const Word& word) {
             return has_key(word.keys, name);
           });
  });
}

/// The index or name of one table of a list that a prefix has, with a dot; else empty.
std::string choice_in(const Key& list, const std::string& path, const std::string& prefix) {
  const std::string part = part_after(path, prefix);
  return part.empty() || has_key(list.keys, part) ? "" : part + ".";
}

/// The name of a key: of those that are many the one that the prefix has.
std::string name_in(const Key& key, const std::string& table, const std::string& prefix) {
  const std::string part = part_after(table, prefix);
  const bool one =
      !key.pattern.empty() && !part.empty() && std::regex_match(part, std::regex(key.pattern));
  return one ? part : key.name;
}

/// Paths of keys and of those below them, in order; those that words bring come after their word.
std::vector<std::string> paths_of(const std::vector<Key>& keys, const std::string& table,
                                  const std::string& prefix) {
  std::vector<std::string> paths;
  const auto append = [&](const std::vector<std::string>& more) {
    paths.insert(paths.end(), more.begin(), more.end());
  };
  for (const Key& key : keys) {
    const std::string path = table + name_in(key, table, prefix);
    if (key.keys.empty() || key.or_file) paths.push_back(path);
    std::string below = path + ".";
    if (key.kind == Key::Kind::Tables) below += choice_in(key, below, prefix);
    append(paths_of(key.keys, below, prefix));
    for (const Word& word : key.words) append(paths_of(word.keys, table, prefix));
  }
  return paths;
}

}  // namespace

std::vector<Key> all_keys() {
  std::vector<Key> keys = scene_keys();
  Key study;
  study.name = "study";
  study.sentence = "a study, in a file of its own";
  study.kind = Key::Kind::Table;
  study.keys = study::study_keys();
  keys.push_back(std::move(study));
  return keys;
}

std::vector<Key> keys_of(const std::string& section) {
  std::vector<Key> keys = keys_at(all_keys(), section);
  if (keys.empty())
    throw BadUsage("--of", "expected scene, study or a section of them, seen " + section);
  return keys;
}

std::vector<std::string> keys_to_set(const std::string& prefix) {
  const std::vector<Key> keys = prefix.starts_with("study") ? all_keys() : scene_keys();
  std::vector<std::string> found;
  std::set<std::string> seen;
  for (const std::string& path : paths_of(keys, "", prefix))
    if (path.starts_with(prefix) && seen.insert(path).second) found.push_back(path);
  return found;
}

}  // namespace abbe::sim
