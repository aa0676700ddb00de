#include "sim/study/budget.h"
#include "kinematics/text.h"
#include "sim/files/output.h"
#include "sim/study/run_study.h"
#include "sim/study/study_charts.h"
#include "sim/study/study_text.h"
#include "tests/study/synthetic_budget.h"
#include "tests/test.h"

namespace abbe::sim::study {
namespace {

using test::compute_budget;
using test::Synthetic;

/// A table as RFC 4180 has it, read by the letter.
std::vector<std::vector<std::string>> read_csv(const std::string& text) {
  std::vector<std::vector<std::string>> rows(1, {""});
  bool inside = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (inside && c == '"' && i + 1 < text.size() && text[i + 1] == '"') {
      rows.back().back() += '"';
      ++i;
    } else if (c == '"') {
      inside = !inside;
    } else if (!inside && c == ',') {
      rows.back().emplace_back();
    } else if (!inside && c == '\n') {
      rows.push_back({""});
    } else {
      rows.back().back() += c;
    }
  }
  EXPECT_FALSE(inside);
  rows.pop_back();  // behind the last end of line
  return rows;
}

std::size_t column(const std::vector<std::vector<std::string>>& table, const std::string& head) {
  const auto& heads = table.front();
  const auto found = std::find(heads.begin(), heads.end(), head);
  EXPECT_NE(found, heads.end()) << head;
  return std::size_t(found - heads.begin());
}

std::size_t lines_with(const std::string& text, const std::string& what) {
  std::size_t found = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1))
    ++found;
  return found;
}

const std::string hostile = "a,b \"c\" | <script> `x` **y**\n# z \\ [l](u) _u_";

/// One arm, one response, inputs without anything else.
Budget bare() {
  Budget b;
  b.study.title = "bare";
  b.study.configurations = {{"", "", ""}};
  b.study.responses = {Response::Pv};
  b.study.inputs.resize(2);
  b.study.inputs[0].name = "first";
  b.study.inputs[1].name = "second";
  ConfigurationBudget arm;
  arm.responses.resize(1);
  arm.responses[0].base = 1e-3;
  b.configurations = {arm};
  return b;
}

TEST(BudgetJson, HasItsKeysAndTellsMicrometres) {
  const Budget b = compute_budget();
  const nlohmann::ordered_json j = to_json(b);
  for (const char* key : {"study", "engine", "seed", "cases", "failed_cases", "inputs",
                          "correlations", "arms", "proofs", "sweeps", "warnings"})
    EXPECT_TRUE(j.contains(key)) << key;
  ASSERT_EQ(j["arms"].size(), 2u);
  const auto& pv = j["arms"][0]["responses"][0];
  for (const char* key :
       {"response", "unit", "base", "root_sum_square", "sum", "worst", "monte_carlo", "limit",
        "within_limit_percent", "cpk", "contributions", "convergence"})
    EXPECT_TRUE(pv.contains(key)) << key;
  EXPECT_EQ(pv["response"], "pv");
  EXPECT_EQ(pv["unit"], "um");
  EXPECT_DOUBLE_EQ(pv["base"].get<double>(), 3.2);
  EXPECT_DOUBLE_EQ(pv["contributions"][0]["high"].get<double>(), 4.0);
  EXPECT_DOUBLE_EQ(pv["within_limit_percent"]["value"].get<double>(), 91.3);
  EXPECT_DOUBLE_EQ(pv["monte_carlo"]["p95"]["high"].get<double>(),
                   in_unit(Response::Pv, b.configurations[0].responses[0].answers->p95.high));
  const auto& area = j["arms"][0]["responses"][2];
  EXPECT_EQ(area["unit"], "%");
  EXPECT_DOUBLE_EQ(area["base"].get<double>(), 96.0);
  EXPECT_DOUBLE_EQ(j["arms"][0]["allocation"]["floor"].get<double>(), 3.2);
  EXPECT_TRUE(j["arms"][1]["allocation"].is_null());
  EXPECT_EQ(j["inputs"].size(), 46u);
  EXPECT_TRUE(j["inputs"][0]["distribution"]["low"].is_null());  // no end
}

TEST(BudgetJson, ComesBackFromItsText) {
  const nlohmann::ordered_json j = to_json(compute_budget());
  EXPECT_EQ(nlohmann::ordered_json::parse(j.dump()), j);
  const nlohmann::ordered_json empty = to_json(bare());
  EXPECT_EQ(nlohmann::ordered_json::parse(empty.dump()), empty);
  EXPECT_TRUE(empty["arms"][0]["map"].is_null());
  EXPECT_TRUE(empty["arms"][0]["responses"][0]["monte_carlo"].is_null());
  EXPECT_TRUE(to_json(Budget{})["arms"].empty());
}

TEST(BudgetJson, WhatIsNotFiniteIsNull) {
  Budget b = bare();
  b.configurations[0].responses[0].base = std::nan("");
  b.configurations[0].responses[0].worst = std::numeric_limits<double>::infinity();
  const nlohmann::ordered_json j = to_json(b);
  EXPECT_TRUE(j["arms"][0]["responses"][0]["base"].is_null());
  EXPECT_TRUE(j["arms"][0]["responses"][0]["worst"].is_null());
}

TEST(BudgetCsv, HasARowForEveryArmResponseAndInputWithUnitsInItsHeads) {
  const auto table = read_csv(to_csv(compute_budget()));
  ASSERT_EQ(table.size(), 1u + 2 * 3 * 46);
  for (const auto& row : table) EXPECT_EQ(row.size(), table.front().size());
  const std::size_t low = column(table, "low_um"), percent = column(table, "low_percent");
  const std::size_t response = column(table, "response");
  for (std::size_t i = 1; i < table.size(); ++i) {
    const bool area = table[i][response] == "in_tolerance";
    EXPECT_EQ(table[i][low].empty(), area);
    EXPECT_EQ(table[i][percent].empty(), !area);
  }
  const std::size_t factor = column(table, "cheapest_factor");
  EXPECT_EQ(table[1][factor], "0.3");
  EXPECT_EQ(table.back()[factor], "");  // the second arm has no allocation
}

TEST(BudgetCsv, NumbersReadBackTheSameBits) {
  Budget b = compute_budget();
  b.configurations[0].responses[0].contributions[3].low = -1.0 / 3.0 * 1e-3;
  b.configurations[0].responses[0].contributions[3].high = 5e-324;
  b.configurations[0].responses[0].contributions[4].high = 1e300;
  const auto table = read_csv(to_csv(b));
  const std::size_t low = column(table, "low_um"), high = column(table, "high_um");
  const std::size_t first = column(table, "sobol_first"), rms = column(table, "map_rms_um");
  for (int i = 0; i < 46; ++i) {
    const Contribution& c = b.configurations[0].responses[0].contributions[std::size_t(i)];
    const auto& row = table[std::size_t(1 + i)];
    EXPECT_EQ(std::stod(row[low]), in_unit(Response::Pv, *c.low)) << i;
    EXPECT_EQ(std::strtod(row[high].c_str(), nullptr), in_unit(Response::Pv, *c.high)) << i;
    EXPECT_EQ(std::stod(row[first]), c.sobol->first.value) << i;
    EXPECT_EQ(std::stod(row[rms]),
              in_unit(Response::Rms, b.configurations[0].maps[std::size_t(i)].rms))
        << i;
  }
}

TEST(BudgetCsv, HostileNamesComeBack) {
  Budget b = compute_budget({.inputs = 2});
  b.study.inputs[1].name = hostile;
  b.configurations[0].arm.name = "";
  b.configurations[1].arm.name = hostile;
  const auto table = read_csv(to_csv(b));
  ASSERT_EQ(table.size(), 1u + 2 * 3 * 2);
  EXPECT_EQ(table[2][column(table, "input")], hostile);
  EXPECT_EQ(table[2][column(table, "arm")], "");
  EXPECT_EQ(table.back()[column(table, "arm")], hostile);
  for (const auto& row : table) EXPECT_EQ(row.size(), table.front().size());
}

TEST(BudgetCsv, OfABareBudgetIsItsHead) {
  EXPECT_EQ(read_csv(to_csv(bare())).size(), 1u);
  EXPECT_EQ(read_csv(to_csv(Budget{})).size(), 1u);
}

TEST(BudgetMarkdown, NamesTheInputsInTheOrderOfWhatTheyContribute) {
  const std::string text = to_markdown(compute_budget());
  EXPECT_EQ(text.find("# gantry dome"), 0u);
  const std::size_t arm = text.find("## uncompensated");
  const std::size_t table = text.find("| input |", arm);
  ASSERT_NE(table, std::string::npos);
  std::size_t at = table;
  for (int i = 0; i < 15; ++i) {
    const std::size_t next = text.find("slide " + std::to_string(i) + " |", at);
    ASSERT_NE(next, std::string::npos) << i;
    ASSERT_LT(next, text.find("## perfect", arm)) << i;
    at = next;
  }
  EXPECT_EQ(text.find("slide 15 |", table), std::string::npos);
  EXPECT_EQ(lines_with(text, "and 31 others"), 2u);
}

TEST(BudgetMarkdown, TablesHaveOneNumberOfColumns) {
  Budget b = compute_budget({.inputs = 20, .configurations = 3});
  b.study.inputs[2].name = b.configurations[1].arm.name = hostile;
  const std::string text = to_markdown(b);
  std::size_t columns = 0, rows = 0;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line.front() != '|') {
      columns = 0;
      continue;
    }
    std::size_t bars = 0;
    for (std::size_t i = 0; i < line.size(); ++i)
      bars += line[i] == '|' && (i == 0 || line[i - 1] != '\\');
    if (columns > 0) {
      EXPECT_EQ(bars, columns) << line;
    }
    columns = bars;
    ++rows;
  }
  EXPECT_GT(rows, 60u);
  EXPECT_EQ(text.find("<script>"), std::string::npos);
  EXPECT_EQ(text.find("\n# z"), std::string::npos);
  EXPECT_EQ(text.find("**y**"), std::string::npos);
}

TEST(BudgetMarkdown, SaysWhatDominatesWhatToSpendOnAndTheFloor) {
  const std::string text = to_markdown(compute_budget());
  EXPECT_HAS(text, "Dominant inputs");
  EXPECT_HAS(text, "Where to spend");
  EXPECT_HAS(text, "Without any spread, with every input at its centre, PV is 3.20 µm");
  EXPECT_HAS(text, "| 0.30 |");  // the tightest factor
  Budget b = compute_budget();
  b.configurations[0].allocation->attainable = false;
  EXPECT_HAS(to_markdown(b), "Not attainable");
}

TEST(BudgetMarkdown, HalvingTheLeaderIsByTheRootSumSquare) {
  // 3 and 4 µm make 5 µm; with 2 instead of 4 they make 3.61 µm
  Budget b = bare();
  b.configurations[0].responses[0].contributions = {{0, 0.0, 3e-3, {}, {}, {}},
                                                    {1, -4e-3, 0.0, {}, {}, {}}};
  const std::string text = to_markdown(b);
  EXPECT_HAS(text,
             "Halving the spread of second would reduce the RSS of PV from 5.00 µm to "
             "3.61 µm");
}

TEST(BudgetMarkdown, OfABareBudgetLeavesOutWhatIsNotThere) {
  const std::string text = to_markdown(bare());
  for (const char* absent : {"P95", "Cpk", "RSS", "Sobol", "worst", "nan", "Where to spend"})
    EXPECT_EQ(text.find(absent), std::string::npos) << absent << "\n" << text;
  EXPECT_HAS(text, "1.00");
  EXPECT_FALSE(to_markdown({}).empty());
}

TEST(BudgetRanking, SharesAddToOneAndTheLargestComesFirst) {
  const Budget b = compute_budget();
  for (const Ranking& r : {ranking(b.configurations[0].responses[0], 46),
                           change_ranking(b.configurations[0].responses[0], 46),
                           map_ranking(b.configurations[0], 46)}) {
    EXPECT_NEAR(r.shares.sum() + r.apart, 1.0, 1e-12);
    EXPECT_GE(r.apart, 0.0);
    EXPECT_EQ(std::set<int>(r.order.begin(), r.order.end()).size(), 46u);
    for (std::size_t k = 1; k < r.order.size(); ++k)
      EXPECT_GE(r.weights[r.order[k - 1]], r.weights[r.order[k]]);
  }
  EXPECT_EQ(ranking(b.configurations[0].responses[0], 46).basis, Ranking::Basis::Sobol);
  EXPECT_EQ(ranking(bare().configurations[0].responses[0], 2).basis, Ranking::Basis::None);
}

TEST(BudgetRanking, NegativeAndMissingFiguresWeighNothing) {
  ResponseBudget r;
  r.contributions = {{0, {}, {}, SobolIndex{{}, {-0.1, 0, 0}}, {}, {}},
                     {1, {}, {}, SobolIndex{{}, {std::nan(""), 0, 0}}, {}, {}},
                     {2, {}, {}, SobolIndex{{}, {0.5, 0, 0}}, {}, {}}};
  const Ranking order = ranking(r, 4);
  EXPECT_EQ(order.order, (std::vector<int>{2, 0, 1, 3}));
  EXPECT_EQ(order.shares, Eigen::Vector4d(0, 0, 0, 0));
  EXPECT_EQ(order.apart, 1.0) << "it acts with others alone";
}

double sum_of(const std::vector<ParetoBar>& bars) {
  double sum = 0.0;
  for (const ParetoBar& bar : bars) sum += bar.share;
  return sum;
}

TEST(BudgetRanking, ParetoBarsAddUpToTheWholeAndInteractionsStandApart) {
  const Budget b = compute_budget();
  const ResponseBudget& response = b.configurations[0].responses[0];
  for (const Ranking& r :
       {ranking(response, 46), change_ranking(response, 46), map_ranking(b.configurations[0], 46)})
    for (const std::size_t most : {0u, 5u, 100u}) {
      const std::vector<ParetoBar> bars = pareto(r, most);
      EXPECT_NEAR(sum_of(bars), 1.0, 1e-12) << share_of(r.basis) << " " << most;
      EXPECT_EQ(bars.back().kind == ParetoBar::Kind::Apart, r.basis == Ranking::Basis::Sobol);
    }
  // two inputs that act alone with 0.3 and 0.2, and half together; totals count that half twice
  ResponseBudget r;
  r.contributions = {{0, {}, {}, SobolIndex{{0.2, 0, 0}, {0.7, 0, 0}}, {}, {}},
                     {1, {}, {}, SobolIndex{{0.3, 0, 0}, {0.8, 0, 0}}, {}, {}}};
  const std::vector<ParetoBar> bars = pareto(ranking(r, 2), 5);
  ASSERT_EQ(bars.size(), 3u);
  EXPECT_EQ(bars[0].input, 1);
  EXPECT_NEAR(bars[2].share, 0.5, 1e-12);
  // estimates that add up to more than the whole are scaled
  r.contributions[0].sobol->first.value = 0.9;
  EXPECT_NEAR(sum_of(pareto(ranking(r, 2), 5)), 1.0, 1e-12);
}

/// A response of which random machines alone are known.
ResponseBudget drawn(const std::vector<double>& effects, double correlation) {
  ResponseBudget r;
  r.values = VectorXd::LinSpaced(1000, 5e-3, 15e-3);
  r.answers = answers(r.values);
  for (std::size_t i = 0; i < effects.size(); ++i)
    r.contributions.push_back({int(i), {}, {}, {}, correlation, correlation, effects[i]});
  return r;
}

Budget budget_of_drawn(const std::vector<double>& effects, double correlation) {
  Budget b = compute_budget({.inputs = int(effects.size()), .configurations = 1, .prefix = "E"});
  b.study.responses.resize(1);
  b.configurations[0].responses = {drawn(effects, correlation)};
  b.configurations[0].allocation.reset();
  return b;
}

TEST(BudgetRanking, AWeakCorrelationIsNobodysAndAnEvenResponseIsItsInputs) {
  // beyond chance, and yet nothing: 0.6 % of the variance
  const Ranking weak = ranking(drawn({0.0, 0.006, 0.0}, -0.08), 3);
  EXPECT_EQ(weak.basis, Ranking::Basis::MainEffect);
  EXPECT_EQ(weak.shares.sum(), 0.0);
  EXPECT_EQ(weak.apart, 1.0);
  EXPECT_TRUE(dominant_inputs(weak).empty());
  // even in its inputs: no correlation, all of the variance
  const Ranking even = ranking(drawn({0.2, 0.75, 0.0}, 0.0), 3);
  EXPECT_EQ(dominant_inputs(even), (std::vector<int>{1, 0}));
  EXPECT_NEAR(even.apart, 0.05, 1e-12);
  // a large share of what inputs make alone is none of the whole
  EXPECT_TRUE(dominant_inputs(ranking(drawn({0.05, 0.04, 0.03}, 0.2), 3)).empty());
}

TEST(BudgetRanking, ChangesBelowTheNumericalFloorAreNobodys) {
  ResponseBudget r;
  r.contributions = {{0, 1e-9, -2e-9, {}, {}, {}}, {1, 0.0, 1e-12, {}, {}, {}}};
  EXPECT_EQ(change_ranking(r, 2).shares.sum(), 0.0);
  EXPECT_TRUE(dominant_inputs(change_ranking(r, 2)).empty());
}

TEST(BudgetHeadline, SaysThatNoInputDominatesOrWhichDo) {
  Budget none = budget_of_drawn({0.0, 0.006, 0.0}, -0.08);
  none.configurations[0].maps = {{1e-3, 3e-3, 0.4}, {0.65e-6, 2e-6, 0.2}, {1e-3, 3e-3, 0.4}};
  for (const std::string& text : {to_markdown(none), to_text(none)}) {
    EXPECT_HAS(text, "no input dominates: no single contribution is statistically significant");
    EXPECT_EQ(text.find("100 %"), std::string::npos) << text;
    EXPECT_HAS(text, "the map is mostly ");
  }
  const std::string some = to_text(budget_of_drawn({0.05, 0.1, 0.02}, 0.1));
  EXPECT_HAS(some,
             "no input dominates: the largest are E1 10 %, E0 5.0 %, E2 2.0 %, not due "
             "to a single input 83 %");
  const std::string two = to_text(budget_of_drawn({0.2, 0.75, 0.0}, 0.0));
  EXPECT_HAS(two, "; mostly E1 75 %, E0 20 %, not due to a single input 5.0 %");
  EXPECT_HAS(to_markdown(budget_of_drawn({0.2, 0.75, 0.0}, 0.0)),
             "mostly **E1** 75 %, **E0** 20 %");
}

TEST(BudgetText, OfATerminalHasNoMarkUpAndItsColumnsStandBelowEachOther) {
  const std::string text = to_text(compute_budget({.inputs = 20, .configurations = 2}));
  for (const char* mark : {"**", "|", "##", "---:"})
    EXPECT_EQ(text.find(mark), std::string::npos) << mark;
  std::istringstream lines(text);
  std::size_t tables = 0;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("---") || line.find("  ---") == std::string::npos) continue;
    ++tables;
    for (std::string row; std::getline(lines, row) && !row.empty();)
      EXPECT_LE(terminal_width(row), terminal_width(line)) << row;
  }
  EXPECT_GE(tables, 4u);
  EXPECT_HAS(to_markdown(compute_budget()), "| input |") << "the file has Markdown";
}

TEST(BudgetUnits, EveryFigureSaysItsUnit) {
  Budget b = compute_budget({.inputs = 3, .configurations = 1});  // um, urad, and a pure number
  const auto json = to_json(b);
  EXPECT_EQ(json["inputs"][2]["unit"], "1");
  b.study.inputs[2].element = "EXX";
  EXPECT_HAS(to_markdown(b), "| × EXX |") << "a factor names what it counts";
  for (const auto& response : json["arms"][0]["responses"])
    EXPECT_FALSE(response["unit"].get<std::string>().empty());
  const auto table = read_csv(to_csv(b));
  for (std::size_t i = 1; i < table.size(); ++i)
    EXPECT_FALSE(table[i][column(table, "input_unit")].empty());
  b.study.sweeps = {{0, Vector2d(0, 1)}};
  b.sweeps = {{0, {{Vector2d(1e-3, 2e-3), Vector2d(1e-3, 2e-3), Vector2d(90, 91)}}}};
  EXPECT_EQ(to_json(b)["sweeps"][0]["units"]["pv"], "um");
  EXPECT_EQ(to_json(b)["sweeps"][0]["units"]["in_tolerance"], "%");
  const Plan plan = make_plan(b.study);
  EXPECT_HAS(cases_csv(b.study, plan, {}), "slide 2 / 1,");
}

TEST(PictureNames, AreSafeAndNeverTheSame) {
  EXPECT_EQ(file_name_part("3 h perfect-iterated-ideal"), "3-h-perfect-iterated-ideal");
  EXPECT_EQ(file_name_part("../../etc/passwd"), "etc-passwd");
  EXPECT_EQ(file_name_part("EXX[1] µm"), "EXX-1-m");
  EXPECT_EQ(file_name_part(""), "unnamed");
  EXPECT_EQ(file_name_part("..."), "unnamed");
  EXPECT_EQ(file_name_part(std::string("a\0b", 3)), "a-b");
  EXPECT_LE(file_name_part(std::string(5000, 'x')).size(), 80u);
  PictureNames names;
  EXPECT_EQ(names.unique_name({"pareto", "a b"}), "pareto-a-b");
  EXPECT_EQ(names.unique_name({"pareto", "a-b"}), "pareto-a-b-2");
  EXPECT_EQ(names.unique_name({"pareto", "A B"}), "pareto-A-B-3");
}

TEST(Words, LongNamesLoseTheirMiddle) {
  EXPECT_EQ(shortened_line("EXX[1]", 6), "EXX[1]");
  EXPECT_EQ(shortened_line("abcdefgh", 5), "ab…gh");
  EXPECT_EQ(shortened_line("µµµµµµ", 3), "µ…µ");
  EXPECT_EQ(shortened_line("", 3), "");
  EXPECT_EQ(one_line("a\r\n\tb"), "a b");
}

#if ABBE_RENDER

class BudgetPictures : public testing::Test {
 protected:
  BudgetPictures()
      : folder_(fs::temp_directory_path() / ("abbe-budget-" + std::to_string(::getpid()))) {}
  ~BudgetPictures() override { fs::remove_all(folder_); }

  std::set<std::string> written(const Budget& budget) {
    fs::remove_all(folder_);
    write_pictures(ResultFolder(folder_, {}), budget);
    std::set<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(folder_))
      if (entry.path().filename() != manifest_name) names.insert(entry.path().filename().string());
    return names;
  }

  /// Bytes 20 to 23 of any PNG, the most significant first.
  static int png_height(const fs::path& file) {
    const std::string head = read_text(file, std::size_t(1) << 24).substr(20, 4);
    int height = 0;
    for (const unsigned char byte : head) height = 256 * height + byte;
    return height;
  }

  fs::path folder_;
};

TEST_F(BudgetPictures, AreThoseThatTheBudgetHas) {
  Budget b = compute_budget({.inputs = 3, .configurations = 2, .prefix = "EXX "});
  for (ConfigurationBudget& arm : b.configurations) arm.responses.resize(1);
  b.study.responses.resize(1);
  b.sweeps[0].answers = {{b.sweeps[0].answers[0][0]}, {b.sweeps[0].answers[1][0]}};
  EXPECT_EQ(written(b),
            (std::set<std::string>{
                "pareto-uncompensated.png", "pareto-perfect-iterated-ideal.png",
                "tornado-uncompensated-pv.png", "tornado-perfect-iterated-ideal-pv.png",
                "indices-uncompensated-pv.png", "indices-perfect-iterated-ideal-pv.png",
                "correlation-uncompensated.png", "correlation-perfect-iterated-ideal.png",
                "distribution-pv.png", "sweep-EXX-0.png"}));
  EXPECT_TRUE(written(bare()).empty());
  EXPECT_TRUE(written({}).empty());
}

TEST_F(BudgetPictures, OfAwkwardBudgetsAreDrawn) {
  Budget b = compute_budget({.inputs = 2, .configurations = 1, .prefix = hostile});
  ResponseBudget& r = b.configurations[0].responses[0];
  b.configurations[0].responses.resize(1);
  b.study.responses.resize(1);
  b.sweeps.clear();
  b.configurations[0].arm.name = "../" + std::string(300, '/');
  r.values.setConstant(std::nan(""));
  r.contributions[0].low = std::nan("");
  r.contributions[1].high = {};
  r.contributions[1].sobol = {};
  r.base = std::numeric_limits<double>::infinity();
  b.configurations[0].maps[0] = {0.0, 0.0, 0.0};
  b.configurations[0].maps[1] = {std::nan(""), 0.0, std::nan("")};
  const std::set<std::string> names = written(b);
  for (const std::string& name : names) std::cout << name << "\n";
  EXPECT_TRUE(names.count("tornado-unnamed-pv.png"));
}

TEST_F(BudgetPictures, OfCorrelationsLeaveOutWhatChanceMayGive) {
  Budget b = compute_budget({.inputs = 46, .configurations = 1, .map = false});
  b.sweeps.clear();  // no other picture
  for (ResponseBudget& r : b.configurations[0].responses) {
    r.index_convergence.reset();
    r.values.resize(0);
    for (Contribution& c : r.contributions) {
      c.low = c.high = {};
      c.sobol = {};
    }
  }
  const double chance = 4.0 / std::sqrt(double(b.configurations[0].responses[0].answers->cases));
  const auto correlated = [&](int inputs) {
    for (ResponseBudget& r : b.configurations[0].responses)
      for (Contribution& c : r.contributions) {
        c.correlation = (c.input < inputs ? 1.01 : -0.99) * chance;
        c.rank_correlation = 0.99 * chance;
      }
    return written(b).count("correlation-uncompensated.png") > 0;
  };
  const auto height = [&] { return png_height(folder_ / "correlation-uncompensated.png"); };
  EXPECT_FALSE(correlated(0));
  ASSERT_TRUE(correlated(2));
  const int of_two = height();
  ASSERT_TRUE(correlated(12));
  const int of_twelve = height();
  ASSERT_TRUE(correlated(46));
  std::cout << "2 rows " << of_two << " px, 12 rows " << of_twelve << " px, 25 of 46 rows "
            << height() << " px\n";
  // the pixels of a row; a picture is as high as four rows at least
  EXPECT_EQ(of_twelve - of_two, 8 * 36);
  EXPECT_EQ(height() - of_two, 21 * 36);
}

TEST_F(BudgetPictures, ThatCannotBeWrittenAreAnOutputFailure) {
  EXPECT_THROW(write_pictures(ResultFolder("/dev/null/pictures", {}),
                              compute_budget({.inputs = 1, .configurations = 1})),
               OutputFailure);
}

#endif

TEST(StudyPage, OfManyMachinesShowsEveryNthByRank) {
  Budget budget = compute_budget({.inputs = 3, .configurations = 1});
  budget.configurations[0].responses[0].values = VectorXd::LinSpaced(50001, 1e-3, 0.0);
  const FiguresPage page = study_page(budget, {}, {});
  EXPECT_FALSE(page_html(page).empty());
  for (const nlohmann::ordered_json& block : page.blocks) {
    if (block.at("id") != "distribution-pv") continue;
    const std::vector<double> values = block.at("series")[0].at("values");
    EXPECT_EQ(values.size(), 20000u);
    EXPECT_EQ(std::pair(values.front(), values.back()), std::pair(0.0, 1.0));
  }
  EXPECT_HAS(page.warnings.back(), "of 50001 random machines of uncompensated, PV, the report");
}

}  // namespace
}  // namespace abbe::sim::study
