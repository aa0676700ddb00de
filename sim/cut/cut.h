#pragma once

#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cutting/map/interpolation.h"
#include "sim/cut/collision_events.h"
#include "sim/cut/job.h"
#include "sim/cut/signals.h"
#include "sim/cut/tool_poses.h"

/// The cut of one case: the program on the machine, error-free or with errors, and the surface it
/// leaves.
namespace abbe::sim {

/// Root mean square and maximum over the samples of a program.
struct Spread {
  double rms = 0.0;
  double max = 0.0;
};

/// The result of cutting one case.
struct Cut {
  std::string name;       ///< name in reports; for a variant with the name of the variant in front
  std::string case_name;  ///< argument of `run --case`
  cutting::Surface surface;
  std::optional<cutting::InterpolationError> interpolation;  ///< only after `sampled`
  Spread tip_error;                    ///< mm, actual against nominal position of the tip
  Spread direction_error;              ///< rad
  ChordError chord_error;              ///< without intervals in the error-free case
  double remaining_point_error = 0.0;  ///< largest position error known to the compensator that it
                                       ///< could not remove, mm
  double remaining_direction_error = 0.0;  ///< the same for the direction, rad
  Process process;                       ///< forces and stock as simulated; empty without [cutting]
  Signals signals;                       ///< empty without heat, force or channels
  std::vector<WornTool> wear;            ///< of the tools that wear, at the end of the program
  std::string rewritten_program;         ///< text of the program channel; empty for other channels
  std::optional<Collisions> collisions;  ///< if the scene requests them
  std::optional<ToolTrack> track;        ///< if requested by `Retention::Track`
  std::vector<std::string> warnings;
  std::map<std::string, double> timing_s;
};

/// Data kept in addition to the map of a cut. The track of the tool takes about 180 bytes a sample.
enum class Retention { Map, Track };

/// Cuts the program on the machine without any error, with perfect tool, setup and control.
Cut cut_error_free(const Job& job, const Progress& progress = {}, Retention keep = Retention::Map);

/// Cuts the program on the machine with errors, without a compensator.
/// @throws BadInput if a commanded axis leaves its travel (with program line, axis and value) or
///     the range of an error table
Cut cut(const Job& job, const Progress& progress = {}, Retention keep = Retention::Map);

/// Cuts given commands, compensated or not, on the machine with errors.
/// @throws BadInput as the overload without commands; CollisionStop if the scene asks to stop at a
///     collision and there is one
Cut cut(const Job& job, const Commands& commands, const Progress& progress = {},
        Retention keep = Retention::Map);

/// Cuts a job in windows on the machine with errors, in the memory of one window and of the steps
/// of the cutting process. Each window is sampled, commanded and swept as often as the surface
/// needs it; figures are those of the first time.
/// @throws BadInput, CollisionStop  as `cut`
Cut cut_in_windows(const Job& job, const WindowedProgram& program, const Progress& progress = {});

/// Throws BadInput with the first program line on which a commanded axis leaves its travel.
void check_travel(const Job& job, const Commands& commands);

/// Simulates the cutting process (stock and forces) of a segment without the surface.
/// @param before  has the stock at the start of the segment; without a stock the blank is cut
Process segment_process(const Segment& segment, const Commands& commands, Process before = {},
                        const Progress& progress = {});
/// Returns the same of a segment of a job in windows.
/// @param segment  index in `tool_segments`
Process segment_process(const Job& job, std::size_t segment, const CommandSource& command_source,
                        Process before, const Progress& progress = {});
/// Returns the same of a job.
Process cut_process(const Job& job, const Commands& commands, const Progress& progress = {});

/// Returns the warnings of the scene, then those of the cut.
std::vector<std::string> warnings_of(const Job& job, const Cut& cut);

}  // namespace abbe::sim
