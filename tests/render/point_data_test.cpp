#include "render/vtk_writer.h"

#include <limits>
#include <stdexcept>
#include <system_error>

#include <vtkDataArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkXMLPolyDataReader.h>

#include "tests/render/picture.h"

namespace abbe::render {
namespace {

using test::bytes;

class PointData : public test::Folder {};

cutting::Design design() { return test::sheet(80, 60, 9, 7, test::flat, test::flat).design; }

TEST_F(PointData, ComesBackBitForBitWhateverItsName) {
  const cutting::Design d = design();
  const Eigen::Index n = d.vertices.rows();
  const std::vector<std::string> names{"EXX_c1_um", "a \"quoted\" <name> & more", "Größe µm", ""};
  const std::vector<std::string> written{"EXX_c1_um", "a _quoted_ _name_ _ more", "Größe µm", "_"};
  std::vector<Eigen::VectorXd> arrays(4, Eigen::VectorXd::LinSpaced(n, -1.0, 1.0 / 3.0));
  arrays[1].setConstant(std::numeric_limits<double>::quiet_NaN());
  arrays[2] *= 1e300;
  write_point_data(file("a.vtp"), d, names, arrays);
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->SetFileName(file("a.vtp").c_str());
  reader->Update();
  vtkPointData& data = *reader->GetOutput()->GetPointData();
  ASSERT_EQ(reader->GetOutput()->GetNumberOfPoints(), n);
  ASSERT_EQ(reader->GetOutput()->GetNumberOfPolys(), d.triangles.rows());
  ASSERT_EQ(data.GetNumberOfArrays(), 4);
  EXPECT_EQ(data.GetScalars(), data.GetArray(0));
  for (int k = 0; k < 4; ++k) {
    EXPECT_EQ(data.GetArrayName(k), written[k]);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double seen = data.GetArray(k)->GetComponent(i, 0), meant = arrays[k][i];
      EXPECT_TRUE(seen == meant || (std::isnan(seen) && std::isnan(meant)));
    }
  }
}

TEST_F(PointData, IsWhatAResidualIsWrittenAs) {
  Field f = test::sheet(80, 60, 9, 7, test::flat, [](double x, double y) { return x - y; });
  test::leave_uncut(f, 4);
  write_residual(file("a.vtp"), f);
  const auto view = [](const Eigen::VectorXd& v) {
    return std::span<const double>(v.data(), std::size_t(v.size()));
  };
  write_point_data(file("b.vtp"), f.design.vertices, f.design.triangles,
                   {{"deviation_um", view(f.deviation_um)},
                    {"status", std::span<const std::uint8_t>(f.status)},
                    {"cut_time_s", view(f.cut_time_s)},
                    {"cut_line", std::span<const int>(f.cut_line)},
                    {"area_mm2", view(f.design.area)}});
  EXPECT_TRUE(bytes(file("a.vtp")) == bytes(file("b.vtp")));
}

TEST_F(PointData, RefusesWhatDoesNotFit) {
  const cutting::Design d = design();
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(d.vertices.rows());
  EXPECT_THROW(write_point_data(file("a.vtp"), d, {"a"}, {zero, zero}), std::invalid_argument);
  EXPECT_THROW(write_point_data(file("a.vtp"), d, {"a", "a"}, {zero, zero}), std::invalid_argument);
  EXPECT_THROW(write_point_data(file("a.vtp"), d, {"a"}, {Eigen::VectorXd::Zero(3)}),
               std::invalid_argument);
  EXPECT_FALSE(std::filesystem::exists(file("a.vtp")));
  EXPECT_THROW(write_point_data(file("no/a.vtp"), d, {"a"}, {zero}), std::system_error);
  EXPECT_THROW(write_point_data("/dev/full", d, {"a"}, {zero}), std::system_error);
  write_point_data(file("none.vtp"), d, {}, {});
}

}  // namespace
}  // namespace abbe::render
