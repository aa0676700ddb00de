#include <atomic>
#include <limits>
#include <memory>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "cutting/gouge.h"
#include "cutting/surface.h"
#include "cutting/surface_input.h"
#include "cutting/swept_nose.h"

namespace abbe::cutting {

namespace {

Surface searched_by_nose(const SweptNose& swept, const Design& design_w,
                         const SurfaceOptions& options) {
  const Eigen::Index n = design_w.vertices.rows();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Surface surface{Eigen::VectorXd::Constant(n, nan), Eigen::VectorXd::Constant(n, nan),
                  std::vector<int>(std::size_t(n), 0),
                  std::vector<VertexStatus>(std::size_t(n), VertexStatus::Uncut)};
  const auto cut_vertex = [&](Eigen::Index v) {
    const auto k = std::size_t(v);
    if (!is_judged(design_w, v)) {
      surface.status[k] = VertexStatus::Outside;
      return;
    }
    const std::optional<NoseCut> cut =
        swept.first({design_w.vertices.row(v), design_w.normals.row(v), options.band});
    if (!cut) return;
    if (cut->s <= -options.band) {
      surface.status[k] = VertexStatus::Gouged;
      return;
    }
    surface.residual[v] = cut->s;
    surface.cut_time_s[v] = cut->time_s;
    surface.cut_line[k] = cut->line;
    surface.status[k] = VertexStatus::Cut;
  };
  std::atomic<Eigen::Index> done = 0;
  tbb::parallel_for(tbb::blocked_range<Eigen::Index>(0, n, 256),
                    [&](const tbb::blocked_range<Eigen::Index>& range) {
                      for (Eigen::Index v = range.begin(); v != range.end(); ++v) cut_vertex(v);
                      done += range.size();
                      if (options.progress) options.progress(double(done) / double(n));
                    });
  return with_gouges(std::move(surface), design_w, options,
                     [&](const Ray& ray) -> std::optional<FirstCut> {
                       const std::optional<NoseCut> cut = swept.first(ray);
                       if (!cut) return std::nullopt;
                       return FirstCut{cut->s, cut->time_s, cut->line};
                     });
}

}  // namespace

std::function<Surface(const Design& design_w)> turned_search(const Nose& nose,
                                                             const NoseMotion& motion,
                                                             const SurfaceOptions& options) {
  const auto swept = std::make_shared<const SweptNose>(nose, motion);
  return [swept, options](const Design& design_w) {
    check_turned(design_w, options.band);
    return searched_by_nose(*swept, design_w, options);
  };
}

Surface turned_surface(const Design& design_w, const Nose& nose, const NoseMotion& motion,
                       const SurfaceOptions& options) {
  check_turned(design_w, options.band);
  return searched_by_nose(SweptNose(nose, motion), design_w, options);
}

}  // namespace abbe::cutting
