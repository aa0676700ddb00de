#include "tests/safety/mistakes/mistake.h"
#include "tests/test.h"

namespace abbe::safety {
namespace {

/// Every line of an .obj that begins with a letter, its three numbers changed.
std::string with_lines(const std::string& text, char letter,
                       const std::function<Vector3d(const Vector3d&)>& change) {
  std::string changed;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    Vector3d p;
    char first = ' ';
    std::istringstream(line) >> first >> p.x() >> p.y() >> p.z();
    if (first == letter) {
      p = change(p);
      line = fmt::format("{} {:.9g} {:.9g} {:.9g}", letter, p.x(), p.y(), p.z());
    }
    changed += line + "\n";
  }
  return changed;
}

std::string with_y_up(const std::string& text) {
  return with_lines(text, 'v', [](const auto& p) { return Vector3d(p.x(), p.z(), -p.y()); });
}

std::string mirrored(const std::string& text) {
  return with_lines(text, 'v', [](const auto& p) { return Vector3d(-p.x(), p.y(), p.z()); });
}

std::string without_triangles(const std::string& text) { return text.substr(0, text.find("f ")); }

std::string with_commas(std::string text) {
  std::ranges::replace(text, '.', ',');
  return text;
}

}  // namespace

std::vector<Mistake> mistakes_in_meshes() {
  return {
      input_error("mesh in m", "mesh", {{"block.obj", "", box_obj(60, 40, 40, 0.001)}},
                  "with the part scaled by 1000"),
      input_error("mesh in inches", "mesh", {{"block.obj", "", box_obj(60, 40, 40, 1 / 25.4)}},
                  "with the part scaled by 25.4"),
      input_error("mesh in cm", "mesh", {{"block.obj", "", box_obj(60, 40, 40, 0.1)}},
                  "with the part scaled by 10"),
      input_error("mesh in um", "mesh", {{"block.obj", "", box_obj(60, 40, 40, 1000)}},
                  "read in um it would be 60 mm long"),
      input_error("unit of a mesh in inches by mistake", "mesh",
                  {{"scene.toml", "file = \"block.obj\"", "file = \"block.obj\"\nunit = \"inch\""}},
                  "with the part scaled by 0.03937"),
      warning("mesh with zero at its top", "mesh",
              {{"scene.toml", "at_mm = [150, -80, 0]", "at_mm = [150, -80, 40]"}},
              "with G54 Z = -60 (now -100) it fits best"),
      input_error("place of a mesh forgotten", "mesh",
                  {{"scene.toml", "at_mm = [150, -80, 0]\n", ""}},
                  "with G54 X = 0 (now 150) Y = 0 (now -80) it fits best"),
      input_error("place of a mesh twice", "mesh",
                  {{"scene.toml", "at_mm = [150, -80, 0]", "at_mm = [300, -160, 0]"}},
                  "72.0 mm away from the part"),
      input_error("place of a mesh in m", "mesh",
                  {{"scene.toml", "at_mm = [150, -80, 0]", "at_mm = [0.150, -0.080, 0]"}},
                  "a program that comes within"),
      input_error("mesh with y up", "mesh", {{"block.obj", with_y_up}},
                  "a program that comes within"),
      input_error(
          "mesh on its side", "mesh",
          {{"scene.toml", "at_mm = [150, -80, 0]", "at_mm = [150, -80, 0]\nturn_deg = [90, 0, 0]"}},
          "20.0 mm away from the part"),
      input_error("mesh upside down", "mesh",
                  {{"scene.toml", "at_mm = [150, -80, 0]",
                    "at_mm = [150, -80, 0]\nturn_deg = [180, 0, 0]"}},
                  "below the part"),
      input_error("mesh inside out", "mesh", {{"block.obj", inside_out}},
                  "counter-clockwise as seen from outside"),
      input_error("mesh mirrored", "mesh", {{"block.obj", mirrored}},
                  "counter-clockwise as seen from outside"),
      input_error("a triangle turned round", "mesh", {{"block.obj", "f 1 2 3", "f 1 3 2"}},
                  "all triangles with the same orientation"),
      input_error("mesh with a hole", "mesh", {{"block.obj", "\nf 1 2 ", "\n# f 1 2 "}},
                  "or part.open = true"),
      input_error("mesh of a lower part", "mesh", {{"block.obj", "", box_obj(60, 40, 30)}},
                  "10.0 mm above the part"),
      warning("mesh of a higher part", "mesh", {{"block.obj", "", box_obj(60, 40, 42)}},
              "more than 2 mm below the design"),
      warning("mesh of a larger part", "mesh", {{"block.obj", "", box_obj(200, 150, 40)}},
              "the program comes within 2 mm of 25 %"),
      input_error("mesh that is a picture", "mesh", {{"block.obj", "", "PNG\r\n"}},
                  "expected an OBJ keyword"),
      input_error("mesh that is empty", "mesh", {{"block.obj", "", " "}}, "a mesh"),
      input_error("mesh of points alone", "mesh", {{"block.obj", without_triangles}},
                  "a mesh of triangles, seen none"),
      input_error("mesh with decimal commas", "mesh", {{"block.obj", with_commas}},
                  "a finite number"),
      input_error("mesh of another name", "mesh", {{"scene.toml", "\"block.obj\"", "\"blok.obj\""}},
                  "nearest: \"block.obj\""),
      input_error("mesh in a format of CAD", "mesh",
                  {{"scene.toml", "\"block.obj\"", "\"block.step\""},
                   {"block.step", "", "ISO-10303-21;\n"}},
                  "ending in .stl, .obj, .ply or .off"),
      input_error("normal of what is judged in degrees", "mesh",
                  {{"scene.toml", "judged_normal_z = 0.9", "judged_normal_z = 90"}},
                  "part.judged_normal_z >= -1"),
      warning("normal of what is judged the other way", "mesh",
              {{"scene.toml", "judged_normal_z = 0.9", "judged_normal_z = -0.9"}},
              "of the judged area"),
  };
}

}  // namespace abbe::safety
