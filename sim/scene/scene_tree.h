#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"

/// The text of a scene as one tree: sub-files read in, values changed by path.
namespace abbe::sim {

/// A value put at a dotted path. A table merges into what is there, anything else replaces it.
struct Change {
  std::string path;
  Node value;  ///< carries the place that messages shall name
};

/// The override that makes a change, with the place where it stands.
Override override_of(const Change& change);

/// The scene file with the sub-files of its sections read in and every data file named by absolute
/// path. Faults of syntax and missing files are collected; a section whose file was refused stays
/// the name of that file. Empty if the scene file itself was refused.
std::optional<Node> read_tree(const std::filesystem::path& file, Faults& faults);

/// A section of a scene that is a file of its own.
struct SectionInFile {
  std::string section;  ///< dotted: "belief.identified"; "part.file" of a mesh or a program
  Place place;          ///< where its name stands
  std::filesystem::path file;
};

/// The sections, mesh and program that a scene as it is written leaves to files.
/// @param folder  of the scene
std::vector<SectionInFile> sections_in_files_of(const Node& as_written,
                                                const std::filesystem::path& folder,
                                                Faults& faults);

/// The tree with the changes made in their order, and the sub-files that they name read in. In a
/// path a list takes an index, the `name` of one of its tables, or neither: then each table is
/// changed.
/// @param folder  paths in the changes are relative to it
Node changed(Node tree, const std::vector<Change>& changes, const std::filesystem::path& folder,
             Faults& faults);
/// The same by overrides, whose values are TOML, or a bare word where that can mean nothing else;
/// one that is neither is a fault.
Node changed(Node tree, const std::vector<Override>& overrides, const std::filesystem::path& folder,
             Faults& faults);

/// The scene of a tree with values changed, as `read_scene` makes it of a file; only what overrides
/// name is read from disk.
/// @param faults  found before
/// @throws BadScene
Scene scene_of_tree(const Node& as_written, const std::filesystem::path& file,
                    const std::vector<Override>& overrides, Faults faults = {});

/// Changes that a variant's `set` table stands for, one for each value, with their places.
std::vector<Change> changes_of_set(const Node& set);

}  // namespace abbe::sim
