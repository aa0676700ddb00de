#include "sim/commands/new_command.h"

#include <algorithm>
#include <memory>

#include <fmt/format.h>

#include "sim/files/new_folder.h"
#include "sim/files/terminal.h"
#include "sim/scene/library.h"
#include "sim/scene/read_scene.h"

namespace abbe::sim {

const std::vector<std::string>& new_kinds() {
  static const std::vector<std::string> kinds{"gantry", "trunnion",  "three_axis",
                                              "lathe",  "head_head", "platform"};
  return kinds;
}

std::vector<CopiedFile> new_scene(const std::string& kind, const std::filesystem::path& folder) {
  check_new_folder(folder);
  const std::vector<CopiedFile> copied = copy_of(library_folder() / "new" / (kind + ".toml"));
  std::vector<NewFile> files;
  for (const CopiedFile& one : copied) files.push_back({one.name, one.text});
  write_new_folder(folder, files);
  return copied;
}

namespace {

/// Where the new folder is and of what kind.
struct NewWords {
  std::string kind;
  std::filesystem::path folder;
};

Exit print_new_scene(const NewWords& words) {
  const std::filesystem::path library = library_folder();
  for (const CopiedFile& one : new_scene(words.kind, words.folder))
    print("{:<16} from {}\n", one.name, one.from.lexically_relative(library).generic_string());
  const std::string scene = (words.folder / "scene.toml").string();
  const std::string out = (words.folder / "out").string();
  print("\nabbe check {} --picture --out {}\nabbe compare {} --out {}\n", scene, out + "/check",
        scene, out + "/compare");
  return Exit::Ok;
}

}  // namespace

Command new_command() {
  const auto words = std::make_shared<NewWords>();
  return {.name = "new",
          .summary = "Write a first scene with its machine, errors, tool, part and program",
          .examples = {"abbe new gantry first", "abbe new lathe parts/shaft"},
          .options = {{"KIND", &words->kind,
                       "of machine: gantry, trunnion, three_axis, lathe, head_head or platform",
                       OneOf{new_kinds()}},
                      {"DIR", &words->folder, "folder for the files: new or empty"}},
          .run = [words] { return print_new_scene(*words); }};
}

}  // namespace abbe::sim
