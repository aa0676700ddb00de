#include <fmt/format.h>

#include "sim/scene/scene_tool_forms.h"

namespace abbe::sim {

namespace {

using cutting::Insert;
using cutting::Nose;
using cutting::OutlinePoint;
using Points = std::vector<OutlinePoint>;

constexpr Range edge_size{0.0, 10'000.0, true, false};  // mm
constexpr Range edge_angle{0.0, 179.0};                 // deg

Fields<Insert> insert_dimensions(Asked asked) {
  return Fields<Insert>()
      .number(asked("radius_mm"), &Insert::radius, edge_size, "of the nose")
      .number(asked("cutting_edge_angle_deg"), &Insert::major, edge_angle,
              "ISO 3002-1 κr, from the feed -x to the edge ahead, upwards")
      .number(asked("minor_edge_angle_deg"), &Insert::minor, edge_angle,
              "κr', from +x to the edge behind, upwards; with κr 1 to 179 deg")
      .number(asked("cutting_edge_mm"), &Insert::major_length, edge_size,
              "length of the edge ahead, from the nose")
      .number(asked("minor_edge_mm"), &Insert::minor_length, edge_size,
              "length of the edge behind, from nose or wiper")
      .number(left_out(asked, "wiper_mm"), &Insert::wiper, non_negative,
              "b_s, a flat along x from below the centre of the nose to the minor edge");
}

/// @return empty after a fault
Points read_edge(TableReader& reader) {
  const auto x = reader.maybe_numbers("x_mm"), z = reader.maybe_numbers("z_mm");
  const auto arcs = reader.maybe_numbers("arc_radii_mm");
  if (!x || !z) return {};
  const auto expect_as_many = [&](const char* key, Eigen::Index seen) {
    if (seen == x->size()) return true;
    reader.refuse(key, fmt::format("as many numbers as x_mm, {}", x->size()), std::to_string(seen));
    return false;
  };
  if (!expect_as_many("z_mm", z->size()) || (arcs && !expect_as_many("arc_radii_mm", arcs->size())))
    return {};
  Points points;
  for (Eigen::Index i = 0; i < x->size(); ++i)
    points.push_back({{(*x)[i], (*z)[i]}, arcs ? (*arcs)[i] : 0.0});
  return points;
}

Fields<Points> free_dimensions(Asked asked) {
  const std::vector<Key> keys{
      key_of_numbers(asked("x_mm"), 0,
                     "of points around the edge, counter-clockwise from x to z, the centre inside"),
      key_of_numbers(asked("z_mm"), 0, "of the same points"),
      key_of_numbers(left_out(asked, "arc_radii_mm"), 0,
                     "of the arcs to them from the points before, that to the first from the "
                     "last; 0: a line")};
  return Fields<Points>().custom(
      keys,
      [asked](TableReader& reader, Points& points) {
        const bool required = asked("x_mm").required;
        for (const char* key : {"x_mm", "z_mm"})
          if (!reader.has(key) &&
              (required || reader.has("x_mm") || reader.has("z_mm") || reader.has("arc_radii_mm")))
            reader.missing(key, "a list of numbers");
        if (Points read = read_edge(reader); !read.empty()) points = std::move(read);
      },
      [](const Points& points, Node::Table& table) {
        const auto n = Eigen::Index(points.size());
        Eigen::VectorXd x(n), z(n), arcs(n);
        for (Eigen::Index i = 0; i < n; ++i) {
          const OutlinePoint& point = points[std::size_t(i)];
          x[i] = point.at.x(), z[i] = point.at.y(), arcs[i] = point.radius;
        }
        put_numbers(table, "x_mm", x, 1.0);
        put_numbers(table, "z_mm", z, 1.0);
        put_numbers(table, "arc_radii_mm", arcs, 1.0);
      });
}

Nose insert_nose(const Insert& insert) { return cutting::nose_of(cutting::insert_profile(insert)); }
Nose free_nose(const Points& points) {
  return cutting::nose_of(cutting::edge_profile_through(points));
}

void refuse_insert(TableReader& reader, const Insert&, const std::invalid_argument& why) {
  reader.faults().add(reader.place(), "a turning insert that can be", why.what());
}

void refuse_edge(TableReader& reader, const Points& points, const std::invalid_argument& why) {
  if (const auto* fault = dynamic_cast<const cutting::OutlineFault*>(&why))
    return refuse_point(reader, {"x_mm", "z_mm", "arc_radii_mm"}, points, *fault);
  const Refusal refusal = refusal_of(why.what());
  reader.refuse("x_mm", refusal.expected + " for " + reader.name_of("x_mm") + " and z_mm",
                refusal.seen);
}

}  // namespace

Fields<ToolDescription> insert_fields(const std::string& kind, const FormOf& which) {
  if (kind == "insert")
    return fields_of_form(which, insert_dimensions(which.asked), insert_nose, refuse_insert);
  return fields_of_form(which, free_dimensions(which.asked), free_nose, refuse_edge);
}

}  // namespace abbe::sim
