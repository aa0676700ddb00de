#pragma once

#include "sim/dialects/control_table_reading.h"

namespace abbe::sim::dialects {

/// A table of LinuxCNC: a tool table or the parameters of its file of variables, as
/// `control_tables.h` says; faults are noted in it.
void read_linuxcnc_table(TableReading& reading);

}  // namespace abbe::sim::dialects
