#include "sim/dialects/fanuc.h"

#include "sim/dialects/fanuc_flow.h"

namespace abbe::sim::dialects {

void read_fanuc(std::string_view text, ProgramRun& run) { fanuc::Flow(text, run).run(); }

}  // namespace abbe::sim::dialects
