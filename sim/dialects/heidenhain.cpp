#include "sim/dialects/heidenhain.h"

#include "sim/dialects/heidenhain_flow.h"

namespace abbe::sim::dialects {

void read_heidenhain(std::string_view text, ProgramRun& run) { heidenhain::Flow(text, run).run(); }

}  // namespace abbe::sim::dialects
