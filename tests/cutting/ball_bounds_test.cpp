#include "cutting/surface/ball_entry.h"
#include "cutting/surface/entry_bounds.h"
#include "tests/cutting/any_form.h"
#include "tests/cutting/any_move.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

/// Of balls that are met from below: bounds are never above the entry, and near to it.
TEST(BallBounds, AreNoMoreThanTheEntry) {
  Random random(1801);
  long entries = 0, unknown = 0, missed = 0, rays_tried = 0;
  double highest = -1e300, lowest = 0.0;  // of bound - entry, R
  for (int n = 0; n < 60000 * longer(10); ++n) {
    const double R = random.decades(-1, 2), band = R * random.decades(-2, 0.3);
    const Cutter cutter{R, R, 3 * R};
    const Move move = any_move(random, R, [&] {
      return random.once_in(3) ? Vector3d(Vector3d::UnitZ()) : random.near(Vector3d::UnitZ(), 0.5);
    });
    const Vector3d normal = random.near(Vector3d::UnitZ(), 0.4);
    const double lean = random.decades(-9, -1);
    const BallChord chord(cutter, move, Vector3d::Zero());
    Ray8 eight;
    std::array<Ray, 8> rays;
    double far = 0.0, around = 0.0, tilt = 0.0;
    for (std::size_t i = 0; i < 8; ++i) {
      rays[i] = {R * random.decades(-6, 0) * random.any(),
                 random.turned_evenly(normal, lean * random.in(0, 1)), band};
      far = std::max(far, rays[i].point.norm());
      const Vector3d end = rays[i].point + band * rays[i].normal;
      around = std::max(around, end.norm());
      tilt = std::max(tilt, normal.cross(rays[i].normal).norm() / normal.dot(rays[i].normal));
      for (int d = 0; d < 3; ++d) {
        eight.p[d][i] = float(rays[i].point[d]);
        eight.n[d][i] = float(rays[i].normal[d]);
      }
    }
    if (!(chord.distance + far < 4.9 * R) ||
        !is_below_centre(cutter, move, Vector3d::Zero(), around, normal, tilt))
      continue;
    std::array<Entry8, 1> bounds;
    ball_bounds({&chord, 1}, eight, bounds);
    for (std::size_t i = 0; i < 8; ++i) {
      ++rays_tried;
      const double bound = bounds[0].min_s[i];
      const auto entry = first_entry(cutter, move, rays[i], band);
      unknown += bound < -1e29;
      missed += bound > 1e29;
      if (!entry || bound < -1e29) continue;
      ASSERT_LE(bound, entry->s) << "seed 1801, case " << n << ", R " << R;
      if (entry->s <= -band) continue;
      ++entries;
      highest = std::max(highest, (bound - entry->s) / R);
      lowest = std::min(lowest, (bound - entry->s) / R);
    }
  }
  std::cout << rays_tried << " rays (seed 1801): " << entries << " entries, bounds " << -highest
            << " to " << -lowest << " R below them; " << unknown << " not known, " << missed
            << " missed\n";
  EXPECT_GT(entries, rays_tried / 20);
  EXPECT_LT(unknown, rays_tried / 2);
  EXPECT_GT(lowest, -1e-2);
}

TEST(BallBounds, HoldWhereTheHeightAboveTheCentreDoes) {
  const Cutter cutter{5, 5, 20};
  Move move{Vector3d::Zero(), Vector3d(1, 0, 0), Vector3d::UnitZ(), Vector3d::UnitX()};
  const Vector3d up = Vector3d::UnitZ();
  EXPECT_TRUE(is_below_centre(cutter, move, {0, 0, 4.9}, 0.09, up, 0.1));
  EXPECT_FALSE(is_below_centre(cutter, move, {0, 0, 4.9}, 0.11, up, 0.1));
  EXPECT_TRUE(is_below_centre(cutter, move, {0, 0, 1}, 0.1, Vector3d::UnitX(), 0.0));
  EXPECT_FALSE(is_below_centre(cutter, move, {0, 0, 1}, 0.1, Vector3d::UnitX(), 0.01));
  move.step = {0, 0, -3};  // sinks past it
  EXPECT_FALSE(is_below_centre(cutter, move, {0, 0, 4}, 0.1, up, 0.1));
  EXPECT_TRUE(is_below_centre(cutter, move, {0, 0, 1.8}, 0.1, up, 0.1));
  move.step = {0, 0, 3};
  EXPECT_TRUE(is_below_centre(cutter, move, {0, 0, 4}, 0.1, up, 0.1));
}

namespace entry_bounds_cases {

Cutter any_cutter(Random& random) {
  const double R = random.decades(-1, 2);
  switch (random.below(4)) {
    case 0:
      return {R, R, R * random.in(1, 4)};
    case 1:
      return {R, 0.0, R * random.in(0.1, 4)};
    case 2:
      return {R, R * random.decades(-5, 0), R * random.in(1, 4)};
    default:
      return any_form(random, R);
  }
}

}  // namespace entry_bounds_cases

/// Of any cutter, move and ray: no bound is above the entry, and a lane is of its own pair alone.
TEST(EntryBounds, AreNoMoreThanTheEntry) {
  Random random(1802);
  long entries = 0, unknown = 0, missed = 0, tried = 0, near = 0, outside = 0;
  double highest = -1e300;
  for (int n = 0; n < 40000 * longer(20); ++n) {
    const Cutter cutter = entry_bounds_cases::any_cutter(random);
    const double R = cutter.radius;
    Move8 eight;
    std::array<Move, 8> moves;
    for (int i = 0; i < 8; ++i) {
      moves[std::size_t(i)] = any_move(random, R, [&] { return random.direction(); });
      eight.set_lane(i, cutter, move_endpoints(moves[std::size_t(i)]));
    }
    const Ray ray{R * random.decades(-6, 0.3) * random.any(), random.direction(),
                  R * random.decades(-3, 0.3)};
    EntryBounds bounds;
    entry_bounds(cutter, eight, {&ray, 1}, {&bounds, 1});
    // the same pairs in another order, behind eights of others
    std::array<Pair8, 10> pairs;
    std::array<EntryBounds, 10> of_pairs;
    for (std::size_t g = 0; g < pairs.size(); ++g)
      for (int i = 0; i < 8; ++i) pairs[g].set_lane(i, eight, g < 9 ? int(g + 3) % 8 : 7 - i, ray);
    entry_bounds(cutter, pairs, ray.band, of_pairs);
    const EntryBounds& paired = of_pairs.back();
    for (std::size_t i = 0; i < 8; ++i) {
      ++tried;
      ASSERT_EQ(paired.min_s[i], bounds.min_s[7 - i]) << "seed 1802, case " << n;
      ASSERT_EQ(paired.fraction[i], bounds.fraction[7 - i]) << "seed 1802, case " << n;
      const double bound = bounds.min_s[i];
      unknown += bound < -1e29;
      missed += bound > 1e29;
      // from a place of its own, so that the bound has no say in it
      const auto entry =
          first_entry(cutter, moves[i], ray, ray.band, float(random.in(0, 1)), -1e30f);
      if (!entry) continue;
      ++entries;
      outside += entry->s > -ray.band;
      highest = std::max(highest, (bound - entry->s) / R);
      near += entry->s > -ray.band && bound > entry->s - 1e-3 * R;
      ASSERT_LE(bound, std::max(entry->s, -ray.band))
          << "seed 1802, case " << n << ", lane " << i << ", R " << R << " r "
          << cutter.corner_radius << " form " << bool(cutter.outline) << " band " << ray.band
          << " t " << entry->t << " part " << bounds.fraction[i] << " angle " << moves[i].angle;
    }
  }
  std::cout << tried << " pairs (seed 1802): " << entries << " entries, bounds " << -highest
            << " R below them and more, " << near << " within 1e-3 R; " << unknown << " not known, "
            << missed << " missed\n";
  EXPECT_GT(entries, tried / 20);
  EXPECT_GT(near, outside / 2);
}

/// Rays beside one whose planes they are held against: what they enter is never ruled out.
TEST(MovePlanes, LeaveOpenWhatARayBesideEnters) {
  Random random(1826);
  long entries = 0, outside = 0, ruled_out = 0, tried = 0;
  for (int n = 0; n < 40000 * longer(20); ++n) {
    const Cutter cutter = entry_bounds_cases::any_cutter(random);
    const double R = cutter.radius, band = R * random.decades(-3, 0.3);
    Move8 eight;
    std::array<Move, 8> moves;
    for (int i = 0; i < 8; ++i) {
      moves[std::size_t(i)] = any_move(random, R, [&] { return random.direction(); });
      eight.set_lane(i, cutter, move_endpoints(moves[std::size_t(i)]));
    }
    const Ray middle{R * random.decades(-6, 0.3) * random.any(), random.direction(), band};
    const double around = R * random.decades(-6, 0.5), lean = random.decades(-6, 0.4);
    MovePlanes planes;
    move_planes(cutter, {&eight, 1}, middle, 1.001 * around, {&planes, 1});
    for (int k = 0; k < 4; ++k) {
      const Vector3d aside = random.any();
      const Ray ray{middle.point + around / std::max(1.0, aside.lpNorm<1>()) * aside,
                    random.turned_evenly(middle.normal, lean), band};
      for (std::size_t i = 0; i < 8; ++i) {
        ++tried;
        const auto entry = first_entry(cutter, moves[i], ray, band, float(random.in(0, 1)), -1e30f);
        const double limit = entry ? entry->s : band * random.in(-1, 1);
        const bool open = (candidates_before(planes, middle.point, ray, limit) >> i & 1u) != 0;
        ruled_out += !open;
        if (!entry) continue;
        ++entries;
        outside += entry->s > -band;
        ASSERT_TRUE(open) << "seed 1826, case " << n << ", lane " << i << ", R " << R << " r "
                          << cutter.corner_radius << " form " << bool(cutter.outline) << " band "
                          << band << " around " << around << " lean " << lean << " s " << entry->s;
      }
    }
  }
  std::cout << tried << " pairs (seed 1826): " << entries << " entries, " << outside
            << " of them from outside; ruled out of the others: " << ruled_out << '\n';
  EXPECT_GT(outside, tried / 40);
  EXPECT_GT(ruled_out, (tried - entries) / 2);
}

}  // namespace
}  // namespace abbe::cutting
