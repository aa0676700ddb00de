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

/// A map split into form and texture by the areal filter of the part's cut-off.
struct FormTextureSplit {
  Eigen::VectorXd filtered;                         ///< (n) mm, NaN where not cut
  cutting::Statistics form;                         ///< of `filtered`
  std::optional<errors::metrology::Areal> texture;  ///< of the map minus `filtered`, about its
                                                    ///< mean; empty if nothing is cut, or the
                                                    ///< random points are too few to carry the form
};

/// Splits a map.
/// @param surface    a map on the job's design, aligned
/// @param tolerance  of each vertex; no rows if there is none
FormTextureSplit split_form_texture(const Job& job, const cutting::Surface& surface,
                                    const cutting::ToleranceBands& tolerance);

struct StockCheck;

/// Verdict on one case: its map aligned as the scene says, with its figures.
struct Verdict {
  Cut cut;
  cutting::AlignmentResult aligned;       ///< the map without the displacement that the scene's
                                          ///< alignment removes
  cutting::Statistics residual;           ///< of the aligned map
  std::vector<cutting::FormNumber> form;  ///< form numbers if the design is a known surface
  Eigen::VectorXd
      filtered;  ///< (n) mm, the aligned map through the areal filter; NaN where not cut
  std::optional<cutting::Statistics> form_part;     ///< of `filtered`
  std::optional<errors::metrology::Areal> texture;  ///< of the map minus `filtered`, about its mean
  std::optional<cutting::Statistics> machine;       ///< of the map minus the error-free map
  /// A ring of the part with its mean radius, mm; empty if nothing of it is cut.
  struct Ring {
    std::string name;
    std::optional<double> radius;
  };
  std::vector<Ring> rings;
  cutting::ToleranceBands tolerance;  ///< mm, of each vertex; no rows if there is none
  /// A point of the part.
  struct Place {
    double residual = 0.0;  ///< mm
    Eigen::Vector3d at_m = Eigen::Vector3d::Zero();
    int line = 0;        ///< line of the program that made it
    bool bound = false;  ///< a gouge deeper than the searched band
  };
  std::optional<Place> highest, lowest;  ///< gouges included
  std::optional<Place> worst;            ///< farthest outside its tolerance
  /// Comparison of the machined body with the design; null if no stock is tracked or it was not
  /// requested.
  std::shared_ptr<const StockCheck> stock = {};
};

/// Judges a cut.
/// @param error_free  map that is subtracted to obtain the machine's own part; null for the
/// error-free case itself
Verdict judge(const Job& job, Cut cut, const Verdict* error_free);

/// Returns "PASS", "FAIL by 3.2 um at (12.1, -4.0, 80.2), line 18231" or, if uncut area is the only
/// failure, "FAIL: 2.1 % of the judged area is not cut"; empty if the part has no tolerance or
/// nothing of it is judged.
std::string tolerance_verdict(const std::optional<cutting::Conformance>& conformance,
                              const std::optional<Verdict::Place>& worst);

/// Returns a message for each acceptance limit of the scene that a case exceeds.
std::vector<std::string> exceeded_limits(const Limits& limits, const Verdict& verdict);

/// A case among others.
struct Compared {
  Verdict verdict;
  const Job* job = nullptr;  ///< the scene itself, or the variant that the case belongs to
  std::optional<std::size_t> uncompensated;  ///< index of the case it is compared with
};

/// Return names as they stand in files and pictures.
const char* name_of(DatumDescription::Kind datum);
const char* name_of(Alignment alignment);

}  // namespace abbe::sim
