#include "render/stock_picture.h"

#include <stdexcept>

#include <vtkDataArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkXMLPolyDataReader.h>

#include "tests/render/picture.h"

namespace abbe::render {
namespace {

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
  picture.from = Eigen::Vector3d::UnitZ();
  picture.up = Eigen::Vector3d::UnitY();
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
