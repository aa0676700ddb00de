#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "kinematics/fault_list.h"
#include "sim/dialects/control_table.h"
#include "sim/dialects/cursor.h"

/// What the readers of the controls' tables share.
namespace abbe::sim::dialects {

/// A table while it is read.
struct TableReading {
  std::string_view text;
  TableKind kind = TableKind::Tools;
  std::optional<double> unit;  ///< mm per unit of length, as stated or as the file says
  ControlTable table = {};
  FaultList faults = {};
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

}  // namespace abbe::sim::dialects
