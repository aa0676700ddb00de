#pragma once

#include <regex>
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"
#include "tests/test.h"

namespace abbe::sim {

/// The key of a table by its name, also among those that a word brings; null if there is none.
inline const Key* listed(const std::string& name, const std::vector<Key>& keys) {
  for (const Key& key : keys) {
    if (key.pattern.empty() ? key.name == name : std::regex_match(name, std::regex(key.pattern)))
      return &key;
    for (const EnumChoice& word : key.choices)
      if (const Key* found = listed(name, word.keys)) return found;
  }
  return nullptr;
}

/// Keys of a table, all the way down, that are not in the list, a line each.
inline std::string unlisted(const Node::Table& table, const std::vector<Key>& keys) {
  std::string all;
  for (const Node::Entry& entry : table) {
    const Key* key = listed(entry.key, keys);
    if (!key) {
      all += entry.key + "\n";
      continue;
    }
    if (const auto* inner = entry.node.table()) all += unlisted(*inner, key->keys);
    if (const auto* list = entry.node.array())
      for (const Node& one : *list)
        if (one.table()) all += unlisted(*one.table(), key->keys);
  }
  return all;
}

}  // namespace abbe::sim
