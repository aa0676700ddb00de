#include "sim/report/film_plan.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace abbe::sim {

std::optional<FilmStretch> stretch_of_lines(const program::Path& path,
                                            const std::optional<LineRange>& lines) {
  std::optional<FilmStretch> stretch;
  for (const program::Block& block : path.blocks) {
    if (lines && (block.file != 0 || block.line < lines->first || block.line > lines->last))
      continue;
    if (!stretch) stretch = FilmStretch{block.start_s, block.end_s};
    stretch->end_s = std::max(stretch->end_s, block.end_s);
  }
  return stretch;
}

FilmPlan film_plan(const FilmStretch& stretch, double seconds, double fps) {
  FilmPlan plan{stretch, {}, fps};
  const auto n = std::max(1L, std::lround(seconds * fps));
  for (long k = 0; k < n; ++k) {
    const double u = n > 1 ? double(k) / double(n - 1) : 1.0;
    plan.time_s.push_back(k + 1 == n ? stretch.end_s
                                     : stretch.begin_s + u * (stretch.end_s - stretch.begin_s));
  }
  return plan;
}

double speed_up(const FilmPlan& plan) {
  return (plan.stretch.end_s - plan.stretch.begin_s) * plan.fps / double(plan.time_s.size());
}

std::string speed_text(const FilmPlan& plan) {
  const double times = speed_up(plan);
  const auto number = [](double x) { return fmt::format("{:.{}f}", x, x < 10.0 ? 1 : 0); };
  if (!(times > 0.0)) return "a moment of the program";
  if (times >= 1.05) return number(times) + " × faster than real time";
  if (times <= 1.0 / 1.05) return number(1.0 / times) + " × slower than real time";
  return "in real time";
}

}  // namespace abbe::sim
