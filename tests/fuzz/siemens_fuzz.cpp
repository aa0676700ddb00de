#include "tests/fuzz/program.h"
#include "tests/fuzz/reader.h"

void abbe::fuzz::read(std::string_view text) { read_as(sim::dialects::Dialect::Siemens, text); }
