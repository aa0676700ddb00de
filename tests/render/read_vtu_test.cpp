#include <vtkDataArray.h>
#include <vtkDoubleArray.h>
#include <vtkFloatArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLPolyDataReader.h>
#include <vtkXMLUnstructuredGridWriter.h>
#include "render/vtk_reader.h"
#include "render/vtk_writer.h"
#include "tests/render/picture.h"
#include "tests/test.h"

namespace abbe::render {
namespace {

using test::bytes;

/// A file of its own, gone afterwards.
class Vtu {
 public:
  explicit Vtu(const std::string& text = {})
      : path_(fs::temp_directory_path() /
              ("abbe_vtu_" + std::to_string(std::random_device{}()) + ".vtu")) {
    write(text);
  }
  ~Vtu() {
    std::error_code ignored;
    fs::remove(path_, ignored);
  }
  Vtu(const Vtu&) = delete;
  Vtu& operator=(const Vtu&) = delete;

  void write(const std::string& text) const {
    fs::remove(path_);  // some file systems flush what is written over
    std::ofstream(path_, std::ios::binary) << text;
  }
  std::string text() const {
    std::ifstream in(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// How VTK is asked to write.
struct Style {
  int mode = vtkXMLWriter::Ascii;
  int compressor = vtkXMLWriter::NONE;
  int header = vtkXMLWriter::UInt32;
  bool raw = false;
  int components = 9;
  bool single = false;
  int nodes = 50;
  int block = 1000;  ///< bytes
};

double value(int node, int component) { return 0.5 * node - 3.25 * component * component; }

template <class Array>
void fill(Array& array, const char* name, int components, int nodes) {
  array.SetName(name);
  array.SetNumberOfComponents(components);
  for (int i = 0; i < nodes; ++i)
    for (int k = 0; k < components; ++k) array.InsertNextValue(value(i, k));
}

template <class Array>
void write(const fs::path& path, const Style& style) {
  vtkNew<Array> xyz, other, tensors;
  fill(*xyz, "Points", 3, style.nodes);
  fill(*other, "stress", 6, style.nodes);
  fill(*tensors, "C", style.components, style.nodes);
  vtkNew<vtkPoints> points;
  points->SetData(xyz);
  vtkNew<vtkUnstructuredGrid> grid;
  grid->SetPoints(points);
  grid->GetPointData()->AddArray(other);
  grid->GetPointData()->AddArray(tensors);
  vtkNew<vtkXMLUnstructuredGridWriter> writer;
  writer->SetInputData(grid);
  writer->SetFileName(path.c_str());
  writer->SetDataMode(style.mode);
  writer->SetCompressorType(style.compressor);
  writer->SetHeaderType(style.header);
  writer->SetEncodeAppendedData(style.raw ? 0 : 1);
  writer->SetBlockSize(std::size_t(style.block));
  ASSERT_EQ(writer->Write(), 1);
}

void write(const fs::path& path, const Style& style) {
  fs::remove(path);
  style.single ? write<vtkFloatArray>(path, style) : write<vtkDoubleArray>(path, style);
}

void expect_read(const fs::path& path, const Style& style) {
  const PointTensors read = read_vtu(path, "C");
  ASSERT_EQ(read.points.rows(), style.nodes);
  ASSERT_EQ(read.tensors.size(), std::size_t(style.nodes));
  for (int i = 0; i < style.nodes; ++i) {
    for (int k = 0; k < 3; ++k) ASSERT_EQ(read.points(i, k), value(i, k));
    Matrix3d T;
    const auto v = [&](int k) { return value(i, k); };
    if (style.components == 9) {
      T << v(0), v(1), v(2), v(3), v(4), v(5), v(6), v(7), v(8);
    } else {
      T << v(0), v(3), v(5), v(3), v(1), v(4), v(5), v(4), v(2);
    }
    ASSERT_EQ(read.tensors[std::size_t(i)], T) << "node " << i;
  }
}

std::vector<Style> styles() {
  std::vector<Style> all;
  for (const int mode : {vtkXMLWriter::Ascii, vtkXMLWriter::Binary, vtkXMLWriter::Appended})
    for (const int compressor : {vtkXMLWriter::NONE, vtkXMLWriter::ZLIB, vtkXMLWriter::LZ4})
      for (const int header : {vtkXMLWriter::UInt32, vtkXMLWriter::UInt64})
        for (const bool raw : {false, true})
          for (const int components : {9, 6})
            for (const bool single : {false, true})
              for (const int nodes : {1, 7, 50, 125})
                all.push_back({mode, compressor, header, raw, components, single, nodes, 1000});
  return all;
}

std::string refusal(const fs::path& path) {
  try {
    read_vtu(path, "C");
  } catch (const BadInput& fault) {
    return fault.what();
  }
  return {};
}

TEST(ReadVtu, ReadsWhatVtkWritesInEveryWayItWrites) {
  const Vtu file;
  int count = 0;
  for (const Style& style : styles()) {
    SCOPED_TRACE(testing::Message()
                 << "mode " << style.mode << " compressor " << style.compressor << " header "
                 << style.header << " raw " << style.raw << " components " << style.components
                 << " single " << style.single << " nodes " << style.nodes);
    write(file.path(), style);
    expect_read(file.path(), style);
    ++count;
  }
  std::cout << count << " ways\n";
}

TEST(ReadVtu, ReadsOneWrittenByHand) {
  const Vtu file(
      "<?xml version='1.0'?>\n<!-- a > b -->\n<VTKFile type='UnstructuredGrid' version=\"0.1\">\n"
      "<UnstructuredGrid><Piece NumberOfPoints=\"2\" NumberOfCells=\"0\"><PointData>\n"
      "<DataArray Name=\"C\" type=\"Float64\" NumberOfComponents=\"6\" format=\"ascii\">\n"
      "1 2 3 4e-1 5 6\n7 8 9\t10 11 12</DataArray></PointData><Points>\n"
      "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 2 "
      "3</DataArray>\n"
      "</Points></Piece></UnstructuredGrid></VTKFile>\n");
  const PointTensors read = read_vtu(file.path(), "C");
  EXPECT_EQ(read.points.row(1), Eigen::RowVector3d(1, 2, 3));
  Matrix3d T;
  T << 1, 0.4, 6, 0.4, 2, 5, 6, 5, 3;
  EXPECT_EQ(read.tensors[0], T);
}

TEST(ReadVtu, RefusesAnotherFileByName) {
  const Vtu file;
  write(file.path(), {});
  const std::string good = file.text();
  const auto why = [&](const std::string& from, const std::string& to,
                       const std::string& after = "") {
    std::string text = good;
    const std::size_t at = text.find(from, text.find(after));
    EXPECT_NE(at, std::string::npos) << from;
    if (at != std::string::npos) text.replace(at, from.size(), to);
    file.write(text);
    const std::string fault = refusal(file.path());
    EXPECT_TRUE(fault.starts_with(file.path().string())) << fault;
    return fault;
  };
  const auto contains = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos ? testing::AssertionSuccess()
                                                : testing::AssertionFailure() << text;
  };
  EXPECT_TRUE(contains(why("\"UnstructuredGrid\"", "\"PolyData\""), "UnstructuredGrid"));
  EXPECT_TRUE(contains(why("LittleEndian", "BigEndian"), "LittleEndian"));
  EXPECT_TRUE(contains(why("UInt32", "UInt16"), "UInt64"));
  EXPECT_TRUE(contains(why("<VTKFile", "<VTKFile compressor=\"vtkLZMADataCompressor\""), "LZ4"));
  EXPECT_TRUE(contains(why("<VTKFile", "<VTK"), "VTK XML"));
  EXPECT_TRUE(contains(why("\"C\"", "\"D\""), "point array \"C\", seen only \"stress\" \"D\""));
  EXPECT_TRUE(contains(why("<Points>", "<Cells>"), "array of Points"));
  EXPECT_TRUE(contains(why("NumberOfComponents=\"9\"", "NumberOfComponents=\"3\""), "9 or 6"));
  EXPECT_TRUE(contains(why("NumberOfPoints=\"50\"", "NumberOfPoints=\"51\""), "153 numbers"));
  EXPECT_TRUE(contains(why("NumberOfPoints=\"50\"", "NumberOfPoints=\"-1\""), "integer"));
  EXPECT_TRUE(contains(why("NumberOfPoints=\"50\"", "NumberOfPoints=\"0\""), "with points"));
  EXPECT_TRUE(contains(why("NumberOfPoints=\"50\"", "NumberOfPoints=\"18446744073709551615\""),
                       "fits into the file"));
  EXPECT_TRUE(contains(why("</Piece>", "<Piece NumberOfPoints=\"1\">"), "one piece"));
  EXPECT_TRUE(
      contains(why("\"Float64\" Name=\"C\"", "\"Int64\" Name=\"C\""), "Float32 or Float64"));
  const std::string in_C = "Name=\"C\"";
  EXPECT_TRUE(contains(why("ascii", "asc", in_C), "ascii, binary or appended"));
  EXPECT_TRUE(contains(why("-3.25", "nan", in_C), "finite numbers, seen nan at node 1"));
  EXPECT_TRUE(contains(why("-3.25", "-3.25x", in_C), "numbers, seen \"-3.25x\""));
  EXPECT_TRUE(contains(why("type=\"", "type=\"a\" type=\""), "once"));
  file.write("");
  EXPECT_TRUE(contains(refusal(file.path()), "VTK XML"));
  EXPECT_TRUE(contains(refusal(file.path().string() + "x"), "no such file"));
  EXPECT_TRUE(contains(refusal(fs::temp_directory_path()), "no such file"));
}

TEST(ReadVtu, HugeClaimsCostNothing) {
  // 2^40 points, blocks and bytes that are not there: refused before anything is allocated
  const Vtu file;
  for (const char* header : {"/////w==", "AQAAAP////8AAAAA/////w==", "/////////////////////w=="}) {
    for (const char* packing : {"", " compressor=\"vtkZLibDataCompressor\""}) {
      for (const char* nodes : {"1", "100000", "1099511627776"}) {
        file.write(std::string("<VTKFile type=\"UnstructuredGrid\"") + packing +
                   "><Piece NumberOfPoints=\"" + nodes +
                   "\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" "
                   "format=\"binary\">" +
                   header +
                   "</DataArray></Points><PointData><DataArray Name=\"C\" type=\"Float64\" "
                   "NumberOfComponents=\"9\" format=\"binary\">" +
                   header + "</DataArray>");
        EXPECT_NE(refusal(file.path()), "") << header << packing << nodes;
      }
    }
  }
}

TEST(ReadVtu, EveryTruncationIsRefused) {
  const Vtu file;
  int refused = 0;
  for (const Style& style : styles()) {
    if (style.nodes != 7 || style.single || style.components != 6) continue;
    write(file.path(), style);
    const std::string good = file.text();
    // behind the last byte of data only closing tags may be missing
    std::size_t end = good.rfind("</AppendedData>");
    const std::size_t slack = end == std::string::npos ? 1 : 200;  // of the cells, passed over
    if (end == std::string::npos)
      end = good.find('<', good.find("<DataArray", good.find("<Points>")) + 1);
    while (std::string_view(" \n\t").find(good[end - 1]) != std::string_view::npos) --end;
    for (std::size_t n = 0; n + slack < end; n += 7) {
      file.write(good.substr(0, n));
      ASSERT_NE(refusal(file.path()), "") << n << " of " << good.size() << " bytes";
      ++refused;
    }
  }
  std::cout << refused << " refused\n";
}

TEST(ReadVtu, NoiseIsRefusedOrRead) {
  SeededRandom random(4711);
  const Vtu file;
  int refused = 0, all = 0;
  for (const Style& style : styles()) {
    if (style.nodes != 7 && style.nodes != 125) continue;
    write(file.path(), style);
    const std::string good = file.text();
    for (int i = 0; i < 40; ++i) {
      std::string text = good;
      for (unsigned k = 0; k < 1 + random() % 4; ++k) text[random() % text.size()] = char(random());
      if (random() % 5 == 0) text.erase(random() % text.size(), random() % 100);
      file.write(text);
      refused += !refusal(file.path()).empty();
      ++all;
    }
  }
  std::cout << refused << " of " << all << " refused\n";
  EXPECT_GT(refused, all / 10);
}

class PointData : public test::Folder {};

cutting::Design design() { return test::sheet(80, 60, 9, 7, test::flat, test::flat).design; }

TEST_F(PointData, ComesBackBitForBitWhateverItsName) {
  const cutting::Design d = design();
  const Index n = d.vertices.rows();
  const std::vector<std::string> names{"EXX_c1_um", "a \"quoted\" <name> & more", "Größe µm", ""};
  const std::vector<std::string> written{"EXX_c1_um", "a _quoted_ _name_ _ more", "Größe µm", "_"};
  std::vector<VectorXd> arrays(4, VectorXd::LinSpaced(n, -1.0, 1.0 / 3.0));
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
    for (Index i = 0; i < n; ++i) {
      const double seen = data.GetArray(k)->GetComponent(i, 0), meant = arrays[k][i];
      EXPECT_TRUE(seen == meant || (std::isnan(seen) && std::isnan(meant)));
    }
  }
}

TEST_F(PointData, IsWhatAResidualIsWrittenAs) {
  Field f = test::sheet(80, 60, 9, 7, test::flat, [](double x, double y) { return x - y; });
  test::leave_uncut(f, 4);
  write_residual(file("a.vtp"), f);
  const auto view = [](const VectorXd& v) {
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
  const VectorXd zero = VectorXd::Zero(d.vertices.rows());
  EXPECT_THROW(write_point_data(file("a.vtp"), d, {"a"}, {zero, zero}), std::invalid_argument);
  EXPECT_THROW(write_point_data(file("a.vtp"), d, {"a", "a"}, {zero, zero}), std::invalid_argument);
  EXPECT_THROW(write_point_data(file("a.vtp"), d, {"a"}, {VectorXd::Zero(3)}),
               std::invalid_argument);
  EXPECT_FALSE(fs::exists(file("a.vtp")));
  EXPECT_THROW(write_point_data(file("no/a.vtp"), d, {"a"}, {zero}), std::system_error);
  EXPECT_THROW(write_point_data("/dev/full", d, {"a"}, {zero}), std::system_error);
  write_point_data(file("none.vtp"), d, {}, {});
}

}  // namespace
}  // namespace abbe::render
