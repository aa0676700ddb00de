#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/scene/table_reader.h"

/// Reference tables and the JSON Schema of the keys of a file.
namespace abbe::sim {

/// A key as a row of a reference table.
struct KeyRow {
  std::string path;       ///< path from the section: "ring.name"
  std::string condition;  ///< value of another key that enables it, such as `surface = "disc"`;
                          ///< empty: always enabled
  bool required = false;
  std::string unit;           ///< such as "mm"; empty: none
  std::string value;          ///< allowed values: "> 0", "3 numbers", "\"zigzag\" or \"one_way\""
  std::string default_value;  ///< empty: none
  std::string description;
};

/// Returns the rows of keys and of the keys of their tables, in order.
/// @param path  dotted path of the table that has the keys; empty at the top level
std::vector<KeyRow> key_rows(const std::vector<Key>& keys, const std::string& path = "");

/// Returns the rows that match a query: a dotted path from the top level ("part.ring.name"), which
/// may contain list indices, or the name of a key at any level. A table matches together with its
/// keys. Empty if nothing matches.
std::vector<KeyRow> matching_key_rows(const std::vector<Key>& keys, std::string_view query);

/// Returns rows as `abbe explain` prints them: key, unit, range, default, description.
std::string to_text(const std::vector<KeyRow>& rows);

/// Returns the keys of the table at a dotted path; empty if there is none.
std::vector<Key> keys_at(const std::vector<Key>& keys, std::string_view path);

/// Returns the JSON Schema (draft 7) of a file with these keys, which editors use for completion,
/// descriptions and error marks. It contains types, ranges, required keys, the keys that an
/// enumeration value enables, and units as part of key names. Other relations between keys are
/// checked only by `abbe check`.
nlohmann::ordered_json schema(const std::vector<Key>& keys, const std::string& title);

}  // namespace abbe::sim
