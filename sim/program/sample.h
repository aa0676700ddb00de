#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "kinematics/bad_input.h"
#include "kinematics/chain.h"
#include "sim/program/path.h"

/// Sampling of a path: commanded axis positions at instants.
namespace abbe::sim::program {

/// State at the end of a sampled path, from which the next path continues.
struct SamplingState {
  kinematics::AxisState last;  ///< the last sample
  /// (axes) last position of each axis at which it was detected to move
  kinematics::AxisVector moved;
};

/// Tolerances and limits of sampling.
struct SampleOptions {
  /// mm, largest distance of any point of the tool axis up to `reach` above the tip from the line
  /// and great circle between samples
  double chord_tolerance = 5e-7;
  double reach = 20.0;     ///< mm, height above the tip up to which the tool cuts
  double max_step = 1.0;   ///< mm of tip travel in the workpiece between samples
  double max_turn = 0.02;  ///< rad of tool axis direction between samples
  /// mm or rad of any axis except the workpiece spindle, so that error curves are resolved
  double max_axis_step = 1.0;
  double max_spindle_turn = 6.283185307179586;  ///< rad of the workpiece spindle between samples
  /// rad of a tool spindle between samples, if its rotation is to be resolved
  std::optional<double> max_tool_spindle_turn;
  /// Joint whose rotation is excluded from the chord error (turning).
  std::optional<int> workpiece_spindle;
  /// Directions and stroke counts of the axes at the start, for a path that continues another one.
  kinematics::AxisState before = {};
  /// State to continue from if the first block is already sampled; of that block only the last
  /// sample is repeated.
  std::optional<SamplingState> continued_from = {};
  /// More samples are an input error, which is raised before memory is allocated.
  std::size_t max_samples = 50'000'000;
};

/// Commanded axis positions at instants. A reversal of an axis has two samples, before and after
/// it.
struct Samples {
  /// (n) commanded axis positions with time, direction and stroke of each axis and spindle speed
  std::vector<kinematics::AxisState> states;
  std::vector<int> line;   ///< (n) program line of the block that ends or runs at the sample
  std::vector<int> block;  ///< (n) index of that block in the path
  kinematics::AxisVector moved = {};  ///< (axes) last position at which each was detected to move
};

/// A range of blocks of a path that is sampled at once.
struct SampleWindow {
  std::size_t first = 0, last = 0;                   ///< first block, and one past the last
  std::optional<SamplingState> continued_from = {};  ///< empty for the first window
};

/// Thrown for more samples than the options allow, at the line where the limit is exceeded.
struct TooManySamples : BadInput {
  using BadInput::BadInput;
};

/// Samples the axis positions that the control commands: programmed coordinates, converted under
/// G43.4 to slide positions by the chain of the control. Throws BadInput at the line if the slides
/// cannot reach a tip or there are too many samples.
Samples sample(const Path& path, const kinematics::Chain& control,
               const SampleOptions& options = {});

/// Limit on the samples of a path in windows; more would take days.
inline constexpr double max_samples_in_windows = 1e9;

/// Splits a path into windows, each ending with the block that brings it to
/// `max_samples_per_window` samples. Together the windows have the samples of the whole path, bit
/// for bit, with the last sample of each repeated as the first of the next. Needs the memory of one
/// window and 300 bytes for each window. Throws as `sample` does, and TooManySamples if one window
/// has more than options.max_samples or all together more than `max_samples_in_windows`.
std::vector<SampleWindow> windows(const Path& path, const kinematics::Chain& control,
                                  const SampleOptions& options, std::size_t max_samples_per_window,
                                  const std::function<void(double part)>& progress = {});

/// Returns the blocks of a window as a path. Except for the first window it begins with the
/// preceding block.
Path path_of(const Path& path, const SampleWindow& window);

}  // namespace abbe::sim::program
