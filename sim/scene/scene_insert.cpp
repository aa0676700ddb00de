#include "sim/scene/scene_insert.h"

#include <algorithm>
#include <functional>
#include <stdexcept>

#include <fmt/format.h>

namespace abbe::sim {

namespace {

using cutting::EdgeProfile;
using cutting::Insert;
using cutting::Nose;
using cutting::OutlinePoint;
using Points = std::vector<OutlinePoint>;

constexpr Range edge_size{0.0, 10'000.0, true, false};  // mm
constexpr Range edge_angle{0.0, 179.0};                 // deg

/// How a key is asked for, of the nominal tool or of the actual one.
using EdgeKey = KeyName (*)(KeyName);
KeyName if_not_nominal(KeyName key) { return key.otherwise("as nominal"); }
KeyName as_it_is(KeyName key) { return key; }

Fields<Insert> insert_dimensions(EdgeKey asked, EdgeKey optional) {
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
      .number(optional("wiper_mm"), &Insert::wiper, non_negative,
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

Fields<Points> free_dimensions(EdgeKey asked, EdgeKey optional) {
  const std::vector<Key> keys{
      key_of_numbers(asked("x_mm"), 0,
                     "of points around the edge, counter-clockwise from x to z, the centre inside"),
      key_of_numbers(asked("z_mm"), 0, "of the same points"),
      key_of_numbers(optional("arc_radii_mm"), 0,
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

/// Which of the two tools of a description is meant.
struct EdgeOf {
  EdgeShape ToolDescription::*edge;
  std::variant<cutting::Cutter, Nose> ToolDescription::*tool;
};
constexpr EdgeOf of_nominal{&ToolDescription::edge, &ToolDescription::nominal};
constexpr EdgeOf of_actual{&ToolDescription::actual_edge, &ToolDescription::actual};

/// The keys of a shape, and the tool that it makes where each of them is good.
template <class Shape>
Fields<ToolDescription> shaped_fields(const EdgeOf& which, const Fields<Shape>& dimensions,
                                      EdgeProfile (*profile_of)(const Shape&)) {
  return Fields<ToolDescription>().custom(
      dimensions.keys(),
      [=](TableReader& reader, ToolDescription& tool) {
        const std::size_t before = reader.faults().list().size();
        const Shape* start = std::get_if<Shape>(&(tool.*which.edge));
        const Shape shape = dimensions.read(reader, start ? *start : Shape{});
        tool.*which.edge = shape;
        tool.*which.tool = Nose{};
        const std::vector<Key> keys = dimensions.keys();
        const bool whole = std::all_of(keys.begin(), keys.end(), [&](const Key& key) {
          return !key.required || reader.has(key.name);
        });
        if (!whole || reader.faults().list().size() != before) return;
        try {
          tool.*which.tool = cutting::nose_of(profile_of(shape));
        } catch (const std::invalid_argument& fault) {
          reader.faults().add(reader.place(), "a turning insert that can be", fault.what());
        }
      },
      [=](const ToolDescription& tool, Node::Table& table) {
        put_all(table, dimensions.written(std::get<Shape>(tool.*which.edge)));
      });
}

Fields<ToolDescription> edge_fields(const EdgeOf& which, const std::string& kind, EdgeKey asked,
                                    EdgeKey optional) {
  if (kind == "insert")
    return shaped_fields<Insert>(which, insert_dimensions(asked, optional),
                                 cutting::insert_profile);
  return shaped_fields<Points>(which, free_dimensions(asked, optional),
                               cutting::edge_profile_through);
}

}  // namespace

Fields<ToolDescription> nominal_edge_fields(const std::string& kind) {
  return edge_fields(of_nominal, kind, must, as_it_is);
}

Fields<ToolDescription> actual_edge_fields(const std::string& kind) {
  return edge_fields(of_actual, kind, if_not_nominal, if_not_nominal);
}

}  // namespace abbe::sim
