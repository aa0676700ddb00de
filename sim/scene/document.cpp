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

// A section that may be stored in a file of its own: its dotted path, and the library folder that
// holds files of its kind.
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

// Returns the node at a dotted path, null if there is none. The path may be one quoted key or
// nested tables.
Node* find_path(Node& node, std::string_view dotted) {
  if (Node* value = node.find(dotted)) return value;
  const std::size_t dot = dotted.find('.');
  if (dot == std::string_view::npos) return nullptr;
  Node* section = node.find(dotted.substr(0, dot));
  return section ? find_path(*section, dotted.substr(dot + 1)) : nullptr;
}

std::string absolute(const std::string& name, const path& folder) {
  return std::filesystem::absolute(folder / name).lexically_normal().string();
}

std::string_view last_component(std::string_view dotted) {
  return dotted.substr(dotted.rfind('.') + 1);  // npos + 1 is 0
}

// Replaces a file name by its absolute path; a value that is not a string remains as it is.
void make_absolute(Node& node, const char* kind, const path& folder, InputErrors& input_errors) {
  if (const std::string* name = node.text())
    node.value =
        absolute(locate_file({*name, node.position, kind}, folder, input_errors).string(), "");
}

// Makes the value of every key `file` absolute; the format uses this key for data files only.
void make_data_files_absolute(Node& node, const path& folder, InputErrors& input_errors) {
  if (Node::Array* array = node.array()) {
    for (Node& element : *array) make_data_files_absolute(element, folder, input_errors);
  }
  if (Node::Table* table = node.table()) {
    for (auto& [key, position, value] : *table) {
      if (value.text()) {
        if (last_component(key) == "file") make_absolute(value, "", folder, input_errors);
      } else {
        make_data_files_absolute(value, folder, input_errors);
      }
    }
  }
}

// Makes the section files of a variant absolute. They are read when the variant is applied, which
// may happen in another folder.
void make_section_files_absolute(Node& set, const path& folder, InputErrors& input_errors) {
  for (const auto& [dotted, kind] : sections_in_files) {
    Node* section = find_path(set, dotted);
    if (!section) continue;
    make_absolute(*section, kind, folder, input_errors);
    if (Node::Array* list = section->array()) {
      for (Node& element : *list) make_absolute(element, kind, folder, input_errors);
    }
  }
}

void report_missing_file(const Node& section, const path& file, const char* kind,
                         const path& folder, InputErrors& input_errors) {
  const std::string known = library_names(kind, file.string());
  input_errors.add(
      section.position,
      "a file that can be read" + (known.empty() ? "" : ", or a library name: " + known),
      fmt::format(
          "no file {}; names are relative to the folder of the file that contains them, here {}",
          file.string(), absolute(".", folder)));
}

void read_section_file(Node& section, const char* kind, const path& folder,
                       InputErrors& input_errors) {
  const std::size_t error_count = input_errors.list().size();
  const path file = locate_file({*section.text(), section.position, kind}, folder, input_errors);
  // A name that cannot be located is reported already.
  if (input_errors.list().size() > error_count) return;
  std::error_code error_code;
  if (!std::filesystem::is_regular_file(file, error_code)) {
    report_missing_file(section, file, kind, folder, input_errors);
    return;
  }
  if (file.extension() != ".toml") {  // a program or a mesh itself
    // The short form `program = "part.ngc"` becomes a table with a `file` key, so that the readers
    // handle one form only.
    Node file_node;
    file_node.position = section.position;
    file_node.value = absolute(file.string(), "");
    section.value = Node::Table{{"file", section.position, file_node}};
    return;
  }
  try {
    Node content = read_toml_file(file);
    // Names inside the file are relative to the folder of that file, which is unknown later.
    make_data_files_absolute(content, file.parent_path(), input_errors);
    section = std::move(content);
  } catch (const BadInput& error) {
    input_errors.add(error);
  }
}

void read_section_files(Node& tree, const path& folder, InputErrors& input_errors) {
  for (const auto& [dotted, kind] : sections_in_files) {
    Node* section = find_path(tree, dotted);
    if (!section) continue;
    if (section->text()) read_section_file(*section, kind, folder, input_errors);
    const std::string_view name = last_component(dotted);
    // These sections may be lists whose elements are tables or file names.
    if (section->array() && (name == "errors" || name == "identified" || name == "tool")) {
      for (Node& element : *section->array()) {
        if (element.text()) read_section_file(element, kind, folder, input_errors);
      }
    }
  }
}

// Makes the files of plug-ins absolute. A case whose name has a dot or slash is such a file.
void make_plug_ins_absolute(Node& tree, const path& folder) {
  Node* cases = find_path(tree, "compare.cases");
  if (!cases || !cases->array()) return;
  for (Node& node : *cases->array())
    if (std::string* name = std::get_if<std::string>(&node.value))
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

// Sets the position of a node and of everything below it.
void set_position(Node& node, const SourcePosition& position) {
  node.position = position;
  if (Node::Array* array = node.array()) {
    for (Node& element : *array) set_position(element, position);
  }
  if (Node::Table* table = node.table()) {
    for (auto& [key, key_position, value] : *table) {
      key_position = position;
      set_position(value, position);
    }
  }
}

std::vector<std::string> path_components(const std::string& dotted) {
  std::vector<std::string> components(1);
  for (const char c : dotted) {
    if (c == '.') {
      components.emplace_back();
    } else {
      components.back() += c;
    }
  }
  return components;
}

std::optional<std::size_t> parse_index(const std::string& component) {
  std::size_t index = 0;
  const auto [end, error] =
      std::from_chars(component.data(), component.data() + component.size(), index);
  if (error != std::errc() || end != component.data() + component.size()) return std::nullopt;
  return index;
}

// Tables are merged key by key; any other value is replaced as a whole.
void merge(Node& target, const Node& value) {
  Node::Table* table = target.table();
  if (!table || !value.table()) {
    target = value;
    return;
  }
  for (const Node::Entry& entry : *value.table()) {
    if (Node* node = target.find(entry.key)) {
      merge(*node, entry.node);
    } else {
      table->push_back(entry);
    }
  }
}

/// Applies one change to a tree.
class TreeEditor {
 public:
  TreeEditor(const Change& change, InputErrors& input_errors)
      : change_(change), components_(path_components(change.path)), input_errors_(input_errors) {}

  void apply(Node& node, std::size_t depth = 0) const {
    if (depth == components_.size()) {
      merge(node, change_.value);
    } else if (node.table()) {
      apply_to_table(node, depth);
    } else if (node.array()) {
      apply_to_list(node, depth);
    } else {
      // Numbers and strings have nothing below them.
      input_errors_.add(change_.value.position,
                        fmt::format("a path to a value; {} has none below \"{}\"", change_.path,
                                    components_[depth - 1]),
                        display_text(node));
    }
  }

 private:
  void apply_to_table(Node& node, std::size_t depth) const {
    const std::string& key = components_[depth];
    if (key.empty()) {
      input_errors_.add(change_.value.position, "a dotted path such as part.vertices",
                        "\"" + change_.path + "\"");
      return;
    }
    // A missing section is created, so that an override can add it.
    if (!node.find(key)) {
      Node table;
      table.position = change_.value.position;
      table.value = Node::Table{};
      node.table()->push_back({key, change_.value.position, std::move(table)});
    }
    // The node is looked up again, because push_back() may have moved the entries.
    apply(*node.find(key), depth + 1);
  }

  /// Returns the numbers of the tables of a list, such as "; tool.0 has number 1, tool.1 has number
  /// 2". Users may take these numbers for indices.
  std::string numbers_in(const Node::Array& list, std::size_t depth) const {
    const std::string path =
        fmt::format("{}", fmt::join(components_.begin(), components_.begin() + long(depth), "."));
    std::string text;
    for (std::size_t i = 0; i < list.size(); ++i) {
      const Node* number = list[i].find("number");
      if (number)
        text += fmt::format("{} {}.{} has number {}", text.empty() ? ";" : ",", path, i,
                            display_text(*number));
    }
    return text;
  }

  void apply_to_list(Node& node, std::size_t depth) const {
    Node::Array& list = *node.array();
    if (list.empty()) {
      input_errors_.add(change_.value.position,
                        "a list with an entry for " + change_.path + " to change", "an empty list");
      return;
    }
    // An index takes precedence over a name.
    if (const auto index = parse_index(components_[depth])) {
      if (*index < list.size()) {
        apply(list[*index], depth + 1);
      } else {
        input_errors_.add(change_.value.position,
                          fmt::format("an index from 0 to {} in {}, as lists are numbered from 0{}",
                                      list.size() - 1, change_.path, numbers_in(list, depth)),
                          components_[depth]);
      }
      return;
    }
    // Names need not be unique; the change applies to every table of that name.
    bool named = false;
    for (Node& element : list) {
      const Node* name = element.find("name");
      if (!name || !name->text() || *name->text() != components_[depth]) continue;
      apply(element, depth + 1);
      named = true;
    }
    if (named) return;
    // The component is neither an index nor a name, hence a key in every table of the list.
    for (Node& element : list) apply(element, depth);
  }

  const Change& change_;
  std::vector<std::string> components_;
  InputErrors& input_errors_;
};

std::optional<Node> parse_value(const std::string& text, const std::string& name) {
  try {
    const Node tree = parse_toml("value = " + text + "\n", name);
    // A second entry means that the text contains another key after the value.
    if (tree.table()->size() == 1) return tree.table()->front().node;
  } catch (const BadInput&) {
    // The text may still be a bare word.
  }
  return std::nullopt;
}

bool is_bare_word(const std::string& text) {
  return !text.empty() && text.find_first_of("\"'[]{}=#,\n\r\t") == std::string::npos &&
         text.front() != ' ' && text.back() != ' ';
}

// Appends one change for every value in a table and the tables below it.
void append_changes(const Node& table, const std::string& prefix, std::vector<Change>& changes) {
  for (const auto& [key, position, value] : *table.table()) {
    const std::string dotted = prefix.empty() ? key : prefix + "." + key;
    if (value.table()) {
      append_changes(value, dotted, changes);
    } else {
      changes.push_back({dotted, value});
    }
  }
}

// @throws BadInput naming the override if its value is neither TOML nor a bare word
Change parse_override(const Override& override) {
  const std::string name = override.path + "=" + override.value;
  // An override from the command line has no file, so messages name the option itself.
  const SourcePosition position =
      override.position
          ? *override.position
          : SourcePosition{std::make_shared<const std::string>("--set " + name), 0, 0, true};
  const auto throw_input_error = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(*position.file, position.line, position.column, expected, seen);
  };
  // The editor recurses once per component, so the limit bounds the depth of the recursion.
  if (std::count(override.path.begin(), override.path.end(), '.') > 30)
    throw_input_error("a path of at most 30 components", "a longer path");
  Change change{override.path, {}};
  // A line break could begin a second key.
  const bool is_one_line = override.value.find_first_of("\n\r") == std::string::npos;
  if (const auto value = is_one_line ? parse_value(override.value, name) : std::nullopt) {
    change.value = *value;
  } else if (is_one_line && is_bare_word(override.value)) {
    change.value.value = override.value;
  } else {
    throw_input_error("a TOML value for " + override.path, override.value);
  }
  // Positions in the parsed text mean nothing to the user; messages name the override instead.
  set_position(change.value, position);
  return change;
}

}  // namespace

Override make_override(const Change& change) {
  return {change.path, to_toml_value(change.value),
          std::make_shared<const SourcePosition>(change.value.position)};
}

std::vector<Change> changes_from_set(const Node& set) {
  std::vector<Change> changes;
  if (set.table()) append_changes(set, "", changes);
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
  } catch (const BadInput& error) {
    input_errors.add(error);
    return std::nullopt;
  }
}

Node apply_changes(Node tree, const std::vector<Change>& changes, const path& folder,
                   InputErrors& input_errors) {
  for (const Change& change : changes) {
    Change resolved_change = change;
    make_data_files_absolute(resolved_change.value, folder, input_errors);
    if (last_component(resolved_change.path) == "file")
      make_absolute(resolved_change.value, "", folder, input_errors);
    TreeEditor(resolved_change, input_errors).apply(tree);
    // The change may name a file, and later changes may address values inside that file.
    make_plug_ins_absolute(tree, folder);
    read_section_files(tree, folder, input_errors);
  }
  return tree;
}

Node apply_changes(Node tree, const std::vector<Override>& overrides, const path& folder,
                   InputErrors& input_errors) {
  std::vector<Change> changes;
  for (const Override& override : overrides) {
    try {
      changes.push_back(parse_override(override));
    } catch (const BadInput& error) {
      input_errors.add(error);
    }
  }
  return apply_changes(std::move(tree), changes, folder, input_errors);
}

namespace {

constexpr std::size_t max_copied_bytes = std::size_t(256) << 20;

/// Returns the offset of a position in the text of its file.
std::size_t text_offset(const std::string& text, const SourcePosition& position) {
  std::size_t offset = 0;
  for (int line = 1; line < position.line; ++line) offset = text.find('\n', offset) + 1;
  return offset + std::size_t(position.column - 1);
}

/// Replaces the quoted file name at a position of the text.
std::string replace_file_name(std::string text, const SourcePosition& position,
                              const std::string& name) {
  const std::size_t begin = text_offset(text, position);
  // The quotes may be single or double; both ends have the same.
  const std::size_t end = text.find(text.at(begin), begin + 1);
  return text.replace(begin + 1, end - begin - 1, name);
}

/// A section of a scene that is stored in a file of its own.
struct SectionFileReference {
  std::string section;      ///< dotted: "belief.identified"; "part.file" for a mesh or a program
  SourcePosition position;  ///< position of the file name
  std::filesystem::path file;
};

/// Returns the sections, mesh and program that a scene takes from files.
/// @param as_written  the scene file alone, without the contents of its section files
/// @param folder  folder of the scene
std::vector<SectionFileReference> section_files(const Node& as_written, const path& folder,
                                                InputErrors& input_errors) {
  std::vector<SectionFileReference> references;
  const auto add = [&](const SectionFile& section_file, const Node& name) {
    if (name.text())
      references.push_back(
          {section_file.dotted, name.position,
           locate_file({*name.text(), name.position, section_file.kind}, folder, input_errors)});
  };
  // find_path() needs a mutable tree.
  Node tree = as_written;
  for (const SectionFile& section_file : sections_in_files) {
    const Node* section = find_path(tree, section_file.dotted);
    if (!section) continue;
    add(section_file, *section);
    if (section->array())
      for (const Node& element : *section->array()) add(section_file, element);
  }
  for (const SectionFile& section_file :
       {SectionFile{"part.file", "parts"}, SectionFile{"program.file", "programs"},
        SectionFile{"program.tools.file", "programs"},
        SectionFile{"program.offsets.file", "programs"}})
    if (const Node* name = find_path(tree, section_file.dotted)) add(section_file, *name);
  return references;
}

/// Returns the file name of a section in the copy, such as "machine.toml"; further files of the
/// same section are numbered from 2.
std::string copied_file_name(const SectionFileReference& reference,
                             const std::vector<CopiedFile>& files) {
  std::string section = reference.section;
  // `part.file` is named after its section; otherwise its copy would be called "file".
  if (section.ends_with(".file")) section.resize(section.rfind('.'));
  section.erase(0, section.rfind('.') + 1);
  const std::string ending = reference.file.extension().string();
  std::string name = section + ending;
  const auto is_taken = [&] {
    return std::ranges::any_of(files, [&](const CopiedFile& file) { return file.name == name; });
  };
  for (int k = 2; is_taken(); ++k) name = fmt::format("{}_{}{}", section, k, ending);
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
    // In the order of their positions, for the replacements below.
    std::ranges::sort(sections, {}, [](const SectionFileReference& reference) {
      return std::tuple(reference.position.line, reference.position.column);
    });
    for (const SectionFileReference& reference : sections)
      files.push_back({copied_file_name(reference, files),
                       read_text(reference.file, max_copied_bytes), reference.file});
    // Backwards through the text, so that the positions of earlier names remain valid.
    for (std::size_t i = sections.size(); i-- > 0;)
      files.front().text =
          replace_file_name(files.front().text, sections[i].position, files[i + 1].name);
  } catch (const BadInput& error) {
    throw BadScene({error});
  }
  return files;
}

}  // namespace abbe::sim
