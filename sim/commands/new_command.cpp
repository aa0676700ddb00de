#include "sim/commands/new_command.h"

#include <algorithm>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/commands/library_list.h"
#include "sim/files/new_folder.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/scene/library.h"
#include "sim/scene/read_scene.h"

namespace abbe::sim {

const std::vector<std::string>& new_kinds() {
  static const std::vector<std::string> kinds{"cam",        "fanuc",      "gantry",   "head_head",
                                              "heidenhain", "lathe",      "linuxcnc", "platform",
                                              "siemens",    "three_axis", "trunnion"};
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
  bool list = false;
};

Exit print_list(const Common& common) {
  const LibraryList list = library_list(new_kinds());
  print("{}", Lines(common.json ? json_text(to_json(list)) : to_text(list)));
  return Exit::Ok;
}

Exit print_new_scene(const NewWords& words) {
  if (words.kind.empty() || words.folder.empty())
    throw BadUsage(words.kind.empty() ? "KIND" : "DIR",
                   "expected a kind and a folder, such as abbe new gantry first, or --list");
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

Command new_command(Common& common) {
  const auto words = std::make_shared<NewWords>();
  return {.name = "new",
          .summary = "Write a first scene with its machine, errors, tool, part and program",
          .examples = {"abbe new gantry first", "abbe new lathe parts/shaft", "abbe new --list"},
          .options =
              {{"KIND", &words->kind,
                "of machine, gantry, trunnion, three_axis, lathe, head_head or platform; or for a "
                "program of a CAM, cam, fanuc, siemens, heidenhain or linuxcnc",
                OneOf{new_kinds()}, MayBeLeftOut{}},
               {"DIR", &words->folder, "folder for the files: new or empty", MayBeLeftOut{}},
               {"--list", &words->list, "print the kinds, and the machines of the library"},
               json_option(common)},
          .run = [words, &common] {
            return words->list ? print_list(common) : print_new_scene(*words);
          }};
}

}  // namespace abbe::sim
