#include "sim/dialects/cl.h"

#include "sim/dialects/cl_machine.h"
#include "sim/dialects/cl_statement.h"
#include "sim/dialects/cl_table.h"

namespace abbe::sim::dialects {

void read_cl(std::string_view text, ProgramRun& run) {
  if (cl::is_table(text)) return cl::read_table(text, run);
  cl::Machine machine(run);
  cl::Statements statements(text);
  cl::Statement statement;
  while (!machine.ended() && !run.hopeless() && statements.next(statement))
    run.attempt([&] {
      run.count_block();
      machine.execute(statement);
    });
  machine.finish();
}

}  // namespace abbe::sim::dialects
