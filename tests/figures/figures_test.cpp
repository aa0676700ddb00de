// The figures of the source papers: scenes/FIGURES.md is generated here, and what documents and
// scenes say must be what stands there.
//
// Rows that are quick to compute are computed in every run, all of them under ABBE_LONG=1;
// ABBE_WRITE_FIGURES=1 writes the file and the numbers of the sentences that stand in documents and
// in heads of scenes.

#include <fmt/args.h>
#include <regex>
#include "tests/figures/figure.h"
#include "tests/sim/packaged_remarks.h"
#include "tests/test.h"

namespace abbe::figures {
namespace {

const fs::path root = ABBE_SOURCE_DIR;
const fs::path table_file = root / "scenes" / "FIGURES.md";

bool asked(const char* variable) {
  const char* value = std::getenv(variable);
  return value && std::string(value) == "1";
}

std::string contents(const fs::path& file) {
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
  std::string words;              ///< {:.2f} for each number, or {3:.2f} for the fourth
  std::vector<std::string> from;  ///< rows; all their numbers, one after the other
  bool drops = false;             ///< of each pair of these numbers the first less the second
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

/// Returns the words with any number for each of their numbers, as a pattern with a group for each.
std::regex pattern_of(const std::string& words) {
  static const std::regex field(R"(\{\d*:[^}]*\})"), special(R"([.*+?^$()|\[\]\\])");
  std::string pattern;
  std::string rest = words;
  for (std::smatch found; std::regex_search(rest, found, field); rest = found.suffix())
    pattern += std::regex_replace(found.prefix().str(), special, R"(\$&)") + R"((-?\d+(?:\.\d+)?))";
  pattern += std::regex_replace(rest, special, R"(\$&)");
  return std::regex(std::regex_replace(pattern, std::regex(" "), R"((?:\s|\n#)+)"));
}

std::string filled(const std::string& words, const std::vector<double>& numbers) {
  fmt::dynamic_format_arg_store<fmt::format_context> arguments;
  for (const double number : numbers) arguments.push_back(number);
  return fmt::vformat(words, arguments);
}

/// Writes the numbers into the sentence where it stands in its file, line breaks as they are. What
/// stands there more than once is left to its author.
void write_numbers(const std::string& file, const std::string& words,
                   const std::vector<double>& numbers) {
  const std::regex pattern = pattern_of(words);
  const std::string before = contents(root / file), sentence = filled(words, numbers);
  const std::sregex_iterator there(before.begin(), before.end(), pattern), end;
  std::smatch computed;
  if (std::distance(there, end) != 1 || !std::regex_search(sentence, computed, pattern)) return;
  std::string text = before;
  for (std::size_t i = there->size() - 1; i > 0; --i)
    text.replace(std::size_t(there->position(i)), std::size_t(there->length(i)), computed[i].str());
  std::ofstream(root / file, std::ios::binary) << text;
}

/// Compares a sentence of a file with its numbers, or writes these.
void expect_sentence(const std::string& file, const std::string& words,
                     const std::vector<double>& numbers, const std::string& commands = "") {
  const std::string sentence = filled(words, numbers);
  const auto says = [&] {
    return flowing(contents(root / file)).find(sentence) != std::string::npos;
  };
  if (asked("ABBE_WRITE_FIGURES") && !says()) write_numbers(file, words, numbers);
  EXPECT_TRUE(says()) << file << " does not say \"" << sentence << "\" " << commands;
}

std::vector<Quote> quotes();

std::vector<double> numbers_of(const Quote& quote,
                               const std::map<std::string, std::vector<std::string>>& table) {
  std::vector<double> numbers;
  for (const std::string& key : quote.from)
    for (const double number : numbers_in(table.at(key)[3])) numbers.push_back(number);
  if (!quote.drops) return numbers;
  std::vector<double> drops;
  for (std::size_t i = 0; i + 1 < numbers.size(); i += 2)
    drops.push_back(numbers[i] - numbers[i + 1]);
  return drops;
}

TEST(Figures, WhatDocumentsAndScenesSayStandsInTheTable) {
  const auto shipped = shipped_rows();
  for (const Quote& quote : quotes()) {
    for (const std::string& key : quote.from) ASSERT_TRUE(shipped.count(key)) << "no row " << key;
    expect_sentence(quote.file, quote.words, numbers_of(quote, shipped));
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

/// What the heads of the platform's scenes say beside the table of the plane's.
std::vector<Quote> platform_quotes() {
  const std::string plane = "scenes/platform_plane.toml", cone = "scenes/platform_cone.toml",
                    sphere = "scenes/platform_sphere.toml";
  const auto alone = peng_rows("13 elements alone"),
             centred = peng_rows("spindle chosen, tool centred"),
             chosen = peng_rows("spindle and tool chosen"),
             inferred = peng_rows("two numbers inferred");
  std::vector<Quote> all{
      {plane, "with the tool centred {:.2f}, {:.2f} and {:.2f} um", centred, true},
      {plane, "only {:.2f} is gained", {chosen[2]}, true},
      {plane, "({:.2f} and {:.2f} on plane and cone)", {chosen[0], chosen[1]}, true}};
  for (const std::size_t i : {1u, 2u}) {
    const std::string& file = i == 1 ? cone : sphere;
    all.push_back({file, "two numbers inferred gives {:.1f} and {:.1f}", {inferred[i]}});
    all.push_back({file, "Computed {0:.1f} um peak to valley", {chosen[i]}});
    all.push_back({file, "out of the program it is {1:.1f}, measured", {chosen[i]}});
    all.push_back(
        {file, "elements make {0:.1f}, the spindle {2:.1f} with them", {alone[i], centred[i]}});
  }
  return all;
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
      {"scenes/platform_perfect.toml",
       "= {:.6f} um",
       {"Peng et al. 2017: cusp of the feed, R − sqrt(R² − f²/4), µm"}},
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
  };
  for (const char* tour : {"scenes/TOUR.md", "scenes/TOUR.zh.md"}) {
    all.push_back({tour, "PV {:.2f} → {:.2f}, {:.1f} → {:.1f}, {:.1f} → {:.1f}",
                   peng_rows("spindle and tool chosen")});
    all.push_back({tour, "| {:.2f} → {:.2f}, {:.2f} → {:.2f}, {:.2f} → {:.2f}", inferred});
  }
  const std::vector<std::string> spreads{
      table + "stepped: spread before → after in three trials, µm",
      table + "cone: spread before → after in three trials, µm"},
      learnt{table + "stepped: spread by the law as learnt, open control, µm",
             table + "cone: spread by the law as learnt, open control, µm"};
  const std::string tour = "scenes/TOUR.md", chinese = "scenes/TOUR.zh.md",
                    three = "{:.1f} → {:.1f}, {:.1f}", two = "{:.2f} → {:.2f}, {:.2f} → {:.2f}";
  all.push_back({tour, three + " and " + three + " in two trials", spreads});
  all.push_back({tour, two + " by the law as learnt", learnt});
  all.push_back({chinese, three + " 和 " + three, spreads});
  all.push_back({chinese, "按学得的规律为 " + two, learnt});
  for (const auto& some : {sensor_quotes(), reading_quotes(), platform_quotes()})
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
    all.push_back({readme,
                   shaft == std::string("cone") ? "without noise {:.2f} → {:.2f}"
                                                : "without noise of the current {:.2f} → {:.2f}",
                   {name + "spread by the law as learnt, open control, no noise, µm"}});
    all.push_back({scene,
                   "before compensation {:.4f} {:.4f} {:.4f}",
                   {name + "radii before compensation, mm"}});
    all.push_back({scene, six, trials});
    all.push_back({scene,
                   "from {:.2f} to {:.2f} um",
                   {name + "spread by the law as learnt, open control, µm"}});
    all.push_back({scene,
                   "to {1:.2f} by shifting the origin",
                   {name + "spread by the law as learnt, shift of the origin, µm"}});
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
  bool slow = false;  ///< run only under ABBE_LONG=1 and where numbers are written
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
      {file, "stand cusps of {:.2f} um", {{{scene, {}, "error_free"}, "/residual_um/pv"}}},
      {file,
       "the {:.2f} become {:.2f}, for",
       {{{scene}, at}, {{scene, {}, "part-position-program"}, at}}},
      {file, "geometric errors alone {:.3f} {:.3f}", before_and_after("")},
      {file, "worn ball {:.3f} {:.3f}", before_and_after("worn ball")},
      {file, "other pose {:.3f} {:.3f}", before_and_after("other pose")},
      {file, "force {:.3f} {:.3f}", before_and_after("force"), true},
      {file, "drift {:.3f} {:.3f}", before_and_after("drift"), true},
  };
  return all;
}

/// A row of a tour's table: error-free PV, PV and RMS, machine's part, then that of compensators.
RunQuote tour_row(const std::string& tour, const std::string& scene, const std::string& words,
                  const std::vector<std::string>& compensators) {
  std::vector<RunNumber> numbers{{{scene, {}, "error_free"}, "/residual_um/pv"},
                                 {{scene}, "/residual_um/pv"},
                                 {{scene}, "/residual_um/rms"},
                                 {{scene}, "/machine_um/rms"}};
  for (const std::string& name : compensators)
    numbers.push_back({{scene, {}, name}, "/machine_um/rms"});
  return {tour, "| `" + scene + "` | " + words, numbers, true};
}

/// The table of a tour, in one of its languages.
std::vector<RunQuote> tour_quotes(const std::string& tour) {
  const std::string position = "perfect-position-ideal", decoupled = "perfect-decoupled-ideal";
  return {
      tour_row(tour, "gantry_dome", "{:.2f} | {:.1f} / {:.1f} | {:.2f} | {:.3f} | {:.4f} |",
               {position, decoupled}),
      tour_row(tour, "gantry_tilted_flat", "{:.2f} | {:.2f} / {:.1f} | {:.2f} | {:.3f} | {:.4f} |",
               {position, decoupled}),
      tour_row(tour, "gantry_mesh", "{:.2f} | {:.1f} / {:.1f} | {:.2f} | {:.3f} |", {position}),
      tour_row(tour, "cone_frustum", "{:.2f} | {:.1f} / {:.1f} | {:.2f} | {:.3f} | {:.4f} |",
               {position, decoupled}),
      tour_row(tour, "platform_plane", "{:.2f} | {:.2f} / {:.2f} | {:.2f} |", {}),
      tour_row(tour, "platform_cone", "{:.2f} | {:.1f} / {:.2f} | {:.2f} |", {}),
      tour_row(tour, "platform_sphere", "{:.2f} | {:.1f} / {:.2f} | {:.2f} |", {}),
      tour_row(tour, "gantry_force", "{:.2f} | {:.1f} / {:.2f} | {:.2f} |", {}),
      tour_row(tour, "stepped_shaft", "{:.2f} | {:.2f} / {:.1f} | {:.2f} | {:.3f} |", {position}),
      tour_row(tour, "thin_wall", "{:.2f} | {:.2f} / {:.2f} | {:.2f} | {:.4f} |", {position}),
      {tour,
       "| `platform_perfect` | {:.4f} |",
       {{{"platform_perfect", {}, "error_free"}, "/residual_um/pv"}},
       true},
  };
}

std::vector<RunQuote> thin_wall_quotes() {
  const std::string scene = "thin_wall", file = "scenes/thin_wall.toml", rms = "/machine_um/rms",
                    pv = "/machine_um/pv", computed = "force-position-program",
                    measured = "part-position-program";
  const sim::Override fine{"compensation.word_resolution_mm", "1e-6"},
      modulus{"belief.force.compliance.workpiece.youngs_modulus_GPa", "71.7"},
      silent{"instrument.0.noise_um", "0"};
  return {
      {file,
       "the deflection of {:.3f} um RMS becomes {:.3f} as computed and {:.3f} as measured",
       {{{scene}, rms}, {{scene, {}, computed}, rms}, {{scene, {}, measured}, rms}},
       true},
      {"scenes/README.md",
       "machine {:.3f} → {:.3f} computed (modulus 70 instead of 71.7 GPa), → {:.3f} measured",
       {{{scene}, rms}, {{scene, {}, computed}, rms}, {{scene, {}, measured}, rms}},
       true},
      {file,
       "with the true one it is {:.4f} in words of 1 nm",
       {{{scene, {modulus, fine}, computed}, rms}},
       true},
      {file, "The second, {:.2f} from peak to valley", {{{scene, {}, measured}, pv}}, true},
      {file,
       "without noise {:.3f} (PV {:.2f}), in words of 1 nm besides {:.3f}",
       {{{scene, {silent}, measured}, rms},
        {{scene, {silent}, measured}, pv},
        {{scene, {silent, fine}, measured}, rms}},
       true},
  };
}

std::vector<RunQuote> fused_quotes() {
  const auto left = [](const std::string& name) {
    return RunNumber{{"gantry_fused", {}, name}, "/machine_um/rms"};
  };
  const std::string end = "-iterated-ideal";
  const RunNumber wrong = left(""), geometry = left("identified" + end),
                  heat = left("thermal" + end), force = left("force" + end),
                  both = left("composite" + end), fused = left("fused" + end),
                  pulses = left("fused-iterated-pulses");
  const std::string file = "scenes/gantry_fused.toml", tour = "scenes/TOUR.md";
  return {
      {file,
       "uncompensated {:.2f}; geometry alone {:.2f}, heat alone {:.2f}, force alone {:.2f} (what",
       {wrong, geometry, heat, force},
       true},
      {file,
       "geometry and heat (composite) {:.2f}, all three {:.2f}, through",
       {both, fused},
       true},
      {file, "a position loop of 20 Hz {:.2f}.", {pulses}, true},
      {tour,
       "{:.1f} µm RMS become {:.1f} with the geometry believed alone, {:.1f} with the heat, {:.1f} "
       "with the force, and {:.2f} with all three",
       {wrong, geometry, heat, force, fused},
       true},
      {"scenes/README.md",
       "machine {:.2f}; geometry alone {:.2f}, heat {:.2f}, force {:.2f}, geometry and heat "
       "(`composite`) {:.2f}, all three {:.2f}, by pulses of 1 µm {:.2f} |",
       {wrong, geometry, heat, force, both, fused, pulses},
       true},
      {tour, "| all three | {:.1f} → {:.2f} RMS |", {wrong, fused}, true},
  };
}

std::vector<RunQuote> run_quotes() {
  const std::string plane = "scenes/platform_plane.toml", rms = "/residual_um/rms",
                    pv = "/residual_um/pv", free = "error_free";
  std::vector<RunQuote> all{
      {"scenes/stepped_shaft.toml",
       "a perfect belief leaves {:.3f} um RMS",
       {{{"stepped_shaft", {}, "perfect-position-ideal"}, "/machine_um/rms"}},
       true},
      {"scenes/README.md",
       "| `gantry_force` | machine's part, RMS: {:.2f};",
       {{{"gantry_force"}, "/machine_um/rms"}},
       true},
      {plane,
       "(cusps alone {:.2f} {:.2f} {:.2f})",
       {{{"platform_plane", {}, free}, pv},
        {{"platform_cone", {}, free}, pv},
        {{"platform_sphere", {}, free}, pv}},
       true},
      {"scenes/platform_sphere.toml",
       "the RMS even rises, from {:.1f} to {:.1f}.",
       {{{"platform_sphere"}, rms}, {{"platform_sphere", {}, "identified-position-program"}, rms}},
       true},
  };
  for (const auto& some : {tour_quotes("scenes/TOUR.md"), tour_quotes("scenes/TOUR.zh.md"),
                           on_machine_quotes(), thin_wall_quotes(), fused_quotes()})
    all.insert(all.end(), some.begin(), some.end());
  return all;
}

/// A scene warns of itself only of what is listed.
void expect_only_remarks(const SceneCase& run) {
  if (!run.set.empty() || !run.variant.empty()) return;
  if (!run.case_name.empty() && run.case_name != "error_free") return;
  for (const auto& warning : summary_of(run)["warnings"])
    EXPECT_TRUE(sim::is_remark(run.scene, warning.get<std::string>()))
        << command(run) << " warns: " << warning;
}

TEST(Figures, WhatDocumentsAndScenesSayOfRunsIsWhatRunsGive) {
  const bool every = asked("ABBE_LONG") || asked("ABBE_WRITE_FIGURES");
  int run = 0, all = 0;
  for (const RunQuote& quote : run_quotes()) {
    ++all;
    EXPECT_TRUE(std::regex_search(contents(root / quote.file), pattern_of(quote.words)))
        << quote.file << " has no numbers for \"" << quote.words << "\"";
    if (quote.slow && !every) continue;
    ++run;
    std::vector<double> numbers;
    std::string commands;
    for (const RunNumber& number : quote.numbers) {
      numbers.push_back(
          summary_of(number.run).at(nlohmann::json::json_pointer(number.at)).get<double>());
      commands += command(number.run) + " " + number.at + "; ";
      expect_only_remarks(number.run);
    }
    std::cout << quote.file << ": " << filled(quote.words, numbers) << std::endl;
    expect_sentence(quote.file, quote.words, numbers, "(" + commands + ")");
  }
  std::cout << run << " of " << all << " sentences run\n";
}

// --- no figure in the head of a scene that nothing holds

/// Words of a head whose numbers are not computed here.
struct Stated {
  std::string scene;
  std::vector<std::string> words;
};

std::vector<Stated> chosen_or_published() {
  return {
      {"cone_shaft",
       {"radius 12.5 mm", "from 0.078 mm at the chuck to 1.142 mm",
        "(12.4887 12.4853 12.4826 in the paper)",
        "(12.4931 12.4914 12.4893 and 12.4895 12.4921 12.4934)"}},
      {"gantry_force", {"stands 0.3 mm proud"}},
      {"on_machine_measurement",
       {"reads 0.3 nm of", "in words of 0.1 um", "words of 0.1 nm", "20 (1 - cos 45) = 5.86"}},
      {"platform_cone", {"0.4 mm high", "out to 10.8 mm", "the tool 0.1 mm beyond"}},
      {"platform_plane",
       {"21.6 mm diameter", "tool 0.1 mm beyond", "e x slope = 4.0", "8.0 at the rim",
        "core of 0.1 mm radius", "5.9 um of axial motion once a turn instead of the 1.5",
        "from 0.15 mm"}},
      {"platform_sphere", {"R 125.2, 0.4 mm high", "out to 10.8 mm", "the tool 0.1 mm beyond"}},
      {"shaft_training", {"from 0.15 to 1.5 mm"}},
      {"stepped_shaft",
       {"radius 12.5 mm", "depths of 0.637, 1.0 and 1.363 mm",
        "(12.4847 12.4816 12.4782 in the paper)",
        "(12.4936 12.4913 12.4898 and 12.4911 12.4894 12.4927)", "agree to 0.3 um",
        "by 0.4 in trial 1 and by 1.3 to 1.6 in trial 2", "the spread of 3.4 um"}},
      {"thin_wall", {"cuts 0.5 mm deep", "2.4 % too low", "0.1 each", "words of 0.1 um"}},
      {"yang_axis",
       {"1.1192e-6 x^4 + 8.9455e-5 x^3 + 9.0575e-4 x^2 - 6.2218e-3 x + 0.29717",
        "(-0.027523 - 0.0049600 dT7 + 0.033601 dT8)", "+0.297 um at x = 0"}},
      {"yang_composite", {"--margin 0.5"}},
      // ChannelScenes compare what every channel leaves with its formula, to 2 to 15 %
      {"gantry_channels",
       {"program 23.5 23.6", "pulses 69.2 72.8", "open 13.6 13.6", "piezo 93.5 95.3",
        "its lag is 4.3", "by 1.58 um/s", "leaves 13.7 nm of 43.4 um"}},
  };
}

/// Returns the comment that a file begins with.
std::string head_of(const std::string& text) {
  std::istringstream lines(text);
  std::string head;
  for (std::string line; std::getline(lines, line) && line.rfind('#', 0) == 0;) head += "\n" + line;
  return flowing(head);
}

TEST(Figures, EveryNumberInTheHeadOfASceneIsComputedOrStated) {
  static const std::regex decimal(R"(\d+\.\d+)");
  std::vector<std::pair<std::string, std::string>> sentences;
  for (const Quote& quote : quotes()) sentences.emplace_back(quote.file, quote.words);
  for (const RunQuote& quote : run_quotes()) sentences.emplace_back(quote.file, quote.words);
  const std::vector<Stated> stated = chosen_or_published();
  int heads = 0;
  for (const auto& entry : fs::directory_iterator(root / "scenes")) {
    if (entry.path().extension() != ".toml") continue;
    ++heads;
    const std::string scene = entry.path().stem().string();
    std::string head = head_of(contents(entry.path()));
    for (const Stated& of_scene : stated)
      for (const std::string& words : of_scene.words) {
        if (of_scene.scene != scene) continue;
        const auto at = head.find(words);
        if (at == std::string::npos)
          ADD_FAILURE() << scene << " does not state \"" << words << "\"";
        else
          head.replace(at, words.size(), "...");
      }
    for (const auto& [file, words] : sentences)
      if (file == "scenes/" + scene + ".toml")
        head = std::regex_replace(head, pattern_of(words), "...");
    std::smatch number;
    EXPECT_FALSE(std::regex_search(head, number, decimal))
        << scene << ": nothing computes " << number.str() << " in its head: " << head;
  }
  EXPECT_GT(heads, 25);
}

}  // namespace
}  // namespace abbe::figures
