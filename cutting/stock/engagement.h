#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "cutting/stock/stock.h"

/// The engagement of cutting edges: of a milling cutter in dexels, and of a turning tool in a
/// turned blank.
namespace abbe::cutting {

/// A thin ring of the cutter's outline.
struct EdgeSlice {
  double height = 0.0;  ///< mm above the tip, at the middle of the ring
  double radius = 0.0;  ///< mm, at the middle
  double length = 0.0;  ///< mm along the outline
  double kappa = 0.0;  ///< rad, between the outward normal and the tool axis towards the part: pi/2
                       ///< on the flank, 0 at the tip of a ball and on a flat bottom
};
/// The angles, rad, at which a slice is in material: about z of frame t from x, counter-clockwise
/// seen from the spindle along -z; from < to <= from + 2 pi.
struct EngagedArc {
  int slice = 0;
  double from = 0.0;
  double to = 0.0;
};
/// The engagement of a milling cutter.
struct Engagement {
  std::vector<EdgeSlice> slices;  ///< of the whole cutter from the tip upwards, then partial slices
  std::vector<EngagedArc> arcs;
  Eigen::Vector3d feed_t = Eigen::Vector3d::UnitX();  ///< unit, direction of motion in frame t
};

struct EngagementOptions {
  int slices_per_radius =
      12;                  ///< of a corner as large as the cutter's radius; slices of a smaller
                           ///< corner and the flank have the same length; a corner has at least 6
  double max_slice = 1.0;  ///< mm, maximum length of a slice of a flank
  int angles = 60;         ///< number of angles tested around a slice before arcs are refined; even
};

/// Minimum component of the outward normal along the feed of a surface that cuts. Below it the chip
/// is negligible; this excludes a bottom that slides on the floor it has cut.
inline constexpr double min_feed_component = 0.01;

/// Returns the slices of a cutter: those of the flat bottom, the corner and the flank, or of the
/// lines and arcs of a form cutter below its top. The sum of their lengths is the length of the
/// outline.
/// @throws std::invalid_argument for an impossible cutter or option
std::vector<EdgeSlice> slices(const Cutter& cutter, const EngagementOptions& options = {});

/// Returns the engagement of the cutter at a pose in the stock, from which the step to that pose
/// must not yet be removed. Only surfaces that face the feed are tested. The boundary of the
/// material between two tested points is located to 1e-7 rad (or mm along the outline) on the
/// interpolated skin, so that integrals over the arcs vary continuously with the pose. A slice that
/// is partly in material over a step of the angle is represented by a partial slice at the end of
/// `slices`, with the average length in that step. Material that bulges between two tested points
/// is not detected until it reaches one; this may cause a jump of a thousandth of the total, less
/// with more angles and slices.
/// @param feed_w  direction of motion, of any length except zero
/// @throws std::invalid_argument if the pose or feed is not finite, the feed is zero, or an option
///         or the cutter is impossible
Engagement engagement(const Stock& stock, const Cutter& cutter, const Eigen::Isometry3d& T_wt,
                      const Eigen::Vector3d& feed_w, const EngagementOptions& options = {});

// Turning.

/// A turned blank: radius along the spindle line, linear between nodes.
struct TurnedStock {
  Eigen::Vector3d point_w = Eigen::Vector3d::Zero();       ///< mm, a point of the spindle line
  Eigen::Vector3d direction_w = Eigen::Vector3d::UnitX();  ///< unit, along it
  double first = 0.0;              ///< mm along the line, position of node 0
  double spacing = 0.01;           ///< mm
  Eigen::VectorXd radius;          ///< (n) mm
  std::vector<std::int32_t> line;  ///< (n) program line that cut the node; 0: skin of the blank;
                                   ///< negative: cut by a rapid
};
/// Returns the volume, mm^3; each interval between nodes is a frustum. Converges at order 2 in the
/// spacing, at order 1 where the profile steps.
double volume(const TurnedStock& stock);

/// Returns the turned blank with a given profile.
/// @param profile_mm  (m x 2) corners (position along the line, radius) in ascending order; two at
/// the
///                    same position are a step
/// @throws std::invalid_argument if the positions fall or a radius is negative, or if the spacing
///         is not positive; std::length_error with the estimate beyond 50 million nodes
TurnedStock make_turned_stock(const Eigen::Matrix<double, Eigen::Dynamic, 2>& profile_mm,
                              double spacing, const Eigen::Vector3d& point_w,
                              const Eigen::Vector3d& direction_w);

/// A segment of a turning tool's edge in material.
struct EngagedEdge {
  double psi = 0.0;     ///< rad, from x to z of frame t, at the middle
  double length = 0.0;  ///< mm along the edge
  double chip = 0.0;    ///< mm, uncut chip thickness normal to the edge
};

/// Returns the segments of the edge in material for a slow pose of the tool (without the spindle's
/// rotation) and the stock left by the previous revolution. The first and the last segment of a cut
/// end where the edge crosses the profile.
/// The chip thickness is the length of material from the middle of the segment towards the centre
/// of the nose, at most to the centre; so the sum of length times chip equals the area of the chip
/// with a relative error of chip / (2 nose radius). Every line and arc of an insert is divided into
/// parts as long as two nodes of the stock, at most `segments`, and the chip is measured along the
/// inward normal of the edge, at most to the other side of the insert.
/// @throws std::invalid_argument for a pose that is not finite, an impossible nose, or fewer than 3
///         `segments`
std::vector<EngagedEdge> engagement(const TurnedStock& stock, const Nose& nose,
                                    const Eigen::Isometry3d& T_without_spindle, int segments = 200);

/// Removes one revolution from the stock: cuts every node back to the lowest point of the edge
/// during a linear motion between two slow poses, to 1e-9 of the radius of the circle that contains
/// the edge.
/// @param line  stored at the nodes that are cut; negative for a rapid
/// @return mm^3 removed
/// @throws std::invalid_argument for a pose that is not finite or an impossible nose
double remove(TurnedStock& stock, const Nose& nose, const Eigen::Isometry3d& from_T_slow,
              const Eigen::Isometry3d& to_T_slow, std::int32_t line = 1);

}  // namespace abbe::cutting
