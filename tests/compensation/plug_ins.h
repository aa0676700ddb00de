#pragma once

#include <sys/stat.h>
#include <sys/wait.h>
#include "kinematics/axes.h"
#include "sim/compensation/plug_in.h"
#include "tests/kinematics/machines.h"
#include "tests/test.h"

/// Plug-ins that the tests write, and what they ask them.
namespace abbe::sim::compensation {

/// A question about the gantry: `samples` commands a tenth of a second apart.
struct Asked {
  explicit Asked(int samples) {
    const kinematics::Chain chain = machines::gantry();
    task.structure = "w C' b X Y Z A s t";
    task.joints = chain.joints();
    task.tool = "ball R5";
    task.tool_length = 90.0;
    std::mt19937_64 random(20250301);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (int i = 0; i < samples; ++i) {
      kinematics::AxisState state;
      state.q.resize(6);
      state.q << unit(random), 300 * unit(random), 300 * unit(random), 150 + 200 * unit(random),
          unit(random), 0.0;
      state.time_s = 0.1 * i;
      state.direction = {1, -1, 0, 1, 0, 0};
      state.spindle_speed = 314.0;
      T_wt.push_back(chain.tool_in_workpiece(state.q));
      commands.push_back(state);
    }
  }
  PlugInResponse answer(const fs::path& plug_in, const PlugInOptions& options = {}) const {
    return ask(plug_in, task, {commands, T_wt}, options);
  }

  PlugInTask task;
  std::vector<kinematics::AxisState> commands;
  std::vector<kinematics::Pose> T_wt;
};

/// Whether a process of that number still runs; one that is dead and not yet reaped does not.
inline bool runs(long pid) {
  std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  std::getline(stat, text);
  const std::size_t name_end = text.rfind(')');
  return name_end != std::string::npos && text.size() > name_end + 2 && text[name_end + 2] != 'Z';
}

inline long open_files() {
  return std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator());
}

/// A folder for plug-ins. After every test no child is left, dead or alive, and no file is open.
class PlugIns : public testing::Test {
 protected:
  PlugIns() : files_before_(open_files()) {
    std::string name = (fs::temp_directory_path() / "abbe_plug_in_XXXXXX").string();
    folder = mkdtemp(name.data());
  }
  ~PlugIns() override { fs::remove_all(folder); }

  void TearDown() override {
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1) << "a child is left";
    EXPECT_EQ(errno, ECHILD);
    EXPECT_EQ(open_files(), files_before_);
  }

  fs::path written(const std::string& name, const std::string& text,
                   bool executable = false) const {
    const fs::path file = folder / name;
    std::ofstream(file, std::ios::binary) << text;
    ::chmod(file.c_str(), executable ? 0755 : 0644);
    return file;
  }

  /// A Python program: hears the task, then does what `text` says.
  fs::path python(const std::string& text, const std::string& name = "mine.py") const {
    return written(name, R"(import json, os, signal, sys, time
def say(message): print(json.dumps(message))
def hear(): return json.loads(sys.stdin.readline())
def ready(answers="correction"):
    say({"abbe": 1, "kind": "ready", "name": "mine", "answers": answers})
def rows(ask, row=[0] * 6): return [row for q in ask["q"]]
task = hear()
)" + text);
  }

  /// A shared library of a C text.
  fs::path library(const std::string& text, const std::string& name = "mine.so") const {
    const fs::path source = written("mine.c", "#include <abbe_compensator.h>\n" + text);
    return compiled("-I '" ABBE_SOURCE_DIR "/sim/compensation' '" + source.string() + "'", name);
  }

  fs::path compiled(const std::string& arguments, const std::string& name) const {
    const fs::path file = folder / name;
    const std::string command =
        ABBE_C_COMPILER " -std=c99 -Wall -Wextra -Wpedantic -Werror -shared -fPIC -O2 -o '" +
        file.string() + "' " + arguments;
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    return file;
  }

  /// The text of the failure that a plug-in brings.
  std::string failure(const fs::path& plug_in, const PlugInOptions& options = {},
                      int samples = 3) const {
    return thrown_text<PlugInFailure>([&] { Asked(samples).answer(plug_in, options); },
                                      "no failure");
  }

  fs::path folder;

 private:
  long files_before_;
};

}  // namespace abbe::sim::compensation
