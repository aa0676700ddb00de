// What a program of a million lines costs to read: processor seconds, and bytes that are kept per
// move, by the path that a run keeps and by `abbe program`, which keeps none.

#include <malloc.h>

#include <cmath>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <string>

#include <fmt/format.h>

#include "sim/cut/part.h"
#include "sim/cut/program_inspection.h"
#include "sim/dialects/read_program.h"
#include "tests/program/machines.h"

namespace {

using namespace abbe;

constexpr int count = 1'000'000;

double seconds() { return double(std::clock()) / CLOCKS_PER_SEC; }

double bytes_in_use() {
  const auto info = ::mallinfo2();
  return double(info.uordblks) + double(info.hblkhd);
}

/// Three axes, as a CAM system posts a fine surface.
std::string three_axes() {
  std::string text = "G21 G90 G94 G17\nG43.4 H1\nG1 F3000\n";
  for (int i = 0; i < count; ++i)
    text += fmt::format("G1 X{:.3f} Y{:.3f} Z{:.3f}\n", 100 * std::sin(1e-3 * i), 1e-4 * i,
                        10 * std::cos(7e-3 * i));
  return text;
}

std::string five_axes() {
  std::string text = "UNITS/MM\nFEDRAT/MMPM,3000\n";
  for (int i = 0; i < count; ++i) {
    const double a = 0.4 + 0.1 * std::sin(1e-2 * i), c = 1e-3 * i;
    text += fmt::format("GOTO/{:.4f},{:.4f},{:.4f},{:.7f},{:.7f},{:.7f}\n",
                        100 * std::sin(1e-3 * i), 1e-4 * i, 10 * std::cos(7e-3 * i),
                        std::sin(a) * std::cos(c), std::sin(a) * std::sin(c), std::cos(a));
  }
  return text;
}

void report(const char* what, const std::string& text, const std::string& name) {
  sim::dialects::ReadOptions options;
  options.control = sim::program::test::options_for(sim::program::test::gantry());
  const double before = bytes_in_use(), start = seconds();
  {
    const auto read = sim::dialects::read_program(text, name, options);
    fmt::print("{:<24}{:8.2f} s read, {:6.1f} bytes a move kept of {} moves\n", what,
               seconds() - start, (bytes_in_use() - before) / read.path.motion_blocks,
               read.path.motion_blocks);
  }
  const auto file = std::filesystem::temp_directory_path() / name;
  std::ofstream(file) << text;
  const double alone_start = seconds(), alone_before = bytes_in_use();
  const auto alone =
      sim::inspect_program(file, {.machine = "library:gantry_cxyza", .tool_length = 100.0});
  fmt::print("{:<24}{:8.2f} s by abbe program, {:6.1f} bytes a move kept\n", what,
             seconds() - alone_start,
             (bytes_in_use() - alone_before) / double(alone.figures.blocks));
  std::filesystem::remove(file);
}

}  // namespace

int main() {
  report("RS274, three axes", three_axes(), "bench.ngc");
  report("cutter locations", five_axes(), "bench.cls");
}
