#include <atomic>
#include <cmath>
#include <functional>
#include <iostream>
#include <numbers>

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include "cutting/surface/sweep_tree.h"
#include "tests/cutting/any_form.h"
#include "tests/cutting/every_move.h"

// The tree against every move tried on its own, bit for bit: neither the rays nor the cutters nor
// the motions are what anybody would call reasonable.
namespace abbe::cutting {
namespace {

using Eigen::Vector3d;
using std::numbers::pi;

Cutter any_cutter(Random& random) {
  const double R = random.decades(-1, 2);
  double r = 0.0;
  switch (random.below(6)) {
    case 0:
      r = R;
      break;  // ball
    case 1:
      r = 0.0;
      break;  // flat
    case 2:
      r = R * random.in(0, 1);
      break;  // bull-nosed
    case 4:
      return any_form(random, R);
    case 3:
      r = R * (1 - random.decades(-9, -1));
      break;  // all but a ball
    default:
      r = R * random.decades(-9, -1);
      break;  // all but flat
  }
  const bool no_flank = r > 0 && random.once_in(6);
  return {R, r, no_flank ? r : r + R * random.decades(-2, 1)};
}

struct Pass {
  double step;  // mm a move
  double turn;  // rad a move
  int moves;
};

/// A straight pass, a raster, a walk or a stand, with the axis leaning by 1e-9 to 1 rad from a
/// direction that mostly is z.
CutterMotion any_motion(Random& random, const Cutter& cutter, int moves) {
  const Vector3d up = random.once_in(3) ? random.direction() : Vector3d::UnitZ();
  const double lean = random.once_in(8) ? 0.0 : random.decades(-9, 0);
  const double step = random.once_in(10) ? 0.0 : cutter.radius * random.decades(-9, 1);
  const double turn = random.once_in(2) ? 0.0 : random.decades(-9, random.once_in(10) ? 0.4 : -1.3);
  const int shape = random.below(4);
  const Vector3d feed = up.cross(random.direction()).normalized();
  const Vector3d aside = up.cross(feed);
  const int row = 1 + int(std::sqrt(double(moves)));
  Vector3d tip = random.once_in(3) ? Vector3d(1000 * random.direction()) : random.direction();
  Vector3d axis = lean == 0.0 ? up : random.turned_evenly(up, lean);
  CutterMotion motion{Points(moves + 1, 3), Points(moves + 1, 3), Eigen::VectorXd(moves + 1),
                      std::vector<int>(std::size_t(moves) + 1, 1)};
  for (int i = 0; i <= moves; ++i) {
    motion.tip.row(i) = tip;
    motion.axis.row(i) = axis;
    motion.time_s[i] = i;
    if (shape == 3 && i % 2 == 0) continue;  // a stand
    const bool jump = shape == 1 && i % row == row - 1;
    if (shape == 0 || (shape == 1 && !jump)) tip += step * (i / row % 2 == 0 ? 1 : -1) * feed;
    if (jump) tip += cutter.radius * 0.1 * aside;
    if (shape >= 2) tip += step * random.direction() - 0.01 * step * up;
    if (turn > 0) axis = random.turned_evenly(axis, turn);
    if (random.once_in(200)) axis = random.turned_evenly(axis, pi - 1e-5);  // all but opposite
  }
  return motion;
}

/// A point of the cutter's surface with its outward normal, in frame t.
std::pair<Vector3d, Vector3d> any_surface_point(Random& random, const Cutter& cutter) {
  const double r = cutter.corner_radius, ring = cutter.radius - r;
  const double around = random.in(-pi, pi);
  const Vector3d e(std::cos(around), std::sin(around), 0);
  const int part = random.below(4);
  if (part == 0) return {ring * random.in(0, 1) * e, -Vector3d::UnitZ()};
  if (part == 1)
    return {cutter.radius * e + random.in(r, cutter.flank_length) * Vector3d::UnitZ(), e};
  const double kappa = random.once_in(3) ? random.decades(-9, 0) : random.in(0, pi / 2);
  const Vector3d outward = std::sin(kappa) * e - std::cos(kappa) * Vector3d::UnitZ();
  return {ring * e + r * Vector3d::UnitZ() + r * outward, outward};
}

/// A ray that touches, enters, leaves or just misses some tool of the motion, or runs through its
/// middle.
Ray any_ray(Random& random, const Cutter& cutter, const CutterMotion& motion) {
  const double bands[] = {2.0, 0.05, 50.0, random.decades(-3, 2)};
  const double band = bands[random.below(4)];
  const int move = random.below(std::max(1, int(motion.tip.rows()) - 1));
  const Move whole = move_after(motion, move);
  const double t = random.once_in(3) ? random.below(2) : random.in(0, 1);
  const Vector3d axis =
      (std::cos(t * whole.angle) * whole.axis + std::sin(t * whole.angle) * whole.side)
          .normalized();
  const Vector3d x = axis.unitOrthogonal(), y = axis.cross(x);
  const auto in_w = [&](const Vector3d& v) -> Vector3d {
    return v.x() * x + v.y() * y + v.z() * axis;
  };
  auto [place, outward] = any_surface_point(random, cutter);
  if (random.once_in(5)) place = cutter.corner_radius * Vector3d::UnitZ();
  const Vector3d at = whole.tip + t * whole.step + in_w(place);
  Vector3d normal = -in_w(outward);
  if (random.once_in(4)) normal = Vector3d::UnitZ();
  if (random.once_in(2)) normal = random.turned_evenly(normal, random.decades(-9, 0.3));
  if (random.once_in(4)) normal = -normal;  // it leaves the tool there, or starts beyond it
  normal.normalize();
  const double edges[] = {0.0,
                          band,
                          -band,
                          band * (1 - 1e-8),
                          -band * (1 - 1e-8),
                          random.in(-band, band),
                          random.in(-band, 0),
                          cutter.radius};
  return {at - edges[random.below(8)] * normal, normal, band};
}

struct Count {
  std::atomic<long> rays = 0, cut = 0, buried = 0, competing_passes = 0, different = 0;
};

bool same(const Removal& a, const Removal& b) {
  return a.s == b.s && a.t == b.t && a.move == b.move && a.part == b.part;
}

bool same(const std::optional<Removal>& a, const std::optional<Removal>& b, double band) {
  if (a.has_value() != b.has_value()) return false;
  if (!a || (a->s == b->s && a->s <= -band)) return true;  // buried: any move will do
  return same(*a, *b);
}

std::string text(const std::optional<Removal>& r) {
  if (!r) return "none";
  std::ostringstream out;
  out.precision(17);
  out << "s " << r->s << " t " << r->t << " move " << r->move << "." << r->part;
  return out.str();
}

void expect_same(std::uint64_t seed, int moves, int rays, Count& count) {
  Random random(seed);
  const Cutter cutter = any_cutter(random);
  const CutterMotion motion = any_motion(random, cutter, moves);
  const SweepTree tree(cutter, motion);
  SweepTree::Hint carried;
  for (int i = 0; i < rays; ++i) {
    const Ray ray = any_ray(random, cutter, motion);
    const auto expected = first_removal_of_every_move(cutter, motion, ray);
    SweepTree::Hint fresh, other{random.below(moves)};
    ++count.rays;
    count.cut += expected && expected->s > -ray.band;
    count.buried += expected && expected->s <= -ray.band;
    bool good = true;
    for (SweepTree::Hint* hint : {&fresh, &carried, &other}) {
      const auto found = tree.first_removal(ray, *hint);
      good = good && same(found, expected, ray.band);
      if (!same(found, expected, ray.band) && count.different < 20)
        ADD_FAILURE() << "seed " << seed << ", " << moves << " moves, ray " << i << ", R "
                      << cutter.radius << " r " << cutter.corner_radius << " flank "
                      << cutter.flank_length << ", band " << ray.band << ": found " << text(found)
                      << ", of every move " << text(expected);
    }
    if (i % 4 == 0 && expected && expected->s > -ray.band) {
      const double reach = random.decades(-6, 0.5);
      const auto competing_passes = removals_of_every_move(cutter, motion, ray, reach);
      const auto found = tree.removals_within(ray, reach, carried);
      count.competing_passes += long(competing_passes.size());
      const bool all =
          std::equal(competing_passes.begin(), competing_passes.end(), found.begin(), found.end(),
                     [](const Removal& a, const Removal& b) { return same(a, b); });
      good = good && all;
      if (!all && count.different < 20)
        ADD_FAILURE() << "seed " << seed << ", " << moves << " moves, ray " << i << ", reach "
                      << reach << ": " << found.size() << " rivals, of every move "
                      << competing_passes.size();
    }
    count.different += !good;
  }
}

void run(const char* name, std::uint64_t seed, int cases, int most_moves, int rays) {
  Count count;
  tbb::parallel_for(0, cases, [&](int i) {
    const std::uint64_t own = seed + std::uint64_t(i);
    Random random(own ^ 0x5555);
    const int moves = most_moves == 1 ? 1 : int(random.decades(0, std::log10(double(most_moves))));
    expect_same(own, moves, rays, count);
  });
  std::cout << "  " << name << ", seeds " << seed << " and on: " << cases << " motions, "
            << count.rays << " rays, " << count.cut << " cut, " << count.buried << " buried, "
            << count.competing_passes << " rivals, " << count.different << " different\n";
  EXPECT_EQ(count.different, 0);
  EXPECT_GT(count.cut, count.rays / 4);
}

TEST(Culling, LosesNothingOfOneMove) { run("one move", 130000000, 20000 * longer(5), 1, 8); }

TEST(Culling, LosesNothingOfAFewMoves) { run("to 40 moves", 131000000, 3000 * longer(5), 40, 12); }

TEST(Culling, LosesNothingOfThousandsOfMoves) {
  run("to 6000 moves", 132000000, 60 * longer(5), 6000, 24);
}

/// Rays beside one, with normals that lean a little from its own, on a surface of some curvature.
std::vector<Ray> any_patch(Random& random, const Cutter& cutter, const CutterMotion& motion) {
  const Ray first = any_ray(random, cutter, motion);
  const double size = cutter.radius * random.decades(-6, 0.5),
               lean = random.decades(-9, random.once_in(5) ? 0.2 : -0.7),
               bent = random.in(-1, 1) / cutter.radius;
  std::vector<Ray> rays{first};
  const Vector3d x = first.normal.unitOrthogonal(), y = first.normal.cross(x);
  for (int i = 1 + random.below(70); i > 0; --i) {
    const double u = size * random.in(-1, 1), v = size * random.in(-1, 1);
    const Vector3d normal = random.once_in(3)
                                ? first.normal
                                : random.turned_evenly(first.normal, lean * random.in(0, 1));
    const Vector3d place = first.point + u * x + v * y + bent * (u * u + v * v) * first.normal;
    rays.push_back({place, normal.normalized(), first.band});
  }
  return rays;
}

/// A ball or a bull nose over a wave, as parts are finished; upright or leading.
CutterMotion finishing(Random& random, const Cutter& cutter, int passes) {
  const double pitch = cutter.radius * random.decades(-2, -0.5),
               lead = random.once_in(2) ? 0.0 : random.in(0, 0.4);
  const double side = pitch * passes, height = 0.1 * side * random.in(0, 1);
  const int n = passes * passes;
  CutterMotion motion{Points(n, 3), Points(n, 3), Eigen::VectorXd(n),
                      std::vector<int>(std::size_t(n), 1)};
  for (int k = 0; k < n; ++k) {
    const double x = 2 * pi * (k % passes) / passes, y = 2 * pi * (k / passes) / passes;
    const Vector3d normal =
        Vector3d(-height * std::cos(x) * 2 * pi / side, height * std::sin(y) * 2 * pi / side, 1)
            .normalized();
    const Vector3d axis =
        lead > 0 ? Vector3d(std::cos(lead) * normal + std::sin(lead) * normal.unitOrthogonal())
                       .normalized()
                 : Vector3d(Vector3d::UnitZ());
    const Vector3d place(x / (2 * pi) * side, y / (2 * pi) * side,
                         height * (std::sin(x) + std::cos(y)));
    motion.tip.row(k) = place + cutter.corner_radius * (normal - axis);
    motion.axis.row(k) = axis;
    motion.time_s[k] = k;
  }
  return motion;
}

void expect_same_rays(std::uint64_t seed, const SweepTree& tree, const Cutter& cutter,
                      const CutterMotion& motion, std::span<const Ray> rays, SweepTree::Hint& hint,
                      Count& count) {
  std::vector<std::optional<Removal>> found(rays.size());
  tree.first_removals(rays, found, hint);
  for (std::size_t k = 0; k < rays.size(); ++k) {
    const auto expected = first_removal_of_every_move(cutter, motion, rays[k]);
    ++count.rays;
    count.cut += expected && expected->s > -rays[k].band;
    count.buried += expected && expected->s <= -rays[k].band;
    if (same(found[k], expected, rays[k].band)) continue;
    if (++count.different < 20)
      ADD_FAILURE() << "seed " << seed << ", ray " << k << " of " << rays.size() << ", R "
                    << cutter.radius << " r " << cutter.corner_radius << ", band " << rays[k].band
                    << ": found " << text(found[k]) << ", of every move " << text(expected);
  }
}

void expect_same_patches(std::uint64_t seed, const Cutter& cutter, const CutterMotion& motion,
                         int patches, Random& random, Count& count) {
  const SweepTree tree(cutter, motion);
  SweepTree::Hint hint;
  for (int i = 0; i < patches; ++i)
    expect_same_rays(seed, tree, cutter, motion, any_patch(random, cutter, motion), hint, count);
}

void run_patches(const char* name, std::uint64_t seed, int cases,
                 const std::function<void(Random&, std::uint64_t, Count&)>& one) {
  Count count;
  tbb::parallel_for(0, cases, [&](int i) {
    Random random(seed + std::uint64_t(i));
    one(random, seed + std::uint64_t(i), count);
  });
  std::cout << "  " << name << ", seeds " << seed << " and on: " << cases << " motions, "
            << count.rays << " rays, " << count.cut << " cut, " << count.buried << " buried, "
            << count.different << " different\n";
  EXPECT_EQ(count.different, 0);
  EXPECT_GT(count.cut, count.rays / 8);
}

TEST(Culling, LosesNothingOfRaysBesideEachOther) {
  run_patches("any motions", 133000000, 2000 * longer(5),
              [](Random& random, std::uint64_t seed, Count& count) {
                const Cutter cutter = any_cutter(random);
                const CutterMotion motion = any_motion(random, cutter, int(random.decades(0, 2.3)));
                expect_same_patches(seed, cutter, motion, 2, random, count);
              });
}

TEST(Culling, LosesNothingOfFinishedSurfaces) {
  run_patches("finishing", 134000000, 400 * longer(5),
              [](Random& random, std::uint64_t seed, Count& count) {
                Cutter cutter = any_cutter(random);
                if (random.once_in(2)) cutter = {cutter.radius, cutter.radius, 2 * cutter.radius};
                expect_same_patches(seed, cutter, finishing(random, cutter, 8 + random.below(16)),
                                    3, random, count);
              });
}

/// Rays along the wall that a cutter leaves where it stands, beside rays in the open: whether they
/// touch it is up to rounding, and what a limit promises the search must find.
TEST(Culling, LosesNothingOfRaysAlongWalls) {
  run_patches(
      "walls", 135000000, 600 * longer(5), [](Random& random, std::uint64_t seed, Count& count) {
        const double R = random.once_in(2) ? double(1 + random.below(8)) : random.decades(-1, 1.5);
        const double corners[] = {0.0, 0.1 * R, R * random.in(0, 1), R};
        const Cutter cutter{R, corners[random.below(4)], R * random.in(1, 5)};
        const Eigen::Matrix3d turned =
            random.once_in(2) ? Eigen::Matrix3d::Identity().eval() : random.rotation(pi);
        // into a groove, or down, and out a little higher
        const Vector3d into = random.once_in(2) ? Vector3d(-4 * R, 0, 0) : Vector3d(0, 0, 2 * R);
        const double higher = random.once_in(2) ? 0.1 * R : R * random.in(0, 0.5);
        const std::array<Vector3d, 4> tips{into, Vector3d::Zero(), Vector3d(0, 0, higher),
                                           Vector3d(2 * R, 0, higher)};
        CutterMotion motion{Points(4, 3), Points(4, 3), Eigen::VectorXd(4), {1, 2, 3, 4}};
        for (int k = 0; k < 4; ++k) {
          motion.tip.row(k) = turned * tips[std::size_t(k)];
          motion.axis.row(k) = turned * Vector3d::UnitZ();
          motion.time_s[k] = k;
        }
        const double band = R * random.in(0.2, 1), height = R * random.in(0, 0.9);
        const double from = random.in(-pi, pi), step = random.decades(-5, -1);
        std::vector<Ray> rays;
        for (int k = 0; k < 40; ++k) {
          const double around = from + step * k, rho = k < 8 ? 0.5 * R : R;
          const Vector3d place(rho * std::cos(around), rho * std::sin(around), height);
          rays.push_back({turned * place, turned * Vector3d::UnitZ(), band});
        }
        const SweepTree tree(cutter, motion);
        SweepTree::Hint hint;
        expect_same_rays(seed, tree, cutter, motion, rays, hint, count);
      });
}

/// A cone that a flank runs around in moves far shorter than it: a ray has hundreds of them near,
/// of which single precision orders none.
TEST(Culling, LosesNothingOfFlanks) {
  run_patches(
      "flanks", 136000000, 48 * longer(5), [](Random& random, std::uint64_t seed, Count& count) {
        const double R = random.decades(-0.5, 1), length = R * random.in(3, 8);
        const Cutter cutter{R, R * random.in(0, 0.3), length};
        const double lean = random.in(0, 0.4), top = R * random.in(2, 6),
                     step = R / top * random.decades(-4, -2);
        const auto normal = [&](double around) {
          return Vector3d(std::cos(around) * std::cos(lean), std::sin(around) * std::cos(lean),
                          std::sin(lean));
        };
        const auto place = [&](double around, double down) {
          const double rho = top + down * std::tan(lean);
          return Vector3d(rho * std::cos(around), rho * std::sin(around), -down);
        };
        const int n = 300 + random.below(2000);
        CutterMotion motion{Points(n, 3), Points(n, 3), Eigen::VectorXd(n),
                            std::vector<int>(std::size_t(n), 1)};
        for (int k = 0; k < n; ++k) {
          const double around = step * (k - n / 2);
          motion.axis.row(k) = (place(around, 0) - place(around, 1)).normalized();
          motion.tip.row(k) = place(around, 0.9 * length) + R * normal(around);
          motion.time_s[k] = k;
        }
        const SweepTree tree(cutter, motion);
        SweepTree::Hint hint;
        const double size = step * n * random.decades(-3, 0);
        const double middle = step * n * random.in(-0.5, 0.5), high = random.in(0.1, 0.5);
        std::vector<Ray> rays;
        for (int k = 0; k < 40; ++k) {
          const double around = middle + size * random.in(-0.5, 0.5);
          const double down = length * (high + random.in(0, 0.3));
          rays.push_back({place(around, down),
                          random.turned_evenly(normal(around), random.decades(-9, -1)), 0.3 * R});
        }
        expect_same_rays(seed, tree, cutter, motion, rays, hint, count);
      });
}

}  // namespace
}  // namespace abbe::cutting
