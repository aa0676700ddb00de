#include "sim/cut/surface_warnings.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "cutting/stock.h"

namespace abbe::sim {
namespace {

using cutting::Surface;
using cutting::VertexStatus;
using Eigen::Index;
using Eigen::Vector3d;

int count(const Surface& surface, VertexStatus status) {
  return int(std::count(surface.status.begin(), surface.status.end(), status));
}

std::string share(int part, int all) {
  return fmt::format("{} of {} judged vertices ({:.3g} %)", part, all, 100.0 * part / all);
}

/// Whether a gouge counts as one at less than the band, as the part is thinner than two bands.
bool thin_gouge(const Surface& surface, double band) {
  return std::any_of(surface.gouges.begin(), surface.gouges.end(),
                     [&](const cutting::Gouge& gouge) { return gouge.depth < band; });
}

std::string gouge_text(const Surface& surface, int judged, double band) {
  const auto deepest =
      std::max_element(surface.gouges.begin(), surface.gouges.end(),
                       [](const auto& a, const auto& b) { return a.depth < b.depth; });
  int first = 0;
  for (const cutting::Gouge& gouge : surface.gouges)
    if (const int line = surface.cut_line[std::size_t(gouge.vertex)]; first == 0 || line < first)
      first = line;
  return fmt::format(
      "{} are gouged deeper than the band of {} mm{}, the deepest by {}{:.3f} mm (line {}, first "
      "line {}): PV, RMS, form and alignment leave them out",
      share(int(surface.gouges.size()), judged), band,
      thin_gouge(surface, band) ? " or than half way through the part where that is less" : "",
      deepest->deeper ? "more than the searched " : "", deepest->depth,
      surface.cut_line[std::size_t(deepest->vertex)], first);
}

std::set<int> rapid_lines(const program::Path& path) {
  std::set<int> lines;
  for (const program::Block& block : path.blocks)
    if (block.interpolation == program::Interpolation::Rapid) lines.insert(block.line);
  return lines;
}

/// Where the tool is at an instant, between two samples.
struct Position {
  Vector3d tip, axis;
};

Position position(const cutting::CutterMotion& motion, double time_s) {
  const double* begin = motion.time_s.data();
  const double* end = begin + motion.time_s.size();
  const Index after =
      std::min<Index>(std::lower_bound(begin, end, time_s) - begin, motion.time_s.size() - 1);
  const Index before = std::max<Index>(0, after - 1);
  const double span = motion.time_s[after] - motion.time_s[before];
  const double t = span > 0.0 ? (time_s - motion.time_s[before]) / span : 1.0;
  const Vector3d axis = (1.0 - t) * motion.axis.row(before) + t * motion.axis.row(after);
  return {(1.0 - t) * motion.tip.row(before) + t * motion.tip.row(after), axis.normalized()};
}

}  // namespace

std::vector<std::string> surface_warnings(const Surface& surface, const program::Path& path,
                                          double band) {
  std::vector<std::string> warnings;
  const int cut = count(surface, VertexStatus::Cut), uncut = count(surface, VertexStatus::Uncut);
  const int judged = cut + uncut + count(surface, VertexStatus::Gouged);
  if (judged == 0) return warnings;
  if (uncut >= uncut_warning * judged)
    warnings.push_back(
        fmt::format("{} are uncut: nothing is removed there within {} mm of the "
                    "design, and PV, RMS and form leave them out",
                    share(uncut, judged), band));
  if (!surface.gouges.empty()) warnings.push_back(gouge_text(surface, judged, band));
  const std::set<int> rapids = rapid_lines(path);
  int by_rapid = 0, first = 0;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    const int line = surface.cut_line[i];
    if (surface.status[i] != VertexStatus::Cut || !rapids.contains(line)) continue;
    if (by_rapid++ == 0 || line < first) first = line;
  }
  if (by_rapid >= uncut_warning * judged && by_rapid > 0)
    warnings.push_back(
        fmt::format("{} are cut by rapids, first line {}", share(by_rapid, judged), first));
  return warnings;
}

ProgramGouge program_gouge(const Surface& surface, double explained) {
  ProgramGouge gouge;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    const double s = surface.residual[Index(i)];
    if (surface.status[i] != VertexStatus::Cut || !(s < -cutting::rubbing - explained)) continue;
    gouge.at.push_back(Index(i));
    ++gouge.vertices;
    if (-s <= gouge.deepest) continue;
    gouge.deepest = -s;
    gouge.line = surface.cut_line[i];
  }
  return gouge;
}

int by_flank(const ProgramGouge& gouge, const Surface& surface, const cutting::Design& design_w,
             const cutting::Cutter& cutter, const cutting::CutterMotion& motion) {
  constexpr double above_corner = 1e-3;  // mm, of the height at which the flank begins
  return int(std::count_if(gouge.at.begin(), gouge.at.end(), [&](Index i) {
    const Position tool = position(motion, surface.cut_time_s[i]);
    const Vector3d contact =
        design_w.vertices.row(i) + surface.residual[i] * design_w.normals.row(i);
    return tool.axis.dot(contact - tool.tip) > cutting::corner_height(cutter) + above_corner;
  }));
}

}  // namespace abbe::sim
