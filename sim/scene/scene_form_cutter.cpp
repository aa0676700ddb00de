#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "cutting/hollow_outline.h"
#include "sim/scene/scene_tool_forms.h"

namespace abbe::sim {

namespace {

constexpr Range form_size{0.0, 10'000.0, true, false};  // mm
constexpr Range corner_size{0.0, 10'000.0, false, false};
constexpr Range corner_place{-10'000.0, 10'000.0};
constexpr Range bottom_angle{0.0, 90.0, false, true};  // deg
constexpr Range flank_angle{-90.0, 90.0, true, true};

template <auto member>
constexpr auto of_numbers = [](auto& form) -> auto& {
  return form.numbers.*member;
};

Fields<AptForm> apt_fields(Asked asked) {
  using Apt = cutting::AptCutter;
  return Fields<AptForm>()
      .number(left_out(asked, KeyName("diameter_mm")
                                  .otherwise("a ball: the corner's middle is on "
                                             "the axis")),
              &AptForm::diameter, form_size, "D of APT: where the lines of bottom and flank meet")
      .number(left_out(asked, "corner_radius_mm"), of_numbers<&Apt::corner>, corner_size,
              "of a bull nose, at most the radius; R of APT")
      .number(
          left_out(asked, KeyName("corner_offset_mm").otherwise("such that the corner is tangent")),
          &AptForm::radial, corner_place, "E of APT: of the corner's middle from the axis")
      .number(
          left_out(asked, KeyName("corner_height_mm").otherwise("such that the corner is tangent")),
          &AptForm::axial, corner_place, "F of APT: of the corner's middle above the tip")
      .number(left_out(asked, "bottom_deg"), of_numbers<&Apt::bottom>, bottom_angle,
              "alpha of APT: by which the bottom rises outwards")
      .number(left_out(asked, "flank_deg"), of_numbers<&Apt::flank>, flank_angle,
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
      .numbers(left_out(asked, KeyName("arc_radii_mm").otherwise("straight")), &OutlineForm::arcs,
               0, "radius of the arc that bulges out on the way to each point; 0: straight");
}

Fields<ProfileForm> profile_form_fields(Asked asked) {
  return Fields<ProfileForm>()
      .numbers(asked("radii_mm"), &ProfileForm::radii, 0,
               "of the points of the outline from the tip up; flat below the first")
      .numbers(asked("heights_mm"), &ProfileForm::heights, 0,
               "of the same points above the tip; the first is 0, none is below the one before")
      .numbers(
          left_out(asked, KeyName("arc_radii_mm").otherwise("straight")), &ProfileForm::arcs, 0,
          "radius of the arc on the way to each point; 0: straight; below 0: it bulges in, and "
          "is cut as chords inside of it, by which the tool is up to 1 um larger");
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

/// Lists of numbers for one outline of which one is longer than another.
struct UnequalLists : std::invalid_argument {
  UnequalLists(const char* which, Eigen::Index expected, Eigen::Index seen)
      : std::invalid_argument(fmt::format("{} numbers and {}", expected, seen)),
        key(which),
        expected_text(fmt::format("as many numbers as radii_mm, {},", expected)),
        seen_text(std::to_string(seen)) {}

  const char* key;
  std::string expected_text, seen_text;
};

/// @throws UnequalLists
template <class Form>
std::vector<cutting::OutlinePoint> points_of(const Form& form) {
  const Eigen::Index n = form.radii.size();
  if (form.heights.size() != n) throw UnequalLists("heights_mm", n, form.heights.size());
  if (form.arcs && form.arcs->size() != n) throw UnequalLists("arc_radii_mm", n, form.arcs->size());
  std::vector<cutting::OutlinePoint> points;
  for (Eigen::Index i = 0; i < n; ++i)
    points.push_back({{form.radii[i], form.heights[i]}, form.arcs ? (*form.arcs)[i] : 0.0});
  return points;
}

cutting::ToolOutline outline_of(const OutlineForm& form) {
  return cutting::outline_through(points_of(form));
}

cutting::ToolOutline outline_of(const ProfileForm& form) {
  return cutting::profile_through(points_of(form));
}

template <class Form>
cutting::Cutter cutter_of(const Form& form) {
  return cutting::form_cutter(outline_of(form));
}

void refuse_tool(TableReader& reader, const std::invalid_argument& why) {
  const Refusal refusal = refusal_of(why.what());
  reader.faults().add(reader.place(), refusal.expected + " for tool", refusal.seen);
}

void refuse_apt(TableReader& reader, const AptForm&, const std::invalid_argument& why) {
  refuse_tool(reader, why);
}

template <class Form>
void refuse_points(TableReader& reader, const Form& form, const std::invalid_argument& why) {
  if (const auto* unequal = dynamic_cast<const UnequalLists*>(&why))
    reader.refuse(unequal->key, unequal->expected_text + " for " + reader.name_of(unequal->key),
                  unequal->seen_text);
  else if (const auto* fault = dynamic_cast<const cutting::OutlineFault*>(&why))
    refuse_point(reader, {"radii_mm", "heights_mm", "arc_radii_mm"}, points_of(form), *fault);
  else
    refuse_tool(reader, why);
}

/// A convex outline is asked for; what is hollow has a kind of its own.
void refuse_outline(TableReader& reader, const OutlineForm& form,
                    const std::invalid_argument& why) {
  const auto* bend = dynamic_cast<const cutting::InwardBend*>(&why);
  if (bend == nullptr) return refuse_points(reader, form, why);
  const std::string text = std::string(why.what()) + "; kind = \"profile\" takes hollow ones";
  refuse_points(reader, form, cutting::OutlineFault(text, bend->at, bend->number));
}

}  // namespace

double chord_sag(const ToolForm& form) {
  const auto* profile = std::get_if<ProfileForm>(&form);
  return profile ? cutting::chord_sag(points_of(*profile)) : 0.0;
}

Fields<ToolDescription> form_cutter_fields(const std::string& kind, const FormOf& which) {
  if (kind == "apt")
    return fields_of_form(which, apt_fields(which.asked), cutter_of<AptForm>, refuse_apt);
  if (kind == "profile")
    return fields_of_form(which, profile_form_fields(which.asked), cutter_of<ProfileForm>,
                          refuse_points<ProfileForm>);
  return fields_of_form(which, outline_fields(which.asked), cutter_of<OutlineForm>, refuse_outline);
}

}  // namespace abbe::sim
