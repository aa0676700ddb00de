#include "sim/scene/bodies.h"

#include <functional>
#include <stdexcept>
#include <string>
#include <system_error>

#include <fmt/format.h>

#include "cutting/stock/body.h"
#include "kinematics/units.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

Fields<MeshFile> mesh_file_fields(const KeyName& file) {
  return Fields<MeshFile>()
      .text(file, &MeshFile::file, "mesh file; faces with more than three corners are split")
      .choice("unit", &MeshFile::unit,
              {{"mm", 1.0}, {"inch", units::inch}, {"cm", 10.0}, {"m", 1000.0}, {"um", units::um}},
              "unit of the numbers in the mesh")
      .boolean("any_size", &MeshFile::is_size_intended,
               "true: the size of the mesh is intended; otherwise a warning is given if it is "
               "below 1 mm or does not fit the travel or the program")
      .check([](TableReader& reader, MeshFile& mesh) {
        // Errors inside the mesh are found when it is loaded; they are then reported at the
        // position of the file name.
        if (const Node* file = reader.node().find("file")) mesh.position = file->position;
        std::error_code error_code;
        if (!mesh.file.empty() && !std::filesystem::is_regular_file(mesh.file, error_code))
          reader.report_invalid("file", "a file that can be read", missing_file_text(mesh.file));
      });
}

namespace {

constexpr Range body_size{0.0, 100'000.0, true, false};  // mm
constexpr Range scale_range{0.0, 1e6, true, false};

void read_size(TableReader& reader, BoxShape& box) {
  // If the vector itself is invalid, that is reported already. A second message about its values
  // would mislead.
  const std::size_t error_count = reader.input_errors().list().size();
  box.size = reader.vector("size_mm");
  const bool is_vector =
      reader.has("size_mm") && reader.input_errors().list().size() == error_count;
  // The negated comparison also rejects NaN.
  if (is_vector && !(box.size.minCoeff() > 0.0 && box.size.maxCoeff() <= body_size.max))
    reader.report_invalid(
        "size_mm",
        fmt::format("three sizes above 0 and at most {:g} mm for size_mm", body_size.max),
        fmt::format("{:g}, {:g}, {:g}", box.size.x(), box.size.y(), box.size.z()));
}

Fields<BoxShape> box_shape_fields() {
  return Fields<BoxShape>().custom_field(
      {make_numbers_key(required_key("size_mm"), 3, "lengths along its own x, y and z, above 0")},
      read_size, [](const BoxShape& box, Node::Table& table) {
        put_numbers(table, "size_mm", box.size, 1.0);
      });
}

Fields<CylinderShape> cylinder_shape_fields() {
  return Fields<CylinderShape>()
      .number(required_key("radius_mm"), &CylinderShape::radius, body_size,
              "radius about its own z")
      .number(required_key("height_mm"), &CylinderShape::height, body_size,
              "height above its own z = 0");
}

Fields<ConeShape> cone_shape_fields() {
  const Range radius{0.0, body_size.max};
  return Fields<ConeShape>()
      .number(required_key("radius_below_mm"), &ConeShape::radius_below, radius,
              "radius about its own z, at z = 0")
      .number(required_key("radius_above_mm"), &ConeShape::radius_above, radius,
              "radius at its upper end")
      .number(required_key("height_mm"), &ConeShape::height, body_size,
              "height above its own z = 0")
      .check([](TableReader& reader, ConeShape& cone) {
        // A cone with both radii zero encloses no volume; one zero radius makes a valid tip.
        if (reader.has("radius_below_mm") && reader.has("radius_above_mm") &&
            !(cone.radius_below + cone.radius_above > 0.0))
          reader.report_invalid("radius_above_mm", "at least one radius above 0 for a cone",
                                "two radii of 0");
      });
}

Fields<SphereShape> sphere_fields() {
  return Fields<SphereShape>().number(required_key("radius_mm"), &SphereShape::radius, body_size,
                                      "radius of the sphere");
}

/// Reads two lists of equal length as the columns of points.
Eigen::MatrixX2d read_points(TableReader& reader, const char* first_key, const char* second_key) {
  constexpr Eigen::Index max_points = 10000;
  const auto x = reader.maybe_numbers(first_key), y = reader.maybe_numbers(second_key);
  // Both keys are tested before the function returns, so that one run reports both.
  if (!reader.has(first_key)) reader.report_missing(first_key, "a list of numbers");
  if (!reader.has(second_key)) reader.report_missing(second_key, "a list of numbers");
  if (!x || !y) return Eigen::MatrixX2d(0, 2);
  if (x->size() != y->size() || x->size() < 2 || x->size() > max_points) {
    reader.report_invalid(second_key,
                          fmt::format("as many numbers as {}, from 2 to {}", first_key, max_points),
                          fmt::format("{} and {}", x->size(), y->size()));
    return Eigen::MatrixX2d(0, 2);
  }
  Eigen::MatrixX2d points(x->size(), 2);
  points << *x, *y;
  return points;
}

/// Returns the fields of two keys that hold the first and second coordinates of a list of points.
/// @param first_sentence, second_sentence  descriptions of the keys for the manual
/// @param validate  returns what is wrong with the points; empty if they are valid
Fields<Eigen::MatrixX2d> point_fields(
    const char* first_key, const char* first_sentence, const char* second_key,
    const char* second_sentence,
    const std::function<std::string(const Eigen::MatrixX2d&)>& validate) {
  return Fields<Eigen::MatrixX2d>(Eigen::MatrixX2d(0, 2))
      .custom_field(
          {make_numbers_key(required_key(first_key), 0, first_sentence),
           make_numbers_key(required_key(second_key), 0, second_sentence)},
          [=](TableReader& reader, Eigen::MatrixX2d& points) {
            points = read_points(reader, first_key, second_key);
            // An empty matrix means that read_points() has already reported the error.
            if (points.rows() == 0) return;
            if (const std::string message = validate(points); !message.empty())
              reader.report_invalid(
                  second_key,
                  fmt::format("{} and {} that describe a valid body", first_key, second_key),
                  message);
          },
          [=](const Eigen::MatrixX2d& points, Node::Table& table) {
            if (points.rows() == 0) return;
            put_numbers(table, first_key, points.col(0), 1.0);
            put_numbers(table, second_key, points.col(1), 1.0);
          });
}

/// Returns what is wrong with a profile; empty if it is valid.
std::string profile_error(const Eigen::MatrixX2d& profile) {
  // Comparisons are negated so that NaN is rejected as well.
  if (!(profile.col(0).minCoeff() >= 0.0)) return "a negative radius";
  if (!(profile.col(0).maxCoeff() > 0.0)) return "no radius above 0";
  for (Eigen::Index i = 1; i < profile.rows(); ++i) {
    // Equal heights are allowed, since they form a flat ring; falling heights would fold the
    // surface.
    if (profile(i, 1) < profile(i - 1, 1))
      return fmt::format("decreasing heights, {:g} mm after {:g} mm", profile(i, 1),
                         profile(i - 1, 1));
    if (profile.row(i) == profile.row(i - 1)) return "the same point twice";
    // A segment on the axis has no area and would give degenerate faces.
    if (profile(i, 0) == 0.0 && profile(i - 1, 0) == 0.0) return "a segment on the axis";
  }
  // A profile of a single height encloses no volume.
  if (!(profile(profile.rows() - 1, 1) > profile(0, 1))) return "a single height";
  return {};
}

/// Returns what is wrong with an outline; empty if it is valid.
std::string outline_error(const Eigen::MatrixX2d& outline) {
  try {
    // Building the mesh is the test, so that the reader accepts exactly the outlines it can mesh.
    cutting::extruded_mesh(outline, 1.0);
    return {};
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

Fields<RevolvedShape> revolved_fields() {
  return Fields<RevolvedShape>().include_fields(&RevolvedShape::profile,
                                                profile_fields("from its own z = 0"));
}

Fields<ExtrudedShape> extruded_fields() {
  return Fields<ExtrudedShape>()
      .include_fields(
          &ExtrudedShape::outline,
          point_fields("x_mm", "x of the corners, counter-clockwise seen from its own +z", "y_mm",
                       "y of the same corners", outline_error))
      .number(required_key("height_mm"), &ExtrudedShape::height, body_size,
              "height above its own z = 0");
}

Fields<MeshShape> mesh_shape_fields() {
  return Fields<MeshShape>()
      .include_fields(&MeshShape::mesh, mesh_file_fields(required_key("file")))
      .number_as_written("scale", &MeshShape::scale, scale_range,
                         "factor applied to the coordinates in the file, in addition to its unit");
}

}  // namespace

Fields<Eigen::MatrixX2d> profile_fields(const char* height_origin) {
  const std::string heights_sentence =
      fmt::format("heights of the same points, ascending, measured {}", height_origin);
  return point_fields("radii_mm", "radii of the profile points about the axis, 0 or more",
                      "heights_mm", heights_sentence.c_str(), profile_error);
}

Fields<BodyDescription> body_fields() {
  return Fields<BodyDescription>()
      .text("name", &BodyDescription::name, "name of the body, used in reports")
      .variant(
          KeyName("shape").with_fallback("box"), &BodyDescription::shape,
          {alternative<BodyShape>("box", box_shape_fields(), "centred on the origin"),
           alternative<BodyShape>("cylinder", cylinder_shape_fields(), "axis along z"),
           alternative<BodyShape>("cone", cone_shape_fields(), "axis along z"),
           alternative<BodyShape>("sphere", sphere_fields()),
           alternative<BodyShape>("revolution", revolved_fields(), "a profile revolved about z"),
           alternative<BodyShape>("extrusion", extruded_fields(), "an outline extruded along z"),
           alternative<BodyShape>("mesh", mesh_shape_fields(),
                                  "a closed STL, OBJ, PLY or OFF mesh")},
          "shape of the body")
      .include_fields(&BodyDescription::T, placement_fields());
}

const Fields<CollisionDescription>& collision_fields() {
  using Pair = CollisionDescription::Pair;
  static const Fields<Pair> pair = Fields<Pair>()
                                       .text(required_key("a"), &Pair::a, "name of a body")
                                       .text(required_key("b"), &Pair::b, "name of the other body");
  static const Fields<CollisionDescription> fields =
      Fields<CollisionDescription>()
          .boolean("on", &CollisionDescription::is_enabled,
                   "true: every run checks for collisions, and exits with 1 if there are any")
          .boolean("stop", &CollisionDescription::stop,
                   "true: a run with a collision ends before anything is cut")
          .number("clearance_mm", &CollisionDescription::clearance, non_negative,
                  "bodies closer than this are reported as a near miss")
          .number("gouge_mm", &CollisionDescription::gouge, {0.0, 10.0},
                  "a cutter or shank deeper in the part than this collides with it")
          .number("resolution_mm", &CollisionDescription::resolution, {1e-4, 1.0},
                  "bodies closer than this are in contact")
          .tables("ignore", &CollisionDescription::ignore, pair,
                  "pairs of bodies that may touch and are not checked");
  return fields;
}

}  // namespace abbe::sim
