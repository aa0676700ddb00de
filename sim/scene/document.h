#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "sim/scene/table_reader.h"

namespace abbe::sim {

struct Place;

/// A value of the scene changed by its path, such as {"errors.scale", "2.0"}.
struct Override {
  std::string path;
  std::string value;                        ///< TOML text
  std::shared_ptr<const Place> place = {};  ///< position in a file; null if the user typed it

  /// Returns true for the same change, whatever its position.
  friend bool operator==(const Override& a, const Override& b) {
    return a.path == b.path && a.value == b.value;
  }
};

/// A program that a scene or study would run, namely a compensator supplied by the user.
struct NamedProgram {
  std::filesystem::path program;  ///< absolute
  std::filesystem::path file;     ///< the file that names the program
  int line = 0;
  int column = 0;
  bool typed = false;  ///< true if the user gave it on the command line
};

struct Variant {
  std::string name;
  std::vector<Override> set;
};

// The text of a scene as one tree, with its section files read in and values changed by path.

/// A value assigned to a dotted path. A table merges with the existing one; other values replace
/// it.
struct Change {
  std::string path;
  Node value;  ///< carries the position that messages name
};

/// Returns the override that makes a change, with the position of the change.
Override make_override(const Change& change);

/// Returns the scene file with the files of its sections read in and every data file named by its
/// absolute path. Syntax errors and missing files are collected; a section whose file was rejected
/// keeps the name of that file. Returns nothing if the scene file itself was rejected.
std::optional<Node> read_tree(const std::filesystem::path& file, InputErrors& input_errors);

/// A section of a scene that is stored in a file of its own.
struct SectionFileReference {
  std::string section;  ///< dotted: "belief.identified"; "part.file" for a mesh or a program
  Place place;          ///< the position of the file name
  std::filesystem::path file;
};

/// Returns the sections, mesh and program that a scene, as written, takes from files.
/// @param folder  of the scene
std::vector<SectionFileReference> section_files(const Node& as_written,
                                                const std::filesystem::path& folder,
                                                InputErrors& input_errors);

/// Returns the tree with the changes applied in order and the files that they name read in. In a
/// path, a list takes an index, the `name` of one of its tables, or neither; with neither, every
/// table is changed.
/// @param folder  base of relative paths in the changes
Node changed(Node tree, const std::vector<Change>& changes, const std::filesystem::path& folder,
             InputErrors& input_errors);
/// Returns the same for overrides, whose values are TOML, or a bare word if that is unambiguous;
/// any other value is an error.
Node changed(Node tree, const std::vector<Override>& overrides, const std::filesystem::path& folder,
             InputErrors& input_errors);

/// Returns the changes in the `set` table of a variant, one for each value, with their positions.
std::vector<Change> changes_from_set(const Node& set);

/// A file of a copied scene, with the origin of its text.
struct CopiedFile {
  std::string name;
  std::string text;
  std::filesystem::path from;
};

/// Returns a scene and the files of its sections as they would be stored in a folder of their own:
/// `scene.toml`, `machine.toml`, `program.ngc` and so on, each named after its section. The texts
/// equal the originals, comments included, except for these names in the scene.
/// @throws BadScene if a file cannot be read
std::vector<CopiedFile> scene_copy(const std::filesystem::path& scene);

}  // namespace abbe::sim
