#include <functional>
#include <stdexcept>

#include "cutting/primitive.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {

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

constexpr Range half_turn_open{0.0, 90.0, true, true};
constexpr Range part_size{1e-3, 1e5};  // mm

constexpr auto declared = [](auto& part) -> auto& { return std::get<Primitive>(part.shape); };
constexpr auto mesh = [](auto& part) -> auto& { return std::get<MeshFile>(part.shape); };

Fields<RevolvedProfile::Piece> piece_fields() {
  using Piece = RevolvedProfile::Piece;
  return Fields<Piece>()
      .numbers(must("to_mm"), &Piece::to, 2, "its end, [r, z]")
      .number("arc_radius_mm", &Piece::arc_radius, any_number,
              "0: a line; above: an arc that is convex, below: one that is concave");
}

Fields<RevolvedProfile> profile_fields() {
  const Key start = key_of_numbers(must("start_mm"), 2, "[r, z] nearest to the axis");
  const Key pieces = key_of(must("profile"), Key::Kind::Tables,
                            "lines and arcs from there outwards", piece_fields().keys());
  return Fields<RevolvedProfile>().custom(
      {start, pieces},
      [](TableReader& reader, RevolvedProfile& profile) {
        Eigen::Vector2d from = reader.numbers("start_mm", 2);
        if (!reader.has("profile")) reader.missing("profile", "a list of tables");
        for (const Node* node : reader.tables("profile")) {
          profile.pieces.push_back(
              piece_fields().read_table(*node, reader.name_of("profile"), reader.faults()));
          profile.pieces.back().from = from;
          from = profile.pieces.back().to;
        }
      },
      [](const RevolvedProfile& profile, Node::Table& table) {
        if (profile.pieces.empty()) return;
        put_numbers(table, "start_mm", profile.pieces.front().from, 1.0);
        put_tables(table, "profile", profile.pieces, piece_fields());
      });
}

Fields<RectanglePlane> rectangle_fields() {
  return Fields<RectanglePlane>()
      .number(must("length_x_mm"), &RectanglePlane::length_x, part_size, "from edge to edge")
      .number(must("length_y_mm"), &RectanglePlane::length_y, part_size, "from edge to edge");
}

Fields<Disc> disc_fields() {
  return Fields<Disc>()
      .number(must("radius_mm"), &Disc::radius, part_size, "of the rim")
      .number("inner_radius_mm", &Disc::inner_radius, non_negative, "of the hole of a ring");
}

Fields<Cylinder> cylinder_surface_fields() {
  return Fields<Cylinder>()
      .number(must("radius_mm"), &Cylinder::radius, part_size, "of the wall")
      .number(must("height_mm"), &Cylinder::height, part_size, "from z = 0 upwards");
}

Fields<Cone> cone_fields() {
  return Fields<Cone>()
      .number(must("base_radius_mm"), &Cone::base_radius, part_size, "at z = 0")
      .number(must("height_mm"), &Cone::height, part_size, "from z = 0 upwards")
      .number(must("half_apex_deg"), &Cone::half_apex_angle, half_turn_open,
              "between the axis and the wall");
}

Fields<SphereCap> sphere_cap_fields() {
  return Fields<SphereCap>()
      .number(must("radius_mm"), &SphereCap::radius, part_size, "of the sphere")
      .number(must("rim_radius_mm"), &SphereCap::rim_radius, part_size,
              "from the axis, at most that of the sphere");
}

Fields<Torus> torus_fields() {
  return Fields<Torus>()
      .number(must("radius_mm"), &Torus::radius, part_size, "of the centre line of the tube")
      .number(must("tube_radius_mm"), &Torus::tube_radius, part_size,
              "at most that of the centre line");
}

Fields<PartDescription> declared_fields() {
  return Fields<PartDescription>()
      .kinds(
          must("surface").one_of("shape"), declared,
          {alternative<Primitive>("rectangle", rectangle_fields(), "z = 0 about the origin"),
           alternative<Primitive>("disc", disc_fields(), "a disc or ring at z = 0"),
           alternative<Primitive>("cylinder", cylinder_surface_fields(), "the outer wall about z"),
           alternative<Primitive>("cone", cone_fields(),
                                  "the outer wall of a frustum, narrower upwards"),
           alternative<Primitive>("sphere_cap", sphere_cap_fields(), "a dome, its top at z = 0"),
           alternative<Primitive>("torus", torus_fields(), "the half above z = 0"),
           alternative<Primitive>("revolved", profile_fields(), "a profile turned about z")},
          "an exact surface, unless there is a `file`")
      .whole("vertices", &PartDescription::vertices, 100, 50'000'000,
             "wanted on a `surface`; a mesh has its own");
}

Fields<PartDescription> mesh_fields() {
  return Fields<PartDescription>().all_of(
      mesh, mesh_file_fields(must("file").one_of("shape"))
                .boolean("any_size", &MeshFile::any_size,
                         "of a mesh: one far smaller or larger than the machine's travel is meant, "
                         "else its unit is doubted")
                .boolean("open", &MeshFile::open, "of a mesh: a rim is meant"));
}

bool is_mesh(const PartDescription& part) { return std::holds_alternative<MeshFile>(part.shape); }

void choose_shape(TableReader& reader, PartDescription& part) {
  if (reader.has("file")) part.shape = MeshFile{};
  reader.know("file");
  reader.know("surface");
}

Fields<PartDescription> judged_fields() {
  return Fields<PartDescription>()
      .number(KeyName("judged_radius_max_mm").otherwise("all"), &PartDescription::judged_radius_max,
              positive, "from the part's z axis; vertices beyond are not judged")
      .number(KeyName("judged_radius_min_mm").otherwise("all"), &PartDescription::judged_radius_min,
              non_negative, "from the part's z axis; vertices nearer are not judged")
      .check([](TableReader& reader, PartDescription& part) {
        if (part.judged_radius_min && part.judged_radius_max &&
            !(*part.judged_radius_min < *part.judged_radius_max))
          reader.refuse("judged_radius_min_mm", "less than judged_radius_max_mm", "not less");
      })
      .where(is_mesh, Fields<PartDescription>()
                          .number(KeyName("judged_normal_z").otherwise("all"),
                                  &PartDescription::judged_normal_z, {-1.0, 1.0, false, false},
                                  "of a mesh: least z of the normal of a vertex that is judged")
                          .number(KeyName("judged_margin_mm").otherwise("all"),
                                  &PartDescription::judged_margin, non_negative,
                                  "of a mesh: from the rim; vertices nearer are not judged"));
}

Fields<Ring> ring_fields() {
  return Fields<Ring>()
      .text(must("name"), &Ring::name, "that no other ring has")
      .number(must("along_mm"), &Ring::along, any_number, "its middle, z of the part")
      .number(must("width_mm"), &Ring::width, positive, "along z");
}

void read_rings(TableReader& reader, PartDescription& part) {
  std::vector<Ring>& rings = part.rings;
  for (const Node* node : reader.tables("ring")) {
    TableReader ring(*node, reader.name_of("ring"), reader.faults());
    rings.push_back(ring_fields().read(ring));
    ring.close();
    for (std::size_t i = 0; i + 1 < rings.size(); ++i)
      if (rings[i].name == rings.back().name)
        ring.refuse("name", "a name that no other ring has", "\"" + rings[i].name + "\" again");
  }
}

const Fields<PartDescription>& part_fields() {
  static const Fields<PartDescription> fields =
      Fields<PartDescription>()
          .text("name", &PartDescription::name, "of the part")
          .check(choose_shape)
          .where(is_mesh, mesh_fields())
          .where(std::not_fn(is_mesh), declared_fields())
          .all_of(&PartDescription::T_wm, placement_fields())
          .all_of(itself, judged_fields())
          .number(KeyName("tolerance_um").otherwise("none"), &PartDescription::tolerance,
                  non_negative, "to either side of the design")
          .custom(
              {key_of("ring", Key::Kind::Tables,
                      "where the radius of a part of revolution is reported: `radii_um` in "
                      "`summary.json` is the mean radius about z of what was cut there, null where "
                      "nothing was",
                      ring_fields().keys())},
              read_rings, [](const PartDescription& part, Node::Table& table) {
                put_tables(table, "ring", part.rings, ring_fields());
              });
  return fields;
}

void check_surface(TableReader& reader, const Primitive& primitive) {
  if (std::holds_alternative<RectanglePlane>(primitive)) return;  // checked number by number
  try {
    cutting::profile(primitive);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("surface", "a surface that can be, of the keys of part", fault.what());
  }
}

}  // namespace

PartDescription read_part(const Node& table, Faults& faults) {
  TableReader reader(table, "part", faults);
  const std::size_t before = faults.list().size();
  PartDescription part = part_fields().read(reader);
  reader.close();
  if (!is_mesh(part) && faults.list().size() == before) check_surface(reader, declared(part));
  return part;
}

Node::Table written_part(const PartDescription& part) { return part_fields().written(part); }

std::vector<Key> part_keys() { return part_fields().keys(); }

}  // namespace abbe::sim
