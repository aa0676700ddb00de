#include "render/volume_map.h"
#include <vtkDoubleArray.h>
#include <vtkPointData.h>
#include <vtkStructuredGrid.h>
#include <vtkXMLStructuredGridReader.h>
#include "render/vtk_writer.h"
#include "tests/render/picture.h"
#include "tests/test.h"

namespace abbe::render {
namespace {

using test::bytes;
using test::Image;
using test::Pixel;

class VolumeMap : public test::Folder {
 protected:
  /// A block of 300 x 200 x 100 mm whose points are displaced by `d` (um) of their place (mm).
  template <class Displacement>
  static VolumePicture block(std::array<int, 3> size, Displacement d) {
    VolumePicture p;
    p.title = "a block";
    p.figures = "max 1 µm";
    p.size = size;
    p.points.resize(size[0] * size[1] * size[2], 3);
    p.displacement_um.resize(p.points.rows(), 3);
    Index row = 0;
    for (int k = 0; k < size[2]; ++k)
      for (int j = 0; j < size[1]; ++j)
        for (int i = 0; i < size[0]; ++i, ++row) {
          const auto part = [](int at, int of) { return of > 1 ? at / (of - 1.0) : 0.0; };
          p.points.row(row) << 300 * part(i, size[0]), 200 * part(j, size[1]),
              100 * part(k, size[2]);
          p.displacement_um.row(row) = d(Vector3d(p.points.row(row)));
        }
    return p;
  }
  static Vector3d shear(const Vector3d& p) { return {0.3 * p.z(), -0.05 * p.x(), 0}; }

  // px of a picture of 1600 x 1200, about where the displaced grid and the components lie
  static constexpr std::array<int, 2> main_lower{40, 270}, main_upper{1010, 1060};
  static constexpr std::array<int, 2> side_lower{1045, 270}, side_upper{1560, 1060};

  static double covered(const Image& image, std::array<int, 2> lower, std::array<int, 2> upper) {
    const double all = double(upper[0] - lower[0]) * (upper[1] - lower[1]);
    return image.count(lower, upper, [](Pixel p) { return !p.is_white(); }) / all;
  }
};

TEST_F(VolumeMap, FillsItsPlaceWithoutAWordOnTheTerminal) {
  for (const std::array<int, 3> size : {std::array{7, 5, 4}, {7, 5, 1}, {7, 1, 4}, {1, 5, 4}}) {
    SCOPED_TRACE(testing::Message() << size[0] << " x " << size[1] << " x " << size[2]);
    testing::internal::CaptureStderr();
    testing::internal::CaptureStdout();
    write_volume_map(file("a.png"), block(size, shear));
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
    EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
    const Image image(file("a.png"));
    EXPECT_EQ(image.width(), 1600);
    EXPECT_EQ(image.height(), 1200);
    const double main = covered(image, main_lower, main_upper);
    const double side = covered(image, side_lower, side_upper);
    std::cout << 100 * main << " % and " << 100 * side << " % of the places are drawn on\n";
    EXPECT_GT(main, 0.3);
    EXPECT_GT(side, 0.1);
  }
}

TEST_F(VolumeMap, ShowsLengthsInRedAndComponentsInBothColours) {
  write_volume_map(file("a.png"), block({7, 5, 4}, shear));
  const Image image(file("a.png"));
  const auto red = [](Pixel p) { return p.is_reddish(); };
  const auto blue = [](Pixel p) { return p.is_blueish(); };
  EXPECT_GT(image.count(main_lower, main_upper, red), 20000);
  EXPECT_GT(image.count(side_lower, side_upper, red), 3000);
  EXPECT_GT(image.count(side_lower, side_upper, blue), 3000);
}

TEST_F(VolumeMap, GivesTheSameBytesTwiceAndAnotherPictureOfAnotherMachine) {
  write_volume_map(file("a.png"), block({5, 5, 5}, shear));
  write_volume_map(file("b.png"), block({5, 5, 5}, shear));
  write_volume_map(file("c.png"),
                   block({5, 5, 5}, [](const auto& p) { return Vector3d(-shear(p)); }));
  EXPECT_EQ(bytes(file("a.png")), bytes(file("b.png")));
  EXPECT_NE(bytes(file("a.png")), bytes(file("c.png")));
}

TEST_F(VolumeMap, APerfectMachineAndAPoorOneAreDrawn) {
  for (const double um : {0.0, 1e-9, 1e-3, 1e6}) {
    const VolumePicture p =
        block({3, 3, 3}, [&](const auto& q) { return Vector3d(um * shear(q)); });
    write_volume_map(file("a.png"), p);
    EXPECT_GT(covered(Image(file("a.png")), main_lower, main_upper), 0.2) << um;
  }
  EXPECT_EQ(fitted_magnification(block({3, 3, 3}, [](const auto&) { return Vector3d(0, 0, 0); })),
            1.0);
  // 374 mm of diagonal, 33.5 um: a twelfth of it is 930 times as much
  EXPECT_EQ(fitted_magnification(block({3, 3, 3}, shear)), 500.0);
}

TEST_F(VolumeMap, RefusesWhatItCannotDraw) {
  const auto refused = [&](const VolumePicture& p, const VolumeOptions& options = {}) {
    EXPECT_THROW(write_volume_map(file("a.png"), p, options), std::invalid_argument);
  };
  const VolumePicture good = block({3, 3, 3}, shear);
  VolumePicture bad = good;
  bad.size = {3, 3, 2};
  refused(bad);
  bad = good;
  bad.displacement_um(4, 1) = std::nan("");
  refused(bad);
  refused(block({9, 1, 1}, shear));
  VolumeOptions options;
  options.magnification = 0.0;
  refused(good, options);
  EXPECT_FALSE(fs::exists(file("a.png")));
}

TEST_F(VolumeMap, TheGridIsReadBackByVtkBitForBit) {
  const VolumePicture p = block({4, 3, 2}, shear);
  const std::vector<GridArray> arrays{{"deviation_um", p.displacement_um},
                                      {"deviation_norm_um", p.displacement_um.rowwise().norm()}};
  write_structured_grid(file("a.vts"), p.points, p.size, arrays);
  vtkNew<vtkXMLStructuredGridReader> reader;
  reader->SetFileName(file("a.vts").c_str());
  reader->Update();
  vtkStructuredGrid& grid = *reader->GetOutput();
  std::array<int, 3> size{};
  grid.GetDimensions(size.data());
  EXPECT_EQ(size, p.size);
  ASSERT_EQ(grid.GetNumberOfPoints(), p.points.rows());
  EXPECT_EQ(grid.GetNumberOfCells(), 3 * 2 * 1);
  const auto* vectors =
      vtkDoubleArray::SafeDownCast(grid.GetPointData()->GetVectors("deviation_um"));
  auto* lengths = vtkDoubleArray::SafeDownCast(grid.GetPointData()->GetArray("deviation_norm_um"));
  ASSERT_TRUE(vectors != nullptr && lengths != nullptr);
  for (vtkIdType i = 0; i < grid.GetNumberOfPoints(); ++i) {
    const double* point = grid.GetPoint(i);
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(point[k], p.points(i, k));
      EXPECT_EQ(const_cast<vtkDoubleArray*>(vectors)->GetComponent(i, k), p.displacement_um(i, k));
    }
    EXPECT_EQ(lengths->GetComponent(i, 0), arrays[1].values(i, 0));
  }
  EXPECT_THROW(write_structured_grid(file("b.vts"), p.points, {4, 3, 3}, arrays),
               std::invalid_argument);
  EXPECT_THROW(write_structured_grid(file("b.vts"), p.points, p.size, {arrays[0], arrays[0]}),
               std::invalid_argument);
  EXPECT_THROW(write_structured_grid(file("none/b.vts"), p.points, p.size, arrays),
               std::system_error);
}

}  // namespace
}  // namespace abbe::render
