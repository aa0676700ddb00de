#include "sim/commands/help_commands.h"

#include <algorithm>
#include <memory>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/commands/command.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/report/key_reference.h"
#include "sim/scene/scene_fields.h"
#include "sim/study/study_fields.h"

namespace abbe::sim {

/// A topic of `abbe help`: background for reading the figures of abbe.
struct HelpTopic {
  std::string name, summary, text;
};

const std::vector<HelpTopic>& help_topics();

namespace {

/// Returns the part of a prefix after the path of a table if another part follows it; else empty.
std::string next_key_part(const std::string& table, const std::string& prefix) {
  if (!prefix.starts_with(table)) return "";
  const std::size_t end = prefix.find('.', table.size());
  return end == std::string::npos ? "" : prefix.substr(table.size(), end - table.size());
}

/// Returns true if a key has the name, also among keys that values enable.
bool has_key(const std::vector<Key>& keys, const std::string& name) {
  return std::ranges::any_of(keys, [&](const Key& key) {
    return key.name == name || std::ranges::any_of(key.choices, [&](const EnumChoice& choice) {
             return has_key(choice.keys, name);
           });
  });
}

/// Returns the index or name of one table of a list in a prefix, with a dot; else empty.
std::string table_selector(const Key& list, const std::string& path, const std::string& prefix) {
  const std::string part = next_key_part(path, prefix);
  return part.empty() || has_key(list.keys, part) ? "" : part + ".";
}

/// Returns the name of a key; of a key with a pattern, the name that the prefix contains.
std::string matching_name(const Key& key, const std::string& table, const std::string& prefix) {
  const std::string part = next_key_part(table, prefix);
  const bool one =
      !key.pattern.empty() && !part.empty() && std::regex_match(part, std::regex(key.pattern));
  return one ? part : key.name;
}

/// Returns the paths of keys and of the keys below them, in order; keys that a value enables come
/// after that value's key.
std::vector<std::string> key_paths(const std::vector<Key>& keys, const std::string& table,
                                   const std::string& prefix) {
  std::vector<std::string> paths;
  const auto append = [&](const std::vector<std::string>& more) {
    paths.insert(paths.end(), more.begin(), more.end());
  };
  for (const Key& key : keys) {
    const std::string path = table + matching_name(key, table, prefix);
    if (key.keys.empty() || key.or_file) paths.push_back(path);
    std::string below = path + ".";
    if (key.kind == Key::Kind::Tables) below += table_selector(key, below, prefix);
    append(key_paths(key.keys, below, prefix));
    for (const EnumChoice& choice : key.choices) append(key_paths(choice.keys, table, prefix));
  }
  return paths;
}

}  // namespace

std::vector<Key> all_keys() {
  std::vector<Key> keys = scene_keys();
  Key study;
  study.name = "study";
  study.sentence = "a study, in a separate file";
  study.kind = Key::Kind::Table;
  study.keys = study::study_keys();
  keys.push_back(std::move(study));
  return keys;
}

std::vector<Key> keys_of(const std::string& section) {
  std::vector<Key> keys = keys_at(all_keys(), section);
  if (keys.empty())
    throw BadUsage("--of", "expected scene, study or a section of either, seen " + section);
  return keys;
}

std::vector<std::string> settable_keys(const std::string& prefix) {
  const std::vector<Key> keys = prefix.starts_with("study") ? all_keys() : scene_keys();
  std::vector<std::string> found;
  std::set<std::string> seen;
  for (const std::string& path : key_paths(keys, "", prefix))
    if (path.starts_with(prefix) && seen.insert(path).second) found.push_back(path);
  // A key that several values enable is listed once.
  return found;
}

namespace {

constexpr const char* frames = R"(Frames and axes

A structural code lists the moving parts from the workpiece via the bed to the tool: w C' b X Y Z A s t.
  w  workpiece    b  bed    s  spindle nose    t  tool tip    capitals: the carriages of the axes

T_bt is the pose of frame t in frame b. Adjacent letters cancel: T_wt = T_wb * T_bt is the tool in the
workpiece, the pose that cuts. The z axis of t is the tool axis, from the tip to the spindle.

A primed axis carries the workpiece. A positive command moves the tool in the positive direction
relative to the workpiece (ISO 841), so a primed carriage itself moves the opposite way.

Internal units are mm, rad, s, N and K; any other unit is part of the name: residual_um, lead_deg.
More: kinematics/README.md; abbe check SCENE prints the chain of a machine, abbe pose SCENE its poses.
)";

constexpr const char* signs = R"(Signs of errors

A deviation is actual minus nominal pose of the carriage itself, at the commanded position. Elements are
named as in ISO 230-1: EXX is the positioning of X, EYX its straightness in Y, ECX its yaw about Z; EC0Y is a
location error, the squareness of Y to X.

Effect on the tip relative to the workpiece: an axis on the tool side contributes its displacement, a
primed axis the negative of it, rotated into the workpiece frame. EXX = +5 um: an X carriage on the tool
side travels too far, and the tip is at +5 um in the workpiece; with a primed X it is at -5 um.

More: errors/README.md defines the sign of every element; abbe pose SCENE --elements shows each at a pose.
)";

constexpr const char* residual = R"(The residual

A residual is the distance from the design surface to the machined surface along the outward normal of the
design: plus is material left, minus is a gouge.

alignment states what is removed first; every picture shows it too:
  none    nothing           offset  the mean           rigid  a displacement and a rotation

PV, RMS and mean cover the vertices that are cut within the search band. The numbers of vertices not cut
and gouged deeper than the band are stated next to them, with a warning.

More: scenes/README.md, cutting/README.md; abbe explain part.alignment describes the key.
)";

constexpr const char* cases = R"(Cases

error_free     the machine without errors: only sampling and cusps remain
uncompensated  the machine with errors, as programmed
BELIEF-STRATEGY-CHANNEL  a compensator, as in perfect-iterated-ideal
  belief    its model of the machine: perfect, identified, thermal, composite, force, part, fused
  strategy  how corrections are computed from it: position, decoupled, iterated
  channel   how they reach the axes: ideal, program, pulses, open, origin, table, piezo
A name with a dot or a slash is the file of your own compensator: ./mine.py

[compare] cases lists those of a scene, abbe run --case NAME cuts one, abbe --cases SCENE prints the names.
More: scenes/README.md, [belief] and [compare]; sim/compensation/README.md for your own compensators.
)";

constexpr const char* files = R"(Files

A scene (TOML) specifies machine, errors, tool, part and program, each in the scene or in a separate file.
A file name is relative to the file that contains it; library:NAME means a file that comes with abbe.
--set KEY=VALUE changes any value by its path. In a list, instrument.kind=... changes every entry,
instrument.0.kind=... the first (counted from 0), instrument.NAME.kind=... the entry of that name.

Results go into the folder of --out (out/SCENE), which must be new, empty or created by abbe; --force allows
any other. Input files are never overwritten. The folder contains:
  summary.json     figures, warnings, versions        residual.vtp   the map of a case, for ParaView
  comparison.json  figures of every case              comparison.png the maps on one colour scale
  scene.toml       the scene with every value; reproduces the results bit for bit
An error in a file is reported as FILE:LINE:COLUMN: expected ..., seen ..., with exit code 3.
More: scenes/README.md, scenes/studies/README.md; abbe --keys lists the keys of a scene.
)";

}  // namespace

const std::vector<HelpTopic>& help_topics() {
  static const std::vector<HelpTopic> topics{
      {"frames", "frames, axes and units", frames},
      {"signs", "signs of errors", signs},
      {"residual", "what the map of a part shows", residual},
      {"cases", "names of cases: belief-strategy-channel", cases},
      {"files", "input files, and where results are written", files}};
  return topics;
}

namespace {

std::string row(const std::string& name, const std::string& summary) {
  return fmt::format("  {:<10} {}\n", name, summary);
}

/// Returns the list of topics and commands.
std::string topic_list(const std::string& commands) {
  std::string text = "Topics, abbe help TOPIC:\n";
  std::vector<HelpTopic> topics(help_topics().begin(), help_topics().end());
  std::ranges::sort(topics, {}, &HelpTopic::name);
  for (const HelpTopic& topic : topics) text += row(topic.name, topic.summary);
  return text + "\nCommands, abbe help COMMAND:\n" + commands;
}

/// Prints a topic; without a valid name the list. Names of commands never arrive here.
Exit print_help(const std::string& name, const std::string& commands) {
  const auto topic = std::ranges::find(help_topics(), name, &HelpTopic::name);
  print("{}", MultilineText(topic == help_topics().end() ? topic_list(commands) : topic->text));
  return Exit::Ok;
}

}  // namespace

Command help_command(const std::vector<Command>& others) {
  const std::string summary = "Explain a topic or a command; without one, list both";
  const auto name = std::make_shared<std::string>();
  std::vector<std::string> names;
  std::string commands;
  for (const HelpTopic& topic : help_topics()) names.push_back(topic.name);
  for (const Command& command : others) {
    names.push_back(command.name);
    commands += row(command.name, command.summary);
  }
  return {"help",
          summary,
          {"abbe help", "abbe help residual", "abbe help run"},
          {{"TOPIC", name.get(), "a topic or a command", OneOf{names}, OptionalArgument{}}},
          [name, text = commands + row("help", summary)] { return print_help(*name, text); }};
}

namespace {

/// Prints the rows of a key.
/// @throws BadUsage with the nearest key
Exit print_explanation(const std::string& question) {
  const std::vector<Key> keys = all_keys();
  const std::vector<KeyRow> rows = matching_key_rows(keys, question);
  if (rows.empty()) {
    std::set<std::string> known;
    // A query without dots is compared with bare names, because paths would always be far from it.
    const bool dotted = question.find('.') != std::string::npos;
    for (const KeyRow& row : key_rows(keys))
      known.insert(dotted ? row.path : row.path.substr(row.path.rfind('.') + 1));
    const auto meant = nearest(question, known);
    throw BadUsage("KEY", fmt::format("expected a key of a scene or study{}, seen {}",
                                      meant ? " (nearest: " + *meant + ")" : "", question));
  }
  print("{}", MultilineText(to_text(rows)));
  return Exit::Ok;
}

}  // namespace

Command explain_command() {
  const auto key = std::make_shared<std::string>();
  return {"explain",
          "Explain a key of a scene or study: unit, range, default",
          {"abbe explain part.radius_mm", "abbe explain study.monte_carlo"},
          {{"KEY", key.get(),
            "part.radius_mm, a section such as view, study.monte_carlo, or radius_mm"}},
          [key] { return print_explanation(*key); }};
}

namespace {

/// Prints the schema of a scene, a study or a section.
Exit print_schema(const std::string& section) {
  const std::vector<Key> keys = section == "scene" ? scene_keys() : keys_of(section);
  print("{}", MultilineText(json_text(schema(keys, "abbe: " + section))));
  return Exit::Ok;
}

}  // namespace

Command schema_command() {
  const auto section = std::make_shared<std::string>("scene");
  return {"schema",
          "Print the JSON Schema of a scene or of a file for one of its sections, for editors",
          {"abbe schema", "abbe schema --of study"},
          {{"--of", section.get(),
            "scene, study, or a section that may be a file: machine, errors, tool, belief.force"}},
          [section] { return print_schema(*section); },
          "An editor with TOML support (Taplo, Even Better TOML) completes keys and marks mistakes "
          "if the first line of a scene is  #:schema FILE"};
}

}  // namespace abbe::sim
