#include "sim/cut/meant.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "cutting/leftover.h"

namespace abbe::sim {
namespace {

using cutting::Surface;
using cutting::VertexStatus;

/// mm, of the smallest round corner that the job cuts with: what it does not fit, none does. A
/// turning tool meets the part along its edge alone, so none counts.
double smallest_corner(const Job& job) {
  double least = std::numeric_limits<double>::infinity();
  for (const Job& part : job.windows ? std::span(&job, 1) : parts_of(job)) {
    const auto* cutter = std::get_if<cutting::Cutter>(&part.scene.tool.nominal);
    least = std::min(least, cutter != nullptr ? cutter->corner_radius : 0.0);
  }
  return least;
}

std::vector<WhyUnmeant> reasons(const Job& job, const Surface& nominal) {
  const double radius = smallest_corner(job);
  const auto corner = cutting::out_of_corner(job.design_w, nominal, *job.body_w, radius);
  const auto run_out = cutting::run_out_beside(job.design_w, nominal, radius, corner);
  std::vector<WhyUnmeant> why(nominal.status.size(), WhyUnmeant::Meant);
  for (std::size_t i = 0; i < why.size(); ++i) {
    if (nominal.status[i] == VertexStatus::Uncut) why[i] = WhyUnmeant::Unreached;
    if (corner[i]) why[i] = WhyUnmeant::Corner;
    if (run_out[i]) why[i] = WhyUnmeant::RunOut;
  }
  return why;
}

/// Not judged any more. @return mm, the material that was left there
double leave_out(Job& job, Surface& nominal, std::size_t i) {
  const auto v = Eigen::Index(i);
  const double left = nominal.status[i] == VertexStatus::Cut ? nominal.residual[v] : 0.0;
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  job.design_w.judged[i] = 0;
  nominal.status[i] = VertexStatus::Outside;
  nominal.residual[v] = nominal.cut_time_s[v] = none;
  nominal.cut_line[i] = 0;
  return left;
}

}  // namespace

std::vector<WhyUnmeant> leave_out_unmeant(Job& job, Surface& nominal,
                                          std::vector<WhyUnmeant> before) {
  const std::size_t n = nominal.status.size();
  before.resize(n, WhyUnmeant::Meant);
  if (job.scene.part.judged != PartDescription::Judged::Cut) return before;
  const std::vector<WhyUnmeant> why = reasons(job, nominal);
  const auto is_left = [&](std::size_t i) {
    return why[i] == WhyUnmeant::Meant && nominal.status[i] != VertexStatus::Outside;
  };
  bool any = false;
  for (std::size_t i = 0; i < n && !any; ++i) any = is_left(i);
  if (!any) return before;
  Unmeant& unmeant = job.sampled->unmeant;
  unmeant.radius = smallest_corner(job);
  for (std::size_t i = 0; i < n; ++i) {
    if (why[i] == WhyUnmeant::Meant) continue;
    before[i] = why[i];
    unmeant.most_left = std::max(unmeant.most_left, leave_out(job, nominal, i));
  }
  return before;
}

MeantAreas meant_areas(const Job& job, const Surface& nominal, const std::vector<WhyUnmeant>& why) {
  MeantAreas areas{0.0, job.sampled->unmeant};
  areas.unmeant.unreached = areas.unmeant.corner = areas.unmeant.run_out = 0.0;
  for (std::size_t i = 0; i < why.size(); ++i) {
    const double area = job.design_w.area[Eigen::Index(i)];
    switch (why[i]) {
      case WhyUnmeant::Meant:
        if (nominal.status[i] != VertexStatus::Outside) areas.judged += area;
        break;
      case WhyUnmeant::Unreached:
        areas.unmeant.unreached += area;
        break;
      case WhyUnmeant::Corner:
        areas.unmeant.corner += area;
        break;
      case WhyUnmeant::RunOut:
        areas.unmeant.run_out += area;
        break;
    }
  }
  return areas;
}

std::string unmeant_text(const SampledSurface& sampled) {
  const Unmeant& unmeant = sampled.unmeant;
  const double all = sampled.judged_area + unmeant.area();
  std::string text =
      fmt::format("the program means to cut {:.4g} % of the part's {:.4g} mm^2; not judged are",
                  100.0 * sampled.judged_area / all, all);
  const char* joint = " ";
  const auto add = [&](double area, const std::string& words) {
    if (area > 0.0)
      text += fmt::format("{}{:.4g} mm^2 {}", std::exchange(joint, ", "), area, words);
  };
  add(unmeant.unreached, "that it does not come to");
  add(unmeant.corner,
      fmt::format("into which the tool's corner of {:.4g} mm does not fit", unmeant.radius));
  add(unmeant.run_out, "beside those, where its sweep runs out");
  if (unmeant.most_left > 0.0)
    text += fmt::format(", up to {:.3g} mm above the design", unmeant.most_left);
  return text + " (part.judged = \"all\" judges all)";
}

}  // namespace abbe::sim
