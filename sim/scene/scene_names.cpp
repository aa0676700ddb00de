#include "sim/scene/scene_names.h"

#include <algorithm>
#include <set>
#include <stdexcept>

#include "sim/scene/case_name.h"
#include "sim/scene/scene_tree.h"

namespace abbe::sim {
namespace {

using std::filesystem::path;

path plain(const path& file) { return std::filesystem::absolute(file).lexically_normal(); }

class Collector {
 public:
  explicit Collector(Named& named) : named_(named) {}

  void add_scene(const Node& tree, const path& file) {
    add_file(file);
    add_tree(tree);
    for (const Node* variant : tables(tree.find("variant"))) {
      const Node* set = variant->find("set");
      if (!set || !set->table()) continue;
      Faults reported_already;
      add_tree(changed(tree, changes_of_set(*set), file.parent_path(), reported_already));
    }
  }

 private:
  static std::vector<const Node*> tables(const Node* list) {
    if (!list) return {};
    if (list->table()) return {list};
    std::vector<const Node*> all;
    if (!list->array()) return all;
    for (const Node& one : *list->array())
      if (one.table()) all.push_back(&one);
    return all;
  }

  void add_tree(const Node& tree) {
    add_places(tree);
    add_program(tree.find("case"));
    if (const Node* compare = tree.find("compare"))
      if (const Node* cases = compare->find("cases"); cases && cases->array())
        for (const Node& one : *cases->array()) add_program(&one);
    for (const Node* instrument : tables(tree.find("instrument")))
      add_program(instrument->find("case"));
    const Node* at = &tree;
    for (const char* key : {"belief", "force", "training", "file"})
      at = at ? at->find(key) : nullptr;
    if (at && at->text()) add_training(plain(*at->text()));
  }

  /// The files from which nodes come, and those that they name.
  void add_places(const Node& node) {
    if (node.place.file && !node.place.typed && seen_.insert(*node.place.file).second)
      add_file(*node.place.file);
    if (const Node::Array* array = node.array())
      for (const Node& one : *array) add_places(one);
    if (const Node::Table* table = node.table())
      for (const Node::Entry& entry : *table) {
        if (entry.key == "file" && entry.node.text()) add_file(*entry.node.text());
        add_places(entry.node);
      }
  }

  void add_program(const Node* text) {
    const auto program = text ? program_named(*text) : std::nullopt;
    if (!program) return;
    add_file(program->program);
    const bool known = std::ranges::any_of(named_.programs, [&](const NamedProgram& one) {
      return one.program == program->program && one.file == program->file &&
             one.line == program->line && one.column == program->column;
    });
    if (!known) named_.programs.push_back(*program);
  }

  void add_training(const path& file) {
    if (!trainings_.insert(file).second) return;
    Faults reported_when_used;
    if (const auto tree = read_tree(file, reported_when_used)) add_scene(*tree, file);
  }

  void add_file(const path& file) {
    if (file.empty()) return;
    const path one = plain(file);
    if (std::ranges::find(named_.files, one) == named_.files.end()) named_.files.push_back(one);
  }

  Named& named_;
  std::set<std::string> seen_;
  std::set<path> trainings_;
};

}  // namespace

std::optional<NamedProgram> program_named(const Node& node) {
  const std::string* text = node.text();
  if (!text || text->find_first_of("./") == std::string::npos) return std::nullopt;
  try {
    return NamedProgram{plug_in_case(*text).plug_in, node.place.file ? *node.place.file : "",
                        node.place.line, node.place.column, node.place.typed};
  } catch (const std::invalid_argument&) {
    return std::nullopt;  // refused by the reader
  }
}

Named named_by(const Node& tree, const path& file) {
  Named named;
  Collector(named).add_scene(tree, file);
  return named;
}

}  // namespace abbe::sim
