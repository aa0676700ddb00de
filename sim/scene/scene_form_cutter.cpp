#include <stdexcept>

#include "sim/scene/scene_sections.h"

namespace abbe::sim {

namespace {

constexpr Range form_size{0.0, 10'000.0, true, false};  // mm
constexpr Range corner_size{0.0, 10'000.0, false, false};
constexpr Range corner_place{-10'000.0, 10'000.0};
constexpr Range bottom_angle{0.0, 90.0, false, true};  // deg
constexpr Range flank_angle{-90.0, 90.0, true, true};

/// A key that may be left out, of the nominal tool with the fallback of its own.
KeyName optional(Asked asked, const KeyName& key) { return asked == must ? key : asked(key); }

template <auto member>
constexpr auto of_numbers = [](auto& form) -> auto& {
  return form.numbers.*member;
};

Fields<AptForm> apt_fields(Asked asked) {
  using Apt = cutting::AptCutter;
  return Fields<AptForm>()
      .number(optional(asked, KeyName("diameter_mm")
                                  .otherwise("a ball: the corner's middle is on "
                                             "the axis")),
              &AptForm::diameter, form_size, "D of APT: where the lines of bottom and flank meet")
      .number(optional(asked, "corner_radius_mm"), of_numbers<&Apt::corner>, corner_size,
              "of a bull nose, at most the radius; R of APT")
      .number(
          optional(asked, KeyName("corner_offset_mm").otherwise("such that the corner is tangent")),
          &AptForm::radial, corner_place, "E of APT: of the corner's middle from the axis")
      .number(
          optional(asked, KeyName("corner_height_mm").otherwise("such that the corner is tangent")),
          &AptForm::axial, corner_place, "F of APT: of the corner's middle above the tip")
      .number(optional(asked, "bottom_deg"), of_numbers<&Apt::bottom>, bottom_angle,
              "alpha of APT: by which the bottom rises outwards")
      .number(optional(asked, "flank_deg"), of_numbers<&Apt::flank>, flank_angle,
              "beta of APT: by which the flank leans outwards, upwards")
      .number(asked("flank_length_mm"), of_numbers<&Apt::height>, form_size,
              "H of APT: of the flank's upper end above the tip")
      .check([](TableReader& reader, AptForm& form) {
        if (!form.diameter && (form.radial || form.axial || !(form.numbers.corner > 0.0)))
          return reader.missing("diameter_mm", "a number");
        if (form.radial.has_value() == form.axial.has_value()) return;
        reader.missing(form.radial ? "corner_height_mm" : "corner_offset_mm",
                       "both of corner_offset_mm and corner_height_mm, or neither,");
      });
}

Fields<OutlineForm> outline_fields(Asked asked) {
  return Fields<OutlineForm>()
      .numbers(asked("radii_mm"), &OutlineForm::radii, 0,
               "of the points of the outline from the tip up; flat below the first")
      .numbers(asked("heights_mm"), &OutlineForm::heights, 0,
               "of the same points above the tip; the first is 0")
      .numbers(optional(asked, KeyName("arc_radii_mm").otherwise("straight")), &OutlineForm::arcs,
               0, "radius of the arc that bulges out on the way to each point; 0: straight");
}

/// Where a description is not of the kind, one of it is begun.
template <typename Form>
Fields<FormDescription> form_of(const Fields<Form>& own) {
  return Fields<FormDescription>().custom(
      own.keys(),
      [own](TableReader& reader, FormDescription& form) {
        const Form* begun = std::get_if<Form>(&form);
        form = own.read(reader, begun ? *begun : Form{});
      },
      [own](const FormDescription& form, Node::Table& table) {
        put_all(table, own.written(std::get<Form>(form)));
      });
}

cutting::ToolOutline outline_of(const AptForm& form) {
  cutting::AptCutter cutter = form.numbers;
  if (!form.diameter) return cutting::apt_outline(cutting::with_ball_corner(cutter));
  cutter.diameter = *form.diameter;
  if (!form.radial || !form.axial)
    return cutting::apt_outline(cutting::with_tangent_corner(cutter));
  cutter.radial = *form.radial;
  cutter.axial = *form.axial;
  return cutting::apt_outline(cutter);
}

cutting::ToolOutline outline_of(const OutlineForm& form) {
  if (form.heights.size() != form.radii.size() ||
      (form.arcs && form.arcs->size() != form.radii.size()))
    throw std::invalid_argument(
        "outline: expected as many radii, heights and arcs, seen them differ");
  std::vector<cutting::OutlinePoint> points;
  for (Eigen::Index i = 0; i < form.radii.size(); ++i)
    points.push_back({{form.radii[i], form.heights[i]}, form.arcs ? (*form.arcs)[i] : 0.0});
  return cutting::outline_through(points);
}

}  // namespace

Fields<FormDescription> form_fields(const std::string& kind, Asked asked) {
  return kind == "apt" ? form_of(apt_fields(asked)) : form_of(outline_fields(asked));
}

cutting::Cutter cutter_of(const FormDescription& form) {
  const auto* apt = std::get_if<AptForm>(&form);
  return cutting::form_cutter(apt ? outline_of(*apt) : outline_of(std::get<OutlineForm>(form)));
}

}  // namespace abbe::sim
