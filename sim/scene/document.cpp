#include "sim/scene/document.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <stdexcept>
#include <tuple>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/scene/library.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

namespace {

using std::filesystem::path;

// A section that may be the name of a file instead of a table: its dotted path, and the library
// folder of its kind.
struct SectionFile {
  const char* dotted;
  const char* kind;
};
constexpr std::array sections_in_files{SectionFile{"machine", "machines"},
                                       SectionFile{"errors", "errors"},
                                       SectionFile{"tool", "tools"},
                                       SectionFile{"part", "parts"},
                                       SectionFile{"program", "programs"},
                                       SectionFile{"thermal", "errors"},
                                       SectionFile{"compliance", "errors"},
                                       SectionFile{"material", "materials"},
                                       SectionFile{"belief.identified", "beliefs"},
                                       SectionFile{"belief.force.compliance", "errors"}};

// Returns the node at a dotted path below a table, with dotted or nested keys; null if there is
// none.
Node* at_path(Node& node, std::string_view dotted) {
  if (Node* whole = node.find(dotted)) return whole;
  const std::size_t dot = dotted.find('.');
  if (dot == std::string_view::npos) return nullptr;
  Node* section = node.find(dotted.substr(0, dot));
  return section ? at_path(*section, dotted.substr(dot + 1)) : nullptr;
}

std::string absolute(const std::string& name, const path& folder) {
  return std::filesystem::absolute(folder / name).lexically_normal().string();
}

std::string_view last_component(std::string_view dotted) {
  return dotted.substr(dotted.rfind('.') + 1);  // npos + 1 is 0
}

// Replaces the name of a file by its absolute path; values other than texts stay.
void make_absolute(Node& node, const char* kind, const path& folder, InputErrors& input_errors) {
  if (const std::string* name = node.text())
    node.value =
        absolute(locate_file({*name, node.place, kind}, folder, input_errors).string(), "");
}

// Makes every key `file` absolute, since the format uses that key for data files only.
void make_data_files_absolute(Node& node, const path& folder, InputErrors& input_errors) {
  if (Node::Array* array = node.array()) {
    for (Node& element : *array) make_data_files_absolute(element, folder, input_errors);
  }
  if (Node::Table* table = node.table()) {
    for (auto& [key, place, value] : *table) {
      if (value.text()) {
        if (last_component(key) == "file") make_absolute(value, "", folder, input_errors);
      } else {
        make_data_files_absolute(value, folder, input_errors);
      }
    }
  }
}

// A variant is applied later and from another folder, so its files are made absolute and not read.
void make_section_files_absolute(Node& set, const path& folder, InputErrors& input_errors) {
  for (const auto& [dotted, kind] : sections_in_files) {
    Node* section = at_path(set, dotted);
    if (!section) continue;
    make_absolute(*section, kind, folder, input_errors);
    if (Node::Array* list = section->array()) {
      for (Node& element : *list) make_absolute(element, kind, folder, input_errors);
    }
  }
}

void refuse_missing(const Node& section, const path& file, const char* kind, const path& folder,
                    InputErrors& input_errors) {
  const std::string known = library_names(kind, file.string());
  input_errors.add(
      section.place,
      "a file that can be read" + (known.empty() ? "" : ", or one of the library: " + known),
      fmt::format("no file {}: a name counts from the folder of the file that has it, here {}",
                  file.string(), absolute(".", folder)));
}

void read_section_file(Node& section, const char* kind, const path& folder,
                       InputErrors& input_errors) {
  const std::size_t before = input_errors.list().size();
  // Names are relative to the folder of the scene, as the user writes them, and not to the root
  const path file = locate_file({*section.text(), section.place, kind}, folder, input_errors);
  // A name that cannot be resolved is reported already.
  if (input_errors.list().size() > before) return;
  std::error_code failure;
  if (!std::filesystem::is_regular_file(file, failure)) {
    refuse_missing(section, file, kind, folder, input_errors);
    return;
  }
  if (file.extension() != ".toml") {  // a program or a mesh itself
    // The short form `program = "part.ngc"` becomes the long form with a `file` key, so that the
    // readers handle one form only.
    Node named;
    named.place = section.place;
    named.value = absolute(file.string(), "");
    section.value = Node::Table{{"file", section.place, named}};
    return;
  }
  try {
    Node content = read_toml_file(file);
    // Names inside the file count from the folder of that file, so they are resolved before it is
    // merged into the scene.
    make_data_files_absolute(content, file.parent_path(), input_errors);
    section = std::move(content);
  } catch (const BadInput& fault) {
    input_errors.add(fault);
  }
}

void read_section_files(Node& tree, const path& folder, InputErrors& input_errors) {
  for (const auto& [dotted, kind] : sections_in_files) {
    Node* section = at_path(tree, dotted);
    if (!section) continue;
    if (section->text()) read_section_file(*section, kind, folder, input_errors);
    const std::string_view last = last_component(dotted);
    // These sections may be lists, and every element may be a file name of its own.
    if (section->array() && (last == "errors" || last == "identified" || last == "tool")) {
      for (Node& part : *section->array()) {
        if (part.text()) read_section_file(part, kind, folder, input_errors);
      }
    }
  }
}

// Makes the files of plug-ins absolute; a case with a dot or slash is such a file.
void make_plug_ins_absolute(Node& tree, const path& folder) {
  Node* cases = at_path(tree, "compare.cases");
  if (!cases || !cases->array()) return;
  for (Node& one : *cases->array())
    if (std::string* name = std::get_if<std::string>(&one.value))
      if (name->find_first_of("./") != std::string::npos) *name = absolute(*name, folder);
}

void make_variant_files_absolute(Node& tree, const path& folder, InputErrors& input_errors) {
  Node* variants = tree.find("variant");
  if (!variants || !variants->array()) return;
  for (Node& variant : *variants->array()) {
    if (Node* set = variant.find("set"); set && set->table()) {
      make_section_files_absolute(*set, folder, input_errors);
      make_plug_ins_absolute(*set, folder);
    }
  }
}

void set_place(Node& node, const Place& place) {
  node.place = place;
  if (Node::Array* array = node.array()) {
    for (Node& element : *array) set_place(element, place);
  }
  if (Node::Table* table = node.table()) {
    for (auto& [key, key_place, value] : *table) {
      key_place = place;
      set_place(value, place);
    }
  }
}

std::vector<std::string> parts_of(const std::string& dotted) {
  std::vector<std::string> parts(1);
  for (const char c : dotted) {
    if (c == '.') {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

std::optional<std::size_t> index_of(const std::string& part) {
  std::size_t index = 0;
  const auto [end, failure] = std::from_chars(part.data(), part.data() + part.size(), index);
  if (failure != std::errc() || end != part.data() + part.size()) return std::nullopt;
  return index;
}

void merge(Node& into, const Node& value) {
  Node::Table* table = into.table();
  // Only tables merge key by key; any other value is replaced as a whole.
  if (!table || !value.table()) {
    into = value;
    return;
  }
  for (const Node::Entry& entry : *value.table()) {
    if (Node* there = into.find(entry.key)) {
      merge(*there, entry.node);
    } else {
      table->push_back(entry);
    }
  }
}

class TreeEditor {
 public:
  TreeEditor(const Change& change, InputErrors& input_errors)
      : change_(change), parts_(parts_of(change.path)), input_errors_(input_errors) {}

  void apply(Node& node, std::size_t depth = 0) const {
    if (depth == parts_.size()) {
      merge(node, change_.value);
    } else if (node.table()) {
      apply_to_table(node, depth);
    } else if (node.array()) {
      apply_to_list(node, depth);
    } else {
      // A path cannot continue below a number or a text.
      input_errors_.add(change_.value.place,
                        fmt::format("a path to a value, {} has none below \"{}\"", change_.path,
                                    parts_[depth - 1]),
                        shown(node));
    }
  }

 private:
  void apply_to_table(Node& node, std::size_t depth) const {
    const std::string& key = parts_[depth];
    if (key.empty()) {
      input_errors_.add(change_.value.place, "a dotted path such as part.vertices",
                        "\"" + change_.path + "\"");
      return;
    }
    // A missing section is created, so that an override can add one that the scene leaves out.
    if (!node.find(key)) {
      Node table;
      table.place = change_.value.place;
      table.value = Node::Table{};
      node.table()->push_back({key, change_.value.place, std::move(table)});
    }
    // The node is looked up again, because push_back() may have moved the entries.
    apply(*node.find(key), depth + 1);
  }

  /// Lists the tables that have a number of their own, as "; tool.0 has number 1, tool.1 has number
  /// 2".
  std::string numbers_in(const Node::Array& list, std::size_t depth) const {
    const std::string path =
        fmt::format("{}", fmt::join(parts_.begin(), parts_.begin() + long(depth), "."));
    std::string text;
    for (std::size_t i = 0; i < list.size(); ++i) {
      const Node* number = list[i].find("number");
      if (number)
        text += fmt::format("{} {}.{} has number {}", text.empty() ? ";" : ",", path, i,
                            shown(*number));
    }
    return text;
  }

  void apply_to_list(Node& node, std::size_t depth) const {
    Node::Array& list = *node.array();
    if (list.empty()) {
      input_errors_.add(change_.value.place,
                        "an entry in the list that " + change_.path + " goes into",
                        "an empty list");
      return;
    }
    // An index takes precedence over a name.
    if (const auto index = index_of(parts_[depth])) {
      if (*index < list.size()) {
        apply(list[*index], depth + 1);
      } else {
        input_errors_.add(change_.value.place,
                          fmt::format("an index from 0 to {} in {}, for lists are counted from 0{}",
                                      list.size() - 1, change_.path, numbers_in(list, depth)),
                          parts_[depth]);
      }
      return;
    }
    // Names need not be unique, so every table of that name changes.
    bool named = false;
    for (Node& element : list) {
      const Node* name = element.find("name");
      if (!name || !name->text() || *name->text() != parts_[depth]) continue;
      apply(element, depth + 1);
      named = true;
    }
    if (named) return;
    // Neither index nor name matched, so the path applies to every table of the list.
    for (Node& element : list) apply(element, depth);
  }

  const Change& change_;
  std::vector<std::string> parts_;
  InputErrors& input_errors_;
};

std::optional<Node> parsed_value(const std::string& text, const std::string& name) {
  try {
    const Node tree = parse_toml("value = " + text + "\n", name);
    // More than one entry means that the text holds a further key behind its value.
    if (tree.table()->size() == 1) return tree.table()->front().node;
  } catch (const BadInput&) {
    // may still be a bare word
  }
  return std::nullopt;
}

bool is_bare_word(const std::string& text) {
  return !text.empty() && text.find_first_of("\"'[]{}=#,\n\r\t") == std::string::npos &&
         text.front() != ' ' && text.back() != ' ';
}

void collect(const Node& table, const std::string& prefix, std::vector<Change>& changes) {
  for (const auto& [key, place, value] : *table.table()) {
    const std::string dotted = prefix.empty() ? key : prefix + "." + key;
    if (value.table()) {
      collect(value, dotted, changes);
    } else {
      changes.push_back({dotted, value});
    }
  }
}

// @throws BadInput naming the override if its value is neither TOML nor a bare word
Change parse_override(const Override& override) {
  const std::string name = override.path + "=" + override.value;
  // An override from the command line has no file, so messages name the option itself.
  const Place place = override.place
                          ? *override.place
                          : Place{std::make_shared<const std::string>("--set " + name), 0, 0, true};
  const auto refuse = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(*place.file, place.line, place.column, expected, seen);
  };
  // The editor recurses once per part, so the limit bounds the depth of the recursion.
  if (std::count(override.path.begin(), override.path.end(), '.') > 30)
    refuse("a path of at most 30 parts", "a longer one");
  Change change{override.path, {}};
  // A line break could begin a second key.
  const bool one_line = override.value.find_first_of("\n\r") == std::string::npos;
  if (const auto value = one_line ? parsed_value(override.value, name) : std::nullopt) {
    change.value = *value;
  } else if (one_line && is_bare_word(override.value)) {
    change.value.value = override.value;
  } else {
    refuse("a TOML value for " + override.path, override.value);
  }
  // All nodes of the value get the position of the override, because positions in the temporary
  // text mean nothing to the user.
  set_place(change.value, place);
  return change;
}

}  // namespace

Override make_override(const Change& change) {
  return {change.path, to_toml_value(change.value),
          std::make_shared<const Place>(change.value.place)};
}

std::vector<SectionFileReference> section_files(const Node& as_written, const path& folder,
                                                InputErrors& input_errors) {
  std::vector<SectionFileReference> found;
  const auto add = [&](const SectionFile& one, const Node& name) {
    if (name.text())
      found.push_back({one.dotted, name.place,
                       locate_file({*name.text(), name.place, one.kind}, folder, input_errors)});
  };
  // at_path() needs a mutable tree, so it works on a copy.
  Node tree = as_written;
  for (const SectionFile& one : sections_in_files) {
    const Node* section = at_path(tree, one.dotted);
    if (!section) continue;
    add(one, *section);
    if (section->array())
      for (const Node& part : *section->array()) add(one, part);
  }
  for (const SectionFile& one :
       {SectionFile{"part.file", "parts"}, SectionFile{"program.file", "programs"},
        SectionFile{"program.tools.file", "programs"},
        SectionFile{"program.offsets.file", "programs"}})
    if (const Node* name = at_path(tree, one.dotted)) add(one, *name);
  return found;
}

std::vector<Change> changes_from_set(const Node& set) {
  std::vector<Change> changes;
  if (set.table()) collect(set, "", changes);
  return changes;
}

std::optional<Node> read_tree(const path& file, InputErrors& input_errors) {
  try {
    Node tree = read_toml_file(file);
    make_data_files_absolute(tree, file.parent_path(), input_errors);
    make_variant_files_absolute(tree, file.parent_path(), input_errors);
    make_plug_ins_absolute(tree, file.parent_path());
    read_section_files(tree, file.parent_path(), input_errors);
    return tree;
  } catch (const BadInput& fault) {
    input_errors.add(fault);
    return std::nullopt;
  }
}

Node changed(Node tree, const std::vector<Change>& changes, const path& folder,
             InputErrors& input_errors) {
  for (const Change& change : changes) {
    Change one = change;
    make_data_files_absolute(one.value, folder, input_errors);
    if (last_component(one.path) == "file") make_absolute(one.value, "", folder, input_errors);
    TreeEditor(one, input_errors).apply(tree);
    // A change may itself name a file, and later changes may address values inside that file.
    make_plug_ins_absolute(tree, folder);
    read_section_files(tree, folder, input_errors);
  }
  return tree;
}

Node changed(Node tree, const std::vector<Override>& overrides, const path& folder,
             InputErrors& input_errors) {
  std::vector<Change> changes;
  for (const Override& override : overrides) {
    try {
      changes.push_back(parse_override(override));
    } catch (const BadInput& fault) {
      input_errors.add(fault);
    }
  }
  return changed(std::move(tree), changes, folder, input_errors);
}

namespace {

constexpr std::size_t max_copied_bytes = std::size_t(256) << 20;

/// Returns the offset of a position in the text of its file.
std::size_t offset_of(const std::string& text, const Place& place) {
  std::size_t at = 0;
  for (int line = 1; line < place.line; ++line) at = text.find('\n', at) + 1;
  return at + std::size_t(place.column - 1);
}

/// Returns the text with the quoted name at a position replaced.
std::string renamed(std::string text, const Place& place, const std::string& name) {
  const std::size_t from = offset_of(text, place);
  // The closing quote equals the opening one, single or double.
  const std::size_t to = text.find(text.at(from), from + 1);
  return text.replace(from + 1, to - from - 1, name);
}

/// Returns the last part of a dotted section, numbered from its second file on.
std::string name_of(const SectionFileReference& one, const std::vector<CopiedFile>& files) {
  std::string section = one.section;
  // The name of `part.file` is the section, since every copied file would else be called "file".
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

std::vector<CopiedFile> scene_copy(const std::filesystem::path& scene) {
  InputErrors input_errors;
  std::vector<CopiedFile> files;
  try {
    const Node tree = read_toml_file(scene);
    files.push_back({"scene.toml", read_text(scene, max_toml_bytes), scene});
    std::vector<SectionFileReference> sections =
        section_files(tree, scene.parent_path(), input_errors);
    if (!input_errors.empty()) throw BadScene(input_errors.list());
    // Sorted by position, so that the replacements below can run backwards through the text.
    std::ranges::sort(sections, {}, [](const SectionFileReference& one) {
      return std::tuple(one.place.line, one.place.column);
    });
    for (const SectionFileReference& one : sections)
      files.push_back({name_of(one, files), read_text(one.file, max_copied_bytes), one.file});
    // backwards, so that the positions of the earlier names remain valid
    for (std::size_t i = sections.size(); i-- > 0;)
      files.front().text = renamed(files.front().text, sections[i].place, files[i + 1].name);
  } catch (const BadInput& fault) {
    throw BadScene({fault});
  }
  return files;
}

}  // namespace abbe::sim
