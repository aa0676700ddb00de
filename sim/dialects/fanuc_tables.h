#pragma once

#include "sim/dialects/control_table_reading.h"

namespace abbe::sim::dialects {

/// A table of Fanuc: a listing of G10 blocks, as `control_tables.h` says; faults are noted in it.
void read_fanuc_table(TableReading& reading);

}  // namespace abbe::sim::dialects
