#include "cutting/shank.h"

#include <algorithm>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "cutting/stock.h"
#include "cutting/surface_input.h"
#include "cutting/sweep_tree.h"
#include "cutting/thickness.h"

namespace abbe::cutting {

using Eigen::Index;

namespace {

constexpr int block_size = 512;  // vertices that share their hints

/// The motion of the lower end of the shank.
CutterMotion raised(const CutterMotion& motion, double by) {
  CutterMotion up = motion;
  up.tip += by * motion.axis;
  return up;
}

/// mm below the design, and the line; 0 where the shank is not.
struct Depth {
  double depth = 0.0;
  int line = 0;
};

ShankContact summed(const std::vector<Depth>& depths) {
  ShankContact contact;
  for (const Depth& one : depths) {
    if (one.depth <= 0.0) continue;
    if (contact.vertices++ == 0 || one.line < contact.first_line) contact.first_line = one.line;
    if (one.depth <= contact.deepest) continue;
    contact.deepest = one.depth;
    contact.line = one.line;
  }
  return contact;
}

}  // namespace

std::optional<ShankContact> shank_contact(const Design& design_w, const Cutter& cutter,
                                          const CutterMotion& motion, const ShankOptions& options) {
  const double length = options.length - cutter.flank_length;
  const double least = std::min(rubbing, 0.25 * cutter.radius);
  if (!(length > 0.0) || !(options.band > least) || motion.tip.rows() == 0) return std::nullopt;
  Design all = design_w;
  all.judged.clear();
  const Cutter shank{cutter.radius, 0.0, length};
  const CutterMotion path = raised(motion, cutter.flank_length);
  check_milled(all, shank, path, options.band);
  const SweepTree tree(shank, path);
  const double middle = -0.5 * (options.band + least), half = 0.5 * (options.band - least);
  const std::vector<Index> order = judged_in_order(all);
  std::vector<Depth> depths(order.size());
  const auto range_of_all = tbb::blocked_range<std::size_t>(0, order.size(), block_size);
  tbb::parallel_for(range_of_all, [&](const auto& range) {
    SweepTree::Hint hint;
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      const Eigen::Vector3d normal = all.normals.row(order[k]);
      const Ray ray{all.vertices.row(order[k]).transpose() + middle * normal, normal, half};
      const std::optional<Removal> met = tree.first_removal(ray, hint);
      if (!met) continue;
      const Index next = std::min<Index>(met->move + 1, path.tip.rows() - 1);
      depths[k] = {std::min(options.band, -(met->s + middle)), path.line[std::size_t(next)]};
    }
  });
  if (std::all_of(depths.begin(), depths.end(), [](const Depth& d) { return d.depth <= 0.0; }))
    return std::nullopt;
  // a thin part is not met by what passes behind it
  const Thickness thickness(all);
  for (std::size_t k = 0; k < depths.size(); ++k) {
    if (depths[k].depth <= 0.0) continue;
    const auto behind = thickness.behind(order[k], 2.0 * options.band);
    if (behind && depths[k].depth > 0.5 * *behind) depths[k] = {};
  }
  const ShankContact contact = summed(depths);
  return contact.vertices > 0 ? std::optional(contact) : std::nullopt;
}

}  // namespace abbe::cutting
