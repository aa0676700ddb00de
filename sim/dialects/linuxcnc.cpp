#include "sim/dialects/linuxcnc.h"

#include "sim/dialects/linuxcnc_flow.h"

namespace abbe::sim::dialects {

void read_linuxcnc(std::string_view text, ProgramRun& run) { linuxcnc::Flow(text, run).run(); }

}  // namespace abbe::sim::dialects
