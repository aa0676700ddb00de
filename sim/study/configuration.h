#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "sim/loop/compensate.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// The result on one day (test) of a thermal belief learned on another (train). The drift part of a
/// map is the map of the machine with its heat, minus the uncompensated map of the same machine on
/// the same day with `thermal.scale = 0`: with the same geometric errors, tool and random numbers,
/// but without displacements by heat, also while the datum is measured. The second map is the same
/// with and without the compensator, and neither map is aligned. Residuals due to geometric errors
/// and program cancel.
struct HistoryResult {
  std::string train;  ///< variant; "" for the scene's own day
  std::string test;
  bool is_own_day = false;  ///< true if both days have the same name, or the same history, room and
                            ///< coolant
  double uncompensated_rms = 0.0;           ///< mm, drift part of the map, weighted by area
  double compensated_rms = 0.0;             ///< mm, the same with the belief of the train day
  std::optional<double> reduction_percent;  ///< negative: made worse; empty where heat moves the
  std::vector<std::string> sensors;   ///< sensors that the belief reads, in the order of selection
  std::vector<std::string> warnings;  ///< of learning, then of the compensated cut
};

/// Learns a thermal belief on every train day and compensates the part of every test day with it.
/// The [[instrument]] tables of a train day that read the machine (a variant may set its own by
/// `instrument`) read it as in `abbe measure`. The belief is made from the contents of their files
/// as in `abbe identify --method thermal`, with four sensors; nothing else of the truth is used,
/// nor is a `[belief.thermal]` of the scene. Random numbers depend on the seed of each day: days
/// with independent noise need a `seed` of their own. A day is judged with its own readings only if
/// it is in both lists; then `is_own_day` is true.
/// @param progress  shows one stage, "thermal histories", by days learned and parts cut
/// @return train day by train day, for each test day by test day
/// @throws BadScene for a day that does not exist; BadInput naming the scene if a day has no heat,
/// or no readings from which heat can be learned, or naming the study if it has no [histories] or
/// its case uses more than a thermal belief; Interrupted
std::vector<HistoryResult> histories(const Study& study, const Progress& progress = {});

/// Returns the compensator of a study with [histories].
/// @throws BadInput naming the study if the compensator uses more than a thermal belief
CaseDescription histories_compensator(const Study& study);

/// Returns a list of objects with lengths in um, and keys that are stable for scripts.
nlohmann::ordered_json to_json(const std::vector<HistoryResult>& results);
/// Returns the contents of `histories.csv`: a row for each result, with sensors separated by "; ".
std::string to_csv(const std::vector<HistoryResult>& results);
/// Returns the results as a table for a terminal.
std::string to_text(const std::vector<HistoryResult>& results);

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
  cutting::Surface error_free;           ///< empty unless the study subtracts the error-free map
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
