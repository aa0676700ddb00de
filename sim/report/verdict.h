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

/// A map that the areal filter, with the part's cut-off, has split into form and texture.
struct FormTextureSplit {
  Eigen::VectorXd form_map;             ///< (n) mm, NaN where not cut
  cutting::Statistics form_statistics;  ///< of `form_map`
  std::optional<errors::metrology::ArealParameters>
      texture;  ///< of the map minus `form_map`, about its
                ///< mean; empty if nothing is cut, or if there
                ///< are too few random points for the filter
};

/// Splits a map into form and texture.
/// @param surface    aligned map on the job's design
/// @param tolerance  of each vertex; no rows if there is none
FormTextureSplit split_form_texture(const Job& job, const cutting::Surface& surface,
                                    const cutting::ToleranceBands& tolerance);

struct StockCheck;

/// Evaluation of one case: its map, aligned as the scene requests, and the figures of the map.
struct Verdict {
  Cut cut;
  cutting::AlignmentResult alignment;  ///< the map without the displacement that the scene's
                                       ///< alignment removes
  cutting::Statistics residual;        ///< of the aligned map
  std::vector<cutting::FormNumber>
      form_deviations;  ///< form deviations if the design is an analytic surface
  Eigen::VectorXd
      form_map;  ///< (n) mm, the aligned map through the areal filter; NaN where not cut
  std::optional<cutting::Statistics> form_statistics;  ///< of `form_map`
  std::optional<errors::metrology::ArealParameters>
      texture;  ///< of the map minus `form_map`, about its mean
  std::optional<cutting::Statistics> machine_contribution;  ///< of the map minus the error-free map
  /// A ring of the part.
  struct Ring {
    std::string name;
    std::optional<double> radius;  ///< mm, mean radius; empty if no vertex of the ring is cut
  };
  std::vector<Ring> rings;
  cutting::ToleranceBands tolerance;  ///< mm, of each vertex; no rows if there is none
  /// A point of the part with an extreme residual.
  struct ExtremePoint {
    double residual = 0.0;                                 ///< mm
    Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< mm, position in the part frame
    int line = 0;                                          ///< line of the program that cut it
    bool is_bound = false;  ///< the true gouge is deeper, because it exceeds the searched band
  };
  std::optional<ExtremePoint> highest, lowest;  ///< including gouges
  std::optional<ExtremePoint> worst;            ///< farthest outside its tolerance
  /// Comparison of the machined body with the design; null if no stock is tracked, or if it was not
  /// requested.
  std::shared_ptr<const StockCheck> stock = {};
};

/// Evaluates a cut.
/// @param error_free  evaluation of the error-free case, whose map is subtracted to obtain the
/// contribution of the machine; null for the error-free case itself
Verdict judge(const Job& job, Cut cut, const Verdict* error_free);

/// Returns "PASS", "FAIL by 3.2 um at (12.1, -4.0, 80.2), line 18231" or, if uncut area is the only
/// failure, "FAIL: 2.1 % of the judged area is not cut"; empty without a tolerance or a judged
/// area.
std::string tolerance_verdict(const std::optional<cutting::Conformance>& conformance,
                              const std::optional<Verdict::ExtremePoint>& worst);

/// Returns a message for each acceptance limit of the scene that a case exceeds.
std::vector<std::string> exceeded_limits(const Limits& limits, const Verdict& verdict);

/// A case of a comparison.
struct ComparedCase {
  Verdict verdict;
  const Job* job = nullptr;  ///< job of the scene, or of the case's variant
  std::optional<std::size_t>
      uncompensated_index;  ///< index of the uncompensated case of the same variant
};

/// Return the names used in files and pictures.
const char* name_of(DatumDescription::Kind datum);
const char* name_of(Alignment alignment);

}  // namespace abbe::sim
