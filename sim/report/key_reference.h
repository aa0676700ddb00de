#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/scene/table_reader.h"

namespace abbe::sim {

/// A key as a row of a table that people read.
struct KeyRow {
  std::string path;  ///< from the section: "ring.name"
  std::string when;  ///< word that brings it: `surface = "disc"`; empty: always
  bool required = false;
  std::string unit;      ///< "mm"; empty: none
  std::string value;     ///< what it may be: "> 0", "3 numbers", "\"zigzag\" or \"one_way\""
  std::string fallback;  ///< what stands in; empty: nothing
  std::string sentence;
};

/// Rows of keys and of those of their tables, in order.
/// @param path  of the table that has them; empty at the top
std::vector<KeyRow> key_rows(const std::vector<Key>& keys, const std::string& path = "");

/// Rows that a question means: a dotted path from the top ("part.ring.name"), in which a list may
/// have an index, or the bare name of a key anywhere. A table answers with its keys. Empty if there
/// is none.
std::vector<KeyRow> explained(const std::vector<Key>& keys, std::string_view question);

/// Rows as `abbe explain` prints them: key, unit, range, default, sentence.
std::string to_text(const std::vector<KeyRow>& rows);

/// The keys of the table at a dotted path; empty if there is none.
std::vector<Key> keys_at(const std::vector<Key>& keys, std::string_view path);

/// JSON Schema (draft 7) of a file whose top has these keys, for editors: completion, sentences and
/// a mark where something is wrong. It holds types, ranges, required keys, the keys that a word
/// brings, and units by the names of keys; what keys ask of each other beyond that `abbe check`
/// knows.
nlohmann::ordered_json schema(const std::vector<Key>& keys, const std::string& title);

}  // namespace abbe::sim
