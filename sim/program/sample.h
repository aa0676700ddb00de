#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "kinematics/bad_input.h"
#include "kinematics/chain.h"
#include "sim/program/path.h"

namespace abbe::sim::program {

/// How far the samples of a path go, for those of what follows it.
struct SamplingState {
  kinematics::AxisState last;    ///< the last sample
  kinematics::AxisVector moved;  ///< (n) where each axis was last seen to move
};

struct SampleOptions {
  double chord_tolerance = 5e-7;  ///< mm: any point of the tool axis up to `reach` above the tip
                                  ///< lies this near to the line and great circle between samples
  double reach = 20.0;            ///< mm, how far above the tip the tool cuts
  double max_step = 1.0;          ///< mm of tip travel in the workpiece between samples
  double max_turn = 0.02;         ///< rad of tool axis between samples
  double max_axis_step = 1.0;  ///< mm or rad of any axis but the workpiece spindle, so that curves
                               ///< of errors are seen
  double max_spindle_turn = 6.283185307179586;  ///< rad of the workpiece spindle between samples
  std::optional<double> max_nose_turn;   ///< rad of a tool spindle between samples, if its turning
                                         ///< shall be seen
  std::optional<int> workpiece_spindle;  ///< joint whose turning is left out of the chord (turning)
  kinematics::AxisState before = {};  ///< of a path that goes on from another: the ways and strokes
                                      ///< of the axes so far
  std::optional<SamplingState> goes_on = {};  ///< of a path whose first block is sampled: that
                                              ///< block gives the last sample again and no other
  std::size_t max_samples = 50'000'000;  ///< more is refused before memory is taken
};

/// Commanded axes at instants. A reversal of an axis is sampled twice, before and after.
struct Samples {
  std::vector<kinematics::AxisState> states;  ///< (n) commanded positions of the axes, with time,
                                              ///< direction and stroke of every axis and speed of
                                              ///< the spindle
  std::vector<int> line;              ///< (n) program line of the block that ends or runs here
  std::vector<int> block;             ///< (n) its index in the path
  kinematics::AxisVector moved = {};  ///< (axes) where each was last seen to move
};

/// Blocks of a path that are sampled at once.
struct Window {
  std::size_t first = 0, last = 0;            ///< blocks, the last left out
  std::optional<SamplingState> goes_on = {};  ///< none of the first
};

/// More samples than the options allow: still a refusal of the line where the last of them ends.
struct TooManySamples : BadInput {
  using BadInput::BadInput;
};

/// What the control commands the axes: programmed coordinates, under G43.4 turned into slide
/// positions by the control's own chain.
/// @throws BadInput naming the line if the slides cannot reach a tip or the samples are too many
Samples sample(const Path& path, const kinematics::Chain& control,
               const SampleOptions& options = {});

/// Samples of a path in windows at most: more would take days.
inline constexpr double max_in_windows = 1e9;

/// A path in windows, each of which ends with the block that takes it to `most` samples; together
/// they have the samples of the whole, to the bit, the last of each once more as the first of the
/// next. In memory for one window and 300 bytes for each.
/// @throws as `sample`; TooManySamples where a single window has more than options.max_samples, or
///         all of them more than `max_in_windows`
std::vector<Window> windows(const Path& path, const kinematics::Chain& control,
                            const SampleOptions& options, std::size_t most,
                            const std::function<void(double part)>& progress = {});

/// The blocks of a window as a program of their own that goes on, of any but the first window with
/// the block before.
Path path_of(const Path& path, const Window& window);

}  // namespace abbe::sim::program
