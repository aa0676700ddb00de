#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/bad_input.h"
#include "sim/dialects/cursor.h"
#include "sim/dialects/read_options.h"

namespace abbe::sim::dialects {

/// Content of a control table.
enum class ControlTableKind { Tools, Offsets };

/// A tool of a control table, mm. Length and radius include the wear and are empty if the table
/// does not state them.
struct ControlTableTool {
  std::optional<double> length, radius;
  double length_wear = 0.0, radius_wear = 0.0;
  std::string name;
  int line = 0;  ///< line of the first value
};

/// A work offset by axis letter, mm and degrees.
struct ControlTableOffset {
  struct Value {
    double value = 0.0;
    int line = 0, column = 0;
  };
  std::map<char, Value> axes;
};

/// A tool table or a table of work offsets, as read from a file.
struct ControlTable {
  std::string file;
  Dialect control = Dialect::LinuxCnc;    ///< control whose format the file has
  std::map<int, ControlTableTool> tools;  ///< by T, or by H and D on Fanuc
  /// 1 to 6 are G54 to G59, presets 1 to 6 of Heidenhain, or G54 to G57, G505 and G506 of Siemens;
  /// other keys are those of `program::NcOptions::extra_offsets`.
  std::map<int, ControlTableOffset> offsets;
  std::vector<std::string> notes;  ///< values in the file that have no effect, with counts
};

/// The largest preset number of Heidenhain.
inline constexpr int max_preset = 9999;

/// Returns the key of a Heidenhain preset, 1 to `max_preset`, among the offsets.
constexpr int preset_offset_key(int preset) { return preset > 6 ? 1000 + preset : preset; }

/// Returns the control's name of an offset, "G54" or "preset 7".
std::string offset_name(Dialect control, int offset_key);

/// Returns the warnings about a control table used with a program: its notes, a table of another
/// control, and offsets that the program calls but the table does not have. `read_as` is the
/// dialect of the program and how it was recognised; empty for a PVT table. `called_offsets` holds
/// the offsets of the program's moves.
std::vector<std::string> table_warnings(const ControlTable& table, std::string_view read_as,
                                        const std::set<int>& called_offsets);

// Functions shared by the readers of control tables.

/// State of the parser of a table.
struct ControlTableParser {
  std::string_view text;
  ControlTableKind kind = ControlTableKind::Tools;
  std::optional<double> unit;  ///< mm per unit of length, stated by the scene or by the file
  ControlTable table = {};
  InputErrorList input_errors = {};
  std::map<std::string, std::size_t> unused = {};  ///< number of values without effect, by name
  /// Offsets beyond the sixth that cannot be read and are therefore missing.
  std::set<int> unreadable_offsets = {};

  /// Counts a non-zero value that has no effect.
  void count_unused(const std::string& name);
  /// Reads an offset beyond the sixth, which usually belongs to another job. If `read` throws
  /// BadInput, the offset is left out and the error is not reported; a program that calls the
  /// offset is then an input error.
  void read_extra_offset(int offset_key, const std::function<void()>& read);
  /// Returns mm per unit of length. Throws BadInput at byte `start` of the line if neither the
  /// scene nor the file states the unit.
  double require_unit(const Cursor& cursor, std::size_t start) const;
  /// Returns the factor from the value of an axis to mm or degrees. Only lengths other than zero
  /// need a unit; throws as `require_unit` does.
  double axis_unit(char axis, double value, const Cursor& cursor, std::size_t start) const;
  /// Sets the unit stated by the file. Throws BadInput at byte `start` of the line if the scene
  /// states another.
  void set_unit(double mm_per_unit, const Cursor& cursor, std::size_t start);
};

/// Calls `read` for every line until it returns false. Collects the errors that it throws and
/// continues with the next line.
void for_each_line(ControlTableParser& parser, const std::function<bool(Cursor&)>& read);

/// Parses the number of the value `what`. Throws BadInput unless it is within 1e6 and followed by a
/// blank or a delimiter.
double parse_table_number(Cursor& cursor, std::string_view what);
/// Parses an integer from `min_value` to `max_value`; does not check the text that follows. Throws
/// BadInput.
int parse_table_integer(Cursor& cursor, int min_value, int max_value, std::string_view what);

/// Reads a LinuxCNC table, a tool table or the parameters of a variables file, in the format
/// described in control_table_files.h. Errors are collected in `parser`.
void read_linuxcnc_table(ControlTableParser& parser);

/// Reads a Fanuc table, a listing of G10 blocks, in the format described in control_table_files.h.
/// Errors are collected in `parser`.
void read_fanuc_table(ControlTableParser& parser);

}  // namespace abbe::sim::dialects
