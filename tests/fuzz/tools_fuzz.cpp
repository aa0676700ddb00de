#include "sim/dialects/control_table_files.h"
#include "tests/fuzz/reader.h"

void abbe::fuzz::read(std::string_view text) {
  sim::dialects::read_control_table(text, "fuzz", sim::dialects::ControlTableKind::Tools, 1.0);
}
