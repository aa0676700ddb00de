#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "sim/loop/compensate.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// Returns one warning for each number of a study that is probably a mistake:
/// - an input whose spread looks like a number in another unit than that of its path, or like
///   percent where it is a factor or of a logarithm;
/// - limits `low` and `high` that leave less than a fifth of the spread;
/// - a centre more than three spreads from the number that the scene states;
/// - two inputs that change one element;
/// - a sweep that ends more than ten spreads from the centre;
/// - limits, steps, reaches and coverages in another unit;
/// - fewer than 100 random cases, whose P95 and P99 are extremes of a few.
/// @param scene  of the configuration that is judged, before any input
std::vector<std::string> study_warnings(const Study& study, const Scene& scene);

/// A configuration prepared for cutting its machines one after the other. Immutable once made.
struct PreparedConfiguration {
  Configuration arm;
  Scene scene;  ///< before any input is set
  Job job;      ///< with all inputs at their centres; sampled densely enough for all their values
  Commands commanded;
  bool commanded_for_each = false;  ///< the commands depend on the inputs and are computed for
                                    ///< every machine
  cutting::Surface error_free;      ///< empty unless responses are those of the map minus the
                                    ///< error-free map
};
/// Prepares a configuration: its scene, its job sampled for all inputs, its commands.
/// @throws BadScene, BadInput
PreparedConfiguration prepare_configuration(const Study& study, const Configuration& arm,
                                            const Progress& progress = {});

/// Returns the commands of a configuration's program: compensated, or as programmed.
Commands commands(const Configuration& arm, const Job& job);

/// The result of cutting one machine; the job comes back for reuse by the next one.
struct Tried {
  Job job;
  cutting::Surface surface;   ///< as cut, not aligned
  Eigen::VectorXd responses;  ///< (responses) of the study
};
/// Cuts the machine of a configuration with its inputs at x. The bits do not depend on what the job
/// was used for before.
/// @param job  a copy of the configuration's job, or one that another call returned
/// @throws BadScene, BadInput if that machine cannot cut the program
Tried cut_at(const Study& study, const PreparedConfiguration& ready, Job job,
             const Eigen::VectorXd& x);

/// Returns the responses of a study, mm or percent: of the map as the scene aligns it, less the
/// error-free map if the study requests that. (responses) NaN where a response has no value
Eigen::VectorXd responses(const Study& study, const Job& job, const cutting::Surface& surface,
                          const cutting::Surface& error_free);

}  // namespace abbe::sim::study
