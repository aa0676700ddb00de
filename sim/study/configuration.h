#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "sim/loop/compensate.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// Returns a warning for each number of a study that is probably a mistake:
/// - an input whose spread seems to be in another unit than that of its path, or in percent
/// although it
///   is a factor or that of a logarithm;
/// - limits `low` and `high` that leave less than a fifth of the spread;
/// - a centre more than three spreads from the number of the scene;
/// - two inputs that change one element;
/// - a sweep that ends more than ten spreads from the centre;
/// - limits, steps, reaches and coverages in another unit;
/// - fewer than 100 random cases, whose P95 and P99 are extremes of a few.
/// @param scene  of the configuration that is judged, before any input
std::vector<std::string> study_warnings(const Study& study, const Scene& scene);

/// A configuration prepared for cutting its machines one after another. Immutable after its
/// preparation.
struct PreparedConfiguration {
  Configuration arm;
  Scene scene;  ///< before any input is set
  Job job;      ///< with all inputs at their centres; sampled densely enough for all their values
  Commands commanded;
  bool needs_commands_per_case = false;  ///< true if the commands depend on the inputs and are
                                         ///< computed for every machine
  cutting::Surface error_free;  ///< empty unless the study subtracts the error-free map
};
/// Prepares a configuration: its scene, its job sampled for all inputs, its commands.
/// @throws BadScene, BadInput
PreparedConfiguration prepare_configuration(const Study& study, const Configuration& arm,
                                            const Progress& progress = {});

/// Returns the commands of a configuration's program: compensated, or as programmed.
Commands commands(const Configuration& arm, const Job& job);

/// The result of cutting one machine, with the job for reuse by the next.
struct CutCase {
  Job job;
  cutting::Surface surface;   ///< as cut, not aligned
  Eigen::VectorXd responses;  ///< (responses) of the study
};
/// Cuts the machine of a configuration with its inputs at x. The bits do not depend on earlier uses
/// of the job.
/// @param job  a copy of the job of the configuration, or the job returned by another call
/// @throws BadScene, BadInput if that machine cannot cut the program
CutCase cut_at(const Study& study, const PreparedConfiguration& ready, Job job,
               const Eigen::VectorXd& x);

/// Returns (responses) the responses of a study, mm or percent, to a map in the alignment of the
/// scene, minus the error-free map if the study requests that. NaN for a response without a value.
Eigen::VectorXd responses(const Study& study, const Job& job, const cutting::Surface& surface,
                          const cutting::Surface& error_free);

}  // namespace abbe::sim::study
