#include "sim/dialects/bad_program.h"

#include <utility>

namespace abbe::sim::dialects {

BadProgram::BadProgram(std::vector<BadInput> list) : BadInput(list.at(0)), faults(std::move(list)) {
  for (const BadInput& fault : faults)
    text += (text.empty() ? "" : "\n") + std::string(fault.what());
}

}  // namespace abbe::sim::dialects
