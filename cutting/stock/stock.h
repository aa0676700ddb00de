#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <variant>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/part/mesh.h"
#include "cutting/surface/tool.h"

namespace abbe::cutting {

/// A run of material on a line, with the program lines that cut its ends: 0 for skin of the blank,
/// negative if it was cut by a crash on that line.
struct DexelRun {
  double low = 0.0;  ///< mm along the line from the grid's origin
  double high = 0.0;
  std::int32_t low_line = 0;
  std::int32_t high_line = 0;
};

/// The runs of one line in rising order. Its size is 32 bytes: a single run needs no memory of its
/// own.
class DexelLine {
 public:
  /// mm; smaller differences are rounding: no smaller amount is removed and no shorter run is kept.
  static constexpr double touch = 1e-9;

  DexelLine() : one_{} {}
  DexelLine(const DexelLine& other);
  DexelLine(DexelLine&& other) noexcept;
  DexelLine& operator=(DexelLine other) noexcept;
  ~DexelLine() { drop(); }

  std::span<const DexelRun> runs() const { return {data(), count_}; }
  bool empty() const { return count_ == 0; }

  /// Returns the length of material, mm.
  double length() const;
  /// Returns the length of material between two positions, mm.
  double length(double low, double high) const;
  /// Returns the depth of a position inside material, along the line; negative outside, -infinity
  /// on an empty line.
  double signed_depth(double at) const;

  /// Adds material beyond all existing runs; a run that ends where it begins is extended.
  void append(const DexelRun& run);
  /// Removes the material between two positions (either may be infinite); the new ends get `line`.
  /// @return mm of material removed
  double take(double low, double high, std::int32_t line);

 private:
  const DexelRun* data() const { return capacity_ == 0 ? &one_ : many_; }
  DexelRun* data() { return capacity_ == 0 ? &one_ : many_; }
  void drop();
  void insert(std::uint32_t place, const DexelRun& run);
  void erase(std::uint32_t place);

  std::uint32_t count_ = 0;
  std::uint32_t capacity_ = 0;  // 0: the single run is stored in one_
  union {
    DexelRun one_;
    DexelRun* many_;
  };
};

// The stock is the material left of the blank. It serves forces, engagement and pictures; the
// residual never uses it.

/// A box along the axes of frame k.
struct BoxBlank {
  Eigen::Vector3d lower_k = Eigen::Vector3d::Zero();  ///< mm
  Eigen::Vector3d upper_k = Eigen::Vector3d::Zero();
};
/// A cylinder about z of frame k.
struct CylinderBlank {
  double radius = 0.0;  ///< mm
  double lower = 0.0;   ///< mm, along z
  double upper = 0.0;
};
/// A closed body in frame k.
struct MeshBlank {
  Points vertices_k;
  Triangles triangles;
};
using Blank = std::variant<BoxBlank, CylinderBlank, MeshBlank>;

/// Returns the body between a design surface raised along its normals and a plane below it: the
/// part before finishing. A closed design is raised without a plane.
/// @param design_k   open and visible from +z without folds, or closed
/// @param allowance  mm along the normals
/// @param floor      mm, z of the plane below; not used for a closed design
/// @throws std::invalid_argument if the raised surface does not stay above the floor or does not
///         face +z
MeshBlank offset_blank(const Design& design_k, double allowance, double floor);

/// Parallel lines through the nodes of a grid, each with its runs of material in rising order.
struct DexelField {
  int along = 2;                 ///< axis of the grid frame: 0, 1 or 2
  std::array<int, 2> size{};     ///< number of lines along the next two axes, cyclic
  std::vector<DexelLine> lines;  ///< (size[0] * size[1]), first index fastest
};

/// Material as dexels: in one direction (z of the grid) if the tool axis is along it, or in three
/// directions through the same nodes. A value type: a copy preserves the state.
struct Stock {
  Eigen::Isometry3d T_wk = Eigen::Isometry3d::Identity();  ///< pose of the grid frame k in the
                                                           ///< workpiece
  Eigen::Vector3d origin_k = Eigen::Vector3d::Zero();      ///< mm, position of the first node
  std::array<int, 3> nodes{};
  double spacing = 0.5;            ///< mm
  std::vector<DexelField> fields;  ///< one (along z) or three (along x, y, z)
};

/// Resolution of the dexels, and the memory that they may take.
struct StockOptions {
  double spacing = 0.5;  ///< mm between dexels
  bool three_directions = true;
  std::size_t max_bytes = std::size_t(2) << 30;
};

/// Returns the dexels of a blank. Nodes are placed symmetrically about its centre, along each axis
/// round(extent / spacing) of them, at least one, plus one outside at either end: faces of a box
/// lie between nodes.
/// @throws std::length_error with the estimated MiB if it would take more than `max_bytes`;
///         std::invalid_argument if the spacing or the blank has no size or the mesh is not closed
Stock make_stock(const Blank& blank, const Eigen::Isometry3d& T_wk,
                 const StockOptions& options = {});

/// Returns the volume, mm^3: the mean over the directions of the sum of runs times spacing^2. It
/// converges at order 1.5 or better on average over the orientations of a body; at order 1 for
/// walls along the grid, where whole layers of lines are in or out; a plane across the lines of a
/// single direction is exact.
double volume(const Stock& stock);

/// Returns the depth of a point under the skin: > 0 in material, < 0 outside, -infinity outside the
/// grid, continuous within it. It is measured in mm along the grid's lines, interpolated between
/// their nodes, so it is at most sqrt(3) times the distance.
/// It is zero on the skin: with three directions exactly on planes of any orientation (2e-7 mm, up
/// to a spacing from their edges), to second order on curved skin (2.5 um on R 8 mm at 0.25 mm);
/// with one direction the same for surfaces flatter than 4 in 1, walls only to half a spacing.
/// Beyond 3 spacings (4 with one direction) only the sign is meaningful. With three directions a
/// layer that passes between nodes is not detected.
double depth(const Stock& stock, const Eigen::Vector3d& point_w);

/// A straight segment of the tool's path.
struct StockMove {
  Eigen::Isometry3d from_T_wt;
  Eigen::Isometry3d to_T_wt;
  int line = 0;        ///< program line
  bool rapid = false;  ///< material that is met is a crash
};
/// Result of a move.
struct RemovalResult {
  double volume = 0.0;    ///< mm^3 removed
  bool crashed = false;   ///< by a rapid, or by the shank above the flank
  std::size_t lines = 0;  ///< number of dexels tested against the sweep
};
/// The lines of a stock that are tested against a sweep: those that it may reach, or all of them,
/// which is slow and gives the same result to the bit.
enum class DexelSelection { Near, All };
/// Depth up to which a rapid or the shank may penetrate material without counting as a crash:
/// spring-back and drift make it rub on surfaces that were just cut. A quarter of the radius if
/// that is less.
inline constexpr double rubbing = 0.1;  // mm

/// Removes the cutter's sweep from the stock. The tip moves on a line while the axis turns. Ends of
/// runs are exact to 1e-9 mm along their line if the axis does not turn; a move with a turning axis
/// is swept in parts, each within 2 um (normal to the surface, up to the end of the flank) of the
/// true sweep.
/// The shank is the cylinder of the cutter's radius above its flank, without an end; it is a crash
/// if it meets material that the flank has not cut just before. The shank of a form cutter has the
/// radius of its top.
/// @throws std::invalid_argument if a pose is not finite, the axis turns by half a turn or over a
///         move that is too long (kilometres), or the cutter is impossible
RemovalResult remove(Stock& stock, const Cutter& cutter, const StockMove& move,
                     DexelSelection dexels = DexelSelection::Near);

/// The machined part as a mesh: one vertex in every cell that the skin crosses, at the mean of the
/// crossings of its edges. It is closed; edges of the part are cut off by less than a spacing, so
/// its volume converges to that of the stock at order 1 or better. `line` as in DexelRun, of most
/// of those crossings.
struct StockMesh {
  Points vertices_w;
  Triangles triangles;
  std::vector<std::int32_t> line;  ///< (vertices)
};
/// Returns the mesh of a stock.
StockMesh stock_mesh(const Stock& stock);

/// Computes `depth` of many points, given in a frame of their own, while the stock does not change;
/// neighbouring points share the nodes of a cell. Not thread-safe.
class DepthProbe {
 public:
  /// @param stock  must outlive the probe
  /// @param T_wa   pose of the frame in which points are given
  DepthProbe(const Stock& stock, const Eigen::Isometry3d& T_wa);

  double depth(const Eigen::Vector3d& point_a);

 private:
  /// The depths at the eight nodes of a cell, indexed by the bits of their x, y, z.
  using Nodes = std::array<float, 8>;
  struct Known {
    std::int64_t cell = -1;
    Nodes depths;
  };
  double along_one(const Eigen::Vector3d& place, const int* cell) const;
  double along_three(const Eigen::Vector3d& place, const int* cell);
  const Nodes& depths_of(const int* cell);
  Nodes looked_up(const int* cell) const;

  const Stock& stock_;
  std::array<Known, 512> known_;
  Eigen::Isometry3d T_ga_;  // to the grid, in spacings from its first node
};

}  // namespace abbe::cutting
