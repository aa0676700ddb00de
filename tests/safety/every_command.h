#pragma once

#include "sim/commands/command.h"
#include "sim/commands/command_line.h"
#include "tests/safety/program_run.h"
#include "tests/test.h"

/// Calls of every command, for what must hold of all.
namespace abbe::safety {

struct CommandList {
  sim::CommonOptions common;
  int argc = 0;
  char** argv = nullptr;
  std::vector<sim::Command> commands = sim::all_commands(common, argc, argv);
};

struct CommandCall {
  std::string command;
  std::string arguments;
};

inline std::string gantry_dome_scene() { return (source / "scenes/gantry_dome.toml").string(); }

/// Writes what the calls read: a scene with its program, a study, readings, a result.
inline void write_inputs(const Folder& folder) {
  folder.write("scene.toml", small_scene("[errors]\nEXX_um = 5\n"));
  folder.write("p.ngc", small_program);
  folder.write("study.toml",
               "scene = \"scene.toml\"\n[[input]]\nelement = \"EXX\"\nspread = "
               "0.2\n[monte_carlo]\ncases = 2\n");
  const std::string here = "cd " + folder.path().string() + " &&";
  run("measure " + gantry_dome_scene() + " --instrument ball_bar --out readings", here);
  run("run scene.toml --out made", here);
}

/// Returns short calls that succeed in the folder of `write_inputs`, with words on standard output.
inline std::vector<CommandCall> small_calls() {
  std::vector<CommandCall> calls{{"new", "gantry first"},
                                 {"new", "--list"},
                                 {"run", "scene.toml"},
                                 {"compare", "scene.toml"},
                                 {"check", "scene.toml"},
                                 {"check", "scene.toml --collisions"},
                                 {"program", "p.ngc"},
                                 {"program", "p.ngc --to csv"},
                                 {"report", "scene.toml"},
                                 {"pose", "scene.toml --at \"X=0 Y=0 Z=95\""},
                                 {"pose", "scene.toml --grid X=0:1:2"},
                                 {"measure", gantry_dome_scene() + " --instrument ball_bar"},
                                 {"identify", "readings/ball_bar.csv --elements EXX --order 1"},
                                 {"evaluate", "readings/ball_bar.csv"},
                                 {"rewrite", "scene.toml --case perfect-position-program"},
                                 {"export", "scene.toml --case perfect-position-table"},
                                 {"study", "study.toml"},
                                 {"schema", ""},
                                 {"explain", "part.radius_mm"},
                                 {"help", ""}};
#if ABBE_RENDER
  calls.push_back({"render", "made"});
  calls.push_back({"animate", "scene.toml --film none --seconds 0.2 --fps 10 --size 320x240"});
#endif
  return calls;
}

/// Returns the commands that no call has; empty if every one is called.
inline std::string uncalled(const std::vector<sim::Command>& commands,
                            const std::vector<CommandCall>& calls) {
  std::string names;
  for (const sim::Command& command : commands)
    if (std::ranges::find(calls, command.name, &CommandCall::command) == calls.end() &&
        (ABBE_RENDER || (command.name != "render" && command.name != "animate")))
      names += command.name + " ";
  return names;
}

inline bool has_option(const sim::Command& command, const std::string& name) {
  for (const std::vector<sim::Option>& options : {command.options, command.required_choice})
    if (std::ranges::find(options, name, &sim::Option::name) != options.end()) return true;
  return false;
}

}  // namespace abbe::safety
