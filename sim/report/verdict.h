#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/map/form.h"
#include "cutting/map/residual.h"
#include "errors/metrology/surface_texture.h"
#include "sim/cut/cut.h"
#include "sim/cut/job.h"

namespace abbe::sim {

/// A map parted by the areal filter of the part's cut-off.
struct FormTextureSplit {
  Eigen::VectorXd filtered;                         ///< (n) mm, NaN where not cut
  cutting::Statistics form;                         ///< of that
  std::optional<errors::metrology::Areal> texture;  ///< of the map minus it, about its mean; none
                                                    ///< where nothing is cut, or the places at
                                                    ///< random are too few to carry the form
};

/// @param surface    a map on the job's design, aligned
/// @param tolerance  of each vertex; no rows where there is none
FormTextureSplit split_form_texture(const Job& job, const cutting::Surface& surface,
                                    const cutting::ToleranceBands& tolerance);

struct StockCheck;

/// One case judged: its map aligned as the scene asks, and the figures of it.
struct Verdict {
  Cut cut;
  cutting::AlignmentResult aligned;  ///< the map without what the alignment of the scene takes out
  cutting::Statistics residual;      ///< of the aligned map
  std::vector<cutting::FormNumber> form;  ///< where the design is a known surface
  Eigen::VectorXd
      filtered;  ///< (n) mm, the aligned map through the areal filter; NaN where not cut
  std::optional<cutting::Statistics> form_part;     ///< of that
  std::optional<errors::metrology::Areal> texture;  ///< of the map minus it, about its mean
  std::optional<cutting::Statistics> machine;       ///< of it minus the error-free map
  /// A ring of the part, and its mean radius, mm; none where nothing of it is cut.
  struct Ring {
    std::string name;
    std::optional<double> radius;
  };
  std::vector<Ring> rings;
  cutting::ToleranceBands tolerance;  ///< mm, of each vertex; no rows where there is none
  /// A place of the part.
  struct Place {
    double residual = 0.0;  ///< mm
    Eigen::Vector3d at_m = Eigen::Vector3d::Zero();
    int line = 0;        ///< of the program, that made it
    bool bound = false;  ///< a gouge, that goes deeper than was searched
  };
  std::optional<Place> highest, lowest;  ///< gouges too
  std::optional<Place> worst;            ///< furthest out of its tolerance
  /// The machined body held against the design; null where none is followed or nobody asked.
  std::shared_ptr<const StockCheck> stock = {};
};

/// @param error_free  the map that is taken away for the machine's own part; null for that case
///                    itself
Verdict judge(const Job& job, Cut cut, const Verdict* error_free);

/// "PASS", "FAIL by 3.2 um at (12.1, -4.0, 80.2), line 18231" or, where nothing else is amiss,
/// "FAIL: 2.1 % of the judged area is not cut"; empty where the part has no tolerance or nothing of
/// it is judged.
std::string tolerance_verdict(const std::optional<cutting::Conformance>& conformance,
                              const std::optional<Verdict::Place>& worst);

/// Names the acceptance limits of the scene that a case exceeds; empty if none.
std::vector<std::string> exceeded_limits(const Limits& limits, const Verdict& verdict);

/// A case beside others.
struct Compared {
  Verdict verdict;
  const Job* job = nullptr;  ///< the scene itself, or the variant, that it belongs to
  std::optional<std::size_t> uncompensated;  ///< index of the case that it is measured against
};

/// Names as they stand in files and pictures.
const char* name_of(DatumDescription::Kind datum);
const char* name_of(Alignment alignment);

}  // namespace abbe::sim
