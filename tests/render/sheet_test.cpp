#include <vtkDataArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkXMLPolyDataReader.h>
#include "render/map_sheet.h"
#include "render/stock_picture.h"
#include "tests/render/picture.h"
#include "tests/test.h"

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
  const VectorXd sd = design.vertices.leftCols<2>().rowwise().norm() * 0.02;
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
  VectorXd values = design.vertices.col(0);
  const auto grey = [&] {
    write_sheet(file("a.png"), design, {{"a", "", values, {}}});
    return Image(file("a.png")).count([](Pixel p) { return p.is_grey(); });
  };
  const int none = grey();
  for (Index i = 0; i < values.size(); ++i)
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
  const Index n = design.vertices.rows();
  SheetOptions options;
  options.title = std::string(400, 'x');
  options.caption = {std::string(900, 'y')};
  write_sheet(file("a.png"), design,
              {{std::string(300, 'w'), std::string(300, 'f'), VectorXd::Zero(n), {}},
               {"", "", VectorXd::Constant(n, nan), {}},
               {"far", "", VectorXd::Constant(n, 1e9), 1e-3},
               {"small", "", VectorXd::Constant(n, -1e-9), {}}},
              options);
  write_sheet(file("b.png"), {}, {{"nothing", "", VectorXd(0), {}}});
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
  EXPECT_THROW(write_sheet(file("a.png"), design, {{"", "", VectorXd::Zero(3), {}}}),
               std::invalid_argument);
  for (const double range : {0.0, -1.0, nan, std::numeric_limits<double>::infinity()})
    EXPECT_THROW(write_sheet(file("a.png"), design, {{"", "", one[0].values_um, range}}),
                 std::invalid_argument);
  EXPECT_THROW(write_sheet(file("no/a.png"), design, one), std::system_error);
}

class StockPictures : public test::Folder {};

/// A flat of 20 x 10 mm, half of it 0.2 mm too high and half gouged, with a rim not compared.
StockField flat() {
  constexpr int nx = 41, ny = 21;
  StockField field;
  field.mesh.vertices_w.resize(nx * ny, 3);
  field.deviation_um.resize(nx * ny);
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i) {
      const int v = i + nx * j;
      const bool rim = j < 3;
      field.mesh.vertices_w.row(v) << 0.5 * i, 0.5 * j, 0.0;
      field.deviation_um[v] =
          rim ? std::numeric_limits<double>::quiet_NaN() : (i < nx / 2 ? 200.0 : -200.0);
      field.compared.push_back(rim ? 2 : 0);
      field.finding.push_back(rim ? 0 : (i < nx / 2 ? 1 : 2));
      field.undercut.push_back(0);
      field.kind.push_back(std::uint8_t(rim ? 0 : (i < nx / 2 ? 1 : 2)));
      field.mesh.line.push_back(i % 3 - 1);
    }
  field.largest_um = field.deviation_um;
  field.mesh.triangles.resize(2 * (nx - 1) * (ny - 1), 3);
  int row = 0;
  for (int j = 0; j + 1 < ny; ++j)
    for (int i = 0; i + 1 < nx; ++i) {
      const int a = i + nx * j;
      field.mesh.triangles.row(row++) << a, a + 1, a + nx + 1;
      field.mesh.triangles.row(row++) << a, a + nx + 1, a + nx;
    }
  return field;
}

StockPicture picture_of(const StockField& field) {
  StockPicture picture;
  picture.title = "a flat";
  picture.field = field;
  picture.from = Vector3d::UnitZ();
  picture.up = Vector3d::UnitY();
  picture.width = 800;
  picture.height = 600;
  return picture;
}

TEST_F(StockPictures, MaterialLeftIsRedGougesBlueWhatIsNotComparedGrey) {
  write_stock_picture(file("stock.png"), picture_of(flat()));
  const test::Image image(file("stock.png"));
  ASSERT_EQ(image.width(), 800);
  const auto share = [&](int from, int to, auto is) {
    return image.count({from, 100}, {to, 520}, is);
  };
  const auto red = [](const test::Pixel& p) { return p.is_reddish(); };
  const auto blue = [](const test::Pixel& p) { return p.is_blueish(); };
  EXPECT_GT(share(20, 325, red), 20000);
  EXPECT_GT(share(330, 640, blue), 20000);
  EXPECT_EQ(share(20, 310, blue), 0);
  EXPECT_GT(
      image.count({20, 100}, {640, 520},
                  [](const test::Pixel& p) { return test::distance(p, colours::outside) < 12; }),
      5000);
}

TEST_F(StockPictures, ABodyThatNothingIsComparedOfIsGreyThroughout) {
  StockField field = flat();
  field.deviation_um.setConstant(std::numeric_limits<double>::quiet_NaN());
  for (std::uint8_t& one : field.compared) one = 2;
  write_stock_picture(file("grey.png"), picture_of(field));
  const test::Image image(file("grey.png"));
  EXPECT_EQ(image.count({20, 100}, {640, 520},
                        [](const test::Pixel& p) { return p.is_reddish() || p.is_blueish(); }),
            0);
}

TEST_F(StockPictures, OfTooManyPlacesThoseInViewAreLabelled) {
  using Mark = StockPicture::Mark;
  const std::vector<Mark> hidden = {
      {{3, 5, -4}, "1", 0}, {{6, 5, -4}, "2", 0}, {{9, 5, -4}, "3", 0}};
  const Mark seen{{15, 5, 0}, "4", 0}, of_other_kind{{17, 8, -4}, "5", 1};
  const auto picture = [&](const std::string& name, std::vector<Mark> marks) {
    StockPicture one = picture_of(flat());
    one.marks = std::move(marks);
    write_stock_picture(file(name), one);
    return test::bytes(file(name));
  };
  EXPECT_EQ(picture("all.png", {hidden[0], hidden[1], hidden[2], seen, of_other_kind}),
            picture("best.png", {hidden[0], hidden[1], seen, of_other_kind}));
}

TEST_F(StockPictures, OfAPlaceWhoseDeepestIsHiddenWhatIsInViewIsMarked) {
  const auto picture = [&](const std::string& name, StockPicture::Mark mark) {
    StockPicture one = picture_of(flat());
    one.marks = {std::move(mark)};
    write_stock_picture(file(name), one);
    return test::bytes(file(name));
  };
  const auto moved = picture("moved.png", {{12, 5, -4}, "2", 0, 2});
  // in the middle of it
  EXPECT_TRUE(moved == picture("a.png", {{15, 5.5, 0}, "2", 0}) ||
              moved == picture("b.png", {{15, 6, 0}, "2", 0}));
  EXPECT_NE(moved, picture("hidden.png", {{12, 5, -4}, "2", 0}));
}

TEST_F(StockPictures, TheSameFieldGivesTheSameFileWithAllItsArrays) {
  write_stock(file("a.vtp"), flat(), {{"frame", "workpiece"}});
  write_stock(file("b.vtp"), flat(), {{"frame", "workpiece"}});
  EXPECT_EQ(test::bytes(file("a.vtp")), test::bytes(file("b.vtp")));
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->SetFileName(file("a.vtp").c_str());
  reader->Update();
  vtkPointData* const data = reader->GetOutput()->GetPointData();
  const StockField field = flat();
  for (const char* name : {"deviation_um", "largest_um", "compared", "finding", "undercut", "kind",
                           "status", "cut_line"}) {
    ASSERT_NE(data->GetArray(name), nullptr) << name;
    EXPECT_EQ(data->GetArray(name)->GetNumberOfTuples(), field.deviation_um.size());
  }
  for (vtkIdType i = 0; i < field.deviation_um.size(); ++i) {
    const auto v = std::size_t(i);
    EXPECT_EQ(data->GetArray("finding")->GetTuple1(i), field.finding[v]);
    EXPECT_EQ(data->GetArray("status")->GetTuple1(i),
              field.mesh.line[v] > 0 ? 0 : (field.mesh.line[v] == 0 ? 1 : 2));
  }
}

TEST_F(StockPictures, WhatDoesNotFitIsRefused) {
  EXPECT_THROW(write_stock_picture(file("none.png"), picture_of({})), std::invalid_argument);
  StockField field = flat();
  field.compared.pop_back();
  EXPECT_THROW(write_stock_picture(file("none.png"), picture_of(field)), std::invalid_argument);
  EXPECT_THROW(write_stock(file("none.vtp"), field), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::render
