#include <tbb/parallel_for.h>
#include "cutting/stock/engagement.h"
#include "cutting/surface/nose_cut.h"
#include "cutting/surface/sweep_tree.h"
#include "tests/cutting/any_form.h"
#include "tests/cutting/every_move.h"
#include "tests/cutting/random.h"
#include "tests/cutting/stock_parts.h"
#include "tests/cutting/turned_parts.h"
#include "tests/test.h"

// The tree against every move tried on its own, bit for bit: neither the rays nor the cutters nor
// the motions are what anybody would call reasonable.
namespace abbe::cutting {
namespace {

using Eigen::Isometry3d;

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
  CutterMotion motion{Points(moves + 1, 3), Points(moves + 1, 3), VectorXd(moves + 1),
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
  CutterMotion motion{Points(n, 3), Points(n, 3), VectorXd(n), std::vector<int>(std::size_t(n), 1)};
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
        const Matrix3d turned =
            random.once_in(2) ? Matrix3d::Identity().eval() : random.rotation(pi);
        // into a groove, or down, and out a little higher
        const Vector3d into = random.once_in(2) ? Vector3d(-4 * R, 0, 0) : Vector3d(0, 0, 2 * R);
        const double higher = random.once_in(2) ? 0.1 * R : R * random.in(0, 0.5);
        const std::array<Vector3d, 4> tips{into, Vector3d::Zero(), Vector3d(0, 0, higher),
                                           Vector3d(2 * R, 0, higher)};
        CutterMotion motion{Points(4, 3), Points(4, 3), VectorXd(4), {1, 2, 3, 4}};
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
        CutterMotion motion{Points(n, 3), Points(n, 3), VectorXd(n),
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

// The sweep through a stock against the same with every line tried, bit for bit, and engagement
// against counting: cutters of every kind, leans from 1e-9 rad on.

Cutter any_cutter(Random& random, double least, double most) {
  const double R = random.decades(std::log10(least), std::log10(most));
  if (random.once_in(5)) return any_form(random, R);
  const double r = random.once_in(3) ? R
                   : random.once_in(2)
                       ? 0.0
                       : R * (random.once_in(3) ? random.decades(-9, -1) : random.in(0, 1));
  return {R, r, r + R * random.decades(-2, 1)};
}

bool same_runs(const Stock& a, const Stock& b) {
  for (std::size_t f = 0; f < a.fields.size(); ++f)
    for (std::size_t l = 0; l < a.fields[f].lines.size(); ++l) {
      const auto x = a.fields[f].lines[l].runs(), y = b.fields[f].lines[l].runs();
      if (!std::equal(x.begin(), x.end(), y.begin(), y.end(),
                      [](const DexelRun& p, const DexelRun& q) {
                        return p.low == q.low && p.high == q.high && p.low_line == q.low_line &&
                               p.high_line == q.high_line;
                      }))
        return false;
    }
  return true;
}

/// An axis: upright, leaning by 1e-9 to 1 rad, or any.
Vector3d any_axis(Random& random) {
  if (random.once_in(6)) return Vector3d::UnitZ();
  if (random.once_in(6)) return random.any().normalized();
  return random.turned(Vector3d::UnitZ(), random.decades(-9, 0));
}

TEST(StockCulling, LosesNothing) {
  const std::uint64_t seed = 601000;
  const int cases = 1500 * longer(10);
  std::atomic<int> different = 0, cut = 0, crashed = 0;
  std::atomic<long> near = 0, all = 0;
  tbb::parallel_for(0, cases, [&](int i) {
    Random random(seed + std::uint64_t(i));
    const Cutter cutter = any_cutter(random, 0.3, 40);
    const bool upright = random.once_in(2);
    const double spacing = random.in(0.7, 1.5);
    const Vector3d half(random.in(2, 9), random.in(2, 9), random.in(2, 7));
    const double away = random.once_in(3) ? 1000.0 : 1.0;
    const Vector3d middle = away * random.any();
    Stock culled = make_stock(BoxBlank{-half, half},
                              pose(middle, upright ? Vector3d::UnitZ() : random.any().normalized()),
                              {spacing, !random.once_in(3)});
    Stock tried = culled;
    for (int move = 0; move < 3; ++move) {
      const Vector3d axis = any_axis(random);
      const double turn = random.once_in(2) ? 0.0 : random.decades(-12, -0.7);
      const Vector3d target = turn > 0 ? random.turned(axis, turn) : axis;
      const Vector3d touch = middle + half.cwiseProduct(random.any());
      const double aside = cutter.radius * (random.once_in(3) ? 1.0 : random.in(0, 1));
      const Vector3d tip = touch + aside * axis.cross(random.any()).normalized();
      const Vector3d step = random.once_in(8) ? Vector3d::Zero().eval()
                                              : Vector3d(random.decades(-9, 1.3) * random.any());
      const StockMove way{pose(tip, axis), pose(tip + step, target), move + 1, random.once_in(5)};
      const RemovalResult a = remove(culled, cutter, way);
      const RemovalResult b = remove(tried, cutter, way, DexelSelection::All);
      cut += b.volume > 0;
      crashed += b.crashed;
      near += long(a.lines);
      all += long(b.lines);
      if (a.volume == b.volume && a.crashed == b.crashed && same_runs(culled, tried)) continue;
      if (++different < 10)
        ADD_FAILURE() << "seed " << seed + std::uint64_t(i) << ", move " << move << ", R "
                      << cutter.radius << " r " << cutter.corner_radius << ": " << a.volume
                      << " mm^3, of every line " << b.volume;
    }
  });
  std::cout << "  seeds " << seed << " and on: " << 3 * cases << " moves, " << cut << " cut, "
            << crashed << " crashed, " << near << " lines of " << all << ", " << different
            << " different\n";
  EXPECT_EQ(different, 0);
  EXPECT_GT(cut, cases);
  EXPECT_LT(near, all);
}

/// An axis that turns by 1e-12 to 1e-9 rad takes what one that stands takes.
TEST(StockCulling, ATurnOfNothingTakesWhatStandingTakes) {
  const std::uint64_t seed = 602000;
  double worst = 0.0;
  for (int i = 0; i < 200; ++i) {
    Random random(seed + std::uint64_t(i));
    const Cutter cutter{random.in(2, 6), 0.0, 60.0};
    const Vector3d axis = (Vector3d::UnitZ() + 0.5 * random.any()).normalized();
    const Vector3d step = 5 * random.any();
    Stock standing = make_stock(BoxBlank{Vector3d(-6, -6, 0), Vector3d(6, 6, 50)},
                                Isometry3d::Identity(), {1.1, true});
    Stock turning = standing;
    const Vector3d tip(random.in(-3, 3), random.in(-3, 3), 1.0);
    const Vector3d target = random.turned(axis, random.decades(-11.9, -9));
    remove(standing, cutter, {pose(tip, axis), pose(tip + step, axis), 1, false});
    remove(turning, cutter, {pose(tip, axis), pose(tip + step, target), 1, false});
    for (std::size_t f = 0; f < 3; ++f)
      for (std::size_t l = 0; l < standing.fields[f].lines.size(); ++l) {
        const auto a = standing.fields[f].lines[l].runs(), b = turning.fields[f].lines[l].runs();
        if (a.size() != b.size()) continue;  // a line that grazes
        for (std::size_t k = 0; k < a.size(); ++k) {
          // across the surface; a line that runs all but along it tells more than there is
          const double off =
              std::max(std::abs(a[k].low - b[k].low), std::abs(a[k].high - b[k].high));
          worst = std::max(worst, std::min(off, 1.0));
        }
      }
  }
  std::cout << "  seeds " << seed << " and on: ends of runs differ by " << worst << " mm\n";
  EXPECT_LT(worst, 1e-5);
}

// ---- engagement ---------------------------------------------------------------------------------

/// The outline by the length along it: (radius, height) and the angle of its normal.
struct Edge {
  double radius, height, kappa;
};
/// Along an outline, each arc by its angle.
Edge edge_at(const ToolOutline& outline, double at) {
  for (const OutlineSegment& piece : outline.segments) {
    const double begin = std::atan2(piece.normal_from.x(), -piece.normal_from.y());
    const double turn = std::atan2(piece.normal_to.x(), -piece.normal_to.y()) - begin;
    const double length = piece.is_arc ? piece.radius * turn : (piece.to - piece.from).norm();
    if (at > length) {
      at -= length;
      continue;
    }
    const double kappa = piece.is_arc ? begin + at / piece.radius : begin;
    const Vector2d normal(std::sin(kappa), -std::cos(kappa));
    const Vector2d place = piece.is_arc
                               ? Vector2d(piece.from + piece.radius * (normal - piece.normal_from))
                               : Vector2d(piece.from + at / length * (piece.to - piece.from));
    return {place.x(), place.y(), kappa};
  }
  return {};
}

Edge edge_at(const Cutter& cutter, double at) {
  if (cutter.outline) return edge_at(*cutter.outline, at);
  const double r = cutter.corner_radius, flat = cutter.radius - r;
  if (at <= flat) return {at, 0.0, 0.0};
  const double kappa = r > 0 ? (at - flat) / r : pi;
  if (kappa >= 0.5 * pi) return {cutter.radius, r + at - flat - 0.5 * pi * r, 0.5 * pi};
  return {flat + r * std::sin(kappa), r * (1 - std::cos(kappa)), kappa};
}

/// rad mm of edge in material that faces the feed, by trying places.
double counted(const Stock& stock, const Cutter& cutter, const Isometry3d& T_wt,
               const Vector3d& feed_w) {
  constexpr int angles = 240, places = 5;
  const Vector3d feed = (T_wt.linear().transpose() * feed_w).normalized();
  double sum = 0.0, from = 0.0;
  for (const EdgeSlice& slice : slices(cutter)) {
    for (int a = 0; a < angles; ++a) {
      const double around = 2 * pi * (a + 0.5) / angles;
      const Vector3d e(std::cos(around), std::sin(around), 0);
      const Vector3d outward =
          std::sin(slice.kappa) * e - std::cos(slice.kappa) * Vector3d::UnitZ();
      if (outward.dot(feed) <= min_feed_component) continue;
      for (int k = 0; k < places; ++k) {
        const Edge edge = edge_at(cutter, from + slice.length * (k + 0.5) / places);
        const Vector3d place = edge.radius * e + edge.height * Vector3d::UnitZ();
        if (depth(stock, T_wt * place) > 0) sum += slice.length / places * 2 * pi / angles;
      }
    }
    from += slice.length;
  }
  return sum;
}

TEST(EngagementCulling, AgreesWithCounting) {
  const std::uint64_t seed = 603000;
  const int cases = 150 * longer(5);
  std::atomic<int> engaged = 0;
  std::vector<double> off(std::size_t(cases), 0.0);
  tbb::parallel_for(0, cases, [&](int i) {
    Random random(seed + std::uint64_t(i));
    const Cutter cutter = any_cutter(random, 2, 8);
    Stock stock = make_stock(BoxBlank{Vector3d(-10, -10, -12), Vector3d(10, 10, 0)},
                             Isometry3d::Identity(), {0.5, true});
    const Vector3d axis = any_axis(random);
    const Vector3d tip(random.in(-9, 9), random.in(-9, 9), random.in(-4, 0));
    const Vector3d feed = (Vector3d(random.in(-1, 1), random.in(-1, 1), 0) +
                           (random.once_in(2) ? random.decades(-9, 0) : 0.0) * random.any())
                              .normalized();
    remove(stock, cutter, {pose(tip - 15 * feed, axis), pose(tip - 0.7 * feed, axis), 1, false});
    double sum = 0.0, whole = 0.0;
    const Engagement found = engagement(stock, cutter, pose(tip, axis), feed);
    for (const EngagedArc& arc : found.arcs)
      sum += found.slices[std::size_t(arc.slice)].length * (arc.to - arc.from);
    for (const EdgeSlice& slice : slices(cutter)) whole += 2 * pi * slice.length;
    const double expected = counted(stock, cutter, pose(tip, axis), feed);
    engaged += expected > 0.01 * whole;
    off[std::size_t(i)] = std::abs(sum - expected) / whole;
  });
  const auto worst = std::max_element(off.begin(), off.end());
  std::cout << "  seeds " << seed << " and on: " << cases << " poses, " << engaged
            << " engaged, off by up to " << *worst * 100 << " % of the edge at seed "
            << seed + std::uint64_t(worst - off.begin()) << "\n";
  EXPECT_LT(*worst, 0.01);
  EXPECT_GT(engaged, cases / 3);
}

// The tree over the revolutions of a turning tool against every revolution tried: a window that
// holds the whole motion leaves nothing out.

constexpr double no_turn_is_farther = 1e9;  // rad

NosePath any_path(Random& random, double feed) {
  NosePath path;
  const double height = random.some(0.05), wander = random.some(1e-3), tilt = random.some(0.1);
  const Matrix3d R = Eigen::AngleAxisd(tilt, random.any().normalized()).toRotationMatrix();
  const double from = random.decades(-1, 1.5);
  const double to = random.in(0, 3) < 1 ? 0.0 : std::max(0.0, from - 30 * feed);
  const double turns = std::min(60.0, (from - to) / feed) + 1.0;
  const double a_sample = random.decades(-1, 0.7);
  const double angle = random.in(-20, 20);
  for (double turn = 0; turn < turns; turn += a_sample) {
    const double r = std::max(to, from - feed * turn);
    const Matrix3d wandering =
        Eigen::AngleAxisd(wander, random.any().normalized()).toRotationMatrix();
    path.add(Vector3d(0.25 - 0.05 * r, height, r) + wander * random.any(), angle + two_pi * turn,
             R * wandering);
  }
  path.add(path.T_lt.back().translation(), path.spindle.back() + two_pi, path.T_lt.back().linear());
  return path;
}

TEST(TurnedCulling, LosesNothing) {
  const std::uint64_t seed = 701000;
  const int cases = 40 * longer(15);
  std::atomic<int> rays = 0, cut = 0, late = 0;
  tbb::parallel_for(0, cases, [&](int i) {
    Random random(seed + std::uint64_t(i));
    const Nose nose{random.decades(-1.3, 0.7), {}};
    const double feed = nose.radius * random.decades(-1.5, -0.3);
    const NosePath path = any_path(random, feed);
    const NoseCutSearch swept(nose, motion_of(path));
    for (int ray = 0; ray < 40; ++ray) {
      const std::size_t near = std::size_t(random.in(0, double(path.T_lt.size()) - 0.01));
      const Vector3d centre = path.T_lt[near].translation();
      const double lean = random.in(-0.3, 0.8);
      const double reach = nose.radius * (random.in(0, 3) < 1 ? 0.9999 : random.in(0.5, 1.02));
      const MeridianVertex vertex{centre.x() - std::cos(lean) * reach,
                                  std::max(0.0, centre.z() - std::sin(lean) * reach),
                                  random.in(-10, 10), std::cos(lean), std::sin(lean)};
      const Design design = design_of(std::vector<MeridianVertex>{vertex});
      const Vector3d askew = random.some(0.3) * random.any();
      const Ray in_w{design.vertices.row(0),
                     (design.normals.row(0).transpose() + askew).normalized(), 0.3};
      const auto found = swept.first(in_w);
      const auto tried = swept.first_in_window(in_w, found.value_or(NoseCut{}), no_turn_is_farther);
      ++rays;
      cut += found.has_value();
      const double s = found ? found->s : in_w.band;
      if (!tried || tried->s >= s - 1e-9) continue;
      if (++late < 10)
        ADD_FAILURE() << "seed " << seed + std::uint64_t(i) << ", ray " << ray << ": first cut at "
                      << s << ", of every revolution " << tried->s;
    }
  });
  std::cout << "  seeds " << seed << " and on: " << rays << " rays, " << cut << " cut, " << late
            << " late\n";
  EXPECT_EQ(late, 0);
  EXPECT_GT(cut, rays / 2);
}

}  // namespace
}  // namespace abbe::cutting
