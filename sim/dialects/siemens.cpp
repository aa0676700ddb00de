#include "sim/dialects/siemens.h"

#include "sim/dialects/siemens_flow.h"

namespace abbe::sim::dialects {

void read_siemens(std::string_view text, ProgramRun& run) { siemens::Flow(text, run).run(); }

}  // namespace abbe::sim::dialects
