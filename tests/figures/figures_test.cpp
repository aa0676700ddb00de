// The figures of the source papers: scenes/FIGURES.md is generated here, and what documents and
// scenes say must be what stands there.
//
// Rows that are quick to compute are computed in every run, all of them under ABBE_LONG=1;
// ABBE_WRITE_FIGURES=1 writes the file.

#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <regex>
#include <sstream>

#include <fmt/args.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/figures/figure.h"

namespace abbe::figures {
namespace {

const std::filesystem::path root = ABBE_SOURCE_DIR;
const std::filesystem::path table_file = root / "scenes" / "FIGURES.md";

bool asked(const char* variable) {
  const char* value = std::getenv(variable);
  return value && std::string(value) == "1";
}

std::string contents(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

std::vector<Figure> all_figures() {
  std::vector<Figure> all;
  for (const auto& some : {guo(), yang(), yang_shafts(), peng(), chen(), grey_degrees()})
    all.insert(all.end(), some.begin(), some.end());
  return all;
}

std::string row(const Figure& figure, const std::string& computed) {
  return fmt::format("| {} | {} | {} | {} | {} | {} |\n", figure.paper, figure.quantity,
                     figure.published, computed, figure.command, figure.why);
}

const std::string head =
    "# Figures of the source papers\n\n"
    "What the papers print beside what the scenes here give. This file is generated, by\n"
    "`ABBE_WRITE_FIGURES=1 ./abbe test -R '^Figures'`; `./abbe test` fails where it, or a figure "
    "in "
    "a README or the\nhead of a scene that is taken from it, no longer is what is computed (with "
    "`ABBE_LONG=1` every row, else those\nthat take a moment).\n\n"
    "| paper | quantity | published | computed | command | why not equal |\n"
    "|---|---|---|---|---|---|\n";

/// Cells of every row of the table as it lies there, by paper and quantity.
std::map<std::string, std::vector<std::string>> shipped_rows() {
  std::map<std::string, std::vector<std::string>> rows;
  std::istringstream lines(contents(table_file));
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("| ", 0) != 0 || line.rfind("| paper |", 0) == 0) continue;
    std::vector<std::string> cells;
    for (std::size_t at = 2; at < line.size();) {
      const std::size_t end = line.find(" |", at);
      cells.push_back(line.substr(at, end - at));
      at = end + 3;
    }
    if (cells.size() == 6) rows[cells[0] + ": " + cells[1]] = cells;
  }
  return rows;
}

/// Names the first line that differs.
void expect_same_lines(const std::string& made, const std::string& there) {
  std::istringstream ours(made), theirs(there);
  std::string line, other;
  for (int number = 1; std::getline(ours, line); ++number) {
    if (!std::getline(theirs, other)) other = "the end of the file";
    ASSERT_EQ(line, other) << table_file << ":" << number;
  }
  EXPECT_FALSE(std::getline(theirs, other)) << "beyond the table: " << other;
}

TEST(Figures, TheTableIsWhatIsComputed) {
  const std::vector<Figure> figures = all_figures();
  const bool writes = asked("ABBE_WRITE_FIGURES"), every = writes || asked("ABBE_LONG");
  const auto shipped = shipped_rows();
  std::string text = head;
  int computed = 0;
  for (const Figure& figure : figures) {
    const std::string key = figure.paper + ": " + figure.quantity;
    const auto there = shipped.find(key);
    std::string value = there == shipped.end() ? "" : there->second[3];
    if (every || !figure.slow) {
      try {
        value = figure.computed();
      } catch (const std::exception& fault) {
        ADD_FAILURE() << key << ": " << fault.what();
      }
      ++computed;
      std::cout << key << ": " << value << " | " << figure.published << "\n";
    }
    text += row(figure, value);
    if (writes) continue;
    if (there == shipped.end()) {
      ADD_FAILURE() << "no row for " << key;
      continue;
    }
    EXPECT_EQ(value, there->second[3]) << key;
  }
  std::cout << computed << " of " << figures.size() << " rows computed\n";
  if (writes)
    std::ofstream(table_file, std::ios::binary) << text;
  else
    expect_same_lines(text, contents(table_file));
}

// --- what documents and scenes say

/// A sentence with numbers of the table in it.
struct Quote {
  std::string file;
  std::string words;              ///< {:.2f} for each number
  std::vector<std::string> from;  ///< rows; all their numbers, one after the other
};

/// Numbers of a cell: digits that stand for themselves, not in words such as R1.
std::vector<double> numbers_in(const std::string& cell) {
  static const std::regex number(R"((^|[ (,→])(-?\d+(\.\d+)?))");
  std::vector<double> all;
  for (std::sregex_iterator at(cell.begin(), cell.end(), number), end; at != end; ++at)
    all.push_back(std::stod((*at)[2]));
  return all;
}

/// Words on one line, comment signs and line breaks taken for blanks.
std::string flowing(const std::string& text) {
  static const std::regex breaks(R"(\s*\n#?\s*)");
  static const std::regex blanks(" +");
  return std::regex_replace(std::regex_replace(text, breaks, " "), blanks, " ");
}

std::vector<Quote> quotes();

TEST(Figures, WhatDocumentsAndScenesSayStandsInTheTable) {
  const auto shipped = shipped_rows();
  std::map<std::string, std::string> files;
  for (const Quote& quote : quotes()) {
    fmt::dynamic_format_arg_store<fmt::format_context> numbers;
    for (const std::string& key : quote.from) {
      ASSERT_TRUE(shipped.count(key)) << "no row " << key;
      for (const double number : numbers_in(shipped.at(key)[3])) numbers.push_back(number);
    }
    const std::string words = fmt::vformat(quote.words, numbers);
    if (!files.count(quote.file)) files[quote.file] = flowing(contents(root / quote.file));
    EXPECT_NE(files[quote.file].find(words), std::string::npos)
        << quote.file << " does not say \"" << words << "\"";
  }
}

std::vector<std::string> peng_rows(const std::string& what) {
  std::vector<std::string> rows;
  for (const char* part : {"plane", "cone", "sphere"})
    rows.push_back(fmt::format("Peng et al. 2017: {}: PV before → after, µm, {}", part, what));
  return rows;
}

std::vector<Quote> quotes() {
  const std::string readme = "scenes/README.md", table = "Yang 2012, table 1: ";
  const auto inferred = peng_rows("two numbers inferred");
  std::vector<Quote> all{
      {readme, "PV {:.2f} → {:.2f}, {:.2f} → {:.2f}, {:.2f} → {:.2f}; with the tool centred",
       peng_rows("spindle and tool chosen")},
      {readme, "{:.2f} → {:.2f}, {:.2f} → {:.2f}, {:.2f} → {:.2f}; the 13 elements alone",
       peng_rows("spindle chosen, tool centred")},
      {readme, "{:.2f} → {:.2f}, {:.2f} → {:.2f}, {:.2f} → {:.2f} |",
       peng_rows("13 elements alone")},
      {readme, "PV {:.2f} → {:.2f}, {:.2f} → {:.2f}, {:.2f} → {:.2f} over", inferred},
      {"scenes/platform_plane.toml",
       "13 elements alone {:.2f} -> {:.2f} {:.2f} -> {:.2f} {:.2f} -> {:.2f}",
       peng_rows("13 elements alone")},
      {"scenes/platform_plane.toml",
       "with the spindle {:.2f} -> {:.2f} {:.2f} -> {:.2f} {:.2f} -> {:.2f}",
       peng_rows("spindle chosen, tool centred")},
      {"scenes/platform_plane.toml",
       "with the spindle and the tool {:.2f} -> {:.2f} {:.2f} -> {:.2f} {:.2f} -> {:.2f}",
       peng_rows("spindle and tool chosen")},
      {"scenes/platform_plane.toml",
       "two numbers inferred {:.2f} -> {:.2f} {:.2f} -> {:.2f} {:.2f} -> {:.2f}", inferred},
      {"scenes/platform_cone.toml", "two numbers inferred gives {:.1f} and {:.1f}", {inferred[1]}},
      {"scenes/platform_sphere.toml",
       "two numbers inferred gives {:.1f} and {:.1f}",
       {inferred[2]}},
      {"README.md", "PV {:.2f} → {:.2f}, {:.1f} → {:.1f}, {:.1f} → {:.1f}",
       peng_rows("spindle and tool chosen")},
  };
  for (const char* shaft : {"stepped", "cone"}) {
    const std::string name = table + shaft + ": ",
                      scene = std::string("scenes/") + shaft + "_shaft.toml";
    const std::vector<std::string> trials{name + "radii after, trial 1, mm",
                                          name + "radii after, trial 2, mm"};
    const std::string six = "{:.4f} {:.4f} {:.4f} and {:.4f} {:.4f} {:.4f}";
    all.push_back({readme, "{:.4f} {:.4f} {:.4f}", {name + "radii before compensation, mm"}});
    all.push_back({readme, six, trials});
    all.push_back({readme,
                   "{:.2f} → {:.2f} by an open control",
                   {name + "spread by the law as learnt, open control, µm"}});
    all.push_back({readme,
                   "{:.2f} → {:.2f} by shifts of the origin",
                   {name + "spread by the law as learnt, shift of the origin, µm"}});
    all.push_back({scene,
                   "before compensation {:.4f} {:.4f} {:.4f}",
                   {name + "radii before compensation, mm"}});
    all.push_back({scene, six, trials});
    all.push_back({scene,
                   "from {:.2f} to {:.2f} um",
                   {name + "spread by the law as learnt, open control, µm"}});
  }
  return all;
}

}  // namespace
}  // namespace abbe::figures
