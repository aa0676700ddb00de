#include "sim/report/result_files.h"
#include <OpenMesh/Core/IO/MeshIO.hh>
// after the readers and writers, which it looks for
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <nlohmann/json.hpp>
#include "cutting/part/read_mesh.h"
#include "sim/report/map_formats.h"
#include "tests/safety/program_run.h"
#include "tests/sim/odd_scenes.h"
#include "tests/test.h"

/// Files of a map, read by OpenMesh, by the reader of meshes and by the C library. NumPy and VTK
/// read them in tests/oracles/saved_results.py.
namespace abbe::sim {
namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

/// A wavy sheet of n x n vertices, a millimetre apart.
ResultMap wavy_sheet(int n) {
  ResultMap map;
  map.facts = {"wavy sheet", "uncompensated", 7, 2.5, Tolerance{-0.02, 0.02}};
  cutting::Design& d = map.design;
  d.vertices.resize(n * n, 3);
  d.triangles.resize(2 * (n - 1) * (n - 1), 3);
  map.residual_um.resize(n * n);
  Index face = 0;
  for (int i = 0; i < n * n; ++i) {
    const double x = i % n, y = i / n;
    d.vertices.row(i) << x + 1.0 / 3.0, y - 200.0, std::sin(x / 7.0) * std::cos(y / 11.0);
    map.residual_um[i] = 20.0 * std::sin(x / 3.0 + y / 5.0);
    map.status.push_back(0);
    map.cut_line.push_back(i);
    if (i % n == n - 1 || i / n == n - 1) continue;
    d.triangles.row(face++) << i, i + 1, i + n;
    d.triangles.row(face++) << i + 1, i + n + 1, i + n;
  }
  d.normals = cutting::vertex_normals(d.vertices, d.triangles);
  d.area = cutting::vertex_area(d.vertices, d.triangles);
  map.form_um = 0.5 * map.residual_um;
  map.texture_um = map.residual_um - map.form_um;
  map.cut_time_s = VectorXd::LinSpaced(n * n, 0.0, 60.0);
  return map;
}

/// With a vertex of each status, and numbers that digits lose easily.
ResultMap awkward_map() {
  ResultMap map = wavy_sheet(20);
  for (const int status : {1, 2, 3}) {
    map.status[std::size_t(status)] = std::uint8_t(status);
    map.residual_um[status] = map.form_um[status] = map.texture_um[status] = -not_a_number;
  }
  map.cut_time_s[1] = -not_a_number;
  map.cut_line[1] = 0;
  map.residual_um[4] = -0.0;
  map.residual_um[5] = std::numeric_limits<double>::denorm_min();
  map.residual_um[6] = 1.0 / 3.0;
  map.residual_um[7] = -1e-300;
  map.facts.scene = "two\nlines, \"quoted\" end_header \u00b5\u4e2d\x1b[2J";
  return map;
}

struct MeshTraits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
};
using ReadBack = OpenMesh::TriMesh_ArrayKernelT<MeshTraits>;

ReadBack read_by_open_mesh(const fs::path& file) {
  ReadBack mesh;
  mesh.request_vertex_normals();
  OpenMesh::IO::Options options(OpenMesh::IO::Options::VertexNormal |
                                OpenMesh::IO::Options::Custom);
  EXPECT_TRUE(OpenMesh::IO::read_mesh(mesh, file.string(), options)) << file;
  return mesh;
}

cutting::ReadMeshOptions open_surface() {
  cutting::ReadMeshOptions options;
  options.open = true;
  return options;
}

/// The corners of triangle after triangle.
cutting::Points corners_of(const cutting::Points& vertices, const cutting::Triangles& triangles) {
  cutting::Points corners(3 * triangles.rows(), 3);
  for (Index i = 0; i < triangles.size(); ++i) corners.row(i) = vertices.row(triangles.data()[i]);
  return corners;
}
cutting::Points corners_of(const ReadBack& mesh) {
  cutting::Points corners(3 * Index(mesh.n_faces()), 3);
  Index row = 0;
  for (const auto face : mesh.faces())
    for (const auto vertex : face.vertices()) {
      const OpenMesh::Vec3d& p = mesh.point(vertex);
      corners.row(row++) << p[0], p[1], p[2];
    }
  return corners;
}

cutting::Points machined_points(const ResultMap& map) {
  cutting::Points points = map.design.vertices;
  for (Index i = 0; i < points.rows(); ++i)
    if (map.status[std::size_t(i)] == 0)
      points.row(i) += 1e-3 * map.residual_um[i] * map.design.normals.row(i);
  return points;
}

TEST(ResultFiles, OpenMeshReadsThePlyWithItsNormalsAndQuality) {
  const SceneFolder folder;
  const ResultMap map = awkward_map();
  const ReadBack mesh = read_by_open_mesh(folder.write("a.ply", to_ply(map)));
  ASSERT_EQ(Index(mesh.n_vertices()), map.design.vertices.rows());
  const cutting::Points wanted = corners_of(map.design.vertices, map.design.triangles);
  const cutting::Points as_float = wanted.cast<float>().cast<double>();
  EXPECT_EQ(corners_of(mesh), as_float) << "OpenMesh reads float64 through float32";
  OpenMesh::VPropHandleT<float> quality;
  OpenMesh::VPropHandleT<unsigned char> status;
  ASSERT_TRUE(mesh.get_property_handle(quality, "quality"));
  ASSERT_TRUE(mesh.get_property_handle(status, "status"));
  for (const auto vertex : mesh.vertices()) {
    const Index i = vertex.idx();
    for (int k = 0; k < 3; ++k)
      EXPECT_EQ(mesh.normal(vertex)[k], double(float(map.design.normals(i, k))));
    const float seen = mesh.property(quality, vertex), given = float(map.residual_um[i]);
    EXPECT_TRUE(seen == given || (std::isnan(seen) && std::isnan(given))) << i;
    EXPECT_EQ(mesh.property(status, vertex), map.status[std::size_t(i)]);
  }
}

TEST(ResultFiles, TheStlIsTheMachinedSurfaceForOpenMeshAndForTheReaderOfParts) {
  const SceneFolder folder;
  const ResultMap map = awkward_map();
  const auto file = folder.write("a.stl", to_stl(map));
  const cutting::Points wanted = corners_of(machined_points(map), map.design.triangles);
  const float largest = float(wanted.cwiseAbs().maxCoeff());
  const double half_a_step = 0.5 * (std::nextafter(largest, 2 * largest) - largest);
  const double by_open_mesh = (corners_of(read_by_open_mesh(file)) - wanted).cwiseAbs().maxCoeff();
  const cutting::Design read = cutting::read_mesh(file, open_surface());
  const double by_abbe = (corners_of(read.vertices, read.triangles) - wanted).cwiseAbs().maxCoeff();
  std::cout << "off by " << by_open_mesh << " and " << by_abbe << " mm, half a step is "
            << half_a_step << " mm\n";
  EXPECT_LE(by_open_mesh, half_a_step);
  EXPECT_LE(by_abbe, half_a_step);
  EXPECT_EQ(read.vertices.rows(), map.design.vertices.rows());
}

TEST(ResultFiles, TheReaderOfPartsTakesThePlyAsTheDesign) {
  const SceneFolder folder;
  const ResultMap map = awkward_map();
  const cutting::Design read =
      cutting::read_mesh(folder.write("a.ply", to_ply(map)), open_surface());
  EXPECT_EQ(read.vertices, map.design.vertices);
  EXPECT_EQ(read.triangles, map.design.triangles);
}

TEST(ResultFiles, NumbersOfTheCsvReadBackToTheSameBits) {
  const ResultMap map = awkward_map();
  std::istringstream text(to_csv(map));
  std::string line;
  while (std::getline(text, line) && line.starts_with("#")) {
  }
  EXPECT_EQ(line,
            "x_mm,y_mm,z_mm,nx,ny,nz,residual_um,form_um,texture_um,status,cut_time_s,cut_line,"
            "area_mm2");
  for (Index i = 0; i < map.residual_um.size(); ++i) {
    ASSERT_TRUE(std::getline(text, line));
    const cutting::Design& d = map.design;
    const double wanted[] = {d.vertices(i, 0),   d.vertices(i, 1),
                             d.vertices(i, 2),   d.normals(i, 0),
                             d.normals(i, 1),    d.normals(i, 2),
                             map.residual_um[i], map.form_um[i],
                             map.texture_um[i],  double(map.status[std::size_t(i)]),
                             map.cut_time_s[i],  double(map.cut_line[std::size_t(i)]),
                             d.area[i]};
    const char* at = line.c_str();
    for (const double one : wanted) {
      char* end = nullptr;
      const double seen = std::strtod(at, &end);
      if (std::isnan(one))
        EXPECT_EQ(std::string(at, 3), "nan");
      else
        EXPECT_EQ(std::memcmp(&seen, &one, sizeof one), 0) << line << ": " << seen << ", " << one;
      at = end + 1;
    }
    EXPECT_EQ(at, line.c_str() + line.size() + 1);
  }
  EXPECT_FALSE(std::getline(text, line));
}

TEST(ResultFiles, FactsStayOnTheirLineWhateverTheTitle) {
  const ResultMap map = awkward_map();
  const std::string title = "two\\x0alines, \"quoted\" end_header \u00b5\u4e2d\\x1b[2J";
  EXPECT_HAS(to_ply(map), "\ncomment scene: " + title + "\n");
  EXPECT_HAS(to_csv(map), "\n# scene: " + title + "\n");
  EXPECT_HAS(to_csv(map), "\n# seed: 7\n");
  EXPECT_HAS(to_csv(map), "\n# tolerance_um: [-20.0,20.0]\n");
  const std::string head = to_stl(map).substr(0, 80);
  EXPECT_TRUE(std::ranges::all_of(head, [](char c) { return c >= ' ' && c <= '~'; })) << head;
}

TEST(ResultFiles, OfNoVerticesStillRead) {
  ResultMap map = wavy_sheet(1);
  map.design.vertices.resize(0, 3);
  map.design.normals.resize(0, 3);
  map.design.triangles.resize(0, 3);
  map.design.area.resize(0);
  map.residual_um.resize(0);
  map.form_um.resize(0);
  map.texture_um.resize(0);
  map.cut_time_s.resize(0);
  map.status.clear();
  map.cut_line.clear();
  EXPECT_EQ(to_stl(map).size(), 84u);
  EXPECT_TRUE(to_ply(map).ends_with("end_header\n"));
  EXPECT_TRUE(to_csv(map).ends_with(",area_mm2\n"));
  EXPECT_GT(to_npz(map).size(), 1000u);
}

TEST(ResultFiles, TheSameMapGivesTheSameBytesInLittleTime) {
  const ResultMap map = wavy_sheet(316);
  const std::pair<const char*, std::string (*)(const ResultMap&)> formats[] = {
      {"ply", to_ply}, {"stl", to_stl}, {"csv", to_csv}, {"npz", to_npz}};
  for (const auto& [name, bytes_of] : formats) {
    const auto start = std::chrono::steady_clock::now();
    const std::string bytes = bytes_of(map);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    EXPECT_EQ(bytes, bytes_of(map)) << name;
    std::cout << name << ": " << double(bytes.size()) * 1e-6 << " MB of "
              << map.design.vertices.rows() << " vertices in " << took.count() << " s\n";
  }
}

/// `run` and `compare` with --save.
class Save : public testing::Test {
 protected:
  Save() {
    folder_.write("good.ngc", to_nc({}));
    scene_ = folder_.write("scene.toml", to_toml(FlatScene{}));
  }
  safety::Ran run(const std::string& words) const {
    return safety::run(fmt::format("run {} --out {} {}", scene_.string(), out().string(), words));
  }
  fs::path out() const { return folder_ / "out"; }
  /// Endings of the maps in the folder.
  std::set<std::string> saved() const {
    std::set<std::string> endings;
    for (const auto& entry : fs::directory_iterator(out()))
      if (entry.path().stem() == "residual" && entry.path().extension() != ".png")
        endings.insert(entry.path().extension().string().substr(1));
    return endings;
  }

  safety::Folder folder_;
  fs::path scene_;
};

TEST_F(Save, WritesWhatIsAskedForAndRemovesWhatAnEarlierRunLeft) {
  const std::vector<std::string> usual = default_map_formats();
  ASSERT_EQ(run("").code, 0);
  EXPECT_EQ(saved(), std::set<std::string>(usual.begin(), usual.end()));
  ASSERT_EQ(run("--save ply,stl,csv --save npz,json").code, 0);
  EXPECT_EQ(saved(), (std::set<std::string>{"ply", "stl", "csv", "npz", "json"}));
  const auto about = nlohmann::json::parse(safety::bytes(out() / "residual.json"));
  EXPECT_EQ(about["files"], (nlohmann::json{"residual.ply", "residual.stl", "residual.csv",
                                            "residual.npz", "residual.json"}));
  ASSERT_EQ(run("--save csv").code, 0);
  EXPECT_EQ(saved(), std::set<std::string>{"csv"});
}

TEST_F(Save, RefusesAFormatThatIsNoneWithTheNearest) {
  const auto ran = run("--save npz,pyl");
  EXPECT_EQ(ran.code, 2);
  EXPECT_HAS(ran.text, "--save: expected one of ");
  EXPECT_HAS(ran.text, "ply, stl, csv, npz, json, track (nearest: ply), seen pyl");
  EXPECT_FALSE(fs::exists(out()));
}

TEST_F(Save, LeavesAloneWhatAPersonPutThere) {
  ASSERT_EQ(run("").code, 0);
  folder_.write("out/residual.csv", "mine");
  EXPECT_EQ(run("--save csv").code, 5);
  EXPECT_EQ(safety::bytes(out() / "residual.csv"), "mine");
}

TEST_F(Save, EveryCaseOfAComparisonIsSavedAlike) {
  ASSERT_EQ(safety::run(
                fmt::format("compare {} --out {} --save ply,npz", scene_.string(), out().string()))
                .code,
            0);
  for (const char* name : {"error_free", "uncompensated"})
    for (const auto& [ending, there] :
         std::map<std::string, bool>{{"ply", true}, {"npz", true}, {"vtp", false}, {"csv", false}})
      EXPECT_EQ(fs::exists(out() / name / ("residual." + ending)), there) << name << ending;
}

}  // namespace
}  // namespace abbe::sim
