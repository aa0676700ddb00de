// The page of `abbe report`: what is packed unpacks to within half a step, no label is missing, and
// the page asks nothing of a network.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/compensation/time_series.h"
#include "sim/report/case_page.h"
#include "sim/report/page_data.h"
#include "sim/report/page_template.h"
#include "tests/report/unpack.h"
#include "tests/safety/program_run.h"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

double largest_error(const PackedColumns& packed, const Eigen::MatrixXd& values) {
  const Eigen::MatrixXi numbers = unpack::numbers(packed);
  double largest = 0.0;
  for (Eigen::Index c = 0; c < values.cols(); ++c)
    for (Eigen::Index r = 0; r < values.rows(); ++r) {
      const bool is_missing = numbers(r, c) == missing;
      EXPECT_EQ(is_missing, std::isnan(values(r, c))) << r << " " << c;
      if (is_missing) continue;
      const double back =
          packed.offset[std::size_t(c)] + packed.step[std::size_t(c)] * numbers(r, c);
      largest = std::max(largest, std::abs(back - values(r, c)));
    }
  return largest;
}

Eigen::MatrixXd some_values(double size) {
  std::mt19937 rng(19);
  std::uniform_real_distribution<double> uniform(-size, 1.5 * size);
  Eigen::MatrixXd values(5000, 3);
  for (double& value : values.reshaped()) value = uniform(rng);
  values(0, 0) = values(17, 1) = values(4999, 2) = nan;
  return values;
}

TEST(PackedColumns, ValuesUnpackToWithinHalfAStep) {
  const Eigen::MatrixXd values = some_values(30.0);
  const double rounding = 1e-12;
  for (const double step : {step_for_16_bits(values), 1e-6, 0.3}) {
    const PackedColumns packed = pack_values(values, step);
    EXPECT_LE(largest_error(packed, values), step / 2.0 + rounding);
    EXPECT_GT(largest_error(packed, values), 0.4 * step) << "not quantised at all";
  }
}

TEST(PackedColumns, ValuesThatAreAllOneOrNoneUnpackExactly) {
  const Eigen::VectorXd same = Eigen::VectorXd::Constant(7, 1.25);
  EXPECT_EQ(largest_error(pack_values(same, step_for_16_bits(same)), same), 0.0);
  const Eigen::VectorXd none = Eigen::VectorXd::Constant(7, nan);
  EXPECT_EQ(largest_error(pack_values(none, 1.0), none), 0.0);
}

TEST(PackedColumns, WhatCannotBePackedIsRefused) {
  const Eigen::Vector2d far(0.0, 1e6), infinite(0.0, std::numeric_limits<double>::infinity());
  EXPECT_THROW(pack_values(far, 0.0), std::invalid_argument);
  EXPECT_THROW(pack_values(far, nan), std::invalid_argument);
  EXPECT_THROW(pack_values(far, 1e-5), std::invalid_argument);
  EXPECT_THROW(pack_values(infinite, 1.0), std::invalid_argument);
  EXPECT_THROW(pack_numbers(Eigen::Vector2i(3, max_packed + 1)), std::invalid_argument);
}

TEST(PackedColumns, WholeNumbersUnpackExactly) {
  Eigen::MatrixXi numbers(6, 2);
  numbers << 5, 0, max_packed, 3, -max_packed, 70000, max_packed, -1, missing, missing, 0, -12;
  EXPECT_EQ(unpack::numbers(pack_numbers(numbers)), numbers);
}

// --- meshes

using Corners = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;

Corners grid(int side) {
  Corners triangles(2 * (side - 1) * (side - 1), 3);
  Eigen::Index row = 0;
  for (int y = 0; y + 1 < side; ++y)
    for (int x = 0; x + 1 < side; ++x) {
      const int a = y * side + x;
      triangles.row(row++) << a, a + 1, a + side;
      triangles.row(row++) << a + 1, a + side + 1, a + side;
    }
  return triangles;
}

/// Every triangle from the least of its turns, in order.
std::vector<std::array<int, 3>> ordered(std::vector<std::array<int, 3>> all) {
  for (std::array<int, 3>& one : all) {
    const auto [a, b, c] = one;
    one = std::min({one, std::array{b, c, a}, std::array{c, a, b}});
  }
  std::ranges::sort(all);
  return all;
}

void expect_comes_back(const Corners& triangles, Eigen::Index vertices) {
  const MeshWalk walk = mesh_walk(triangles, vertices);
  std::vector<int> number(std::size_t(vertices), -1);
  ASSERT_EQ(walk.order.size(), number.size());
  for (std::size_t k = 0; k < walk.order.size(); ++k) number[std::size_t(walk.order[k])] = int(k);
  EXPECT_EQ(std::ranges::count(number, -1), 0) << "not every vertex stands in the order";
  for (std::size_t k = 1; k < walk.known.size(); ++k)
    for (const int one : walk.known[k]) ASSERT_LT(std::size_t(one), k);
  std::vector<std::array<int, 3>> wanted;
  for (const auto& t : triangles.rowwise())
    wanted.push_back(
        {number[std::size_t(t[0])], number[std::size_t(t[1])], number[std::size_t(t[2])]});
  EXPECT_EQ(ordered(unpack::Mesh(walk.code, wanted.size()).all), ordered(wanted));
}

TEST(MeshWalk, TrianglesOfAnyMeshComeBack) {
  std::mt19937 rng(7);
  for (const int vertices : {1, 3, 5, 10, 60, 500})  // few: edges of many triangles, equal corners
    for (const int triangles : {0, 1, 4, 60, 900}) {
      SCOPED_TRACE(testing::Message() << vertices << " vertices, " << triangles << " triangles");
      Corners soup(triangles, 3);
      for (int& corner : soup.reshaped()) corner = int(rng() % unsigned(vertices));
      expect_comes_back(soup, vertices);
    }
}

TEST(MeshWalk, TrianglesOfAMeshWithHolesComeBackInAnyOrder) {
  std::mt19937 rng(11);
  const Corners whole = grid(40);
  std::vector<Eigen::Index> kept;
  for (Eigen::Index t = 0; t < whole.rows(); ++t)
    if (rng() % 8 > 0) kept.push_back(t);
  std::ranges::shuffle(kept, rng);
  expect_comes_back(whole(kept, Eigen::all), 1600);
}

TEST(MeshWalk, AGridTakesNextToNothing) {
  const int side = 200;
  const MeshWalk walk = mesh_walk(grid(side), side * side);
  EXPECT_LT(walk.code.size(), 1000u) << "of " << 2 * (side - 1) * (side - 1) << " triangles";
}

/// Values over a grid of a walk, with a hole.
Eigen::VectorXi wave(const MeshWalk& walk, int side, double phase) {
  Eigen::VectorXi numbers(side * side);
  for (Eigen::Index k = 0; k < numbers.size(); ++k) {
    const auto x = double(walk.order[std::size_t(k)] % side),
               y = double(walk.order[std::size_t(k)] / side);
    numbers[k] = std::hypot(x - 20.0, y - 30.0) < 5.0
                     ? missing
                     : int(3000.0 * std::sin(0.3 * x + phase) * std::cos(0.2 * y));
  }
  return numbers;
}

TEST(PackedColumns, NumbersOnAMeshUnpackExactlyAndTakeLessBesideALikeColumn) {
  const int side = 60;
  const MeshWalk walk = mesh_walk(grid(side), side * side);
  const Eigen::VectorXi first = wave(walk, side, 0.0), second = wave(walk, side, 0.02);
  const PackedColumns alone = pack_numbers(first, {&walk, {}});
  EXPECT_EQ(unpack::numbers(alone, &walk), first);
  const Eigen::VectorXi reference = alone.numbers.col(0);
  EXPECT_EQ((reference.array() == missing).count(), 0);
  const PackedColumns beside = pack_numbers(second, {&walk, {&reference}});
  ASSERT_EQ(beside.reference, 0);
  EXPECT_EQ(unpack::numbers(beside, &walk, &reference), second);
  EXPECT_LT(double(beside.text.size()),
            0.8 * double(pack_numbers(second, {&walk, {}}).text.size()));
}

TEST(PackedColumns, Base64IsThatOfTheRfc) {  // RFC 4648, section 10
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
}

TEST(DecimatedMesh, LinesBetweenTheKeptComeWithinTheToleranceOfTheRest) {
  Eigen::VectorXd time(2000);
  Eigen::MatrixXd q(2000, 2);
  for (Eigen::Index k = 0; k < time.size(); ++k) {
    time[k] = 0.01 * double(k - (k > 700 ? 1 : 0));  // one instant stands twice
    q.row(k) << 50.0 * std::sin(time[k]), k < 1200 ? 3.0 * time[k] : -time[k];
  }
  const double tolerance = 0.05;
  const compensation::TimeSeries few =
      compensation::thinned({time, q}, Eigen::VectorXd::Constant(2, tolerance));
  std::vector<Eigen::Index> kept;
  for (Eigen::Index k = 0, next = 0; k < time.size() && next < few.time_s.size(); ++k)
    if (time[k] == few.time_s[next] && q.row(k) == few.value.row(next)) {
      kept.push_back(k);
      ++next;
    }
  ASSERT_EQ(kept.size(), std::size_t(few.time_s.size()));
  EXPECT_LT(kept.size(), 500u);
  EXPECT_EQ(kept.front(), 0);
  EXPECT_EQ(kept.back(), 1999);
  for (std::size_t i = 1; i < kept.size(); ++i) {
    const Eigen::Index a = kept[i - 1], b = kept[i];
    for (Eigen::Index k = a + 1; k < b; ++k) {
      const double share = (time[k] - time[a]) / (time[b] - time[a]);
      const Eigen::RowVectorXd between = q.row(a) + share * (q.row(b) - q.row(a));
      EXPECT_LE((q.row(k) - between).cwiseAbs().maxCoeff(), tolerance * (1.0 + 1e-9)) << k;
    }
  }
}

// --- labels

std::set<std::string> found(const std::string& text, const std::regex& pattern) {
  std::set<std::string> keys;
  for (std::sregex_iterator it(text.begin(), text.end(), pattern), end; it != end; ++it)
    keys.insert((*it)[1]);
  return keys;
}

TEST(ReportLabels, EveryOneHasBothLanguagesAndStandsOnce) {
  std::set<std::string_view> keys;
  for (const auto& labels : {report_labels(), chart_labels()})
    for (const ReportLabel& one : labels) {
      EXPECT_FALSE(one.en.empty()) << one.key;
      EXPECT_FALSE(one.zh.empty()) << one.key;
      EXPECT_TRUE(keys.insert(one.key).second) << one.key << " stands twice";
    }
}

TEST(ReportLabels, WhatThePageAndItsScriptNameIsThere) {
  std::set<std::string> keys;
  for (const ReportLabel& one : report_labels()) keys.insert(std::string(one.key));
  const std::set<std::string> in_page =
      found(std::string(viewer_page()), std::regex("data-(?:label|aria)=\"(\\w+)\""));
  const std::set<std::string> in_script =
      found(viewer_script(), std::regex("\\bL\\(\"(\\w+)\"\\)"));
  EXPECT_GT(in_page.size(), 20u);
  EXPECT_GT(in_script.size(), 10u);
  for (const std::set<std::string>& named : {in_page, in_script})
    for (const std::string& key : named) EXPECT_TRUE(keys.count(key)) << key;
}

// --- the page of a scene

struct Page : testing::Test {
  static void SetUpTestSuite() {
    folder = fs::temp_directory_path() / ("abbe_report_test_" + std::to_string(::getpid()));
    fs::create_directories(folder);
    scene = ABBE_SOURCE_DIR "/scenes/gantry_dome.toml --set part.vertices=300";
    // the 45 000 points of its passes take most of the time of a page of 300 vertices
    if (std::getenv("ABBE_LONG") == nullptr)
      scene += " --set program.step_over_mm=1 --set program.step_mm=2";
    ran = safety::run("report " + scene + " -o " + (folder / "page.html").string());
    std::ifstream in(folder / "page.html", std::ios::binary);
    html.assign(std::istreambuf_iterator<char>(in), {});
  }
  static void TearDownTestSuite() { fs::remove_all(folder); }
  static inline fs::path folder;
  static inline std::string scene;  ///< and its overrides
  static inline safety::Ran ran;
  static inline std::string html;
};

TEST_F(Page, IsWholeAndMayAskNothingOfANetwork) {
  ASSERT_EQ(ran.code, 0);
  EXPECT_NE(html.find("content=\"default-src 'none';"), std::string::npos);
  EXPECT_EQ(html.find("connect-src"), std::string::npos);
  const std::regex resource(R"rx((?:src|href|url)\s*[=(]\s*["']?(?:https?:)?//)rx");
  const std::string sources =
      std::string(viewer_page()) + std::string(viewer_style()) + viewer_script();
  EXPECT_FALSE(std::regex_search(sources, resource));
  EXPECT_EQ(sources.find("http://"), std::string::npos);
  EXPECT_EQ(sources.find("https://"), std::string::npos);
  const std::size_t script = html.find("DOMContentLoaded"), data = html.find("id=\"a:position\"");
  ASSERT_NE(data, std::string::npos);
  EXPECT_LT(script, data) << "a page that is cut off could not say so";
  EXPECT_GT(html.find("id=\"end\" hidden"), data);
}

TEST_F(Page, NamesOnlyLabelsThatThereAre) {
  std::set<std::string> keys;
  for (const ReportLabel& one : report_labels()) keys.insert(std::string(one.key));
  const std::size_t table = html.find("id=\"figures\""), end = html.find("id=\"labels\"");
  ASSERT_LT(table, end);
  const std::set<std::string> named =
      found(html.substr(table, end - table), std::regex("data-label=\"(\\w+)\""));
  EXPECT_GT(named.size(), 10u);
  for (const std::string& key : named) EXPECT_TRUE(keys.count(key)) << key;
}

TEST_F(Page, ALimitOfAcceptanceThatIsExceededGivesTheExitCodeOfCompare) {
  const safety::Ran exceeded_limits = safety::run(
      "report " + scene + " --set limits.pv_um=0.001 -o " + (folder / "limit.html").string());
  EXPECT_EQ(ran.code, 0) << "of the same without a limit";
  EXPECT_EQ(exceeded_limits.code, 1);
  EXPECT_NE(exceeded_limits.text.find("the scene allows 0.0010 um"), std::string::npos)
      << exceeded_limits.text;
}

TEST_F(Page, AFolderOfResultsIsRefusedByName) {
  const safety::Ran refused = safety::run("report " + folder.string());
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.text.find("left, seen the folder"), std::string::npos) << refused.text;
}

}  // namespace
}  // namespace abbe::sim
