// Tool tables and work offsets of four controls: the same figures from each, refusals with a place,
// and damaged files.

#include "sim/dialects/control_table_files.h"
#include "sim/dialects/read_options.h"
#include "tests/program/machines.h"
#include "tests/test.h"

namespace abbe::sim::dialects {
namespace {

std::string corpus_table(const std::string& name) {
  return program::test::file_text(ABBE_SOURCE_DIR "/tests/corpus/tables/" + name);
}

const std::string tbl = corpus_table("tools_linuxcnc.tbl");
const std::string fanuc_tools = corpus_table("tools_fanuc.nc");
const std::string toa = corpus_table("tools_siemens.toa");
const std::string tool_t = corpus_table("tools_heidenhain.t");

ControlTable tools(const std::string& text, std::optional<double> unit = {}) {
  return read_control_table(text, "tools", ControlTableKind::Tools, unit);
}
ControlTable offsets(const std::string& text, std::optional<double> unit = {}) {
  return read_control_table(text, "offsets", ControlTableKind::Offsets, unit);
}

TEST(ControlTables, FourControlsSayTheSameOfTheirTools) {
  const std::pair<ControlTable, Dialect> all[] = {{tools(tbl, 1.0), Dialect::LinuxCnc},
                                                  {tools(fanuc_tools), Dialect::Fanuc},
                                                  {tools(toa, 1.0), Dialect::Siemens},
                                                  {tools(tool_t), Dialect::Heidenhain}};
  for (const auto& [table, control] : all) {
    SCOPED_TRACE(name_of(control));
    EXPECT_EQ(table.control, control);
    ASSERT_EQ(table.tools.size(), 2u);
    EXPECT_NEAR(*table.tools.at(1).length, 80.005, 1e-13);
    EXPECT_NEAR(*table.tools.at(1).radius, 5.005, 1e-14);
    EXPECT_NEAR(*table.tools.at(20).length, -5.5, 1e-14);
    EXPECT_NEAR(*table.tools.at(20).radius, 3.0, 1e-14);
  }
  EXPECT_EQ(all[2].first.tools.at(1).name, "BALL 10");
  EXPECT_EQ(all[3].first.tools.at(1).name, "BALL 10");
  EXPECT_EQ(all[1].first.tools.at(1).radius_wear, 0.005);
}

TEST(ControlTables, WhatHasNoEffectIsCounted) {
  const auto note = [](const ControlTable& table) {
    return table.notes.empty() ? std::string() : table.notes.front();
  };
  EXPECT_EQ(note(tools(tbl, 1.0)), "tools has nonzero values that are not used: I (1), Q (1)");
  EXPECT_EQ(note(tools(toa, 1.0)),
            "tools has nonzero values that are not used: $TC_DP24 (1), $TC_MPP1 (1)");
  EXPECT_EQ(note(tools(tool_t)),
            "tools has nonzero values that are not used: CUT (1), R2 (1), tools with an index such "
            "as 5.1 (1)");
}

TEST(ControlTables, InchesAreStatedOnce) {
  EXPECT_EQ(*tools("T1 Z1 D0.5\n", units::inch).tools.at(1).length, 25.4);
  EXPECT_EQ(*tools("T1 Z1 D0.5\n", units::inch).tools.at(1).radius, 6.35);
  EXPECT_EQ(*tools("G20\nG10 L10 P2 R1.\n").tools.at(2).length, 25.4);
  EXPECT_EQ(*tools("BEGIN TOOL.T INCH\nT L R\n7 2 1\n[END]\n").tools.at(7).length, 50.8);
}

const std::string var = corpus_table("offsets_linuxcnc.var");
const std::string fanuc_offsets = corpus_table("offsets_fanuc.nc");
const std::string ufr = corpus_table("offsets_siemens.ufr");
const std::string preset = corpus_table("offsets_heidenhain.pr");

TEST(ControlTables, FourControlsSayTheSameOfAnOffset) {
  for (const ControlTable& table :
       {offsets(var, 1.0), offsets(fanuc_offsets), offsets(ufr, 1.0), offsets(preset)}) {
    SCOPED_TRACE(name_of(table.control));
    const auto& axes = table.offsets.at(1).axes;
    EXPECT_NEAR(axes.at('X').value, -100.5, 1e-13);
    EXPECT_NEAR(axes.at('Y').value, 20.0, 1e-13);
    EXPECT_NEAR(axes.at('Z').value, -300.25, 1e-13);
    EXPECT_NEAR(axes.at('A').value, 1.5, 1e-13);
  }
  EXPECT_EQ(offsets(var, 1.0).offsets.at(9).axes.at('X').value, 7.25);
  EXPECT_EQ(offsets(fanuc_offsets).offsets.at(102).axes.at('X').value, 1.0);
  EXPECT_EQ(offsets(fanuc_offsets).offsets.at(0).axes.at('Z').value, -1.0);
}

TEST(ControlTables, OffsetsBeyondTheSixKeepTheirNumbers) {
  const ControlTable siemens =
      offsets("%_N_UFR1_INI\n$P_UIFR[7,X,TR]=1\n$P_UIFR[99]=CTRANS(X,2)\n", 1.0);
  EXPECT_EQ(siemens.offsets.at(507).axes.at('X').value, 1.0);
  EXPECT_EQ(siemens.offsets.at(599).axes.at('X').value, 2.0);
  const ControlTable heidenhain =
      offsets("BEGIN P .PR MM\nNR    X\n6     1\n7     2\n9999  3\n10000 4\n[END]\n");
  EXPECT_EQ(heidenhain.offsets.at(6).axes.at('X').value, 1.0);
  EXPECT_EQ(heidenhain.offsets.at(1007).axes.at('X').value, 2.0);
  EXPECT_EQ(heidenhain.offsets.at(10999).axes.at('X').value, 3.0);
  ASSERT_EQ(heidenhain.notes.size(), 1u);
  EXPECT_HAS(heidenhain.notes[0], "presets other than 1 to 9999 (1)");
}

void refuses(const std::string& text, ControlTableKind kind, const std::string& message,
             std::optional<double> unit = 1.0) {
  try {
    read_control_table(text, "f", kind, unit);
    ADD_FAILURE() << "read: " << text;
  } catch (const BadProgram& bad) {
    EXPECT_HAS(bad.text, message);
  }
}

TEST(ControlTables, RefusalsNameThePlace) {
  constexpr auto of_tools = ControlTableKind::Tools, of_offsets = ControlTableKind::Offsets;
  refuses("T1 P1 Z80\n", of_tools, "f:1:7: expected a unit", {});
  refuses("T1 P1 X2 Z80\n", of_tools, "f:1:7: expected 0 for X");
  refuses("T1 Z1\nT1 Z2\n", of_tools, "f:2:1: expected a tool not yet in the table");
  refuses("T1 Z1 E3\n", of_tools, "f:1:7: expected a word T P D");
  refuses("G10 L10 P1 R80000\n", of_tools, "f:1:12: expected a value with a decimal point");
  refuses("G10 L1 P1 R8.\n", of_tools, "f:1:5: expected L2 L10 L11 L12 L13 or L20");
  refuses("G91 G10 L10 P1 R8.\n", of_tools, "f:1:1: expected G10 G11 G20 G21 or G90");
  refuses("G20\nG10 L10 P1 R8.\n", of_tools, "f:1:1: expected a table in mm");
  refuses("$TC_DP1[1,1]=500\n", of_tools, "f:1:14: expected a milling cutter or drill");
  refuses("$TC_DP4[1,1]=2.5\n", of_tools, "f:1:14: expected 0 for length 2 and 3");
  refuses("$P_UIFR[1,X,RT]=2.5\n", of_offsets, "f:1:17: expected a work offset without rotation");
  refuses("$P_UIFR[1]=CTRANS(X,1):CROT(Z,5)\n", of_offsets, "f:1:24: expected CTRANS or CFINE");
  refuses("$P_UIFR[0,X,TR]=2.5\n", of_offsets, "f:1:17: expected 0 for $P_UIFR[0]");
  refuses("BEGIN TOOL.T MM\nT   L   R\n1   80  5\n", of_tools, "f:3:1: expected [END]");
  refuses("BEGIN TOOL.T MM\nT   L   R\n1   80.0005\n[END]\n", of_tools,
          "f:3:9: expected a blank before the column R");
  refuses("BEGIN TOOL.T MM\nT   NAME\n[END]\n", of_tools, "f:2:1: expected columns named T, L");
  refuses("BEGIN A.PR MM\nNR ROT X\n1  5   1\n[END]\n", of_offsets, "f:3:4: expected 0 for ROT");
  refuses("5210 1\n5211 3\n5221 1\n", of_offsets, "f:2:6: expected 0 for a G92 shift");
  refuses("5230 3\n", of_offsets, "f:1:6: expected 0 for the rotation");
  refuses("hello\n", of_tools, "f:1:1: expected a tool table");
  refuses("", of_offsets, "f:1:1: expected work offsets");
}

std::string damaged_table(std::mt19937& random, std::string text) {
  std::uniform_int_distribution<int> any(0, 1 << 20);
  const int edits = 1 + any(random) % 5;
  for (int i = 0; i < edits && !text.empty(); ++i) {
    const std::size_t at = std::size_t(any(random)) % text.size();
    const auto c = char(any(random) % 4 == 0 ? any(random) % 256 : 32 + any(random) % 95);
    switch (any(random) % 5) {
      case 0:
        text[at] = c;
        break;
      case 1:
        text.insert(at, 1, c);
        break;
      case 2:
        text.erase(at, 1 + std::size_t(any(random)) % 9);
        break;
      case 3:
        text.insert(at, text.substr(std::size_t(any(random)) % text.size(), 12));
        break;
      default:
        text.resize(at);
    }
  }
  return text;
}

TEST(ControlTables, DamagedFilesAreReadOrRefusedWithAPlace) {
  constexpr unsigned seed = 20260314;
  std::mt19937 random(seed);
  int read = 0, refused = 0;
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 24'000; ++i) {
    const std::string* whole[] = {&tbl, &fanuc_tools,   &toa, &tool_t,
                                  &var, &fanuc_offsets, &ufr, &preset};
    const std::size_t k = std::size_t(i) % 8;
    const std::string text = damaged_table(random, *whole[k]);
    const bool says_unit = k == 1 || k == 3 || k == 5 || k == 7;
    try {
      read_control_table(text, "f", k < 4 ? ControlTableKind::Tools : ControlTableKind::Offsets,
                         says_unit ? std::nullopt : std::optional(1.0));
      ++read;
    } catch (const BadProgram& bad) {
      ++refused;
      for (const BadInput& fault : bad.input_errors) {
        ASSERT_EQ(fault.file, "f");
        ASSERT_GT(fault.line, 0) << bad.text << "\n" << text;
        ASSERT_GT(fault.column, 0) << bad.text << "\n" << text;
        ASSERT_FALSE(fault.expected.empty());
      }
    }
  }
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
  std::cout << "[ measured ] seed " << seed << ": 24000 damaged tables, " << read << " read, "
            << refused << " refused, " << spent.count() << " s\n";
  EXPECT_GT(read, 500);
  EXPECT_GT(refused, 5000);
}

TEST(ControlTables, LargeFilesTakeBoundedTime) {
  std::string many;
  for (int i = 0; i < 100'000; ++i) many += "T" + std::to_string(i) + " Z1.5 D2\n";
  EXPECT_EQ(tools(many, 1.0).tools.size(), 100'000u);
  std::string bad = "T1 Z1\n";
  for (int i = 0; i < 300'000; ++i) bad += "T1 Z1\n";
  refuses(bad, ControlTableKind::Tools, "f:2:1");
  refuses("BEGIN TOOL.T MM\n" + std::string(2'000'000, 'x') + "\n", ControlTableKind::Tools,
          "f:2:1");
  std::string columns = "BEGIN TOOL.T MM\n";
  for (int i = 0; i < 200'000; ++i) columns += "C" + std::to_string(i) + " ";
  refuses(columns, ControlTableKind::Tools, "at most 256 columns");
}

}  // namespace
}  // namespace abbe::sim::dialects
