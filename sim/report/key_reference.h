#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/scene/table_reader.h"

namespace abbe::sim {

/// A key as a row of a reference table.
struct KeyRow {
  std::string path;  ///< path from the section: "ring.name"
  std::string when;  ///< value of another key that enables it: `surface = "disc"`; empty: always
                     ///< enabled
  bool required = false;
  std::string unit;      ///< "mm"; empty: none
  std::string value;     ///< allowed values: "> 0", "3 numbers", "\"zigzag\" or \"one_way\""
  std::string fallback;  ///< default; empty: none
  std::string sentence;
};

/// Returns rows of keys and of the keys of their tables, in order.
/// @param path  of the table that has the keys; empty at the top
std::vector<KeyRow> key_rows(const std::vector<Key>& keys, const std::string& path = "");

/// Returns the rows that match a query: a dotted path from the top ("part.ring.name"), in which a
/// list may have an index, or the bare name of a key at any level. A table matches with its keys.
/// Empty if nothing matches.
std::vector<KeyRow> explained(const std::vector<Key>& keys, std::string_view question);

/// Returns rows as `abbe explain` prints them: key, unit, range, default, sentence.
std::string to_text(const std::vector<KeyRow>& rows);

/// Returns the keys of the table at a dotted path; empty if there is none.
std::vector<Key> keys_at(const std::vector<Key>& keys, std::string_view path);

/// Returns the JSON Schema (draft 7) of a file with these keys, for completion, descriptions and
/// error marks in editors. It holds types, ranges, required keys, the keys that an enumeration
/// value enables, and units by the names of keys; `abbe check` tests the relations between keys
/// beyond that.
nlohmann::ordered_json schema(const std::vector<Key>& keys, const std::string& title);

}  // namespace abbe::sim
