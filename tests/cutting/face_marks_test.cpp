// What mesh files say of their faces: groups and colours, how they are read and what keeps them.

#include "cutting/map/areal_filter.h"
#include "cutting/map/refinement.h"
#include "cutting/part/mesh.h"
#include "cutting/part/primitive.h"
#include "cutting/part/read_mesh.h"
#include "cutting/part/remeshing.h"
#include "cutting/part/text_mesh_formats.h"
#include "tests/cutting/milled_parts.h"
#include "tests/cutting/random.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

class MarkFolder {
 public:
  MarkFolder()
      : path_(fs::path(testing::TempDir()) / fmt::format("abbe_face_marks_{}", ::getpid())) {
    fs::create_directories(path_);
  }
  ~MarkFolder() { fs::remove_all(path_); }
  fs::path write(const std::string& name, const std::string& bytes) const {
    std::ofstream(path_ / name, std::ios::binary) << bytes;
    return path_ / name;
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

constexpr MarkSelection all_marks{true, true};

/// A block of 2 x 3 x 5, so that the three pairs of its faces have areas of their own.
constexpr std::array<double, 3> block_size = {2.0, 3.0, 5.0};
const std::array<Vector3d, 8> block_corners = {Vector3d(0, 0, 0), {2, 0, 0}, {2, 3, 0}, {0, 3, 0},
                                               {0, 0, 5},         {2, 0, 5}, {2, 3, 5}, {0, 3, 5}};
struct BlockFace {
  std::string name;
  std::array<int, 4> corners;
  Rgb colour;
  double area;
};
const std::array<BlockFace, 6> block_faces = {BlockFace{"bottom", {0, 3, 2, 1}, {255, 0, 0}, 6.0},
                                              {"top", {4, 5, 6, 7}, {0, 128, 0}, 6.0},
                                              {"front", {0, 1, 5, 4}, {10, 20, 30}, 10.0},
                                              {"back", {2, 3, 7, 6}, {1, 2, 3}, 10.0},
                                              {"left", {3, 0, 4, 7}, {254, 253, 7}, 15.0},
                                              {"right", {1, 2, 6, 5}, {100, 0, 200}, 15.0}};

std::string point_text(const Vector3d& p) { return fmt::format("{} {} {}", p.x(), p.y(), p.z()); }

double area_of(const Design& design, Index t) {
  const Vector3d a = design.vertices.row(design.triangles(t, 0)),
                 b = design.vertices.row(design.triangles(t, 1)),
                 c = design.vertices.row(design.triangles(t, 2));
  return 0.5 * (b - a).cross(c - a).norm();
}

/// mm^2 of the triangles by their names; "" of those without one.
std::map<std::string, double> areas_by_name(const MarkedMesh& mesh) {
  std::map<std::string, double> areas;
  for (Index t = 0; t < mesh.design.triangles.rows(); ++t) {
    const FaceMark& mark = mesh.marks.marks[std::size_t(mesh.marks.mark_of_face[std::size_t(t)])];
    std::set<std::string> names;  // of OBJ one name may come of two keywords
    for (const int set : mark.name_set_indices)
      names.insert(mesh.marks.name_sets[std::size_t(set)].begin(),
                   mesh.marks.name_sets[std::size_t(set)].end());
    if (names.empty()) names.insert("");
    for (const std::string& name : names) areas[name] += area_of(mesh.design, t);
  }
  return areas;
}

double area_that_may_be(const MarkedMesh& mesh, const Rgb& colour) {
  double area = 0.0;
  for (Index t = 0; t < mesh.design.triangles.rows(); ++t) {
    const auto& own = mesh.marks.marks[std::size_t(mesh.marks.mark_of_face[std::size_t(t)])].colour;
    if (own && can_denote(*own, colour)) area += area_of(mesh.design, t);
  }
  return area;
}

void expect_block_names(const MarkedMesh& mesh, const std::string& suffix = "") {
  std::map<std::string, double> areas = areas_by_name(mesh);
  EXPECT_EQ(areas.size(), 6u);
  for (const BlockFace& face : block_faces)
    EXPECT_NEAR(areas[face.name + suffix], face.area, 1e-12) << face.name;
}

void expect_block_colours(const MarkedMesh& mesh) {
  for (const BlockFace& face : block_faces)
    EXPECT_NEAR(area_that_may_be(mesh, face.colour), face.area, 1e-12) << face.name;
  EXPECT_EQ(area_that_may_be(mesh, {77, 77, 77}), 0.0);
}

std::string refusal_of_marks(const fs::path& file, const MarkSelection& wanted = all_marks) {
  return thrown_text<BadInput>([&] { read_mesh_with_marks(file, {}, wanted); }, "accepted");
}

// --- colours as they are written

TEST(FaceColours, EveryEightBitColourIsFoundHoweverItWasCutOrRounded) {
  int ambiguous = 0;
  for (int v = 0; v < 256; ++v) {
    const auto is = [&](int written, FaceColour::ChannelFormat digits) {
      return can_denote({{written, written, written}, digits}, {v, v, v});
    };
    const int cut = v >> 3, rounded = int(std::lround(v * 31 / 255.0));
    int found = 0;
    for (int c = 0; c < 32; ++c) {
      EXPECT_EQ(is(c, FaceColour::ChannelFormat::FiveBits), c == cut || c == rounded)
          << v << " " << c;
      found += is(c, FaceColour::ChannelFormat::FiveBits);
    }
    ambiguous += found == 2;
    for (int w = 0; w < 256; ++w) EXPECT_EQ(is(w, FaceColour::ChannelFormat::EightBits), v == w);
    for (const int digits : {2, 3, 6}) {  // as writers print v / 255, or v / 256
      for (const double scale : {255.0, 256.0}) {
        if (scale == 256.0 && digits == 2) continue;
        const double power = std::pow(10, digits);
        const double value = std::round(v / scale * power) / power;
        EXPECT_TRUE(is(int(std::lround(255 * value)), FaceColour::ChannelFormat::Fraction))
            << v << " as " << value;
      }
    }
    EXPECT_FALSE(is((v + 3) % 256, FaceColour::ChannelFormat::Fraction));
  }
  std::cout << ambiguous << " of 256 channels are two of 5 bits, cut and rounded\n";
}

TEST(FaceColours, TextIsSixDigitsAndNothingElse) {
  EXPECT_EQ(parse_hex_colour("#ff8000"), (Rgb{255, 128, 0}));
  EXPECT_EQ(parse_hex_colour("#Ff80aA"), (Rgb{255, 128, 170}));
  for (const char* text : {"", "#", "ff8000", "#ff800", "#ff80000", "#gg8000", "#+f8000", "#-18000",
                           "# f8000", "#ff80 0", "#0x8000"})
    EXPECT_FALSE(parse_hex_colour(text)) << text;
  for (int v = 0; v < 256; ++v)
    EXPECT_EQ(parse_hex_colour(hex_text({v, 255 - v, v / 2})), (Rgb{v, 255 - v, v / 2}));
}

TEST(FaceColours, FiveBitsAreSpreadOverEight) {
  EXPECT_EQ(to_eight_bits({{0, 16, 31}, FaceColour::ChannelFormat::FiveBits}), (Rgb{0, 132, 255}));
  for (int c = 0; c < 32; ++c)
    EXPECT_TRUE(can_denote({{c, c, c}, FaceColour::ChannelFormat::FiveBits},
                           to_eight_bits({{c, c, c}, FaceColour::ChannelFormat::FiveBits})))
        << "what is listed is what may be asked for";
}

// --- OBJ

std::string block_obj(const std::function<std::string(const BlockFace&)>& before,
                      const std::string& head = "") {
  std::string text = head;
  for (const Vector3d& p : block_corners) text += "v " + point_text(p) + "\n";
  for (const BlockFace& face : block_faces) {
    text += before(face) + "f";
    for (const int corner : face.corners) text += fmt::format(" {}", corner + 1);
    text += "\n";
  }
  return text;
}

std::string block_mtl(const std::string& kd_format = "Kd {:.6f} {:.6f} {:.6f}\n") {
  std::string text = "# made by nobody\n";
  for (const BlockFace& face : block_faces)
    text += "newmtl " + face.name + " paint\nNs 10\nKa 0 0 0\nmap_Kd -s 1 1 1 wood.png\n" +
            fmt::format(fmt::runtime(kd_format), face.colour[0] / 255.0, face.colour[1] / 255.0,
                        face.colour[2] / 255.0) +
            "illum 2\n";
  return text;
}

TEST(FaceMarks, OfAnObjAreItsGroupsObjectsAndMaterials) {
  const MarkFolder folder;
  for (const char* keyword : {"g", "o", "usemtl"})
    expect_block_names(
        read_mesh_with_marks(folder.write("block.obj", block_obj([&](const BlockFace& face) {
                                            return fmt::format("{} {}\n", keyword, face.name);
                                          })),
                             {}, {.groups = true}));
  const MarkedMesh all = read_mesh_with_marks(
      folder.write("all.obj", block_obj(
                                  [&](const BlockFace& face) {
                                    return "g sides " + face.name + "  # a remark\nusemtl " +
                                           face.name + "\n";
                                  },
                                  "o The Block\r\n")),
      {}, {.groups = true});
  std::map<std::string, double> areas = areas_by_name(all);
  EXPECT_NEAR(areas["The Block"], 62.0, 1e-12);
  EXPECT_NEAR(areas["sides"], 62.0, 1e-12);
  EXPECT_NEAR(areas["top"], 6.0, 1e-12);
  EXPECT_NEAR(areas["sides top"], 6.0, 1e-12) << "a name with a blank in it";
  EXPECT_EQ(areas.size(), 14u);
}

TEST(FaceMarks, GroupsThatComeTwiceAreOneAndNamesMayBeInAnyScript) {
  const MarkFolder folder;
  int count = 0;
  const MarkedMesh mesh = read_mesh_with_marks(
      folder.write("names.obj", block_obj([&](const BlockFace&) -> std::string {
                     const char* lines[] = {"",          "g\n",           "g Fläche 上\n",
                                            "g other\n", "g Fläche 上\n", "g #\n"};
                     return lines[count++];
                   })),
      {}, {.groups = true});
  std::map<std::string, double> areas = areas_by_name(mesh);
  EXPECT_NEAR(areas[""], 6.0, 1e-12) << "before any";
  EXPECT_NEAR(areas["default"], 6.0 + 15.0, 1e-12) << "of a g alone";
  EXPECT_NEAR(areas["Fläche 上"], 10.0 + 15.0, 1e-12);
  EXPECT_NEAR(areas["other"], 10.0, 1e-12);
}

TEST(FaceMarks, ColoursOfAnObjAreThoseOfItsLibrary) {
  const MarkFolder folder;
  const auto use = [](const BlockFace& face) { return "usemtl " + face.name + " paint\n"; };
  folder.write("my paints.mtl", block_mtl());
  folder.write("two.mtl", block_mtl("Kd {:.2f} {:.2f} {:.2f}\n"));
  folder.write("none.mtl", "newmtl other\n");
  for (const char* library :
       {"mtllib my paints.mtl\n", "mtllib C:\\models\\my paints.mtl\n", "mtllib ./my paints.mtl\n",
        "mtllib /etc/two.mtl\n", "mtllib none.mtl two.mtl\n", "mtllib two.mtl\nmtllib two.mtl\n"}) {
    SCOPED_TRACE(library);
    const fs::path file = folder.write("block.obj", block_obj(use, library));
    expect_block_colours(read_mesh_with_marks(file, {}, all_marks));
    EXPECT_FALSE(material_files(file).empty());
  }
  const MarkedMesh plain = read_mesh_with_marks(
      folder.write("plain.obj", block_obj([](const BlockFace&) { return ""; })), {}, all_marks);
  EXPECT_EQ(plain.marks.marks.size(), 1u);
  EXPECT_FALSE(plain.marks.marks[0].colour);
}

TEST(FaceMarks, ALibraryThatIsNotOneIsRefusedWithItsPlaceAndOnlyIfItIsAskedFor) {
  const MarkFolder folder;
  const auto use = [](const BlockFace& face) { return "usemtl " + face.name + " paint\n"; };
  const fs::path obj = folder.write("block.obj", block_obj(use, "# a\nmtllib  b.mtl\n"));
  EXPECT_EQ(refusal_of_marks(obj, {.groups = true}), "accepted");
  EXPECT_EQ(refusal_of_marks(obj, {}), "accepted");
  EXPECT_TRUE(material_files(obj).empty());
  const auto refused = [&](const std::string& text) {
    folder.write("b.mtl", text);
    return refusal_of_marks(obj);
  };
  EXPECT_HAS(refusal_of_marks(obj),
             "block.obj:2:9: expected the file b.mtl next to the OBJ "
             "file, for its face colours, seen 'b.mtl'");
  const std::pair<std::string, std::string> cases[] = {
      {"",
       "block.obj:11:8: expected a material of a library (mtllib) named above, seen 'bottom "
       "paint'"},
      {"newmtl a\nKd 1 2 0\n", "b.mtl:2:6: expected a channel from 0 to 1, seen '2'"},
      {"newmtl a\nKd -0.1 0 0\n", "b.mtl:2:4: expected a channel from 0 to 1"},
      {"newmtl a\nKd nan 0 0\n", "b.mtl:2:4: expected a finite number, seen 'nan'"},
      {"newmtl a\nKd 1 1\n", "b.mtl:2:1: expected one or three numbers after the keyword, not 2"},
      {"newmtl a\nKd\n", "b.mtl:2:1: expected one or three numbers after the keyword, not 0"},
      {"newmtl a\nKd 1 1 1 1\n", "b.mtl:2:10: expected the end of the line after three"},
      {"newmtl a\nKd xyz 1 1 1\n", "b.mtl:2:4: expected a colour given as red, green and blue"},
      {"newmtl a\nKd spectral a.rfl\n",
       "b.mtl:2:4: expected a colour given as red, green and blue"},
      {"Kd 1 1 1\n", "b.mtl:1:1: expected newmtl before the colour"},
      {"newmtl a\nKd 1 1 1\nKd 1 0 0\n", "b.mtl:3:1: expected one Kd per material"},
      {"newmtl a\nnewmtl b\nnewmtl a\n",
       "b.mtl:3:8: expected a material name that is not yet used"},
      {"newmtl\n", "b.mtl:1:7: expected a material name after newmtl, seen the end"},
      {"newmtl a\nmtllib b.mtl\n", "b.mtl:2:1: expected an MTL keyword"},
      {std::string("\x7f"
                   "ELF\0\1\2",
                   7),
       "b.mtl:1:1: expected an MTL keyword"},
      {std::string(17 << 20, ' '), "b.mtl: expected at most 16777216 bytes, seen 17825792"}};
  for (const auto& [text, said] : cases) EXPECT_HAS(refused(text), said);
  folder.write("b.mtl", block_mtl());
  folder.write("c.mtl", block_mtl());
  EXPECT_HAS(refusal_of_marks(folder.write("block.obj", block_obj(use, "mtllib b.mtl c.mtl\n"))),
             "block.obj:1:14: expected one library only that defines the material");
  EXPECT_HAS(refusal_of_marks(folder.write("block.obj", block_obj(use))),
             "block.obj:9:8: expected mtllib before usemtl");
  fs::remove(folder.path() / "c.mtl");
  fs::create_directory(folder.path() / "c.mtl");
  EXPECT_HAS(refusal_of_marks(folder.write("block.obj", block_obj(use, "mtllib c.mtl\n"))),
             "expected the file c.mtl next to");
}

TEST(FaceMarks, MoreNamesThanThereMayBeAreRefused) {
  const MarkFolder folder;
  std::string names;
  for (int i = 0; i < 1'000'001; ++i) names += fmt::format(" {:x}", i);
  EXPECT_HAS(refusal_of_marks(folder.write(
                 "many.obj", block_obj([](const BlockFace&) { return ""; }, "g" + names + "\n"))),
             "expected at most 1000000 group names");
}

// --- STL

std::string solid(const std::string& name, const BlockFace& face) {
  std::string text = "solid " + name + "\n";
  for (const auto& [a, b, c] : {std::array{0, 1, 2}, {0, 2, 3}}) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const int k : {a, b, c})
      text +=
          "vertex " + point_text(block_corners[std::size_t(face.corners[std::size_t(k)])]) + "\n";
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid " + name + "\n";
}

TEST(FaceMarks, SolidsOfAnAsciiStlAreGroupsOfOneBody) {
  const MarkFolder folder;
  std::string text;
  for (const BlockFace& face : block_faces) text += solid(face.name + " face", face);
  const fs::path file = folder.write("solids.stl", text);
  const MarkedMesh mesh = read_mesh_with_marks(file, {}, all_marks);
  EXPECT_EQ(mesh.design.vertices.rows(), 8);
  expect_block_names(mesh, " face");
  EXPECT_EQ(read_mesh(file).triangles.rows(), 12) << "whether groups are asked for or not";
  EXPECT_HAS(refusal_of_marks(folder.write("junk.stl", text + "solid\nfacets\n")),
             ":98:1: expected 'facet' or 'endsolid', seen 'facets'");
  EXPECT_HAS(refusal_of_marks(folder.write("junk.stl", text + "and more\n")),
             ":97:1: expected 'solid', seen 'and'");
  EXPECT_HAS(refusal_of_marks(folder.write("open.stl", text + "solid more\n")),
             "expected 'facet' or 'endsolid', seen the end");
}

std::string little(std::uint64_t value, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += char(value >> (8 * i) & 0xff);
  return text;
}

std::string float_bytes(double value) {
  return little(std::bit_cast<std::uint32_t>(float(value)), 4);
}

std::string block_stl(std::string header,
                      const std::function<unsigned(const BlockFace&)>& attribute) {
  header.resize(80, ' ');
  std::string text = header + little(12, 4);
  for (const BlockFace& face : block_faces)
    for (const auto& [a, b, c] : {std::array{0, 1, 2}, {0, 2, 3}}) {
      text += float_bytes(0) + float_bytes(0) + float_bytes(0);
      for (const int k : {a, b, c})
        for (const double x : block_corners[std::size_t(face.corners[std::size_t(k)])])
          text += float_bytes(x);
      text += little(attribute(face), 2);
    }
  return text;
}

TEST(FaceMarks, ColoursOfABinaryStlAreInItsAttributes) {
  const MarkFolder folder;
  for (const bool cut : {true, false}) {
    const auto five = [&](int v) {
      return unsigned(cut ? v >> 3 : int(std::lround(v * 31 / 255.0)));
    };
    const auto viscam = [&](const BlockFace& face) {
      const auto& [r, g, b] = face.colour;
      return 0x8000u | five(r) << 10 | five(g) << 5 | five(b);
    };
    const auto magics = [&](const BlockFace& face) {
      const auto& [r, g, b] = face.colour;
      return five(b) << 10 | five(g) << 5 | five(r);
    };
    // at 5 bits #010203 is black, and nothing else of the block is
    expect_block_colours(
        read_mesh_with_marks(folder.write("v.stl", block_stl("", viscam)), {}, all_marks));
    expect_block_colours(read_mesh_with_marks(
        folder.write("m.stl", block_stl("by magics COLOR=" + std::string("\x09\x08\x07\xff") +
                                            ",MATERIAL=" + std::string(12, 'x'),
                                        magics)),
        {}, all_marks));
  }
  const MarkedMesh none = read_mesh_with_marks(
      folder.write("n.stl", block_stl("", [](const BlockFace&) { return 0x1234u; })), {},
      all_marks);
  EXPECT_FALSE(none.marks.marks.at(0).colour) << "the 16th bit says that it is none";
  const MarkedMesh whole = read_mesh_with_marks(
      folder.write("w.stl", block_stl("COLOR=\x09\x08\x07\xff",
                                      [](const BlockFace& face) {
                                        return face.name == "top" ? 31u : 0x8000u;
                                      })),
      {}, all_marks);
  EXPECT_NEAR(area_that_may_be(whole, {9, 8, 7}), 56.0, 1e-12) << "that of the header";
  EXPECT_NEAR(area_that_may_be(whole, {255, 0, 0}), 6.0, 1e-12);
  EXPECT_HAS(
      refusal_of_marks(folder.write("short.stl", block_stl(std::string(72, ' ') + "COLOR=",
                                                           [](const BlockFace&) { return 0u; }))),
      "expected four colour bytes after COLOR= in the header of the STL file");
}

// --- PLY

struct PlyText {
  std::string vertex, face;  ///< lines of properties
  std::function<std::string(std::size_t)> at_vertex = [](std::size_t) { return ""; };
  std::function<std::string(const BlockFace&)> at_face = [](const BlockFace&) { return ""; };
};

std::string block_ply(const PlyText& ply) {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 8\nproperty double x\nproperty double y\nproperty "
      "double z\n" +
      ply.vertex + "element face 6\nproperty list uchar int vertex_indices\n" + ply.face +
      "end_header\n";
  for (std::size_t i = 0; i < 8; ++i)
    text += point_text(block_corners[i]) + ply.at_vertex(i) + "\n";
  for (const BlockFace& face : block_faces) {
    text += "4";
    for (const int corner : face.corners) text += fmt::format(" {}", corner);
    text += ply.at_face(face) + "\n";
  }
  return text;
}

std::string rgb_lines(const std::string& type) {
  std::string text;
  for (const char* name : {"red", "green", "blue"}) text += "property " + type + " " + name + "\n";
  return text;
}

TEST(FaceMarks, ColoursAndWholeNumbersOfPlyFaces) {
  const MarkFolder folder;
  const auto whole = [](const BlockFace& face) {
    return fmt::format(" {} {} {}", face.colour[0], face.colour[1], face.colour[2]);
  };
  const auto read = [&](const PlyText& ply) {
    return read_mesh_with_marks(folder.write("block.ply", block_ply(ply)), {}, all_marks);
  };
  for (const char* type : {"uchar", "int", "ushort"})
    expect_block_colours(read({.vertex = "", .face = rgb_lines(type), .at_face = whole}));
  expect_block_colours(read({.vertex = "",
                             .face = rgb_lines("float") + "property float alpha\n",
                             .at_face = [](const BlockFace& face) {
                               return fmt::format(" {:.3f} {:.3f} {:.3f} 1", face.colour[0] / 255.0,
                                                  face.colour[1] / 255.0, face.colour[2] / 255.0);
                             }}));
  const MarkedMesh ids = read({.vertex = "",
                               .face = "property int object_id\nproperty uchar alpha\nproperty "
                                       "double quality\nproperty short part\n",
                               .at_face = [](const BlockFace& face) {
                                 return fmt::format(" {} 9 0.5 {}", face.name == "top" ? -3 : 40,
                                                    face.name == "back" ? 1 : 0);
                               }});
  EXPECT_EQ(
      areas_by_name(ids),
      (std::map<std::string, double>{
          {"object_id -3", 6.0}, {"object_id 40", 56.0}, {"part 0", 52.0}, {"part 1", 10.0}}));
}

TEST(FaceMarks, AFaceOfPlyHasTheColourOfItsCornersIfTheyAgree) {
  const MarkFolder folder;
  const PlyText ply{.vertex = rgb_lines("uchar"), .face = "", .at_vertex = [](std::size_t i) {
                      return i < 4 ? " 200 10 10" : i == 5 ? " 0 0 1" : " 0 0 0";
                    }};
  const MarkedMesh mesh =
      read_mesh_with_marks(folder.write("block.ply", block_ply(ply)), {}, all_marks);
  EXPECT_NEAR(area_that_may_be(mesh, {200, 10, 10}), 6.0, 1e-12) << "the bottom alone";
  EXPECT_EQ(area_that_may_be(mesh, {0, 0, 0}), 0.0) << "one corner differs";
  PlyText both = ply;
  both.face = rgb_lines("uchar");
  both.at_face = [](const BlockFace&) { return " 1 2 3"; };
  EXPECT_NEAR(area_that_may_be(
                  read_mesh_with_marks(folder.write("both.ply", block_ply(both)), {}, all_marks),
                  {1, 2, 3}),
              62.0, 1e-12)
      << "faces go before vertices";
}

TEST(FaceMarks, BinaryPlyOfEitherOrder) {
  const MarkFolder folder;
  for (const bool is_big : {false, true}) {
    const auto number = [&](std::uint64_t value, int bytes) {
      std::string text = little(value, bytes);
      if (is_big) std::reverse(text.begin(), text.end());
      return text;
    };
    std::string text = fmt::format(
        "ply\nformat binary_{}_endian 1.0\nelement vertex 8\nproperty float x\nproperty float "
        "y\nproperty float z\nelement face 6\n{}property list uchar int "
        "vertex_indices\nend_header\n",
        is_big ? "big" : "little", rgb_lines("ushort"));
    for (const Vector3d& p : block_corners)
      for (const double x : p) text += number(std::bit_cast<std::uint32_t>(float(x)), 4);
    for (const BlockFace& face : block_faces) {
      for (const int channel : face.colour) text += number(std::uint64_t(channel), 2);
      text += char(4);
      for (const int corner : face.corners) text += number(std::uint64_t(corner), 4);
    }
    expect_block_colours(read_mesh_with_marks(folder.write("b.ply", text), {}, all_marks));
  }
}

TEST(FaceMarks, ColoursOfPlyThatAreNoneAreRefusedIfTheyAreAskedFor) {
  const MarkFolder folder;
  const auto text = [](const std::string& lines, const std::string& values) {
    return block_ply(
        {.vertex = "", .face = lines, .at_face = [=](const BlockFace&) { return values; }});
  };
  const std::tuple<std::string, std::string, std::string> cases[] = {
      {rgb_lines("int"), " 0 256 0",
       "ply:21:13: expected an integer channel from 0 to 255, seen 256 for green"},
      {rgb_lines("int"), " 0 0 -1",
       "ply:21:15: expected an integer channel from 0 to 255, seen -1 for blue"},
      {rgb_lines("int"), " 0 0 0.5",
       "expected an integer channel from 0 to 255, seen 0.5 for blue"},
      {rgb_lines("float"), " 0 0 1.5", "expected a channel from 0 to 1, seen 1.5 for blue"},
      {"property uchar red\n", " 0",
       "ply:7:1: expected one property each for red, green and blue, all integers or all floats, "
       "seen 1, 0 and 0"},
      {rgb_lines("uchar") + "property uchar red\n", " 0 0 0 0", "seen 2, 1 and 1"},
      {"property uchar red\nproperty float green\nproperty uchar blue\n", " 0 0 0",
       "seen integers mixed with floats"}};
  for (const auto& [lines, values, said] : cases) {
    const fs::path file = folder.write("bad.ply", text(lines, values));
    EXPECT_HAS(refusal_of_marks(file), said);
    EXPECT_EQ(refusal_of_marks(file, {}), "accepted");
    EXPECT_EQ(refusal_of_marks(file, {.groups = true}), "accepted");
  }
}

// --- OFF

std::string block_off(const std::string& magic,
                      const std::function<std::string(std::size_t)>& at_vertex,
                      const std::function<std::string(const BlockFace&)>& at_face) {
  std::string text = magic + "\n8 6 0\n";
  for (std::size_t i = 0; i < 8; ++i) text += point_text(block_corners[i]) + at_vertex(i) + "\n";
  for (const BlockFace& face : block_faces) {
    text += "4";
    for (const int corner : face.corners) text += fmt::format(" {}", corner);
    text += at_face(face) + "\n";
  }
  return text;
}

TEST(FaceMarks, ColoursOfOff) {
  const MarkFolder folder;
  const auto no_vertex = [](std::size_t) { return ""; };
  const auto read = [&](const std::string& text) {
    return read_mesh_with_marks(folder.write("block.off", text), {}, all_marks);
  };
  expect_block_colours(read(block_off("OFF", no_vertex, [](const BlockFace& face) {
    return fmt::format("  {} {} {} 255 # paint", face.colour[0], face.colour[1], face.colour[2]);
  })));
  expect_block_colours(read(block_off("OFF", no_vertex, [](const BlockFace& face) {
    return fmt::format(" {:.3f} {:.3f} {:.3f}", face.colour[0] / 255.0, face.colour[1] / 255.0,
                       face.colour[2] / 255.0);
  })));
  EXPECT_NEAR(
      area_that_may_be(
          read(block_off("OFF", no_vertex,
                         [](const BlockFace& face) { return face.name == "top" ? " 1 0 0" : ""; })),
          {255, 0, 0}),
      6.0, 1e-12)
      << "fractions without a point";
  const MarkedMesh of_corners = read(block_off(
      "COFF", [](std::size_t i) { return i < 4 ? " 0.5 0.25 0 1" : " 0 0 0 1"; },
      [](const BlockFace& face) { return face.name == "left" ? " 7 7 7" : ""; }));
  EXPECT_NEAR(area_that_may_be(of_corners, {128, 64, 0}), 6.0, 1e-12);
  EXPECT_NEAR(area_that_may_be(of_corners, {0, 0, 0}), 6.0, 1e-12);
  EXPECT_NEAR(area_that_may_be(of_corners, {7, 7, 7}), 15.0, 1e-12);
}

TEST(FaceMarks, ColoursOfOffThatAreNoneAreRefusedIfTheyAreAskedFor) {
  const MarkFolder folder;
  const std::pair<std::string, std::string> cases[] = {
      {" 7", "off:11:11: expected a colour of three or four numbers, or no colour (an index"},
      {" 7 7", "off:11:11: expected a colour of three or four numbers"},
      {" 7 7 256", "off:11:15: expected a channel (0 to 255), seen '256'"},
      {" 7 7 -1", "off:11:15: expected a channel (0 to 255), seen '-1'"},
      {" 0.5 0.5 2", "off:11:19: expected channels from 0 to 1, or integers"},
      {" 0.5 nan 0", "off:11:15: expected a finite number, seen 'nan'"},
      {" red green blue", "off:11:11: expected a finite number, seen 'red'"},
      {" 7 7 7 7 7", "off:11:19: expected the end of the line after a colour, seen '7'"}};
  for (const auto& [colour, said] : cases) {
    const fs::path file = folder.write("bad.off", block_off(
                                                      "OFF", [](std::size_t) { return ""; },
                                                      [&](const BlockFace&) { return colour; }));
    EXPECT_HAS(refusal_of_marks(file), said);
    EXPECT_EQ(refusal_of_marks(file, {}), "accepted");
  }
}

/// Files cut short or with a byte changed are read or refused with a place, nothing else.
TEST(FaceMarks, InjuredFilesAreReadOrRefused) {
  const MarkFolder folder;
  folder.write("my paints.mtl", block_mtl());
  std::string solids;
  for (const BlockFace& face : block_faces) solids += solid(face.name, face);
  const std::map<std::string, std::string> files = {
      {"i.obj",
       block_obj(
           [](const BlockFace& f) { return "g " + f.name + "\nusemtl " + f.name + " paint\n"; },
           "mtllib my paints.mtl\n")},
      {"i.stl", solids},
      {"j.stl", block_stl("COLOR=abcd", [](const BlockFace&) { return 77u; })},
      {"i.ply", block_ply({.vertex = "",
                           .face = rgb_lines("uchar") + "property int id\n",
                           .at_face = [](const BlockFace&) { return " 1 2 3 4"; }})},
      {"i.off", block_off(
                    "COFF", [](std::size_t) { return " 0.5 0 0 1"; },
                    [](const BlockFace&) { return " 9 9 9"; })},
  };
  Random random(20261124);
  int refused = 0, accepted = 0;
  for (const auto& [name, text] : files)
    for (int i = 0; i < 120 * longer(50); ++i) {
      std::string injured = text;
      if (random.once_in(3)) injured.resize(std::size_t(random.below(int(text.size()))));
      for (int k = 0; k < 3 && !injured.empty(); ++k)
        injured[std::size_t(random.below(int(injured.size())))] = char(random.below(256));
      (refusal_of_marks(folder.write(name, injured)) == "accepted" ? accepted : refused)++;
    }
  for (int i = 0; i < 120 * longer(50); ++i) {
    std::string mtl = block_mtl();
    mtl[std::size_t(random.below(int(mtl.size())))] = char(random.below(256));
    folder.write("my paints.mtl", mtl);
    (refusal_of_marks(folder.write("i.obj", files.at("i.obj"))) == "accepted" ? accepted
                                                                              : refused)++;
  }
  std::cout << refused << " refused, " << accepted << " accepted\n";
  EXPECT_GT(refused, 100);
  EXPECT_GT(accepted, 20);
}

// --- what keeps them

/// mm^2 by group; every triangle must be of one.
std::map<int, double> areas_by_group(const Design& design) {
  std::map<int, double> areas;
  for (Index t = 0; t < design.triangles.rows(); ++t) {
    const auto group = [&](int k) { return design.group[std::size_t(design.triangles(t, k))]; };
    EXPECT_TRUE(group(0) == group(1) && group(0) == group(2)) << t;
    areas[group(0)] += area_of(design, t);
  }
  return areas;
}

/// The same of vertices by their area.
std::map<int, double> vertex_areas_by_group(const Design& design) {
  std::map<int, double> areas;
  for (Index i = 0; i < design.vertices.rows(); ++i)
    areas[design.group[std::size_t(i)]] += design.area[i];
  return areas;
}

void expect_same_areas(const std::map<int, double>& wanted, const std::map<int, double>& seen) {
  ASSERT_EQ(wanted.size(), seen.size());
  for (const auto& [group, area] : wanted)
    EXPECT_NEAR(seen.at(group) / area, 1.0, 1e-12) << "group " << group;
}

Design bumpy_sheet(Random& random, int n, double height) {
  Points vertices((n + 1) * (n + 1), 3);
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const bool inside = i > 0 && i < n && j > 0 && j < n;
      vertices.row(i * (n + 1) + j) =
          Vector3d(i, j, 0.0) +
          (inside ? 0.3 : 0.0) * random.any().cwiseProduct(Vector3d(1, 1, 0)) +
          Vector3d(0, 0, random.in(0, height));
    }
  vertices.leftCols<2>() /= 0.5 * n;
  Triangles triangles(2 * n * n, 3);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const int a = i * (n + 1) + j, b = a + n + 1;
      triangles.row(2 * (i * n + j)) << a, b, b + 1;
      triangles.row(2 * (i * n + j) + 1) << a, b + 1, a + 1;
    }
  Design design;
  design.normals = vertex_normals(vertices, triangles);
  design.area = vertex_area(vertices, triangles);
  design.facet_error = facet_error(vertices, design.normals, triangles);
  design.judged.assign(std::size_t(vertices.rows()), 1);
  design.vertices = std::move(vertices);
  design.triangles = std::move(triangles);
  return design;
}

std::vector<int> any_groups(Random& random, const Design& design, int count) {
  std::vector<int> group(std::size_t(design.triangles.rows()));
  for (int& one : group) one = random.below(count);
  return group;
}

std::map<int, double> areas_of(const Design& design, const std::vector<int>& group) {
  std::map<int, double> areas;
  for (Index t = 0; t < design.triangles.rows(); ++t)
    areas[group[std::size_t(t)]] += area_of(design, t);
  return areas;
}

TEST(SplitAtGroups, EveryVertexIsOfOneGroupAndStandsAndLooksAsBefore) {
  Random random(5);
  for (int i = 0; i < 20; ++i) {
    const Design sheet = bumpy_sheet(random, 3 + random.below(6), 0.3);
    const std::vector<int> group = any_groups(random, sheet, 1 + random.below(4));
    const Design split = split_at_groups(sheet, group);
    expect_same_areas(areas_of(sheet, group), areas_by_group(split));
    expect_same_areas(areas_of(sheet, group), vertex_areas_by_group(split));
    for (Index t = 0; t < sheet.triangles.rows(); ++t)
      for (int k = 0; k < 3; ++k) {
        const int now = split.triangles(t, k), before = sheet.triangles(t, k);
        EXPECT_EQ(split.group[std::size_t(now)], group[std::size_t(t)]);
        EXPECT_EQ(split.vertices.row(now), sheet.vertices.row(before));
        EXPECT_EQ(split.normals.row(now), sheet.normals.row(before));
        EXPECT_EQ(split.facet_error[now], sheet.facet_error[before]);
      }
    const std::vector<int> patch = patches(split);
    EXPECT_EQ(std::set(patch.begin(), patch.end()).size(), 1u) << "no edge parts the sheet";
  }
  EXPECT_THROW(split_at_groups(bumpy_sheet(random, 3, 0.1), {1, 2}), std::invalid_argument);
}

TEST(SplitAtGroups, OneGroupSplitsNothingAndAFanEachHasItsVertex) {
  Random random(6);
  const Design sheet = bumpy_sheet(random, 4, 0.2);
  const Design whole = split_at_groups(sheet, std::vector<int>(32, 3));
  EXPECT_EQ(whole.vertices, sheet.vertices);
  EXPECT_EQ(whole.triangles, sheet.triangles);
  EXPECT_TRUE(whole.seams.empty());
  std::vector<int> chess(32);  // squares of a chess board: two of a colour meet in a corner only
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      for (int k = 0; k < 2; ++k) chess[std::size_t(2 * (4 * i + j) + k)] = (i + j) % 2;
  const Design board = split_at_groups(sheet, chess);
  EXPECT_EQ(board.vertices.rows(), 16 * 4);
  EXPECT_NO_THROW(subdivide(board, facet_point, {0.1, 100000})) << "one fan at a vertex";
}

TEST(SplitAtGroups, ABorderIsNoRimOfTheTop) {
  Random random(7);
  const Design sheet = bumpy_sheet(random, 8, 0.0);
  const Design split = split_at_groups(sheet, any_groups(random, sheet, 2));
  const Design judged = judge_top(split, {0.5, 0.3}), wanted = judge_top(sheet, {0.5, 0.3});
  std::map<std::pair<double, double>, int> is;
  for (Index i = 0; i < sheet.vertices.rows(); ++i)
    is[{sheet.vertices(i, 0), sheet.vertices(i, 1)}] = wanted.judged[std::size_t(i)];
  for (Index i = 0; i < split.vertices.rows(); ++i)
    EXPECT_EQ(judged.judged[std::size_t(i)], (is[{split.vertices(i, 0), split.vertices(i, 1)}]));
}

TEST(SplitAtGroups, TheFilterPassesABorder) {
  Random random(11);
  const Design sheet = bumpy_sheet(random, 40, 0.1);
  const Design split = split_at_groups(sheet, any_groups(random, sheet, 3));
  const auto form = [](const Design& design) {
    const Index n = design.vertices.rows();
    Surface surface{VectorXd(n), VectorXd::Zero(n), std::vector<int>(std::size_t(n)),
                    std::vector<VertexStatus>(std::size_t(n), VertexStatus::Cut)};
    for (Index i = 0; i < n; ++i)
      surface.residual[i] =
          std::sin(9.0 * design.vertices(i, 0)) * std::cos(7.0 * design.vertices(i, 1));
    return gaussian_form(design, surface, 0.47);  // no border of its blocks lies on the grid
  };
  const VectorXd whole = form(sheet), parted = form(split);
  double worst = 0.0, least = 1.0, most = -1.0;
  for (Index t = 0; t < sheet.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const double wanted = whole[sheet.triangles(t, k)];
      worst = std::max(worst, std::abs(parted[split.triangles(t, k)] - wanted));
      least = std::min(least, wanted);
      most = std::max(most, wanted);
    }
  std::cout << "form from " << least << " to " << most << ", off by " << worst << " at most\n";
  EXPECT_GT(most - least, 0.1);
  EXPECT_LT(worst, 1e-12);
}

TEST(SplitAtGroups, SubdivisionKeepsTheAreaOfEveryGroup) {
  Random random(8);
  double worst = 0.0;
  for (int i = 0; i < 10 * longer(10); ++i) {
    const Design sheet = bumpy_sheet(random, 3 + random.below(5), 0.5);
    const std::vector<int> group = any_groups(random, sheet, 2 + random.below(3));
    const std::map<int, double> before = areas_of(sheet, group);
    const Design fine =
        subdivide(split_at_groups(sheet, group), facet_point, {random.in(0.05, 0.3), 20000});
    ASSERT_GT(fine.vertices.rows(), 2 * sheet.vertices.rows());
    for (const auto& after : {areas_by_group(fine), vertex_areas_by_group(fine)}) {
      expect_same_areas(before, after);
      for (const auto& [one, area] : before)
        worst = std::max(worst, std::abs(after.at(one) / area - 1.0));
    }
  }
  std::cout << "areas off by " << worst << " of themselves at most\n";
}

/// Passes of a ball 0.5 mm apart over a square about (1, 1).
CutterMotion passes_over_the_sheet() {
  std::vector<Stop> stops;
  for (double y = -1.0; y <= 3.0; y += 0.5) {
    stops.push_back({{-1.0, y, 5.0}});
    for (double x = -1.0; x <= 3.0; x += 0.5) stops.push_back({{x, y, 0.001 * std::sin(x)}});
    stops.push_back({{3.0, y, 5.0}});
  }
  return motion_of(stops);
}

TEST(SplitAtGroups, RefinementKeepsTheAreaOfEveryGroup) {
  const CutterMotion motion = passes_over_the_sheet();
  const std::function<Surface(const Design&)> search = prepare_milled_surface(ball_mill, motion);
  const SurfaceProber sound = [&](const Design& design) {
    Surface surface = search(design);
    PassGradients contacts = milled_gradients(design, surface, ball_mill, motion);
    return SurfaceProbe{std::move(surface), std::move(contacts)};
  };
  Random random(9);
  double worst = 0.0;
  for (const bool can_flip_edges : {false, true})
    for (int i = 0; i < 3; ++i) {
      const Design sheet = bumpy_sheet(random, 4 + 2 * i, 0.0);
      const std::vector<int> group = any_groups(random, sheet, 3);
      const std::map<int, double> before = areas_of(sheet, group);
      const RefinementResult fine =
          refined(split_at_groups(sheet, group), facet_point, sound,
                  {.resolution = 3e-4, .points = 50000, .can_flip_edges = can_flip_edges});
      ASSERT_GT(fine.design.vertices.rows(), 4 * sheet.vertices.rows());
      ASSERT_EQ(fine.design.group.size(), std::size_t(fine.design.vertices.rows()));
      for (const auto& after : {areas_by_group(fine.design), vertex_areas_by_group(fine.design)}) {
        expect_same_areas(before, after);
        for (const auto& [one, area] : before)
          worst = std::max(worst, std::abs(after.at(one) / area - 1.0));
      }
      std::cout << sheet.vertices.rows() << " vertices, then " << fine.design.vertices.rows()
                << "\n";
    }
  std::cout << "areas off by " << worst << " of themselves at most\n";
}

}  // namespace
}  // namespace abbe::cutting
