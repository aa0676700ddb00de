#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "cutting/stock/part_deviation.h"

/// Where a machined part has material left, is gouged or undercut, by connected regions of its
/// skin.
namespace abbe::cutting {

enum class FindingKind : std::uint8_t { Rest, Gouge, Undercut };
inline constexpr std::size_t finding_kinds = 3;

struct FindingOptions {
  double rest = 0.05;   ///< mm, > 0: material left beyond this
  double gouge = 0.05;  ///< mm, > 0: cut deeper than this, by the program or a crash
  /// Unit, towards where the tool comes from: skin that was cut and is under other material along
  /// it is undercut. None: undercuts are not looked for.
  std::optional<Eigen::Vector3d> undercut_along = Eigen::Vector3d::UnitZ();
  std::size_t most = 100;  ///< listed of each kind
};

/// A connected region of the skin.
struct Finding {
  FindingKind kind = FindingKind::Rest;
  double volume = 0.0;  ///< mm^3, between skin and design; of an undercut the void from its floor
                        ///< up to what is above
  double area = 0.0;    ///< mm^2 of skin
  double depth =
      0.0;  ///< mm, the greatest deviation up to the band; of an undercut the greatest height
  Eigen::Vector3d place_w = Eigen::Vector3d::Zero();  ///< mm, where that is
  int line = 0;           ///< program line that made the skin there; 0: never cut
  bool by_crash = false;  ///< by a rapid or the shank, on that line
  Eigen::AlignedBox3d extent_w;
  int vertices = 0;
  bool is_at_least = false;  ///< the depth: some of it is further off than the band
};

struct Findings {
  /// Rest material, gouges, undercuts; of each kind the largest volumes first.
  std::vector<Finding> list;
  struct Sums {
    std::size_t regions = 0;  ///< listed or not, without speckles
    std::size_t listed = 0;
    double volume = 0.0, area = 0.0, depth = 0.0;  ///< of all of these
    double unlisted_volume = 0.0;
    std::size_t speckles = 0;  ///< regions of fewer than `min_vertices`: the dexels do not say
                               ///< how large they are
    double speckle_volume = 0.0, speckle_depth = 0.0;
  };
  std::array<Sums, finding_kinds> sums;  ///< by kind
  std::vector<int> number;    ///< (n) of a vertex, 1 + its row of the list: rest or gouge; 0: none
  std::vector<int> undercut;  ///< (n) the same of undercuts
  double compared = 0.0;      ///< mm^2 of skin
  double cut_off = 0.0;       ///< of it further off than the band
  double no_design = 0.0;
  double unresolved = 0.0;
  double too_small = 0.0;  ///< of it where a blank that was never cut lies under the design by more
                           ///< than the limit for gouges
};
inline constexpr int min_vertices = 4;

/// Volumes of rest material and gouges are those of `volumes_between`, less what lies under the
/// limit around a region. Areas and extents come to those of the region to a spacing around it, as
/// heights and volumes of undercuts do. Overhangs and gaps narrower than a spacing are no
/// undercuts. The same for any number of threads.
/// @throws std::invalid_argument if sizes differ or a limit is not positive
Findings findings(const StockSkin& skin, const PartDeviation& part, const DesignDistance& design,
                  const FindingOptions& options = {});

}  // namespace abbe::cutting
