#pragma once

#include <deque>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "kinematics/chain.h"
#include "sim/program/path.h"
#include "sim/program/sample.h"
#include "sim/scene/tool_description.h"

/// The true cutter as it wears: its length and radius fall in proportion to the time or the way of
/// the tip at feed, as the error-free machine runs the program. What was cut before by the same
/// tool counts; forces and the stock are those of the fresh cutter.
namespace abbe::sim {

/// By how much a cutter may differ from the worn one anywhere on its lower half, mm: the sweep is
/// cut into pieces, and each takes the cutter of its middle.
inline constexpr double wear_within = 25e-6;
/// Beyond so many pieces of one sweep they become coarser, which is warned of.
inline constexpr int most_wear_pieces = 400;

/// What a tool has done: time and way of its tip in the workpiece, at feed.
struct FeedUse {
  double time_s = 0.0;
  double way = 0.0;  ///< mm
};

/// What one tool cuts, as the error-free machine runs it. It refers to what it was made of.
struct CutPart {
  const ToolDescription& tool;
  const program::Path& path;
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt;  ///< (samples)
  FeedUse before = {};                        ///< of the same tool
};

/// Time and way at feed up to each sample of a part, what was before it included. (samples)
std::vector<FeedUse> feed_use(const CutPart& part);
/// What the tool of each part has done in those before it. (parts)
std::vector<FeedUse> uses_before(std::span<const CutPart> parts);

/// What the tool of a part has lost, as a share of its `wear`: at the samples that are commanded,
/// linear in time between those of the part. (samples) empty without wear
std::vector<double> wear_shares(const CutPart& part, const program::Samples& samples);

/// The cutter when its radius is smaller by `lost`: a ball stays a ball, and a corner fits.
cutting::Cutter worn(const cutting::Cutter& cutter, double lost);

/// A piece of a sweep that one cutter stands for.
struct WornPiece {
  std::variant<cutting::Cutter, cutting::Nose> tool;
  program::Samples samples;  ///< times, lines and blocks alone
  std::vector<kinematics::Pose> T_wt;
};

/// How far each piece is from the worn cutter, mm. @param lost  of the radius in the whole sweep,
/// mm
double wear_step(double lost);

/// A sweep in pieces, one after the other; between samples the tool goes on line and great circle,
/// as the sweep does. @param shares, T_wt  (samples)
std::deque<WornPiece> worn_pieces(const ToolDescription& tool, const std::vector<double>& shares,
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
std::vector<WornTool> worn_tools(std::span<const CutPart> parts);
/// What is to be said of them.
std::vector<std::string> wear_warnings(const std::vector<WornTool>& tools);

}  // namespace abbe::sim
