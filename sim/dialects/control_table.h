#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "sim/dialects/dialect.h"

namespace abbe::sim::dialects {

enum class TableKind { Tools, Offsets };

/// A tool as a control's table has it, mm. Length and radius are with the wear that stands beside
/// them; none where the table has no line for it.
struct TableTool {
  std::optional<double> length, radius;
  double length_wear = 0.0, radius_wear = 0.0;
  std::string name;
  int line = 0;  ///< of the first of its values
};

/// A work offset by axis letter, mm and degrees.
struct TableOffset {
  struct Value {
    double value = 0.0;
    int line = 0, column = 0;
  };
  std::map<char, Value> axes;
};

struct ControlTable {
  std::string file;
  Dialect control = Dialect::LinuxCnc;  ///< whose format it is
  std::map<int, TableTool> tools;       ///< by T, or by H and D of Fanuc
  /// 1 to 6: G54 to G59, Heidenhain's presets 1 to 6, Siemens' G54 to G57, G505, G506; others as
  /// `program::NcOptions::more_offset` numbers them.
  std::map<int, TableOffset> offsets;
  std::vector<std::string> notes;  ///< what of it is without effect, with counts
};

inline constexpr int most_preset = 9999;

/// The number of a preset of Heidenhain, 1 to `most_preset`, among the offsets.
constexpr int system_of_preset(int preset) { return preset > 6 ? 1000 + preset : preset; }

/// What a control calls an offset, "G54" or "preset 7".
std::string offset_name(Dialect control, int system);

/// What is to be said of a control's table beside a program: its notes, that it is another
/// control's, and which offsets the program calls without its having them.
/// @param read_as  the dialect of the program, with its sign; empty: a table of times
/// @param called   by the moves of the program
std::vector<std::string> table_warnings(const ControlTable& table, std::string_view read_as,
                                        const std::set<int>& called);

}  // namespace abbe::sim::dialects
