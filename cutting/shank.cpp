#include "cutting/shank.h"

#include <algorithm>
#include <array>
#include <deque>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "cutting/cutter_entry.h"
#include "cutting/stock.h"
#include "cutting/surface_input.h"
#include "cutting/thickness.h"

namespace abbe::cutting {

using Eigen::AlignedBox3d;
using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr std::size_t chunk_size = 64;  // moves that share a box

/// The motion of the lower end of the shank.
CutterMotion raised(const CutterMotion& motion, double by) {
  CutterMotion up = motion;
  up.tip += by * motion.axis;
  return up;
}

AlignedBox3d grown(const AlignedBox3d& box, double by) {
  const Vector3d margin = Vector3d::Constant(by);
  return {box.min() - margin, box.max() + margin};
}

/// Box of the stretch of a shank's axis that lies in `room`; empty if none does.
AlignedBox3d stretch_in(const AlignedBox3d& room, const Vector3d& low_end, const Vector3d& axis,
                        double length) {
  double from = 0.0, to = length;
  for (int k = 0; k < 3; ++k) {
    if (axis[k] == 0.0) {
      if (low_end[k] < room.min()[k] || low_end[k] > room.max()[k]) return {};
      continue;
    }
    const double a = (room.min()[k] - low_end[k]) / axis[k];
    const double b = (room.max()[k] - low_end[k]) / axis[k];
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  AlignedBox3d box;
  if (from <= to) box.extend(low_end + from * axis).extend(low_end + to * axis);
  return box;
}

/// The moves on which a shank comes into the box around the part, with boxes around what of it
/// does. A long shank leans over much of a part; the stretch of it that is low enough is short.
class NearMoves {
 public:
  NearMoves(const Cutter& shank, const CutterMotion& path, const AlignedBox3d& part) {
    for (Index i = 0; i < path.tip.rows(); ++i) {
      const Index next = std::min<Index>(i + 1, path.tip.rows() - 1);
      const AlignedBox3d box = box_of(shank, path, {i, next}, part);
      if (!box.isEmpty()) moves_.push_back({box, int(i)});
    }
    for (std::size_t first = 0; first < moves_.size(); first += chunk_size) {
      AlignedBox3d all;
      for (std::size_t i = first; i < std::min(first + chunk_size, moves_.size()); ++i)
        all.extend(moves_[i].box);
      chunks_.push_back(all);
    }
  }

  bool empty() const { return moves_.empty(); }

  /// Calls use(move) for those whose box meets this one, until it returns false.
  template <class Use>
  void each(const AlignedBox3d& box, const Use& use) const {
    for (std::size_t c = 0; c < chunks_.size(); ++c) {
      if (!chunks_[c].intersects(box)) continue;
      const std::size_t first = c * chunk_size, last = std::min(first + chunk_size, moves_.size());
      for (std::size_t i = first; i < last; ++i)
        if (moves_[i].box.intersects(box) && !use(moves_[i].move)) return;
    }
  }

 private:
  /// Poses between two samples are nowhere further from one of them than `margin`.
  static AlignedBox3d box_of(const Cutter& shank, const CutterMotion& path,
                             const std::array<Index, 2>& ends, const AlignedBox3d& part) {
    const double length = shank.flank_length;
    const double margin =
        shank.radius + (path.tip.row(ends[1]) - path.tip.row(ends[0])).norm() +
        2.0 * (length + shank.radius) * (path.axis.row(ends[1]) - path.axis.row(ends[0])).norm();
    AlignedBox3d box;
    for (const Index i : ends) {
      const AlignedBox3d one =
          stretch_in(grown(part, margin), path.tip.row(i), path.axis.row(i), length);
      if (!one.isEmpty()) box.extend(grown(one, margin));
    }
    return box;
  }

  struct Near {
    AlignedBox3d box;
    int move;
  };
  std::vector<Near> moves_;
  std::vector<AlignedBox3d> chunks_;
};

/// A piece on its way through the room around the part.
struct Passing {
  Cutter shape;
  CutterMotion path;
  NearMoves moves;

  Passing(const IdlePiece& piece, const CutterMotion& motion, const AlignedBox3d& room)
      : shape(piece.shape), path(raised(motion, piece.base)), moves(shape, path, room) {}
};

/// mm below the design, and the line; 0 where the shank is not.
struct Depth {
  double depth = 0.0;
  int line = 0;
  bool deeper = false;  ///< the ray ends in the shank
};

ShankContact summed(const std::vector<Depth>& depths, double passed) {
  ShankContact contact;
  contact.passed = passed;
  for (const Depth& one : depths) {
    if (one.depth <= 0.0) continue;
    contact.deeper |= one.deeper;
    if (contact.vertices++ == 0 || one.line < contact.first_line) contact.first_line = one.line;
    if (one.depth <= contact.deepest) continue;
    contact.deepest = one.depth;
    contact.line = one.line;
  }
  return contact;
}

/// How deep a shank goes in at a vertex, at most to the far end of the ray.
Depth depth_at(const Cutter& shank, const CutterMotion& path, const NearMoves& moves,
               const Ray& ray, double middle) {
  AlignedBox3d box;
  box.extend(ray.point - ray.band * ray.normal).extend(ray.point + ray.band * ray.normal);
  Depth deepest;
  double limit = ray.band;
  moves.each(box, [&](int move) {
    const std::optional<Entry> met = first_entry(shank, move_after(path, move), ray, limit);
    if (!met) return true;
    if (met->s >= limit && deepest.depth > 0.0) return true;
    limit = met->s;
    const Index next = std::min<Index>(move + 1, path.tip.rows() - 1);
    deepest = {std::min(-(met->s + middle), ray.band - middle), path.line[std::size_t(next)],
               met->s <= -ray.band};
    return met->s > -ray.band;
  });
  return deepest;
}

/// A shank on its way, held against the vertices of a design.
class HeldAgainst {
 public:
  /// @param passed  mm that it may go in
  HeldAgainst(const Design& design_w, const Cutter& shank, const CutterMotion& path,
              const NearMoves& moves, double passed)
      : design_(design_w), shank_(shank), path_(path), moves_(moves), passed_(passed) {}

  /// Along the normal of a vertex.
  Depth depth(Index v, double band) const {
    if (band <= passed_) return {};
    const double middle = -0.5 * (band + passed_);
    const Vector3d normal = design_.normals.row(v);
    const Ray ray{design_.vertices.row(v).transpose() + middle * normal, normal,
                  0.5 * (band - passed_)};
    return depth_at(shank_, path_, moves_, ray, middle);
  }

  /// Of what was found along a normal that which is in the part, and how deep.
  Depth within(const Thickness& part, Index v, Depth found, double band) const {
    const Vector3d place = design_.vertices.row(v), normal = design_.normals.row(v);
    // a thin part is not met by what passes behind it
    const auto behind = part.behind(place, normal, 2.0 * band);
    if (behind && found.depth > 0.5 * *behind) found = depth(v, 0.5 * *behind);
    if (found.depth <= 0.0) return {};
    // the normal of a vertex on an edge runs along the face beyond it, and so does a shank
    found.depth = part.nearest(place - found.depth * normal, found.depth);
    return found.depth > passed_ ? found : Depth{};
  }

 private:
  const Design& design_;
  const Cutter& shank_;
  const CutterMotion& path_;
  const NearMoves& moves_;
  double passed_;
};

}  // namespace

std::vector<IdlePiece> idle_pieces(const Eigen::MatrixX2d& profile) {
  std::vector<IdlePiece> pieces;
  for (Index i = 0; i + 1 < profile.rows(); ++i) {
    const double height = profile(i + 1, 1) - profile(i, 1);
    // a cone needs some top
    const double top = std::max(profile(i + 1, 0), 1e-6 * profile.col(0).maxCoeff());
    if (height > 0.0)
      pieces.push_back(
          {form_cutter(outline_through({{{profile(i, 0), 0.0}}, {{top, height}}})), profile(i, 1)});
  }
  return pieces;
}

std::optional<ShankContact> shank_contact(const Design& design_w, const Cutter& cutter,
                                          const CutterMotion& motion, const ShankOptions& options) {
  const double length = options.length - cutter.flank_length;
  const double radius = options.radius.value_or(shank_radius(cutter));
  if (!(length > 0.0)) return std::nullopt;
  return idle_contact(design_w, {{{radius, 0.0, length}, cutter.flank_length}}, motion,
                      options.band);
}

std::optional<ShankContact> idle_contact(const Design& design_w,
                                         const std::vector<IdlePiece>& pieces,
                                         const CutterMotion& motion, double band) {
  double passed = rubbing;
  for (const IdlePiece& piece : pieces) passed = std::min(passed, 0.25 * piece.shape.radius);
  AlignedBox3d part;
  for (Index v = 0; v < design_w.vertices.rows(); ++v)
    part.extend(Vector3d(design_w.vertices.row(v)));
  if (part.isEmpty() || !(band > passed) || motion.tip.rows() == 0) return std::nullopt;

  std::deque<Passing> passing;  // what refers to itself does not move
  for (const IdlePiece& piece : pieces) {
    passing.emplace_back(piece, motion, grown(part, band));
    if (passing.back().moves.empty()) passing.pop_back();
  }
  if (passing.empty()) return std::nullopt;
  std::vector<HeldAgainst> held;
  for (const Passing& one : passing) {
    check_milled(design_w, one.shape, one.path, band);
    held.emplace_back(design_w, one.shape, one.path, one.moves, passed);
  }

  std::vector<Depth> depths(std::size_t(design_w.vertices.rows()));
  std::vector<std::vector<Depth>> of_pieces(held.size(), depths);
  const auto each = [&](const auto& act) {
    tbb::parallel_for(tbb::blocked_range<Index>(0, Index(depths.size()), 64), [&](auto& range) {
      for (Index v = range.begin(); v != range.end(); ++v)
        for (std::size_t k = 0; k < held.size(); ++k) act(v, held[k], of_pieces[k][std::size_t(v)]);
    });
  };
  each([&](Index v, const HeldAgainst& one, Depth& depth) { depth = one.depth(v, band); });
  const auto goes_in = [](const Depth& d) { return d.depth > 0.0; };
  if (std::ranges::none_of(of_pieces,
                           [&](const auto& d) { return std::ranges::any_of(d, goes_in); }))
    return std::nullopt;
  const Thickness thickness(design_w);
  each([&](Index v, const HeldAgainst& one, Depth& depth) {
    if (goes_in(depth)) depth = one.within(thickness, v, depth, band);
  });
  for (const std::vector<Depth>& one : of_pieces)
    for (std::size_t v = 0; v < depths.size(); ++v)
      if (one[v].depth > depths[v].depth) depths[v] = one[v];
  const ShankContact contact = summed(depths, passed);
  return contact.vertices > 0 ? std::optional(contact) : std::nullopt;
}

}  // namespace abbe::cutting
