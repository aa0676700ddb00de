#include "sim/dialects/cl.h"

#include "sim/dialects/cl_machine.h"
#include "sim/dialects/cl_statement.h"
#include "sim/dialects/cl_table.h"
#include "sim/dialects/cursor.h"

namespace abbe::sim::dialects {

void read_cl(std::string_view text, ProgramRun& run) {
  if (cl::is_table(text)) {
    run.start([&](std::string_view code) {
      run.canon.refuse({1, code}, "no startup code for a table of cutter locations");
    });
    return cl::read_table(text, run);
  }
  cl::Machine machine(run);
  run.start([&](std::string_view code) {
    cl::Statements statements(code);
    cl::Statement statement;
    while (statements.next(statement)) machine.execute(statement);
  });
  cl::Statements statements(text);
  cl::Statement statement;
  while (!machine.ended() && !run.hopeless() && statements.next(statement))
    run.attempt([&] {
      run.canon.stand_at(statement.line);
      run.count_block();
      machine.execute(statement);
    });
  machine.finish();
  if (!machine.ended()) return;
  const std::vector<std::string_view> lines = lines_of_text(text);
  run.warn_unread(lines, {{0, lines.size()}});
}

}  // namespace abbe::sim::dialects
