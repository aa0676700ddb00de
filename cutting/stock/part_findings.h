#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/stock/part_deviation.h"

/// Regions of the skin of a machined part where material is left, where it is gouged or undercut.
namespace abbe::cutting {

/// Material left, material cut away below the design, or skin under other material.
enum class FindingKind : std::uint8_t { Rest, Gouge, Undercut };
inline constexpr std::size_t finding_kinds = 3;

struct FindingOptions {
  double rest = 0.05;   ///< mm, > 0: more material left than this
  double gouge = 0.05;  ///< mm, > 0: cut deeper than this, by the program or a crash
  /// Unit, direction from which the tool comes: skin that was cut and lies under other material
  /// along it is undercut. Empty: undercuts are not searched for.
  std::optional<Eigen::Vector3d> undercut_along = Eigen::Vector3d::UnitZ();
  std::size_t most = 100;  ///< number of regions of each kind that are listed
};

/// A connected region of the skin.
struct Finding {
  FindingKind kind = FindingKind::Rest;
  double volume = 0.0;  ///< mm^3, between skin and design; for an undercut the void from its floor
                        ///< up to the material above
  double area = 0.0;    ///< mm^2 of skin
  /// mm, the greatest deviation, up to the band; for an undercut the greatest height
  double depth = 0.0;
  Eigen::Vector3d place_w = Eigen::Vector3d::Zero();  ///< mm, location of that depth
  int line = 0;           ///< program line that made the skin there; 0: never cut
  bool by_crash = false;  ///< made by a rapid or the shank on that line
  Eigen::AlignedBox3d extent_w;
  int vertices = 0;
  bool is_at_least = false;  ///< the depth is a lower bound: some of the region is farther than the
                             ///< band
};

/// The regions found on a part.
struct Findings {
  /// Rest material, gouges, undercuts; within each kind the largest volumes first.
  std::vector<Finding> list;
  /// Sums over one kind of region.
  struct Sums {
    std::size_t regions = 0;  ///< all regions, listed or not, without speckles
    std::size_t listed = 0;
    double volume = 0.0, area = 0.0, depth = 0.0;  ///< of these regions; depth: the largest
    double unlisted_volume = 0.0;
    std::size_t speckles = 0;  ///< regions of fewer than `min_vertices`, whose size the dexels do
                               ///< not resolve
    double speckle_volume = 0.0, speckle_depth = 0.0;
  };
  std::array<Sums, finding_kinds> sums;  ///< by kind
  std::vector<int> number;  ///< (n) of a vertex, 1 + row of its rest or gouge in the list; 0: none
  std::vector<int> undercut;  ///< (n) the same for undercuts
  double compared = 0.0;      ///< mm^2, compared skin
  double cut_off = 0.0;       ///< mm^2, part of it that is farther than the band
  double no_design = 0.0;
  double unresolved = 0.0;
  double too_small = 0.0;  ///< mm^2, part of it where a blank that was never cut lies under the
                           ///< design by more than the limit for gouges
};
/// Least number of vertices of a finding; smaller regions are speckles.
inline constexpr int min_vertices = 4;

/// Returns the findings. Volumes of rest material and gouges are those of `volumes_between`, less
/// the volume below the limit around a region. Areas and extents are those of the region plus up to
/// a spacing around it, and so are heights and volumes of undercuts. Overhangs and gaps narrower
/// than a spacing are no undercuts. The result is the same for any number of threads.
/// @throws std::invalid_argument if sizes differ or a limit is not positive
Findings findings(const StockSkin& skin, const PartDeviation& part, const DesignDistance& design,
                  const FindingOptions& options = {});

}  // namespace abbe::cutting
