#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/gouge.h"
#include "cutting/rival_shape.h"
#include "cutting/rivals.h"
#include "cutting/surface_input.h"
#include "cutting/swept_nose.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr double half_turn = std::numbers::pi;

struct Lathe {
  const SweptNose& swept;
  const NoseMotion& motion;
  const RivalOptions& options;
};

/// The nearest cut of every revolution, the nearest first.
std::vector<NoseCut> one_a_revolution(const SweptNose& swept, const std::vector<NoseCut>& cuts) {
  std::vector<NoseCut> nearest;
  double begins = 0.0;
  for (const NoseCut& cut : cuts) {
    const double turned = swept.turned(cut);
    if (nearest.empty() || turned - begins > half_turn) {
      nearest.push_back(cut);
      begins = turned;
    } else if (cut.s < nearest.back().s) {
      nearest.back() = cut;
    }
  }
  std::stable_sort(nearest.begin(), nearest.end(),
                   [](const NoseCut& a, const NoseCut& b) { return a.s < b.s; });
  return nearest;
}

/// Normal of the rake plane in the workpiece, which is the way of the work past the edge.
Vector3d rake_normal(const NoseMotion& motion, const NoseCut& cut) {
  const auto i = std::size_t(cut.interval);
  const Vector3d from = motion.T_slow[i].linear().col(1);
  const Vector3d to = motion.T_slow[i + 1].linear().col(1);
  const double angle =
      motion.spindle[Index(i)] + cut.u * (motion.spindle[Index(i) + 1] - motion.spindle[Index(i)]);
  return Eigen::AngleAxisd(angle, motion.spindle_direction) * (from + cut.u * (to - from));
}

/// rad, how far the spindle may turn until the same revolution cuts a ray of the stencil.
double window(const Lathe& lathe, const Vector3d& contact) {
  const Vector3d arm = contact - lathe.motion.spindle_point;
  const double radius = arm.cross(lathe.motion.spindle_direction).norm();
  return std::min(0.5 * half_turn, 0.05 + 4.0 * lathe.options.stencil / std::max(radius, 1e-9));
}

Rival rival_of(const Lathe& lathe, const NoseCut& cut, const Ray& ray) {
  Rival rival{.distance = cut.s, .move = cut.interval, .t = cut.u};
  rival.contact = ray.point + cut.s * ray.normal;
  const PassProbe probe{ray.normal, cut.s, rake_normal(lathe.motion, cut), lathe.options.stencil};
  const double turn = window(lathe, rival.contact);
  const auto distance = [&](const Vector3d& displacement) -> std::optional<double> {
    const Ray beside{ray.point + displacement, ray.normal, ray.band};
    const std::optional<NoseCut> found = lathe.swept.near(beside, cut, turn);
    if (!found || found->s <= -ray.band) return std::nullopt;
    return found->s;
  };
  const PassShape shape = pass_shape(probe, distance);
  rival.gradient = shape.gradient;
  rival.across = shape.across;
  rival.curvature = shape.curvature;
  return rival;
}

std::vector<Rival> rivals_of(const Lathe& lathe, const Ray& ray) {
  const std::optional<NoseCut> first = lathe.swept.first(ray);
  if (!first || first->s <= -ray.band) return {};
  const double limit = std::min(first->s + lathe.options.reach, ray.band);
  std::vector<NoseCut> cuts = one_a_revolution(lathe.swept, lathe.swept.within(ray, limit));
  if (cuts.size() > std::size_t(lathe.options.most)) cuts.resize(std::size_t(lathe.options.most));
  std::vector<Rival> rivals;
  for (const NoseCut& cut : cuts) rivals.push_back(rival_of(lathe, cut, ray));
  return rivals;
}

}  // namespace

std::vector<Rival> turned_rivals(const Design& design_w, const Nose& nose, const NoseMotion& motion,
                                 const RivalOptions& options) {
  check_turned(design_w, options.band);
  check_rivals(options);
  const SweptNose swept(nose, motion);
  const Lathe lathe{swept, motion, options};
  const Index n = design_w.vertices.rows();
  auto of_vertex = std::vector<std::vector<Rival>>(std::size_t(n));
  const ThinRays thin_rays(design_w, options.band);
  const auto rivals_at = [&](Index v) {
    std::vector<Rival> rivals =
        rivals_of(lathe, {design_w.vertices.row(v), design_w.normals.row(v), options.band});
    if (!rivals.empty()) return rivals;
    const std::optional<ShiftedRay> thin = thin_rays.of(v);
    if (!thin) return rivals;
    rivals = rivals_of(lathe, thin->ray);
    for (Rival& rival : rivals) rival.distance += thin->shift;
    return rivals;
  };
  std::atomic<Index> done = 0;
  tbb::parallel_for(tbb::blocked_range<Index>(0, n, 64), [&](const auto& range) {
    for (Index v = range.begin(); v != range.end(); ++v)
      if (is_judged(design_w, v)) of_vertex[std::size_t(v)] = rivals_at(v);
    done += Index(range.size());
    if (options.progress) options.progress(double(done) / double(n));
  });
  return in_order_of_vertices(of_vertex);
}

}  // namespace abbe::cutting
