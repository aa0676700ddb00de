#pragma once

#include <string>
#include <string_view>

namespace abbe::sim::dialects {

/// The languages in which machining programs are written.
enum class Dialect {
  Auto,      ///< by the signs that `recognised` looks for
  LinuxCnc,  ///< RS274/NGC as LinuxCNC reads it, and G43.4 of abbe's own programs
  Fanuc,
  Siemens,     ///< 840D
  Heidenhain,  ///< Klartext
  Cl,          ///< APT cutter locations, or CSV
};

/// "linuxcnc", as a scene says it.
std::string_view name_of(Dialect dialect);

/// A dialect and the sign by which it was taken, as "line 3 has TRAORI".
struct Recognised {
  Dialect dialect = Dialect::LinuxCnc;
  std::string sign;
  int line = 0;  ///< of the sign; 0: it is the name of the file, or there is none
};

/// The dialect of a program by its signs, listed in the README of this folder: what its file is
/// named, then the first line of the first 2000 that only one dialect can have; else LinuxCNC's.
/// A line in brackets or behind ; is no sign.
Recognised recognised(std::string_view text, std::string_view file);

}  // namespace abbe::sim::dialects
