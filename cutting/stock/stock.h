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

/// A run of material on a line, with the program lines that cut its ends: 0 skin of the blank,
/// negative where it was cut by a crash on that line.
struct DexelRun {
  double low = 0.0;  ///< mm along the line from the grid's origin
  double high = 0.0;
  std::int32_t low_line = 0;
  std::int32_t high_line = 0;
};

/// The runs of one line in rising order. A value of 32 bytes: one run needs no memory of its own.
class DexelLine {
 public:
  /// Differences below this are rounding, mm: nothing is cut off by less, no shorter run is kept.
  static constexpr double touch = 1e-9;

  DexelLine() : one_{} {}
  DexelLine(const DexelLine& other);
  DexelLine(DexelLine&& other) noexcept;
  DexelLine& operator=(DexelLine other) noexcept;
  ~DexelLine() { drop(); }

  std::span<const DexelRun> runs() const { return {data(), count_}; }
  bool empty() const { return count_ == 0; }

  /// mm of material.
  double length() const;
  /// mm of material between two places.
  double length(double low, double high) const;
  /// How far a place is inside material, along the line; negative outside, -infinity on an empty
  /// line.
  double signed_depth(double at) const;

  /// Adds material beyond all there is; with what ends where it begins it becomes one run.
  void append(const DexelRun& run);
  /// Takes out what lies between two places (either may be infinite), which `line` then ends.
  /// @return mm of material taken
  double take(double low, double high, std::int32_t line);

 private:
  const DexelRun* data() const { return capacity_ == 0 ? &one_ : many_; }
  DexelRun* data() { return capacity_ == 0 ? &one_ : many_; }
  void drop();
  void insert(std::uint32_t place, const DexelRun& run);
  void erase(std::uint32_t place);

  std::uint32_t count_ = 0;
  std::uint32_t capacity_ = 0;  // 0: the one run lives here
  union {
    DexelRun one_;
    DexelRun* many_;
  };
};

// What is left of the blank: for forces, engagement and pictures; the residual never uses it.

struct BoxBlank {                                     ///< in frame k, along its axes
  Eigen::Vector3d lower_k = Eigen::Vector3d::Zero();  ///< mm
  Eigen::Vector3d upper_k = Eigen::Vector3d::Zero();
};
struct CylinderBlank {  ///< about z of frame k
  double radius = 0.0;  ///< mm
  double lower = 0.0;   ///< mm, along z
  double upper = 0.0;
};
struct MeshBlank {  ///< a closed body in frame k
  Points vertices_k;
  Triangles triangles;
};
using Blank = std::variant<BoxBlank, CylinderBlank, MeshBlank>;

/// The body between a design surface raised along its normals and a plane below it: what a part has
/// left before finishing. A closed design is raised as it is.
/// @param design_k   open and seen from +z without folds, or closed
/// @param allowance  mm along the normals
/// @param floor      mm, z of the plane below; not used for a closed design
/// @throws std::invalid_argument if the raised surface does not stay above the floor or does not
///         face +z
MeshBlank offset_blank(const Design& design_k, double allowance, double floor);

/// Parallel lines through the nodes of a grid, each with its runs of material in rising order.
struct DexelField {
  int along = 2;                 ///< axis of the grid frame, 0 1 2
  std::array<int, 2> size{};     ///< lines along the next two axes, cyclic
  std::vector<DexelLine> lines;  ///< (size[0] * size[1]), first index fastest
};

/// Material as dexels: one direction (z of the grid) where the tool axis keeps to it, or three
/// through the same nodes. A value: copying it keeps the state.
struct Stock {
  Eigen::Isometry3d T_wk = Eigen::Isometry3d::Identity();  ///< grid frame k in the workpiece
  Eigen::Vector3d origin_k = Eigen::Vector3d::Zero();      ///< mm, first node
  std::array<int, 3> nodes{};
  double spacing = 0.5;            ///< mm
  std::vector<DexelField> fields;  ///< one (along z) or three (along x, y, z)
};

struct StockOptions {
  double spacing = 0.5;  ///< mm between dexels
  bool three_directions = true;
  std::size_t max_bytes = std::size_t(2) << 30;
};

/// Dexels of a blank. Nodes lie evenly about its middle, as many along each axis as round(extent /
/// spacing), at least one, and one more outside at either end: faces of a box lie between nodes.
/// @throws std::length_error with the estimated MiB if it would take more than `max_bytes`;
///         std::invalid_argument if the spacing or the blank has no size or the mesh is not closed
Stock make_stock(const Blank& blank, const Eigen::Isometry3d& T_wk,
                 const StockOptions& options = {});

/// mm^3, mean over the directions of the sum of runs times spacing^2. Converges at order 1.5 or
/// better on average over the ways a body may lie; 1 for walls along the grid, where whole layers
/// of lines are in or out; a plane across the lines of a single direction is exact.
double volume(const Stock& stock);

/// Depth of a point under the skin: > 0 in material, < 0 outside, -infinity outside the grid,
/// continuous within it. In mm along the grid's lines, interpolated between their nodes, so at most
/// sqrt(3) times the distance. Zero on the skin: with three directions exactly on planes however
/// they lie (2e-7 mm, up to a spacing from their edges), to second order on curved skin (2.5 um on
/// R 8 mm at 0.25 mm); with one direction the same for surfaces flatter than 4 in 1, walls only to
/// half a spacing. Says no more than the side beyond 3 spacings (4 with one direction). With three
/// directions a layer that passes between nodes is not seen.
double depth(const Stock& stock, const Eigen::Vector3d& point_w);

/// A straight stretch of the tool's motion.
struct StockMove {
  Eigen::Isometry3d from_T_wt;
  Eigen::Isometry3d to_T_wt;
  int line = 0;        ///< program line
  bool rapid = false;  ///< material met is a crash
};
/// What a move took.
struct RemovalResult {
  double volume = 0.0;    ///< mm^3
  bool crashed = false;   ///< by a rapid, or by the shank above the flank
  std::size_t lines = 0;  ///< dexels that were held against the sweep
};
/// Which lines of a stock are held against a sweep: those that it may reach, or every one, which is
/// slow and takes the same to the bit.
enum class DexelSelection { Near, All };
/// Depth to which a rapid or the shank may go into material before it counts as a crash: what
/// spring-back and drift make it rub on surfaces just cut. A quarter of the radius if that is less.
inline constexpr double rubbing = 0.1;  // mm

/// Takes the cutter's sweep out of the stock. The tip moves on a line and the axis turns in
/// between. Ends of runs are exact to 1e-9 mm along their line where the axis stands; a turning
/// axis is swept in parts, each within 2 um (across the surface, up to the end of the flank) of the
/// sweep. The shank is the cylinder of the cutter's radius above its flank, without an end; where
/// it meets material that the flank has not cut just before, that is a crash. That of a form cutter
/// has the radius of its top.
/// @throws std::invalid_argument if a pose is not finite, the axis turns by half a turn or over a
///         move too long to be followed (kilometres), or the cutter is impossible
RemovalResult remove(Stock& stock, const Cutter& cutter, const StockMove& move,
                     DexelSelection dexels = DexelSelection::Near);

/// The machined part as a mesh: one vertex in every cell that the skin passes, at the mean of the
/// crossings of its edges. Closed; edges of the part are cut off by less than a spacing, so its
/// volume comes to that of the stock at order 1 or better. `line` as in DexelRun, of most of
/// those crossings.
struct StockMesh {
  Points vertices_w;
  Triangles triangles;
  std::vector<std::int32_t> line;  ///< (vertices)
};
StockMesh stock_mesh(const Stock& stock);

/// `depth` of many points given in a frame of their own, while the stock stays as it is; those
/// beside each other share the nodes of a cell. For one thread.
class DepthProbe {
 public:
  /// @param stock  outlives the probe
  /// @param T_wa   the frame in which points are given
  DepthProbe(const Stock& stock, const Eigen::Isometry3d& T_wa);

  double depth(const Eigen::Vector3d& point_a);

 private:
  /// The eight nodes of a cell, by the bits of their x, y, z.
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
