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

/// The tools of a program: the segments that they cut, the comments about them, and their wear.
namespace abbe::sim {

/// Consecutive blocks of a program with one tool of the scene.
struct ToolSegment {
  std::size_t tool = 0;             ///< index among the tools of the scene
  std::size_t first = 0, last = 0;  ///< first block, and one past the last
};

/// The segments of a program by tool, and the warnings about them.
struct ToolUse {
  std::vector<ToolSegment> segments;  ///< all blocks, in their order
  std::vector<std::string> warnings;
};

/// Assigns the blocks of a program to tools. A single tool cuts everything, whatever the program
/// calls. Each of several runs from its call to the next, and the first of the scene before any
/// call.
/// @param tools  of the scene; several must have numbers
/// @throws BadInput on the line of a call of a tool that the scene does not describe, of a second
///     tool if the only one has no number, and of a block under G43.4 with the H of another of
///     several tools
ToolUse tool_use(const program::Path& path, std::span<const ToolDescription> tools);

/// Returns warnings about a segment with the length (H) of another tool.
/// @param number  of the tool of the segment
/// @throws BadInput on the line of a block under G43.4 with such a length
std::vector<std::string> length_warnings(const program::Path& path, const ToolSegment& segment,
                                         int number);

/// Returns warnings about comments of a CAM system with another cutter than that of the scene, such
/// as "line 3 says "T1 D=12. CR=0. - FLAT END MILL": 12 mm in diameter, the scene's T1 has 10 mm".
/// A comment describes the tool with its number or, without a number, the tool that is called next.
/// Tools that do not cut, and turning tools, are not compared.
/// @param tools  of the scene; one without a number is compared with every comment
std::vector<std::string> tool_comment_warnings(const program::Path& path,
                                               std::span<const ToolDescription> tools);

// The length and the radius of the actual cutter decrease in proportion to the time, or to the path
// length of the tip, in feed on the error-free machine, including earlier cuts of the same tool.
// Forces and stock are those of the fresh cutter.

/// Largest difference between the cutter of a segment and the worn cutter, anywhere on its lower
/// half, mm. A sweep is divided into segments, each with the cutter of its middle.
inline constexpr double wear_tolerance = 25e-6;
/// Largest number of segments of a sweep. If more would be needed, they are coarser, with a
/// warning.
inline constexpr int max_wear_segments = 400;

/// The use of a tool in feed.
struct FeedUse {
  double time_s = 0.0;
  double distance = 0.0;  ///< path length of the tip in the workpiece, mm
};

/// The cut of one tool on the error-free machine. Holds references to its arguments.
struct ToolRun {
  const ToolDescription& tool;
  const program::Path& path;
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt;  ///< (samples)
  FeedUse before = {};                        ///< earlier use of the same tool
};

/// Returns (parts) the use of the tool of each part in earlier parts.
std::vector<FeedUse> previous_uses(std::span<const ToolRun> parts);

/// Returns the wear of the tool of a part as a fraction of its `wear`, at commanded samples, linear
/// in time between the samples of the part.
/// @return (samples), empty without wear
std::vector<double> wear_fractions(const ToolRun& part, const program::Samples& samples);

/// Returns the cutter with its radius reduced by `loss`, mm, but by three quarters at most. A ball
/// stays a ball, and a corner radius never exceeds the radius.
cutting::Cutter worn_cutter(const cutting::Cutter& cutter, double loss);

/// A segment of a sweep, with the cutter used for it.
struct WornSegment {
  std::variant<cutting::Cutter, cutting::Nose> tool;
  program::Samples samples;  ///< only times, lines and blocks
  std::vector<kinematics::Pose> T_wt;
};

/// Divides a sweep into consecutive segments. Between samples the tip moves on a line and the axis
/// on a great circle, as in the sweep.
/// @param fractions  (samples) of the stated wear
/// @param T_wt       (samples)
std::deque<WornSegment> worn_segments(const ToolDescription& tool,
                                      const std::vector<double>& fractions,
                                      const program::Samples& samples,
                                      const std::vector<kinematics::Pose>& T_wt);

/// The wear of a tool at the end of a program.
struct WornTool {
  std::string tool;     ///< number such as "T5", or name
  FeedUse use;          ///< of the tool
  double radius = 0.0;  ///< loss of radius, mm
  double length = 0.0;  ///< loss of length, mm
  double within = 0.0;  ///< largest difference of the sweep from the worn radius, mm
};

/// Returns the tools with wear, with their assumed losses.
std::vector<WornTool> worn_tools(std::span<const ToolRun> parts);
/// Returns the warnings about worn tools.
std::vector<std::string> wear_warnings(const std::vector<WornTool>& tools);

}  // namespace abbe::sim
