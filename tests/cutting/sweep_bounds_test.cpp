#include "cutting/surface/sweep_bounds.h"
#include <tbb/parallel_for.h>
#include <mutex>
#include "tests/cutting/any_form.h"
#include "tests/test.h"

// Bounds under attack: a search for the cutter, move and ray at which a bound errs most. It starts
// at random and climbs, so that it comes where no sample would.
namespace abbe::cutting {
namespace {

using Real = long double;
using Vector = Eigen::Matrix<Real, 3, 1>;

/// What a situation is made of, each number in 0 .. 1.
constexpr int genes = 31;
using Genes = std::array<double, genes>;

double decades(double low, double high, double gene) {
  return std::pow(10.0, low + (high - low) * gene);
}
Vector3d direction(double around, double along) {
  const double z = 2 * along - 1, rho = std::sqrt(std::max(0.0, 1 - z * z));
  return {rho * std::cos(2 * pi * around), rho * std::sin(2 * pi * around), z};
}
Vector3d turned(const Vector3d& v, double angle, double around) {
  const Vector3d x = v.unitOrthogonal(), y = v.cross(x);
  return (std::cos(angle) * v +
          std::sin(angle) * (std::cos(2 * pi * around) * x + std::sin(2 * pi * around) * y))
      .normalized();
}

struct Situation {
  Cutter cutter;
  std::array<Move, 2> moves;
  Ray ray;
};

Move move_between(const Vector3d& tip, const Vector3d& axis, const Vector3d& step, double turn,
                  double around) {
  CutterMotion motion{Points(2, 3), Points(2, 3), Vector2d(0, 1), {1, 1}};
  motion.tip.row(0) = tip;
  motion.tip.row(1) = tip + step;
  motion.axis.row(0) = axis;
  motion.axis.row(1) = turn > 0 ? turned(axis, turn, around) : axis;
  return move_after(motion, 0);
}

Situation situation(const Genes& g) {
  Situation s;
  const double R = decades(-1, 2, g[0]);
  const double r = g[1] < 0.15 ? R : g[1] < 0.45 ? 0.0 : R * g[2];
  s.cutter = {R, r, r + R * decades(-2, 1, g[3])};
  if (g[1] > 0.8) {
    Random of_form(std::uint64_t(1e6 * g[2]));
    s.cutter = any_form(of_form, R);
  }
  const Vector3d up = g[4] < 0.5 ? Vector3d::UnitZ().eval() : direction(g[5], g[6]);
  const Vector3d axis = g[7] < 0.1 ? up : turned(up, decades(-9, 0, g[8]), g[9]);
  const Vector3d origin =
      g[10] < 0.6 ? Vector3d::Zero().eval() : Vector3d(1000 * direction(g[11], g[12]));
  const double turn = g[13] < 0.4 ? 0.0 : decades(-9, std::log10(0.05), g[14]);
  const Vector3d step = g[15] < 0.05 ? Vector3d::Zero().eval()
                                     : Vector3d(decades(-9, 2, g[16]) * direction(g[17], g[18]));
  const Vector3d apart = decades(-3, 3, g[19]) * direction(g[20], g[21]);
  s.moves = {move_between(origin, axis, step, turn, g[22]),
             move_between(origin + apart, axis, step, turn, g[22])};
  const Move& aim = s.moves[g[23] < 0.5 ? 0 : 1];
  const Vector3d to_end = direction(g[24], g[25]);
  const Vector3d end = aim.tip + g[30] * aim.step + r * axis + decades(-2, 2.5, g[26]) * to_end;
  const Vector3d normal = turned(to_end, pi * decades(-9, 0, g[27]), g[28]);
  const double band = decades(-2, 2, g[29]);
  s.ray = {end - band * normal, normal, band};
  return s;
}

struct Worst {
  double error = -1e300;
  Genes at{};
};

/// The largest value of `error` that so many climbs of so many steps find.
template <class Error>
Worst climb(std::uint64_t seed, int climbs, int steps, const Error& error) {
  Worst worst;
  std::mutex mutex;
  tbb::parallel_for(0, climbs, [&](int c) {
    std::mt19937_64 random(seed + std::uint64_t(c));
    std::uniform_real_distribution<double> unit(0, 1);
    std::normal_distribution<double> normal;
    Worst best;
    for (int i = 0; i < steps; ++i) {
      Genes next = best.at;
      if (i < steps / 5) {
        for (double& gene : next) gene = unit(random);
      } else {
        const double size = std::pow(10.0, -7 * unit(random));
        const int changed = 1 + int(3 * unit(random));
        for (int k = 0; k < changed; ++k) {
          double& gene = next[std::size_t(int(genes * unit(random)) % genes)];
          gene = std::clamp(gene + size * normal(random), 0.0, 1.0);
        }
      }
      const double found = error(next);
      if (found > best.error) best = {found, next};
    }
    const std::lock_guard lock(mutex);
    if (best.error > worst.error) worst = best;
  });
  return worst;
}

// ---- the tree's bounds --------------------------------------------------------------------------

/// How far an outline reaches, by its points and arcs.
Real outline_along(const ToolOutline& outline, Real along, Real across) {
  Real most = 0;
  for (const OutlineSegment& piece : outline.segments) {
    most = std::max(most, piece.to.x() * across + piece.to.y() * along);
    if (piece.radius == 0.0) continue;
    const Real angle = std::atan2(along, across);
    const Real from = std::atan2(Real(piece.normal_from.y()), Real(piece.normal_from.x()));
    const Real to = std::atan2(Real(piece.normal_to.y()), Real(piece.normal_to.x()));
    if (angle < from || angle > to) continue;
    const Real x = piece.from.x() - Real(piece.radius) * piece.normal_from.x();
    const Real y = piece.from.y() - Real(piece.radius) * piece.normal_from.y();
    most = std::max(most, x * across + y * along + piece.radius * std::hypot(along, across));
  }
  return most;
}

/// How far along m the cutter reaches over a move, by the definition of a support, at 33 instants.
Real reach_along(const Vector& m, const Cutter& cutter, const Move& move) {
  const Real r = cutter.corner_radius, R = cutter.radius, flank = cutter.flank_length;
  const Vector axis = move.axis.cast<Real>(), side = move.side.cast<Real>();
  Real most = -std::numeric_limits<Real>::infinity();
  for (int i = 0; i <= 32; ++i) {
    const Real t = i / Real(32);
    const Vector u = std::cos(t * Real(move.angle)) * axis + std::sin(t * Real(move.angle)) * side;
    const Vector tip = move.tip.cast<Real>() + t * move.step.cast<Real>();
    const Real along = m.dot(u), across = m.cross(u).norm();
    if (cutter.outline) {
      most = std::max(most, m.dot(tip) + outline_along(*cutter.outline, along, across));
      continue;
    }
    const Real body =
        along > 0 ? flank * along + R * across : r * along + r * m.norm() + (R - r) * across;
    most = std::max(most, m.dot(tip) + body);
  }
  return most;
}

/// By how much a bound is too large, as a share of the doubt that it allows itself. Below 1 it
/// never rules out a cutter that meets the ray.
double fraction_of_error_bound(const Clearance& clearance, const Situation& s, const RayEnd& end,
                               std::span<const Move> moves) {
  if (!(clearance.error_bound > 0)) return -1e300;
  const Vector m = clearance.direction.cast<Real>();
  const Vector q = Vector3d(end.point).cast<Real>();
  Real gap = std::numeric_limits<Real>::infinity();
  for (const Move& move : moves) {
    // of the ray, what a cutter can reach at all
    const Real away = (q - move.tip.cast<Real>()).norm() + move.step.norm() + 2 * s.cutter.radius +
                      s.cutter.flank_length;
    const Real length = std::min<Real>(2 * Real(s.ray.band), away);
    const Real behind = std::max<Real>(0, m.dot(s.ray.normal.cast<Real>())) * length;
    gap = std::min(gap, m.dot(q) - behind - reach_along(m, s.cutter, move));
  }
  return double((Real(clearance.gap) - gap) / Real(clearance.error_bound));
}

struct Made {
  SweepLeaves leaves;
  SweepNode node, above;
  Vector3d centre;
  double reach;
};

Made made(const Situation& s) {
  Made all;
  all.leaves.moves.resize(2);
  all.leaves.frames.resize(2);
  for (std::size_t l = 0; l < 2; ++l) fill_leaf(all.leaves, l, s.cutter, {&s.moves[l], 1});
  Eigen::Matrix<double, 3, 4> tips;
  tips << s.moves[0].tip, s.moves[0].tip + s.moves[0].step, s.moves[1].tip,
      s.moves[1].tip + s.moves[1].step;
  const Vector3d low = tips.rowwise().minCoeff(), high = tips.rowwise().maxCoeff();
  all.centre = 0.5 * (low + high);
  all.reach = 0.5 * (high - low).lpNorm<1>() + 4 * s.cutter.radius + s.cutter.flank_length;
  for (int i = 0; i < SweepNode::width; ++i)
    fill_child(all.node, i, sweep_bounds(all.leaves, std::size_t(std::min(i, 1))), all.centre);
  for (int i = 0; i < SweepNode::width; ++i)
    fill_child(all.above, i, sweep_bounds(all.node, 2, all.centre, all.leaves, 0, 2), all.centre);
  return all;
}

TEST(SweepBounds, OfMovesStayWithinTheirDoubtUnderAttack) {
  const std::uint64_t seed = 501000;
  const Worst worst = climb(seed, 64 * longer(5), 1500, [](const Genes& at) {
    const Situation s = situation(at);
    SweepLeaves leaves;
    leaves.moves.resize(1);
    leaves.frames.resize(1);
    fill_leaf(leaves, 0, s.cutter, s.moves);
    const RayEnd end(s.cutter, s.ray, s.ray.band, s.moves[0].tip, 0.0);
    const auto all = clearances(leaves.moves[0], leaves.frames[0], end);
    double most = -1e300;
    for (std::size_t i = 0; i < 2; ++i)
      most = std::max(most, fraction_of_error_bound(all[i], s, end, {&s.moves[i], 1}));
    return most;
  });
  std::cout << "  seeds " << seed << " and on: " << worst.error << " of the doubt\n";
  EXPECT_LT(worst.error, 1.0);
  EXPECT_GT(worst.error, 0.02) << "the attack is blunt";
}

TEST(SweepBounds, OfNodesStayWithinTheirDoubtUnderAttack) {
  const std::uint64_t seed = 502000;
  const Worst worst = climb(seed, 64 * longer(5), 1000, [](const Genes& at) {
    const Situation s = situation(at);
    const Made all = made(s);
    const RayEnd end(s.cutter, s.ray, s.ray.band, all.centre, all.reach);
    const auto of_node = clearances(all.node, end);
    double most = fraction_of_error_bound(clearances(all.above, end)[0], s, end, s.moves);
    for (std::size_t i = 0; i < 2; ++i)
      most = std::max(most, fraction_of_error_bound(of_node[i], s, end, {&s.moves[i], 1}));
    return most;
  });
  std::cout << "  seeds " << seed << " and on: " << worst.error << " of the doubt\n";
  EXPECT_LT(worst.error, 1.0);
  EXPECT_GT(worst.error, 0.02) << "the attack is blunt";
}

/// A ray through the middle of a ball beyond which it ends: the plane that is left of the direction
/// from the middle once it is turned across the ray is rounding alone.
/// Rays in a box that lean from each other, one of which meets the skin of a tool on its way.
TEST(SweepBounds, OfRaysBesideEachOtherLeaveOpenWhatOneOfThemMeets) {
  Random random(1802);
  int closed_moves = 0, closed_nodes = 0;
  const int cases = 200000 * longer(10);
  for (int n = 0; n < cases; ++n) {
    const double R = random.decades(-1, 2);
    const double corners[] = {R, 0.0, R * random.in(0, 1)};
    const Cutter cutter{R, corners[random.below(3)], R * random.in(1, 4)};
    Move move;
    move.tip = R * random.in(0, 3) * random.direction();
    move.step = R * random.some(3.0) * random.direction();
    move.axis = random.direction();
    move.side = move.axis.unitOrthogonal();
    move.angle = random.some(0.05);
    SweepLeaves leaves{std::vector<SweepLeaf>(1), std::vector<SweepLeafFrame>(1)};
    fill_leaf(leaves, 0, cutter, {&move, 1});
    SweepNode node;
    for (int i = 0; i < SweepNode::width; ++i)
      fill_child(node, i, sweep_bounds(leaves, 0), Vector3d::Zero());
    // a place on the skin, at some instant
    const double t = random.in(0, 1), around = random.in(-pi, pi);
    const Vector3d u = std::cos(t * move.angle) * move.axis + std::sin(t * move.angle) * move.side;
    const Vector3d x = u.unitOrthogonal();
    const Vector3d aside = std::cos(around) * x + std::sin(around) * u.cross(x);
    const double kappa = random.in(0, pi / 2), ring = R - cutter.corner_radius;
    Vector3d place = move.tip + t * move.step;
    if (random.once_in(2))
      place += R * aside + random.in(cutter.corner_radius, cutter.flank_length) * u;
    else
      place += (ring + cutter.corner_radius * std::sin(kappa)) * aside +
               cutter.corner_radius * (1 - std::cos(kappa)) * u;
    // a ray that runs to it, and goes on to where it is cut off
    const Vector3d middle = random.direction();
    const double lean = random.decades(-6, -0.2);
    const Vector3d normal = random.turned_evenly(middle, lean);
    const double before = R * random.decades(-3, 1), after = R * random.decades(-6, 1);
    Matrix3d axes;
    axes.col(2) = middle;
    axes.col(0) = middle.unitOrthogonal();
    axes.col(1) = middle.cross(axes.col(0));
    const auto end = [&](const Vector3d& at, double sense) {
      const Vector3d halves = R * random.decades(-6, 0) * Vector3d(1, 1, random.in(0, 1));
      const Vector3d offset = halves.cwiseProduct(random.any());
      const Ray ray{at + axes * offset, sense * middle, 1.0};
      return PatchEnd({cutter, ray, 0.0, Vector3d::Zero(), 12 * R}, axes, halves, std::tan(lean));
    };
    const PatchSegment rays{end(place + after * normal, 1.0), end(place - before * normal, -1.0)};
    closed_moves += (candidate_moves(leaves.moves[0], leaves.frames[0], rays).bits & 1u) == 0;
    closed_nodes += (candidate_children(node, rays).bits & 1u) == 0;
  }
  std::cout << cases << " rays that meet a tool (seed 1802), ruled out: " << closed_moves
            << " moves, " << closed_nodes << " nodes\n";
  EXPECT_EQ(closed_moves, 0);
  EXPECT_EQ(closed_nodes, 0);
}

TEST(SweepBounds, OfABallThatTheRayRunsThroughAreOpen) {
  std::mt19937_64 random(503);
  std::normal_distribution<double> normal;
  int closed = 0;
  for (int i = 0; i < 100000; ++i) {
    const Vector3d n = Vector3d(normal(random), normal(random), normal(random)).normalized();
    const Cutter ball{0.5, 0.5, 3.0};
    const Vector3d middle(normal(random), normal(random), normal(random));
    const Vector3d axis =
        (n + 0.3 * Vector3d(normal(random), normal(random), normal(random))).normalized();
    const Move move = move_between(middle - 0.5 * axis, axis, Vector3d::Zero(), 0.0, 0.0);
    const Ray ray{middle - 0.5 * n, n, 2.0};
    SweepLeaves leaves;
    leaves.moves.resize(1);
    leaves.frames.resize(1);
    fill_leaf(leaves, 0, ball, {&move, 1});
    SweepNode node;
    for (int child = 0; child < 8; ++child)
      fill_child(node, child, sweep_bounds(leaves, 0), move.tip);
    const RaySegment segment(ball, ray, ray.band, move.tip, 5.0);
    closed += candidate_moves(leaves.moves[0], leaves.frames[0], segment).bits == 0 ||
              candidate_children(node, segment).bits == 0;
  }
  EXPECT_EQ(closed, 0);
}

// ---- the entry of one ray into one move ---------------------------------------------------------

Move standing_at(const Move& move, double t) {
  Move stand = move;
  stand.axis = std::cos(t * move.angle) * move.axis + std::sin(t * move.angle) * move.side;
  stand.tip += t * move.step;
  stand.step.setZero();
  stand.angle = 0.0;
  return stand;
}

struct Grazing {
  Situation s;
  double t;  // at which the ray goes in by as little as the genes say
};

/// A ray that runs along the skin of the cutter as it stands at some instant, and dips into it.
Grazing grazing(const Genes& g) {
  Grazing made{situation(g), g[30]};
  const Cutter& cutter = made.s.cutter;
  const double r = cutter.corner_radius, ring = cutter.radius - r;
  const Move stand = standing_at(made.s.moves[0], made.t);
  const Vector3d x = stand.axis.unitOrthogonal(), y = stand.axis.cross(x);
  const Vector3d e = std::cos(2 * pi * g[23]) * x + std::sin(2 * pi * g[23]) * y;
  Vector3d outward = -stand.axis, place = ring * g[24] * e;
  if (g[25] < 0.3) {
    outward = e;
    place = cutter.radius * e + (r + g[24] * (cutter.flank_length - r)) * stand.axis;
  } else if (g[25] < 0.8) {
    outward = std::sin(0.5 * pi * g[24]) * e - std::cos(0.5 * pi * g[24]) * stand.axis;
    place = ring * e + r * stand.axis + r * outward;
  }
  const Vector3d u = outward.unitOrthogonal(), v = outward.cross(u);
  const double tilt = 0.5 * pi * decades(-9, 0, g[27]);
  const Vector3d along = std::cos(2 * pi * g[26]) * u + std::sin(2 * pi * g[26]) * v;
  const Vector3d normal = (std::cos(tilt) * along - std::sin(tilt) * outward).normalized();
  const double band = decades(-2, 2, g[29]);
  const Vector3d inside = stand.tip + place - cutter.radius * decades(-9, -1, g[28]) * outward;
  made.s.ray = {inside - 0.9 * (2 * g[20] - 1) * band * normal, normal, band};
  return made;
}

/// How much later the first entry is, mm, than that of any cutter that really stands on the way,
/// made thinner by what a touch may have that goes unseen: 1e-10 mm, and the second touch of a
/// turning move.
double lateness(const Grazing& grazing) {
  const Situation& s = grazing.s;
  const Move& move = s.moves[0];
  const Cutter& cutter = s.cutter;
  if (cutter.outline) return -1e300;  // held against brute force
  const double off =
      2e-10 + 0.125 * (cutter.radius + cutter.flank_length) * move.angle * move.angle;
  const Cutter thinner{cutter.radius - off, std::max(0.0, cutter.corner_radius - off),
                       cutter.flank_length - 2 * off};
  if (off > 0.1 * cutter.radius || thinner.flank_length < thinner.corner_radius) return -1e300;
  double witness = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= 33; ++i) {
    Move stand = standing_at(move, i <= 32 ? i / 32.0 : grazing.t);
    stand.tip += off * stand.axis;
    if (const auto at = first_entry(thinner, stand, s.ray, s.ray.band))
      witness = std::min(witness, at->s);
  }
  if (!std::isfinite(witness)) return -1e300;
  const auto entry = first_entry(cutter, move, s.ray, s.ray.band);
  return (entry ? entry->s : 2 * s.ray.band) - witness;
}

/// A ray along a flank that turns: it lies in the cutter at the beginning of the move and at its
/// end, and 0.3 um beside it between. What is found first is at the end, 9.5 mm later.
TEST(CutterEntry, IsFoundBeyondAGap) {
  const Cutter cutter{87.861557929056701, 1.5235627855616607, 24.669803911253133};
  Move move;
  move.tip = {434.923461556544, 614.10473308492146, -658.57190905046275};
  move.step = {0.0092778732328042679, 0.049713327819404185, -0.011482262760523554};
  move.axis = {0.0055875402067020862, 0.01953898326999727, 0.99979348243885513};
  move.side = {-0.25589592897696278, -0.96649078699605073, 0.020318272189627687};
  move.angle = 0.0042845756261982778;
  const Ray ray{{351.88803387964566, 586.07404437736182, -637.78667020478235},
                {-0.025699977813409752, 0.1056974241495396, 0.99406617771079131},
                18.811468716402672};
  const auto entry = first_entry(cutter, move, ray, ray.band);
  double standing = ray.band;
  for (int i = 0; i <= 1000; ++i)
    if (const auto at = first_entry(cutter, standing_at(move, i / 1000.0), ray, ray.band))
      standing = std::min(standing, at->s);
  ASSERT_TRUE(entry);
  EXPECT_LT(entry->s, -18.0);
  EXPECT_LE(entry->s, standing + 2e-8);
}

TEST(CutterEntry, IsNeverLateUnderAttack) {
  const std::uint64_t seed = 504000;
  const Worst worst = climb(seed, 128 * longer(8), 600 * longer(2),
                            [](const Genes& at) { return lateness(grazing(at)); });
  std::cout << "  seeds " << seed << " and on: late by " << worst.error * 1e6 << " nm\n";
  EXPECT_LE(worst.error, 2.001e-8);
}

}  // namespace
}  // namespace abbe::cutting
