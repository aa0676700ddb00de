#pragma once

#include <array>
#include <string>

#include "kinematics/numbers.h"
#include "sim/cut/job.h"

/// How far tool and part reach in the coordinates in which they are held against each other: x y z
/// of the part's frame; of a turned part along the spindle and from it.
namespace abbe::sim {

/// What lies between two values of a coordinate, and the program lines that reach them.
struct Span {
  double low = infinity, high = -infinity;  // mm
  int low_line = 0, high_line = 0;

  void extend(double least, double most, int line);
  double middle() const { return 0.5 * (low + high); }
  double size() const { return high - low; }
};
using Spans = std::array<Span, 3>;  ///< the third is empty of a turned part

/// What a program sweeps on the error-free machine.
struct SweptSpans {
  Spans all, feed;  ///< with the whole cutter; `feed` is `all` where nothing feeds
  Spans tip;        ///< of the tip alone, in feed
};
SweptSpans swept_spans(const Job& job);

/// Of the judged vertices.
Spans part_spans(const Job& job);

/// The coordinate in which a tool keeps farthest from a part, and by how much.
struct Miss {
  double gap = -infinity;  ///< mm, negative where they overlap
  int line = 0;            ///< that comes nearest
  std::string words;       ///< "the lowest cut lies 80.0 mm above the part"
};
Miss miss(const Job& job, const Spans& part, const Spans& tool);

/// Along the spindle, and from it.
std::array<double, 2> round_spindle(const Job& job, const Eigen::Vector3d& p_w);

}  // namespace abbe::sim
