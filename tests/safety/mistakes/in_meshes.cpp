#include <sstream>

#include <fmt/format.h>

#include "tests/safety/mistakes/mistake.h"

namespace abbe::safety {
namespace {

/// Every line of an .obj that begins with a letter, its three numbers changed.
std::string with_lines(const std::string& text, char letter,
                       const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& change) {
  std::string changed;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    Eigen::Vector3d p;
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
  return with_lines(text, 'v', [](const auto& p) { return Eigen::Vector3d(p.x(), p.z(), -p.y()); });
}

std::string mirrored(const std::string& text) {
  return with_lines(text, 'v', [](const auto& p) { return Eigen::Vector3d(-p.x(), p.y(), p.z()); });
}

std::string without_triangles(const std::string& text) { return text.substr(0, text.find("f ")); }

std::string with_commas(std::string text) {
  std::ranges::replace(text, '.', ',');
  return text;
}

}  // namespace

std::vector<Mistake> mistakes_in_meshes() {
  return {
      {"mesh in m",
       "mesh",
       {{"block.obj", "", box_obj(60, 40, 40, 0.001)}},
       Expected::InputError,
       "with the part scaled by 1000"},
      {"mesh in inches",
       "mesh",
       {{"block.obj", "", box_obj(60, 40, 40, 1 / 25.4)}},
       Expected::InputError,
       "with the part scaled by 25.4"},
      {"mesh in cm",
       "mesh",
       {{"block.obj", "", box_obj(60, 40, 40, 0.1)}},
       Expected::InputError,
       "with the part scaled by 10"},
      {"mesh in um",
       "mesh",
       {{"block.obj", "", box_obj(60, 40, 40, 1000)}},
       Expected::InputError,
       "read in um it would be 60 mm long"},
      {"unit of a mesh in inches by mistake",
       "mesh",
       {{"scene.toml", "file = \"block.obj\"", "file = \"block.obj\"\nunit = \"inch\""}},
       Expected::InputError,
       "with the part scaled by 0.03937"},
      {"mesh with zero at its top",
       "mesh",
       {{"scene.toml", "at_mm = [150, -80, 0]", "at_mm = [150, -80, 40]"}},
       Expected::Warning,
       "with G54 Z = -60 (now -100) it fits best"},
      {"place of a mesh forgotten",
       "mesh",
       {{"scene.toml", "at_mm = [150, -80, 0]\n", ""}},
       Expected::InputError,
       "with G54 X = 0 (now 150) Y = 0 (now -80) it fits best"},
      {"place of a mesh twice",
       "mesh",
       {{"scene.toml", "at_mm = [150, -80, 0]", "at_mm = [300, -160, 0]"}},
       Expected::InputError,
       "72.0 mm away from the part"},
      {"place of a mesh in m",
       "mesh",
       {{"scene.toml", "at_mm = [150, -80, 0]", "at_mm = [0.150, -0.080, 0]"}},
       Expected::InputError,
       "a program that comes within"},
      {"mesh with y up",
       "mesh",
       {{"block.obj", with_y_up}},
       Expected::InputError,
       "a program that comes within"},
      {"mesh on its side",
       "mesh",
       {{"scene.toml", "at_mm = [150, -80, 0]", "at_mm = [150, -80, 0]\nturn_deg = [90, 0, 0]"}},
       Expected::InputError,
       "20.0 mm away from the part"},
      {"mesh upside down",
       "mesh",
       {{"scene.toml", "at_mm = [150, -80, 0]", "at_mm = [150, -80, 0]\nturn_deg = [180, 0, 0]"}},
       Expected::InputError,
       "below the part"},
      {"mesh inside out",
       "mesh",
       {{"block.obj", inside_out}},
       Expected::InputError,
       "counter-clockwise as seen from outside"},
      {"mesh mirrored",
       "mesh",
       {{"block.obj", mirrored}},
       Expected::InputError,
       "counter-clockwise as seen from outside"},
      {"a triangle turned round",
       "mesh",
       {{"block.obj", "f 1 2 3", "f 1 3 2"}},
       Expected::InputError,
       "all triangles with the same orientation"},
      {"mesh with a hole",
       "mesh",
       {{"block.obj", "\nf 1 2 ", "\n# f 1 2 "}},
       Expected::InputError,
       "or part.open = true"},
      {"mesh of a lower part",
       "mesh",
       {{"block.obj", "", box_obj(60, 40, 30)}},
       Expected::InputError,
       "10.0 mm above the part"},
      {"mesh of a higher part",
       "mesh",
       {{"block.obj", "", box_obj(60, 40, 42)}},
       Expected::Warning,
       "more than 2 mm below the design"},
      {"mesh of a larger part",
       "mesh",
       {{"block.obj", "", box_obj(200, 150, 40)}},
       Expected::Warning,
       "the program comes within 2 mm of 25 %"},
      {"mesh that is a picture",
       "mesh",
       {{"block.obj", "", "PNG\r\n"}},
       Expected::InputError,
       "expected an OBJ keyword"},
      {"mesh that is empty", "mesh", {{"block.obj", "", " "}}, Expected::InputError, "a mesh"},
      {"mesh of points alone",
       "mesh",
       {{"block.obj", without_triangles}},
       Expected::InputError,
       "a mesh of triangles, seen none"},
      {"mesh with decimal commas",
       "mesh",
       {{"block.obj", with_commas}},
       Expected::InputError,
       "a finite number"},
      {"mesh of another name",
       "mesh",
       {{"scene.toml", "\"block.obj\"", "\"blok.obj\""}},
       Expected::InputError,
       "nearest: \"block.obj\""},
      {"mesh in a format of CAD",
       "mesh",
       {{"scene.toml", "\"block.obj\"", "\"block.step\""}, {"block.step", "", "ISO-10303-21;\n"}},
       Expected::InputError,
       "ending in .stl, .obj, .ply or .off"},
      {"normal of what is judged in degrees",
       "mesh",
       {{"scene.toml", "judged_normal_z = 0.9", "judged_normal_z = 90"}},
       Expected::InputError,
       "part.judged_normal_z >= -1"},
      {"normal of what is judged the other way",
       "mesh",
       {{"scene.toml", "judged_normal_z = 0.9", "judged_normal_z = -0.9"}},
       Expected::Warning,
       "of the judged area"},
  };
}

}  // namespace abbe::safety
