#include "sim/commands/all_commands.h"

#include "sim/commands/animate_command.h"
#include "sim/commands/check_command.h"
#include "sim/commands/compare_command.h"
#include "sim/commands/evaluate_command.h"
#include "sim/commands/explain_command.h"
#include "sim/commands/export_command.h"
#include "sim/commands/help_command.h"
#include "sim/commands/identify_command.h"
#include "sim/commands/measure_command.h"
#include "sim/commands/new_command.h"
#include "sim/commands/pose_command.h"
#include "sim/commands/program_command.h"
#include "sim/commands/render_command.h"
#include "sim/commands/report_command.h"
#include "sim/commands/rewrite_command.h"
#include "sim/commands/run_command.h"
#include "sim/commands/schema_command.h"
#include "sim/commands/study_command.h"

namespace abbe::sim {

std::vector<Command> all_commands(Common& common, int& argc, char**& argv) {
  std::vector<Command> all{
      new_command(common),     run_command(common),      compare_command(common),
      check_command(common),   program_command(common),  animate_command(common),
      render_command(common),  report_command(common),   pose_command(common),
      measure_command(common), identify_command(common), evaluate_command(common),
      rewrite_command(common), export_command(common),   study_command(common, argc, argv),
      schema_command(),        explain_command()};
  all.push_back(help_command(all));
  return all;
}

}  // namespace abbe::sim
