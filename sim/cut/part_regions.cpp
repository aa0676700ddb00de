#include "sim/cut/part_regions.h"

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

namespace {

using cutting::FaceMark;
using cutting::FaceMarks;

constexpr std::size_t max_listed = 20;  // maximum number of names in a message

/// Returns up to `max_listed` names in quotes.
std::string listed_names(const std::set<std::string>& names) {
  std::vector<std::string> quoted;
  for (const std::string& name : names) {
    if (quoted.size() == max_listed) break;
    quoted.push_back("\"" + name + "\"");
  }
  std::string text = fmt::format("{}", fmt::join(quoted, ", "));
  if (names.size() > quoted.size())
    text += fmt::format(" and {} more", names.size() - quoted.size());
  return text;
}

[[noreturn]] void throw_region_error(const PartRegion& region, const std::string& expected,
                                     const std::string& seen) {
  throw BadInput(region.position.file ? *region.position.file : "", region.position.line,
                 region.position.column, expected, seen);
}

[[noreturn]] void throw_group_error(const PartRegion& region, const FaceMarks& marks) {
  // Limits on number and length keep the comparison of letters fast.
  constexpr std::size_t max_compared = 10'000, max_length = 200;
  std::set<std::string> names, compared;
  for (const auto& mark_names : marks.name_sets) names.insert(mark_names.begin(), mark_names.end());
  if (names.empty())
    throw_region_error(region,
                       "part.region.group with a mesh that has groups (g, o, usemtl of OBJ, solids "
                       "of ASCII STL, integers on faces of PLY)",
                       fmt::format("\"{}\" for a mesh without groups", region.group));
  for (const std::string& name : names)
    if (name.size() <= max_length && compared.size() < max_compared) compared.insert(name);
  std::string seen = fmt::format("\"{}\"", region.group);
  if (const auto nearest_name = nearest(region.group, compared))
    seen += fmt::format(" (nearest: \"{}\")", *nearest_name);
  throw_region_error(region, "a part.region.group of the mesh: " + listed_names(names), seen);
}

int max_channel_difference(const cutting::Rgb& a, const cutting::Rgb& b) {
  int max_difference = 0;
  for (std::size_t k = 0; k < 3; ++k)
    max_difference = std::max(max_difference, std::abs(a[k] - b[k]));
  return max_difference;
}

[[noreturn]] void throw_colour_error(const PartRegion& region, const FaceMarks& marks) {
  constexpr int max_near_difference = 48;  // of 255; a colour this near may be the intended one
  std::set<std::string> colours;
  std::optional<cutting::Rgb> nearest;
  for (const FaceMark& mark : marks.marks) {
    if (!mark.colour) continue;
    const cutting::Rgb colour = cutting::to_eight_bits(*mark.colour);
    colours.insert(cutting::hex_text(colour));
    const int difference = max_channel_difference(colour, *region.colour);
    if (difference <= max_near_difference &&
        (!nearest || difference < max_channel_difference(*nearest, *region.colour)))
      nearest = colour;
  }
  std::string seen = fmt::format("\"{}\"", cutting::hex_text(*region.colour));
  if (colours.empty())
    throw_region_error(region,
                       "part.region.colour with a mesh that has face colours (PLY, OFF, binary "
                       "STL, OBJ with its .mtl)",
                       seen + " for a mesh without face colours");
  if (nearest) seen += fmt::format(" (nearest: \"{}\")", cutting::hex_text(*nearest));
  throw_region_error(region, "a part.region.colour of the mesh: " + listed_names(colours), seen);
}

/// Returns (marks) true if faces with the mark are in the group of a region.
std::vector<bool> marks_in_group(const PartRegion& region, const FaceMarks& marks) {
  std::vector<bool> has_name;  // (sets of names)
  for (const auto& name_set : marks.name_sets)
    has_name.push_back(std::ranges::find(name_set, region.group) != name_set.end());
  std::vector<bool> matches;
  for (const FaceMark& mark : marks.marks)
    matches.push_back(std::ranges::any_of(
        mark.name_set_indices, [&](int name_set) { return has_name[std::size_t(name_set)]; }));
  return matches;
}

/// Returns (marks) true if faces with the mark may have the colour of a region. Formats round
/// colours differently, so that the colours need not be equal.
std::vector<bool> marks_with_colour(const PartRegion& region, const FaceMarks& marks) {
  std::vector<bool> matches;
  for (const FaceMark& mark : marks.marks)
    matches.push_back(mark.colour && cutting::can_denote(*mark.colour, *region.colour));
  return matches;
}

bool any_set(const std::vector<bool>& flags) {
  return std::ranges::any_of(flags, [](bool flag) { return flag; });
}

/// Returns (marks) true if faces with the mark may lie in a region.
std::vector<bool> marks_allowed_in(const PartRegion& region, const FaceMarks& marks) {
  std::vector<bool> may_lie(marks.marks.size(), true);
  const auto restrict_to = [&](const std::vector<bool>& matches) {
    for (std::size_t m = 0; m < may_lie.size(); ++m) may_lie[m] = may_lie[m] && matches[m];
  };
  if (!region.group.empty()) {
    const auto matches = marks_in_group(region, marks);
    if (!any_set(matches)) throw_group_error(region, marks);
    restrict_to(matches);
  }
  if (region.colour) {
    const auto matches = marks_with_colour(region, marks);
    if (!any_set(matches)) throw_colour_error(region, marks);
    restrict_to(matches);
  }
  return may_lie;
}

}  // namespace

cutting::MarkSelection required_marks(const PartDescription& part) {
  cutting::MarkSelection selection;
  for (const PartRegion& region : part.regions) {
    selection.groups = selection.groups || !region.group.empty();
    selection.colours = selection.colours || region.colour.has_value();
  }
  return selection;
}

GroupedFaces grouped_faces(const PartDescription& part, const FaceMarks& marks) {
  std::vector<std::vector<bool>> allowed;  // (regions)(marks)
  for (const PartRegion& region : part.regions) allowed.push_back(marks_allowed_in(region, marks));
  GroupedFaces result;
  std::map<std::vector<bool>, int> numbers;
  std::vector<int> group_of_mark;
  for (std::size_t mark = 0; mark < marks.marks.size(); ++mark) {
    std::vector<bool> regions;
    for (const auto& allowed_in_region : allowed) regions.push_back(allowed_in_region[mark]);
    // Marks that allow the same regions share a group, which limits the number of groups.
    const auto [entry, is_new] = numbers.emplace(regions, int(result.groups.can_contain.size()));
    if (is_new) result.groups.can_contain.push_back(std::move(regions));
    group_of_mark.push_back(entry->second);
  }
  for (const int mark : marks.mark_of_face)
    result.group_of_triangle.push_back(group_of_mark[std::size_t(mark)]);
  return result;
}

RegionPoint region_point(const cutting::Design& design_m, Eigen::Index vertex) {
  const auto v = std::size_t(vertex);
  return {design_m.vertices.row(vertex), design_m.group.empty() ? -1 : design_m.group[v]};
}

bool holds(const PartDescription& part, std::size_t region, const FaceGroups& groups,
           const RegionPoint& point) {
  constexpr double rounding = 1e-6;  // mm, bound for a point moved with the part and back
  const PartRegion& description = part.regions[region];
  const bool needs_mark = !description.group.empty() || description.colour;
  if (needs_mark && (point.group < 0 || !groups.can_contain[std::size_t(point.group)][region]))
    return false;
  const Eigen::Vector3d& p_m = point.p_m;
  const auto within = [](const std::optional<Eigen::VectorXd>& limits, double value) {
    return !limits || ((*limits)[0] - rounding <= value && value <= (*limits)[1] + rounding);
  };
  const auto& box = description.box;
  return within(description.z, p_m.z()) && within(description.radius, p_m.head<2>().norm()) &&
         (!box || ((box->head<3>().array() - rounding <= p_m.array()).all() &&
                   (p_m.array() <= box->tail<3>().array() + rounding).all()));
}

const PartRegion* region_at(const PartDescription& part, const FaceGroups& groups,
                            const RegionPoint& point) {
  // Later regions override earlier ones.
  const PartRegion* last_region = nullptr;
  for (std::size_t r = 0; r < part.regions.size(); ++r)
    if (holds(part, r, groups, point)) last_region = &part.regions[r];
  return last_region;
}

std::vector<RegionCoverage> region_coverage(const PartDescription& part, const FaceGroups& groups,
                                            const cutting::Design& design_m) {
  std::vector<RegionCoverage> coverages;
  for (const PartRegion& region : part.regions) coverages.push_back({.name = region.name});
  const double total_area = design_m.area.sum();
  for (Eigen::Index i = 0; i < design_m.vertices.rows(); ++i) {
    const RegionPoint point = region_point(design_m, i);
    bool is_decided = false;
    // The loop runs backwards, since the last region that contains a vertex decides.
    for (std::size_t r = coverages.size(); r-- > 0;) {
      if (!holds(part, r, groups, point)) continue;
      coverages[r].area += design_m.area[i];
      if (!std::exchange(is_decided, true)) coverages[r].deciding_fraction += design_m.area[i];
    }
  }
  for (RegionCoverage& region : coverages) {
    region.area_fraction = region.area / total_area;
    region.deciding_fraction /= total_area;
  }
  return coverages;
}

std::vector<std::string> region_warnings(const std::vector<RegionCoverage>& coverages) {
  std::vector<std::string> warnings;
  for (const RegionCoverage& coverage : coverages) {
    if (!(coverage.area > 0.0))
      warnings.push_back(fmt::format(
          "the region \"{}\" is empty: it contains no vertex of the part", coverage.name));
    else if (!(coverage.deciding_fraction > 0.0))
      warnings.push_back(fmt::format(
          "the region \"{}\" has no effect: later regions contain all of its {:.4g} mm^2",
          coverage.name, coverage.area));
  }
  return warnings;
}

cutting::ToleranceBands tolerance_bands(const PartDescription& part, const FaceGroups& groups,
                                        const cutting::Design& design_w) {
  const bool has_region_tolerance = std::ranges::any_of(
      part.regions, [](const PartRegion& region) { return region.tolerance.has_value(); });
  if (!part.tolerance && !has_region_tolerance) return {};
  const Tolerance part_tolerance = part.tolerance.value_or(Tolerance{-infinity, infinity});
  const kinematics::Pose T_mw = part.T_wm.inverse();
  cutting::ToleranceBands bands(design_w.vertices.rows(), 2);
  for (Eigen::Index i = 0; i < design_w.vertices.rows(); ++i) {
    RegionPoint point = region_point(design_w, i);
    point.p_m = T_mw * point.p_m;
    bands.row(i) << part_tolerance.lower, part_tolerance.upper;
    for (std::size_t r = 0; r < part.regions.size(); ++r)
      if (holds(part, r, groups, point)) {
        const Tolerance region_tolerance = part.regions[r].tolerance.value_or(part_tolerance);
        bands.row(i) << region_tolerance.lower, region_tolerance.upper;
      }
  }
  return bands;
}

}  // namespace abbe::sim
