#include "sim/dialects/front_ends.h"

#include <array>
#include <string_view>

#include "sim/dialects/cl/machine.h"
#include "sim/dialects/cursor.h"
#include "sim/dialects/fanuc/flow.h"
#include "sim/dialects/fanuc/machine.h"
#include "sim/dialects/heidenhain/block.h"
#include "sim/dialects/heidenhain/flow.h"
#include "sim/dialects/linuxcnc/flow.h"
#include "sim/dialects/program_run.h"
#include "sim/dialects/read_options.h"
#include "sim/dialects/siemens/flow.h"

namespace abbe::sim::dialects {

/// Reads Klartext as a TNC 640 does.
void read_heidenhain(std::string_view text, ProgramRun& run);

void read_cl(std::string_view text, ProgramRun& run) {
  if (cl::is_table(text)) {
    // A table has no statements in which a startup code could be written.
    run.run_startup_code([&](std::string_view code) {
      run.canon.throw_input_error({1, code}, "no startup code for a table of cutter locations");
    });
    return cl::read_table(text, run);
  }
  cl::Machine machine(run);
  run.run_startup_code([&](std::string_view code) {
    cl::Statements statements(code);
    cl::Statement statement;
    while (statements.next(statement)) machine.execute(statement);
  });
  cl::Statements statements(text);
  cl::Statement statement;
  while (!machine.has_ended() && !run.is_aborted() && statements.next(statement))
    run.try_block([&] {
      run.canon.set_line(statement.line);
      run.count_block();
      machine.execute(statement);
    });
  machine.finish();
  // Without FINI the whole text has been read.
  if (!machine.has_ended()) return;
  const std::vector<std::string_view> lines = lines_of_text(text);
  run.warn_of_unread_lines(lines, {{0, lines.size()}});
}

void read_fanuc(std::string_view text, ProgramRun& run) {
  if (!run.is_turning())
    if (const auto sign = fanuc::find_turning_sign(text, run.canon)) {
      // The only error that is reported: all others would be consequences of the wrong control.
      throw BadProgram({BadInput(
          run.canon.place().file, sign->line, sign->column,
          "a program of a milling control; control = \"turning\" (--control turning), or a machine "
          "whose spindle turns the workpiece, reads those of turning controls",
          sign->words)});
    }
  fanuc::Flow(text, run).run();
}

void read_heidenhain(std::string_view text, ProgramRun& run) { heidenhain::Flow(text, run).run(); }

void read_linuxcnc(std::string_view text, ProgramRun& run) { linuxcnc::Flow(text, run).run(); }

void read_siemens(std::string_view text, ProgramRun& run) { siemens::Flow(text, run).run(); }

std::span<const FrontEnd> front_ends() {
  static constexpr std::array table = {
      FrontEnd{Dialect::LinuxCnc, "LinuxCNC (RS274/NGC)", read_linuxcnc, linuxcnc_words},
      FrontEnd{Dialect::Cl, "CL (APT cutter locations, CSV)", read_cl, cl_words},
      FrontEnd{Dialect::Fanuc, "Fanuc (milling, custom macro B)", read_fanuc, fanuc_words,
               fanuc_lathe_words, "Fanuc (turning, G-code system A)"},
      FrontEnd{Dialect::Siemens, "Siemens 840D", read_siemens, siemens_words},
      FrontEnd{Dialect::Heidenhain, "Heidenhain (TNC 640, Klartext)", read_heidenhain,
               heidenhain_words},
  };
  return table;
}

}  // namespace abbe::sim::dialects
