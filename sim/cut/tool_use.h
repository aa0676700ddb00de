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

namespace abbe::sim {

/// The calls of tools with which a program cuts: those that a block of feed follows before the
/// next; T alone is a call where no M6 is in the program.
std::vector<program::ToolCall> cutting_calls(const program::Path& path);

/// Blocks of a program that one tool of the scene runs, one after the other.
struct ToolSegment {
  std::size_t tool = 0;             ///< of the scene's, in their order
  std::size_t first = 0, last = 0;  ///< first block, and one past the last
};

/// Which tool runs what, and what is to be said of it.
struct ToolUse {
  std::vector<ToolSegment> stretches;  ///< all blocks, in their order
  std::vector<std::string> warnings;
};

/// A scene with one tool cuts with it whatever T and M6 say; of several each runs from its call to
/// the next, the first of them before any.
/// @param tools  of the scene; several have numbers
/// @throws BadInput on the line of a call of a tool that the scene does not describe, of a second
///         tool where its only one has no number, and of a block under G43.4 with the H of another
///         tool of several than runs it
ToolUse tool_use(const program::Path& path, std::span<const ToolDescription> tools);

/// Lengths (H) of other tools than the one that runs a stretch, as warnings.
/// @param number  of that tool
/// @throws BadInput on the line of a block under G43.4 with such a length
std::vector<std::string> length_warnings(const program::Path& path, const ToolSegment& stretch,
                                         int number);

/// Comments of a CAM system whose cutter is not the scene's: "line 3 says "T1 D=12. CR=0. - FLAT
/// END MILL": 12 mm in diameter, the scene's T1 has 10 mm". A comment is of the tool whose number
/// it gives, else of the one that is called next. Tools that do not cut, and turning tools, are not
/// compared. @param tools  of the scene; one without a number is every tool
std::vector<std::string> tool_comment_warnings(const program::Path& path,
                                               std::span<const ToolDescription> tools);

// The true cutter as it wears: its length and radius fall in proportion to the time or the way of
// the tip at feed, as the error-free machine runs the program. What was cut before by the same
// tool counts; forces and the stock are those of the fresh cutter.

/// By how much a cutter may differ from the worn one anywhere on its lower half, mm: the sweep is
/// cut into pieces, and each takes the cutter of its middle.
inline constexpr double wear_tolerance = 25e-6;
/// Beyond so many pieces of one sweep they become coarser, which is warned of.
inline constexpr int max_wear_pieces = 400;

/// What a tool has done: time and way of its tip in the workpiece, at feed.
struct FeedUse {
  double time_s = 0.0;
  double way = 0.0;  ///< mm
};

/// What one tool cuts, as the error-free machine runs it. It refers to what it was made of.
struct ToolRun {
  const ToolDescription& tool;
  const program::Path& path;
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt;  ///< (samples)
  FeedUse before = {};                        ///< of the same tool
};

/// Time and way at feed up to each sample of a part, what was before it included. (samples)
std::vector<FeedUse> feed_use(const ToolRun& part);
/// What the tool of each part has done in those before it. (parts)
std::vector<FeedUse> previous_uses(std::span<const ToolRun> parts);

/// What the tool of a part has lost, as a share of its `wear`: at the samples that are commanded,
/// linear in time between those of the part. (samples) empty without wear
std::vector<double> wear_fractions(const ToolRun& part, const program::Samples& samples);

/// The cutter when its radius is smaller by `lost`: a ball stays a ball, and a corner fits.
cutting::Cutter worn(const cutting::Cutter& cutter, double lost);

/// A piece of a sweep that one cutter stands for.
struct WornSegment {
  std::variant<cutting::Cutter, cutting::Nose> tool;
  program::Samples samples;  ///< times, lines and blocks alone
  std::vector<kinematics::Pose> T_wt;
};

/// How far each piece is from the worn cutter, mm. @param lost  of the radius in the whole sweep,
/// mm
double wear_step(double lost);

/// A sweep in pieces, one after the other; between samples the tool goes on line and great circle,
/// as the sweep does. @param shares, T_wt  (samples)
std::deque<WornSegment> worn_segments(const ToolDescription& tool,
                                      const std::vector<double>& shares,
                                      const program::Samples& samples,
                                      const std::vector<kinematics::Pose>& T_wt);

/// What a tool has lost at the end of a program.
struct WornTool {
  std::string tool;     ///< "T5", or its name
  FeedUse use;          ///< of it
  double radius = 0.0;  ///< mm
  double length = 0.0;  ///< mm
  double within = 0.0;  ///< mm, by which the sweep follows the radius
};

/// The tools of these parts that wear, as they are assumed to.
std::vector<WornTool> worn_tools(std::span<const ToolRun> parts);
/// What is to be said of them.
std::vector<std::string> wear_warnings(const std::vector<WornTool>& tools);

}  // namespace abbe::sim
