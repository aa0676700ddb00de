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

/// Returns the triangles as a matrix.
inline Triangles triangle_matrix(const std::vector<std::array<int, 3>>& triangles) {
  if (triangles.empty()) return Triangles(0, 3);
  return Eigen::Map<const Triangles>(triangles.front().data(), Eigen::Index(triangles.size()), 3);
}

/// A run of material on a line, with the program lines that cut its ends: 0 for the skin of the
/// blank, negative if a crash on that line cut it.
struct DexelRun {
  double low = 0.0;  ///< mm along the line from the grid's origin
  double high = 0.0;
  std::int32_t low_line = 0;
  std::int32_t high_line = 0;
};

/// The runs of one line in ascending order. Takes 32 bytes; a single run needs no further memory.
class DexelLine {
 public:
  /// mm; smaller differences are rounding: no shorter length is removed and no shorter run remains.
  static constexpr double tolerance = 1e-9;

  DexelLine() : single_run_{} {}
  DexelLine(const DexelLine& other);
  DexelLine(DexelLine&& other) noexcept;
  DexelLine& operator=(DexelLine other) noexcept;
  ~DexelLine() { release(); }

  std::span<const DexelRun> runs() const { return {data(), count_}; }
  bool empty() const { return count_ == 0; }

  /// Returns the length of material, mm.
  double length() const;
  /// Returns the length of material between two positions, mm.
  double length(double low, double high) const;
  /// Returns the depth of a position inside material, along the line; negative outside, -infinity
  /// on an empty line.
  double signed_depth(double position) const;

  /// Adds material above all runs; extends the last run if it ends where the new one begins.
  void append(const DexelRun& run);
  /// Removes the material between two positions, which may be infinite. The new ends get `line`.
  /// Returns the removed length, mm.
  double cut(double low, double high, std::int32_t line);

 private:
  const DexelRun* data() const { return capacity_ == 0 ? &single_run_ : run_array_; }
  DexelRun* data() { return capacity_ == 0 ? &single_run_ : run_array_; }
  void release();
  void insert(std::uint32_t index, const DexelRun& run);
  void erase(std::uint32_t index);

  std::uint32_t count_ = 0;
  std::uint32_t capacity_ = 0;  // 0: the single run is stored in one_
  union {
    DexelRun single_run_;
    DexelRun* run_array_;
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

/// Returns the part before finishing: the body between a design surface raised along its normals
/// and a plane below it. A closed design is only raised.
/// @param design_k   open and visible from +z without folds, or closed
/// @param allowance  mm along the normals
/// @param floor      mm, z of the plane below; not used for a closed design
/// @throws std::invalid_argument if the raised surface does not stay above the floor or does not
///         face +z
MeshBlank offset_blank(const Design& design_k, double allowance, double floor);

/// Parallel dexel lines through the nodes of a grid.
struct DexelField {
  int along = 2;                 ///< axis of the grid frame: 0, 1 or 2
  std::array<int, 2> size{};     ///< number of lines along the next two axes, cyclic
  std::vector<DexelLine> lines;  ///< (size[0] * size[1]), first index fastest
};

/// Material as dexels: in one direction, z of the grid, which suits a tool axis along z, or in
/// three directions through the same nodes. A value type: a copy preserves the state.
struct Stock {
  Eigen::Isometry3d T_wk = Eigen::Isometry3d::Identity();  ///< pose of the grid frame k in the
                                                           ///< workpiece
  Eigen::Vector3d origin_k = Eigen::Vector3d::Zero();      ///< mm, position of the first node
  std::array<int, 3> nodes{};
  double spacing = 0.5;            ///< mm
  std::vector<DexelField> fields;  ///< one (along z) or three (along x, y, z)
};

/// Resolution and memory limit of the dexels.
struct StockOptions {
  double spacing = 0.5;  ///< mm between dexels
  bool three_directions = true;
  std::size_t max_bytes = std::size_t(2) << 30;
};

/// Returns the dexels of a blank. The nodes are symmetric about its centre: along each axis
/// round(extent / spacing), at least one, plus one outside at either end, so that the faces of a
/// box lie between nodes.
/// @throws std::length_error with the estimated MiB if it would take more than `max_bytes`;
///         std::invalid_argument if the spacing or the blank has no size or the mesh is not closed
Stock make_stock(const Blank& blank, const Eigen::Isometry3d& T_wk,
                 const StockOptions& options = {});

/// Returns the volume, mm^3: the mean over the directions of the sum of runs times spacing^2.
/// Averaged over the orientations of a body it converges at order 1.5 or better; for walls along
/// the grid, where whole layers of lines are in or out, at order 1. A plane across the lines of a
/// single direction is exact.
double volume(const Stock& stock);

/// Returns the depth of a point below the skin: > 0 in material, < 0 outside, -infinity outside the
/// grid, continuous within it. It is measured in mm along the grid's lines and interpolated between
/// their nodes, so it is at most sqrt(3) times the distance.
/// It is zero on the skin: with three directions exactly on planes of any orientation (2e-7 mm, up
/// to a spacing from their edges), to second order on curved skin (2.5 um on R 8 mm at 0.25 mm).
/// With one direction the same holds for surfaces with slopes below 4; walls are only accurate to
/// half a spacing. Beyond 3 spacings (4 with one direction) only the sign is meaningful. With three
/// directions a layer that passes between nodes is not detected.
double depth(const Stock& stock, const Eigen::Vector3d& point_w);

/// A straight segment of the tool's path.
struct StockMove {
  Eigen::Isometry3d from_T_wt;
  Eigen::Isometry3d to_T_wt;
  int line = 0;        ///< program line
  bool rapid = false;  ///< true if contact with material is a crash
};
/// Result of a move.
struct RemovalResult {
  double volume = 0.0;    ///< mm^3 removed
  bool crashed = false;   ///< true after contact in a rapid or of the shank above the flank
  std::size_t lines = 0;  ///< number of dexels tested against the sweep
};
/// The lines of a stock that are tested against a sweep: those that the sweep may reach, or all,
/// which is slow and gives the same bits.
enum class DexelSelection { Near, All };
/// Depth up to which a rapid or the shank may penetrate material without a crash, since spring-back
/// and drift make it rub on surfaces that were just cut. A quarter of the radius if that is less.
inline constexpr double rubbing = 0.1;  // mm

/// Removes the cutter's sweep from the stock. The tip moves on a line while the axis turns. If the
/// axis does not turn, ends of runs are exact to 1e-9 mm along their line; otherwise the move is
/// swept in parts, each within 2 um (normal to the surface, up to the end of the flank) of the true
/// sweep. The shank is the cylinder of the cutter's radius above its flank, without an end. Its
/// contact with material that the flank has not just cut is a crash. The shank of a form cutter has
/// the radius of its top.
/// @throws std::invalid_argument if a pose is not finite, the axis turns by half a turn or over a
///         move that is too long (kilometres), or the cutter is impossible
RemovalResult remove(Stock& stock, const Cutter& cutter, const StockMove& move,
                     DexelSelection dexels = DexelSelection::Near);

/// The machined part as a closed mesh: one vertex in every cell that the skin crosses, at the mean
/// of the crossings of the cell's edges. It cuts off edges of the part by less than a spacing, so
/// its volume converges to that of the stock at order 1 or better. `line` is that of most of the
/// crossings, as in DexelRun.
struct StockMesh {
  Points vertices_w;
  Triangles triangles;
  std::vector<std::int32_t> line;  ///< (vertices)
};
/// Returns the mesh of a stock.
StockMesh stock_mesh(const Stock& stock);

/// Computes `depth` of many points in their own frame while the stock does not change; neighbouring
/// points share the nodes of a cell. Not thread-safe.
class DepthProbe {
 public:
  /// @param stock  must outlive the probe
  /// @param T_wa   pose of the points' frame a in the workpiece
  DepthProbe(const Stock& stock, const Eigen::Isometry3d& T_wa);

  double depth(const Eigen::Vector3d& point_a);

 private:
  /// The depths at the eight nodes of a cell, indexed by the bits of their x, y, z.
  using NodeDepths = std::array<float, 8>;
  struct CachedCell {
    std::int64_t cell = -1;
    NodeDepths depths;
  };
  double depth_in_one_direction(const Eigen::Vector3d& grid_point, const int* cell) const;
  double depth_in_three_directions(const Eigen::Vector3d& grid_point, const int* cell);
  const NodeDepths& cached_depths(const int* cell);
  NodeDepths node_depths(const int* cell) const;

  const Stock& stock_;
  std::array<CachedCell, 512> cache_;
  Eigen::Isometry3d T_ga_;  // to the grid, in spacings from its first node
};

}  // namespace abbe::cutting
