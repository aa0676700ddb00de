// Pages of tables and charts: of a study, an identification and an evaluation. Their figures are
// those of the JSON files, digit by digit; what is broken or of something else is refused by name.

#include "sim/report/figures_page.h"
#include <nlohmann/json.hpp>
#include <regex>
#include "sim/report/page_template.h"
#include "tests/injured.h"
#include "tests/safety/program_run.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;
using safety::Folder, safety::Ran;

const std::string scenes = ABBE_SOURCE_DIR "/scenes";

void put(const fs::path& file, const std::string& text) { std::ofstream(file) << text; }

/// What a page holds besides words.
ordered_json index_of(const fs::path& page) {
  const std::string html = safety::bytes(page);
  const std::string begin = "<script type=\"application/json\" id=\"index\">";
  const std::size_t from = html.find(begin), to = html.find("</script>", from);
  if (from == std::string::npos) return {};
  return ordered_json::parse(html.substr(from + begin.size(), to - from - begin.size()));
}

bool has_block(const ordered_json& index, const std::string& id) {
  return std::ranges::any_of(index.at("blocks"),
                             [&](const ordered_json& one) { return one.at("id") == id; });
}

const ordered_json& block(const ordered_json& index, const std::string& id) {
  for (const ordered_json& one : index.at("blocks"))
    if (one.at("id") == id) return one;
  throw std::out_of_range("no block " + id);
}

/// The place of a column by its label.
std::size_t column(const ordered_json& table, const std::string& label) {
  for (std::size_t k = 0; k < table.at("columns").size(); ++k)
    if (table.at("columns")[k].at("head") == ordered_json{{"label", label}}) return k;
  throw std::out_of_range("no column " + label);
}

TEST(ChartLabels, WhatThePageAndItsScriptNameIsThere) {
  std::set<std::string> keys;
  for (const auto& labels : {report_labels(), chart_labels()})
    for (const ReportLabel& one : labels) keys.insert(std::string(one.key));
  const std::string sources = std::string(charts_page()) + charts_script();
  const std::regex named(R"rx(data-(?:label|aria)="(\w+)"|\bL\("(\w+)"\)|button\("(\w+)")rx");
  int count = 0;
  for (std::sregex_iterator it(sources.begin(), sources.end(), named), end; it != end; ++it)
    for (int group = 1; group <= 3; ++group)
      if ((*it)[std::size_t(group)].matched) {
        ++count;
        EXPECT_TRUE(keys.count((*it)[std::size_t(group)])) << (*it)[std::size_t(group)];
      }
  EXPECT_GT(count, 15);
}

TEST(ChartLabels, ThePageMayAskNothingOfANetwork) {
  const std::string sources =
      std::string(charts_page()) + std::string(charts_style()) + charts_script();
  EXPECT_HAS(sources, "content=\"default-src 'none';");
  EXPECT_EQ(sources.find("connect-src"), std::string::npos);
  EXPECT_EQ(sources.find("https://"), std::string::npos);
  EXPECT_FALSE(std::regex_search(
      sources, std::regex(R"rx((?:src|href|url)\s*[=(]\s*["']?(?:https?:)?//)rx")));
}

// --- a study

struct StudyPages : testing::Test {
  static void SetUpTestSuite() {
    folder = std::make_unique<Folder>();
    study = *folder / "study.toml";
    put(study,
        "title = \"small <budget> & more\"\nscene = \"" + scenes +
            "/gantry_dome.toml\"\nset = { part.vertices = 300, sampling.max_step_mm = 1000 }\n"
            "responses = [\"pv\", \"rms\"]\nlimits = { pv_um = 20 }\n"
            "[[inputs]]\nevery = \"element\"\nof = [\"EX0C\", \"EZZ\", \"EXX\"]\nspread = 1\n"
            "low = -3\nhigh = 3\n[one_at_a_time]\n[monte_carlo]\ncases = 200\n"
            "[sobol_indices]\nbase_points = 32\n[tolerance]\nlimit_um = 20\nmachines = 200\n"
            "[[sweep]]\ninput = \"EXX\"\nfrom = -2\nto = 2\nsteps = 5\n"
            "[influence]\nchecks = 1\n");
    out = *folder / "out";
    ran = safety::run("study " + study.string() + " --report --out " + out.string());
    if (ran.code != 0) return;
    budget = ordered_json::parse(safety::bytes(out / "budget.json"));
    saved = ordered_json::parse(safety::bytes(out / "page.json"));
    index = index_of(out / "report.html");
  }
  static void TearDownTestSuite() { folder.reset(); }
  void SetUp() override { ASSERT_EQ(ran.code, 0) << ran.text; }
  static inline std::unique_ptr<Folder> folder;
  static inline fs::path study, out;
  static inline Ran ran;
  static inline ordered_json budget, saved, index;
};

TEST_F(StudyPages, TheFiguresAreThoseOfTheBudget) {
  const ordered_json& table = block(index, "figures");
  const ordered_json& responses = budget.at("arms")[0].at("responses");
  ASSERT_EQ(table.at("rows").size(), responses.size());
  for (std::size_t r = 0; r < responses.size(); ++r) {
    const ordered_json& row = table.at("rows")[r];
    for (const char* key : {"base", "root_sum_square", "sum", "worst", "cpk", "limit"})
      EXPECT_EQ(row[column(table, key)], responses[r].at(key)) << key;
    for (const char* key : {"mean", "p95", "max"})
      EXPECT_EQ(row[column(table, "machines_" + std::string(key))],
                responses[r].at("monte_carlo").at(key))
          << key;
    EXPECT_EQ(row[column(table, "within")], responses[r].at("within_limit_percent"));
  }
}

TEST_F(StudyPages, BarsAreSortedAndCarryTheirBands) {
  const ordered_json& contributions = budget.at("arms")[0].at("responses")[0].at("contributions");
  const ordered_json& rows = block(index, "indices-0-pv").at("rows");
  ASSERT_EQ(rows.size(), contributions.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const ordered_json& total = rows[k].at("values")[0];
    if (k > 0) {
      EXPECT_LE(total.at("value"), rows[k - 1].at("values")[0].at("value"));
    }
    bool found = false;
    for (const ordered_json& one : contributions)
      if (one.at("input") == rows[k].at("name")) {
        found = true;
        EXPECT_EQ(total, one.at("sobol_total"));
        EXPECT_EQ(rows[k].at("values")[1], one.at("sobol_first"));
      }
    EXPECT_TRUE(found) << rows[k];
  }
  for (const ordered_json& row : block(index, "tornado-0-rms").at("rows"))
    for (const ordered_json& one : budget.at("arms")[0].at("responses")[1].at("contributions"))
      if (one.at("input") == row.at("name")) {
        EXPECT_EQ(row.at("values")[0], one.at("low"));
        EXPECT_EQ(row.at("values")[1], one.at("high"));
      }
}

TEST_F(StudyPages, RandomMachinesHaveTheMeanOfTheBudget) {
  const ordered_json& values = block(index, "distribution-pv").at("series")[0].at("values");
  ASSERT_EQ(values.size(), 200u);
  double sum = 0.0;
  for (const ordered_json& value : values) sum += value.get<double>();
  const double mean =
      budget.at("arms")[0].at("responses")[0].at("monte_carlo").at("mean").at("value");
  EXPECT_NEAR(sum / 200.0, mean, 1e-9 * mean);
}

TEST_F(StudyPages, EveryAnalysisHasItsBlock) {
  for (const char* id : {"map-0", "whose-0-pv", "allocation-0", "allocation-totals-0",
                         "inputs-0-rms", "convergence-0-pv", "sweep-0", "map-figures-0"})
    EXPECT_TRUE(has_block(index, id)) << id;
  EXPECT_EQ(block(index, "sweep-0").at("panels")[0].at("series")[0].at("y"),
            budget.at("sweeps")[0].at("arms")[0].at("pv"));
  const ordered_json& table = block(index, "allocation-0");
  for (const ordered_json& row : table.at("rows"))
    for (std::size_t i = 0; i < budget.at("inputs").size(); ++i)
      if (budget.at("inputs")[i].at("name") == row[0]) {
        EXPECT_EQ(row[column(table, "factor_cheapest")],
                  budget.at("arms")[0].at("allocation").at("cheapest").at("factors")[i]);
      }
  EXPECT_FALSE(has_block(index, "proofs"));
  EXPECT_FALSE(has_block(index, "histories"));
}

TEST_F(StudyPages, AFolderGivesThePageAgain) {
  const std::string page = safety::bytes(out / "report.html");
  const Ran again =
      safety::run("report " + out.string() + " -o " + (*folder / "again.html").string());
  ASSERT_EQ(again.code, 0) << again.text;
  EXPECT_EQ(safety::bytes(*folder / "again.html"), page);
  EXPECT_EQ(page.find("<budget>"), std::string::npos) << "a title acts in the page";
  EXPECT_HAS(page, "download=\"scene.toml\"");
}

TEST_F(StudyPages, AStudyWithoutAPageTakesAnOldOneAway) {
  const fs::path copy = *folder / "other";
  fs::copy(out, copy, fs::copy_options::recursive);  // what `study --report` has written
  EXPECT_TRUE(fs::exists(copy / "report.html"));
  ASSERT_EQ(safety::run("study " + study.string() + " --out " + copy.string()).code, 0);
  EXPECT_FALSE(fs::exists(copy / "report.html"));
}

TEST_F(StudyPages, ABrokenOrForeignFolderIsRefusedByFile) {
  const fs::path broken = folder->write("broken/budget.json", budget.dump()).parent_path();
  const auto refused = [&](const std::string& text, const std::string& expected) {
    if (!text.empty()) put(broken / "page.json", text);
    const Ran ran = safety::run("report " + broken.string());
    EXPECT_EQ(ran.code, 3) << ran.text;
    EXPECT_HAS(ran.text, "page.json: expected a page saved by abbe study, identify or evaluate");
    EXPECT_HAS(ran.text, expected);
    EXPECT_FALSE(fs::exists(broken / "report.html"));
  };
  refused("", "no such file, as in results of older versions");
  refused("{", "text that is not JSON");
  refused(budget.dump(), "title");
  refused(std::string(1000, '[') + std::string(1000, ']'), "nested brackets");
  const auto changed = [&](const std::string& pointer, const ordered_json& value) {
    ordered_json other = saved;
    other[ordered_json::json_pointer(pointer)] = value;
    return other.dump();
  };
  for (const auto& [key, value] : saved.items()) {
    refused(saved.patch({{{"op", "remove"}, {"path", "/" + key}}}).dump(), key);
    refused(changed("/" + key, 3),
            key == "blocks" ? "blocks that are no list" : "json.exception.type_error");
  }
  refused(changed("/blocks/0/id", 3), "type must be string");
  refused(changed("/blocks/0/title/label", "nonsense"), "no label nonsense");
  refused(changed("/request/0/0", "nonsense\"><script>"), "no label nonsense");
  const std::string cell =
      "/blocks/0/rows/0/" + std::to_string(column(block(index, "figures"), "machines_mean"));
  refused(changed(cell + "/value", "\"><img src=x onerror=alert(1)>"), "not a figure");
  refused(changed("/blocks/0/src", "x\" onerror=\"alert(1)"), "picture");
  refused(changed("/blocks", nullptr), "blocks that are no list");
  refused(changed("/blocks", ordered_json{{"a", saved["blocks"][0]}}), "blocks that are no list");
  refused(changed("/blocks/0/type", "nosuch"), "no block of this type");
  refused(changed("/blocks/0/title", 5), "a block without a title");
  refused(changed("/blocks/0/rows", nullptr), "a block without its list rows");
  refused(changed("/blocks/0", {{"type", "table"}, {"id", "x"}, {"title", "t"}}), "columns");
  fs::remove(broken / "page.json");
  fs::create_symlink("page.json", broken / "page.json");
  refused("", "no such file");
}

TEST_F(StudyPages, AChangedPageIsSaidAndAnInjuredOneIsHarmless) {
  const fs::path copy = *folder / "injured";
  fs::copy(out, copy, fs::copy_options::recursive);
  ordered_json page = saved;
  page["title"] = page["command"] = page["warnings"][0] = page["blocks"][0]["rows"][0][0] =
      "</script></title><script>alert(1)</script>";
  put(copy / "page.json", page.dump());
  ASSERT_EQ(safety::run("report " + copy.string()).code, 0);
  const std::string html = safety::bytes(copy / "report.html");
  EXPECT_HAS(html, "page.json was changed after abbe wrote it");
  for (const char* text : {"<script>alert", "budget.json was changed"})
    EXPECT_EQ(html.find(text), std::string::npos) << text;
  std::mt19937 random(1);
  int shown = 0;
  for (int k = 0; k < 300; ++k) {
    put(copy / "page.json", injured(page.dump(), "\"{}[]:,<>/\\0null", 4, random));
    const auto show = [&] {
      const FiguresPage injured_page = read_page(copy / "page.json", {});
      EXPECT_EQ(page_html(injured_page).find("<script>alert"), std::string::npos) << k;
    };
    shown += thrown_text<BadInput>(show).empty();
  }
  EXPECT_TRUE(shown > 0 && shown < 300) << shown;
}

// --- an identification

struct IdentificationPages : testing::Test {
  static void SetUpTestSuite() {
    folder = std::make_unique<Folder>();
    const fs::path readings = *folder / "readings";
    measured =
        safety::run("measure " + scenes + "/gantry_calibration.toml --out " + readings.string());
    ran = safety::run("identify " + (readings / "laser.csv").string() + " " +
                      (readings / "square.csv").string() + " " + (readings / "level.csv").string() +
                      " --order 3 --report --out " + (*folder / "belief.toml").string());
    if (ran.code != 0) return;
    report = ordered_json::parse(safety::bytes(*folder / "belief.json"));
    index = index_of(*folder / "belief.html");
  }
  static void TearDownTestSuite() { folder.reset(); }
  void SetUp() override { ASSERT_EQ(ran.code, 0) << measured.text << ran.text; }
  static inline std::unique_ptr<Folder> folder;
  static inline Ran measured, ran;
  static inline ordered_json report, index;
};

TEST_F(IdentificationPages, TheNumbersAreThoseOfTheReport) {
  const ordered_json& table = block(index, "numbers");
  ASSERT_EQ(table.at("rows").size(), report.at("numbers").size());
  ASSERT_GT(table.at("rows").size(), 10u);
  for (std::size_t k = 0; k < table.at("rows").size(); ++k) {
    const ordered_json &row = table.at("rows")[k], &one = report.at("numbers")[k];
    EXPECT_EQ(row[column(table, "name")], one.at("name"));
    EXPECT_EQ(row[column(table, "value")], one.at("value"));
    EXPECT_EQ(row[column(table, "standard_uncertainty")], one.at("standard_uncertainty"));
    if (one.at("standard_uncertainty").is_null()) {
      EXPECT_NE(row[column(table, "remark")], "") << one.at("name") << " is not marked";
    }
  }
  EXPECT_EQ(block(index, "confounded").at("rows").size(), report.at("confounded").size());
  ASSERT_GT(report.at("confounded").size(), 0u) << "nothing to mark";
}

TEST_F(IdentificationPages, ResidualsHaveTheChiSquareOfTheFit) {
  double sum = 0.0;
  const ordered_json& series = block(index, "residuals").at("series");
  const ordered_json& all = series[0].at("values");
  EXPECT_EQ(all.size(), report.at("count").get<std::size_t>());
  for (const ordered_json& value : all) sum += value.get<double>() * value.get<double>();
  const double chi = report.at("reduced_chi_square"), degrees = report.at("degrees_of_freedom");
  // what is known beforehand of set-ups counts in chi-square, not among the readings
  EXPECT_LE(sum, 1.001 * chi * degrees);
  EXPECT_GE(sum, 0.8 * chi * degrees);
  ASSERT_EQ(series.size(), 4u) << "one of all, one of each file";
  std::size_t each = 0;
  for (std::size_t k = 1; k < series.size(); ++k) each += series[k].at("values").size();
  EXPECT_EQ(each, all.size());
}

TEST_F(IdentificationPages, EveryCurveHasItsBand) {
  const ordered_json& panels = block(index, "curves").at("panels");
  ASSERT_GT(panels.size(), 0u);
  for (const ordered_json& panel : panels) {
    const ordered_json& curve = panel.at("series")[0];
    ASSERT_EQ(curve.at("x").size(), curve.at("low").size());
    for (std::size_t k = 0; k < curve.at("x").size(); ++k) {
      EXPECT_LE(curve.at("low")[k], curve.at("y")[k]);
      EXPECT_GE(curve.at("high")[k], curve.at("y")[k]);
    }
  }
}

TEST_F(IdentificationPages, AnIdentificationWithoutAPageTakesAnOldOneAway) {
  const fs::path belief = *folder / "other.toml";
  const std::string again = "identify " + (*folder / "readings/laser.csv").string() +
                            " --order 3 --out " + belief.string();
  ASSERT_EQ(safety::run(again + " --report").code, 0);
  EXPECT_TRUE(fs::exists(*folder / "other.html"));
  ASSERT_EQ(safety::run(again).code, 0);
  EXPECT_TRUE(fs::exists(belief));
  EXPECT_FALSE(fs::exists(*folder / "other.html"));
}

TEST(PageBlocks, APanelThatDrawsAFewOfItsReadingsSaysHowMany) {
  EXPECT_EQ(reading_subset("EXX", 1500, 1500).title, "EXX");
  EXPECT_EQ(reading_subset("EXX", 0, 1500).every, 1);
  const ReadingSubset few = reading_subset("EXX", 1501, 1500);
  EXPECT_EQ(few.every, 2);
  EXPECT_EQ(few.title, phrase({"EXX, ", label_text("readings"), " 751 / 1501"}));
}

TEST_F(IdentificationPages, TheSavedReportGivesThePageAgain) {
  const fs::path page = *folder / "saved.html", foreign = *folder / "foreign.json";
  const Ran again =
      safety::run("report " + (*folder / "belief.json").string() + " -o " + page.string());
  ASSERT_EQ(again.code, 0) << again.text;
  EXPECT_EQ(index_of(page), index);
  EXPECT_HAS(safety::bytes(page), "download=\"belief.toml\"");
  put(foreign, "{\"machine\": \"w b X t\"}");
  const Ran refused = safety::run("report " + foreign.string());
  EXPECT_EQ(refused.code, 3);
  EXPECT_HAS(refused.text, "foreign_page.json: expected a page saved by abbe study, identify");
}

// --- an evaluation

TEST_F(IdentificationPages, AnEvaluationShowsTheFiguresOfItsFile) {
  const fs::path out = *folder / "laser";
  const Ran ran = safety::run("evaluate " + (*folder / "readings/laser.csv").string() +
                              " --report --out " + out.string());
  ASSERT_EQ(ran.code, 0) << ran.text;
  const ordered_json evaluation = ordered_json::parse(safety::bytes(out / "evaluation.json"));
  const ordered_json page = index_of(out / "report.html");
  const ordered_json& table = block(page, "standard-0");
  int compared = 0;
  for (const ordered_json& row : table.at("rows"))
    for (std::size_t t = 0; t < evaluation.at("tests").size(); ++t) {
      const ordered_json& test = evaluation.at("tests")[t];
      if (!test.contains(row[0].get<std::string>())) continue;
      EXPECT_EQ(row[t + 1], test.at(row[0].get<std::string>())) << row[0];
      ++compared;
    }
  EXPECT_GT(compared, 30);
  EXPECT_EQ(block(page, "positions").at("panels").size(), evaluation.at("tests").size());
  const Ran saved =
      safety::run("report " + out.string() + " -o " + (*folder / "saved_laser.html").string());
  ASSERT_EQ(saved.code, 0) << saved.text;
  EXPECT_EQ(index_of(*folder / "saved_laser.html"), page);
}

// --- saved cases

TEST(SavedPages, TheFiguresOfACaseAreThoseOfItsSummary) {
  const Folder folder;
  const fs::path out = folder / "run";
  const Ran ran = safety::run("run " + scenes + "/gantry_dome.toml --set part.vertices=300 " +
                              "--set sampling.max_step_mm=1000 --out " + out.string());
  ASSERT_EQ(ran.code, 0) << ran.text;
  const Ran reported = safety::run("report " + out.string());
  ASSERT_EQ(reported.code, 0) << reported.text;
  EXPECT_HAS(reported.text, "abbe run --report");
  const ordered_json summary = ordered_json::parse(safety::bytes(out / "summary.json"));
  const std::string with_map = safety::bytes(out / "report.html");
  for (const char* key : {"pv", "rms", "p95_abs"})
    EXPECT_HAS(with_map, "data-key=\"" + std::string(key) + "\" data-value=\"" +
                             summary.at("residual_um").at(key).dump() + "\"")
        << key;
  fs::remove(out / "residual.vtp");
  ASSERT_EQ(safety::run("report " + out.string()).code, 0);
  const ordered_json page = index_of(out / "report.html");
  const ordered_json& table = block(page, "figures");
  ASSERT_EQ(table.at("rows").size(), 1u);
  for (const char* key : {"pv", "rms", "p95_abs"})
    EXPECT_EQ(table.at("rows")[0][column(table, key)], summary.at("residual_um").at(key)) << key;
  put(folder / "summary.json", "{\"scene\": 1}");
  const Ran refused = safety::run("report " + folder.path().string());
  EXPECT_EQ(refused.code, 3);
  EXPECT_HAS(refused.text, "summary.json: expected the figures of cases");
}

}  // namespace
}  // namespace abbe::sim
