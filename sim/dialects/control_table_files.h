#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "sim/dialects/control_table.h"

/// Tool tables and work offsets as controls keep them in files.
///
/// Which control a file is from is told by the first line that has a sign, comments left out:
/// Heidenhain, a line that begins with BEGIN; Siemens, `%_N_`, `$TC_` or `$P_UIFR`; Fanuc, G10 or a
/// line that is O and a number; LinuxCNC, T and a number (tools) or two numbers (offsets).
///
/// - LinuxCNC: tools as `src/emc/rs274ngc/tool_parse.cc` reads them, words T P D X Y Z A B C U V W
/// I
///   J Q and a comment behind `;`, in machine units; offsets are the parameters 5221 to 5390 of the
///   file of parameters (User Manual, "Coordinate System").
/// - Fanuc: a listing of blocks G10 L10 to L13 P R (length, its wear, radius, its wear), G10 L2 P0
/// to
///   P6 and L20 P1 to P300 with axis words. Assumed: R of L12 and L13 is a radius, a value without
///   a point is a count of increments and refused unless it is zero.
/// - Siemens: `$TC_DP` 3, 6, 12, 15, 21 of cutting edge 1 (Programming Guide Advanced, 04.00, 8.1,
///   p. 8-265), `$TC_TP2` the name; `$P_UIFR[n, axis, TR]`, n 1 to 99, and FI, or CTRANS and CFINE.
///   Assumed: length 1 lies along the tool, as it does in G17 for types 100 to 299.
/// - Heidenhain: columns by the places of their names in the header, from BEGIN, with MM or INCH,
/// to
///   `[END]`: T NAME L R DL DR of a tool table (TNC7 User's Manual, "Tool table tool.t"). Of a
///   preset table NR 1 to 9999, X Y Z A B C U V W, whose names and `-` for a value not set are
///   assumed.
///
/// Of Siemens and Heidenhain an offset beyond the sixth that is turned or cannot be read is left
/// out and counted: it is refused where a program calls it.
namespace abbe::sim::dialects {

/// Reads a table in time and memory proportional to its text; beyond 64 MiB it is refused.
/// @param unit  mm per unit of length; must be given where the file does not say, and agree where
/// it
///              does
/// @throws BadProgram with every fault, up to 200, each with its line and column
ControlTable read_control_table(std::string_view text, const std::string& file, TableKind kind,
                                std::optional<double> unit = {});
/// The same from a file.
ControlTable read_control_table_file(const std::filesystem::path& file, TableKind kind,
                                     std::optional<double> unit = {});

}  // namespace abbe::sim::dialects
