#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "sim/scene/table_reader.h"

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

// The text of a scene as one tree: sub-files read in, values changed by path.

/// A value put at a dotted path. A table merges into what is there, anything else replaces it.
struct Change {
  std::string path;
  Node value;  ///< carries the place that messages shall name
};

/// The override that makes a change, with the place where it stands.
Override make_override(const Change& change);

/// The scene file with the sub-files of its sections read in and every data file named by absolute
/// path. Faults of syntax and missing files are collected; a section whose file was refused stays
/// the name of that file. Empty if the scene file itself was refused.
std::optional<Node> read_tree(const std::filesystem::path& file, InputErrors& input_errors);

/// A section of a scene that is a file of its own.
struct SectionFileReference {
  std::string section;  ///< dotted: "belief.identified"; "part.file" of a mesh or a program
  Place place;          ///< where its name stands
  std::filesystem::path file;
};

/// The sections, mesh and program that a scene as it is written leaves to files.
/// @param folder  of the scene
std::vector<SectionFileReference> section_files(const Node& as_written,
                                                const std::filesystem::path& folder,
                                                InputErrors& input_errors);

/// The tree with the changes made in their order, and the sub-files that they name read in. In a
/// path a list takes an index, the `name` of one of its tables, or neither: then each table is
/// changed.
/// @param folder  paths in the changes are relative to it
Node changed(Node tree, const std::vector<Change>& changes, const std::filesystem::path& folder,
             InputErrors& input_errors);
/// The same by overrides, whose values are TOML, or a bare word where that can mean nothing else;
/// one that is neither is a fault.
Node changed(Node tree, const std::vector<Override>& overrides, const std::filesystem::path& folder,
             InputErrors& input_errors);

/// Changes that a variant's `set` table stands for, one for each value, with their places.
std::vector<Change> set_changes(const Node& set);

/// A file of a copied scene, and where its text is from.
struct CopiedFile {
  std::string name;
  std::string text;
  std::filesystem::path from;
};

/// A scene and the files of its sections as they would stand in a folder of their own:
/// `scene.toml`, `machine.toml`, `program.ngc` and so on, each named after its section. Their texts
/// are those of the originals, comments included, but for these names in the scene.
/// @throws BadScene where a file cannot be read
std::vector<CopiedFile> scene_copy(const std::filesystem::path& scene);

}  // namespace abbe::sim
