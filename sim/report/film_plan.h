#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "sim/program/path.h"

/// Which moments of a program a film shows.
namespace abbe::sim {

/// Lines of a program, both ends with them.
struct LineRange {
  int first = 1, last = 1;
};

/// A part of a program in time, s.
struct FilmStretch {
  double begin_s = 0.0, end_s = 0.0;
};

/// From the beginning of the first block on these lines of the program itself, not of its
/// subprograms, to the end of the last one; without lines all of it. None where there is no block.
std::optional<FilmStretch> stretch_of_lines(const program::Path& path,
                                            const std::optional<LineRange>& lines);

struct FilmPlan {
  FilmStretch stretch;
  std::vector<double> time_s;  ///< (frames) of the program, rising evenly; the last is the end
  double fps = 25.0;
};

/// round(seconds * fps) frames, at least one, spread evenly from the beginning to the end.
FilmPlan film_plan(const FilmStretch& stretch, double seconds, double fps);

/// How many times faster than the machine the film runs; 0 for a stretch that takes no time.
double speed_up(const FilmPlan& plan);

/// "12.3 × faster than real time"
std::string speed_text(const FilmPlan& plan);

}  // namespace abbe::sim
