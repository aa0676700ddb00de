#include "cutting/part/mesh.h"
#include "cutting/part/design_points.h"
#include "cutting/part/primitive.h"
#include "cutting/part/read_mesh.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

const fs::path corpus = fs::path(ABBE_SOURCE_DIR) / "tests/corpus/mesh";
const fs::path parts = fs::path(ABBE_SOURCE_DIR) / "scenes/parts";

std::string refusal(const fs::path& file, const ReadMeshOptions& options = {}) {
  return thrown_text<BadInput>([&] { read_mesh(file, options); }, "accepted");
}

fs::path written(const std::string& name, const std::string& bytes) {
  const fs::path file =
      fs::path(testing::TempDir()) / ("abbe_mesh_test_" + std::to_string(::getpid()) + "_" + name);
  std::ofstream(file, std::ios::binary) << bytes;
  return file;
}

std::string bytes_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST(ReadMesh, EveryGoodFileGivesTheSameTetrahedron) {
  int files = 0;
  for (const auto& entry : fs::directory_iterator(corpus)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("good", 0) != 0) continue;
    SCOPED_TRACE(name);
    ++files;
    const Design design = read_mesh(entry.path());
    ASSERT_EQ(design.vertices.rows(), 4);
    ASSERT_EQ(design.triangles.rows(), 4);
    // three right triangles of 50 mm^2 and one equilateral of side 10 sqrt 2
    EXPECT_NEAR(design.area.sum(), 150.0 + 50.0 * std::sqrt(3.0), 1e-12);
    for (int i = 0; i < 4; ++i) {
      EXPECT_NEAR(design.normals.row(i).norm(), 1.0, 1e-15);
      EXPECT_GT((design.vertices.row(i) - Eigen::RowVector3d(2, 2, 2)).dot(design.normals.row(i)),
                0);
      EXPECT_EQ(design.judged[static_cast<std::size_t>(i)], 1);
    }
  }
  EXPECT_EQ(files, 10);
}

TEST(ReadMesh, EveryBadFileOfTheCorpusIsRefusedForItsReason) {
  const std::map<std::string, std::string> reasons = {
      {"truncated_ascii.stl", ":15:1: expected 'endfacet', seen 'endfa'"},
      {"truncated_binary.stl", "(284 bytes for n = 4 in its header), seen 150 bytes"},
      {"truncated.off", ":9:8: expected a number of corners (3 to 1000), seen the end"},
      {"truncated_little.ply",
       "data for all elements listed in the header, seen the end of the file at byte"},
      {"truncated_ascii.ply", "expected a finite number, seen the end"},
      {"truncated.obj", "the number of a vertex"},
      {"empty.stl", "expected a mesh, seen an empty file"},
      {"empty.obj", "expected a mesh, seen an empty file"},
      {"empty.ply", "expected a mesh, seen an empty file"},
      {"empty.off", "expected a mesh, seen an empty file"},
      {"random.stl", "84 + 50 n bytes"},
      {"random.obj", "expected an OBJ keyword"},
      {"random.ply", ":1:1: expected 'ply'"},
      {"random.off", ":1:2: expected 'OFF'"},
      {"nan_ascii.stl", ":5:12: expected a finite number, seen 'nan'"},
      {"nan_binary.stl", "finite numbers, seen nan in facet 1"},
      {"nan.off", ":6:3: expected a finite number, seen 'nan'"},
      {"nan.obj", ":3:5: expected a finite number, seen 'nan'"},
      {"nan_ascii.ply", ":13:3: expected a finite number, seen 'nan'"},
      {"nan_little.ply", "finite numbers, seen nan"},
      {"open.stl", "3 open edges"},
      {"open.obj", "3 open edges"},
      {"open.ply", "3 open edges"},
      {"open.off", "3 open edges"},
      {"flipped.stl", "an inside-out mesh, volume -166.667"},
      {"flipped.obj", "an inside-out mesh, volume -166.667"},
      {"flipped.ply", "an inside-out mesh, volume -166.667"},
      {"flipped.off", "an inside-out mesh, volume -166.667"},
      {"flipped_shell.off", "an inside-out shell between (30, 0, 0) and (40, 10, 10)"},
      {"disagree.off", "two that are opposed at edge"},
      {"nonmanifold_edge.stl", "4 at edge (0, 0, 0) - (0, 0, 10): not manifold"},
      {"nonmanifold_edge.obj", "4 at edge (0, 0, 0) - (0, 0, 10): not manifold"},
      {"nonmanifold_edge.ply", "4 at edge (0, 0, 0) - (0, 0, 10): not manifold"},
      {"nonmanifold_edge.off", "4 at edge (0, 0, 0) - (0, 0, 10): not manifold"},
      {"nonmanifold_vertex.stl", "two fans that touch at (0, 0, 0): not manifold"},
      {"nonmanifold_vertex.obj", "two fans that touch at (0, 0, 0): not manifold"},
      {"nonmanifold_vertex.ply", "two fans that touch at (0, 0, 0): not manifold"},
      {"nonmanifold_vertex.off", "two fans that touch at (0, 0, 0): not manifold"},
      {"degenerate.stl", "triangle 5 at"},
      {"degenerate.obj", ":9:1: expected triangles with an area"},
      {"lying.ply", ":4:16: expected a count that fits the size of the file"},
      {"lying.off", ":3:3: expected a number of faces that fits the file size"},
      {"lying.stl", "(200000000084 bytes for n = 4000000000 in its header), seen 284 bytes"},
      {"index.obj", ":9:7: expected the number of a vertex"},
      {"index.off", ":8:7: expected a vertex index (0 to 3)"},
      {"index.ply", "a vertex index (0 to 3), seen -1"},
      {"quad.obj", "4 open edges"},
      {"crossed.obj", ":5:1: expected a face whose outline does not cross itself"},
      {"nul.obj", ":2:3: expected a finite number, seen '10\\x00'"},
      {"huge.obj", ":2:3: expected a finite number, seen '1e400'"},
  };
  std::set<std::string> files;
  for (const auto& entry : fs::directory_iterator(corpus)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("good", 0) == 0) continue;
    files.insert(name);
    const auto reason = reasons.find(name);
    ASSERT_NE(reason, reasons.end()) << name << " has no reason in this test";
    const std::string seen = refusal(entry.path());
    EXPECT_HAS(seen, reason->second) << name;
    std::cout << name << ": " << seen.substr(seen.find(name) + name.size()) << "\n";
  }
  EXPECT_EQ(files.size(), reasons.size());
}

TEST(ReadMesh, AnyCutOfAGoodFileIsRefusedOrIsTheWholeMesh) {
  // a cut through trailing blanks or the name of an STL loses nothing; every other must be seen
  for (const char* name : {"good_ascii.stl", "good_binary.stl", "good.off", "good.obj",
                           "good_ascii.ply", "good_little.ply", "good_big.ply"}) {
    const std::string whole = bytes_of(corpus / name);
    int accepted = 0;
    for (std::size_t size = 0; size < whole.size(); ++size) {
      const std::string seen = refusal(written(name, whole.substr(0, size)));
      if (seen != "accepted") continue;
      ++accepted;
      EXPECT_EQ(read_mesh(written(name, whole.substr(0, size))).triangles.rows(), 4);
      EXPECT_GE(size + 8, whole.size()) << name << " cut to " << size;
    }
    std::cout << name << ": " << whole.size() << " cuts, " << accepted << " lose nothing\n";
  }
}

TEST(ReadMesh, AnySpoiltByteIsRefusedOrGivesASoundMesh) {
  for (const char* name : {"good_ascii.stl", "good_binary.stl", "good.off", "good.obj",
                           "good_ascii.ply", "good_little.ply", "good_big.ply"}) {
    const std::string whole = bytes_of(corpus / name);
    int refused = 0, accepted = 0;
    const std::string spoils{'\0', '\xff', '9', '-', ' '};
    for (std::size_t at = 0; at < whole.size(); ++at) {
      std::string bytes = whole;
      bytes[at] = spoils[at % spoils.size()];
      const fs::path file = written(name, bytes);
      if (refusal(file) != "accepted") {
        ++refused;
        continue;
      }
      ++accepted;
      const Design design = read_mesh(file);
      EXPECT_TRUE(design.vertices.allFinite() && design.normals.allFinite());
      EXPECT_EQ(design.triangles.rows(), 4);
    }
    std::cout << name << ": " << refused << " refused, " << accepted << " sound\n";
    EXPECT_GT(refused, 0);
  }
}

TEST(ReadMesh, TheOrderOfTrianglesDoesNotMatter) {
  SeededRandom random(3);
  const Design cap = tessellate(SphereCap{50.0, 30.0}, {5000});
  std::vector<int> order(static_cast<std::size_t>(cap.triangles.rows()));
  std::iota(order.begin(), order.end(), 0);
  for (int round = 0; round < 3; ++round) {
    std::shuffle(order.begin(), order.end(), random);
    std::string text;
    for (Index i = 0; i < cap.vertices.rows(); ++i)
      text += "v " + std::to_string(cap.vertices(i, 0)) + " " + std::to_string(cap.vertices(i, 1)) +
              " " + std::to_string(cap.vertices(i, 2)) + "\n";
    for (const int t : order)
      text += "f " + std::to_string(cap.triangles(t, 0) + 1) + " " +
              std::to_string(cap.triangles(t, 1) + 1) + " " +
              std::to_string(cap.triangles(t, 2) + 1) + "\n";
    ReadMeshOptions options;
    options.open = true;
    EXPECT_EQ(refusal(written("shuffled.obj", text), options), "accepted") << round;
  }
}

TEST(ReadMesh, OpenSurfacesPassIfTheySayThatTheyAre) {
  ReadMeshOptions options;
  options.open = true;
  for (const char* name : {"open.stl", "open.obj", "open.ply", "open.off"})
    EXPECT_EQ(read_mesh(corpus / name, options).triangles.rows(), 3) << name;
}

/// The tetrahedron of the corpus, every triangle with corners of its own, as many programs write
/// it.
const std::vector<Vector3d> unshared_corners = {{0, 0, 0},  {0, 10, 0}, {10, 0, 0}, {0, 0, 0},
                                                {10, 0, 0}, {0, 0, 10}, {10, 0, 0}, {0, 10, 0},
                                                {0, 0, 10}, {0, 0, 0},  {0, 0, 10}, {0, 10, 0}};

std::string unshared_obj() {
  std::string text;
  for (const Vector3d& p : unshared_corners)
    text += fmt::format("v {} {} {}\n", p.x(), p.y(), p.z());
  for (int t = 0; t < 4; ++t) text += fmt::format("f {} {} {}\n", 3 * t + 1, 3 * t + 2, 3 * t + 3);
  return text;
}

/// Points and triangles as OFF and ascii PLY have them.
std::string unshared_lists() {
  std::string text;
  for (const Vector3d& p : unshared_corners) text += fmt::format("{} {} {}\n", p.x(), p.y(), p.z());
  for (int t = 0; t < 4; ++t) text += fmt::format("3 {} {} {}\n", 3 * t, 3 * t + 1, 3 * t + 2);
  return text;
}

/// Only STL was: the others had a normal a face at each corner, and an open edge all round.
TEST(ReadMesh, EqualPointsAreOneVertexInEveryFormat) {
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 12\nproperty float x\nproperty float y\n"
      "property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n";
  const Design shared = read_mesh(corpus / "good.off");
  for (const fs::path& file : {written("unshared.obj", unshared_obj()),
                               written("unshared.off", "OFF\n12 4 0\n" + unshared_lists()),
                               written("unshared.ply", ply + unshared_lists())}) {
    ASSERT_EQ(refusal(file), "accepted");
    const Design design = read_mesh(file);
    ASSERT_EQ(design.vertices.rows(), 4) << file;
    EXPECT_NEAR(design.area.sum(), shared.area.sum(), 1e-12) << file;
    EXPECT_LT((design.normals.row(0) - Eigen::RowVector3d(-1, -1, -1).normalized()).norm(), 1e-12)
        << file;
  }
}

TEST(ReadMesh, BodiesThatTouchAndAreClosedKeepTheirOwnPoints) {
  const std::string one =
      "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
  const std::string beside =  // on its edge from (10, 0, 0) to (0, 10, 0), and beyond it
      "v 10 0 0\nv 20 10 0\nv 0 10 0\nv 10 10 10\nf 5 7 6\nf 5 6 8\nf 6 7 8\nf 5 8 7\n";
  const fs::path file = written("touching.obj", one + beside);
  ASSERT_EQ(refusal(file), "accepted");
  EXPECT_EQ(read_mesh(file).vertices.rows(), 8);
}

/// Open, they were accepted, every normal that of one face.
TEST(ReadMesh, NormalsOfAnOpenRoofAreMeansOfItsFacesWithUnsharedCornersToo) {
  ReadMeshOptions options;
  options.open = true;
  const Design roof = read_mesh(
      written("roof.obj",
              "v 0 0 0\nv 10 0 0\nv 10 10 3\nv 0 10 3\nv 0 10 3\nv 10 10 3\nv 10 20 0\nv 0 20 0\n"
              "f 1 2 3 4\nf 5 6 7 8\n"),
      options);
  ASSERT_EQ(roof.vertices.rows(), 6);
  for (Index i = 0; i < 6; ++i) {
    if (roof.vertices(i, 2) != 3.0) continue;
    EXPECT_NEAR(roof.normals(i, 1), 0.0, 0.15) << "on the ridge";
    EXPECT_GT(roof.normals(i, 2), 0.98);
  }
}

TEST(ReadMesh, RepeatedCornersOfAFaceAreDroppedAndAFaceOfTwoIsCalledDegenerate) {
  const std::string points = "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nv 10 0 0\n";
  const std::string rest = "f 1 2 4 4\nf 2 5 3 4\nf 1 4 3 1\n";
  const fs::path good = written("repeated.obj", points + "f 1 3 3 2\n" + rest);
  ASSERT_EQ(refusal(good), "accepted");
  EXPECT_EQ(read_mesh(good).triangles.rows(), 4);
  EXPECT_EQ(read_mesh(good).vertices.rows(), 4);
  const std::string seen = refusal(written("two.obj", points + "f 1 3 2\n" + rest + "f 1 1 2 5\n"));
  EXPECT_HAS(seen,
             ":10:1: expected faces with an area above 0, seen a degenerate face, 4 corners at 2 "
             "points, one of them (0, 0, 0)");
}

TEST(ReadMesh, LimitsOfSizeAreHeldBeforeReading) {
  ReadMeshOptions options;
  options.max_triangles = 3;
  for (const char* name :
       {"good_ascii.stl", "good_binary.stl", "good.off", "good.obj", "good_little.ply"})
    EXPECT_HAS(refusal(corpus / name, options), "at most 3 triangles, seen 4") << name;
  options = {};
  options.max_bytes = 10;
  EXPECT_HAS(refusal(corpus / "good.off", options), "at most 10 bytes");
}

TEST(ReadMesh, DataThatIsNotNeededIsPassedOver) {
  // a cube of 10 mm
  const std::array<std::array<int, 3>, 8> at = {{{0, 0, 0},
                                                 {10, 0, 0},
                                                 {10, 10, 0},
                                                 {0, 10, 0},
                                                 {0, 0, 10},
                                                 {10, 0, 10},
                                                 {10, 10, 10},
                                                 {0, 10, 10}}};
  const std::array<std::array<int, 3>, 12> faces = {{{0, 2, 1},
                                                     {0, 3, 2},
                                                     {4, 5, 6},
                                                     {4, 6, 7},
                                                     {0, 1, 5},
                                                     {0, 5, 4},
                                                     {1, 2, 6},
                                                     {1, 6, 5},
                                                     {2, 3, 7},
                                                     {2, 7, 6},
                                                     {3, 0, 4},
                                                     {3, 4, 7}}};
  std::string header =
      "ply\nformat FORMAT 1.0\nelement material 2\nproperty list uchar uchar name\n"
      "property float shininess\nelement vertex 8\nproperty float x\nproperty float y\n"
      "property list uchar double uv\nproperty float quality\nproperty float z\n"
      "element face 12\nproperty uchar material_index\nproperty list ushort uint vertex_indices\n"
      "property list uchar float texcoord\nelement edge 1\nproperty int vertex1\n"
      "property list int int path\nend_header\n";
  std::string ascii = "3 1 2 3 0.5\n0 nan\n", little = ascii;
  little.clear();
  const auto put = [&](auto value) {
    little.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  for (const int c : {3, 1, 2, 3}) put(std::uint8_t(c));
  put(0.5f);
  put(std::uint8_t(0));
  put(std::numeric_limits<float>::quiet_NaN());
  for (const auto& p : at) {
    ascii += fmt::format("{} {} 2 0.5 inf nan {}\n", p[0], p[1], p[2]);
    put(float(p[0]));
    put(float(p[1]));
    put(std::uint8_t(2));
    put(0.5);
    put(1.0);
    put(std::numeric_limits<float>::quiet_NaN());
    put(float(p[2]));
  }
  for (const auto& f : faces) {
    ascii += fmt::format("7 3 {} {} {} 6 0 0 nan 0 0 1\n", f[0], f[1], f[2]);
    put(std::uint8_t(7));
    put(std::uint16_t(3));
    for (const int corner : f) put(std::uint32_t(corner));
    put(std::uint8_t(6));
    for (int k = 0; k < 6; ++k) put(0.0f);
  }
  ascii += "0 2 5 6\n";
  for (const int c : {0, 2, 5, 6}) put(std::int32_t(c));
  const auto with = [&](const std::string& form) {
    std::string text = header;
    return text.replace(text.find("FORMAT"), 6, form);
  };
  std::string obj = "mg 1 0.5\nbevel on\nlod 3\nvp 0.1 0.2\nvt 0 0 0\nvn nan 0 1\n";
  std::string off = "STCNOFF\n8 12 0\n", stl = "solid cube\n";
  for (const auto& p : at) {
    obj += fmt::format("v {} {} {} 0.5 0.5 0.5\n", p[0], p[1], p[2]);
    off += fmt::format("{} {} {} 0 0 nan 1 0 0 1 0.5 0.5\n", p[0], p[1], p[2]);
  }
  for (const auto& f : faces) {
    obj += fmt::format("g a b\ns 1\nusemtl none\nf {0}/1/1 {1}/1/1 {2}/1/1\n", f[0] + 1, f[1] + 1,
                       f[2] + 1);
    off += fmt::format("3 {} {} {} 4 5\n", f[0], f[1], f[2]);
    stl += "facet normal nan -nan(ind) nan\nouter loop\n";
    for (const int corner : f) {
      const auto& p = at[std::size_t(corner)];
      stl += fmt::format("vertex {} {} {}\n", p[0], p[1], p[2]);
    }
    stl += "endloop\nendfacet\n";
  }
  for (const auto& [name, bytes] : std::map<std::string, std::string>{
           {"more_ascii.ply", with("ascii") + ascii},
           {"more_little.ply", with("binary_little_endian") + little},
           {"more.obj", obj},
           {"more.off", off},
           {"more.stl", stl + "endsolid cube\n"}}) {
    SCOPED_TRACE(name);
    const fs::path file = written(name, bytes);
    ASSERT_EQ(refusal(file), "accepted");
    EXPECT_NEAR(read_mesh(file).area.sum(), 600.0, 1e-9);
  }
  std::string short_list = with("binary_little_endian") + little;
  short_list.resize(short_list.size() - 4);
  EXPECT_HAS(refusal(written("short.ply", short_list)), "data for all elements");
}

TEST(ReadMesh, WhatIsNoMeshFileIsRefused) {
  EXPECT_HAS(refusal(corpus / "nowhere.stl"), "no such file");
  EXPECT_HAS(refusal(corpus), "something that is not a file");
  EXPECT_HAS(refusal("/dev/zero"), "something that is not a file");
  EXPECT_HAS(refusal(written("part.step", "ISO-10303-21;")), ".stl, .obj, .ply or .off");
  ReadMeshOptions options;
  options.unit_mm = 0.0;
  EXPECT_THROW(read_mesh(corpus / "good.off", options), std::invalid_argument);
}

TEST(ReadMesh, DigitsBeyondFloatAreKept) {
  const fs::path file = written("digits.obj",
                                "v 0.1234567890123456 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nf 1 3 "
                                "2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  EXPECT_EQ(read_mesh(file).vertices(0, 0), 0.1234567890123456);
}

TEST(ReadMesh, OnlyAPartThatCannotLieOnTheMachineIsRefusedForItsSize) {
  // the free-form block of 60 mm, written in inches, metres and so on, on a machine of 600 mm
  // travel
  const Design part = read_mesh(parts / "freeform.stl");
  const auto obj = [&](double unit) {
    std::string text;
    for (Index i = 0; i < part.vertices.rows(); ++i)
      text += "v " + std::to_string(part.vertices(i, 0) / unit) + " " +
              std::to_string(part.vertices(i, 1) / unit) + " " +
              std::to_string(part.vertices(i, 2) / unit) + "\n";
    for (Index t = 0; t < part.triangles.rows(); ++t)
      text += "f " + std::to_string(part.triangles(t, 0) + 1) + " " +
              std::to_string(part.triangles(t, 1) + 1) + " " +
              std::to_string(part.triangles(t, 2) + 1) + "\n";
    return text;
  };
  ReadMeshOptions options;
  options.travel = Vector3d(600, 500, 400);
  const std::string micrometre = refusal(written("um.obj", obj(1e-3)), options);
  std::cout << micrometre << "\n";
  EXPECT_HAS(micrometre,
             "expected a part of at most 1200 mm, 2 times the travel of 600 mm (set "
             "the unit of the mesh), seen 6e+04 x");
  EXPECT_HAS(micrometre, "mm: read in um it would be 60 mm long");
  // 2.4 mm, 0.06 mm, 600 mm and 1200 mm can lie there
  for (const double unit : {25.4, 1000.0, 0.1, 0.05})
    EXPECT_EQ(refusal(written("other.obj", obj(unit)), options), "accepted") << unit;
  EXPECT_NE(refusal(written("other.obj", obj(0.0499)), options), "accepted");
  EXPECT_EQ(refusal(parts / "freeform.stl", options), "accepted");

  options.unit_mm = 25.4;
  const Design read = read_mesh(written("inch.obj", obj(25.4)), options);
  EXPECT_LT((read.vertices - part.vertices).cwiseAbs().maxCoeff(), 25.4 * 0.5e-6 + 1e-12);
}

// --- the audited mesh ---------------------------------------------------------------------------

double top(double x, double y) {
  return 10 + 2.4 * std::sin(x / 9 + 0.3) * std::cos(y / 11) + 0.8 * std::cos(x / 17 - y / 8);
}

Vector3d top_normal(double x, double y) {
  const double dx =
      2.4 / 9 * std::cos(x / 9 + 0.3) * std::cos(y / 11) - 0.8 / 17 * std::sin(x / 17 - y / 8);
  const double dy =
      -2.4 / 11 * std::sin(x / 9 + 0.3) * std::sin(y / 11) + 0.8 / 8 * std::sin(x / 17 - y / 8);
  return Vector3d(-dx, -dy, 1.0).normalized();
}

TEST(ReadMesh, TheFreeFormBlockIsTheSurfaceOfItsSource) {
  const Design part = read_mesh(parts / "freeform.stl");
  EXPECT_EQ(part.triangles.rows(), 30240);
  const Design judged = judge_top(part, {0.5, 1.0});
  double height = 0.0, tilt = 0.0, sag = 0.0;
  int count = 0;
  for (Index i = 0; i < part.vertices.rows(); ++i) {
    if (!judged.judged[static_cast<std::size_t>(i)]) continue;
    ++count;
    const double x = part.vertices(i, 0), y = part.vertices(i, 1);
    height = std::max(height, std::abs(part.vertices(i, 2) - top(x, y)));
    const Vector3d n = part.normals.row(i);
    tilt = std::max(tilt, n.cross(top_normal(x, y)).norm());
    sag = std::max(sag, part.facet_error[i]);
    EXPECT_LT(std::max(std::abs(x), std::abs(y)), 29.0);
  }
  std::cout << count << " judged vertices, height within " << height * 1e6 << " nm, normals within "
            << tilt * 1e6 << " urad, facet error to " << sag * 1e3 << " um\n";
  EXPECT_GT(count, 12000);
  EXPECT_LT(height, 1e-6);  // mm: the rounding of a binary STL at 13 mm
  EXPECT_LT(tilt, 1.2e-3);
  EXPECT_LT(sag, 5e-3);
}

TEST(JudgeTop, LeavesOutWallsRimAndMargin) {
  const Design part = read_mesh(parts / "freeform.stl");
  for (const double margin : {0.0, 0.1, 0.7, 5.0, 29.0}) {
    const Design judged = judge_top(part, {0.5, margin});
    int wrong = 0, count = 0;
    for (Index i = 0; i < part.vertices.rows(); ++i) {
      const Vector3d p = part.vertices.row(i);
      const double plan = 30.0 - std::max(std::abs(p.x()), std::abs(p.y()));
      const bool is = judged.judged[static_cast<std::size_t>(i)] != 0;
      count += is;
      // the rim is a curve in space, so the distance to it is at least the one in plan
      if (plan < 1e-5 || p.z() < 1.0) wrong += is;
      if (plan > margin + 1e-5 && p.z() > 1.0) wrong += !is;
      if (plan < 0.9 * margin && std::abs(p.x()) < 20 && p.z() > 1.0) wrong += is;
    }
    EXPECT_EQ(wrong, 0) << "margin " << margin;
    EXPECT_GT(count, 0);
  }
  EXPECT_THROW(judge_top(part, {0.5, -1.0}), std::invalid_argument);
}

TEST(FacetError, IsTheSagOfTheEdgesOfASphere) {
  const double R = 50.0;
  const Design cap = tessellate(SphereCap{R, 30.0}, {5000});
  const VectorXd estimated = facet_error(cap.vertices, cap.normals, cap.triangles);
  VectorXd sag = VectorXd::Zero(cap.vertices.rows());
  for (Index t = 0; t < cap.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int a = cap.triangles(t, k), b = cap.triangles(t, (k + 1) % 3);
      const Vector3d middle = 0.5 * (cap.vertices.row(a) + cap.vertices.row(b)).transpose();
      const double here = R - (middle - Vector3d(0, 0, -R)).norm();
      sag[a] = std::max(sag[a], here);
      sag[b] = std::max(sag[b], here);
    }
  const double worst = ((estimated - sag).cwiseQuotient(sag)).cwiseAbs().maxCoeff();
  std::cout << "facet error against true sag: " << worst * 100 << " %\n";
  EXPECT_LT(worst, 1e-3);
}

TEST(Transformed, TurnsNormalsAndMovesPoints) {
  const Design disc = tessellate(Disc{10.0, 0.0}, {200});
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(0.3, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  T.translation() = Vector3d(4, 5, 6);
  const Design moved = transformed(disc, T);
  for (Index i = 0; i < disc.vertices.rows(); ++i) {
    EXPECT_LT((moved.vertices.row(i).transpose() - T * disc.vertices.row(i).transpose()).norm(),
              1e-14);
    EXPECT_LT(
        (moved.normals.row(i).transpose() - T.linear() * disc.normals.row(i).transpose()).norm(),
        1e-15);
  }
  EXPECT_EQ(moved.area, disc.area);
}

struct Deviations {
  double height = 0.0, flat = 0.0, tilt = 0.0;
};

/// How far the contacts of a mesh leave a true surface, and how far its flat triangles do.
template <class Truth>
Deviations against(const MeshHeightMap& mesh, const Truth& truth, double reach) {
  SeededRandom random(7);
  std::uniform_real_distribution<double> in(-reach, reach);
  // flat: the same mesh with every normal that of the triangle is what a sharp edge gets
  Design bare = mesh.design();
  for (Index i = 0; i < bare.normals.rows(); ++i) bare.normals.row(i) = Eigen::RowVector3d(1, 0, 0);
  const MeshHeightMap flat(bare);
  Deviations d;
  for (int i = 0; i < 20000; ++i) {
    const double x = in(random), y = in(random);
    const Contact expected = truth(x, y);
    const auto smooth = highest_surface_point(mesh, x, y);
    const auto facet = highest_surface_point(flat, x, y);
    EXPECT_TRUE(smooth && facet);
    if (!smooth || !facet) return d;
    EXPECT_EQ(smooth->point.x(), x);
    EXPECT_EQ(smooth->point.y(), y);
    d.height = std::max(d.height, std::abs(smooth->point.z() - expected.point.z()));
    d.flat = std::max(d.flat, std::abs(facet->point.z() - expected.point.z()));
    d.tilt = std::max(d.tilt, smooth->normal.cross(expected.normal).norm());
  }
  return d;
}

TEST(MeshHeightMap, AQuadraticSurfaceWithExactNormalsIsReproduced) {
  // a paraboloid over an irregular sheet; rounding alone is left
  Design sheet = tessellate(RectanglePlane{20, 20}, {500});
  const auto truth = [](double x, double y) {
    return Contact{Vector3d(x, y, 0.02 * x * x - 0.03 * x * y + 0.01 * y * y),
                   Vector3d(-0.04 * x + 0.03 * y, 0.03 * x - 0.02 * y, 1).normalized()};
  };
  for (Index i = 0; i < sheet.vertices.rows(); ++i) {
    const Contact c = truth(sheet.vertices(i, 0), sheet.vertices(i, 1));
    sheet.vertices.row(i) = c.point;
    sheet.normals.row(i) = c.normal;
  }
  const Deviations d = against(MeshHeightMap(sheet), truth, 10.0);
  std::cout << "paraboloid: " << d.height << " mm (flat triangles " << d.flat << "), " << d.tilt
            << " rad\n";
  EXPECT_LT(d.height, 1e-13);
  EXPECT_LT(d.tilt, 1e-13);
  EXPECT_GT(d.flat, 1e-3);
}

TEST(MeshHeightMap, ADomeIsMetBetterThanItsFacets) {
  const SphereCap cap{50.0, 30.0};
  const MeshHeightMap mesh(tessellate(cap, {20000}));
  const auto truth = [&](double x, double y) { return *highest_surface_point(cap, x, y); };
  const Deviations d = against(mesh, truth, 20.0);
  std::cout << "dome: " << d.height * 1e6 << " nm (flat " << d.flat * 1e6 << " nm), "
            << d.tilt * 1e6 << " urad\n";
  EXPECT_LT(d.height, 0.02 * d.flat);
}

TEST(MeshHeightMap, TheFreeFormBlockIsMetBetterThanItsFacets) {
  const MeshHeightMap mesh(read_mesh(std::string(ABBE_SOURCE_DIR) + "/scenes/parts/freeform.stl"));
  const auto truth = [](double x, double y) {
    const double dx =
        2.4 / 9 * std::cos(x / 9 + 0.3) * std::cos(y / 11) - 0.8 / 17 * std::sin(x / 17 - y / 8);
    const double dy =
        -2.4 / 11 * std::sin(x / 9 + 0.3) * std::sin(y / 11) + 0.8 / 8 * std::sin(x / 17 - y / 8);
    const double z =
        10 + 2.4 * std::sin(x / 9 + 0.3) * std::cos(y / 11) + 0.8 * std::cos(x / 17 - y / 8);
    return Contact{Vector3d(x, y, z), Vector3d(-dx, -dy, 1).normalized()};
  };
  const Deviations d = against(mesh, truth, 29.0);
  std::cout << "free form: " << d.height * 1e6 << " nm (flat " << d.flat * 1e6 << " nm), "
            << d.tilt * 1e6 << " urad\n";
  EXPECT_LT(d.height, 0.2 * d.flat);
  EXPECT_FALSE(highest_surface_point(mesh, 30.5, 0.0));
  EXPECT_FALSE(highest_surface_point(mesh, 0.0, NAN));
  EXPECT_TRUE(highest_surface_point(mesh, 30.0 - 1e-5, 30.0 - 1e-5));
}

TEST(MeshHeightMap, TheHighestOfSeveralSheetsIsTaken) {
  Design low = tessellate(RectanglePlane{10, 10}, {100});
  Design both = low;
  const auto n = low.vertices.rows(), m = low.triangles.rows();
  both.vertices.resize(2 * n, 3);
  both.normals.resize(2 * n, 3);
  both.triangles.resize(2 * m, 3);
  both.vertices << low.vertices, low.vertices.rowwise() + Eigen::RowVector3d(3, 0, 2);
  both.normals << low.normals, low.normals;
  both.triangles << low.triangles, (low.triangles.array() + static_cast<int>(n)).matrix();
  const MeshHeightMap mesh(both);
  EXPECT_EQ(highest_surface_point(mesh, -4.0, 1.0)->point.z(), 0.0);
  EXPECT_EQ(highest_surface_point(mesh, 1.0, 1.0)->point.z(), 2.0);
  EXPECT_EQ(highest_surface_point(mesh, 7.0, 1.0)->point.z(), 2.0);
  EXPECT_FALSE(highest_surface_point(mesh, 8.1, 1.0));
}

TEST(MeshHeightMap, NothingIsAboveAWallOrAnEmptyMesh) {
  EXPECT_FALSE(highest_surface_point(MeshHeightMap(Design{}), 0, 0));
  EXPECT_FALSE(highest_surface_point(MeshHeightMap(tessellate(Cylinder{10, 5}, {200})), 10, 0));
}

}  // namespace
}  // namespace abbe::cutting
