#include "sim/scene/scene_copy.h"

#include <algorithm>
#include <stdexcept>
#include <tuple>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/scene/bad_scene.h"
#include "sim/scene/scene_tree.h"

namespace abbe::sim {
namespace {

constexpr std::size_t most_copied_bytes = std::size_t(256) << 20;

/// Where a place stands in the text of its file.
std::size_t offset_of(const std::string& text, const Place& place) {
  std::size_t at = 0;
  for (int line = 1; line < place.line; ++line) at = text.find('\n', at) + 1;
  return at + std::size_t(place.column - 1);
}

/// The text with the quoted name that begins at a place replaced.
std::string renamed(std::string text, const Place& place, const std::string& name) {
  const std::size_t from = offset_of(text, place);
  const std::size_t to = text.find(text.at(from), from + 1);
  return text.replace(from + 1, to - from - 1, name);
}

/// The last part of a dotted section, numbered from its second file on.
std::string name_of(const SectionInFile& one, const std::vector<CopiedFile>& files) {
  std::string section = one.section;
  if (section.ends_with(".file")) section.resize(section.rfind('.'));
  section.erase(0, section.rfind('.') + 1);
  const std::string ending = one.file.extension().string();
  std::string name = section + ending;
  const auto taken = [&] {
    return std::ranges::any_of(files, [&](const CopiedFile& file) { return file.name == name; });
  };
  for (int k = 2; taken(); ++k) name = fmt::format("{}_{}{}", section, k, ending);
  return name;
}

}  // namespace

std::vector<CopiedFile> copy_of(const std::filesystem::path& scene) {
  Faults faults;
  std::vector<CopiedFile> files;
  try {
    const Node tree = read_toml_file(scene);
    files.push_back({"scene.toml", read_text(scene, max_toml_bytes), scene});
    std::vector<SectionInFile> sections = sections_in_files_of(tree, scene.parent_path(), faults);
    if (!faults.empty()) throw BadScene(faults.list());
    std::ranges::sort(sections, {}, [](const SectionInFile& one) {
      return std::tuple(one.place.line, one.place.column);
    });
    for (const SectionInFile& one : sections)
      files.push_back({name_of(one, files), read_text(one.file, most_copied_bytes), one.file});
    // from the last on, so that the places of the others still hold
    for (std::size_t i = sections.size(); i-- > 0;)
      files.front().text = renamed(files.front().text, sections[i].place, files[i + 1].name);
  } catch (const BadInput& fault) {
    throw BadScene({fault});
  }
  return files;
}

}  // namespace abbe::sim
