#include <stdexcept>

#include "cutting/primitive.h"
#include "kinematics/units.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {

namespace {

constexpr Range half_turn_open{0.0, 90.0, true, true};
constexpr Range tool_size{0.0, 10'000.0, true, false};  // mm
constexpr Range tool_length{-10'000.0, 10'000.0};       // mm
constexpr Range part_size{1e-3, 1e5};                   // mm
constexpr Range spindle_rpm{0.0, 1e6, true, false};

cutting::RevolvedProfile read_profile(TableReader& reader) {
  cutting::RevolvedProfile profile;
  Eigen::Vector2d from = reader.numbers("start_mm", 2);
  if (!reader.has("profile")) reader.missing("profile", "a list of tables");
  for (const Node* node : reader.tables("profile")) {
    TableReader piece(*node, "part.profile", reader.faults());
    const Eigen::Vector2d to = piece.numbers("to_mm", 2);
    profile.pieces.push_back({from, to, piece.number("arc_radius_mm", any_number, 0.0)});
    piece.close();
    from = to;
  }
  return profile;
}

cutting::Primitive read_surface(TableReader& reader) {
  enum class Kind { Rectangle, Disc, Cylinder, Cone, SphereCap, Torus, Revolved };
  const Kind kind = reader.choice<Kind>("surface", {{"rectangle", Kind::Rectangle},
                                                    {"disc", Kind::Disc},
                                                    {"cylinder", Kind::Cylinder},
                                                    {"cone", Kind::Cone},
                                                    {"sphere_cap", Kind::SphereCap},
                                                    {"torus", Kind::Torus},
                                                    {"revolved", Kind::Revolved}});
  switch (kind) {
    case Kind::Rectangle:
      return cutting::RectanglePlane{reader.number("length_x_mm", part_size),
                                     reader.number("length_y_mm", part_size)};
    case Kind::Disc:
      return cutting::Disc{reader.number("radius_mm", part_size),
                           reader.number("inner_radius_mm", non_negative, 0.0)};
    case Kind::Cylinder:
      return cutting::Cylinder{reader.number("radius_mm", part_size),
                               reader.number("height_mm", part_size)};
    case Kind::Cone:
      return cutting::Cone{reader.number("base_radius_mm", part_size),
                           reader.number("height_mm", part_size),
                           reader.number("half_apex_deg", half_turn_open)};
    case Kind::SphereCap:
      return cutting::SphereCap{reader.number("radius_mm", part_size),
                                reader.number("rim_radius_mm", part_size)};
    case Kind::Torus:
      return cutting::Torus{reader.number("radius_mm", part_size),
                            reader.number("tube_radius_mm", part_size)};
    case Kind::Revolved:
      break;
  }
  return read_profile(reader);
}

void check_surface(TableReader& reader, const cutting::Primitive& primitive) {
  if (std::holds_alternative<cutting::RectanglePlane>(primitive))
    return;  // checked number by number
  try {
    cutting::profile(primitive);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("surface", "a surface that can be, of the keys of part", fault.what());
  }
}

void read_judged(TableReader& reader, PartDescription& part) {
  part.judged_radius_max = reader.maybe_number("judged_radius_max_mm", positive);
  part.judged_radius_min = reader.maybe_number("judged_radius_min_mm", non_negative);
  if (part.judged_radius_min && part.judged_radius_max &&
      !(*part.judged_radius_min < *part.judged_radius_max)) {
    reader.refuse("judged_radius_min_mm", "less than judged_radius_max_mm", "not less");
  }
  if (!std::holds_alternative<MeshFile>(part.shape)) return;
  part.judged_normal_z = reader.maybe_number("judged_normal_z", {-1.0, 1.0, false, false});
  part.judged_margin = reader.maybe_number("judged_margin_mm", non_negative);
}

std::vector<PartDescription::Ring> read_rings(TableReader& part) {
  std::vector<PartDescription::Ring> rings;
  for (const Node* node : part.tables("ring")) {
    TableReader ring(*node, "part.ring", part.faults());
    rings.push_back({ring.text("name"), ring.number("along_mm", any_number),
                     ring.number("width_mm", positive)});
    ring.close();
    for (std::size_t i = 0; i + 1 < rings.size(); ++i)
      if (rings[i].name == rings.back().name)
        ring.refuse("name", "a name that no other ring has", "\"" + rings[i].name + "\" again");
  }
  return rings;
}

cutting::Cutter read_cutter(TableReader& reader, const std::string& kind,
                            const cutting::Cutter& otherwise, bool nominal) {
  const std::size_t before = reader.faults().list().size();
  cutting::Cutter cutter = otherwise;
  cutter.radius = nominal ? reader.number("radius_mm", tool_size)
                          : reader.number("radius_mm", tool_size, otherwise.radius);
  if (kind == "ball") {
    cutter.corner_radius = cutter.radius;
  } else if (kind == "flat") {
    cutter.corner_radius = 0.0;
  } else {
    cutter.corner_radius =
        nominal ? reader.number("corner_radius_mm", positive)
                : reader.number("corner_radius_mm", positive, otherwise.corner_radius);
  }
  cutter.flank_length = nominal
                            ? reader.number("flank_length_mm", tool_size)
                            : reader.number("flank_length_mm", tool_size, otherwise.flank_length);
  const bool whole = !nominal || (reader.has("radius_mm") && reader.has("flank_length_mm") &&
                                  (kind != "bull" || reader.has("corner_radius_mm")));
  if (!whole || reader.faults().list().size() != before) return cutter;
  if (cutter.corner_radius > cutter.radius) {
    reader.refuse("corner_radius_mm", "at most the radius for tool.corner_radius_mm", "more");
  } else if (cutter.flank_length < cutter.corner_radius) {
    reader.refuse("flank_length_mm", "at least the corner radius for tool.flank_length_mm", "less");
  }
  return cutter;
}

std::vector<cutting::NoseWave> read_waves(TableReader& actual) {
  std::vector<cutting::NoseWave> waves;
  for (const Node* node : actual.tables("wave")) {
    TableReader wave(*node, "tool.actual.wave", actual.faults());
    if (!wave.has("order")) wave.missing("order", "a whole number");
    waves.push_back({int(wave.integer("order", 1, 1000, 1)),
                     wave.number("amplitude_um", any_number),
                     wave.number("phase_deg", any_number, 0.0)});
    wave.close();
  }
  return waves;
}

void read_actual_tool(TableReader& actual, const std::string& kind, ToolDescription& tool) {
  tool.actual_length = actual.number("length_mm", tool_length, tool.length);
  if (const auto* nominal = std::get_if<cutting::Cutter>(&tool.nominal)) {
    tool.actual = read_cutter(actual, kind, *nominal, false);
    return;
  }
  cutting::Nose nose = std::get<cutting::Nose>(tool.nominal);
  nose.radius = actual.number("radius_mm", tool_size, nose.radius);
  nose.waves = read_waves(actual);
  tool.actual = nose;
  tool.centring_offset = actual.number("centring_offset_mm", any_number, 0.0);
  tool.centring_height = actual.number("centring_height_mm", any_number, 0.0);
}

program::NcFormat read_format(TableReader& reader) {
  program::NcFormat format;
  format.decimals_mm = int(reader.integer("decimals_mm", 0, 15, format.decimals_mm));
  format.decimals_deg = int(reader.integer("decimals_deg", 0, 15, format.decimals_deg));
  return format;
}

program::Raster read_raster(TableReader& reader) {
  program::Raster raster;
  raster.step_over = reader.number("step_over_mm", positive, raster.step_over);
  raster.step = reader.number("step_mm", positive, raster.step);
  raster.lead = reader.number("lead_deg", {-89.0, 89.0, false, false}, raster.lead);
  raster.tilt = reader.number("tilt_deg", {-89.0, 89.0, false, false}, raster.tilt);
  raster.feed = reader.number("feed_mm_per_min", positive, raster.feed);
  raster.speed_rpm = reader.number_as_written("speed_rpm", spindle_rpm).value_or(raster.speed_rpm);
  raster.clearance = reader.number("clearance_mm", positive, raster.clearance);
  raster.zigzag = reader.choice<bool>("pattern", {{"zigzag", true}, {"one_way", false}}, true);
  raster.overrun = reader.number("overrun_mm", non_negative, raster.overrun);
  raster.format = read_format(reader);
  return raster;
}

program::Flank read_flank(TableReader& reader) {
  program::Flank flank;
  flank.step = reader.number("step_mm", positive, flank.step);
  flank.feed = reader.number("feed_mm_per_min", positive, flank.feed);
  flank.speed_rpm = reader.number_as_written("speed_rpm", spindle_rpm).value_or(flank.speed_rpm);
  flank.clearance = reader.number("clearance_mm", non_negative, flank.clearance);
  flank.tip_below = reader.number("tip_below_mm", non_negative, flank.tip_below);
  flank.format = read_format(reader);
  return flank;
}

program::Spiral read_spiral(TableReader& reader) {
  program::Spiral spiral;
  spiral.spindle_speed = reader.number("speed_rpm", spindle_rpm);
  spiral.feed_per_revolution = reader.number("feed_um_per_rev", positive);
  spiral.start_beyond_rim =
      reader.number("start_beyond_rim_mm", non_negative, spiral.feed_per_revolution);
  spiral.end_radius = reader.number("end_radius_mm", non_negative, spiral.end_radius);
  spiral.interval = reader.number("interval_s", positive, spiral.interval);
  spiral.write_nc = reader.choice<bool>("format", {{"pvt", false}, {"nc", true}}, false);
  spiral.format = read_format(reader);
  return spiral;
}

ProgramDescription::File read_program_file(TableReader& reader) {
  const std::filesystem::path file = reader.text("file");
  const std::string ending = file.extension().string();
  std::error_code failure;
  if (ending != ".ngc" && ending != ".nc" && ending != ".tap" && ending != ".csv" &&
      ending != ".pvt") {
    reader.refuse("file", "a program named .ngc, .nc, .tap, .csv or .pvt", file.string());
  } else if (!std::filesystem::is_regular_file(file, failure)) {
    reader.refuse("file", "a file that can be read", "no file " + file.string());
  }
  return {file};
}

std::map<int, double> read_tool_lengths(TableReader& program) {
  std::map<int, double> lengths;
  const Node* section = program.section("tool_length_mm");
  if (!section) return lengths;
  TableReader reader(*section, "program.tool_length_mm", program.faults());
  for (const Node::Entry& entry : *section->table()) {
    const bool digits =
        entry.key.size() <= 3 && entry.key.find_first_not_of("0123456789") == std::string::npos;
    if (!digits) {
      reader.know(entry.key);
      program.faults().add(entry.place, "an H number from 0 to 999", entry.key);
      continue;
    }
    lengths[std::stoi(entry.key)] = reader.number(entry.key, any_number);
  }
  reader.close();
  return lengths;
}

void read_work_offsets(TableReader& program, const std::vector<kinematics::Joint>& joints,
                       ProgramDescription& description) {
  const Node* section = program.section("work_offset");
  if (!section) return;
  TableReader reader(*section, "program.work_offset", program.faults());
  for (std::size_t i = 0; i < description.work_offset.size(); ++i) {
    const std::string name = "G" + std::to_string(54 + i);
    const Node* node = reader.section(name);
    if (!node) continue;
    TableReader words(*node, "program.work_offset." + name, program.faults());
    description.work_offset[i] = read_axis_words(words, joints);
    if (!joints.empty()) words.close();
  }
  reader.close();
}

}  // namespace

MeshFile read_mesh_file(TableReader& reader) {
  MeshFile mesh;
  mesh.file = reader.text("file");
  mesh.unit = reader.choice<double>(
      "unit", {{"mm", 1.0}, {"inch", 25.4}, {"cm", 10.0}, {"m", 1000.0}, {"um", units::um}}, 1.0);
  std::error_code failure;
  if (!mesh.file.empty() && !std::filesystem::is_regular_file(mesh.file, failure)) {
    reader.refuse("file", "a file that can be read", "no file " + mesh.file.string());
  }
  return mesh;
}

PartDescription read_part(const Node& table, Faults& faults) {
  TableReader reader(table, "part", faults);
  const std::size_t before = faults.list().size();
  PartDescription part;
  part.name = reader.text("name", "");
  if (reader.has("file")) {
    MeshFile mesh = read_mesh_file(reader);
    mesh.any_size = reader.boolean("any_size", false);
    mesh.open = reader.boolean("open", false);
    part.shape = mesh;
  } else {
    part.shape = read_surface(reader);
    part.vertices = int(reader.integer("vertices", 100, 50'000'000, part.vertices));
  }
  part.T_wm = read_placement(reader);
  read_judged(reader, part);
  part.tolerance = reader.number("tolerance_um", non_negative, 0.0);
  part.rings = read_rings(reader);
  reader.know("file");
  reader.know("surface");
  reader.close();
  const auto* primitive = std::get_if<cutting::Primitive>(&part.shape);
  if (primitive && faults.list().size() == before) check_surface(reader, *primitive);
  return part;
}

ToolDescription read_tool(const Node& table, Faults& faults) {
  TableReader reader(table, "tool", faults);
  ToolDescription tool;
  tool.name = reader.text("name", "");
  const std::string kind = reader.choice<std::string>(
      "kind", {{"ball", "ball"}, {"bull", "bull"}, {"flat", "flat"}, {"nose", "nose"}});
  if (kind == "nose") {
    tool.nominal = cutting::Nose{reader.number("radius_mm", tool_size), {}};
  } else {
    tool.nominal = read_cutter(reader, kind, {}, true);
  }
  tool.length = reader.number("length_mm", tool_length);
  if (const auto number = reader.maybe_integer("number", 0, 999'999)) tool.number = int(*number);
  tool.actual = tool.nominal;
  tool.actual_length = tool.length;
  if (const Node* node = reader.section("actual")) {
    TableReader actual(*node, "tool.actual", faults);
    read_actual_tool(actual, kind, tool);
    actual.close();
  }
  reader.close();
  return tool;
}

ProgramDescription read_program(const Node& table, const std::vector<kinematics::Joint>& joints,
                                Faults& faults) {
  TableReader reader(table, "program", faults);
  ProgramDescription program;
  if (reader.has("file")) {
    program.source = read_program_file(reader);
  } else {
    enum class Generator { Raster, Flank, Spiral };
    const Generator generator =
        reader.choice<Generator>("generator", {{"raster", Generator::Raster},
                                               {"flank", Generator::Flank},
                                               {"spiral", Generator::Spiral}});
    if (generator == Generator::Raster) program.source = read_raster(reader);
    if (generator == Generator::Flank) program.source = read_flank(reader);
    if (generator == Generator::Spiral) program.source = read_spiral(reader);
  }
  program.tool_length = read_tool_lengths(reader);
  read_work_offsets(reader, joints, program);
  reader.know("file");
  reader.know("generator");
  reader.close();
  return program;
}

}  // namespace abbe::sim
