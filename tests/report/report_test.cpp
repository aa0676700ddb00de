// The page of `abbe report`: what is packed unpacks to within half a step, no label is missing, and
// the page asks nothing of a network.

#include <cmath>
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
#include <zlib.h>

#include "sim/compensation/course.h"
#include "sim/report/chart_labels.h"
#include "sim/report/encode.h"
#include "sim/report/html_report.h"
#include "sim/report/report_labels.h"
#include "sim/report/viewer_source.h"
#include "tests/safety/program_run.h"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

std::string unpacked_base64(const std::string& text) {
  std::string bytes;
  unsigned bits = 0;
  int have = 0;
  for (const char c : text) {
    if (c == '=') break;
    const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    bits = bits << 6 | unsigned(digits.find(c));
    have += 6;
    if (have >= 8) bytes += char(bits >> (have -= 8) & 0xffu);
  }
  return bytes;
}

/// The numbers of a packed array, as the script of the page unpacks them.
template <typename Number>
std::vector<Number> unpacked(const Packed& packed) {
  const std::size_t count = std::size_t(packed.rows * packed.columns);
  std::string planes(count * sizeof(Number), '\0');
  const std::string bytes = unpacked_base64(packed.text);
  uLongf size = uLongf(planes.size());
  EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(planes.data()), &size,
                       reinterpret_cast<const Bytef*>(bytes.data()), uLong(bytes.size())),
            Z_OK);
  EXPECT_EQ(size, planes.size());
  std::vector<Number> numbers(count);
  for (std::size_t i = 0; i < count; ++i) {
    std::uint32_t number = 0;
    for (std::size_t k = 0; k < sizeof(Number); ++k)
      number |= std::uint32_t(static_cast<unsigned char>(planes[k * count + i])) << (8 * k);
    if (i % std::size_t(packed.rows) != 0) number += std::uint32_t(numbers[i - 1]);
    numbers[i] = Number(number);
  }
  return numbers;
}

template <typename Number>
double largest_error(const Packed& packed, const Eigen::MatrixXd& values) {
  const std::vector<Number> numbers = unpacked<Number>(packed);
  double largest = 0.0;
  for (Eigen::Index c = 0; c < values.cols(); ++c)
    for (Eigen::Index r = 0; r < values.rows(); ++r) {
      const Number number = numbers[std::size_t(c * values.rows() + r)];
      const bool is_missing = number == std::numeric_limits<Number>::min();
      EXPECT_EQ(is_missing, std::isnan(values(r, c))) << r << " " << c;
      if (is_missing) continue;
      const double back =
          packed.offset[std::size_t(c)] + packed.step[std::size_t(c)] * double(number);
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

TEST(Packed, ValuesUnpackToWithinHalfAStep) {
  const Eigen::MatrixXd values = some_values(30.0);
  const double step = step_of_16_bits(values);
  const Packed short_one = packed_values(values, step);
  EXPECT_EQ(short_one.type, "i16");
  const double rounding = 1e-12;
  EXPECT_LE(largest_error<std::int16_t>(short_one, values), step / 2.0 + rounding);
  EXPECT_GT(largest_error<std::int16_t>(short_one, values), 0.4 * step) << "not quantised at all";
  const Packed long_one = packed_values(values, step / 2.0);
  EXPECT_EQ(long_one.type, "i32");
  EXPECT_LE(largest_error<std::int32_t>(long_one, values), step / 4.0 + rounding);
}

TEST(Packed, ValuesThatAreAllOneOrNoneUnpackExactly) {
  const Eigen::VectorXd same = Eigen::VectorXd::Constant(7, 1.25);
  EXPECT_EQ(largest_error<std::int16_t>(packed_values(same, step_of_16_bits(same)), same), 0.0);
  const Eigen::VectorXd missing = Eigen::VectorXd::Constant(7, nan);
  EXPECT_EQ(largest_error<std::int16_t>(packed_values(missing, 1.0), missing), 0.0);
}

TEST(Packed, WhatCannotBePackedIsRefused) {
  const Eigen::Vector2d far(0.0, 1e6), infinite(0.0, std::numeric_limits<double>::infinity());
  EXPECT_THROW(packed_values(far, 0.0), std::invalid_argument);
  EXPECT_THROW(packed_values(far, nan), std::invalid_argument);
  EXPECT_THROW(packed_values(far, 1e-5), std::invalid_argument);
  EXPECT_THROW(packed_values(infinite, 1.0), std::invalid_argument);
  EXPECT_THROW(packed_numbers(Eigen::Vector2i(3, -1)), std::invalid_argument);
}

TEST(Packed, WholeNumbersUnpackExactly) {
  Eigen::MatrixXi numbers(4, 2);
  numbers << 5, 0, 2147483647, 3, 0, 70000, 12, 1;
  const std::vector<std::uint32_t> back = unpacked<std::uint32_t>(packed_numbers(numbers));
  for (Eigen::Index i = 0; i < numbers.size(); ++i)
    EXPECT_EQ(back[std::size_t(i)], std::uint32_t(numbers.data()[i]));
}

TEST(Packed, NeighboursAlongTheCurveAreNeighboursInSpace) {
  Eigen::MatrixX3d grid(512, 3);
  for (int k = 0; k < 512; ++k) grid.row((k * 211) % 512) << k % 8, k / 8 % 8, k / 64;
  const std::vector<Eigen::Index> order = order_along_curve(grid);
  ASSERT_EQ(std::set<Eigen::Index>(order.begin(), order.end()).size(), 512u);
  for (std::size_t k = 1; k < order.size(); ++k)  // what makes it Hilbert's: every step is of one
    EXPECT_EQ((grid.row(order[k]) - grid.row(order[k - 1])).lpNorm<1>(), 1.0) << k;
}

TEST(Packed, Base64IsThatOfTheRfc) {  // RFC 4648, section 10
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
}

TEST(Thinned, LinesBetweenTheKeptComeWithinTheToleranceOfTheRest) {
  Eigen::VectorXd time(2000);
  Eigen::MatrixXd q(2000, 2);
  for (Eigen::Index k = 0; k < time.size(); ++k) {
    time[k] = 0.01 * double(k - (k > 700 ? 1 : 0));  // one instant stands twice
    q.row(k) << 50.0 * std::sin(time[k]), k < 1200 ? 3.0 * time[k] : -time[k];
  }
  const double tolerance = 0.05;
  const compensation::Course few =
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
      found(std::string(viewer_script()), std::regex("\\bL\\(\"(\\w+)\"\\)"));
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
    ran = safety::run("report " ABBE_SOURCE_DIR
                      "/scenes/gantry_dome.toml --set part.vertices=300 -o " +
                      (folder / "page.html").string());
    std::ifstream in(folder / "page.html", std::ios::binary);
    html.assign(std::istreambuf_iterator<char>(in), {});
  }
  static void TearDownTestSuite() { fs::remove_all(folder); }
  static inline fs::path folder;
  static inline safety::Ran ran;
  static inline std::string html;
};

TEST_F(Page, IsWholeAndMayAskNothingOfANetwork) {
  ASSERT_EQ(ran.code, 0);
  EXPECT_NE(html.find("content=\"default-src 'none';"), std::string::npos);
  EXPECT_EQ(html.find("connect-src"), std::string::npos);
  const std::regex resource(R"rx((?:src|href|url)\s*[=(]\s*["']?(?:https?:)?//)rx");
  const std::string sources =
      std::string(viewer_page()) + std::string(viewer_style()) + std::string(viewer_script());
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

TEST_F(Page, AFolderOfResultsIsRefusedByName) {
  const safety::Ran refused = safety::run("report " + folder.string());
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.text.find("left, seen the folder"), std::string::npos)
      << refused.text;
}

}  // namespace
}  // namespace abbe::sim
