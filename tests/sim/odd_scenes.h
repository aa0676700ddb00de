#pragma once

#include "tests/sim/small_scene.h"
#include "tests/test.h"

/// Scenes of which something must be said, and scenes of which nothing may be: each a name and its
/// TOML text. Files that they name are written by `write_odd_files`.
namespace abbe::sim {

struct OddScene {
  std::string name;
  std::string text;
};

/// Ten millimetres square at z = 0 on the three-axis machine, whose words are those of the tip.
struct FlatScene {
  std::string program = "good.ngc";
  std::string tool = "kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 25\nlength_mm = 100\n";
  std::string part =
      "surface = \"rectangle\"\nlength_x_mm = 10\nlength_y_mm = 10\nvertices = 400\n";
  std::string more = {};
};

inline std::string to_toml(const FlatScene& scene) {
  return fmt::format(
      "machine = \"{}machines/three_axis_table.toml\"\n[tool]\n{}[part]\n{}[program]\nfile = "
      "\"{}\"\n{}",
      packaged("").string(), scene.tool, scene.part, scene.program, scene.more);
}

/// Parallel passes along x from y = from to y = to at a height, as NC text.
struct Passes {
  double from = -7.0, to = 7.0;  // mm
  double step = 0.5;             // mm
  double reach = 7.0;            // mm of x to either side
  double z = 0.0;                // mm
  std::string head = "G21 G90 G17 G94 G49\n";
  std::string feed = "F1000";
  std::string cut = "G1";
  std::string middle = {};  // between two passes, half way
};

inline std::string to_nc(const Passes& passes) {
  const int n = int((passes.to - passes.from) / passes.step + 0.5);
  std::string text = passes.head + "S10000 M3\n";
  for (int i = 0; i <= n; ++i) {
    const double y = passes.from + i * passes.step;
    text += fmt::format("G0 X{:.4f} Y{:.4f}\n", -passes.reach, y);
    text += fmt::format("G0 Z{:.4f}\n", passes.z);
    text += fmt::format("{} X{:.4f} {}\n", passes.cut, passes.reach, passes.feed);
    text += "G0 Z80\n";
    if (i == n / 2) text += passes.middle;
  }
  return text + "M5\nM30\n";
}

/// A box of 20 x 20 x 10 mm with its top at z = 10, as an OBJ.
inline std::string box_obj(bool quads, bool flipped = false) {
  std::string text;
  for (const double z : {0.0, 10.0})
    for (const double y : {-10.0, 10.0})
      for (const double x : {-10.0, 10.0}) text += fmt::format("v {} {} {}\n", x, y, z);
  const std::vector<std::vector<int>> faces = {{1, 3, 4, 2}, {5, 6, 8, 7}, {1, 2, 6, 5},
                                               {2, 4, 8, 6}, {4, 3, 7, 8}, {3, 1, 5, 7}};
  const auto face = [&](std::vector<int> corners) {
    text += "f";
    if (flipped) std::reverse(corners.begin(), corners.end());
    for (const int corner : corners) text += fmt::format(" {}", corner);
    text += "\n";
  };
  for (const auto& f : faces) {
    if (quads) {
      face(f);
    } else {
      face({f[0], f[1], f[2]});
      face({f[0], f[2], f[3]});
    }
  }
  return text;
}

/// A square of 2 `half` mm with `n` x `n` quads, its height above the plane as given; open.
inline std::string sheet_obj(int n, double half,
                             const std::function<double(double, double)>& height,
                             bool flipped = false) {
  std::string text;
  const auto at = [&](int i) { return half * (2.0 * i / n - 1.0); };
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i)
      text += fmt::format("v {:.9f} {:.9f} {:.9f}\n", at(i), at(j), height(at(i), at(j)));
  const auto number = [&](int i, int j) { return 1 + i + j * (n + 1); };
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const int a = number(i, j), b = number(i + 1, j), c = number(i + 1, j + 1),
                d = number(i, j + 1);
      text += flipped ? fmt::format("f {} {} {} {}\n", d, c, b, a)
                      : fmt::format("f {} {} {} {}\n", a, b, c, d);
    }
  return text;
}

/// A closed plate of 10 x 10 x 1 mm, its top of `n` x `n` quads at z = 0.
inline std::string thin_obj(int n = 10) {
  std::string text;
  const auto number = [&](int i, int j, bool top) {
    return 1 + i + j * (n + 1) + (top ? 0 : (n + 1) * (n + 1));
  };
  const auto face = [&](int a, int b, int c, int d) {
    text += fmt::format("f {} {} {} {}\n", a, b, c, d);
  };
  for (const double z : {0.0, -1.0})
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i <= n; ++i)
        text += fmt::format("v {:.9f} {:.9f} {}\n", 10.0 * i / n - 5.0, 10.0 * j / n - 5.0, z);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i)
      for (const bool top : {true, false}) {
        const int a = number(i, j, top), b = number(i + 1, j, top), c = number(i + 1, j + 1, top),
                  d = number(i, j + 1, top);
        top ? face(a, b, c, d) : face(d, c, b, a);
      }
  for (int i = 0; i < n; ++i) {
    face(number(i + 1, 0, true), number(i, 0, true), number(i, 0, false), number(i + 1, 0, false));
    face(number(i, n, true), number(i + 1, n, true), number(i + 1, n, false), number(i, n, false));
    face(number(0, i, true), number(0, i + 1, true), number(0, i + 1, false), number(0, i, false));
    face(number(n, i + 1, true), number(n, i, true), number(n, i, false), number(n, i + 1, false));
  }
  return text;
}

inline double dome_height(double x, double y) {
  constexpr double R = 40.0;
  return std::sqrt(R * R - x * x - y * y) - R;
}

void write_odd_files(const SceneFolder& folder);
std::vector<OddScene> odd_scenes();
std::vector<OddScene> sane_scenes();

}  // namespace abbe::sim
