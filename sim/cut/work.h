#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "sim/cut/memory_limit.h"
#include "sim/cut/part.h"
#include "sim/scene/scene.h"

/// How much a scene asks of the computer, said and refused before it is done.
namespace abbe::sim {

/// A refusal of what keys of the scene ask together: the less each is, the more. It stands at the
/// place of the least of those that the user typed, else of those that are written, else of the
/// section.
/// @param keys  dotted paths, such as "program.step_mm"
BadInput refusal_at(const Scene& scene, const std::vector<std::string>& keys,
                    const std::string& expected, const std::string& seen);

/// "; with [thermal] it cannot be run in windows", for such a refusal.
/// @param needs_whole  what of the case does; empty for nothing, of which nothing is said
std::string why_no_windows(const std::string& needs_whole);

/// Most samples that a program may have: 50 million, and no more than the memory holds.
std::size_t most_samples();

/// What is generated and judged, estimated.
struct Work {
  double passes = 0.0;
  double points = 0.0;   ///< of the passes; 0 for a program from a file
  double samples = 0.0;  ///< of the passes, at least
  double vertices = 0.0;
  Eigen::Vector2d range = Eigen::Vector2d::Zero();  ///< mm of the part that is covered
  double bytes = 0.0;                               ///< for all of them, at least
  std::vector<std::string> by;                      ///< keys that set passes, points and samples
};
Work work_of(const Scene& scene, const Part& part);

/// The same of a program that is run in windows, whose samples are not held.
Work without_samples(Work work);

/// @throws BadInput naming the keys and the figures if the points are more than 5 million, or the
///         memory does not hold all
void check_work(const Scene& scene, const Work& work);

/// One line for a person, empty where it takes a moment only.
std::string remark(const Work& work);

}  // namespace abbe::sim
