#include "cutting/stock/collision.h"
#include "cutting/stock/separation.h"
#include "tests/cutting/held_parts.h"
#include "tests/test.h"

namespace abbe::cutting::way_out_tests {
namespace {

using kinematics::Pose;

constexpr double resolution = 1e-3;
constexpr double sag = 5e-4;

Pose at(const Vector3d& place, const Vector3d& turn = Vector3d::Zero()) {
  Pose T(kinematics::rotation(turn));
  T.pretranslate(place);
  return T;
}

ClosedMesh mesh_of(const held_parts::Quads& quads) {
  const Design design = quads.design();
  return {design.vertices, design.triangles, 0.0};
}

/// Every triangle as four, some times over.
ClosedMesh refined(const ClosedMesh& mesh, int times) {
  if (times == 0) return mesh;
  std::vector<Vector3d> points;
  for (const auto& row : mesh.vertices.rowwise()) points.emplace_back(row.transpose());
  std::map<std::pair<int, int>, int> middles;
  const auto middle = [&](int i, int j) {
    const auto [found, is_new] = middles.emplace(std::minmax(i, j), int(points.size()));
    if (is_new) points.push_back(0.5 * (points[std::size_t(i)] + points[std::size_t(j)]));
    return found->second;
  };
  ClosedMesh next;
  next.triangles.resize(4 * mesh.triangles.rows(), 3);
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const int a = mesh.triangles(t, 0), b = mesh.triangles(t, 1), c = mesh.triangles(t, 2);
    const int ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    next.triangles.row(4 * t) << a, ab, ca;
    next.triangles.row(4 * t + 1) << ab, b, bc;
    next.triangles.row(4 * t + 2) << ca, bc, c;
    next.triangles.row(4 * t + 3) << ab, bc, ca;
  }
  next.vertices.resize(Index(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) next.vertices.row(Index(i)) = points[i];
  return refined(next, times - 1);
}

ClosedMesh cylinder(double radius, double height) {
  Eigen::MatrixX2d profile(2, 2);
  profile << radius, 0.0, radius, height;
  return revolved_mesh(profile, sag);
}

/// A body b in a body a, and the shortest translation of b out of it, which is known.
struct Known {
  std::string name;
  ClosedMesh a, b;
  Pose T_ab;
  Vector3d out;  // in the frame of a
};

const double wall = held_parts::pocket_x[0], side = held_parts::pocket_y[0],
             ground = held_parts::pocket_floor, rim = held_parts::block.z();
const double mid_x = 20.0, mid_y = 15.5;

ClosedMesh pocket() {
  return mesh_of(held_parts::pocketed(held_parts::pocket_x, held_parts::pocket_y, ground));
}

std::vector<Known> in_a_pocket() {
  const ClosedMesh a = pocket(), shank = cylinder(5.0, 40.0);
  const auto shank_at = [&](const std::string& name, const Vector3d& tip, const Vector3d& out,
                            const Vector3d& lean = Vector3d::Zero()) {
    return Known{name, a, shank, at(tip, lean), out};
  };
  std::vector<Known> all;
  for (const double d : {0.02, 0.5, 2.0}) {
    all.push_back(shank_at("wall", {wall + 5 - d, mid_y, 12}, {d, 0, 0}));
    all.push_back(shank_at("floor", {mid_x, mid_y, ground - d}, {0, 0, d}));
    all.push_back(
        shank_at("wall and wall", {wall + 5 - d, side + 5 - 0.7 * d, 12}, {d, 0.7 * d, 0}));
    all.push_back(
        shank_at("wall and floor", {wall + 5 - d, mid_y, ground - 0.3 * d}, {d, 0, 0.3 * d}));
    all.push_back(shank_at("two walls and floor",
                           {wall + 5 - d, side + 5 - 0.7 * d, ground - 0.4 * d},
                           {d, 0.7 * d, 0.4 * d}));
  }
  for (const double lean : {0.02, 0.3}) {
    const double d = 0.4, c = std::cos(lean), s = std::sin(lean);
    // over the rim: the flank is met by the edge, across the axis
    const Vector3d across(c, 0, s), axis(-s, 0, c), edge(wall, mid_y, rim);
    all.push_back(shank_at("leaning over the rim", edge + (5 - d) * across - 8.0 * axis, d * across,
                           {0, -lean, 0}));
    // into the wall: the end is the foremost, its edge
    all.push_back(
        shank_at("leaning into the wall", {wall + 5 * c - d, mid_y, 13}, {d, 0, 0}, {0, lean, 0}));
  }
  return all;
}

std::vector<Known> in_grooves() {
  std::vector<Known> all;
  Eigen::MatrixX2d vee(7, 2);
  // opening 90 degrees, 10 mm deep
  vee << -30, -20, 30, -20, 30, 0, 10, 0, 0, -10, -10, 0, -30, 0;
  const ClosedMesh groove = extruded_mesh(vee, 60.0);
  const double R = 3.0, r = std::sqrt(0.5);
  for (const auto& [d, e] : {std::pair(0.3, 0.3), std::pair(0.5, 0.1)}) {
    const Vector3d left(r, r, 0), right(-r, r, 0), bottom(0, -10, 30);
    all.push_back({"ball in a groove", groove, sphere_mesh(R, sag),
                   at(bottom + (R - d) * left + (R - e) * right), d * left + e * right});
  }
  for (const auto& [gap, d, e] :
       {std::tuple(0.02, 3.0, 0.0), std::tuple(0.02, 3.0, 0.005), std::tuple(1.0, 4.0, 0.4)}) {
    const double width = held_parts::pocket_x[1] - wall;
    all.push_back({"box in a slot",
                   pocket(),
                   box_mesh({width - gap, 10, 30}),
                   at({wall + 0.5 * (width - gap) - e, mid_y, ground + 15 - d}),
                   {e, 0, d}});
  }
  const double width = held_parts::pocket_x[1] - wall;
  all.push_back({"box in a narrower slot",
                 pocket(),
                 box_mesh({width + 0.4, 10, 30}),
                 at({wall + 0.5 * width, mid_y, ground + 15 + 2}),
                 {0, 0, rim - ground - 2}});
  return all;
}

/// A tube on z = 0.
ClosedMesh tube(double inner, double outer, double height, int around) {
  held_parts::Quads quads;
  const auto corner = [&](double r, int k, double z) {
    const double f = 2 * std::numbers::pi * (k % around) / around;
    return Vector3d(r * std::cos(f), r * std::sin(f), z);
  };
  for (int k = 0; k < around; ++k) {
    const auto quad = [&](double r, double z, double s, double w) {
      quads.add(corner(r, k, z), corner(r, k + 1, z), corner(s, k + 1, w), corner(s, k, w));
    };
    quad(outer, 0, outer, height);
    quad(outer, height, inner, height);
    quad(inner, height, inner, 0);
    quad(inner, 0, outer, 0);
  }
  return mesh_of(quads);
}

/// z = (x^2 - y^2) / 2 R over a square, its bottom flat.
ClosedMesh saddle(double R, double half, int n) {
  held_parts::Quads quads;
  const auto top = [&](int i, int j) {
    const double x = half * (2.0 * i / n - 1), y = half * (2.0 * j / n - 1);
    return Vector3d(x, y, (x * x - y * y) / (2 * R));
  };
  const auto bottom = [&](int i, int j) {
    const Vector3d p = top(i, j);
    return Vector3d(p.x(), p.y(), -2 * half);
  };
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      quads.add(top(i, j), top(i + 1, j), top(i + 1, j + 1), top(i, j + 1));
      quads.add(bottom(i, j), bottom(i, j + 1), bottom(i + 1, j + 1), bottom(i + 1, j));
    }
    quads.add(bottom(i, 0), bottom(i + 1, 0), top(i + 1, 0), top(i, 0));
    quads.add(bottom(i + 1, n), bottom(i, n), top(i, n), top(i + 1, n));
    quads.add(bottom(0, i + 1), bottom(0, i), top(0, i), top(0, i + 1));
    quads.add(bottom(n, i), bottom(n, i + 1), top(n, i + 1), top(n, i));
  }
  return mesh_of(quads);
}

std::vector<Known> on_round_bodies() {
  std::vector<Known> all;
  const double d = 0.15;
  all.push_back(
      {"through-hole", tube(5, 20, 20, 400), cylinder(4.0, 60.0), at({1 + d, 0, -20}), {-d, 0, 0}});
  const Vector3d slant = Vector3d(1, 2, 5).normalized();
  all.push_back({"ball on a dome", sphere_mesh(40.0, 2e-3), sphere_mesh(6.0, sag),
                 at((46 - d) * slant), d * slant});
  all.push_back({"cylinder on a dome",
                 sphere_mesh(40.0, 2e-3),
                 cylinder(6.0, 30.0),
                 at({0, 0, 40 - d}),
                 {0, 0, d}});
  all.push_back({"ball on a saddle",
                 saddle(30, 10, 80),
                 sphere_mesh(5.0, sag),
                 at({0, 0, 5 - d}),
                 {0, 0, d}});
  return all;
}

std::vector<Known> in_solid_bodies() {
  std::vector<Known> all;
  const ClosedMesh block = box_mesh({40, 30, 20});
  all.push_back({"wholly inside", block, sphere_mesh(3.0, sag), at({14, 2, 5}), {0, 0, 8}});
  all.push_back({"wholly inside", block, sphere_mesh(3.0, sag), at({-17, 2, 3}), {-6, 0, 0}});
  const ClosedMesh plate = box_mesh({100, 80, 1});
  all.push_back({"through a plate", plate, cylinder(5, 60), at({10, 5, -7}), {0, 0, 7.5}});
  all.push_back({"through a plate", plate, cylinder(5, 60), at({48, 5, -30}), {7, 0, 0}});
  Eigen::MatrixX2d fork(8, 2);
  fork << -25, -20, 25, -20, 25, 20, 10, 20, 10, -10, -10, -10, -10, 20, -25, 20;
  Eigen::MatrixX2d holder(6, 2);
  holder << 8, 0, 8, 25, 9, 40, 20, 40, 22, 60, 22, 90;
  // between the fork's arms, its flange in them
  all.push_back({"holder in a clamp",
                 extruded_mesh(fork, 30.0),
                 revolved_mesh(holder, sag),
                 at({0, 0, 30 - 40 - 0.7}),
                 {0, 0, 0.7}});
  return all;
}

double took_ms = 0.0;

Penetration timed(const Body& a, const Pose& T_a, const Body& b, const Pose& T_b) {
  const auto start = std::chrono::steady_clock::now();
  const Penetration out = penetration(a, T_a, b, T_b, resolution);
  took_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return out;
}

void expect_known(const Known& known, std::mt19937& random) {
  const double expected = known.out.norm();
  for (const int times : {0, 3}) {
    if (times > 0 && known.a.triangles.rows() > 4000) continue;  // it has many
    const ClosedMesh mesh = refined(known.a, times);
    const Body a = make_body(mesh), b = make_body(known.b);
    double worst = 0.0, longest = 0.0;
    for (int n = 0; n < 3; ++n) {
      const Pose T_a = n == 0 ? Pose::Identity() : held_parts::any_pose(random);
      const Penetration out = timed(a, T_a, b, T_a * known.T_ab);
      longest = std::max(longest, took_ms);
      const Penetration back = timed(b, T_a * known.T_ab, a, T_a);
      longest = std::max(longest, took_ms);
      for (const double depth : {out.depth, back.depth}) {
        worst = std::max(worst, std::abs(depth - expected));
        EXPECT_NEAR(depth, expected, 4e-3) << known.name << ", " << mesh.triangles.rows();
      }
      const Vector3d way = T_a.linear().transpose() * out.direction;
      EXPECT_NEAR(way.dot(known.out) / expected, 1.0, 1e-3) << known.name;
    }
    std::cout << known.name << " " << expected << " mm, " << mesh.triangles.rows()
              << " triangles: within " << worst << " mm, " << longest << " ms\n";
  }
}

void expect_all(const std::vector<Known>& all, unsigned seed) {
  std::cout << "seed " << seed << "\n";
  std::mt19937 random(seed);
  for (const Known& known : all) expect_known(known, random);
}

TEST(Penetration, OfAPocketIsTheShortest) { expect_all(in_a_pocket(), 301); }
TEST(Penetration, OfAGrooveLeavesEveryWall) { expect_all(in_grooves(), 302); }
TEST(Penetration, OfRoundBodiesIsAcrossThem) { expect_all(on_round_bodies(), 303); }
TEST(Penetration, OfSolidBodiesIsTheShortest) { expect_all(in_solid_bodies(), 304); }

TEST(Penetration, OfACutterInPiecesIsThatOfItsSurface) {
  constexpr unsigned seed = 306;
  std::mt19937 random(seed);
  std::cout << "seed " << seed << "\n";
  Cutter ball{5.0, 5.0, 20.0}, bull{5.0, 1.0, 20.0};
  for (const Cutter& cutter : {ball, bull})
    for (const int times : {0, 3}) {
      const Body a = make_body(refined(pocket(), times)), b = make_body(cutter_meshes(cutter, sag));
      const double d = 0.3;
      const Pose T_a = held_parts::any_pose(random);
      for (const auto& [tip, depth] :
           {std::pair(Vector3d(wall + 5 - d, mid_y, 12), d),
            std::pair(Vector3d(mid_x, mid_y, ground - d), d),
            std::pair(Vector3d(wall + 5 - d, side + 5 - d, ground - d), std::sqrt(3.0) * d)})
        EXPECT_NEAR(timed(a, T_a, b, T_a * at(tip)).depth, depth, 4e-3);
    }
}

TEST(Penetration, OfAPartWithSeamsLeavesIt) {
  // every triangle has vertices of its own, equal but for rounding
  std::mt19937 random(307);
  std::uniform_real_distribution<double> any(-1, 1);
  const ClosedMesh whole = box_mesh({40, 30, 20});
  ClosedMesh seams;
  seams.vertices.resize(3 * whole.triangles.rows(), 3);
  seams.triangles.resize(whole.triangles.rows(), 3);
  for (Index t = 0; t < whole.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const Vector3d noise(any(random), any(random), any(random));
      seams.vertices.row(3 * t + k) =
          whole.vertices.row(whole.triangles(t, k)) + 1e-14 * noise.transpose();
      seams.triangles(t, k) = int(3 * t + k);
    }
  const Body a = make_body(seams), b = make_body(sphere_mesh(3.0, sag));
  const Pose I = Pose::Identity();
  EXPECT_TRUE(is_inside(a, I, b, at({14, 2, 5})));
  EXPECT_FALSE(is_inside(a, I, b, at({14, 2, 15})));
  EXPECT_NEAR(penetration(a, I, b, at({14, 2, 5})).depth, 8.0, 4e-3);
  EXPECT_EQ(penetration(a, I, b, at({14, 2, 15})).depth, 0.0);
  EXPECT_THROW(penetration(a, I, b, I, 0.0), std::invalid_argument);
}

TEST(Penetration, OfAStockIsTheShortest) {
  constexpr unsigned seed = 308;
  std::mt19937 random(seed);
  const Pose T_wk = held_parts::any_pose(random);
  constexpr double spacing = 0.25;
  Stock stock = held_parts::full_block(T_wk, spacing);
  held_parts::mill_pocket(stock, ground, ground, held_parts::pocket_x, held_parts::pocket_y);
  const StockMesh mesh = stock_mesh(stock);
  const Body a = make_patched_body({mesh.vertices_w, mesh.triangles, 0.0}, 32 * spacing);
  const Body b = make_body(cylinder(5.0, 60.0));
  std::cout << "seed " << seed << ", " << mesh.triangles.rows() << " triangles\n";
  for (const auto& [tip, depth] :
       {std::pair(Vector3d(wall + 4.5, mid_y, 12), 0.5),
        std::pair(Vector3d(wall + 3, mid_y, 12), 2.0),
        std::pair(Vector3d(mid_x, mid_y, ground - 0.02), 0.02),
        std::pair(Vector3d(mid_x, mid_y, ground - 2), 2.0),
        std::pair(Vector3d(wall + 4.5, side + 4.7, 12), std::hypot(0.5, 0.3)),
        std::pair(Vector3d(36, mid_y, 2), 9.0)}) {
    EXPECT_NEAR(timed(a, Pose::Identity(), b, T_wk * at(tip)).depth, depth, 4e-3);
    std::cout << depth << " mm in " << took_ms << " ms\n";
  }
}

/// An extruded star, or a ball of flat faces with dents.
ClosedMesh random_body(std::mt19937& random) {
  std::uniform_real_distribution<double> share(0.3, 1.0);
  if (random() % 2 == 0) {
    const int n = 5 + int(random() % 6);
    Eigen::MatrixX2d outline(n, 2);
    for (int i = 0; i < n; ++i) {
      const double f = 2 * std::numbers::pi * i / n, r = 6.0 * share(random);
      outline.row(i) << r * std::cos(f), r * std::sin(f);
    }
    return extruded_mesh(outline, 8.0 * share(random));
  }
  ClosedMesh ball = sphere_mesh(6.0, 0.8);
  for (auto row : ball.vertices.rowwise()) row *= share(random);
  return ball;
}

/// The first translation along a direction that parts two bodies, by small steps and halving; none
/// before a limit.
double first_parted(const Body& a, const Body& b, const Pose& T_ab, const Vector3d& direction,
                    double limit) {
  const auto is_apart = [&](double way) {
    Pose T = T_ab;
    T.pretranslate(way * direction);
    return gap(a, Pose::Identity(), b, T, {0.0, 2e-5}).distance > 1e-5 &&
           !is_inside(a, Pose::Identity(), b, T);
  };
  constexpr double step = 0.05;
  double way = step;
  while (way < limit && !is_apart(way)) way += step;
  if (way >= limit) return limit;
  double met = way - step;
  while (way - met > 1e-4) (is_apart(0.5 * (met + way)) ? way : met) = 0.5 * (met + way);
  return way;
}

/// The shortest way out, tried in many directions, then around the best of them.
double tried_depth(const Body& a, const Body& b, const Pose& T_ab, std::mt19937& random) {
  constexpr int all = 800, around = 100;
  double best = 40.0;
  Vector3d direction = Vector3d::UnitZ();
  const auto look = [&](const Vector3d& one) {
    const double way = first_parted(a, b, T_ab, one, best);
    if (way < best) direction = one;
    best = std::min(best, way);
  };
  for (int i = 0; i < all; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / all, r = std::sqrt(1.0 - z * z), f = 2.399963 * i;
    look({r * std::cos(f), r * std::sin(f), z});
  }
  std::normal_distribution<double> normal;
  for (const double spread : {0.1, 0.03, 0.01, 3e-3})
    for (int i = 0; i < around; ++i)
      look((direction + spread * Vector3d(normal(random), normal(random), normal(random)))
               .normalized());
  return best;
}

TEST(Penetration, IsThatOfManyDirectionsTried) {
  constexpr unsigned seed = 305;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1, 1);
  int count = 0, close = 0, less = 0;
  double most = 0.0, deepest_less = 0.0, took = 0.0;
  const int scenes = std::getenv("ABBE_LONG") != nullptr ? 150 : 12;
  for (int n = 0; n < scenes; ++n) {
    const Body a = make_body(random_body(random)), b = make_body(random_body(random));
    const Pose T_a = held_parts::any_pose(random);
    const Pose T_ab = at(6.0 * Vector3d(any(random), any(random), any(random)),
                         3.0 * Vector3d(any(random), any(random), any(random)));
    const Penetration out = timed(a, T_a, b, T_a * T_ab);
    if (out.depth == 0.0) continue;
    ++count;
    took += took_ms;
    const double tried = tried_depth(a, b, T_ab, random);
    EXPECT_LT(tried, 40.0);
    deepest_less = std::max(deepest_less, tried - out.depth);
    if (out.depth < tried - resolution) ++less;
    if (out.depth < 1.1 * tried + 0.01) ++close;
    most = std::max(most, out.depth / tried);
    // and it is a way out
    Pose T = T_a * T_ab;
    T.pretranslate(out.depth * out.direction);
    EXPECT_GT(gap(a, T_a, b, T).distance, 0.0) << n;
    EXPECT_FALSE(is_inside(a, T_a, b, T)) << n;
  }
  std::cout << "seed " << seed << ": " << close << " of " << count << " within a tenth of "
            << "what was tried, at most " << most << " times it; " << less << " shorter, by up to "
            << deepest_less << " mm; " << took / count << " ms each\n";
  EXPECT_GT(count, scenes / 2);
  EXPECT_GE(close, 0.95 * count);
}

}  // namespace
}  // namespace abbe::cutting::way_out_tests
