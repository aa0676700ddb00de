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
  for (const auto& some :
       {guo(), yang(), yang_readings(), yang_shafts(), peng(), chen(), grey_degrees()})
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

/// Words on one line, comment signs and line breaks taken for blanks, the sign − for -.
std::string flowing(const std::string& text) {
  static const std::regex minus("−");
  static const std::regex breaks(R"(\s*\n#?\s*)");
  static const std::regex blanks(" +");
  const std::string one_line =
      std::regex_replace(std::regex_replace(text, breaks, " "), blanks, " ");
  return std::regex_replace(one_line, minus, "-");
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

/// What the scenes' table says of chosen sensors.
std::vector<Quote> sensor_quotes() {
  const std::string readme = "scenes/README.md",
                    yang = "Yang 2012: ", chen = "Chen and Wang 2013: ";
  const std::string together = "X, Y and Z together on another day by ",
                    missed = "X, Y and Z missed on another day by the four of the ";
  return {
      {readme,
       "X, Y and Z by {:.1f}, {:.1f} and {:.1f}: together {:.1f} %",
       {yang + missed + "comprehensive degree, µm RMS; together, of the ranges"}},
      {readme,
       "missed by an RMS of {:.1f}, {:.1f} and {:.1f} of ranges of 28, 33 and 58: together {:.1f} "
       "%",
       {yang + missed + "regression, µm RMS; together, of the ranges"}},
      {readme,
       "on the day that chose: {:.2f}, {:.2f}, {:.2f}; the regression's four {:.2f}, {:.2f}, "
       "{:.2f}",
       {yang + "X, Y and Z missed by a regression on the four of the comprehensive degree, µm RMS",
        yang + "X, Y and Z missed by the four of the regression, µm RMS"}},
      {readme,
       "Z by {:.2f} of 78.6, together {:.1f} %",
       {chen + "Z on another day by Deng's four, initial image, µm RMS",
        chen + together + "Deng's four, initial image, % of ranges"}},
      {readme,
       "by {:.2f}, together {:.1f} %",
       {chen + "Z on another day by the paper's four, µm RMS",
        chen + together + "the paper's four, % of ranges"}},
      {readme,
       "Z is missed by {:.3f}, by the paper's four by {:.3f} and by the regression's by {:.3f}",
       {chen + "Z on the day that is fitted by Deng's four, initial image, µm RMS",
        chen + "Z on the day that is fitted by the paper's four, µm RMS",
        chen + "Z on the day that is fitted by the scene's four, µm RMS"}},
  };
}

/// What it says of readings of the composite element and of the step diagonal.
std::vector<Quote> reading_quotes() {
  const std::string readme = "scenes/README.md", yang = "Yang 2012: ";
  const std::string flat = yang + "flat under the composite element, ",
                    rests = ": machine's part uncompensated, by the cold curve, by both, µm RMS",
                    step = yang + "step diagonal, ", square = ": EC0Y, EB0Z, EA0Z, µrad",
                    corrected = yang + "flat corrected by the step diagonal, ",
                    parts = ": machine's part before → after, µm RMS";
  const std::string three = "{:.2f}, {:.2f}, {:.2f}";
  return {
      {readme,
       "separated: {:.3f} ± {:.3f} and {:.3f} ± {:.3f} µm/m/K by screw and nut",
       {yang + "composite element separated: slope by screw and nut, µm/m/K"}},
      {readme,
       "slope left at ΔT = 0: {:.2f} ± {:.2f} µm/m",
       {yang + "composite element separated: slope that later starts leave at ΔT = 0, µm/m"}},
      {readme,
       "cold " + three + "; an hour after work " + three + "; after 3 h " + three +
           "; on another day in a warmer room " + three,
       {flat + "cold" + rests, flat + "an hour after work" + rests, flat + "after 3 h" + rests,
        flat + "on another day" + rests}},
      {readme,
       "EC0Y, EB0Z, EA0Z {:.1f}, {:.1f}, {:.1f} µrad, chi-square {:.2f}, positionings by nuts "
       "{:.2f}, {:.2f}, {:.2f} µm/m/K",
       {step + "translations alone" + square, step + "translations alone: reduced chi-square",
        step + "translations alone: EXX, EYY, EZZ by their nuts, µm/m/K"}},
      {readme,
       "With angles of 20 to 40 µrad {:.1f}, {:.1f}, {:.1f} µrad, chi-square {:.0f}",
       {step + "with angles" + square, step + "with angles: reduced chi-square"}},
      {readme,
       "translations alone {:.2f} → {:.2f} (86 %); with angles {:.2f} → {:.2f}",
       {corrected + "translations alone" + parts, corrected + "with angles" + parts}},
  };
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
      {"scenes/TOUR.md", "PV {:.2f} → {:.2f}, {:.1f} → {:.1f}, {:.1f} → {:.1f}",
       peng_rows("spindle and tool chosen")},
  };
  for (const auto& some : {sensor_quotes(), reading_quotes()})
    all.insert(all.end(), some.begin(), some.end());
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

// --- what documents and scenes say of runs

/// A number of `summary.json` of a case.
struct RunNumber {
  SceneCase run;
  std::string at;  ///< JSON pointer
};

/// A sentence with numbers of runs in it.
struct RunQuote {
  std::string file;
  std::string words;  ///< {:.2f} for each number
  std::vector<RunNumber> numbers;
  bool slow = false;  ///< run under ABBE_LONG=1 only
};

std::vector<RunQuote> on_machine_quotes() {
  const std::string scene = "on_machine_measurement", file = "scenes/" + scene + ".toml",
                    at = "/at_vertices_um/rms", ideal = "part-position-ideal";
  const auto before_and_after = [&](const std::string& variant) {
    return std::vector<RunNumber>{{{scene, {}, "", variant}, at},
                                  {{scene, {}, ideal, variant}, at}};
  };
  std::vector<RunQuote> all{
      {file, "a geometric error of {:.2f} um RMS", {{{scene}, at}}},
      {file, "the {:.2f} become", {{{scene}, at}}},
      {file, "become {:.2f}, for", {{{scene, {}, "part-position-program"}, at}}},
      {file, "geometric errors alone {:.3f} {:.3f}", before_and_after("")},
      {file, "worn ball {:.3f} {:.3f}", before_and_after("worn ball")},
      {file, "other pose {:.3f} {:.3f}", before_and_after("other pose")},
      {file, "force {:.3f} {:.3f}", before_and_after("force"), true},
      {file, "drift {:.3f} {:.3f}", before_and_after("drift"), true},
  };
  return all;
}

/// A row of TOUR's table: error-free PV, PV and RMS, machine's part, then that of compensators.
RunQuote tour_row(const std::string& scene, const std::string& words,
                  const std::vector<std::string>& compensators, bool slow = true) {
  std::vector<RunNumber> numbers{{{scene, {}, "error_free"}, "/residual_um/pv"},
                                 {{scene}, "/residual_um/pv"},
                                 {{scene}, "/residual_um/rms"},
                                 {{scene}, "/machine_um/rms"}};
  for (const std::string& name : compensators)
    numbers.push_back({{scene, {}, name}, "/machine_um/rms"});
  return {"scenes/TOUR.md", "| `" + scene + "` | " + words, numbers, slow};
}

std::vector<RunQuote> run_quotes() {
  const std::string position = "perfect-position-ideal", decoupled = "perfect-decoupled-ideal",
                    program = "perfect-iterated-program";
  std::vector<RunQuote> all{
      tour_row("gantry_dome", "{:.2f} | {:.1f} / {:.1f} | {:.2f} | {:.3f} | {:.4f} |",
               {position, decoupled}),
      tour_row("gantry_tilted_flat", "{:.2f} | {:.2f} / {:.1f} | {:.2f} | {:.3f} | {:.4f} |",
               {position, decoupled}),
      tour_row("gantry_mesh", "{:.2f} | {:.1f} / {:.1f} | {:.2f} | {:.3f} |", {position}),
      tour_row("cone_frustum", "{:.2f} | {:.1f} / {:.1f} | {:.2f} | {:.3f} | {:.4f} |",
               {position, decoupled}),
      tour_row("platform_plane", "{:.2f} | {:.2f} / {:.2f} | {:.2f} |", {}),
      tour_row("platform_cone", "{:.2f} | {:.1f} / {:.2f} | {:.2f} |", {}),
      tour_row("platform_sphere", "{:.2f} | {:.1f} / {:.2f} | {:.2f} |", {}),
      tour_row("gantry_force", "{:.2f} | {:.1f} / {:.2f} | {:.2f} |", {}),
      tour_row("stepped_shaft", "{:.2f} | {:.2f} / {:.1f} | {:.2f} | {:.3f} |", {position}),
      tour_row("thin_wall", "{:.2f} | {:.2f} / {:.2f} | {:.2f} | {:.4f} |", {position}),
      {"scenes/TOUR.md",
       "| `platform_perfect` | {:.4f} |",
       {{{"platform_perfect", {}, "error_free"}, "/residual_um/pv"}},
       true},
      {"scenes/thin_wall.toml",
       "the deflection of {:.3f} um RMS becomes {:.3f}",
       {{{"thin_wall"}, "/machine_um/rms"},
        {{"thin_wall", {}, "force-position-program"}, "/machine_um/rms"}},
       true},
      {"scenes/gantry_fused.toml",
       "uncompensated {:.2f}; geometry alone",
       {{{"gantry_fused"}, "/machine_um/rms"}},
       true},
  };
  for (RunQuote& quote : on_machine_quotes()) all.push_back(std::move(quote));
  return all;
}

/// The words with any number for each, as a pattern.
std::regex pattern_of(const std::string& words) {
  static const std::regex field(R"(\{:[^}]*\})"), special(R"([.*+?^$()|\[\]\\])");
  std::string pattern;
  std::string rest = words;
  for (std::smatch found; std::regex_search(rest, found, field); rest = found.suffix())
    pattern += std::regex_replace(found.prefix().str(), special, R"(\$&)") + R"(-?\d+(\.\d+)?)";
  return std::regex(pattern + std::regex_replace(rest, special, R"(\$&)"));
}

TEST(Figures, WhatDocumentsAndScenesSayOfRunsIsWhatRunsGive) {
  std::map<std::string, std::string> files;
  int run = 0, all = 0;
  for (const RunQuote& quote : run_quotes()) {
    ++all;
    if (!files.count(quote.file)) files[quote.file] = flowing(contents(root / quote.file));
    const std::string& text = files[quote.file];
    EXPECT_TRUE(std::regex_search(text, pattern_of(quote.words)))
        << quote.file << " has no numbers for \"" << quote.words << "\"";
    if (quote.slow && !asked("ABBE_LONG")) continue;
    ++run;
    fmt::dynamic_format_arg_store<fmt::format_context> numbers;
    std::string commands;
    for (const RunNumber& number : quote.numbers) {
      numbers.push_back(
          summary_as_run(number.run).at(nlohmann::json::json_pointer(number.at)).get<double>());
      commands += command(number.run) + " " + number.at + "; ";
    }
    const std::string words = fmt::vformat(quote.words, numbers);
    std::cout << quote.file << ": " << words << std::endl;
    EXPECT_NE(text.find(words), std::string::npos)
        << quote.file << " does not say \"" << words << "\" (" << commands << ")";
  }
  std::cout << run << " of " << all << " sentences run\n";
}

}  // namespace
}  // namespace abbe::figures
