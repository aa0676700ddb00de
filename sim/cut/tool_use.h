#pragma once

#include <deque>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "kinematics/chain.h"
#include "sim/program/path.h"
#include "sim/program/sample.h"
#include "sim/scene/tool.h"

/// The tools of a program: which segments they cut, their comments, and their wear.
namespace abbe::sim {

/// Returns the tool calls that are followed by a block of feed before the next call. T alone is a
/// call if the program has no M6.
std::vector<program::ToolCall> cutting_calls(const program::Path& path);

/// Consecutive blocks of a program that one tool of the scene runs.
struct ToolSegment {
  std::size_t tool = 0;             ///< index among the tools of the scene
  std::size_t first = 0, last = 0;  ///< first block, and one past the last
};

/// The segments of a program by tool, and the warnings about them.
struct ToolUse {
  std::vector<ToolSegment> stretches;  ///< all blocks, in their order
  std::vector<std::string> warnings;
};

/// Assigns the blocks of a program to tools. A single tool cuts everything, whatever T and M6 say;
/// of several, each runs from its call to the next, and the first of the scene before any call.
/// @param tools  of the scene; several must have numbers
/// @throws BadInput on the line of a call of a tool that the scene does not describe, of a second
///     tool if the only one has no number, and of a block under G43.4 with the H of another of
///     several tools
ToolUse tool_use(const program::Path& path, std::span<const ToolDescription> tools);

/// Returns warnings about the lengths (H) of other tools than the one that runs a segment.
/// @param number  of that tool
/// @throws BadInput on the line of a block under G43.4 with such a length
std::vector<std::string> length_warnings(const program::Path& path, const ToolSegment& stretch,
                                         int number);

/// Returns warnings about comments of a CAM system whose cutter differs from the scene's: "line 3
/// says "T1 D=12. CR=0. - FLAT END MILL": 12 mm in diameter, the scene's T1 has 10 mm". A comment
/// describes the tool whose number it gives, otherwise the tool that is called next. Tools that do
/// not cut, and turning tools, are not compared.
/// @param tools  of the scene; one without a number stands for every tool
std::vector<std::string> tool_comment_warnings(const program::Path& path,
                                               std::span<const ToolDescription> tools);

// Wear of the actual cutter. Its length and radius decrease in proportion to the time, or to the
// path length of the tip, in feed on the error-free machine. Earlier cuts of the same tool count;
// forces and stock are those of the fresh cutter.

/// Largest difference between the cutter of a segment and the worn one, anywhere on its lower half,
/// mm. A sweep is divided into segments, each with the cutter of its middle.
inline constexpr double wear_tolerance = 25e-6;
/// Number of segments of one sweep beyond which they become coarser, with a warning.
inline constexpr int max_wear_pieces = 400;

/// Use of a tool in feed: time, and path length of its tip in the workpiece.
struct FeedUse {
  double time_s = 0.0;
  double way = 0.0;  ///< mm
};

/// The cut of one tool, as the error-free machine runs it. Holds references to its arguments.
struct ToolRun {
  const ToolDescription& tool;
  const program::Path& path;
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt;  ///< (samples)
  FeedUse before = {};                        ///< earlier use of the same tool
};

/// Returns (samples) the use up to each sample of a part, with the use before it.
std::vector<FeedUse> feed_use(const ToolRun& part);
/// Returns (parts) the use of the tool of each part in the parts before it.
std::vector<FeedUse> previous_uses(std::span<const ToolRun> parts);

/// Returns the wear of the tool of a part as a fraction of its `wear`, at commanded samples, linear
/// in time between the samples of the part.
/// @return (samples), empty without wear
std::vector<double> wear_fractions(const ToolRun& part, const program::Samples& samples);

/// Returns the cutter with its radius reduced by `lost`, mm; a ball stays a ball, and a corner
/// radius never exceeds the radius.
cutting::Cutter worn(const cutting::Cutter& cutter, double lost);

/// A segment of a sweep, with the cutter used for it.
struct WornSegment {
  std::variant<cutting::Cutter, cutting::Nose> tool;
  program::Samples samples;  ///< only times, lines and blocks
  std::vector<kinematics::Pose> T_wt;
};

/// Returns the largest difference between each segment and the worn cutter, mm.
/// @param lost  loss of radius over the whole sweep, mm
double wear_step(double lost);

/// Returns a sweep in consecutive segments; between samples the tip moves on a line and the axis on
/// a great circle, as in the sweep.
/// @param shares, T_wt  (samples)
std::deque<WornSegment> worn_segments(const ToolDescription& tool,
                                      const std::vector<double>& shares,
                                      const program::Samples& samples,
                                      const std::vector<kinematics::Pose>& T_wt);

/// The loss of a tool at the end of a program.
struct WornTool {
  std::string tool;     ///< "T5", or its name
  FeedUse use;          ///< of the tool
  double radius = 0.0;  ///< mm
  double length = 0.0;  ///< mm
  double within = 0.0;  ///< mm, by which the sweep may differ from the worn radius
};

/// Returns the tools of the parts that wear, with their assumed losses.
std::vector<WornTool> worn_tools(std::span<const ToolRun> parts);
/// Returns the warnings about worn tools.
std::vector<std::string> wear_warnings(const std::vector<WornTool>& tools);

}  // namespace abbe::sim
