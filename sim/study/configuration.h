#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "sim/loop/compensate.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// Returns one warning for each number of a study that is hardly intended:
/// - an input whose spread looks like a number in another unit than that of its path, or like
///   percent where it is a factor or of a logarithm;
/// - limits `low` and `high` that leave less than a fifth of the spread;
/// - a centre more than three spreads from the number that the scene states;
/// - two inputs that change one element;
/// - a sweep that ends more than ten spreads from the centre;
/// - limits, steps, reaches and coverages in another unit;
/// - fewer than 100 random cases, whose P95 and P99 are extremes of a few.
/// @param scene  of the arm that is judged, before any input
std::vector<std::string> study_warnings(const Study& study, const Scene& scene);

/// An arm made ready, so that its machines can be tried one after the other. Immutable once made.
struct PreparedConfiguration {
  Configuration arm;
  Scene scene;  ///< before any input
  Job job;      ///< with all inputs at their centres; sampled densely enough for all their values
  Commands commanded;
  bool commanded_for_each = false;  ///< the commands depend on the inputs
  cutting::Surface error_free;      ///< empty unless the study asks for the machine's part
};
/// @throws BadScene, BadInput
PreparedConfiguration prepare_configuration(const Study& study, const Configuration& arm,
                                            const Progress& progress = {});

/// The commands of an arm's program: compensated, or as the control knows it.
Commands commands(const Configuration& arm, const Job& job);

/// One machine tried; the job comes back to be used for the next.
struct Tried {
  Job job;
  cutting::Surface surface;   ///< as cut, not aligned
  Eigen::VectorXd responses;  ///< (responses) of the study
};
/// Cuts the machine of an arm with its inputs at x. The same bits whatever the job was used for.
/// @param job  a copy of the arm's, or what another try gave back
/// @throws BadScene, BadInput where that machine cannot cut the program
Tried cut_at(const Study& study, const PreparedConfiguration& ready, Job job,
             const Eigen::VectorXd& x);

/// The responses of a study, mm or percent: of the map as the scene aligns it, less the error-free
/// one where the study asks for that. (responses) NaN where there is none
Eigen::VectorXd responses(const Study& study, const Job& job, const cutting::Surface& surface,
                          const cutting::Surface& error_free);

}  // namespace abbe::sim::study
