#include "sim/commands/library_list.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/scene/bad_scene.h"
#include "sim/scene/library.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {
namespace {

using kinematics::Motion;
using std::filesystem::path;

constexpr double many_turns = 10000.0;  // degrees

/// The first comment of a file, which says what it is.
std::string first_comment(const path& file) {
  const std::string text = read_text(file, max_toml_bytes);
  const std::string line = text.substr(0, text.find('\n'));
  return line.starts_with("# ") ? line.substr(2) : std::string();
}

ListedKind listed_kind(const std::string& name, const path& library) {
  const path file = library / "new" / (name + ".toml");
  const Node scene = read_toml_file(file);
  const Node* machine = scene.find("machine");
  const std::string* of = machine != nullptr ? machine->text() : nullptr;
  return {name, first_comment(file), of != nullptr ? path(*of).stem().string() : std::string()};
}

ListedMachine listed_machine(const path& file) {
  Faults faults;
  const MachineDescription machine = read_machine(read_toml_file(file), faults);
  if (!faults.empty()) throw BadScene(faults.list());
  ListedMachine listed{file.stem().string(),
                       machine.summary,
                       to_string(kinematics::topology_of(machine.joints)),
                       {}};
  for (const kinematics::Joint& joint : machine.joints) {
    if (joint.motion == Motion::Spindle || joint.name == 'S') continue;
    const bool turns = joint.motion == Motion::Rotary;
    const double unit = turns ? units::deg : 1.0;
    const double min = joint.min / unit, max = joint.max / unit;
    listed.axes.push_back(
        {joint.name, turns, turns ? max - min < many_turns : max < 1e8, min, max});
  }
  std::ranges::sort(listed.axes, {},
                    [](const ListedAxis& axis) { return std::pair(axis.turns, axis.name); });
  return listed;
}

}  // namespace

LibraryList library_list(const std::vector<std::string>& kinds) {
  const path library = library_folder();
  LibraryList list;
  for (const std::string& kind : kinds) list.kinds.push_back(listed_kind(kind, library));
  for (const auto& entry : std::filesystem::directory_iterator(library / "machines"))
    if (entry.path().extension() == ".toml") list.machines.push_back(listed_machine(entry.path()));
  std::ranges::sort(list.machines, {}, &ListedMachine::name);
  return list;
}

std::string travel_text(const ListedMachine& machine) {
  std::string slides, turns;
  for (const ListedAxis& axis : machine.axes) {
    std::string& text = axis.turns ? turns : slides;
    text += text.empty() ? "" : ", ";
    if (!axis.ends)
      text += fmt::format("{} any", axis.name);
    else if (axis.turns)
      text += fmt::format("{} {:.6g} .. {:.6g}", axis.name, axis.min, axis.max);
    else
      text += fmt::format("{} {:.6g}", axis.name, axis.max - axis.min);
  }
  if (!slides.empty()) slides += " mm";
  if (!turns.empty()) slides += (slides.empty() ? "" : "; ") + turns + " deg";
  return slides;
}

std::string to_text(const LibraryList& list) {
  std::string text = "kinds, for abbe new KIND DIR\n";
  for (const ListedKind& kind : list.kinds)
    text += fmt::format("  {:<20} {} (machine {})\n", kind.name, kind.summary, kind.machine);
  text += "\nmachines, for machine = \"library:NAME\" and abbe program --machine NAME\n";
  for (const ListedMachine& machine : list.machines)
    text += fmt::format("  {:<20} {}\n  {:<20} {}; {}\n", machine.name, machine.summary, "",
                        machine.code, travel_text(machine));
  return text;
}

nlohmann::ordered_json to_json(const LibraryList& list) {
  nlohmann::ordered_json kinds = nlohmann::ordered_json::array(), machines = kinds;
  for (const ListedKind& kind : list.kinds)
    kinds.push_back({{"name", kind.name}, {"summary", kind.summary}, {"machine", kind.machine}});
  for (const ListedMachine& machine : list.machines) {
    nlohmann::ordered_json axes = nlohmann::ordered_json::object();
    for (const ListedAxis& axis : machine.axes) {
      nlohmann::ordered_json travel;
      if (axis.ends) travel = {axis.min, axis.max};
      axes[std::string(1, axis.name)] = {{"unit", axis.turns ? "deg" : "mm"}, {"travel", travel}};
    }
    machines.push_back({{"name", machine.name},
                        {"summary", machine.summary},
                        {"code", machine.code},
                        {"axes", axes}});
  }
  return {{"kinds", kinds}, {"machines", machines}};
}

}  // namespace abbe::sim
