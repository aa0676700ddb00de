#include <vtkCellArray.h>
#include <vtkDataArray.h>
#include <vtkFieldData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkStringArray.h>
#include <vtkXMLPolyDataReader.h>
#include <vtkXMLPolyDataWriter.h>
#include "render/residual_field.h"
#include "tests/render/picture.h"
#include "tests/test.h"

namespace abbe::render {
namespace {

using test::bytes;
using test::leave_uncut;
using test::sheet;

class Residual : public test::Folder {};

bool same_bits(const double* a, const double* b, Index n) {
  return n == 0 || std::memcmp(a, b, n * sizeof(double)) == 0;
}

Field awkward() {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Field f = sheet(80, 60, 23, 17, test::flat, [&](double, double) { return 20.0 * unit(random); });
  for (Index i = 0; i < f.design.vertices.rows(); ++i) f.design.vertices(i, 2) = unit(random);
  f.deviation_um[0] = -0.0;
  f.deviation_um[1] = std::numeric_limits<double>::denorm_min();
  f.deviation_um[2] = 1.0 / 3.0;
  f.deviation_um[3] = -1e300;
  leave_uncut(f, 40);
  f.status[41] = 2;
  f.deviation_um[41] = std::numeric_limits<double>::quiet_NaN();
  f.cut_line[5] = std::numeric_limits<int>::max();
  return f;
}

void expect_same(const Field& a, const Field& b) {
  ASSERT_EQ(a.design.vertices.rows(), b.design.vertices.rows());
  EXPECT_TRUE(
      same_bits(a.design.vertices.data(), b.design.vertices.data(), a.design.vertices.size()));
  EXPECT_EQ(a.design.triangles, b.design.triangles);
  EXPECT_TRUE(same_bits(a.deviation_um.data(), b.deviation_um.data(), a.deviation_um.size()));
  EXPECT_TRUE(same_bits(a.cut_time_s.data(), b.cut_time_s.data(), a.cut_time_s.size()));
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.cut_line, b.cut_line);
}

TEST_F(Residual, ComesBackBitForBit) {
  const Field f = awkward();
  write_residual(file("a.vtp"), f);
  expect_same(f, read_residual(file("a.vtp")));
}

TEST_F(Residual, OfNoVerticesComesBack) {
  Field empty;
  empty.design.vertices.resize(0, 3);
  empty.design.triangles.resize(0, 3);
  write_residual(file("a.vtp"), empty);
  EXPECT_EQ(read_residual(file("a.vtp")).design.vertices.rows(), 0);
}

TEST_F(Residual, OpensInTheReaderThatParaViewUses) {
  const Field f = awkward();
  write_residual(file("a.vtp"), f);
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->SetFileName(file("a.vtp").c_str());
  reader->Update();
  vtkPolyData& mesh = *reader->GetOutput();
  ASSERT_EQ(mesh.GetNumberOfPoints(), f.design.vertices.rows());
  ASSERT_EQ(mesh.GetNumberOfPolys(), f.design.triangles.rows());
  vtkPointData& data = *mesh.GetPointData();
  ASSERT_EQ(data.GetNumberOfArrays(), 5);
  EXPECT_STREQ(data.GetScalars()->GetName(), "deviation_um");
  for (Index i = 0; i < f.design.vertices.rows(); ++i) {
    const Vector3d p = f.design.vertices.row(i);
    EXPECT_TRUE(same_bits(mesh.GetPoint(i), p.data(), 3));
    const double deviation = data.GetArray("deviation_um")->GetComponent(i, 0);
    EXPECT_TRUE(same_bits(&deviation, &f.deviation_um[i], 1));
    EXPECT_EQ(data.GetArray("status")->GetComponent(i, 0), f.status[i]);
    EXPECT_EQ(data.GetArray("cut_line")->GetComponent(i, 0), f.cut_line[i]);
    EXPECT_EQ(data.GetArray("area_mm2")->GetComponent(i, 0), f.design.area[i]);
  }
  for (Index i = 0; i < f.design.triangles.rows(); ++i) {
    vtkIdType size = 0;
    const vtkIdType* corners = nullptr;
    mesh.GetPolys()->GetCellAtId(i, size, corners);
    ASSERT_EQ(size, 3);
    for (int k = 0; k < 3; ++k) EXPECT_EQ(corners[k], f.design.triangles(i, k));
  }
}

TEST_F(Residual, FactsAreFieldDataThatTheReaderOfResultsPassesOver) {
  const Field f = awkward();
  const Facts facts = {{"unit", "mm"}, {"scene", "\"<&>\" \u00b5"}, {"", "of no name"}};
  write_residual(file("a.vtp"), f, facts);
  expect_same(f, read_residual(file("a.vtp")));
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->SetFileName(file("a.vtp").c_str());
  reader->Update();
  vtkFieldData& data = *reader->GetOutput()->GetFieldData();
  const auto text = [&](const char* name) -> std::string {
    auto* array = vtkStringArray::SafeDownCast(data.GetAbstractArray(name));
    return array ? std::string(array->GetValue(0)) : "none";
  };
  EXPECT_EQ(text("unit"), "mm");
  EXPECT_EQ(text("scene"), "\"<&>\" \u00b5");
  EXPECT_EQ(text("_"), "of no name");
}

TEST_F(Residual, MiddlesOfTrianglesAreReadAgainAndCountInItsFigures) {
  Field f = awkward();
  f.deviation_um[3] = 7.0;
  f.design.area = cutting::vertex_area(f.design.vertices, f.design.triangles);
  f.within_um = f.deviation_um.head(1).replicate(f.design.triangles.rows(), 1);
  f.within_um[5] = std::numeric_limits<double>::quiet_NaN();
  for (Index t = 0; t < f.within_um.size(); ++t)
    for (const int v : f.design.triangles.row(t))
      if (f.status[std::size_t(v)] != 0) f.within_um[t] = std::numeric_limits<double>::quiet_NaN();
  f.interior_sample = cutting::Surface::InteriorSample::Random;
  write_residual(file("a.vtp"), f);
  const Field again = read_residual(file("a.vtp"));
  ASSERT_EQ(again.within_um.size(), f.within_um.size());
  EXPECT_TRUE(same_bits(again.within_um.data(), f.within_um.data(), f.within_um.size()));
  EXPECT_EQ(again.interior_sample, f.interior_sample);
  EXPECT_EQ(statistics(again).mean, statistics(f).mean);
  f.within_um.array() += 1.0;
  EXPECT_GT(*statistics(f).mean, *statistics(again).mean);
}

TEST_F(Residual, IsReadAsBase64Too) {
  write_residual(file("a.vtp"), awkward());
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->SetFileName(file("a.vtp").c_str());
  reader->Update();
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetInputData(reader->GetOutput());
  writer->SetFileName(file("b.vtp").c_str());
  writer->SetHeaderTypeToUInt64();
  writer->SetIdTypeToInt64();
  writer->EncodeAppendedDataOn();
  writer->SetCompressorTypeToZLib();
  ASSERT_EQ(writer->Write(), 1);
  EXPECT_HAS(bytes(file("b.vtp")), "encoding=\"base64\"");
  expect_same(read_residual(file("a.vtp")), read_residual(file("b.vtp")));
}

TEST_F(Residual, IsTheSameBytesTwice) {
  write_residual(file("a.vtp"), awkward());
  write_residual(file("b.vtp"), awkward());
  EXPECT_TRUE(bytes(file("a.vtp")) == bytes(file("b.vtp")));
}

TEST_F(Residual, AreaOfAVertexIsAThirdOfTheTrianglesAround) {
  write_residual(file("a.vtp"), sheet(80, 60, 23, 17, test::flat, test::flat));
  const Field back = read_residual(file("a.vtp"));
  EXPECT_NEAR(back.design.area.sum(), 4800.0, 1e-9);
  EXPECT_NEAR(back.design.area[0], 80.0 / 22 * 60.0 / 16 / 3, 1e-12);  // a corner in two triangles
}

TEST_F(Residual, IsToldInMicrometresOfTheSurface) {
  const Field f = sheet(1, 1, 2, 2, test::flat, test::flat);
  cutting::Surface surface;
  surface.residual = Eigen::Vector4d(0.001, -0.002, 0.5, std::numeric_limits<double>::quiet_NaN());
  surface.cut_time_s = Eigen::Vector4d(1, 2, 3, std::numeric_limits<double>::quiet_NaN());
  surface.cut_line = {1, 2, 3, 0};
  surface.status = {cutting::VertexStatus::Cut, cutting::VertexStatus::Cut,
                    cutting::VertexStatus::Cut, cutting::VertexStatus::Gouged};
  write_residual(file("a.vtp"), f.design, surface);
  const Field back = read_residual(file("a.vtp"));
  EXPECT_DOUBLE_EQ(back.deviation_um[0], 1.0);
  EXPECT_DOUBLE_EQ(back.deviation_um[1], -2.0);
  EXPECT_DOUBLE_EQ(back.deviation_um[2], 500.0);
  EXPECT_EQ(back.status, (std::vector<std::uint8_t>{0, 0, 0, 3}));
  surface.cut_line.pop_back();
  EXPECT_THROW(write_residual(file("a.vtp"), f.design, surface), std::invalid_argument);
}

TEST_F(Residual, SaysWhichFileCouldNotBeWritten) {
  for (const fs::path& path : {file("no/such/a.vtp"), fs::path("/dev/full")}) {
    try {
      write_residual(path, awkward());
      ADD_FAILURE() << path << " was written";
    } catch (const std::system_error& failure) {
      EXPECT_HAS(failure.what(), path.string());
      EXPECT_TRUE(failure.code() == std::errc::no_such_file_or_directory ||
                  failure.code() == std::errc::no_space_on_device);
    }
  }
}

class BadResidual : public test::Folder {
 protected:
  BadResidual() {
    write_residual(file("good.vtp"), awkward());
    good_ = bytes(file("good.vtp"));
  }

  /// Refused as BadInput that names the file, and nothing on the terminal.
  void expect_refused(const std::string& text, const std::string& why) {
    const auto path = file("bad.vtp");
    std::ofstream(path, std::ios::binary) << text;
    testing::internal::CaptureStderr();
    try {
      read_residual(path);
      ADD_FAILURE() << "accepted: " << why;
    } catch (const BadInput& refusal) {
      EXPECT_EQ(refusal.file, path.string()) << why;
      EXPECT_FALSE(refusal.expected.empty()) << why;
    }
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << why;
  }

  std::string with(const std::string& from, const std::string& to) const {
    std::string text = good_;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
  }

  std::string good_;
};

TEST_F(BadResidual, IsRefusedWhereverItIsTruncated) {
  for (std::size_t length = 0; length + 12 < good_.size(); length += 1 + good_.size() / 400) {
    expect_refused(good_.substr(0, length), "truncated to " + std::to_string(length));
  }
}

TEST_F(BadResidual, IsRefusedForEachFaultByItself) {
  expect_refused("", "empty");
  expect_refused(std::string(1000, '\0'), "zeros");
  expect_refused("solid cube\nendsolid cube\n", "an STL");
  expect_refused(with("deviation_um\" format", "deviation_mm\" format"), "array missing");
  expect_refused(with("Name=\"status\"", "Name=\"deviation_um\""), "array twice");
  expect_refused(with("type=\"Float64\"", "type=\"Float32\""), "other type");
  expect_refused(with("NumberOfPoints=\"391\"", "NumberOfPoints=\"392\""), "one vertex more");
  expect_refused(with("NumberOfPoints=\"391\"", "NumberOfPoints=\"390\""), "one vertex less");
  expect_refused(with("NumberOfPoints=\"391\"", "NumberOfPoints=\"999999999999999\""),
                 "a million billion");
  expect_refused(with("NumberOfPoints=\"391\"", "NumberOfPoints=\"-1\""), "minus one");
  expect_refused(with("NumberOfPolys=\"704\"", "NumberOfPolys=\"18446744073709551615\""),
                 "2^64 - 1");
  expect_refused(with("NumberOfLines=\"0\"", "NumberOfLines=\"1\""), "lines");
  expect_refused(with("LittleEndian", "BigEndian"), "other byte order");
  expect_refused(with("type=\"PolyData\"", "type=\"ImageData\""), "other kind");
  expect_refused(with("encoding=\"raw\"", "encoding=\"base64\""), "bytes called base64");
  expect_refused(with("encoding=\"raw\"", "encoding=\"rot13\""), "an encoding of nobody");
  expect_refused(with("offset=\"0\"", "offset=\"4\""), "offset into the data");
  expect_refused(with("offset=\"0\"", "offset=\"99999999\""), "offset beyond the file");
  expect_refused(with("</VTKFile>", "</VTKFile>more"), "something after the end");
  expect_refused(with("\n   _", "\n   _!"), "bytes moved by one");
}

TEST_F(BadResidual, IsRefusedWhenItsNumbersMakeNoSense) {
  const auto refused = [&](const Field& f, const std::string& why) {
    write_residual(file("made.vtp"), f);
    expect_refused(bytes(file("made.vtp")), why);
  };
  Field f = awkward();
  f.design.vertices(3, 1) = std::numeric_limits<double>::infinity();
  refused(f, "infinite vertex");
  f = awkward();
  f.design.triangles(3, 1) = 391;
  refused(f, "corner that is not there");
  f = awkward();
  f.design.triangles(3, 1) = -1;
  refused(f, "negative corner");
  f = awkward();
  f.status[7] = 4;
  refused(f, "status 4");
  f = awkward();
  f.status[7] = 3;
  refused(f, "a number called gouged");
  f = awkward();
  f.deviation_um[7] = std::numeric_limits<double>::quiet_NaN();
  refused(f, "NaN called cut");
  f = awkward();
  f.deviation_um[40] = 1.0;
  refused(f, "a number called uncut");
}

TEST_F(BadResidual, IsRefusedWhenVtkCompressedIt) {
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->SetFileName(file("good.vtp").c_str());
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetInputConnection(reader->GetOutputPort());
  writer->SetFileName(file("packed.vtp").c_str());
  writer->Write();
  expect_refused(bytes(file("packed.vtp")), "compressed");
}

TEST_F(BadResidual, ThatIsNoFileIsRefused) {
  EXPECT_THROW(read_residual(file("nowhere.vtp")), BadInput);
  EXPECT_THROW(read_residual(file("nowhere.vtp").parent_path()), BadInput);
}

TEST_F(BadResidual, OfDamagedBytesIsRefusedOrConsistent) {
  SeededRandom random(20251);
  int refused = 0;
  constexpr int runs = 3000;
  for (int run = 0; run < runs; ++run) {
    std::string text = good_;
    // half of the damage to the header, which is the smaller part
    const std::size_t span = run % 2 == 0 ? text.find("<AppendedData") : text.size();
    for (unsigned i = 0; i <= random() % 3; ++i)
      text[random() % span] = static_cast<char>(random());
    std::ofstream(file("bad.vtp"), std::ios::binary) << text;
    try {
      const Field f = read_residual(file("bad.vtp"));
      EXPECT_EQ(f.deviation_um.size(), f.design.vertices.rows());
      EXPECT_LT(f.design.triangles.maxCoeff(), f.design.vertices.rows());
    } catch (const BadInput&) {
      ++refused;
    }
  }
  std::cout << refused << " of " << runs << " damaged files refused\n";
  EXPECT_GT(refused, runs / 4);
}

}  // namespace
}  // namespace abbe::render
