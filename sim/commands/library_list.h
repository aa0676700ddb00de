#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

/// What the library has to begin with, for `abbe new --list` and the documents.
namespace abbe::sim {

/// A kind of `abbe new`.
struct ListedKind {
  std::string name, summary;
  std::string machine;  ///< of the library
};

/// Travel of an axis of a machine, mm or degrees.
struct ListedAxis {
  char name = 'X';
  bool turns = false;
  bool ends = false;  ///< there are limits worth the name: a turn of 10 000 degrees has none
  double min = 0.0, max = 0.0;
};

/// A machine of the library.
struct ListedMachine {
  std::string name, summary;
  std::string code;              ///< structural
  std::vector<ListedAxis> axes;  ///< without spindles
};

struct LibraryList {
  std::vector<ListedKind> kinds;
  std::vector<ListedMachine> machines;  ///< by name
};

/// @param kinds  of `abbe new`
/// @throws BadInput without a library, BadScene for a machine that cannot be read
LibraryList library_list(const std::vector<std::string>& kinds);

/// "X 400, Y 200, Z 240 mm; B -50 .. 100, C any deg": of a slide how far, of a turn from where to
/// where.
std::string travel_text(const ListedMachine& machine);

std::string to_text(const LibraryList& list);
nlohmann::ordered_json to_json(const LibraryList& list);

}  // namespace abbe::sim
