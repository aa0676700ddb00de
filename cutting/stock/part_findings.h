#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/stock/part_deviation.h"

/// Regions of the skin of a machined part with rest material, gouges or undercuts.
namespace abbe::cutting {

/// Material left, material removed below the design, or cut skin under other material.
enum class FindingKind : std::uint8_t { Rest, Gouge, Undercut };
inline constexpr std::size_t finding_kinds = 3;

struct FindingOptions {
  double rest = 0.05;   ///< mm, > 0; more material than this is a finding
  double gouge = 0.05;  ///< mm, > 0; a deeper cut by the program or a crash is a finding
  /// Unit vector towards the tool: cut skin with other material above it in this direction is
  /// undercut. Empty: no search for undercuts.
  std::optional<Eigen::Vector3d> undercut_along = Eigen::Vector3d::UnitZ();
  std::size_t max_listed = 100;  ///< maximum number of listed regions of each kind
};

/// A connected region of the skin that exceeds a limit.
struct Finding {
  FindingKind kind = FindingKind::Rest;
  double volume = 0.0;  ///< mm^3 between skin and design; for an undercut, between its floor and
                        ///< the material above
  double area = 0.0;    ///< mm^2 of skin
  /// mm, maximum deviation, limited to the band; for an undercut its maximum height
  double depth = 0.0;
  Eigen::Vector3d position_w = Eigen::Vector3d::Zero();  ///< mm, position of that depth
  int line = 0;           ///< program line that cut the skin there; 0: never cut
  bool by_crash = false;  ///< true if a rapid move or the shank cut it
  Eigen::AlignedBox3d extent_w;
  int vertices = 0;
  bool is_at_least = false;  ///< true if the depth is a lower bound, since a part exceeds the band
};

/// All findings on a part.
struct Findings {
  /// Rest material, then gouges, then undercuts; each kind by descending volume.
  std::vector<Finding> list;
  /// Sums over one kind of region.
  struct Sums {
    std::size_t regions = 0;  ///< number of regions, listed or not, without speckles
    std::size_t listed = 0;   ///< number of listed regions
    double volume = 0.0, area = 0.0, depth = 0.0;  ///< sums over all regions; depth: the maximum
    double unlisted_volume = 0.0;
    std::size_t speckles = 0;  ///< regions of fewer than `min_vertices` vertices, which the dexels
                               ///< do not resolve
    double speckle_volume = 0.0, speckle_depth = 0.0;
  };
  std::array<Sums, finding_kinds> sums;  ///< by kind
  std::vector<int> number;    ///< (vertices) 1 + index in `list` of the rest or gouge; 0: none
  std::vector<int> undercut;  ///< (vertices) the same for undercuts
  double compared = 0.0;      ///< mm^2 of skin that was compared with the design
  double beyond_band = 0.0;   ///< mm^2, part of the compared skin that exceeds the band
  double no_design = 0.0;     ///< mm^2 not compared, see `SkinStatus::NoDesign`
  double unresolved = 0.0;    ///< mm^2 not compared, see `SkinStatus::Unresolved`
  /// mm^2, part of the compared skin that was never cut and lies below the design by more than the
  /// limit for gouges: the blank is too small
  double blank_too_small = 0.0;
};
/// Minimum number of vertices of a finding; smaller regions are speckles.
inline constexpr int min_vertices = 4;

/// Returns the findings on a part. The volumes of rest material and gouges are those of
/// `volumes_between`, without the material within the limit around a region. Areas and extents, and
/// heights and volumes of undercuts, include up to one dexel spacing around the region. Does not
/// find overhangs and gaps narrower than a spacing. The result is the same for any number of
/// threads.
/// @throws std::invalid_argument if sizes differ or a limit is not positive
Findings findings(const StockSkin& skin, const PartDeviation& deviation,
                  const DesignDistance& design, const FindingOptions& options = {});

}  // namespace abbe::cutting
