#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/part/mesh.h"
#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/sweep_tree.h"
#include "cutting/surface/tool.h"

/// Building blocks of the search for the machined surface: checks of the input, the order of the
/// vertices, first cuts along normals, and the second search of vertices that are gouged or uncut.
namespace abbe::cutting {

/// Checks design, cutter, motion and band (mm).
/// @throws std::invalid_argument as milled_surface
void check_milling_input(const Design& design, const Cutter& cutter, const CutterMotion& motion,
                         double band);

/// Checks the design without tool and motion.
/// @throws std::invalid_argument as milled_surface
void check_design(const Design& design);

/// Checks the design and the band (mm); NoseCutSearch checks nose and motion.
/// @throws std::invalid_argument as turned_surface
void check_turning_input(const Design& design, double band);

/// Checks the options of a search for competing passes.
/// @throws std::invalid_argument as milled_competing_passes
void check_pass_options(const CompetingPassOptions& options);

/// Returns true if the vertex lies in the judged region.
bool is_judged(const Design& design, Eigen::Index vertex);

/// Returns the judged vertices along a space-filling curve, so that neighbours in the order are
/// neighbours in space and have neighbouring removals.
std::vector<Eigen::Index> judged_vertices(const Design& design);

// The second search, of vertices whose ray starts in removed material or is not cut at all.

/// The first cut on a ray from inside the part outwards; s is -band if the ray starts in removed
/// material.
struct FirstCut {
  double s = 0.0;  ///< mm along the normal
  double time_s = 0.0;
  int line = 0;
};
using FirstCutFunction = std::function<std::optional<FirstCut>(const Ray&)>;  ///< thread-safe
/// Function that returns the first cuts of `count` rays; `ray(i)` is ray number i.
using FirstCutsFunction = std::function<std::vector<std::optional<FirstCut>>(
    std::size_t count, const std::function<Ray(std::size_t)>& ray)>;

/// A ray along a vertex normal whose point is shifted from the vertex by `shift` mm.
struct ShiftedRay {
  Ray ray;
  double shift = 0.0;
};

/// Rays that start half way through the part, for vertices where the part is thinner than two
/// bands. The design must outlive the object. Thread-safe.
class ThinPartRays {
 public:
  ThinPartRays(const Design& design, double band) : design_(design), band_(band) {}

  /// Returns the ray of a vertex, or nothing if the part is thicker there than two bands.
  std::optional<ShiftedRay> of(Eigen::Index vertex) const;

 private:
  const Design& design_;
  double band_;
  mutable std::once_flag once_;
  mutable std::optional<WallThickness> thickness_;
};

/// Returns the surface completed by its gouges: searches the ray of every Gouged or Uncut vertex
/// farther inwards, as described at milled_surface, and sets the vertex to Gouged, Uncut or, where
/// the part is thinner than two bands, Cut.
Surface complete_gouges(Surface surface, const Design& design, const SurfaceOptions& options,
                        const FirstCutFunction& first_cut);
/// Overload for callers that compute the first cuts of all rays together.
/// @param first_cuts  called once, or not at all if there is no ray
Surface complete_gouges(Surface surface, const Design& design, const SurfaceOptions& options,
                        const FirstCutsFunction& first_cuts);

// First cuts: position, instant and program line.

inline constexpr std::size_t first_cut_block = 512;  ///< number of vertices that share a hint

/// Converts a removal to a first cut with its time and program line.
FirstCut make_first_cut(const Removal& removal, const CutterMotion& motion);

/// Returns one tree of moves for each convex part of a cutter.
/// @param motion  must outlive the trees
std::vector<SweepTree> sweep_trees(const Cutter& cutter, const CutterMotion& motion);

/// Returns the first cut of a single ray by any of the convex parts; of equal cuts the earliest.
/// The result does not depend on earlier calls.
std::optional<FirstCut> first_cut(std::span<const SweepTree> trees, const CutterMotion& motion,
                                  const Ray& ray);

/// Returns the first cuts of the vertices along their normals, from -band on.
/// @param vertices  consecutive ones should be neighbours, as in `judged_vertices`
std::vector<std::optional<FirstCut>> first_cuts(std::span<const SweepTree> trees,
                                                const CutterMotion& motion, const Design& design,
                                                std::span<const Eigen::Index> vertices,
                                                double band);

/// Returns the surface before anything is cut.
/// @param judged  vertices of status Uncut; the others are Outside
Surface uncut_surface(const Design& design, std::span<const Eigen::Index> judged);

/// Stores the cut of a vertex that is Cut or Uncut so far if it is deeper than the stored one; a
/// cut at -band sets the vertex to Gouged.
void record_first_cut(Surface& surface, Eigen::Index vertex, const FirstCut& cut, double band);

}  // namespace abbe::cutting
