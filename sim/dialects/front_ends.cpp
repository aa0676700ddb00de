#include "sim/dialects/front_ends.h"

#include <array>

#include "sim/dialects/cl.h"
#include "sim/dialects/fanuc.h"
#include "sim/dialects/linuxcnc.h"

namespace abbe::sim::dialects {

std::span<const FrontEnd> front_ends() {
  static constexpr std::array all = {
      FrontEnd{Dialect::LinuxCnc, "LinuxCNC (RS274/NGC)", read_linuxcnc, linuxcnc_words},
      FrontEnd{Dialect::Cl, "CL (APT cutter locations, CSV)", read_cl, cl_words},
      FrontEnd{Dialect::Fanuc, "Fanuc (milling, custom macro B)", read_fanuc, fanuc_words},
  };
  return all;
}

}  // namespace abbe::sim::dialects
