#include <string>

#include "sim/commands/all_commands.h"
#include "sim/commands/command_line.h"
#include "sim/compensation/plug_in.h"
#include "sim/files/progress.h"
#include "sim/study/ranks.h"

extern const char* const abbe_commit;  // commit.cmake writes it

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
  common.commit = abbe_commit;
  const Exit code = exit_code(
      [&] { return run_command_line(all_commands(common, argc, argv), common, argc, argv); });
  study::leave_ranks(int(code));
  return int(code);
}
