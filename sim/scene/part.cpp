#include "sim/scene/part.h"

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <variant>

#include <fmt/format.h>

#include "cutting/part/mesh_file.h"
#include "cutting/part/primitive.h"
#include "cutting/part/text_mesh_formats.h"
#include "sim/scene/bodies.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"

// The `[part]` section: the keys of its shape, sampling, judged areas, tolerances and rings.

namespace abbe::sim {

std::vector<std::filesystem::path> material_files(const PartDescription& part) {
  const auto* mesh = std::get_if<MeshFile>(&part.shape);
  const bool uses_colours = std::ranges::any_of(
      part.regions, [](const PartRegion& region) { return region.colour.has_value(); });
  // Only OBJ files keep their colours in separate files.
  if (mesh == nullptr || !uses_colours || cutting::lower(mesh->file.extension().string()) != ".obj")
    return {};
  return cutting::material_files(mesh->file);
}

namespace {

using cutting::Cone;
using cutting::Cylinder;
using cutting::Disc;
using cutting::Primitive;
using cutting::RectanglePlane;
using cutting::RevolvedProfile;
using cutting::SphereCap;
using cutting::Torus;
using Ring = PartDescription::Ring;

constexpr Range half_apex_range{0.0, 90.0, true, true};  // deg
constexpr Range part_size{1e-3, 1e5};                    // mm

// Accessors of the shape of a part, for its fields.
constexpr auto primitive_shape = [](auto& part) -> auto& {
  return std::get<Primitive>(part.shape);
};
constexpr auto mesh_shape = [](auto& part) -> auto& { return std::get<MeshFile>(part.shape); };

Fields<RevolvedProfile::ProfileSegment> profile_segment_fields() {
  using ProfileSegment = RevolvedProfile::ProfileSegment;
  return Fields<ProfileSegment>()
      .numbers(required_key("to_mm"), &ProfileSegment::to, 2, "end of the segment, [r, z]")
      .number("arc_radius_mm", &ProfileSegment::arc_radius, any_number,
              "0: straight line; > 0: convex arc; < 0: concave arc");
}

Fields<RevolvedProfile> revolved_profile_fields() {
  const Key start_key = make_numbers_key(required_key("start_mm"), 2,
                                         "start of the profile nearest to the axis, [r, z]");
  const Key profile_key =
      make_key(required_key("profile"), Key::Kind::Tables, "lines and arcs from the start outwards",
               profile_segment_fields().keys());
  return Fields<RevolvedProfile>().custom_field(
      {start_key, profile_key},
      [](TableReader& reader, RevolvedProfile& profile) {
        Eigen::Vector2d start = reader.numbers("start_mm", 2);
        if (!reader.has("profile")) reader.report_missing("profile", "a list of tables");
        for (const Node* node : reader.tables("profile")) {
          profile.profile_segments.push_back(profile_segment_fields().read_table(
              *node, reader.qualified_name("profile"), reader.input_errors()));
          // Each segment starts at the end of the previous one.
          profile.profile_segments.back().from = start;
          start = profile.profile_segments.back().to;
        }
      },
      [](const RevolvedProfile& profile, Node::Table& table) {
        // The start point belongs to the first segment.
        if (profile.profile_segments.empty()) return;
        put_numbers(table, "start_mm", profile.profile_segments.front().from, 1.0);
        put_tables(table, "profile", profile.profile_segments, profile_segment_fields());
      });
}

Fields<RectanglePlane> rectangle_fields() {
  return Fields<RectanglePlane>()
      .number(required_key("length_x_mm"), &RectanglePlane::length_x, part_size,
              "length from edge to edge")
      .number(required_key("length_y_mm"), &RectanglePlane::length_y, part_size,
              "length from edge to edge");
}

Fields<Disc> disc_fields() {
  return Fields<Disc>()
      .number(required_key("radius_mm"), &Disc::radius, part_size, "radius of the rim")
      .number("inner_radius_mm", &Disc::inner_radius, non_negative, "radius of the hole of a ring");
}

Fields<Cylinder> cylinder_surface_fields() {
  return Fields<Cylinder>()
      .number(required_key("radius_mm"), &Cylinder::radius, part_size, "radius of the wall")
      .number(required_key("height_mm"), &Cylinder::height, part_size, "height above z = 0");
}

Fields<Cone> cone_fields() {
  return Fields<Cone>()
      .number(required_key("base_radius_mm"), &Cone::base_radius, part_size, "radius at z = 0")
      .number(required_key("height_mm"), &Cone::height, part_size, "height above z = 0")
      .number(required_key("half_apex_deg"), &Cone::half_apex_angle, half_apex_range,
              "angle between the axis and the wall");
}

Fields<SphereCap> sphere_cap_fields() {
  return Fields<SphereCap>()
      .number(required_key("radius_mm"), &SphereCap::radius, part_size, "radius of the sphere")
      .number(required_key("rim_radius_mm"), &SphereCap::rim_radius, part_size,
              "distance of the rim from the axis, at most the radius of the sphere");
}

Fields<Torus> torus_fields() {
  return Fields<Torus>()
      .number(required_key("radius_mm"), &Torus::radius, part_size,
              "radius of the centre line of the tube")
      .number(required_key("tube_radius_mm"), &Torus::tube_radius, part_size,
              "radius of the tube, at most that of the centre line");
}

Fields<PartDescription> primitive_fields() {
  return Fields<PartDescription>()
      .variant(
          required_key("surface").in_exclusive_group("shape"), primitive_shape,
          {alternative<Primitive>("rectangle", rectangle_fields(),
                                  "at z = 0, centred on the origin"),
           alternative<Primitive>("disc", disc_fields(), "a disc or ring at z = 0"),
           alternative<Primitive>("cylinder", cylinder_surface_fields(), "the outer wall about z"),
           alternative<Primitive>("cone", cone_fields(),
                                  "the outer wall of a frustum that narrows upwards"),
           alternative<Primitive>("sphere_cap", sphere_cap_fields(),
                                  "a dome with its top at z = 0"),
           alternative<Primitive>("torus", torus_fields(), "the half above z = 0"),
           alternative<Primitive>("revolved", revolved_profile_fields(),
                                  "a profile revolved about z")},
          "an exact surface, if there is no `file`")
      .integer("vertices", &PartDescription::vertices, 100, 50'000'000,
               "number of vertices on a `surface`; a mesh has its own");
}

Fields<PartDescription> mesh_fields() {
  return Fields<PartDescription>().include_fields(
      mesh_shape, mesh_file_fields(required_key("file").in_exclusive_group("shape"))
                      .boolean("open", &MeshFile::open, "true: the mesh is meant to have a rim"));
}

Fields<PartSampling> part_sampling_fields() {
  using Kind = PartSampling::Kind;
  return Fields<PartSampling>()
      .choice(
          KeyName("sampling").with_fallback("adaptive; vertices if `vertices` is given"),
          &PartSampling::kind,
          {{"adaptive", Kind::Adaptive,
            "vertices are added where the residual is not linear between them, as on crests "
            "between passes"},
           {"spacing", Kind::Spacing, "no judged edge is longer than `spacing_mm`"},
           {"vertices", Kind::Vertices, "the vertices of the mesh, or as many as `vertices`"}},
          "where on the part `run` and `compare` evaluate the residual; studies use the vertices")
      .number(KeyName("resolution_um").with_fallback("10 % of the error-free PV, at least 0.05"),
              &PartSampling::resolution, positive,
              "largest error of linear interpolation between vertices: adaptive sampling achieves "
              "it, and a warning is given if another sampling does not")
      .number("spacing_mm", &PartSampling::spacing, positive,
              "longest edge with `sampling = \"spacing\"`")
      .number("finest_mm", &PartSampling::min_edge_length, {1e-6, 1e3, false, false},
              "shortest edge that adaptive sampling makes")
      .integer(
          "points", &PartSampling::points, 100, 50'000'000,
          "largest number of points of the sampling; a warning is given if they do not suffice");
}

bool is_mesh(const PartDescription& part) { return std::holds_alternative<MeshFile>(part.shape); }

void select_shape(TableReader& reader, PartDescription& part) {
  // The kind of shape determines which of the following fields are read.
  if (reader.has("file")) part.shape = MeshFile{};
  reader.accept_key("file");
  reader.accept_key("surface");
}

Fields<PartDescription> judged_fields() {
  return Fields<PartDescription>()
      .number(KeyName("judged_radius_max_mm").with_fallback("all"),
              &PartDescription::judged_radius_max, positive,
              "largest distance from the part's z axis; vertices beyond it are not judged")
      .number(KeyName("judged_radius_min_mm").with_fallback("all"),
              &PartDescription::judged_radius_min, non_negative,
              "smallest distance from the part's z axis; vertices within it are not judged")
      .check([](TableReader& reader, PartDescription& part) {
        // Otherwise the judged ring would contain no vertex.
        if (part.judged_radius_min && part.judged_radius_max &&
            !(*part.judged_radius_min < *part.judged_radius_max))
          reader.report_invalid("judged_radius_min_mm", "less than judged_radius_max_mm",
                                fmt::format("{:.6g} and {:.6g} mm", *part.judged_radius_min,
                                            *part.judged_radius_max));
      })
      .choice("judged", &PartDescription::judged,
              {{"cut", PartDescription::JudgedArea::Cut,
                "the area that the program is meant to cut: the error-free tool comes within the "
                "search band there, its corner radius fits the design, and the sweep does not lead "
                "out next to an uncut area"},
               {"all", PartDescription::JudgedArea::All, "the whole surface"},
               {"regions", PartDescription::JudgedArea::Regions,
                "everything in a `[[part.region]]`, cut or not"}},
              "vertices that are judged, among those that the keys below admit")
      .only_if(
          is_mesh,
          Fields<PartDescription>()
              .choice("facets", &PartDescription::flat_facets,
                      {{"smooth", false,
                        "the surface between vertices is the smooth surface that vertices and "
                        "normals imply, up to sharp edges"},
                       {"flat", true, "the facets themselves are the surface"}},
                      "of a mesh: surface that is judged between the vertices")
              .number("recognise_um", &PartDescription::recognition_tolerance, non_negative,
                      "of a mesh: a face whose vertices lie within this distance of a plane, "
                      "sphere, cylinder, cone or torus is replaced by that surface, so that its "
                      "facets do not appear; 0: never")
              .number("edge_angle_deg", &PartDescription::edge_angle, {1.0, 179.0, false, false},
                      "of a mesh: triangles that meet at a sharper angle belong to separate faces, "
                      "each judged along its own normal")
              .number(KeyName("edge_margin_mm")
                          .with_fallback("1/20 of the smallest tool radius; 0 with "
                                         "sampling = \"vertices\""),
                      &PartDescription::edge_margin, non_negative,
                      "of a mesh: distance from sharp edges; vertices nearer are not judged")
              .number(KeyName("judged_normal_z").with_fallback("all"),
                      &PartDescription::judged_normal_z, {-1.0, 1.0, false, false},
                      "of a mesh: smallest z of the normal of a judged vertex")
              .number(KeyName("judged_margin_mm").with_fallback("all"),
                      &PartDescription::judged_margin, non_negative,
                      "of a mesh: distance from the rim; vertices nearer are not judged"));
}

Fields<Ring> ring_fields() {
  return Fields<Ring>()
      .text(required_key("name"), &Ring::name, "name of the ring; must be unique")
      .number(required_key("along_mm"), &Ring::z_middle, any_number,
              "z of its middle, in the part frame")
      .number(required_key("width_mm"), &Ring::width, positive, "width along z");
}

void read_rings(TableReader& reader, PartDescription& part) {
  std::vector<Ring>& rings = part.rings;
  for (const Node* node : reader.tables("ring")) {
    TableReader ring_reader(*node, reader.qualified_name("ring"), reader.input_errors());
    rings.push_back(ring_fields().read(ring_reader));
    ring_reader.close();
    // `summary.json` reports rings by name.
    for (std::size_t i = 0; i + 1 < rings.size(); ++i)
      if (rings[i].name == rings.back().name)
        ring_reader.report_invalid("name", "a name that no other ring has",
                                   "\"" + rings[i].name + "\" again");
  }
}

constexpr const char* tolerance_key = "tolerance_um";

/// Reads a tolerance, stated as a half width or as [lower, upper]. Returns nothing if the key is
/// missing or the half width is 0.
std::optional<Tolerance> read_tolerance(TableReader& reader) {
  const Node* node = reader.accept_key(tolerance_key);
  if (!node) return std::nullopt;
  if (!node->array()) {
    const double half_width = reader.number(tolerance_key, non_negative);
    return half_width > 0.0 ? std::optional(Tolerance{-half_width, half_width}) : std::nullopt;
  }
  const Eigen::VectorXd limits = reader.numbers(tolerance_key, 2);
  if (limits.size() == 2 && limits[0] < limits[1]) return Tolerance{limits[0], limits[1]};
  if (limits.size() == 2)
    reader.report_invalid(
        tolerance_key, "[lower, upper] with the lower limit first",
        fmt::format("[{:.6g}, {:.6g}]", in_unit(limits[0], unit_factor(tolerance_key)),
                    in_unit(limits[1], unit_factor(tolerance_key))));
  return std::nullopt;
}

/// Writes a tolerance as `read_tolerance` reads it.
void put_tolerance(const std::optional<Tolerance>& tolerance, Node::Table& table) {
  const double unit = unit_factor(tolerance_key);
  const Tolerance limits = tolerance.value_or(Tolerance{});
  // Symmetric limits are written as a half width; no tolerance as 0.
  if (limits.lower == -limits.upper)
    put_value(table, tolerance_key, in_unit(limits.upper, unit));
  else
    put_numbers(table, tolerance_key, Eigen::Vector2d(limits.lower, limits.upper), unit);
}

Key make_tolerance_key(KeyName name, const char* sentence) {
  Key key = make_key(name, Key::Kind::NumberOrNumbers, sentence);
  key.range = non_negative;
  key.size = 2;
  return key;
}

void read_colour(TableReader& reader, PartRegion& region) {
  const std::string text = reader.text("colour", "");
  // Without the key the region has faces of every colour.
  if (text.empty()) return;
  region.colour = cutting::parse_hex_colour(text);
  if (!region.colour)
    reader.report_invalid("colour", "\"#rrggbb\", such as \"#ff8000\"", "\"" + text + "\"");
}

Fields<PartRegion> region_fields() {
  using Region = PartRegion;
  return Fields<Region>()
      .text(required_key("name"), &Region::name, "name of the region")
      .custom_field(
          {make_tolerance_key(KeyName(tolerance_key).with_fallback("that of the part"),
                              "tolerance, as in `part.tolerance_um`, above 0")},
          [](TableReader& reader, Region& region) {
            const std::size_t error_count = reader.input_errors().list().size();
            region.tolerance = read_tolerance(reader);
            // For a part the tolerance 0 means none. For a region it would mean the tolerance of
            // the part, so it is rejected.
            const bool is_zero = !region.tolerance && reader.has(tolerance_key);
            if (is_zero && reader.input_errors().list().size() == error_count)
              reader.report_invalid(tolerance_key, "above 0", "0");
          },
          [](const Region& region, Node::Table& table) {
            if (region.tolerance) put_tolerance(region.tolerance, table);
          })
      .boolean("judged", &Region::judged, "true: vertices in the region have a verdict")
      .numbers("z_mm", &Region::z, 2, "`[from, to]` of z in the part frame")
      .numbers("radius_mm", &Region::radius, 2,
               "`[from, to]` of the distance from the part's z axis")
      .numbers("box_mm", &Region::box, 6, "smallest x, y, z, then largest, in the part frame")
      .text(
          "group", &Region::group,
          "of a mesh: faces with this name in the file: `g`, `o` or `usemtl` (OBJ), `solid` (ASCII "
          "STL), or name and value of an integer property of the faces (PLY), such as \"label 3\"")
      .custom_field({make_key("colour", Key::Kind::Text,
                              "of a mesh: \"#rrggbb\", faces of this colour: PLY, OFF, binary STL "
                              "(5 bits, to which the 8 bits are truncated or rounded), OBJ (Kd of "
                              "its .mtl); fractions match within 1 / 255")},
                    read_colour,
                    [](const Region& region, Node::Table& table) {
                      if (region.colour)
                        put_value(table, "colour", cutting::hex_text(*region.colour));
                    })
      .check([](TableReader& reader, Region& region) {
        const auto check_order = [&](const char* key,
                                     const std::optional<Eigen::VectorXd>& limits) {
          // The first half of the numbers are lower limits, the second half upper limits.
          const Eigen::Index half_size = limits ? limits->size() / 2 : 0;
          if (half_size > 0 &&
              !(limits->head(half_size).array() <= limits->tail(half_size).array()).all())
            reader.report_invalid(key, "the lower limits first",
                                  "a lower limit above its upper limit");
        };
        check_order("z_mm", region.z);
        check_order("radius_mm", region.radius);
        check_order("box_mm", region.box);
      });
}

void read_regions(TableReader& reader, PartDescription& part) {
  for (const Node* node : reader.tables("region")) {
    TableReader region_reader(*node, reader.qualified_name("region"), reader.input_errors());
    part.regions.push_back(region_fields().read(region_reader));
    part.regions.back().position = node->position;
    // Only meshes have faces with groups and colours.
    for (const char* key : {"group", "colour"})
      if (region_reader.has(key) && !is_mesh(part))
        region_reader.report_invalid(key, "a part from a mesh `file`",
                                     "a declared surface, which has no faces");
    region_reader.close();
  }
}

Fields<PartDescription> tolerance_fields() {
  return Fields<PartDescription>()
      .custom_field(
          {make_tolerance_key(
              KeyName(tolerance_key).with_fallback("none"),
              "largest residual to either side of the design, or `[lower, upper]`, where + is "
              "material left; with it a case has a verdict, PASS or FAIL (which `limits.tolerance` "
              "makes an exit code), and a map of tolerance bands, `tolerance.png`; 0: none")},
          [](TableReader& reader, PartDescription& part) {
            part.tolerance = read_tolerance(reader);
          },
          [](const PartDescription& part, Node::Table& table) {
            put_tolerance(part.tolerance, table);
          })
      .tables("region", &PartDescription::regions, region_fields(),
              "region with its own tolerance or verdict: the points that meet all of its keys; "
              "where regions overlap, the last one applies",
              read_regions);
}

const Fields<PartDescription>& part_fields() {
  static const Fields<PartDescription> fields =
      Fields<PartDescription>()
          .text("name", &PartDescription::name, "name of the part")
          .check(select_shape)
          .only_if(is_mesh, mesh_fields())
          .only_if(std::not_fn(is_mesh), primitive_fields())
          .include_fields(&PartDescription::T_wm, placement_fields())
          .include_fields(&PartDescription::sampling, part_sampling_fields())
          .check([](TableReader& reader, PartDescription& part) {
            // A user who states the number of vertices wants these vertices and no refinement.
            if (reader.has("vertices") && !reader.has("sampling"))
              part.sampling.kind = PartSampling::Kind::Vertices;
          })
          .include_fields(whole_struct, judged_fields())
          .number(
              "form_cutoff_mm", &PartDescription::form_cutoff, part_size,
              "cutoff of the areal Gaussian filter (ISO 16610-61) that separates form from texture")
          .include_fields(whole_struct, tolerance_fields())
          .custom_field({make_key("ring", Key::Kind::Tables,
                                  "ring in which the radius of a part of revolution is reported: "
                                  "`radii_um` in `summary.json` is the mean radius about z of what "
                                  "was cut there, null if nothing was",
                                  ring_fields().keys())},
                        read_rings, [](const PartDescription& part, Node::Table& table) {
                          put_tables(table, "ring", part.rings, ring_fields());
                        });
  return fields;
}

/// Adds an input error if the dimensions of a primitive are inconsistent.
void check_primitive(TableReader& reader, const Primitive& primitive) {
  // A rectangle has no profile, and its lengths are checked by their keys.
  if (std::holds_alternative<RectanglePlane>(primitive)) return;
  try {
    cutting::profile(primitive);
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("surface", "a valid surface from the keys of part", error.what());
  }
}

}  // namespace

PartDescription read_part(const Node& table, InputErrors& input_errors) {
  TableReader reader(table, "part", input_errors);
  const std::size_t error_count = input_errors.list().size();
  PartDescription part = part_fields().read(reader);
  reader.close();
  // If a key is invalid, the profile is built from defaults, and its errors would be misleading.
  if (!is_mesh(part) && input_errors.list().size() == error_count)
    check_primitive(reader, primitive_shape(part));
  return part;
}

Node::Table part_to_table(const PartDescription& part) { return part_fields().to_table(part); }

std::vector<Key> part_keys() { return part_fields().keys(); }

}  // namespace abbe::sim
