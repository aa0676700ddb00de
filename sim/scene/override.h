#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace abbe::sim {

struct Place;

/// A value of the scene changed by path: {"errors.scale", "2.0"}.
struct Override {
  std::string path;
  std::string value;                        ///< TOML text
  std::shared_ptr<const Place> place = {};  ///< in a file; null: the user typed it

  /// The same change, wherever it stands.
  friend bool operator==(const Override& a, const Override& b) {
    return a.path == b.path && a.value == b.value;
  }
};

/// A program that a scene or study would have run: a compensator of somebody's own.
struct NamedProgram {
  std::filesystem::path program;  ///< absolute
  std::filesystem::path file;     ///< that names it
  int line = 0;
  int column = 0;
  bool typed = false;  ///< by the user, on the command line
};

struct Variant {
  std::string name;
  std::vector<Override> set;
};

}  // namespace abbe::sim
