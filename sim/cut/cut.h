#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cutting/map/interpolation.h"
#include "sim/cut/collision_events.h"
#include "sim/cut/job.h"
#include "sim/cut/signals.h"
#include "sim/cut/tool_poses.h"

namespace abbe::sim {

/// Largest and root mean square over the samples of a program.
struct Spread {
  double rms = 0.0;
  double max = 0.0;
};

/// One case cut.
struct Cut {
  std::string name;       ///< as it is reported: of a variant, with its name in front
  std::string case_name;  ///< what `run --case` takes
  cutting::Surface surface;
  std::optional<cutting::InterpolationError> interpolation;  ///< of a job that was `sampled`
  Spread tip_error;               ///< mm, tip where it is against where it should be
  Spread direction_error;         ///< rad
  ChordError chord_error;         ///< nothing looked at without errors
  double point_left = 0.0;        ///< mm, most that the compensator knew it could not restore
  double direction_left = 0.0;    ///< rad, the same of the direction
  Process process;                ///< the cut as it went; empty without [cutting]
  Signals signals;                ///< empty without heat, force or channels
  std::vector<WornTool> wear;     ///< of the tools that wear, at the end
  std::string rewritten_program;  ///< text of the program channel, else empty
  std::optional<Collisions> collisions;  ///< where the scene asks for them
  std::optional<ToolTrack> track;        ///< where it was to be kept
  std::vector<std::string> warnings;
  std::map<std::string, double> timing_s;
};

/// What of a cut is kept beside its map: about 180 bytes a sample for the track of the tool.
enum class Retention { Map, Track };

/// The same program on the machine without any error, and with a perfect tool, setup and control.
Cut cut_error_free(const Job& job, const Progress& progress = {}, Retention keep = Retention::Map);

/// The program on the wrong machine without a compensator.
/// @throws BadInput if a commanded axis leaves its travel (program line, axis, value) or a table of
///         the errors
Cut cut(const Job& job, const Progress& progress = {}, Retention keep = Retention::Map);

/// Commands, compensated or not, on the wrong machine.
/// @throws BadInput as without; CollisionStop where the scene asks for collisions, to stop there
Cut cut(const Job& job, const Commands& commands, const Progress& progress = {},
        Retention keep = Retention::Map);

/// What a window of a job is commanded.
using CommandSource = std::function<Commands(const Job& window)>;

/// A job in windows on the wrong machine, each made, commanded and swept as often as the surface
/// asks for it; what is reported of it comes from the first time. Memory is that of one window.
/// @param commands_of  does not depend on what is before or behind a sample
/// @throws as `cut`
Cut cut_in_windows(const Job& job, const CommandSource& command_source,
                   const Progress& progress = {});

/// Refuses the line of the program on which an axis first leaves its travel.
/// @throws BadInput
void check_travel(const Job& job, const Commands& commands);

/// The cut alone, without the surface.
Process cut_process(const Job& job, const Commands& commands, const Progress& progress = {});

/// Warnings of the scene itself and of the cut, in that order.
std::vector<std::string> warnings_of(const Job& job, const Cut& cut);

}  // namespace abbe::sim
