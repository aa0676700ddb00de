// The faults that every table can have, in every kind of table that abbe reads.

#include <algorithm>
#include <functional>
#include <iostream>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "errors/compliance.h"
#include "errors/element_table.h"
#include "errors/metrology/position_file.h"
#include "kinematics/table_file.h"
#include "sim/cut/idle_machine.h"
#include "sim/program/program_writers.h"
#include "sim/readings/readings_file.h"
#include "tests/injured.h"
#include "tests/program/machines.h"
#include "tests/sim/refusal.h"

namespace abbe::sim {
namespace {

using Cells = std::vector<std::string>;

/// A kind of table: a good one, and what of it may be damaged.
struct TableKind {
  std::string name;
  Cells header;
  std::vector<Cells> rows;
  std::size_t number;  ///< a column of numbers of any size
  std::function<void(const std::string&)> read;
  std::optional<std::size_t> required = {};  ///< a column that may not be missing
  std::optional<std::size_t> integer = {};   ///< a column of integers from 0 or 1
  std::optional<std::size_t> increasing = {};
  std::size_t min_rows = 1;
  std::string before = {};  ///< lines above the header, with a #
};

const std::string identity = "[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]";

std::vector<TableKind> table_kinds() {
  std::vector<TableKind> kinds;
  kinds.push_back({"errors of an axis",
                   {"X", "EXX", "EYX_um"},
                   {{"-10", "0.001", "2"}, {"10", "0.002", "3"}},
                   1,
                   [](const std::string& text) { errors::read_element_table(text, "t"); }});
  kinds.back().required = kinds.back().increasing = 0;
  kinds.back().min_rows = 2;
  const auto read_positions = [](const std::string& text) {
    errors::metrology::read_position_csv(text, "t");
  };
  kinds.push_back({"positions, one a row",
                   {"target_mm", "direction", "run", "deviation_um"},
                   {{"0", "up", "1", "1"}, {"100", "up", "1", "2"}},
                   3,
                   read_positions,
                   1,
                   2});
  kinds.push_back({"positions, one target a row",
                   {"target_mm", "dir", "j1", "j2"},
                   {{"0", "up", "0", "0.1"}, {"5", "up", "5", "5.1"}},
                   2,
                   read_positions,
                   1});
  kinds.push_back({"compliance of a workpiece",
                   {"x_mm", "y_mm", "z_mm", "Cxx_um_per_N", "Cyy_um_per_N", "Czz_um_per_N"},
                   {{"0", "0", "0", "1", "1", "1"}, {"1", "0", "0", "1", "1", "1"}},
                   4,
                   [](const std::string& text) { errors::read_compliance_field(text, "t"); },
                   5});
  kinds.push_back({"readings of a part",
                   {"x_mm", "y_mm", "z_mm", "nx", "ny", "nz", "deviation_um", "time_s"},
                   {{"0", "0", "0", "0", "0", "1", "2.5", "1"}},
                   6,
                   [](const std::string& text) { read_part_readings(text, "t"); },
                   7});
  kinds.back().min_rows = 0;
  kinds.back().before = "# abbe_part_readings = 1\n# instrument = \"cmm\"\n# kind = \"cmm\"\n";
  kinds.push_back({"readings",
                   {"set_up", "channel", "run", "target", "time_s", "X_mm", "X_way", "X_stroke",
                    "spindle_rad_per_s", "reading", "unit", "nut_C"},
                   {{"0", "0", "0", "0", "1.5", "10", "1", "0", "0", "0.001", "mm", "20"},
                    {"0", "0", "0", "1", "2.5", "20", "1", "0", "0", "0.002", "mm", "21"}},
                   4,
                   [](const std::string& text) { read_readings(text, "t"); },
                   10,
                   2});
  kinds.back().before =
      "# abbe_readings = 1\n# instrument = \"laser\"\n# kind = \"laser\"\n# T_bw_mm = " + identity +
      "\n# T_bt_mm = " + identity +
      "\n# [[joint]]\n# name = \"X\"\n# side = \"tool\"\n# motion = \"linear\"\n"
      "# direction = [1, 0, 0]\n# point_mm = [0, 0, 0]\n# travel_mm = [-100, 100]\n"
      "# [[set_up]]\n# name = \"along X\"\n# [[set_up.channel]]\n# quantity = \"displacement\"\n"
      "# of = \"tool\"\n# in = \"bed\"\n# point_of_mm = [0, 0, 0]\n# point_in_mm = [0, 0, 0]\n"
      "# direction = [1, 0, 0]\n";
  kinds.push_back(
      {"poses",
       {"X_mm", "A_deg", "time_s"},
       {{"1", "2", "-3"}, {"2", "3", "4"}},
       0,
       [](const std::string& text) { read_poses(text, "t", program::test::gantry()); }});
  kinds.push_back({"positions, velocities and times",
                   {"time_s", "X_mm", "X_mm_per_s"},
                   {{"0", "1", "0"}, {"1", "2", "0"}},
                   1,
                   [](const std::string& text) {
                     program::read_pvt(text, "t",
                                       program::test::options_for(program::test::platform()));
                   },
                   0});
  kinds.back().increasing = 0;
  kinds.back().min_rows = 2;
  return kinds;
}

std::string line_of(const Cells& cells) { return fmt::format("{}\n", fmt::join(cells, ",")); }

std::string text_of(const TableKind& kind) {
  std::string text = kind.before + line_of(kind.header);
  for (const Cells& row : kind.rows) text += line_of(row);
  return text;
}

/// Line of the header, from 1.
int header_line(const TableKind& kind) {
  return 1 + int(std::count(kind.before.begin(), kind.before.end(), '\n'));
}

/// Column of a cell in its line, from 1; of the end of the line for the cell after the last.
int location(const Cells& cells, std::size_t i) {
  return 1 + int(line_of({cells.begin(), cells.begin() + std::ptrdiff_t(i)}).size()) -
         int(i == 0 || i == cells.size());
}

TableKind with_cell(TableKind kind, std::size_t column, const std::string& cell) {
  kind.rows[0][column] = cell;
  return kind;
}

/// Adds a cell to the header and to each row.
TableKind with_column(TableKind kind, const std::string& head, const std::string& cell) {
  kind.header.push_back(head);
  for (Cells& row : kind.rows) row.push_back(cell);
  return kind;
}

TableKind without_column(TableKind kind, std::size_t column) {
  kind.header.erase(kind.header.begin() + std::ptrdiff_t(column));
  for (Cells& row : kind.rows) row.erase(row.begin() + std::ptrdiff_t(column));
  return kind;
}

class TableFiles : public testing::TestWithParam<TableKind> {
 protected:
  const TableKind& kind_ = GetParam();
  const int header_ = header_line(kind_), row_ = header_ + 1;

  std::string message(const std::string& text) const {
    return refusal_by([&] { kind_.read(text); });
  }
  void expect(const TableKind& damaged, int line, int column, const std::string& error) const {
    const std::string text = text_of(damaged), seen = message(text);
    EXPECT_TRUE(seen.starts_with(fmt::format("t:{}:{}: expected {}", line, column, error)))
        << kind_.name << "\n"
        << text << seen << fmt::format("\nnot {}:{} {}", line, column, error);
  }
};

TEST_P(TableFiles, AreReadWithTheLineEndsAndMarksOfOtherSystems) {
  const std::string text = text_of(kind_);
  EXPECT_EQ(message(text), "");
  EXPECT_EQ(message(text.substr(0, text.size() - 1)), "");
  std::string crlf = text.substr(kind_.before.size());
  for (std::size_t i = 0; (i = crlf.find('\n', i)) != std::string::npos; i += 2)
    crlf.insert(i, 1, '\r');
  EXPECT_EQ(message(kind_.before + crlf + "\r\n \t\r\n# end\r\n"), "");
  // The first line of readings must be theirs to the byte.
  if (kind_.before.empty()) {
    EXPECT_EQ(message("\xef\xbb\xbf" + crlf), "");
  }
}

TEST_P(TableFiles, NeedEachColumnOnce) {
  const int end = location(kind_.header, kind_.header.size());
  expect(with_column(kind_, kind_.header[0], kind_.rows[0][0]), header_, end + 1,
         "each column only once");
  expect(with_column(kind_, "size", "1"), header_, end + 1, "a column name");
  expect(with_column(kind_, "", ""), header_, end + 1, "a column name");
  if (!kind_.required) return;
  const TableKind damaged = without_column(kind_, *kind_.required);
  const std::string seen = message(text_of(damaged));
  EXPECT_TRUE(seen.starts_with(fmt::format("t:{}:", header_))) << seen;
  // Without its axis a table of errors has no name for the first column.
  const std::string missing = kind_.name == std::string("errors of an axis")
                                  ? "begins with an axis letter"
                                  : "column " + kind_.header[*kind_.required].substr(0, 3);
  EXPECT_NE(seen.find(missing), std::string::npos) << kind_.name << "\n" << seen;
}

TEST_P(TableFiles, NeedANumberInEachCell) {
  const int column = location(kind_.rows[0], kind_.number);
  for (const char* cell : {"x", "nan", "NaN", "inf", "-inf", "1e400", "1e13", "0x10", "", "1 2",
                           "--1", "+-1", "2e", "1;5", "\"1\""})
    expect(with_cell(kind_, kind_.number, cell), row_, column, "a number within +-1e");
  if (kind_.integer)
    for (const char* cell : {"x", "1.5", "-1", "2e9", ""})
      expect(with_cell(kind_, *kind_.integer, cell), row_, location(kind_.rows[0], *kind_.integer),
             "an integer from ");
  if (kind_.increasing) {
    TableKind damaged = kind_;
    damaged.rows[1][*kind_.increasing] = damaged.rows[0][*kind_.increasing];
    expect(damaged, row_ + 1, location(damaged.rows[1], *kind_.increasing),
           kind_.header[*kind_.increasing] + " that increases from row to row");
  }
}

TEST_P(TableFiles, NeedACellForEachColumn) {
  const std::string cells = fmt::format("{} cells, as in the header", kind_.header.size());
  TableKind damaged = kind_;
  damaged.rows[0].push_back("1");
  const int end = location(kind_.rows[0], kind_.rows[0].size());
  expect(damaged, row_, end + 1, cells + ", seen more");
  damaged.rows[0].resize(kind_.header.size() - 1);
  expect(damaged, row_, location(damaged.rows[0], damaged.rows[0].size()),
         fmt::format("{}, seen {}", cells, kind_.header.size() - 1));
}

TEST_P(TableFiles, NeedAHeaderAndRows) {
  EXPECT_NE(message(""), "");
  const std::string seen = message(kind_.before + "\n");
  EXPECT_NE(seen.find("expected a header such as "), std::string::npos) << kind_.name << seen;
  for (std::size_t rows = 0; rows < kind_.min_rows; ++rows) {
    TableKind damaged = kind_;
    damaged.rows.resize(rows);
    const std::string error = message(text_of(damaged));
    EXPECT_EQ(error, fmt::format("t:{}: expected at least {} row{}, seen {}", header_ + int(rows),
                                 kind_.min_rows, kind_.min_rows == 1 ? "" : "s", rows));
  }
}

TEST_P(TableFiles, AreTextWithoutControlBytes) {
  const std::size_t i = kind_.number;
  const int after = location(kind_.rows[0], i) + int(kind_.rows[0][i].size());
  expect(with_cell(kind_, i, kind_.rows[0][i] + std::string(1, '\0')), row_, after,
         "plain text, seen a byte 0x00");
  expect(with_cell(kind_, i, kind_.rows[0][i] + "\x1b[2J"), row_, after,
         "plain text, seen a byte 0x1b");
  EXPECT_NE(message("\xff\xfe" + text_of(kind_)), "");
}

TEST_P(TableFiles, ThatAreInjuredAreReadOrRefusedWithAPlace) {
  const unsigned seed = 20261128;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const std::string good = text_of(kind_);
  int refused = 0;
  for (int i = 0; i < 3000; ++i) {
    const std::string text = injured(good, "0159.-+eE,;: \t\n\r\"#jXmd_u", 3, random);
    const std::string seen = message(text);
    refused += !seen.empty();
    ASSERT_TRUE(seen.empty() || seen.starts_with("t:")) << text << "\n" << seen;
  }
  std::cout << kind_.name << ": " << refused << " of 3000 refused\n";
  EXPECT_GT(refused, 1000);
}

INSTANTIATE_TEST_SUITE_P(OfEveryKind, TableFiles, testing::ValuesIn(table_kinds()),
                         [](const auto& kind) { return fmt::format("Kind{}", kind.index); });

TEST(TableFile, TellsTheErrorsOfUpToTwentyRows) {
  const TableSchema schema{.header = "a", .columns = {{.names = {{"a"}}, .min = 0, .max = 1}}};
  std::string text = "a\n";
  for (int i = 0; i < 30; ++i) text += "2\n0.5\n";
  try {
    read_table(text, "t", schema);
    FAIL();
  } catch (const BadTable& error) {
    ASSERT_EQ(error.input_errors.size(), 20u);
    EXPECT_EQ(error.input_errors[19].line, 40);
    EXPECT_EQ(std::string(error.what()), "t:2:1: expected a between 0 and 1, seen '2'");
  }
}

TEST(TableFile, HasLimits) {
  TableSchema schema{.header = "a", .columns = {{.names = {{"a"}}}}};
  const std::string text = "a\n1\n2\n3\n";
  EXPECT_EQ(read_table(text, "t", schema).rows(), 3u);
  schema.max_rows = 2;
  EXPECT_THROW(read_table(text, "t", schema), BadInput);
  schema.max_rows = 3;
  schema.max_bytes = text.size() - 1;
  EXPECT_THROW(read_table(text, "t", schema), BadInput);
  schema.max_bytes = std::size_t(64) << 20;
  for (const char separator : {',', ';', ' '})
    EXPECT_THROW(read_table(std::string(std::size_t(32) << 20, separator), "t", schema), BadInput);
  EXPECT_THROW(read_table("a,b\n" + std::string(std::size_t(32) << 20, ','), "t", schema),
               BadInput);
}

}  // namespace
}  // namespace abbe::sim
