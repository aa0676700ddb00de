// What a page of results costs: the dome's six cases by the vertices of the part, bytes and seconds
// a vertex and case, and the share of its still pictures.
//   report_bench [vertices ...]

#include <chrono>
#include <cstdio>
#include <string>
#include <vector>

#include "sim/commands/scene_runs.h"
#include "sim/report/case_page.h"
#include "sim/report/picture_files.h"

namespace abbe::sim {
namespace {

using Clock = std::chrono::steady_clock;

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

CaseResults dome(const std::string& vertices) {
  RunOptions options;
  options.overrides = {{"part.vertices", vertices}};
  options.progress = [](const std::string&, double) {};
  return cut_scene_cases(ABBE_SOURCE_DIR "/scenes/gantry_dome.toml", options);
}

void print_cost(const std::string& vertices) {
  const CaseResults made = dome(vertices);
  Clock::time_point start = Clock::now();
  const HtmlReport page = html_report(made.cases, made.comparison, {});
  const double all_s = since(start);
  start = Clock::now();
  std::size_t picture_bytes = 0;
  for (const ComparedCase& one : made.cases)
    picture_bytes += map_png(*one.job, one.verdict, 900).size();
  const double pictures_s = since(start);
  const auto count = double(made.cases.front().job->design_w.vertices.rows());
  const auto cases = double(made.cases.size());
  std::printf(
      "%.0f vertices, %.0f cases: %.2f MB in %.2f s, %.2f bytes and %.0f ns a vertex and case; its "
      "still pictures alone: %.2f MB in %.2f s\n",
      count, cases, 1e-6 * double(page.html.size()), all_s,
      double(page.html.size()) / (count * cases), 1e9 * all_s / (count * cases),
      1e-6 * double(picture_bytes) * 4 / 3, pictures_s);
}

}  // namespace
}  // namespace abbe::sim

int main(int argc, char** argv) {
  std::vector<std::string> sizes(argv + 1, argv + argc);
  if (sizes.empty()) sizes = {"30000", "120000", "480000"};
  for (const std::string& vertices : sizes) abbe::sim::print_cost(vertices);
}
