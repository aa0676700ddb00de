// The page of `abbe report`: what is packed unpacks to within half a step, no label is missing, and
// the page asks nothing of a network.

#include <regex>
#include "sim/compensation/time_series.h"
#include "sim/report/case_page.h"
#include "sim/report/page_data.h"
#include "sim/report/page_template.h"
#include "tests/report/unpack.h"
#include "tests/safety/program_run.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

double largest_error(const PackedColumns& packed, const MatrixXd& values) {
  const Eigen::MatrixXi numbers = unpack::numbers(packed);
  double largest = 0.0;
  for (Index c = 0; c < values.cols(); ++c)
    for (Index r = 0; r < values.rows(); ++r) {
      const bool is_missing = numbers(r, c) == missing;
      EXPECT_EQ(is_missing, std::isnan(values(r, c))) << r << " " << c;
      if (is_missing) continue;
      const double back =
          packed.offset[std::size_t(c)] + packed.step[std::size_t(c)] * numbers(r, c);
      largest = std::max(largest, std::abs(back - values(r, c)));
    }
  return largest;
}

MatrixXd some_values(double size) {
  std::mt19937 rng(19);
  std::uniform_real_distribution<double> uniform(-size, 1.5 * size);
  MatrixXd values(5000, 3);
  for (double& value : values.reshaped()) value = uniform(rng);
  values(0, 0) = values(17, 1) = values(4999, 2) = nan;
  return values;
}

TEST(PackedColumns, ValuesUnpackToWithinHalfAStep) {
  const MatrixXd values = some_values(30.0);
  const double rounding = 1e-12;
  for (const double step : {step_for_16_bits(values), 1e-6, 0.3}) {
    const PackedColumns packed = pack_values(values, step);
    EXPECT_LE(largest_error(packed, values), step / 2.0 + rounding);
    EXPECT_GT(largest_error(packed, values), 0.4 * step) << "not quantised at all";
  }
}

TEST(PackedColumns, ValuesThatAreAllOneOrNoneUnpackExactly) {
  const VectorXd same = VectorXd::Constant(7, 1.25);
  EXPECT_EQ(largest_error(pack_values(same, step_for_16_bits(same)), same), 0.0);
  const VectorXd none = VectorXd::Constant(7, nan);
  EXPECT_EQ(largest_error(pack_values(none, 1.0), none), 0.0);
}

TEST(PackedColumns, WhatCannotBePackedIsRefused) {
  const Vector2d far(0.0, 1e6), infinite(0.0, std::numeric_limits<double>::infinity());
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

using cutting::Triangles;

Triangles grid(int side) {
  Triangles triangles(2 * (side - 1) * (side - 1), 3);
  Index row = 0;
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

void expect_comes_back(const Triangles& triangles, const Eigen::MatrixX3d& vertices) {
  const std::vector<Index> order = morton_order(vertices);
  std::vector<Index> sorted = order;
  std::ranges::sort(sorted);
  ASSERT_EQ(Index(sorted.size()), vertices.rows());
  for (std::size_t v = 0; v < sorted.size(); ++v) ASSERT_EQ(sorted[v], Index(v));
  const Eigen::MatrixXi packed = unpack::numbers(pack_numbers(sorted_triangles(triangles, order)));
  std::vector<std::array<int, 3>> expected, unpacked;
  for (const auto& t : triangles.rowwise()) expected.push_back({t[0], t[1], t[2]});
  for (const auto& t : packed.rowwise())
    unpacked.push_back({int(order[std::size_t(t[0])]), int(order[std::size_t(t[1])]),
                        int(order[std::size_t(t[2])])});
  EXPECT_EQ(ordered(unpacked), ordered(expected));
}

Eigen::MatrixX3d random_vertices(Index count) {
  std::mt19937 rng(13);
  std::uniform_real_distribution<double> uniform(-40.0, 70.0);
  Eigen::MatrixX3d vertices(count, 3);
  for (double& coordinate : vertices.reshaped()) coordinate = uniform(rng);
  return vertices;
}

TEST(PageMesh, TrianglesOfAnyMeshComeBack) {
  std::mt19937 rng(7);
  for (const int vertices : {1, 3, 5, 10, 60, 500})  // few: edges of many triangles, equal corners
    for (const int triangles : {0, 1, 4, 60, 900}) {
      SCOPED_TRACE(testing::Message() << vertices << " vertices, " << triangles << " triangles");
      Triangles soup(triangles, 3);
      for (int& corner : soup.reshaped()) corner = int(rng() % unsigned(vertices));
      expect_comes_back(soup, random_vertices(vertices));
    }
}

TEST(PageMesh, VerticesAtOnePointOrOnALineKeepTheirOrder) {
  const Triangles triangles = grid(4);
  Eigen::MatrixX3d vertices = Eigen::MatrixX3d::Constant(16, 3, -2.5);
  expect_comes_back(triangles, vertices);
  std::vector<Index> order(16);
  std::iota(order.begin(), order.end(), Index(0));
  EXPECT_EQ(morton_order(vertices), order);
  vertices.col(1).setLinSpaced(16, -3.0, 5.0);
  expect_comes_back(triangles, vertices);
  EXPECT_EQ(morton_order(vertices), order);
}

TEST(PageMesh, AMeshInAnyOrderTakesFewBytesATriangle) {
  const int side = 200;
  std::mt19937 rng(11);
  std::vector<int> number(std::size_t(side * side));
  std::iota(number.begin(), number.end(), 0);
  std::ranges::shuffle(number, rng);
  Eigen::MatrixX3d vertices(side * side, 3);
  for (int v = 0; v < side * side; ++v)
    vertices.row(number[std::size_t(v)]) << v % side, int(v / side), 0.0;
  Triangles triangles = grid(side);
  for (int& corner : triangles.reshaped()) corner = number[std::size_t(corner)];
  const std::size_t bytes =
      pack_numbers(sorted_triangles(triangles, morton_order(vertices))).text.size();
  const double bytes_a_triangle = double(bytes) / double(triangles.rows());
  std::cout << bytes_a_triangle << " bytes a triangle in base64\n";
  EXPECT_LT(bytes_a_triangle, 3.0);
}

/// Values over a grid, with a hole.
Eigen::VectorXi wave(int side, double phase) {
  Eigen::VectorXi numbers(side * side);
  for (Index k = 0; k < numbers.size(); ++k) {
    const auto x = double(k % side), y = double(k / side);
    numbers[k] = std::hypot(x - 20.0, y - 30.0) < 5.0
                     ? missing
                     : int(3000.0 * std::sin(0.3 * x + phase) * std::cos(0.2 * y));
  }
  return numbers;
}

TEST(PackedColumns, NumbersUnpackExactlyAndTakeLessBesideALikeColumn) {
  const int side = 60;
  const Eigen::VectorXi first = wave(side, 0.0);
  Eigen::VectorXi second = wave(side, 0.02), unlike = first.reverse();
  second[7] = missing;
  const PackedColumns alone = pack_numbers(second);
  EXPECT_EQ(unpack::numbers(alone), second);
  const PackedColumns beside = pack_numbers(second, {&unlike, &first});
  ASSERT_EQ(beside.reference, 1);
  EXPECT_EQ(unpack::numbers(beside, &first), second);
  EXPECT_LT(double(beside.text.size()), 0.8 * double(alone.text.size()));
  EXPECT_EQ(pack_numbers(second, {&unlike}).reference, -1) << "it saves nothing";
}

TEST(PackedColumns, TheLargestNumbersUnpackBesideTheirOpposites) {
  Eigen::VectorXi numbers(4);
  numbers << max_packed, -max_packed, missing, max_packed;
  const Eigen::VectorXi reference = -numbers.cwiseMax(-max_packed);
  PackedColumns packed = pack_numbers(numbers, {&reference});
  EXPECT_EQ(unpack::numbers(packed, packed.reference < 0 ? nullptr : &reference), numbers);
}

TEST(PackedColumns, Base64IsThatOfTheRfc) {  // RFC 4648, section 10
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
}

TEST(DecimatedMesh, LinesBetweenTheKeptComeWithinTheToleranceOfTheRest) {
  VectorXd time(2000);
  MatrixXd q(2000, 2);
  for (Index k = 0; k < time.size(); ++k) {
    time[k] = 0.01 * double(k - (k > 700 ? 1 : 0));  // one instant stands twice
    q.row(k) << 50.0 * std::sin(time[k]), k < 1200 ? 3.0 * time[k] : -time[k];
  }
  const double tolerance = 0.05;
  const compensation::TimeSeries few =
      compensation::thin_out({time, q}, VectorXd::Constant(2, tolerance));
  std::vector<Index> kept;
  for (Index k = 0, next = 0; k < time.size() && next < few.time_s.size(); ++k)
    if (time[k] == few.time_s[next] && q.row(k) == few.value.row(next)) {
      kept.push_back(k);
      ++next;
    }
  ASSERT_EQ(kept.size(), std::size_t(few.time_s.size()));
  EXPECT_LT(kept.size(), 500u);
  EXPECT_EQ(kept.front(), 0);
  EXPECT_EQ(kept.back(), 1999);
  for (std::size_t i = 1; i < kept.size(); ++i) {
    const Index a = kept[i - 1], b = kept[i];
    for (Index k = a + 1; k < b; ++k) {
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
  EXPECT_HAS(html, "content=\"default-src 'none';");
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
  EXPECT_HAS(exceeded_limits.text, "the scene allows 0.0010 um");
}

TEST_F(Page, AFolderOfResultsIsRefusedByName) {
  const safety::Ran refused = safety::run("report " + folder.string());
  EXPECT_EQ(refused.code, 2);
  EXPECT_HAS(refused.text, "identify or evaluate, seen the folder");
}

}  // namespace
}  // namespace abbe::sim
