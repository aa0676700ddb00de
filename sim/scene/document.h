#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "sim/scene/table_reader.h"

namespace abbe::sim {

struct SourcePosition;

/// A value of the scene changed by its path, such as {"errors.scale", "2.0"}.
struct Override {
  std::string path;
  std::string value;  ///< TOML text
  std::shared_ptr<const SourcePosition> position =
      {};  ///< position in a file; null if the user typed it

  /// Returns true for the same change, whatever its position.
  friend bool operator==(const Override& a, const Override& b) {
    return a.path == b.path && a.value == b.value;
  }
};

/// A program that running a scene or study would start, i.e. a compensator of the user.
struct ProgramReference {
  std::filesystem::path program;  ///< absolute
  std::filesystem::path file;     ///< the file that names the program
  int line = 0;
  int column = 0;
  bool from_command_line = false;  ///< the user named it on the command line
};

/// A named set of changes to a scene.
struct Variant {
  std::string name;
  std::vector<Override> set;
};

// A scene as one tree: its section files are read in, and values can be changed by path.

/// Assigns a value to a dotted path. A table is merged with the existing one; any other value
/// replaces it.
struct Change {
  std::string path;
  Node value;  ///< carries the position that messages name
};

/// Returns the override that makes a change, with the position of the change.
Override make_override(const Change& change);

/// Reads a scene file and the files of its sections, and makes the names of data files absolute.
/// Collects syntax errors and missing files; a section whose file is invalid keeps the name of that
/// file. Returns nothing if the scene file itself is invalid.
std::optional<Node> read_tree(const std::filesystem::path& file, InputErrors& input_errors);

/// Returns the tree after the changes, applied in order, with the files that they name read in.
/// Below a list, a path continues with an index, with the `name` of one of its tables, or directly
/// with a key; the latter changes every table of the list.
/// @param folder  base of relative paths in the changes
Node apply_changes(Node tree, const std::vector<Change>& changes,
                   const std::filesystem::path& folder, InputErrors& input_errors);
/// Returns the same for overrides. Their values are TOML, or text without quotes if it cannot be
/// mistaken; any other value is an input error.
Node apply_changes(Node tree, const std::vector<Override>& overrides,
                   const std::filesystem::path& folder, InputErrors& input_errors);

/// Returns the changes in the `set` table of a variant, one for each value, with their positions.
std::vector<Change> changes_from_set(const Node& set);

/// A file of a copied scene.
struct CopiedFile {
  std::string name;
  std::string text;
  std::filesystem::path from;  ///< the original
};

/// Returns copies of a scene file and of the files of its sections for one folder: `scene.toml`,
/// `machine.toml`, `program.ngc` and so on, each named after its section. The texts equal the
/// originals, comments included, except for these names in the scene.
/// @throws BadScene if a file cannot be read
std::vector<CopiedFile> scene_copy(const std::filesystem::path& scene);

}  // namespace abbe::sim
