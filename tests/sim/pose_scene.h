#pragma once

#include "sim/cut/pose_table.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/scene_folder.h"
#include "tests/test.h"

namespace abbe::sim {

inline fs::path scenes() { return fs::path(ABBE_SOURCE_DIR) / "scenes"; }

/// A scene of which only the machine and what is wrong with it matter.
inline std::string idle_scene(const std::string& machine, const std::string& more = {},
                              const std::string& tool = "ball_r5") {
  const bool turned = tool != "ball_r5";
  const char* program = turned ? "generator = \"spiral\"\nspeed_rpm = 150\nfeed_um_per_rev = 20\n"
                               : "generator = \"raster\"\nstep_over_mm = 1\nstep_mm = 1\n"
                                 "feed_mm_per_min = 1000\n";
  return fmt::format(
      "machine = \"{0}/machines/{1}.toml\"\ntool = \"{0}/tools/{2}.toml\"\n"
      "[part]\nsurface = \"disc\"\nradius_mm = 10.0\nvertices = 100\n[program]\n{3}{4}",
      scenes().string(), machine, tool, program, more);
}

inline IdleMachine idle_of(const std::string& toml) {
  const SceneFolder folder;
  return idle_machine(read_scene(folder.write("idle.toml", toml)));
}

inline IdleMachine idle_of(const fs::path& scene, const std::vector<Override>& changes = {}) {
  return idle_machine(read_scene(scene, changes));
}

inline const IdleMachine& idle_gantry() {
  static const IdleMachine idle = idle_of(scenes() / "gantry_dome.toml");
  return idle;
}

/// Poses anywhere within the travel (turns without limits: within a turn), and at its ends.
inline std::vector<kinematics::AxisState> any_states(const IdleMachine& idle, int count,
                                                     unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<kinematics::AxisState> states(std::size_t(count), kinematics::AxisState{});
  for (auto& state : states) {
    state.q = kinematics::AxisVector::Zero(idle.machine.nominal.size());
    for (int j = 0; j < idle.machine.nominal.size(); ++j) {
      const kinematics::Joint& joint = idle.machine.nominal.joints()[std::size_t(j)];
      if (!is_positioned(joint)) continue;
      const double least =
          std::max(joint.min, joint.motion == kinematics::Motion::Linear ? -1e3 : -pi);
      const double most =
          std::min(joint.max, joint.motion == kinematics::Motion::Linear ? 1e3 : pi);
      const double draw = unit(random);
      state.q[j] = draw < 0.05 ? least : draw > 0.95 ? most : least + (most - least) * unit(random);
    }
  }
  return states;
}

/// The states as a table of poses, every number with all its digits.
inline std::string csv_of(const IdleMachine& idle,
                          const std::vector<kinematics::AxisState>& states) {
  std::string text;
  std::vector<int> joints;
  for (int j = 0; j < idle.machine.nominal.size(); ++j)
    if (is_positioned(idle.machine.nominal.joints()[std::size_t(j)])) joints.push_back(j);
  for (const int j : joints) {
    const auto& joint = idle.machine.nominal.joints()[std::size_t(j)];
    text += fmt::format("{}{}_{}", text.empty() ? "" : ",", joint.name, position_unit_label(joint));
  }
  for (const auto& state : states)
    for (std::size_t k = 0; k < joints.size(); ++k) {
      const auto& joint = idle.machine.nominal.joints()[std::size_t(joints[k])];
      // degrees that are within the travel again once they are read
      const double unit = position_unit(joint);
      double number = state.q[joints[k]] / unit;
      if (number * unit > joint.max || number * unit < joint.min) number *= 1.0 - 1e-15;
      text += fmt::format("{}{}", k > 0 ? "," : "\n", number);
    }
  return text + "\n";
}

/// Cells of a table that abbe wrote, head first.
inline std::vector<std::vector<std::string>> cells_of_csv(const std::string& text) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    rows.emplace_back();
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(cell);
  }
  return rows;
}

inline std::string table_text(const PoseTable& table, const PoseList& poses, TableFormat format) {
  std::string text;
  write_poses(table, poses, format, [&](std::string_view piece) { text += piece; });
  return text;
}

/// A scene of each machine of the library with everything wrong that it can have.
struct WrongMachine {
  std::string name, toml;
};
inline std::vector<WrongMachine> wrong_machines(double scale = 1.0) {
  const auto elements = [&](const std::string& slides, const std::string& turns, bool nose,
                            const std::string& constants, const std::string& about_spindle = {}) {
    std::string text = fmt::format("[errors]\nscale = {}\n", scale) + constants;
    if (nose) text += "EXS_um = 3\nEYS_um = -2\nEZS_um = 5\nEAS_urad = 12\nEBS_urad = -15\n";
    int k = 0;
    for (const char axis : slides + turns)
      for (const char direction : std::string("XYZABC")) {
        if (std::string{direction, axis} == about_spindle) continue;
        const bool slide = slides.find(axis) != std::string::npos, angle = direction < 'X';
        ++k;
        const double size = (k % 2 == 0 ? 1.0 : -1.0) * (5.0 + k % 7);
        text += fmt::format(
            "[errors.E{}{}]\nkind = \"polynomial\"\ncoefficients_{} = [{}, {}, "
            "{}]\nhalf_range_{}\n",
            direction, axis, angle ? "urad" : "um", 0.5 * size, size, -0.7 * size,
            slide ? "mm = 300" : "deg = 180");
      }
    return text;
  };
  const std::string square = "EC0Y_urad = 32\nEB0Z_urad = -26\nEA0Z_urad = 21\n";
  const std::string rotary =
      "EB0A_urad = 24\nEC0A_urad = -31\nEA0C_urad = -22\nEB0C_urad = 27\nEY0A_um = -14\nEZ0A_um = "
      "11\nEX0C_um = 16\nEY0C_um = 12\n";
  const std::string setup = "[setup]\nEX_um = 20\nEB_urad = 40\n";
  std::vector<WrongMachine> all;
  for (const char* name : {"gantry_cxyza", "trunnion_ca", "head_head"})
    all.push_back({name, idle_scene(name, elements("XYZ", "AC", true, square + rotary) + setup)});
  all.push_back(
      {"three_axis_table",
       idle_scene("three_axis_table",
                  elements("XYZ", "", true, "EB0Z_urad = -26\nEA0Z_urad = 21\n") + setup)});
  for (const auto& [name, about_spindle] : {std::pair{"lathe_zx", "CS"}, {"platform_xz", "AS"}})
    all.push_back({name, idle_scene(name, elements("XZ", "S", false, "", about_spindle) + setup,
                                    "diamond_r249um_off_centre")});
  return all;
}

}  // namespace abbe::sim
