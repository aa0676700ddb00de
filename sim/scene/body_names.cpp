#include "sim/scene/body_names.h"

#include <algorithm>
#include <array>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace abbe::sim {
namespace {

/// What a search names itself.
constexpr std::array own_names{"part", "stock", "cutter", "shank", "holder"};

bool is_own_name(const std::string& name) {
  return std::ranges::find(own_names, name) != own_names.end();
}

std::string carrier_of(const MachineDescription& machine, const MachineBody& body) {
  return body.joint ? std::string(1, machine.joints[std::size_t(*body.joint)].name) : "b";
}

/// "fixture" of one, "fixture 2" of several. @param of  " of X", or empty
std::string numbered(const char* word, int number, int count, const std::string& of) {
  return count == 1 ? word + of : fmt::format("{} {}{}", word, number, of);
}

/// The tables of a list, or the table alone.
std::vector<const Node*> tables_of(const Node* list) {
  std::vector<const Node*> tables;
  if (list != nullptr && list->table() != nullptr) tables.push_back(list);
  if (list != nullptr && list->array() != nullptr)
    for (const Node& one : *list->array()) tables.push_back(&one);
  return tables;
}

/// Refuses names that are taken. @param taken  whose they are; those of `names` are put there
void check_free(Faults& faults, const std::vector<const Node*>& tables,
                const std::vector<std::string>& names, const char* of,
                std::map<std::string, std::string> taken) {
  if (tables.size() != names.size()) return;  // a table among them was refused
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Node* stated = tables[i]->find("name");
    const Place& place = stated != nullptr ? stated->place : tables[i]->place;
    const auto whose = is_own_name(names[i])
                           ? fmt::format("the name of the {} itself", names[i])
                           : (taken.contains(names[i]) ? taken[names[i]] : std::string());
    if (!whose.empty())
      faults.add(place, fmt::format("a name for {} that nothing else has", of),
                 fmt::format("\"{}\", {}", names[i], whose));
    taken.emplace(names[i], fmt::format("that of {} before it", of));
  }
}

}  // namespace

std::vector<std::string> body_names(const MachineDescription& machine) {
  std::map<std::string, int> count, number;
  for (const MachineBody& one : machine.bodies)
    count[carrier_of(machine, one)] += one.body.name.empty();
  std::vector<std::string> names;
  for (const MachineBody& one : machine.bodies) {
    const std::string carrier = carrier_of(machine, one);
    names.push_back(one.body.name.empty()
                        ? numbered("body", ++number[carrier], count[carrier], " of " + carrier)
                        : one.body.name);
  }
  return names;
}

std::vector<std::string> fixture_names(const std::vector<BodyDescription>& fixtures) {
  const auto count = int(std::ranges::count(fixtures, std::string(), &BodyDescription::name));
  int number = 0;
  std::vector<std::string> names;
  for (const BodyDescription& one : fixtures)
    names.push_back(one.name.empty() ? numbered("fixture", ++number, count, "") : one.name);
  return names;
}

void check_body_names(TableReader& machine, const MachineDescription& described) {
  check_free(machine.faults(), tables_of(machine.know("body")), body_names(described),
             "a body of the machine", {});
}

void check_fixture_names(TableReader& scene, const Scene& described) {
  std::map<std::string, std::string> taken;
  for (const std::string& name : body_names(described.machine))
    taken.emplace(name, "that of a body of the machine");
  check_free(scene.faults(), tables_of(scene.know("fixture")), fixture_names(described.fixtures),
             "a fixture", std::move(taken));
}

void check_ignored_names(TableReader& scene, const Scene& described) {
  const Node* collision = scene.know("collision");
  if (collision == nullptr || !scene.faults().empty()) return;
  std::vector<std::string> names = body_names(described.machine);
  for (const std::string& name : fixture_names(described.fixtures)) names.push_back(name);
  names.insert(names.end(), own_names.begin(), own_names.end());
  for (const Node* pair : tables_of(collision->find("ignore"))) {
    const Node *a = pair->find("a"), *b = pair->find("b");
    for (const Node* one : {a, b})
      if (std::ranges::find(names, *one->text()) == names.end())
        scene.faults().add(
            one->place, fmt::format("the name of a body: {}", fmt::join(names, ", ")), shown(*one));
    if (*a->text() == *b->text())
      scene.faults().add(b->place, "the name of another body than collision.ignore.a", shown(*b));
  }
}

}  // namespace abbe::sim
