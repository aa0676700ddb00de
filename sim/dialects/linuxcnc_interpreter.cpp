#include "sim/dialects/linuxcnc_interpreter.h"

#include <algorithm>
#include <charconv>
#include <csignal>
#include <cstring>
#include <fstream>
#include <vector>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/linuxcnc_commands.h"
#include "sim/dialects/linuxcnc_numbered.h"
#include "sim/dialects/linuxcnc_packages.h"
#include "sim/dialects/linuxcnc_process.h"
#include "sim/dialects/turning_tool.h"

namespace abbe::sim::dialects {
namespace {

namespace fs = std::filesystem;
using kinematics::AxisVector;
using linuxcnc::Commands;
using linuxcnc::NumberedProgram;
using program::NcOptions;

constexpr std::string_view six_letters = "XYZABC";
constexpr std::size_t most_tools = 1000;  // that its table takes

// Tables and parameters are in inches whatever the machine is, by this factor and not by 1 / 25.4.
constexpr double inches_of_mm = 0.03937007874016;

void write_whole(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  if (!out.write(text.data(), std::streamsize(text.size())).flush())
    throw BadInput(file.string(), 0, 0, "a file that can be written", "a failure");
}

std::string machine_text() {
  return "[EMC]\nVERSION = 1.1\n[RS274NGC]\nPARAMETER_FILE = numbers.var\n"
         "SUBROUTINE_PATH = program\n[TRAJ]\nCOORDINATES = X Y Z A B C\nLINEAR_UNITS = mm\n"
         "ANGULAR_UNITS = deg\n";
}

/// Tools that are known or called; the others up to 999 too, so that a call that is worked out
/// finds one. What is not known is refused where it would count.
std::string tool_table(const NcOptions& control, const std::set<int>& called,
                       const ProgramRun& run) {
  std::set<int> tools = called;
  for (const auto* all : {&control.tool_length, &control.tool_radius})
    for (const auto& [number, mm] : *all)
      if (number > 0) tools.insert(number);
  if (tools.size() > most_tools)
    run.canon.refuse({}, fmt::format("at most {} tools for LinuxCNC's own interpreter", most_tools),
                     fmt::format("{}", tools.size()));
  for (int n = 1; n < int(most_tools) && tools.size() < most_tools; ++n) tools.insert(n);
  const auto known = [](const std::map<int, double>& all, int tool, double otherwise) {
    const auto found = all.find(tool);
    return (found == all.end() ? otherwise : found->second) * inches_of_mm;
  };
  const auto length = [&](int tool) {
    const kinematics::Chain* to_tip = chain_to_tip(control, tool);
    if (!run.turning() || to_tip == nullptr || !control.tool_length.contains(tool))
      return fmt::format("Z{:.17g}", known(control.tool_length, tool, linuxcnc::unknown_length));
    const kinematics::AxisVector offset = measured_offset(run.canon, *to_tip, {});
    std::string words;
    for (const char letter : {'X', 'Y', 'Z'})
      if (const int j = run.canon.joint_of(letter); j >= 0)
        words += fmt::format("{}{:.17g} ", letter, offset[j] * inches_of_mm);
    return words;
  };
  std::string text;
  int place = 0;
  for (const int tool : tools)
    text += fmt::format("T{} P{} {} D{:.17g}\n", tool, ++place, length(tool),
                        2 * known(control.tool_radius, tool, linuxcnc::unknown_radius));
  return text;
}

/// Origins of the nine coordinate systems, those of the scene with `zero` on top.
std::string parameter_text(const program::Canon& canon, const Eigen::Vector3d& zero) {
  std::string text = "5220\t1\n";
  for (std::size_t i = 0; i < 9; ++i) {
    const kinematics::AxisVector& offset = program::work_offset(canon.options(), int(i) + 1);
    for (std::size_t k = 0; k < 6; ++k) {
      const int j = canon.joint_of(six_letters[k]);
      double value = k < 3 ? zero[Eigen::Index(k)] : 0.0;
      if (j >= 0 && offset.size() > 0)
        value += canon.is_linear(j) ? offset[j] : offset[j] / units::deg;
      if (value != 0.0)
        text +=
            fmt::format("{}\t{:.17g}\n", 5221 + 20 * i + k, k < 3 ? value * inches_of_mm : value);
    }
  }
  return text;
}

/// Leads rs274, whose axes stand at zero first, to where those of the machine stand.
std::string lead_in(const program::Canon& canon) {
  std::string words;
  for (const char letter : six_letters)
    if (const int j = canon.joint_of(letter); j >= 0 && canon.position()[j] != 0.0)
      words += fmt::format(" {}{:.17f}", letter,
                           canon.position()[j] / (canon.is_linear(j) ? 1.0 : units::deg));
  return words.empty() ? "" : "G53 G0" + words + "\nG80\n";
}

/// Offsets of the scene count from the workpiece then, those of the program from elsewhere.
void refuse_systems(const NumberedProgram& program, const ProgramRun& run,
                    const Eigen::Vector3d& zero, program::Canon& canon) {
  if (zero.isZero(0.0)) return;
  for (int number = 1; number <= program.last(); ++number) {
    const linuxcnc::LineCodes codes = linuxcnc::codes_of(program.text_of(number));
    const bool states = codes.data && (codes.data_kind == 2 || codes.data_kind < 0);
    if (!states && !codes.system) continue;
    const auto [file, line] = program.place_of(number);
    canon.stand_at(line, file);
    run.canon.refuse({0, program.text_of(number)},
                     "neither G10 L2 nor #5221 to #5390 for LinuxCNC's own interpreter on a "
                     "machine with rotary axes whose work offset the scene states");
  }
}

std::vector<std::string> lines_said(const std::string& said) {
  std::vector<std::string> lines;
  Lines all(said);
  while (const auto line = all.next()) {
    if (*line == "executing")
      lines.clear();
    else if (!line->empty())
      lines.emplace_back(*line);
  }
  return lines;
}

int number_behind(std::string_view text, std::string_view word) {
  const std::size_t at = text.find(word);
  int number = 0;
  if (at != std::string_view::npos)
    std::from_chars(text.data() + at + word.size(), text.data() + text.size(), number);
  return number;
}

/// The message and the text of the line, as rs274 says them; some messages name a line themselves.
BadInput refused_by_rs274(const std::string& said, const NumberedProgram& program,
                          ProgramRun& run) {
  std::vector<std::string> lines = lines_said(said);
  std::string message = lines.empty() ? "no message" : lines.front();
  const std::string block = lines.size() > 1 ? lines.back() : std::string();
  for (std::size_t i = 1; i + 1 < lines.size(); ++i) message += " " + lines[i];
  std::string file = program.name();
  if (const std::size_t at = message.find("file:"); at != std::string::npos) {
    const std::size_t from = at + 5, length = message.find(' ', from) - from;
    file = fs::path(message.substr(from, length)).filename().string();
    message.replace(from, length, file);  // it is not for others where the private folder is
  }
  int number = block.starts_with("N") ? number_behind(block, "N") : 0;
  if (const int line = number_behind(message, "from line: "); line > 0)
    number = program.number_of(file, line);
  if (number > 0) {
    const linuxcnc::SourceLine place = program.place_of(number);
    run.canon.stand_at(place.line, place.file);
  }
  const program::NcPlace place = run.canon.place();
  return {place.file, place.line, 0, "a block that LinuxCNC's own interpreter takes", message};
}

void judge_end(const InterpreterEnd& end, const InterpreterLimits& limits,
               const NumberedProgram& program, ProgramRun& run) {
  const auto add = [&](std::string expected, std::string seen) {
    const program::NcPlace place = run.canon.place();
    run.add(BadInput(place.file, place.line, 0, std::move(expected), std::move(seen)));
  };
  using Why = InterpreterEnd::Why;
  if (end.why == Why::Time)
    add(fmt::format("an end of LinuxCNC's own interpreter within {} s", limits.seconds),
        "none: a loop without end, or a program that takes longer");
  else if (end.why == Why::Bytes)
    add(fmt::format("at most {} MB of commands of LinuxCNC's own interpreter", limits.megabytes),
        "more: a loop without end, or too many repeats");
  else if (end.why == Why::Signal && end.number == SIGXFSZ)
    add("at most 16 MB of messages of LinuxCNC's own interpreter", "more");
  else if (end.why == Why::Signal)
    add("that LinuxCNC's own interpreter ends by itself",
        fmt::format("signal {} ({})", end.number, strsignal(end.number)));
  else if (end.why == Why::Exit && end.number == 127)
    add("that rs274 can be started", in_quotes(end.said));
  else if (end.why == Why::Exit && end.number != 0)
    run.add(refused_by_rs274(end.said, program, run));
}

fs::path packages_or_refuse(const ProgramRun& run) {
  if (auto packages = linuxcnc_packages()) return *packages;
  throw BadInput(run.canon.place().file, 0, 0,
                 "LinuxCNC's own interpreter, which ./abbe setup --linuxcnc unpacks beside the "
                 "build, or ABBE_LINUXCNC=FOLDER with usr/bin/rs274 in it",
                 "none");
}

}  // namespace

void read_by_linuxcnc(std::string_view text, const Recognised& found, ProgramRun& run) {
  const std::string file = run.canon.place().file;
  if (found.dialect != Dialect::LinuxCnc)
    throw BadInput(
        file, found.line, 0, "a program of LinuxCNC beside interpreter = \"linuxcnc\"",
        std::string(name_of(found.dialect)) + (found.sign.empty() ? "" : ", as " + found.sign));
  const fs::path packages = packages_or_refuse(run);
  const Eigen::Vector3d zero = run.canon.on_top_of_shift();
  const PrivateFolder folder;
  fs::create_directory(folder.path() / "program");
  run.attempt([&] {
    std::string before = lead_in(run.canon);
    if (!run.options().startup_code.empty()) before += run.options().startup_code + "\n";
    const NumberedProgram program(text, file, before, run, folder.path() / "program");
    refuse_systems(program, run, zero, run.canon);
    write_whole(folder.path() / "machine.ini", machine_text());
    write_whole(folder.path() / "tool.tbl",
                tool_table(run.options().control, program.tools(), run));
    write_whole(folder.path() / "numbers.var", parameter_text(run.canon, zero));
    run.canon.stand_at(0);
    Commands commands(run, program, zero);
    const InterpreterEnd end = run_rs274(
        packages, folder.path(), "program/" + program.name(), run.options().interpreter_limits,
        [&](std::string_view line) { return commands.take(line); });
    commands.finish();
    judge_end(end, run.options().interpreter_limits, program, run);
  });
}

}  // namespace abbe::sim::dialects
