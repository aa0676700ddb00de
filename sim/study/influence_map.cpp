#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "kinematics/numbers.h"
#include "sim/scene/bad_scene.h"
#include "sim/study/influence_columns.h"
#include "sim/study/plan.h"

namespace abbe::sim::study {
namespace {

using cutting::Rival;
using Eigen::Index;

constexpr std::uint64_t check_stream = 0x2545f4914f6cdd1dULL;
Columns columns_of_inputs(const BaseRun& run, const Progress& progress) {
  const Index p = Index(run.study.inputs.size()), m = Index(run.rivals.size());
  Columns all{Eigen::MatrixXd(p, m), Eigen::MatrixXd(p, m)};
  const auto put = [&](Index input, const Columns& some, Index row) {
    all.slope.row(input) = some.slope.row(row);
    all.shift.row(input) = some.shift.row(row);
  };
  std::vector<GeometricInput> geometric;
  for (Index i = 0; i < p; ++i) {
    if (progress) progress("inputs", double(i) / double(p));
    if (reshapes(run.study.inputs[std::size_t(i)]))
      throw BadInput(run.study.file.string(), 0, 0,
                     "engine = \"full\" for an input that changes part, program, nominal machine "
                     "or stock",
                     run.study.inputs[std::size_t(i)].name);
    const std::array<Scene, 2> scenes = scenes_around(run, i);
    if (auto one = geometric_input(run, i, scenes))
      geometric.push_back(std::move(*one));
    else
      put(i, difference_columns(run, i, scenes), 0);
  }
  const Columns by_jacobian = geometric_columns(run, geometric);
  for (std::size_t k = 0; k < geometric.size(); ++k) put(geometric[k].input, by_jacobian, Index(k));
  return all;
}

/// Machines that are cut to see where the maps fail, those left out that cannot cut the program.
class Checks {
 public:
  Checks(const Study& study, const ReadyArm& ready) : study_(study), ready_(ready) {}

  std::optional<cutting::Surface> cut(const Eigen::VectorXd& x) {
    try {
      Tried tried = cut_at(study_, ready_, ready_.job, x);
      any_ = true;
      return std::move(tried.surface);
    } catch (const BadScene&) {
      refused_ = std::current_exception();
    } catch (const BadInput&) {
      refused_ = std::current_exception();
    }
    return std::nullopt;
  }

  /// @throws what the last one was refused for, if no machine could be cut
  void want_one() const {
    if (!any_ && refused_) std::rethrow_exception(refused_);
  }

 private:
  const Study& study_;
  const ReadyArm& ready_;
  bool any_ = false;
  std::exception_ptr refused_;
};

/// How far a map is off at a vertex: infinitely where only one of them has a surface.
double off(const InfluenceMap& map, const cutting::Surface& surface, Index v, double estimated) {
  const bool wanted = std::isfinite(map.error_free[v]);
  const bool cut = wanted && surface.status[std::size_t(v)] == cutting::VertexStatus::Cut;
  const bool has_estimate = std::isfinite(estimated);
  if (cut && has_estimate) return std::abs(estimated - surface.residual[v]);
  return cut == has_estimate ? 0.0 : infinity;
}

double flagged_percent(const InfluenceMap& map, double flag) {
  double flagged = 0.0, area = 0.0;
  for (Index v = 0; v < map.doubt.size(); ++v) {
    if (map.status[std::size_t(v)] == cutting::VertexStatus::Outside) continue;
    area += map.design.area[v];
    if (map.doubt[v] > flag) flagged += map.design.area[v];
  }
  return area > 0.0 ? 100.0 * flagged / area : 0.0;
}

/// (n) mm
Eigen::VectorXd doubt_of(const BaseRun& run, const InfluenceMap& map, const Progress& progress) {
  const Study& study = run.study;
  Eigen::VectorXd doubt = Eigen::VectorXd::Zero(map.design.vertices.rows());
  const int count = study.influence.checks;
  if (count == 0) return doubt;
  const Sequence random{Sampling::Random, int(study.inputs.size()), study.seed ^ check_stream};
  const Eigen::MatrixXd x = drawn(study, points(random, 0, count));
  const Eigen::MatrixXd estimated = maps(map, x);
  Checks checks(study, run.ready);
  for (int i = 0; i < count; ++i) {
    if (progress) progress("checks", double(i) / count);
    const std::optional<cutting::Surface> surface = checks.cut(x.col(i));
    if (!surface) continue;
    for (Index v = 0; v < doubt.size(); ++v)
      doubt[v] = std::max(doubt[v], off(map, *surface, v, estimated(v, i)));
  }
  checks.want_one();
  return doubt;
}

/// Without rivals where the study compares with an error-free map that has no surface there.
BaseRun comparable(BaseRun run) {
  if (run.study.machine_part)
    std::erase_if(run.rivals, [&](const Rival& rival) {
      return !std::isfinite(run.ready.error_free.residual[rival.vertex]);
    });
  return run;
}

/// The rivals of every vertex, in order, before what inputs do to them.
InfluenceMap framed(const BaseRun& run) {
  const std::vector<Rival>& rivals = run.rivals;
  const Job& job = run.ready.job;
  const Index n = job.design_w.vertices.rows();
  InfluenceMap map;
  map.design = job.design_w;
  map.centre = centre(run.study);
  map.error_free = Eigen::VectorXd::Zero(n);
  map.status.assign(std::size_t(n), cutting::VertexStatus::Uncut);
  const auto& judged = job.design_w.judged;
  for (Index v = 0; v < n; ++v)
    if (!judged.empty() && !judged[std::size_t(v)])
      map.status[std::size_t(v)] = cutting::VertexStatus::Outside;
  for (const cutting::Gouge& gouge : run.gouges)
    map.status[std::size_t(gouge.vertex)] = cutting::VertexStatus::Gouged;
  if (run.study.machine_part) map.error_free = run.ready.error_free.residual;
  map.distance.resize(Index(rivals.size()));
  map.half_curvature.resize(Index(rivals.size()));
  map.first.assign(std::size_t(n) + 1, 0);
  for (std::size_t r = 0; r < rivals.size(); ++r) {
    ++map.first[std::size_t(rivals[r].vertex) + 1];
    map.status[std::size_t(rivals[r].vertex)] = cutting::VertexStatus::Cut;
    map.distance[Index(r)] = rivals[r].distance;
    map.half_curvature[Index(r)] = 0.5 * rivals[r].curvature;
  }
  for (std::size_t v = 0; v < std::size_t(n); ++v) map.first[v + 1] += map.first[v];
  return map;
}

/// What a base run without any rival did instead.
std::string instead_of_cutting(const BaseRun& run) {
  const std::string& arm = run.ready.arm.name;
  if (run.gouges.empty()) return fmt::format("nothing cut ({})", arm);
  return fmt::format("nothing cut within {} mm, {} {} gouged deeper ({})", run.ready.job.scene.band,
                     run.gouges.size(), run.gouges.size() == 1 ? "vertex" : "vertices", arm);
}

}  // namespace

InfluenceMap influence_map(const Study& study, const ReadyArm& ready, const Progress& progress) {
  const BaseRun run = comparable(base_run(study, ready, progress));
  if (run.rivals.empty())
    throw BadInput(study.scene.string(), 0, 0,
                   "a program that cuts the part within the band, every input at its centre",
                   instead_of_cutting(run));
  InfluenceMap map = framed(run);
  Columns columns = columns_of_inputs(run, progress);
  map.slope = std::move(columns.slope);
  map.shift = std::move(columns.shift);
  map.doubt = doubt_of(run, map, progress);
  map.flagged_percent = flagged_percent(map, study.influence.flag);
  return map;
}

}  // namespace abbe::sim::study
