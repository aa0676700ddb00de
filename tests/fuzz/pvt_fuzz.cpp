#include "sim/program/program_writers.h"
#include "tests/fuzz/reader.h"
#include "tests/program/machines.h"

void abbe::fuzz::read(std::string_view text) {
  sim::program::read_pvt(text, "fuzz",
                         sim::program::test::options_for(sim::program::test::gantry()));
}
