#include "sim/cut/reach.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "sim/cut/datum_touches.h"
#include "sim/cut/program_warnings.h"
#include "sim/cut/unit_doubt.h"
#include "sim/cut/way_out.h"

namespace abbe::sim {
namespace {

using cutting::VertexStatus;

/// "; with G54 Z = -80 it touches", unless a unit explains it better.
std::string next_step(const Job& job) {
  if (const std::string doubt = unit_doubt(job, {}); !doubt.empty()) return "; " + doubt;
  const auto out = way_out(job);
  return out ? "; " + out->words : "";
}

/// "; the mesh of the part, read in mm, is 0.04 x 0.04 x 0.02 mm"
std::string doubt_of_size(const Job& job) {
  const auto* mesh = std::get_if<MeshFile>(&job.scene.part.shape);
  if (mesh == nullptr) return {};
  const std::string odd = odd_size(*mesh, use_of_part(job.scene), extents(job.body_m->vertices));
  return odd.empty() ? odd : "; " + odd;
}

BadInput refusal(const Job& job, int line, const std::string& words) {
  return {job.path.file, line, 0,
          fmt::format("a program that comes within {} mm of the part", job.scene.band),
          words + next_step(job) + doubt_of_size(job)};
}

/// The fault of a program whose tool keeps clear of the box around the part.
std::optional<BadInput> missed_box(const Job& job) {
  const SweptSpans swept = swept_spans(job);
  const Spans part = part_spans(job);
  if (!(miss(job, part, swept.all).gap > job.scene.band)) return std::nullopt;
  const Miss by = miss(job, part, swept.feed);
  return refusal(job, by.line, by.words);
}

/// Where the nearest cut is along the normals of the part, further away than the band.
struct Nearest {
  double s = infinity;  // mm
  int line = 0;
  int tried = 0;
};

Nearest nearest_cut(const Job& job, double within) {
  const Sweep sweep = error_free_sweep(job, {.band = within, .progress = {}});
  const cutting::Surface surface = sweep.surface(thinned(job.design_w));
  Nearest nearest;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    nearest.tried += surface.status[i] != VertexStatus::Outside;
    const double s = surface.residual[Eigen::Index(i)];
    if (surface.status[i] != VertexStatus::Cut || std::abs(s) >= std::abs(nearest.s)) continue;
    nearest.s = s;
    nearest.line = surface.cut_line[i];
  }
  return nearest;
}

std::string words_of(const Nearest& nearest, double within) {
  if (!std::isfinite(nearest.s))
    return fmt::format("nor within {} mm, where {} of its vertices were tried", within,
                       nearest.tried);
  return fmt::format("the nearest cut lies {:.1f} mm {} it", std::abs(nearest.s),
                     nearest.s > 0.0 ? "above" : "below");
}

/// The fault of a part that is judged at places only between which the program may cut.
std::optional<BadInput> judged_too_sparsely(const Job& job, const Nearest& nearest) {
  const JudgedPlaces places = judged_places(job.design_w);
  if (std::isfinite(nearest.s) || !is_sparse(places, job.scene.tool)) return std::nullopt;
  const auto* mesh = std::get_if<MeshFile>(&job.scene.part.shape);
  const auto* cutter = std::get_if<cutting::Cutter>(&job.scene.tool.nominal);
  std::string expected = fmt::format("{} judged vertices or more", least_judged);
  if (cutter != nullptr)
    expected +=
        fmt::format(", no farther apart than the cutter is wide, {:.4g} mm", 2.0 * cutter->radius);
  std::string seen = fmt::format(
      "{} judged {}, up to {:.4g} mm apart, none of which the program cuts: whether it cuts "
      "between them is not known",
      places.vertices, places.vertices == 1 ? "vertex" : "vertices", places.apart);
  if (mesh != nullptr && job.scene.part.sampling.kind == PartSampling::Kind::Vertices)
    seen += "; part.sampling = \"adaptive\" adds vertices to those of the mesh";
  return BadInput(mesh != nullptr ? mesh->file.string() : job.scene.file.string(), 0, 0, expected,
                  seen);
}

std::string span_words(const char* name, const Span& tip, const Span& part) {
  // what a placement leaves of a zero is none
  const auto shown = [](double mm) { return std::abs(mm) < 1e-9 ? 0.0 : mm; };
  return fmt::format("{} {:.4g} to {:.4g} mm of {:.4g} to {:.4g}", name, shown(tip.low),
                     shown(tip.high), shown(part.low), shown(part.high));
}

/// What is said of a part that the program cuts in places only.
std::string partly(const Job& job, const WithinReach& reach) {
  if (std::string doubt = unit_doubt(job, reach); !doubt.empty()) return doubt;
  const Spans tip = swept_spans(job).tip, part = part_spans(job);
  const bool milled = !job.machine.workpiece_spindle;
  const auto out = way_out(job);
  std::string where = span_words(milled ? "x" : "along the spindle", tip[0], part[0]);
  where += ", " + span_words(milled ? "y" : "radius", tip[1], part[1]);
  if (milled) where += ", " + span_words("z", tip[2], part[2]);
  return fmt::format(
      "the program comes within {} mm of {:.3g} % of the judged area ({} vertices tried): its feed "
      "takes the tip over {}, in the part's frame{}",
      job.scene.band, 100.0 * reach.share, reach.tried, where, out ? "; " + out->words : "");
}

/// What is said of a part of which the program leaves next to nothing; none else.
std::optional<std::string> too_deep(const Job& job, const WithinReach& reach) {
  constexpr double most_gouged = 0.5;  // of what the program comes to
  const double gouged = reach.share - reach.cut;
  if (!(gouged > most_gouged * reach.share)) return std::nullopt;
  return fmt::format(
      "the program takes away {:.3g} % of the judged area, more than {} mm below the design, and "
      "cuts {:.3g} % within it ({} vertices tried){}",
      100.0 * gouged, job.scene.band, 100.0 * reach.cut, reach.tried, next_step(job));
}

/// Returns what is said of a part that is much smaller than what the program feeds over: a program
/// of another part may cut all of a small one.
std::vector<std::string> much_smaller_part(const Job& job) {
  constexpr double most_times = 4.0;  // run-outs and the passes beside a narrow part stay below
  if (!std::holds_alternative<ProgramDescription::File>(job.scene.program.source)) return {};
  const auto largest = [](const Spans& spans) {
    double size = 0.0;
    for (const Span& span : spans)
      if (std::isfinite(span.size())) size = std::max(size, span.size());
    return size;
  };
  const double feed = largest(swept_spans(job).tip);
  const double part = extents(job.design_w.vertices).maxCoeff();  // judged or not
  if (!(feed > most_times * part)) return {};
  return {fmt::format(
      "the program feeds over {:.4g} mm, {:.3g} times the part of {:.4g} mm: it looks like "
      "the program of another part, or part.unit or a size of [part] like another unit",
      feed, feed / part, part)};
}

}  // namespace

Placement placement(const Job& job) {
  if (job.path.motion_blocks == 0)
    return {BadInput(job.path.file, 0, 0, "a program that cuts the part", "one that moves nothing"),
            {}};
  if (auto fault = missed_box(job)) return {std::move(fault), {}};
  if (auto fault = touch_error(job)) return {std::move(fault), {}};
  const WithinReach reach = within_reach(thinned(job.design_w), job);
  if (auto text = too_deep(job, reach)) return {std::nullopt, {std::move(*text)}};
  if (reach.share >= least_within_reach) return {std::nullopt, much_smaller_part(job)};
  if (reach.share > 0.0 || within_reach(job.design_w, job).share > 0.0)
    return {std::nullopt, {partly(job, reach)}};
  const double within = cutting::gouge_bands * job.scene.band;
  const Nearest nearest = nearest_cut(job, within);
  if (auto fault = judged_too_sparsely(job, nearest)) return {std::move(fault), {}};
  return {refusal(job, nearest.line, "nothing cut; " + words_of(nearest, within)), {}};
}

Job placed(Job job) {
  Placement found = placement(job);
  if (found.fault) throw *found.fault;
  job.warnings.insert(job.warnings.end(), found.warnings.begin(), found.warnings.end());
  return job;
}

void check_cuts_part(const Job& job, const Cut& cut) {
  const auto& status = cut.surface.status;
  if (std::any_of(status.begin(), status.end(), [](VertexStatus one) {
        return one == VertexStatus::Cut || one == VertexStatus::Gouged;
      }))
    return;
  const double within = cutting::gouge_bands * job.scene.band;
  const Nearest nearest = nearest_cut(job, within);
  if (auto fault = judged_too_sparsely(job, nearest)) throw BadInput(std::move(*fault));
  throw BadInput(
      job.path.file, nearest.line, 0,
      fmt::format("a program that cuts the part within {} mm of the design", job.scene.band),
      fmt::format("nothing cut ({}); {}", cut.name, words_of(nearest, within)));
}

}  // namespace abbe::sim
