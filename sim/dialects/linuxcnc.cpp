#include "sim/dialects/linuxcnc.h"

#include "sim/program/nc.h"

namespace abbe::sim::dialects {

void read_linuxcnc(std::string_view text, ProgramRun& run) {
  run.attempt([&] { program::read_nc(text, run.canon); });
}

std::span<const WordUse> linuxcnc_words() {
  static constexpr WordUse words[] = {
      {"G0", Use::Read, "rapid"},
  };
  return words;
}

}  // namespace abbe::sim::dialects
