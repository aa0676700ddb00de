#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "cutting/stock/stock.h"

namespace abbe::cutting {

/// A thin ring of the cutter's outline.
struct EdgeSlice {
  double height = 0.0;  ///< mm above the tip, of its middle
  double radius = 0.0;  ///< mm, there
  double length = 0.0;  ///< mm along the outline
  double kappa = 0.0;   ///< rad between the outward normal and the tool axis pointing down to the
                        ///< part: pi/2 on the flank, 0 at the tip of a ball and on a flat bottom
};
/// Where a slice meets material: angles about z of frame t from its x, counter-clockwise seen from
/// the spindle side down on -z; from < to <= from + 2 pi.
struct EngagedArc {
  int slice = 0;
  double from = 0.0;
  double to = 0.0;
};
/// The part of a cutter that is in material.
struct Engagement {
  std::vector<EdgeSlice> slices;  ///< all of the cutter, from the tip up; then parts of slices
  std::vector<EngagedArc> arcs;
  Eigen::Vector3d feed_t = Eigen::Vector3d::UnitX();  ///< unit, motion of the tool in frame t
};

struct EngagementOptions {
  int slices_per_radius = 12;  ///< of a corner as large as the cutter's radius; a smaller corner
                               ///< and the flank are sliced as finely, a corner by 6 at least
  double max_slice = 1.0;      ///< mm, longest slice of a flank
  int angles = 60;             ///< tested around a slice before the ends of arcs are refined; even
};

/// A side faces the feed where its outward normal has more than this of it: below, there is no chip
/// to speak of, and a bottom that slides on the floor it made is not in the cut.
inline constexpr double min_facing = 0.01;

/// Slices of a cutter: a flat bottom, a corner, a flank, or the lines and arcs of a form cutter
/// below its top. Their lengths add up to the outline.
/// @throws std::invalid_argument for an impossible cutter or option
std::vector<EdgeSlice> slices(const Cutter& cutter, const EngagementOptions& options = {});

/// Which edges of the cutter are in the stock as it is now, looked at with the tool at its pose;
/// the step to that pose is not taken out yet. Only sides that face the feed are looked at. Where
/// the skin passes between two tested places it is found to 1e-7 rad (or mm along the outline) on
/// the interpolated skin, so integrals over the arcs move continuously with the pose: a slice that
/// is partly in material over a step of the angle has a slice of its own at the end of `slices`, as
/// long as it is on average there. Material that bulges between two tested places is not seen until
/// it reaches one, which may be a step of a thousandth of the whole; smaller with more angles and
/// slices.
/// @param feed_w  direction of motion, any length but zero
/// @throws std::invalid_argument if the pose or feed is not finite, the feed zero, an option or the
///         cutter impossible
Engagement engagement(const Stock& stock, const Cutter& cutter, const Eigen::Isometry3d& T_wt,
                      const Eigen::Vector3d& feed_w, const EngagementOptions& options = {});

// --- turning

/// A blank that turns: radius over the spindle line, linear between nodes.
struct TurnedStock {
  Eigen::Vector3d point_w = Eigen::Vector3d::Zero();       ///< mm, a point of the spindle line
  Eigen::Vector3d direction_w = Eigen::Vector3d::UnitX();  ///< unit, along it
  double first = 0.0;                                      ///< mm along it, of node 0
  double spacing = 0.01;                                   ///< mm
  Eigen::VectorXd radius;                                  ///< (n) mm
  std::vector<std::int32_t> line;  ///< (n) program line that cut it; 0: skin of the blank;
                                   ///< negative: by a rapid
};
/// mm^3, each piece between nodes as a frustum: order 2 in the spacing, 1 where the profile steps.
double volume(const TurnedStock& stock);

/// @param profile_mm  (m x 2) corners (along the line, radius) in rising order; two of equal place
///                    make a step
/// @throws std::invalid_argument if it falls back or has a negative radius, or spacing is not
///         positive; std::length_error with the estimate beyond 50 million nodes
TurnedStock make_turned_stock(const Eigen::Matrix<double, Eigen::Dynamic, 2>& profile_mm,
                              double spacing, const Eigen::Vector3d& point_w,
                              const Eigen::Vector3d& direction_w);

/// A piece of the nose's edge in material.
struct EngagedEdge {
  double psi = 0.0;     ///< rad, from x to z of frame t, of its middle
  double length = 0.0;  ///< mm along the edge
  double chip = 0.0;    ///< mm, uncut chip thickness across the edge
};

/// Pieces of the edge in material with the tool at a slow pose (turned back by the spindle), the
/// stock as the revolution before left it. The first and the last piece of a cut end where the edge
/// passes the profile. Chip thickness is that of the material between the edge and the profile,
/// from the edge's middle point towards the middle of the nose, at most to there; so the sum of
/// length times chip is the area of the chip to chip / (2 nose radius) of itself. Of an insert
/// every line and arc is cut into parts of two nodes of the stock, `pieces` at most, and the chip
/// is that along the inward normal of the edge, at most to the other side of the insert.
/// @throws std::invalid_argument for a pose that is not finite, an impossible nose, or under 3
/// pieces
std::vector<EngagedEdge> engagement(const TurnedStock& stock, const Nose& nose,
                                    const Eigen::Isometry3d& T_slow, int pieces = 200);

/// Takes one revolution out of the stock: every node is cut back to the lowest place of the edge
/// while it moves on a line between two slow poses, to 1e-9 of the radius that holds the edge.
/// @param line  what the nodes that are cut back remember, negative for a rapid
/// @return mm^3 removed
/// @throws std::invalid_argument for a pose that is not finite or an impossible nose
double remove(TurnedStock& stock, const Nose& nose, const Eigen::Isometry3d& from_T_slow,
              const Eigen::Isometry3d& to_T_slow, std::int32_t line = 1);

}  // namespace abbe::cutting
