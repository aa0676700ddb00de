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

/// What the functions that find the machined surface at vertices are given.
namespace abbe::cutting {

/// @throws std::invalid_argument as milled_surface
void check_milled(const Design& design, const Cutter& cutter, const CutterMotion& motion,
                  double band);

/// The design alone.
/// @throws std::invalid_argument as milled_surface
void check_design(const Design& design);

/// The design and the band only: nose and motion are checked where they are taken up.
/// @throws std::invalid_argument as turned_surface
void check_turned(const Design& design, double band);

/// @throws std::invalid_argument as milled_rivals
void check_pass_options(const CompetingPassOptions& options);

bool is_judged(const Design& design, Eigen::Index vertex);

/// The judged vertices along a space-filling curve, so that neighbours in the order have
/// neighbouring removals.
std::vector<Eigen::Index> judged_along_curve(const Design& design);

// The vertices whose ray starts in removed material or meets none, looked at a second time.

/// What removes a ray first, coming from inside the part; s is -band of the ray if it starts in
/// removed material.
struct FirstCut {
  double s = 0.0;  ///< mm along the normal
  double time_s = 0.0;
  int line = 0;
};
using FirstCutFunction = std::function<std::optional<FirstCut>(const Ray&)>;  ///< from any thread
/// Of so many rays at once, each made on request.
using FirstCutsFunction = std::function<std::vector<std::optional<FirstCut>>(
    std::size_t count, const std::function<Ray(std::size_t)>& ray)>;

/// The stretch of a normal that a ray covers, its middle `shift` mm from the vertex.
struct ShiftedRay {
  Ray ray;
  double shift = 0.0;
};

/// Rays that start half way through the part, for vertices where that is nearer than -band.
/// The design outlives them; asked from any thread.
class ThinPartRays {
 public:
  ThinPartRays(const Design& design, double band) : design_(design), band_(band) {}

  /// None where the part is not so thin.
  std::optional<ShiftedRay> of(Eigen::Index vertex) const;

 private:
  const Design& design_;
  double band_;
  mutable std::once_flag once_;
  mutable std::optional<Thickness> thickness_;
};

/// The map with its gouges: every vertex that it calls Gouged (its ray starts in removed material)
/// or Uncut is followed inwards as milled_surface says, and called Gouged, Uncut or, where the part
/// is thinner than two bands, Cut.
Surface with_gouge_depths(Surface surface, const Design& design, const SurfaceOptions& options,
                          const FirstCutFunction& first_cut);
/// The same where the first cuts of all rays are found together. @param first_cuts  asked once, if
/// there is a ray
Surface with_gouge_depths(Surface surface, const Design& design, const SurfaceOptions& options,
                          const FirstCutsFunction& first_cuts);

// Removals as what is reported of them: a place, an instant and a line of the program.

inline constexpr std::size_t first_cut_block = 512;  ///< vertices that share their hints

FirstCut cut_of(const Removal& removal, const CutterMotion& motion);

/// The moves of each convex part of a cutter. @param motion  outlives them
std::vector<SweepTree> sweep_trees(const Cutter& cutter, const CutterMotion& motion);

/// First cut of one ray alone, whatever was asked before, by any of the parts: of equal ones the
/// earliest.
std::optional<FirstCut> first_cut(std::span<const SweepTree> trees, const CutterMotion& motion,
                                  const Ray& ray);

/// First cuts along the normals, from -band on. @param vertices  beside each other: as
/// `judged_along_curve`. @return (vertices)
std::vector<std::optional<FirstCut>> first_cuts(std::span<const SweepTree> trees,
                                                const CutterMotion& motion, const Design& design,
                                                std::span<const Eigen::Index> vertices,
                                                double band);

/// A surface before anything is cut of it. @param judged  its vertices; the others are Outside
Surface uncut_surface(const Design& design, std::span<const Eigen::Index> judged);

/// Keeps the cut of a vertex that is Cut or Uncut so far if it comes before what is known; one at
/// -band makes it Gouged.
void keep_first(Surface& surface, Eigen::Index vertex, const FirstCut& cut, double band);

}  // namespace abbe::cutting
