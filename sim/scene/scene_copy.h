#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace abbe::sim {

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
std::vector<CopiedFile> copy_of(const std::filesystem::path& scene);

}  // namespace abbe::sim
