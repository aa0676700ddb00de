#include "render/map_sheet.h"

#include <cmath>
#include <iostream>
#include <limits>
#include <stdexcept>
#include <system_error>

#include "tests/kinematics/nan.h"
#include "tests/render/picture.h"

namespace abbe::render {
namespace {

using test::bytes;
using test::Image;
using test::Pixel;

class Sheet : public test::Folder {};

/// Maps of a dome, each a tilt of its own size.
std::vector<SheetMap> tilts(const cutting::Design& design, int count) {
  std::vector<SheetMap> maps;
  for (int i = 0; i < count; ++i)
    maps.push_back({"element " + std::to_string(i),
                    "RMS 1.23 µm",
                    design.vertices.col(i % 2) * std::pow(10.0, i % 5 - 3),
                    {}});
  return maps;
}

TEST_F(Sheet, OfOneToManyMapsIsDrawnWithEveryMapOnItsOwnScale) {
  const cutting::Design design = test::dome(20, test::flat).design;
  for (const int count : {1, 2, 7, 46}) {
    write_sheet(file("a.png"), design, tilts(design, count));
    const Image image(file("a.png"));
    const int red = image.count([](Pixel p) { return p.is_reddish(); });
    const int blue = image.count([](Pixel p) { return p.is_blueish(); });
    const double all = double(image.width()) * image.height();
    std::cout << count << " maps: " << image.width() << " x " << image.height() << ", red "
              << 100.0 * red / all << " %, blue " << 100.0 * blue / all << " %\n";
    EXPECT_GT(red / all, 0.05);  // also where values differ by 10 000
    EXPECT_GT(blue / all, 0.05);
    EXPECT_GT(image.width() / double(image.height()), 0.4);
    EXPECT_LT(image.width() / double(image.height()), 3.0);
  }
}

TEST_F(Sheet, OnOneRangeSmallMapsArePale) {
  const cutting::Design design = test::dome(20, test::flat).design;
  const auto red = [&](bool common_range) {
    SheetOptions options;
    options.common_range = common_range;
    write_sheet(file("a.png"), design, tilts(design, 5), options);
    return Image(file("a.png")).count([](Pixel p) { return p.is_reddish(); });
  };
  const int own = red(false), common = red(true);
  std::cout << "red " << own << " px, on one range " << common << " px\n";
  EXPECT_LT(common, 0.5 * own);
}

TEST_F(Sheet, OfStandardDeviationsHasNoBlue) {
  const cutting::Design design = test::dome(20, test::flat).design;
  const Eigen::VectorXd sd = design.vertices.leftCols<2>().rowwise().norm() * 0.02;
  write_sheet(file("a.png"), design,
              {{"standard deviation", "largest 1.00 µm", sd, {}}, {"95 % band", "", 2.0 * sd, {}}});
  const Image image(file("a.png"));
  // the arrow colours and the letters are no blue either
  EXPECT_EQ(image.count([](Pixel p) { return p.is_blueish(); }), 0);
  EXPECT_GT(image.count([](Pixel p) { return p.is_reddish(); }), 10000);
}

TEST_F(Sheet, SaysWhatItsValuesAre) {
  const cutting::Design design = test::dome(5, test::flat).design;
  const auto drawn = [&](int count, std::optional<std::string> values, bool common_range = false) {
    SheetOptions options;
    options.values = std::move(values);
    options.width = 800;
    options.common_range = common_range;
    write_sheet(file("a.png"), design, tilts(design, count), options);
    return bytes(file("a.png"));
  };
  const auto residual = drawn(1, {});
  EXPECT_TRUE(drawn(1, "+ material left, − gouged; along the outward design normal") == residual);
  EXPECT_FALSE(drawn(1, "standard deviation") == residual);
  const int with_signs = Image(file("a.png")).height();
  drawn(1, "");
  const int without = Image(file("a.png")).height();
  std::cout << with_signs << " px, without what the values are " << without << " px\n";
  EXPECT_LT(without, with_signs);  // nor are the scales of a single map compared
  EXPECT_TRUE(drawn(1, {}, true) == residual);
  drawn(2, "");
  const int of_scales = Image(file("a.png")).height();
  drawn(2, "standard deviation");
  EXPECT_EQ(Image(file("a.png")).height(), of_scales);  // one line says both
}

TEST_F(Sheet, ShowsWhereThereIsNoValue) {
  cutting::Design design = test::dome(20, test::flat).design;
  Eigen::VectorXd values = design.vertices.col(0);
  const auto grey = [&] {
    write_sheet(file("a.png"), design, {{"a", "", values, {}}});
    return Image(file("a.png")).count([](Pixel p) { return p.is_grey(); });
  };
  const int none = grey();
  for (Eigen::Index i = 0; i < values.size(); ++i)
    if (design.vertices(i, 0) > 0.0) values[i] = nan;
  const int half = grey();
  std::cout << "grey " << none << " px, with half of it missing " << half << " px\n";
  EXPECT_GT(half, none + 100000);
}

TEST_F(Sheet, OfAFineDesignIsDrawnOnFewerVerticesAndLooksTheSame) {
  // 256 maps of 40 000 vertices are thinned, 16 are not
  const cutting::Design fine = test::dome(100, test::flat).design;
  const auto part_red = [&](int count) {
    SheetOptions options;
    options.columns = 16;
    write_sheet(file("a.png"), fine, std::vector<SheetMap>(std::size_t(count), tilts(fine, 1)[0]),
                options);
    const Image image(file("a.png"));
    return image.count([](Pixel p) { return p.is_reddish(); }) / double(count);
  };
  const double whole = part_red(16), decimate_curve = part_red(256);
  std::cout << "red " << whole << " px a map, of thinned ones " << decimate_curve << " px\n";
  EXPECT_NEAR(decimate_curve / whole, 1.0, 0.06);
}

TEST_F(Sheet, OfAwkwardMapsIsDrawn) {
  const cutting::Design design = test::dome(5, test::flat).design;
  const Eigen::Index n = design.vertices.rows();
  SheetOptions options;
  options.title = std::string(400, 'x');
  options.caption = {std::string(900, 'y')};
  write_sheet(file("a.png"), design,
              {{std::string(300, 'w'), std::string(300, 'f'), Eigen::VectorXd::Zero(n), {}},
               {"", "", Eigen::VectorXd::Constant(n, nan), {}},
               {"far", "", Eigen::VectorXd::Constant(n, 1e9), 1e-3},
               {"small", "", Eigen::VectorXd::Constant(n, -1e-9), {}}},
              options);
  write_sheet(file("b.png"), {}, {{"nothing", "", Eigen::VectorXd(0), {}}});
  write_sheet(file("c.png"), design, tilts(design, int(max_sheet_maps)));
  EXPECT_GT(Image(file("c.png")).height(), 1000);
}

TEST_F(Sheet, IsTheSameBytesTwice) {
  const cutting::Design design = test::dome(10, test::flat).design;
  for (const char* name : {"a.png", "b.png"}) write_sheet(file(name), design, tilts(design, 6));
  EXPECT_TRUE(bytes(file("a.png")) == bytes(file("b.png")));
}

TEST_F(Sheet, RefusesWhatCannotBeDrawn) {
  const cutting::Design design = test::dome(5, test::flat).design;
  const std::vector<SheetMap> one = tilts(design, 1);
  EXPECT_THROW(write_sheet(file("a.png"), design, {}), std::invalid_argument);
  EXPECT_THROW(write_sheet(file("a.png"), design, std::vector<SheetMap>(257, one[0])),
               std::invalid_argument);
  EXPECT_THROW(write_sheet(file("a.png"), design, {{"", "", Eigen::VectorXd::Zero(3), {}}}),
               std::invalid_argument);
  for (const double range : {0.0, -1.0, nan, std::numeric_limits<double>::infinity()})
    EXPECT_THROW(write_sheet(file("a.png"), design, {{"", "", one[0].values_um, range}}),
                 std::invalid_argument);
  EXPECT_THROW(write_sheet(file("no/a.png"), design, one), std::system_error);
}

}  // namespace
}  // namespace abbe::render
