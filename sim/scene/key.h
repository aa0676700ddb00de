#pragma once

#include <string>
#include <vector>

#include "sim/scene/table_reader.h"

namespace abbe::sim {

struct Word;

/// What a key of a table takes, as people and editors read it: the one statement from which come
/// the tables of keys in the documents, `abbe schema` and `abbe explain`.
struct Key {
  enum class Kind {
    Number,
    Whole,
    Boolean,
    Text,
    Numbers,
    NumberOrNumbers,
    Texts,
    Table,
    Tables,
    Any
  };
  std::string name;      ///< "radius_mm"; of keys that are many how they look: "<axis>_mm"
  std::string sentence;  ///< what it is
  Kind kind = Kind::Any;
  bool required = false;    ///< wherever its table, or the word that brings it, is
  std::string fallback;     ///< what stands in where it is left out, for people; empty: nothing
  std::string pattern;      ///< regular expression of the names where they are many; else empty
  std::string either;       ///< of the keys of a table with one `either`, exactly one is given
  Range range{};            ///< of numbers, in the unit of the key
  int size = 0;             ///< of numbers; 0: any from 1 on
  std::vector<Word> words;  ///< of a text that is one of these
  std::vector<Key> keys;    ///< of the table or of each table
  bool or_file = false;     ///< a table that may stand in a file of its own, which is then named
};

/// A word that a key may have, and the keys of its table that it brings.
struct Word {
  std::string word;
  std::string sentence;
  std::vector<Key> keys;
};

}  // namespace abbe::sim
