#include "sim/scene/tool_forms.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "cutting/surface/tool.h"

namespace abbe::sim {

namespace {

constexpr Range form_size{0.0, 10'000.0, true, false};  // mm
constexpr Range corner_size{0.0, 10'000.0, false, false};
constexpr Range corner_position{-10'000.0, 10'000.0};
constexpr Range bottom_angle{0.0, 90.0, false, true};  // deg
constexpr Range flank_angle{-90.0, 90.0, true, true};

/// Returns the fields of a form. Reading also makes the shape of the tool from the form, unless
/// there are input errors.
/// @param make_shape  throws std::invalid_argument if no shape has this form
/// @param report_error  reports such an error
template <class Form, class Shape>
Fields<ToolDescription> form_fields(const FormSelector& selector, const Fields<Form>& form_members,
                                    Shape (*make_shape)(const Form&),
                                    void (*report_error)(TableReader& reader, const Form& form,
                                                         const std::invalid_argument& error)) {
  return Fields<ToolDescription>().custom_field(
      form_members.keys(),
      [=](TableReader& reader, ToolDescription& tool) {
        const std::size_t error_count = reader.input_errors().list().size();
        // The actual tool starts from the nominal form, if its kind is the same.
        const Form* initial = std::get_if<Form>(&(tool.*selector.form));
        const Form form = form_members.read(reader, initial ? *initial : Form{});
        tool.*selector.form = form;
        if (!std::holds_alternative<Shape>(tool.*selector.shape)) tool.*selector.shape = Shape{};
        if (reader.input_errors().list().size() != error_count ||
            !has_all_keys(reader, form_members.keys()))
          return;
        try {
          tool.*selector.shape = make_shape(form);
        } catch (const std::invalid_argument& error) {
          report_error(reader, form, error);
        }
      },
      [=](const ToolDescription& tool, Node::Table& table) {
        append_entries(table, form_members.to_table(std::get<Form>(tool.*selector.form)));
      });
}

/// Accessor of a member of `AptForm::numbers`.
template <auto member>
constexpr auto numbers_member = [](auto& form) -> auto& {
  return form.numbers.*member;
};

Fields<AptForm> apt_fields(ToolKeyFunction tool_key) {
  using Apt = cutting::AptCutter;
  return Fields<AptForm>()
      .number(optional_for_both(
                  tool_key,
                  KeyName("diameter_mm").with_fallback("a ball: the corner centre is on the axis")),
              &AptForm::diameter, form_size,
              "D of APT: diameter at which the lines of bottom and flank meet")
      .number(optional_for_both(tool_key, "corner_radius_mm"), numbers_member<&Apt::corner>,
              corner_size, "corner radius of a bull nose, at most the radius; R of APT")
      .number(
          optional_for_both(
              tool_key, KeyName("corner_offset_mm").with_fallback("so that the corner is tangent")),
          &AptForm::radial, corner_position,
          "E of APT: distance of the corner centre from the axis")
      .number(
          optional_for_both(
              tool_key, KeyName("corner_height_mm").with_fallback("so that the corner is tangent")),
          &AptForm::axial, corner_position, "F of APT: height of the corner centre above the tip")
      .number(optional_for_both(tool_key, "bottom_deg"), numbers_member<&Apt::bottom>, bottom_angle,
              "alpha of APT: angle by which the bottom rises outwards")
      .number(optional_for_both(tool_key, "flank_deg"), numbers_member<&Apt::flank>, flank_angle,
              "beta of APT: angle by which the flank leans outwards, upwards")
      .number(tool_key("flank_length_mm"), numbers_member<&Apt::height>, form_size,
              "H of APT: height of the upper end of the flank above the tip")
      .check([](TableReader& reader, AptForm& form) {
        // Without a diameter the cutter is a ball, which only its corner radius describes.
        if (!form.diameter && (form.radial || form.axial || !(form.numbers.corner > 0.0)))
          return reader.report_missing("diameter_mm", "a number");
        // The centre of the corner is stated by both coordinates or follows from tangency.
        if (form.radial.has_value() == form.axial.has_value()) return;
        reader.report_missing(form.radial ? "corner_height_mm" : "corner_offset_mm",
                              "both of corner_offset_mm and corner_height_mm, or neither,");
      });
}

Fields<OutlineForm> outline_fields(ToolKeyFunction tool_key) {
  return Fields<OutlineForm>()
      .numbers(tool_key("radii_mm"), &OutlineForm::radii, 0,
               "radii of the outline points from the tip upwards; flat below the first")
      .numbers(tool_key("heights_mm"), &OutlineForm::heights, 0,
               "heights of the same points above the tip; the first is 0")
      .numbers(optional_for_both(tool_key, KeyName("arc_radii_mm").with_fallback("straight")),
               &OutlineForm::arcs, 0, "radius of the convex arc to each point; 0: straight");
}

Fields<ProfileForm> profile_form_fields(ToolKeyFunction tool_key) {
  return Fields<ProfileForm>()
      .numbers(tool_key("radii_mm"), &ProfileForm::radii, 0,
               "radii of the outline points from the tip upwards; flat below the first")
      .numbers(tool_key("heights_mm"), &ProfileForm::heights, 0,
               "heights of the same points above the tip; the first is 0, none is below the "
               "previous one")
      .numbers(optional_for_both(tool_key, KeyName("arc_radii_mm").with_fallback("straight")),
               &ProfileForm::arcs, 0,
               "radius of the arc to each point; 0: straight; below 0: concave, cut as chords "
               "inside the arc, which make the tool up to 1 um larger");
}

cutting::ToolOutline make_outline(const AptForm& form) {
  cutting::AptCutter cutter = form.numbers;
  // Without a diameter the centre of the corner lies on the axis.
  if (!form.diameter) return cutting::apt_outline(cutting::with_ball_corner(cutter));
  cutter.diameter = *form.diameter;
  if (!form.radial || !form.axial)
    return cutting::apt_outline(cutting::with_tangent_corner(cutter));
  cutter.radial = *form.radial;
  cutter.axial = *form.axial;
  return cutting::apt_outline(cutter);
}

/// Thrown if the lists of an outline have different lengths.
struct UnequalLists : std::invalid_argument {
  UnequalLists(const char* list_key, Eigen::Index expected, Eigen::Index seen)
      : std::invalid_argument(fmt::format("{} numbers and {}", expected, seen)),
        key(list_key),
        expected_text(fmt::format("as many numbers as radii_mm, {},", expected)),
        seen_text(std::to_string(seen)) {}

  const char* key;
  std::string expected_text, seen_text;
};

/// Returns the points of a form.
/// @throws UnequalLists if its lists have different lengths
template <class Form>
std::vector<cutting::OutlinePoint> outline_points(const Form& form) {
  const Eigen::Index n = form.radii.size();
  if (form.heights.size() != n) throw UnequalLists("heights_mm", n, form.heights.size());
  if (form.arcs && form.arcs->size() != n) throw UnequalLists("arc_radii_mm", n, form.arcs->size());
  std::vector<cutting::OutlinePoint> points;
  for (Eigen::Index i = 0; i < n; ++i)
    points.push_back({{form.radii[i], form.heights[i]}, form.arcs ? (*form.arcs)[i] : 0.0});
  return points;
}

cutting::ToolOutline make_outline(const OutlineForm& form) {
  return cutting::outline_from_points(outline_points(form));
}

cutting::ToolOutline make_outline(const ProfileForm& form) {
  return cutting::tool_outline_from_points(outline_points(form));
}

template <class Form>
cutting::Cutter make_cutter(const Form& form) {
  return cutting::form_cutter(make_outline(form));
}

void report_tool_error(TableReader& reader, const std::invalid_argument& error) {
  const ExpectedAndSeen message = parse_message(error.what());
  reader.input_errors().add(reader.position(), message.expected + " for tool", message.seen);
}

void report_apt_error(TableReader& reader, const AptForm&, const std::invalid_argument& error) {
  report_tool_error(reader, error);
}

template <class Form>
void report_form_error(TableReader& reader, const Form& form, const std::invalid_argument& error) {
  if (const auto* unequal_lists = dynamic_cast<const UnequalLists*>(&error))
    reader.report_invalid(
        unequal_lists->key,
        unequal_lists->expected_text + " for " + reader.qualified_name(unequal_lists->key),
        unequal_lists->seen_text);
  else if (const auto* point_error = dynamic_cast<const cutting::OutlineError*>(&error))
    report_point_error(reader, {"radii_mm", "heights_mm", "arc_radii_mm"}, outline_points(form),
                       *point_error);
  else
    report_tool_error(reader, error);
}

/// Reports an error of a convex outline. If the outline is hollow, the message names the kind of
/// tool that allows it.
void report_outline_error(TableReader& reader, const OutlineForm& form,
                          const std::invalid_argument& error) {
  const auto* bend = dynamic_cast<const cutting::InwardBendError*>(&error);
  if (bend == nullptr) return report_form_error(reader, form, error);
  const std::string text = std::string(error.what()) + "; kind = \"profile\" allows concave ones";
  report_form_error(reader, form, cutting::OutlineError(text, bend->at, bend->number));
}

}  // namespace

double chord_sag(const ToolForm& form) {
  const auto* profile = std::get_if<ProfileForm>(&form);
  return profile ? cutting::chord_sag(outline_points(*profile)) : 0.0;
}

Fields<ToolDescription> form_cutter_fields(const std::string& kind, const FormSelector& selector) {
  if (kind == "apt")
    return form_fields(selector, apt_fields(selector.tool_key), make_cutter<AptForm>,
                       report_apt_error);
  if (kind == "profile")
    return form_fields(selector, profile_form_fields(selector.tool_key), make_cutter<ProfileForm>,
                       report_form_error<ProfileForm>);
  return form_fields(selector, outline_fields(selector.tool_key), make_cutter<OutlineForm>,
                     report_outline_error);
}

namespace {

using cutting::Insert;
using cutting::Nose;
using cutting::OutlinePoint;
using Points = std::vector<OutlinePoint>;

constexpr Range edge_size{0.0, 10'000.0, true, false};  // mm
constexpr Range edge_angle{0.0, 179.0};                 // deg

Fields<Insert> insert_dimension_fields(ToolKeyFunction tool_key) {
  return Fields<Insert>()
      .number(tool_key("radius_mm"), &Insert::radius, edge_size, "radius of the nose")
      .number(tool_key("cutting_edge_angle_deg"), &Insert::major, edge_angle,
              "ISO 3002-1 κr, from the feed direction -x to the major edge, upwards")
      .number(tool_key("minor_edge_angle_deg"), &Insert::minor, edge_angle,
              "κr', from +x to the minor edge, upwards; κr and κr' together 1 to 179 deg")
      .number(tool_key("cutting_edge_mm"), &Insert::major_length, edge_size,
              "length of the major edge, from the nose")
      .number(tool_key("minor_edge_mm"), &Insert::minor_length, edge_size,
              "length of the minor edge, from the nose or the wiper")
      .number(optional_for_both(tool_key, "wiper_mm"), &Insert::wiper, non_negative,
              "b_s, a flat along x from below the centre of the nose to the minor edge");
}

/// Reads the points of the edge. Returns none if they are missing or invalid.
Points read_edge(TableReader& reader) {
  const auto x = reader.maybe_numbers("x_mm"), z = reader.maybe_numbers("z_mm");
  const auto arcs = reader.maybe_numbers("arc_radii_mm");
  if (!x || !z) return {};
  const auto check_length = [&](const char* key, Eigen::Index seen) {
    if (seen == x->size()) return true;
    reader.report_invalid(key, fmt::format("as many numbers as x_mm, {}", x->size()),
                          std::to_string(seen));
    return false;
  };
  if (!check_length("z_mm", z->size()) || (arcs && !check_length("arc_radii_mm", arcs->size())))
    return {};
  Points points;
  for (Eigen::Index i = 0; i < x->size(); ++i)
    points.push_back({{(*x)[i], (*z)[i]}, arcs ? (*arcs)[i] : 0.0});
  return points;
}

Fields<Points> edge_fields(ToolKeyFunction tool_key) {
  const std::vector<Key> keys{
      make_numbers_key(
          tool_key("x_mm"), 0,
          "x of points around the edge, counter-clockwise from x to z, with the centre inside"),
      make_numbers_key(tool_key("z_mm"), 0, "z of the same points"),
      make_numbers_key(optional_for_both(tool_key, "arc_radii_mm"), 0,
                       "radii of the arcs to them from the previous points, that to the first from "
                       "the last; 0: straight")};
  return Fields<Points>().custom_field(
      keys,
      [tool_key](TableReader& reader, Points& points) {
        const bool required = tool_key("x_mm").required;
        for (const char* key : {"x_mm", "z_mm"})
          // The actual tool may omit all lists but not a single one.
          if (!reader.has(key) &&
              (required || reader.has("x_mm") || reader.has("z_mm") || reader.has("arc_radii_mm")))
            reader.report_missing(key, "a list of numbers");
        // Without points, the nominal ones remain.
        if (Points stated_points = read_edge(reader); !stated_points.empty())
          points = std::move(stated_points);
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

Nose make_insert_nose(const Insert& insert) {
  return cutting::profile_nose(cutting::insert_profile(insert));
}
Nose make_edge_nose(const Points& points) {
  return cutting::profile_nose(cutting::edge_profile_from_points(points));
}

void report_insert_error(TableReader& reader, const Insert&, const std::invalid_argument& error) {
  reader.input_errors().add(reader.position(), "a valid turning insert", error.what());
}

void report_edge_error(TableReader& reader, const Points& points,
                       const std::invalid_argument& error) {
  if (const auto* point_error = dynamic_cast<const cutting::OutlineError*>(&error))
    return report_point_error(reader, {"x_mm", "z_mm", "arc_radii_mm"}, points, *point_error);
  const ExpectedAndSeen message = parse_message(error.what());
  reader.report_invalid("x_mm",
                        message.expected + " for " + reader.qualified_name("x_mm") + " and z_mm",
                        message.seen);
}

}  // namespace

Fields<ToolDescription> insert_fields(const std::string& kind, const FormSelector& selector) {
  if (kind == "insert")
    return form_fields(selector, insert_dimension_fields(selector.tool_key), make_insert_nose,
                       report_insert_error);
  return form_fields(selector, edge_fields(selector.tool_key), make_edge_nose, report_edge_error);
}

}  // namespace abbe::sim
