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

inline constexpr int max_preset = 9999;

/// The number of a preset of Heidenhain, 1 to `max_preset`, among the offsets.
constexpr int preset_system(int preset) { return preset > 6 ? 1000 + preset : preset; }

/// What a control calls an offset, "G54" or "preset 7".
std::string offset_name(Dialect control, int system);

/// What is to be said of a control's table beside a program: its notes, that it is another
/// control's, and which offsets the program calls without its having them.
/// @param read_as  the dialect of the program, with its sign; empty: a table of times
/// @param called   by the moves of the program
std::vector<std::string> table_warnings(const ControlTable& table, std::string_view read_as,
                                        const std::set<int>& called);

// What the readers of the controls' tables share.

/// A table while it is read.
struct TableReading {
  std::string_view text;
  TableKind kind = TableKind::Tools;
  std::optional<double> unit;  ///< mm per unit of length, as stated or as the file says
  ControlTable table = {};
  InputErrorList input_errors = {};
  std::map<std::string, std::size_t> unused = {};  ///< values without effect, by name
  std::set<int> unread = {};  ///< offsets beyond the six that cannot be read, and so are not there

  /// A value other than zero that has no effect.
  void leave_out(const std::string& name);
  /// An offset beyond the six, of another job as a rule, that `read` refuses is left out: a program
  /// that calls it is refused there.
  void read_beyond(int system, const std::function<void()>& read);
  /// mm per unit. @throws BadInput there if neither the scene nor the file has said it
  double unit_at(const Cursor& cursor, std::size_t from) const;
  /// The file says its unit. @throws BadInput there if the scene says another
  void state_unit(double mm, const Cursor& cursor, std::size_t from);
};

/// Every line in turn, up to where `read` returns false; what it refuses is noted, and the next
/// line is read.
void each_line(TableReading& reading, const std::function<bool(Cursor&)>& read);

/// A number there. @throws BadInput unless there is one within 1e6, and a blank or an end behind it
double table_number(Cursor& cursor, std::string_view what);
/// A whole number from `least` to `most`; what stands behind it is left.
int table_whole(Cursor& cursor, int least, int most, std::string_view what);

/// A table of LinuxCNC: a tool table or the parameters of its file of variables, as
/// `control_tables.h` says; faults are noted in it.
void read_linuxcnc_table(TableReading& reading);

/// A table of Fanuc: a listing of G10 blocks, as `control_tables.h` says; faults are noted in it.
void read_fanuc_table(TableReading& reading);

}  // namespace abbe::sim::dialects
