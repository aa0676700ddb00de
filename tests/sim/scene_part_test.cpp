// [part], [tool] and [program]: what is written has every key, and reads as the same.

#include "sim/scene/document.h"
#include "sim/scene/fields.h"
#include "sim/scene/part.h"
#include "sim/scene/program.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/scene_fields.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/tool.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/small_scene.h"
#include "tests/sim/written_section.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

std::string part_again(const std::string& text) {
  return written_again(text, read_part, part_to_table);
}
std::string tool_again(const std::string& text) {
  const auto read_tool = [](const Node& table, InputErrors& input_errors) {
    return read_tools(table, input_errors).front();
  };
  return written_again(text, read_tool, tool_to_table);
}

TEST(ScenePart, SurfacesAreWrittenWithEveryKey) {
  const std::string more = R"(vertices = 500
at_mm = [1.0, 2.0, 3.0]
turn_deg = [0.0, 90.0, 0.0]
sampling = "vertices"
resolution_um = 0.3
spacing_mm = 0.1
finest_mm = 0.002
points = 1000000
judged_radius_max_mm = 9.0
judged_radius_min_mm = 0.5
judged = "cut"
form_cutoff_mm = 2.5
tolerance_um = 12.0

[[region]]
name = "rim"
tolerance_um = [-2.0, 5.0]
judged = true
radius_mm = [8.0, 9.0]

[[ring]]
name = "upper"
along_mm = 3.0
width_mm = 0.5

[[ring]]
name = "lower"
along_mm = 1.0
width_mm = 0.5
)";
  for (const std::string surface :
       {"surface = \"rectangle\"\nlength_x_mm = 20.0\nlength_y_mm = 10.0\n",
        "surface = \"disc\"\nradius_mm = 10.0\ninner_radius_mm = 2.0\n",
        "surface = \"cylinder\"\nradius_mm = 10.0\nheight_mm = 5.0\n",
        "surface = \"cone\"\nbase_radius_mm = 10.0\nheight_mm = 5.0\nhalf_apex_deg = 30.0\n",
        "surface = \"sphere_cap\"\nradius_mm = 20.0\nrim_radius_mm = 10.0\n",
        "surface = \"torus\"\nradius_mm = 20.0\ntube_radius_mm = 5.0\n"}) {
    const std::string text = "name = \"p\"\n" + surface + more;
    EXPECT_EQ(part_again(text), text);
  }
  const std::string revolved = R"(surface = "revolved"
start_mm = [0.0, 5.0]
vertices = 20000
at_mm = [0.0, 0.0, 0.0]
turn_deg = [0.0, 0.0, 0.0]
sampling = "vertices"
spacing_mm = 0.1
finest_mm = 0.002
points = 1000000
judged = "cut"
form_cutoff_mm = 2.5
tolerance_um = 0.0

[[profile]]
to_mm = [3.0, 5.0]
arc_radius_mm = 0.0

[[profile]]
to_mm = [6.0, 2.0]
arc_radius_mm = 3.0
)";
  EXPECT_EQ(part_again(revolved), revolved);
}

TEST(ScenePart, MeshesAreWrittenWithEveryKey) {
  const SceneFolder folder;
  const std::string file = folder.write("part.stl", "").string();
  const std::string text = "file = \"" + file + R"("
unit = "inch"
any_size = true
open = true
at_mm = [0.0, 0.0, 1.0]
turn_deg = [0.0, 0.0, 30.0]
sampling = "adaptive"
spacing_mm = 0.1
finest_mm = 0.002
points = 1000000
judged = "all"
facets = "smooth"
recognise_um = 0.1
edge_angle_deg = 30.0
edge_margin_mm = 0.0
judged_normal_z = 0.5
judged_margin_mm = 0.25
form_cutoff_mm = 2.5
tolerance_um = 0.0
)";
  EXPECT_EQ(part_again(text), text);
}

TEST(SceneTool, EveryKindIsWrittenWithEveryKey) {
  const std::string ball = R"(name = "b"
kind = "ball"
radius_mm = 5.0
flank_length_mm = 20.0
length_mm = 100.0
number = 7

[actual]
length_mm = 100.01
radius_mm = 4.99
flank_length_mm = 20.0
)";
  EXPECT_EQ(tool_again(ball), ball);
  const std::string bull = R"(kind = "bull"
radius_mm = 5.0
corner_radius_mm = 5.0
flank_length_mm = 20.0
length_mm = 100.0

[actual]
length_mm = 100.0
radius_mm = 5.0
corner_radius_mm = 4.5
flank_length_mm = 20.0
)";
  EXPECT_EQ(tool_again(bull), bull);
  const std::string flat = R"(kind = "flat"
radius_mm = 5.0
flank_length_mm = 20.0
length_mm = 100.0

[actual]
length_mm = 100.0
radius_mm = 4.9
flank_length_mm = 19.0
)";
  EXPECT_EQ(tool_again(flat), flat);
  const std::string nose = R"(kind = "nose"
radius_mm = 0.25
length_mm = 50.0

[actual]
length_mm = 50.0
radius_mm = 0.24
centring_offset_mm = 0.1
centring_height_mm = -0.2

[[actual.wave]]
order = 3
amplitude_um = 0.5
phase_deg = 90.0
)";
  EXPECT_EQ(tool_again(nose), nose);
}

TEST(SceneTool, AnActualCutterIsAsNominalWhereItIsNotStated) {
  const std::string text = "kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 20\nlength_mm = 90\n";
  EXPECT_EQ(tool_again(text + "actual = { length_mm = 90, radius_mm = 5, flank_length_mm = 20 }\n"),
            tool_again(text));
}

std::vector<kinematics::Joint> joints() {
  kinematics::Joint x, c;
  x.name = 'X';
  c.name = 'C';
  c.motion = kinematics::Motion::Rotary;
  return {c, x};
}

std::string program_again(const std::string& text) {
  return written_again(
      text,
      [](const Node& node, InputErrors& input_errors) {
        return read_program(node, joints(), input_errors);
      },
      [](const ProgramDescription& program) { return program_to_table(program, joints()); });
}

TEST(SceneProgram, GeneratorsAreWrittenWithEveryKey) {
  const std::string raster = R"(generator = "raster"
step_over_mm = 0.25
step_mm = 0.5
lead_deg = 36.0
tilt_deg = -12.0
feed_mm_per_min = 600.0
speed_rpm = 9000.0
clearance_mm = 4.0
pattern = "one_way"
overrun_mm = 1.0
decimals_mm = 5
decimals_deg = 6

[tool_length_mm]
2 = 80.5
3 = 70.0

[work_offset]

[work_offset.G55]
C_deg = 90.0
X_mm = 10.0
)";
  EXPECT_EQ(program_again(raster), raster);
  const std::string flank = R"(generator = "flank"
step_mm = 0.25
feed_mm_per_min = 600.0
speed_rpm = 9000.0
clearance_mm = 0.0
tip_below_mm = 2.0
decimals_mm = 7
decimals_deg = 9
)";
  EXPECT_EQ(program_again(flank), flank);
  const std::string spiral = R"(generator = "spiral"
speed_rpm = 150.0
feed_um_per_rev = 20.0
start_beyond_rim_mm = 0.5
end_radius_mm = 0.25
interval_s = 0.05
format = "nc"
decimals_mm = 7
decimals_deg = 9
)";
  EXPECT_EQ(program_again(spiral), spiral);
}

TEST(SceneProgram, ASpiralBeginsOneFeedBeyondTheRim) {
  const std::string text = "generator = \"spiral\"\nspeed_rpm = 150\nfeed_um_per_rev = 20\n";
  EXPECT_EQ(program_again(text), program_again(text + "start_beyond_rim_mm = 0.02\n"));
}

TEST(SceneProgram, AFileIsNamedAgain) {
  const SceneFolder folder;
  const std::string text = "file = \"" + folder.write("p.ngc", "M30\n").string() + "\"\n";
  EXPECT_EQ(program_again(text), text + R"(dialect = "auto"
on_unknown = "refuse"
block_skip = "on"
interpreter = "abbe"
interpreter_limit_s = 120.0
interpreter_limit_MB = 4000.0
max_moves = 20000000
pole = "as_programmed"
control = "of_machine"
x_words = "of_control"
tip = 0
pole_warning_deg = 2.0
)");
  const std::string stated = text + R"(dialect = "linuxcnc"
on_unknown = "warn"
block_skip = "1 3"
startup_code = "G21"
interpreter = "linuxcnc"
interpreter_limit_s = 5.0
interpreter_limit_MB = 64.0
max_moves = 1000
pole = "fanuc"
pole_near_deg = 1.5
pole_change_deg = 20.0
control = "milling"
x_words = "radii"
tip = 3
pole_warning_deg = 0.5
)";
  EXPECT_EQ(program_again(stated), stated);
}

// A scene written with every key that it has is the same scene, and no key is without effect.

std::vector<fs::path> packaged_files() {
  std::vector<fs::path> files;
  for (const std::string& name : packaged_scenes()) files.push_back(packaged(name));
  return files;
}

/// Where two trees differ by more than the last digits: numbers are written in the unit of their
/// key.
std::string difference(const Node& a, const Node& b, const std::string& path = "") {
  const auto* x = std::get_if<double>(&a.value);
  const auto* y = std::get_if<double>(&b.value);
  if (x && y) {
    const bool near = *x == *y || std::abs(*x - *y) <= 1e-12 + 1e-9 * std::abs(*x);
    return near ? "" : path + ": " + to_toml_value(*x) + " and " + to_toml_value(*y);
  }
  std::string all;
  if (a.table() && b.table() && a.table()->size() == b.table()->size()) {
    for (std::size_t i = 0; i < a.table()->size(); ++i) {
      const Node::Entry &of_a = (*a.table())[i], &of_b = (*b.table())[i];
      all += of_a.key == of_b.key ? difference(of_a.node, of_b.node, path + "." + of_a.key)
                                  : path + ": keys " + of_a.key + " and " + of_b.key;
    }
  } else if (a.array() && b.array() && a.array()->size() == b.array()->size()) {
    for (std::size_t i = 0; i < a.array()->size(); ++i)
      all += difference((*a.array())[i], (*b.array())[i], path + "[]");
  } else if (to_toml_value(a) != to_toml_value(b)) {
    return path + ": another value";
  }
  return all;
}

/// Without variants: their changes are those of the scene as its file has it.
Node written_alone(const Scene& scene) {
  Node table = to_table(scene);
  std::erase_if(*table.table(), [](const Node::Entry& one) { return one.key == "variant"; });
  return table;
}

class WrittenScene : public testing::TestWithParam<fs::path> {};

TEST_P(WrittenScene, IsReadAsTheSameScene) {
  const Scene scene = read_scene(GetParam());
  const Node table = written_alone(scene);
  InputErrors input_errors;
  try {
    EXPECT_EQ(difference(written_alone(scene_from_tree(table, GetParam(), {})), table), "");
  } catch (const BadScene& bad) {
    for (const BadInput& fault : bad.input_errors) ADD_FAILURE() << fault.what();
  }
}

/// Every leaf of a tree that may be changed alone, first numbers of lists only.
void leaves(Node& node, const std::string& path,
            std::vector<std::pair<std::string, Node*>>& found) {
  if (Node::Table* table = node.table()) {
    for (Node::Entry& entry : *table) leaves(entry.node, path + "." + entry.key, found);
  } else if (Node::Array* array = node.array()) {
    // of a direction the one that is zero: a longer one is the same direction
    std::size_t one = 0;
    for (std::size_t i = array->size(); i-- > 0;)
      if (const auto* number = std::get_if<double>(&(*array)[i].value); number && *number == 0.0)
        one = i;
    if (!array->empty()) leaves((*array)[one], path + "[" + std::to_string(one) + "]", found);
  } else {
    found.emplace_back(path, &node);
  }
}

bool change(Node& leaf) {
  if (auto* number = std::get_if<double>(&leaf.value)) {
    *number = *number == 0.0 ? 1e-3 : *number * 1.001;
  } else if (auto* whole = std::get_if<std::int64_t>(&leaf.value)) {
    *whole += 1;
  } else if (auto* yes = std::get_if<bool>(&leaf.value)) {
    *yes = !*yes;
  } else {
    return false;  // words are tried by the tests of their sections
  }
  return true;
}

TEST_P(WrittenScene, ChangesWithEveryNumberOfIt) {
  const Scene scene = read_scene(GetParam());
  Node table = written_alone(scene);
  std::vector<std::pair<std::string, Node*>> found;
  leaves(table, "", found);
  const std::string before = to_toml(to_table(scene_from_tree(table, GetParam(), {})));
  // all of them take minutes
  const std::size_t stride = std::getenv("ABBE_LONG") ? 1 : 1 + found.size() / 30;
  std::set<std::string> without_effect;
  int tried = 0, refused = 0;
  for (std::size_t i = 0; i < found.size(); i += stride) {
    const auto& [path, leaf] = found[i];
    if (path.starts_with(".machine.nose.x[")) continue;  // made square to the axis of the nose
    const Node kept = *leaf;
    if (!change(*leaf)) continue;
    ++tried;
    try {
      if (to_toml(to_table(scene_from_tree(table, GetParam(), {}))) == before)
        without_effect.insert(path);
    } catch (const BadScene&) {
      ++refused;
    }
    *leaf = kept;
  }
  std::cout << tried << " numbers changed, " << refused << " refused\n";
  EXPECT_GT(tried - refused, 10);
  for (const std::string& path : without_effect) ADD_FAILURE() << path << " changes nothing";
}

INSTANTIATE_TEST_SUITE_P(Packaged, WrittenScene, testing::ValuesIn(packaged_files()),
                         [](const auto& scene) { return scene.param.stem().string(); });

}  // namespace
}  // namespace abbe::sim
