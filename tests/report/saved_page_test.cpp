// The page of a folder that `run` or `compare` left: its maps are those of the page of the scene
// itself and of residual.vtp; what a folder lacks is left out by name, what is damaged refused.

#if ABBE_RENDER

#include <nlohmann/json.hpp>
#include "render/residual_field.h"
#include "tests/report/unpack.h"
#include "tests/safety/program_run.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

const char* const names[] = {"error_free", "uncompensated", "perfect-position-ideal"};

/// What stands in a script of a page.
std::string script(const std::string& html, const std::string& id) {
  const std::size_t at = html.find("id=\"" + id + "\">");
  if (at == std::string::npos) throw std::out_of_range("no script " + id);
  const std::size_t from = html.find('>', at) + 1;
  return html.substr(from, html.find("</script>", from) - from);
}

/// A page, with the file's number of each of its vertices.
struct ReadPage {
  std::string html;
  ordered_json index;
  std::vector<Index> order;
};

Eigen::MatrixXi numbers(const ReadPage& page, const std::string& name);

ReadPage page_of(const fs::path& file, const cutting::Design& design) {
  ReadPage page{safety::bytes(file), {}, morton_order(design.vertices)};
  page.index = ordered_json::parse(script(page.html, "index"));
  EXPECT_EQ(numbers(page, "triangle"), sorted_triangles(design.triangles, page.order));
  return page;
}

/// When the lines of a column are half done, in steps of 20 ms.
Eigen::VectorXi midst(const ReadPage& page, const std::string& lines) {
  const Eigen::MatrixXi line = numbers(page, "block_line"), begin = numbers(page, "block_time");
  std::map<int, int> at;
  for (Index k = 0; k < line.rows(); ++k)
    at.emplace(line(k, 0), (begin(k, 0) + begin(std::min(k + 1, line.rows() - 1), 0) + 20) / 40);
  Eigen::VectorXi all = numbers(page, lines);
  for (int& one : all) one = at.contains(one) ? at[one] : 0;
  return all;
}

Eigen::MatrixXi numbers(const ReadPage& page, const std::string& name) {
  const ordered_json& about = page.index.at("arrays").at(name);
  PackedColumns packed;
  packed.rows = about.at("n");
  packed.columns = about.at("components");
  packed.text = script(page.html, "a:" + name);
  if (!about.contains("reference")) return unpack::numbers(packed);
  const std::string of = about.at("reference");
  const Eigen::VectorXi reference =
      of.starts_with("midst:") ? midst(page, of.substr(6)) : Eigen::VectorXi(numbers(page, of));
  return unpack::numbers(packed, &reference);
}

/// By the vertices of the file; NaN where there is no value.
MatrixXd values(const ReadPage& page, const std::string& name) {
  const ordered_json& about = page.index.at("arrays").at(name);
  const Eigen::MatrixXi packed = numbers(page, name);
  MatrixXd all(packed.rows(), packed.cols());
  for (Index c = 0; c < all.cols(); ++c) {
    const bool has_step = about.contains("step");
    const double step = has_step ? about.at("step")[std::size_t(c)].get<double>() : 1.0;
    const double offset = has_step ? about.at("offset")[std::size_t(c)].get<double>() : 0.0;
    for (Index k = 0; k < all.rows(); ++k)
      all(page.order[std::size_t(k)], c) = packed(k, c) == missing
                                               ? std::numeric_limits<double>::quiet_NaN()
                                               : offset + step * packed(k, c);
  }
  return all;
}

void expect_near(const MatrixXd& a, const MatrixXd& b, double bound) {
  ASSERT_EQ(a.rows(), b.rows());
  for (Index k = 0; k < a.size(); ++k) {
    EXPECT_EQ(std::isnan(a.data()[k]), std::isnan(b.data()[k])) << k;
    if (std::isnan(a.data()[k])) continue;
    EXPECT_NEAR(a.data()[k], b.data()[k], bound) << k;
  }
}

const std::string small_dome =
    " --set part.vertices=300 --set program.step_over_mm=4 --set sampling.max_step_mm=1000 "
    "--set 'compare.cases=[\"perfect-position-ideal\"]' ";

/// Three cases with the page of their scene, cut once.
struct SavedFolder : testing::Test {
  static void SetUpTestSuite() {
    root = fs::temp_directory_path() / ("abbe_saved_" + std::to_string(::getpid()));
    fs::create_directories(root);
    ran = safety::run("compare " ABBE_SOURCE_DIR "/scenes/gantry_dome.toml --report" + small_dome +
                      "--out " + (root / "cut").string());
  }
  static void TearDownTestSuite() { fs::remove_all(root); }

  void SetUp() override {
    ASSERT_EQ(ran.code, 0) << ran.text;
    folder = root / "copy";
    fs::copy(root / "cut", folder, fs::copy_options::recursive);
  }
  void TearDown() override { fs::remove_all(folder); }

  safety::Ran report() const {
    return safety::run("report " + folder.string() + " -o " + page_file().string());
  }
  fs::path page_file() const { return folder / "saved.html"; }
  fs::path map_file(const std::string& name) const { return folder / name / "residual.vtp"; }
  std::vector<std::string> shown() const {
    std::vector<std::string> all;
    const ordered_json index = ordered_json::parse(script(safety::bytes(page_file()), "index"));
    for (const ordered_json& one : index.at("cases")) all.push_back(one.at("name"));
    return all;
  }

  static inline fs::path root;
  static inline safety::Ran ran;
  fs::path folder;
};

TEST_F(SavedFolder, ItsMapsAreThoseOfThePageOfTheSceneAndOfItsFiles) {
  const safety::Ran reported = report();
  ASSERT_EQ(reported.code, 0) << reported.text;
  const cutting::Design design = render::read_residual(map_file(names[0])).design;
  const ReadPage saved = page_of(page_file(), design),
                 live = page_of(folder / "report.html", design);
  ASSERT_TRUE(live.index.contains("machine"));
  EXPECT_FALSE(saved.index.contains("machine"));
  EXPECT_EQ(saved.index.at("tolerance_um"), live.index.at("tolerance_um"));
  expect_near(values(saved, "position"), design.vertices, 100.0 / 65534.0);
  for (std::size_t i = 0; i < std::size(names); ++i) {
    SCOPED_TRACE(names[i]);
    const render::Field field = render::read_residual(map_file(names[i]));
    const ordered_json &one = saved.index.at("cases")[i], &other = live.index.at("cases")[i];
    for (const char* key : {"name", "step_nm", "stats"}) EXPECT_EQ(one.at(key), other.at(key));
    const std::string n = std::to_string(i);
    const double step = 1e-3 * one.at("step_nm").get<double>(), rounding = 1e-9;
    expect_near(values(saved, "residual" + n), field.deviation_um, step / 2.0 + rounding);
    expect_near(values(saved, "form" + n), field.form_um, step / 2.0 + rounding);
    expect_near(values(saved, "cut_time" + n), field.cut_time_s, 0.01 + rounding);
    for (const char* array : {"residual", "form", "line", "cut_time"})
      expect_near(values(saved, array + n), values(live, array + n), rounding);
  }
}

TEST_F(SavedFolder, SaysThatTheMachineInMotionIsNotInIt) {
  const safety::Ran reported = report();
  EXPECT_HAS(reported.text,
             "the moving machine and its signals are omitted from the report: "
             "saved results do not contain them; abbe compare --report");
  EXPECT_EQ(reported.text.find("has no map"), std::string::npos) << reported.text;
  const std::string html = safety::bytes(page_file());
  EXPECT_HAS(html, "alt=\"uncompensated/residual\"");
  const ordered_json summary =
      ordered_json::parse(safety::bytes(folder / names[1] / "summary.json"));
  const std::string verdict = summary.at("conformance").at("verdict");
  EXPECT_FALSE(verdict.empty());
  EXPECT_HAS(html, "<li>uncompensated: " + verdict + "</li>") << verdict;
}

TEST_F(SavedFolder, TheMapOfAnotherCaseIsRefused) {
  fs::copy_file(map_file(names[0]), map_file(names[1]), fs::copy_options::overwrite_existing);
  const safety::Ran reported = report();
  EXPECT_EQ(reported.code, 3);
  EXPECT_HAS(reported.text, map_file(names[1]).string() +
                                ": expected the map of these figures, with a maximum of");
}

TEST_F(SavedFolder, ACaseWithoutItsFileIsLeftOutByName) {
  fs::remove(map_file(names[0]));
  const safety::Ran reported = report();
  ASSERT_EQ(reported.code, 0) << reported.text;
  EXPECT_HAS(reported.text, "error_free is in the table but has no map: " +
                                map_file(names[0]).string() + " is missing (--save vtp writes it)");
  EXPECT_EQ(shown(), (std::vector<std::string>{names[1], names[2]}));
}

TEST_F(SavedFolder, WithoutAnyMapThePageHasFiguresAndPictures) {
  for (const char* name : names) fs::remove(map_file(name));
  const safety::Ran reported = report();
  ASSERT_EQ(reported.code, 0) << reported.text;
  EXPECT_HAS(reported.text, "perfect-position-ideal is in the table but has no map");
  const ordered_json index = ordered_json::parse(script(safety::bytes(page_file()), "index"));
  std::vector<std::string> blocks;
  for (const ordered_json& one : index.at("blocks")) blocks.push_back(one.at("id"));
  EXPECT_EQ(blocks, (std::vector<std::string>{"figures", "pictures"}));
}

TEST_F(SavedFolder, ACaseOfAnotherMeshIsLeftOutByName) {
  render::Field other = render::read_residual(map_file(names[1]));
  other.design.vertices.array() += 1.0;
  render::write_residual(map_file(names[1]), other);
  const safety::Ran reported = report();
  ASSERT_EQ(reported.code, 0) << reported.text;
  EXPECT_HAS(reported.text, "uncompensated is in the table but has no map: its part is a mesh");
  EXPECT_EQ(shown(), (std::vector<std::string>{names[0], names[2]}));
}

TEST_F(SavedFolder, AMapWithoutFormHasTheResidualAlone) {
  render::Field field = render::read_residual(map_file(names[2]));
  field.form_um.resize(0);
  render::write_residual(map_file(names[2]), field);
  const safety::Ran reported = report();
  ASSERT_EQ(reported.code, 0) << reported.text;
  EXPECT_HAS(reported.text, map_file(names[2]).string() + " has no form_um");
  const ordered_json index = ordered_json::parse(script(safety::bytes(page_file()), "index"));
  EXPECT_TRUE(index.at("arrays").contains("residual2"));
  EXPECT_FALSE(index.at("arrays").contains("form0"));
}

TEST_F(SavedFolder, RegionsAreLeftOutByName) {
  std::ofstream(folder / names[0] / "scene.toml", std::ios::app)
      << "\n[[part.region]]\nname = \"top\"\nz_mm = [-5, 0]\n";
  const safety::Ran reported = report();
  ASSERT_EQ(reported.code, 0) << reported.text;
  EXPECT_HAS(reported.text, "the regions of the part are omitted");
}

TEST_F(SavedFolder, ADamagedFileIsRefusedByName) {
  fs::resize_file(map_file(names[1]), fs::file_size(map_file(names[1])) / 2);
  const safety::Ran refused = report();
  EXPECT_EQ(refused.code, 3);
  EXPECT_HAS(refused.text, map_file(names[1]).string());
  EXPECT_HAS(refused.text, "seen");
  EXPECT_FALSE(fs::exists(page_file()));
}

TEST_F(SavedFolder, ValuesThatNoPageCanHoldAreRefusedByName) {
  render::Field field = render::read_residual(map_file(names[1]));
  field.deviation_um[0] = 1e30;
  render::write_residual(map_file(names[1]), field);
  const safety::Ran refused = report();
  EXPECT_EQ(refused.code, 3);
  EXPECT_HAS(refused.text, "residual.vtp: expected a map that fits into a page, seen a deviation");
}

TEST_F(SavedFolder, ACaseThatNamesAnotherFolderOrComesTwiceIsRefused) {
  const std::string text = safety::bytes(folder / "comparison.json");
  const std::string name = "\"name\": \"uncompensated\"";
  const std::size_t at = text.find(name);
  ASSERT_NE(at, std::string::npos);
  for (const auto& [other, seen] :
       {std::pair("../copy/uncompensated", "is not the name of a folder in it"),
        std::pair(".", "is not the name of a folder in it"),
        std::pair("error_free", "the case \"error_free\" twice")}) {
    const std::string renamed = "\"name\": \"" + std::string(other) + "\"";
    std::ofstream(folder / "comparison.json")
        << std::string(text).replace(at, name.size(), renamed);
    const safety::Ran refused = report();
    EXPECT_EQ(refused.code, 3);
    EXPECT_HAS(refused.text, seen);
  }
}

TEST_F(SavedFolder, NoPageReplacesWhatItIsMadeOf) {
  for (const fs::path& file : {folder / "comparison.json", map_file(names[1])}) {
    const std::string before = safety::bytes(file);
    const safety::Ran refused =
        safety::run("report " + folder.string() + " --force -o " + file.string());
    EXPECT_EQ(refused.code, 5);
    EXPECT_HAS(refused.text, "expected a folder, seen a file");
    EXPECT_EQ(safety::bytes(file), before);
  }
}

/// Runs a case whose map has samples within its triangles, and asks for the page of its folder.
/// @return true if one of those samples is the highest of the map
bool reports_a_map_with_samples(const std::string& sampling) {
  const fs::path folder =
      fs::temp_directory_path() / ("abbe_sampled_" + std::to_string(::getpid()));
  const safety::Ran cut = safety::run("run " ABBE_SOURCE_DIR
                                      "/scenes/gantry_dome.toml --case uncompensated"
                                      " --set program.step_over_mm=2 " +
                                      sampling + " --out " + folder.string());
  EXPECT_LE(cut.code, 1) << cut.text;
  const safety::Ran reported =
      safety::run("report " + folder.string() + " -o " + (folder / "page.html").string());
  EXPECT_EQ(reported.code, 0) << reported.text;
  const render::Field field = render::read_residual(folder / "residual.vtp");
  fs::remove_all(folder);
  const auto highest = [](const VectorXd& values) {
    return values.unaryExpr([](double v) { return std::isnan(v) ? -1e9 : v; }).maxCoeff();
  };
  EXPECT_GT(field.within_um.size(), 0);
  return highest(field.within_um) > highest(field.deviation_um);
}

TEST(SavedMap, SamplesWithinItsTrianglesCountInTheFiguresOfItsPage) {
  const bool is_highest[] = {
      reports_a_map_with_samples("--set 'part.sampling=\"spacing\"' --set part.spacing_mm=4"),
      reports_a_map_with_samples("--set 'part.sampling=\"vertices\"' --set part.vertices=2000")};
  EXPECT_TRUE(is_highest[0] || is_highest[1]) << "the maps do not test what they should";
}

}  // namespace
}  // namespace abbe::sim

#endif
