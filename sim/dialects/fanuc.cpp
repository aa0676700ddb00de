#include "sim/dialects/fanuc.h"

#include "sim/dialects/bad_program.h"
#include "sim/dialects/fanuc_flow.h"
#include "sim/dialects/fanuc_lathe.h"

namespace abbe::sim::dialects {

void read_fanuc(std::string_view text, ProgramRun& run) {
  if (!run.turning())
    if (const auto sign = fanuc::sign_of_turning(text, run.canon)) {
      // thrown, so that it is the only error: what else a milling control finds in it only follows
      throw BadProgram({BadInput(
          run.canon.place().file, sign->line, sign->column,
          "a program of a milling control; control = \"turning\" (--control turning), or a machine "
          "whose spindle turns the workpiece, reads those of turning controls",
          sign->words)});
    }
  fanuc::Flow(text, run).run();
}

}  // namespace abbe::sim::dialects
