#include "sim/dialects/read_program.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "sim/dialects/bad_program.h"
#include "sim/dialects/front_ends.h"
#include "sim/dialects/linuxcnc_interpreter.h"

namespace abbe::sim::dialects {
namespace {

const FrontEnd& front_end_of(const Recognised& found, const std::string& file) {
  std::string known;
  for (const FrontEnd& one : front_ends()) {
    if (one.dialect == found.dialect) return one;
    known += (known.empty() ? "" : ", ") + std::string(name_of(one.dialect));
  }
  std::string seen(name_of(found.dialect));
  if (!found.sign.empty()) seen += ", as " + found.sign;
  throw BadInput(file, found.line, found.line > 0 ? 1 : 0, "a dialect that is read (" + known + ")",
                 std::move(seen));
}

/// The rule of one control is not for programs of another.
void check_rule(PoleRule rule, Dialect dialect, const std::string& file) {
  const auto check = [&](PoleRule one, const char* name, std::initializer_list<Dialect> fit,
                         const char* why) {
    if (rule != one || std::ranges::find(fit, dialect) != fit.end()) return;
    throw BadInput(file, 0, 0, fmt::format("{}, beside pole = \"{}\"", why, name),
                   fmt::format("one of {}", name_of(dialect)));
  };
  check(PoleRule::LinuxCnc, "linuxcnc", {Dialect::LinuxCnc},
        "a program of LinuxCNC, which has no vectors of the tool");
  check(PoleRule::Fanuc, "fanuc", {Dialect::Fanuc, Dialect::Cl},
        "a program of Fanuc or cutter locations");
  check(PoleRule::Siemens, "siemens", {Dialect::Siemens, Dialect::Cl},
        "a program of Siemens or cutter locations");
}

}  // namespace

ReadProgram read_program(std::string_view text, const std::string& file,
                         const ReadOptions& options) {
  if (text.size() > options.control.max_bytes)
    throw BadInput(file, 0, 0, fmt::format("at most {} bytes", options.control.max_bytes),
                   fmt::format("{}", text.size()));
  ReadProgram read;
  const Recognised found =
      options.dialect == Dialect::Auto ? recognised(text, file) : Recognised{options.dialect, {}};
  read.dialect = found.dialect;
  read.sign = found.sign;
  check_rule(options.pole.rule, found.dialect, file);
  ProgramRun run(file, options, std::size_t(std::count(text.begin(), text.end(), '\n')));
  if (options.interpreter == Interpreter::LinuxCnc)
    read_by_linuxcnc(text, found, run);
  else
    front_end_of(found, file).read(text, run);
  run.hand_over();
  if (!run.faults().empty()) throw BadProgram(run.faults().list());
  read.skipped = run.skipped();
  read.warnings = std::move(run.warnings);
  read.blocks = run.blocks_executed();
  read.path = run.canon.take();
  return read;
}

ReadProgram read_program_file(const std::filesystem::path& file, ReadOptions options) {
  if (options.folder.empty())
    options.folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  return read_program(read_text(file, options.control.max_bytes), file.string(), options);
}

}  // namespace abbe::sim::dialects
