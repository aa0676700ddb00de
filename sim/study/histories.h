#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "sim/loop/compensate.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// What a thermal belief that was learnt on one day is worth on another. The drift part of a map is
/// the map of the machine with its heat, less the uncompensated map of the same machine on the same
/// day with `thermal.scale = 0`: the same geometric errors, tool and chances, only nothing moves by
/// heat, not even while the datum is found. The second map is one and the same with and without the
/// compensator; neither is aligned. What geometric errors and program leave drops out of both.
struct HistoryResult {
  std::string train;  ///< variant, "" for the scene's own day
  std::string test;
  bool is_own_day = false;  ///< learnt and judged on one day: of that name, or with that very
                            ///< history, room and coolant
  double uncompensated_rms = 0.0;           ///< mm, drift part of the map, weighted by area
  double compensated_rms = 0.0;             ///< mm, the same with the belief of the train day
  std::optional<double> reduction_percent;  ///< negative: made worse; none where heat moves the
                                            ///< uncompensated map by less than 1 nm RMS
  std::vector<std::string> sensors;  ///< that the belief reads, in the order in which it chose them
  std::vector<std::string> warnings;  ///< of learning, then of the compensated cut
};

/// Learns a thermal belief on every train day and compensates the part of every test day with it.
/// All [[instrument]] tables of a train day that read the machine (a variant brings its own by
/// `instrument` in its set) read it as `abbe measure` does, and `abbe identify --method thermal`
/// makes the belief, four sensors chosen, of what their files say; nothing else of the truth gets
/// into it, and a `[belief.thermal]` of the scene is not used. Chance is drawn from the seed of
/// each day: days that shall not share their noise set a `seed` of their own. A day is never judged
/// by its own readings unless it is in both lists, and then `is_own_day` says so.
/// @param progress  shows one stage, "thermal histories", by days learnt and parts cut
/// @return train by train, test by test
/// @throws BadScene for a day that is none, BadInput naming the scene where a day has no heat or
///         cannot be measured or learnt from, naming the study where it has no [histories] or its
///         case believes in more than temperatures; Interrupted
std::vector<HistoryResult> histories(const Study& study, const Progress& progress = {});

/// The compensator of a study with [histories].
/// @throws BadInput naming the study if it believes in more than temperatures
CaseDescription case_of_histories(const Study& study);

/// A list of objects, lengths in um; the keys are a promise to scripts.
nlohmann::ordered_json to_json(const std::vector<HistoryResult>& results);
/// `histories.csv`: a row a result; sensors parted by "; ".
std::string to_csv(const std::vector<HistoryResult>& results);
/// The same as a table for a terminal.
std::string to_text(const std::vector<HistoryResult>& results);

}  // namespace abbe::sim::study
