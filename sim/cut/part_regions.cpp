#include "sim/cut/part_regions.h"

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

namespace {

using cutting::FaceMark;
using cutting::FaceMarks;

// Names listed in a message.
constexpr std::size_t max_listed = 20;

/// Returns up to `max_listed` names in quotes.
std::string listed_names(const std::set<std::string>& words) {
  std::vector<std::string> shown;
  for (const std::string& word : words) {
    if (shown.size() == max_listed) break;
    shown.push_back("\"" + word + "\"");
  }
  std::string text = fmt::format("{}", fmt::join(shown, ", "));
  if (words.size() > shown.size()) text += fmt::format(" and {} more", words.size() - shown.size());
  return text;
}

[[noreturn]] void throw_region_error(const PartRegion& region, const std::string& expected,
                                     const std::string& seen) {
  throw BadInput(region.place.file ? *region.place.file : "", region.place.line,
                 region.place.column, expected, seen);
}

[[noreturn]] void throw_group_error(const PartRegion& region, const FaceMarks& marks) {
  // The nearest name is found by comparing letters; limits on number and length keep the message
  // immediate.
  constexpr std::size_t max_compared = 10'000, longest_compared = 200;
  std::set<std::string> names, compared;
  for (const auto& set : marks.names) names.insert(set.begin(), set.end());
  if (names.empty())
    throw_region_error(
        region,
        "part.region.group of a mesh with groups (g, o, usemtl of OBJ, solids of an ascii STL, "
        "whole numbers at the faces of PLY)",
        fmt::format("\"{}\" of a mesh without any", region.group));
  for (const std::string& name : names)
    if (name.size() <= longest_compared && compared.size() < max_compared) compared.insert(name);
  std::string seen = fmt::format("\"{}\"", region.group);
  if (const auto meant = nearest(region.group, compared))
    seen += fmt::format(" (nearest: \"{}\")", *meant);
  throw_region_error(region, "part.region.group that the mesh has: " + listed_names(names), seen);
}

int farthest_channel(const cutting::Rgb& a, const cutting::Rgb& b) {
  int farthest = 0;
  for (std::size_t k = 0; k < 3; ++k) farthest = std::max(farthest, std::abs(a[k] - b[k]));
  return farthest;
}

[[noreturn]] void throw_colour_error(const PartRegion& region, const FaceMarks& marks) {
  constexpr int near = 48;  // of 255: a colour this near may be the one intended
  std::set<std::string> colours;
  std::optional<cutting::Rgb> nearest;
  for (const FaceMark& mark : marks.marks) {
    if (!mark.colour) continue;
    const cutting::Rgb colour = cutting::spread(*mark.colour);
    colours.insert(cutting::hex_text(colour));
    const int off = farthest_channel(colour, *region.colour);
    if (off <= near && (!nearest || off < farthest_channel(*nearest, *region.colour)))
      nearest = colour;
  }
  std::string seen = fmt::format("\"{}\"", cutting::hex_text(*region.colour));
  if (colours.empty())
    throw_region_error(
        region,
        "part.region.colour of a mesh with colours of faces (PLY, OFF, binary STL, OBJ with its "
        ".mtl)",
        seen + " of a mesh without any");
  if (nearest) seen += fmt::format(" (nearest: \"{}\")", cutting::hex_text(*nearest));
  throw_region_error(region, "part.region.colour that the mesh has: " + listed_names(colours),
                     seen);
}

/// Returns (marks) true if faces with the mark are in the group of a region.
std::vector<bool> marks_in_group(const PartRegion& region, const FaceMarks& marks) {
  std::vector<bool> has_name;  // (sets of names)
  for (const auto& set : marks.names)
    has_name.push_back(std::ranges::find(set, region.group) != set.end());
  std::vector<bool> is;
  for (const FaceMark& mark : marks.marks)
    is.push_back(
        std::ranges::any_of(mark.names, [&](int set) { return has_name[std::size_t(set)]; }));
  return is;
}

// Returns (marks) true if faces with the mark may have the colour of a region; formats round
// colours differently.
std::vector<bool> marks_with_colour(const PartRegion& region, const FaceMarks& marks) {
  std::vector<bool> is;
  for (const FaceMark& mark : marks.marks)
    is.push_back(mark.colour && cutting::can_denote(*mark.colour, *region.colour));
  return is;
}

bool any_set(const std::vector<bool>& flags) {
  return std::ranges::any_of(flags, [](bool one) { return one; });
}

/// Returns (marks) true if faces with the mark may lie in a region.
std::vector<bool> marks_of(const PartRegion& region, const FaceMarks& marks) {
  std::vector<bool> may(marks.marks.size(), true);
  const auto narrow = [&](const std::vector<bool>& is) {
    for (std::size_t m = 0; m < may.size(); ++m) may[m] = may[m] && is[m];
  };
  if (!region.group.empty()) {
    const auto is = marks_in_group(region, marks);
    if (!any_set(is)) throw_group_error(region, marks);
    narrow(is);
  }
  if (region.colour) {
    const auto is = marks_with_colour(region, marks);
    if (!any_set(is)) throw_colour_error(region, marks);
    narrow(is);
  }
  return may;
}

}  // namespace

cutting::MarkSelection wanted_marks(const PartDescription& part) {
  cutting::MarkSelection wanted;
  for (const PartRegion& region : part.regions) {
    wanted.groups = wanted.groups || !region.group.empty();
    wanted.colours = wanted.colours || region.colour.has_value();
  }
  return wanted;
}

GroupedFaces grouped_faces(const PartDescription& part, const FaceMarks& marks) {
  std::vector<std::vector<bool>> may;  // (regions)(marks)
  for (const PartRegion& region : part.regions) may.push_back(marks_of(region, marks));
  GroupedFaces grouped;
  std::map<std::vector<bool>, int> numbers;
  std::vector<int> group_of_mark;
  for (std::size_t mark = 0; mark < marks.marks.size(); ++mark) {
    std::vector<bool> regions;
    for (const auto& of_region : may) regions.push_back(of_region[mark]);
    // Marks that allow the same regions share a group, so there are at most as many groups as
    // combinations of regions.
    const auto [place, is_new] = numbers.emplace(regions, int(grouped.groups.can_contain.size()));
    if (is_new) grouped.groups.can_contain.push_back(std::move(regions));
    group_of_mark.push_back(place->second);
  }
  for (const int mark : marks.of_face)
    grouped.of_triangle.push_back(group_of_mark[std::size_t(mark)]);
  return grouped;
}

RegionPoint region_point(const cutting::Design& design_m, Eigen::Index vertex) {
  const auto v = std::size_t(vertex);
  return {design_m.vertices.row(vertex), design_m.group.empty() ? -1 : design_m.group[v]};
}

bool holds(const PartDescription& part, std::size_t region, const FaceGroups& groups,
           const RegionPoint& place) {
  constexpr double rounding = 1e-6;  // mm, of a point that was moved with the part and back
  const PartRegion& one = part.regions[region];
  if (!one.group.empty() || one.colour) {
    if (place.group < 0 || !groups.can_contain[std::size_t(place.group)][region]) return false;
  }
  const Eigen::Vector3d& p_m = place.p_m;
  const auto within = [](const std::optional<Eigen::VectorXd>& limits, double value) {
    return !limits || ((*limits)[0] - rounding <= value && value <= (*limits)[1] + rounding);
  };
  const auto& box = one.box;
  return within(one.z, p_m.z()) && within(one.radius, p_m.head<2>().norm()) &&
         (!box || ((box->head<3>().array() - rounding <= p_m.array()).all() &&
                   (p_m.array() <= box->tail<3>().array() + rounding).all()));
}

const PartRegion* region_at(const PartDescription& part, const FaceGroups& groups,
                            const RegionPoint& place) {
  // later regions override earlier ones
  const PartRegion* found = nullptr;
  for (std::size_t r = 0; r < part.regions.size(); ++r)
    if (holds(part, r, groups, place)) found = &part.regions[r];
  return found;
}

std::vector<RegionCoverage> region_coverage(const PartDescription& part, const FaceGroups& groups,
                                            const cutting::Design& design_m) {
  std::vector<RegionCoverage> shares;
  for (const PartRegion& region : part.regions) shares.push_back({.name = region.name});
  const double all = design_m.area.sum();
  for (Eigen::Index i = 0; i < design_m.vertices.rows(); ++i) {
    const RegionPoint place = region_point(design_m, i);
    bool is_decided = false;
    // The last region that contains a vertex decides, so the loop runs backwards.
    for (std::size_t r = shares.size(); r-- > 0;) {
      if (!holds(part, r, groups, place)) continue;
      shares[r].area += design_m.area[i];
      if (!std::exchange(is_decided, true)) shares[r].decides += design_m.area[i];
    }
  }
  for (RegionCoverage& one : shares) {
    one.share = one.area / all;
    one.decides /= all;
  }
  return shares;
}

std::vector<std::string> region_warnings(const std::vector<RegionCoverage>& shares) {
  std::vector<std::string> warnings;
  for (const RegionCoverage& one : shares) {
    if (!(one.area > 0.0))
      warnings.push_back(fmt::format(
          "the region \"{}\" holds nothing: no vertex of the part lies in it", one.name));
    else if (!(one.decides > 0.0))
      warnings.push_back(fmt::format(
          "the region \"{}\" decides nothing: regions after it hold all of its {:.4g} mm^2",
          one.name, one.area));
  }
  return warnings;
}

cutting::ToleranceBands tolerance_bands(const PartDescription& part, const FaceGroups& groups,
                                        const cutting::Design& design_w) {
  const bool any = std::ranges::any_of(
      part.regions, [](const PartRegion& region) { return region.tolerance.has_value(); });
  if (!part.tolerance && !any) return {};
  const double inf = std::numeric_limits<double>::infinity();
  const Tolerance usual = part.tolerance.value_or(Tolerance{-inf, inf});
  const kinematics::Pose T_mw = part.T_wm.inverse();
  cutting::ToleranceBands bands(design_w.vertices.rows(), 2);
  for (Eigen::Index i = 0; i < design_w.vertices.rows(); ++i) {
    RegionPoint place = region_point(design_w, i);
    // regions are described in the part frame
    place.p_m = T_mw * place.p_m;
    bands.row(i) << usual.lower, usual.upper;
    for (std::size_t r = 0; r < part.regions.size(); ++r)
      if (holds(part, r, groups, place)) {
        const Tolerance own = part.regions[r].tolerance.value_or(usual);
        bands.row(i) << own.lower, own.upper;
      }
  }
  return bands;
}

}  // namespace abbe::sim
