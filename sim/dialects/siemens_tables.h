#pragma once

#include "sim/dialects/control_table_reading.h"

namespace abbe::sim::dialects {

/// A table of Siemens: $TC_DP and $P_UIFR, as `control_tables.h` says; faults are noted in it.
void read_siemens_table(TableReading& reading);

}  // namespace abbe::sim::dialects
