#include "sim/dialects/front_ends.h"

#include <array>

#include "sim/dialects/cl.h"
#include "sim/dialects/fanuc.h"
#include "sim/dialects/heidenhain.h"
#include "sim/dialects/heidenhain_words.h"
#include "sim/dialects/linuxcnc.h"
#include "sim/dialects/siemens.h"

namespace abbe::sim::dialects {

std::span<const FrontEnd> front_ends() {
  static constexpr std::array all = {
      FrontEnd{Dialect::LinuxCnc, "LinuxCNC (RS274/NGC)", read_linuxcnc, linuxcnc_words},
      FrontEnd{Dialect::Cl, "CL (APT cutter locations, CSV)", read_cl, cl_words},
      FrontEnd{Dialect::Fanuc, "Fanuc (milling, custom macro B)", read_fanuc, fanuc_words,
               fanuc_lathe_words, "Fanuc (turning, G-code system A)"},
      FrontEnd{Dialect::Siemens, "Siemens 840D", read_siemens, siemens_words},
      FrontEnd{Dialect::Heidenhain, "Heidenhain (TNC 640, Klartext)", read_heidenhain,
               heidenhain_words},
  };
  return all;
}

}  // namespace abbe::sim::dialects
