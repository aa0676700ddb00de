#pragma once

#include "sim/dialects/control_table_reading.h"

namespace abbe::sim::dialects {

/// A table of Heidenhain: a table with columns, as `control_tables.h` says; faults are noted in it.
void read_heidenhain_table(TableReading& reading);

}  // namespace abbe::sim::dialects
