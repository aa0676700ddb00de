#pragma once

#include <optional>
#include <string>
#include <vector>

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

}  // namespace abbe::sim::study
