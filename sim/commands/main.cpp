#include <string>
#include <vector>

#include "sim/commands/check_command.h"
#include "sim/commands/command_line.h"
#include "sim/commands/compare_command.h"
#include "sim/commands/evaluate_command.h"
#include "sim/commands/explain_command.h"
#include "sim/commands/export_command.h"
#include "sim/commands/identify_command.h"
#include "sim/commands/measure_command.h"
#include "sim/commands/pose_command.h"
#include "sim/commands/render_command.h"
#include "sim/commands/rewrite_command.h"
#include "sim/commands/run_command.h"
#include "sim/commands/schema_command.h"
#include "sim/commands/study_command.h"
#include "sim/compensation/plug_in.h"
#include "sim/files/progress.h"
#include "sim/study/ranks.h"

namespace {

/// The command for the marks of results.
std::string as_typed(int argc, char** argv) {
  std::string text = "abbe";
  for (int i = 1; i < argc; ++i) text += " " + std::string(argv[i]);
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace abbe::sim;
  if (const auto host = compensation::plug_in_host(argc, argv)) return *host;
  watch_interrupts();
  Common common;
  common.permissions.command = as_typed(argc, argv);
  const std::vector<Command> commands{run_command(common),
                                      compare_command(common),
                                      check_command(common),
                                      render_command(common),
                                      pose_command(common),
                                      measure_command(common),
                                      identify_command(common),
                                      evaluate_command(common),
                                      rewrite_command(common),
                                      export_command(common),
                                      study_command(common, argc, argv),
                                      schema_command(),
                                      explain_command()};
  const Exit code = exit_code([&] { return run_command_line(commands, common, argc, argv); });
  study::leave_ranks(int(code));
  return int(code);
}
