// Hollow tools of revolution: their parts, the surface against brute force and closed forms, the
// search against every move tried, stock, engagement, run-out and bodies, and what is refused.

#include "cutting/stock/body.h"
#include "cutting/stock/engagement.h"
#include "cutting/surface/machined_surface.h"
#include "cutting/surface/outline.h"
#include "cutting/surface/removal.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/surface_search.h"
#include "cutting/surface/tool.h"
#include "tests/cutting/brute_pairs.h"
#include "tests/cutting/every_move.h"
#include "tests/cutting/random.h"
#include "tests/cutting/stock_parts.h"
#include "tests/oracles/brute_surface.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

namespace hollow_tools {

using Points = std::vector<OutlinePoint>;

struct Tool {
  const char* name;
  Points points;
};

const Points t_slot{{{10, 0}}, {{10, 5}}, {{4, 5}}, {{4, 20}}};

std::vector<Tool> tools() {
  return {
      {"step drill", {{{0, 0}}, {{3, 1.5}}, {{3, 8}}, {{5, 9}}, {{5, 15}}}},
      {"stepped end mill", {{{4, 0}}, {{4, 5}}, {{6, 5}}, {{6, 12}}}},
      {"T-slot cutter", t_slot},
      {"dovetail on a shank", {{{8, 0}}, {{5, 6}}, {{2.5, 6}}, {{2.5, 16}}}},
      {"grooved form cutter", {{{5, 0}}, {{5, 3}}, {{4, 4}}, {{5, 5}}, {{5, 10}}}},
      {"V with a step", {{{0, 0}}, {{3, 3}}, {{3, 5}}, {{5, 7}}, {{5, 9}}}},
      {"double angle on an arbor", {{{2, 0}}, {{2, 3}}, {{6, 5}}, {{2, 7}}, {{2, 12}}}},
      {"round corners and a neck",
       {{{9, 0}}, {{10, 1}, 1}, {{10, 4}}, {{4, 4}}, {{4, 9}}, {{6, 11}, 2}, {{6, 14}}}},
  };
}

/// What rounding, or the pen of who describes a tool, may make of a profile.
std::vector<Tool> degenerate_tools() {
  return {
      {"step of no height", {{{3, 0}}, {{3, 4}}, {{3, 4}}, {{5, 4}}, {{6, 4}}, {{6, 9}}}},
      {"step of 1e-7 mm", {{{5, 0}}, {{5, 4}}, {{5 + 1e-7, 4}}, {{5 + 1e-7, 10}}}},
      {"disc of 1e-7 mm",
       {{{3, 0}}, {{3, 4}}, {{6, 4}}, {{6, 4 + 1e-7}}, {{3, 4 + 1e-7}}, {{3, 9}}}},
      {"parts that all but touch in a point",
       {{{5, 0}}, {{5, 3}}, {{1e-3, 3}}, {{5, 3.5}}, {{5, 8}}}},
      {"groove of 1e-6 mm", {{{5, 0}}, {{5, 3}}, {{5 - 1e-6, 3.5}}, {{5, 4}}, {{5, 8}}}},
  };
}

/// The chords that stand for the arcs which bulge inwards, and all else.
Points chords_of(const Points& points) {
  Points all;
  const ToolOutline outline = tool_outline_from_points(points);
  for (const OutlineSegment& piece : outline.segments)
    if (piece.to.x() > 0.0 && (all.empty() || (piece.to - all.back().at).norm() > 1e-9))
      all.push_back({piece.to});
  return all;
}

const Points corner_rounding{{{2, 0}}, {{5, 3}, -3}, {{5, 8}}};
const Points half_round_groove{{{5, 0}}, {{5, 4}}, {{5, 10}, -3}, {{5, 20}}};

std::vector<Tool> tools_of_chords() {
  return {{"corner rounding", chords_of(corner_rounding)},
          {"half-round groove", chords_of(half_round_groove)}};
}

Cutter cutter_of(const Tool& tool) { return form_cutter(tool_outline_from_points(tool.points)); }

/// The profile in slices from point to point, whatever the engine makes of it.
std::vector<oracles::BruteLayer> layers_of(const Points& points) {
  std::vector<oracles::BruteLayer> layers;
  Vector2d last(0, 0);
  for (const OutlinePoint& point : points) {
    const double height = point.at.y() - last.y();
    if (height > 0)
      layers.push_back({last.y(), {last.x(), {{point.at.x(), height, point.radius}}}});
    last = point.at;
  }
  return layers;
}

/// mm from the axis, of the profile at a height; of several the largest.
double radius_at(const Points& points, double height) {
  double most = 0.0;
  Vector2d last(0, 0);
  for (const OutlinePoint& point : points) {
    const double low = last.y(), high = point.at.y();
    if (height >= low && height <= high) {
      if (high == low) {
        most = std::max({most, last.x(), point.at.x()});
      } else if (point.radius == 0.0) {
        most = std::max(most, last.x() + (height - low) / (high - low) * (point.at.x() - last.x()));
      }
    }
    last = point.at;
  }
  return most;
}

void hold_against_brute_force(const Tool& tool, unsigned seed, int pairs) {
  brute_pairs::hold_against_brute_force(tool.name, cutter_of(tool), layers_of(tool.points),
                                        {.seed = seed, .pairs = pairs, .most = 6000});
}

}  // namespace hollow_tools

/// Every tool against brute force in long double: the surface of one move, moving and turning.
TEST(HollowCutter, AgreesWithBruteForceToANanometre) {
  using namespace hollow_tools;
  for (const Tool& tool : tools()) hold_against_brute_force(tool, 2201, 200 * longer(50));
}

TEST(HollowCutter, AgreesWithBruteForceWhereItsProfileDegenerates) {
  using namespace hollow_tools;
  for (const Tool& tool : degenerate_tools())
    hold_against_brute_force(tool, 2202, 120 * longer(30));
}

TEST(HollowCutter, OfManyChordsAgreesWithBruteForce) {
  using namespace hollow_tools;
  for (const Tool& tool : tools_of_chords()) hold_against_brute_force(tool, 2203, 60 * longer(10));
}

/// The parts make up the profile: inside of one of them is inside of it, and the other way round,
/// and what is within a hair of a face between two of them is well inside of one.
TEST(HollowCutter, PartsMakeUpTheProfile) {
  using namespace hollow_tools;
  Random random(2203);
  for (const Tool& tool : tools()) {
    const ToolOutline outline = tool_outline_from_points(tool.points);
    const bool has_arcs = std::ranges::any_of(tool.points, [](auto& p) { return p.radius > 0; });
    ASSERT_TRUE(is_hollow(outline)) << tool.name;
    EXPECT_DOUBLE_EQ(outline.height, tool.points.back().at.y());
    for (const ToolOutline& part : outline.parts) EXPECT_FALSE(is_hollow(part));
    for (int i = 0; i < 20000 && !has_arcs; ++i) {
      const Vector2d place(random.in(0, 1.2) * outline.radius, random.in(0, 1) * outline.height);
      const double signed_depth = radius_at(tool.points, place.y()) - place.x();
      if (std::abs(signed_depth) < 1e-9) continue;
      EXPECT_EQ(distance(outline, place).value<0.0, signed_depth> 0.0)
          << tool.name << " " << place.transpose();
    }
    for (std::size_t i = 0; i + 1 < tool.points.size(); ++i) {
      const Vector2d corner = tool.points[i].at;
      const double narrowest = std::min(radius_at(tool.points, corner.y() + 1e-6),
                                        radius_at(tool.points, std::max(0.0, corner.y() - 1e-6)));
      if (i > 0 && !has_arcs) {
        EXPECT_LT(distance(outline, {0.5 * narrowest, corner.y()}).value, -1e-2) << tool.name;
      }
    }
  }
}

/// A profile that does not bend inwards is the outline that it was.
TEST(HollowCutter, OfAConvexProfileIsTheFormCutter) {
  using Points = std::vector<OutlinePoint>;
  for (const Points& points :
       {Points{{{1, 0}}, {{2.4, 0.5}, 2.4}, {{2.4, 14.5}, 20}},
        Points{{{0, 0}}, {{4, 2}}, {{4, 9}}, {{2, 9}}}, Points{{{8, 0}}, {{5, 6}}}})
    EXPECT_EQ(tool_outline_from_points(points), outline_from_points(points));
}

/// What the search through the moves of each part finds is what trying every move finds, to the
/// bit.
TEST(HollowCutter, SearchFindsWhatEveryMoveTriedFinds) {
  using namespace hollow_tools;
  Random random(2204);
  int cut = 0, rays = 0;
  for (const Tool& tool : tools())
    for (int round = 0; round < 6 * longer(20); ++round) {
      const Cutter cutter = cutter_of(tool);
      const int moves = 60;
      CutterMotion motion{Eigen::MatrixX3d(moves + 1, 3), Eigen::MatrixX3d(moves + 1, 3),
                          VectorXd::LinSpaced(moves + 1, 0, moves), std::vector<int>(moves + 1, 1)};
      const double step = random.decades(-3, 0.5),
                   turn = random.once_in(3) ? 0.0 : random.decades(-6, -1);
      Vector3d tip = random.any(), axis = random.direction();
      for (int i = 0; i <= moves; ++i) {
        motion.tip.row(i) = tip;
        motion.axis.row(i) = axis;
        tip += step * random.direction();
        if (turn > 0) axis = random.turned_evenly(axis, turn);
      }
      for (const Cutter& part : convex_parts(cutter)) {
        const SweepTree tree(part, motion);
        SweepTree::Hint hint;
        for (int i = 0; i < 40; ++i, ++rays) {
          const int at = random.below(moves);
          const double height = random.in(-0.1, 1.1) * cutter.flank_length;
          const Vector3d u = motion.axis.row(at);
          const Ray ray{
              Vector3d(motion.tip.row(at)) + height * u +
                  cutter.radius * random.in(0, 1.3) * u.cross(random.direction()).normalized(),
              random.once_in(3) ? u : random.direction(), random.decades(-1, 1)};
          const auto expected = first_removal_of_every_move(part, motion, ray);
          const auto found = tree.first_removal(ray, hint);
          ASSERT_EQ(found.has_value(), expected.has_value()) << tool.name << ", seed 2204";
          if (!found) continue;
          ++cut;
          ASSERT_EQ(found->s, expected->s) << tool.name << ", seed 2204";
          if (found->s > -ray.band) {
            ASSERT_EQ(found->move, expected->move) << tool.name;
          }
        }
      }
    }
  std::cout << rays << " rays, " << cut << " cut\n";
  EXPECT_GT(cut, rays / 5);
}

/// A straight path leaves the section of the tool: its walls where its radius is, at every height,
/// and the shoulders of a T-slot where its upper face is.
TEST(HollowCutter, OnAStraightPathLeavesItsSection) {
  using namespace hollow_tools;
  for (const Tool& tool : {Tool{"stepped end mill", {{{4, 0}}, {{4, 5}}, {{6, 5}}, {{6, 12}}}},
                           Tool{"T-slot cutter", t_slot},
                           Tool{"grooved", {{{5, 0}}, {{5, 3}}, {{4, 4}}, {{5, 5}}, {{5, 10}}}}}) {
    const Cutter cutter = cutter_of(tool);
    CutterMotion motion{Eigen::MatrixX3d(2, 3), Eigen::MatrixX3d(2, 3), Vector2d(0, 1), {1, 1}};
    motion.tip << -30, 0, 0, 30, 0, 0;
    motion.axis << 0, 0, 1, 0, 0, 1;
    constexpr double wall = 6.5;
    constexpr int count = 400;
    Design design;
    design.vertices.resize(count, 3);
    design.normals.resize(count, 3);
    for (int i = 0; i < count; ++i) {
      const double height = cutter.flank_length * (i + 0.5) / count;
      design.vertices.row(i) << 3.0 * std::sin(i), wall, height;
      design.normals.row(i) << 0, -1, 0;
    }
    const Surface surface = milled_surface(design, cutter, motion, {.band = 5.0, .progress = {}});
    for (int i = 0; i < count; ++i) {
      ASSERT_EQ(surface.status[std::size_t(i)], VertexStatus::Cut) << tool.name;
      EXPECT_NEAR(surface.residual[i], wall - radius_at(tool.points, design.vertices(i, 2)), 1e-9)
          << tool.name << " at " << design.vertices(i, 2);
    }
  }
  const Cutter cutter = form_cutter(tool_outline_from_points(t_slot));
  CutterMotion motion{Eigen::MatrixX3d(2, 3), Eigen::MatrixX3d(2, 3), Vector2d(0, 1), {1, 1}};
  motion.tip << -30, 0, 0, 30, 0, 0;
  motion.axis << 0, 0, 1, 0, 0, 1;
  Design overhang;
  overhang.vertices = Eigen::RowVector3d(0, 7, 5.25);
  overhang.normals = Eigen::RowVector3d(0, 0, -1);
  const Surface surface = milled_surface(overhang, cutter, motion);
  ASSERT_EQ(surface.status[0], VertexStatus::Cut);
  EXPECT_NEAR(surface.residual[0], 0.25, 1e-9);
  const PassGradients contacts = milled_gradients(overhang, surface, cutter, motion);
  EXPECT_NEAR(contacts.gradient(0, 2), -1.0, 1e-9);
}

/// In blocks as at once, gouges among them.
TEST(HollowCutter, AMotionInBlocksLeavesTheSame) {
  using namespace hollow_tools;
  Random random(2205);
  const Cutter cutter = form_cutter(tool_outline_from_points(t_slot));
  const int n = 200;
  CutterMotion motion{Eigen::MatrixX3d(n, 3), Eigen::MatrixX3d(n, 3),
                      VectorXd::LinSpaced(n, 0, n - 1), std::vector<int>(n, 1)};
  for (int i = 0; i < n; ++i) {
    motion.tip.row(i) << 0.3 * i - 30, 2 * std::sin(0.1 * i), 0.2 * std::cos(0.3 * i);
    motion.axis.row(i) = Vector3d(0.1 * std::sin(0.02 * i), 0.05, 1).normalized();
    motion.line[std::size_t(i)] = i;
  }
  Design design;
  design.vertices.resize(500, 3);
  design.normals.resize(500, 3);
  for (int i = 0; i < 500; ++i) {
    design.vertices.row(i) << random.in(-25, 25), random.in(2, 13), random.in(0, 8);
    design.normals.row(i) = random.direction();
  }
  const Surface whole = milled_surface(design, cutter, motion);
  const auto begin = [&]() -> MotionBlocks {
    return [&motion, from = 0]() mutable -> std::optional<MotionBlock> {
      if (from + 1 >= n) return std::nullopt;
      const int count = std::min(41, n - from);
      CutterMotion one{motion.tip.middleRows(from, count),
                       motion.axis.middleRows(from, count),
                       motion.time_s.segment(from, count),
                       {motion.line.begin() + from, motion.line.begin() + from + count}};
      from += count - 1;
      return MotionBlock{one, double(from + 1) / n};
    };
  };
  const Surface streamed = streamed_surface(design, cutter, begin);
  int cut = 0;
  for (std::size_t i = 0; i < whole.status.size(); ++i) {
    ASSERT_EQ(whole.status[i], streamed.status[i]);
    if (whole.status[i] != VertexStatus::Cut) continue;
    ++cut;
    EXPECT_EQ(whole.residual[Index(i)], streamed.residual[Index(i)]);
    EXPECT_EQ(whole.cut_line[i], streamed.cut_line[i]);
  }
  EXPECT_GT(cut, 50);
}

/// An arc that bulges inwards: chords that are nowhere smaller than the arc, and by what is said
/// larger.
/// By how much a profile is larger than its arc of 3 mm about `middle`, from `begin` over `turn`.
void expect_chords_inside(const std::vector<OutlinePoint>& points, const Vector2d& middle,
                          double begin, double turn) {
  const double R = 3.0;
  const ToolOutline outline = tool_outline_from_points(points);
  const double sag = chord_sag(points);
  EXPECT_GT(sag, 0.5 * max_chord_sag);
  EXPECT_LE(sag, max_chord_sag);
  double most = 0.0;
  for (int i = 0; i <= 5000; ++i) {
    const double angle = begin + turn * i / 5000;
    const Vector2d place = middle + R * Vector2d(-std::cos(angle), std::sin(angle));
    const double signed_depth = -distance(outline, place).value;
    EXPECT_GT(signed_depth, -1e-9) << angle;
    most = std::max(most, signed_depth);
  }
  std::cout << outline.parts.size() << " parts, " << 1e3 * most << " um larger, said " << 1e3 * sag
            << " um\n";
  EXPECT_LT(most, sag + 1e-9);
  EXPECT_GT(most, 0.9 * sag);
}

TEST(HollowCutter, ChordsOfAHollowArcLieInsideOfItByTheirSag) {
  using namespace hollow_tools;
  // the middle of a corner rounding tool's arc stands beside it
  expect_chords_inside(corner_rounding, {5, 0}, 0.0, 0.5 * pi);
  expect_chords_inside(half_round_groove, {5, 7}, -0.5 * pi, pi);
  for (const double radius : {3.0000001, 3.001, 30.0}) {
    const Points groove{{{5, 0}}, {{5, 4}}, {{5, 10}, -radius}, {{5, 20}}};
    EXPECT_LE(chord_sag(groove), max_chord_sag) << radius;
    EXPECT_GT(chord_sag(groove), 0.1 * max_chord_sag) << radius;
  }
  EXPECT_EQ(chord_sag({{{2, 0}}, {{5, 3}}, {{5, 8}}}), 0.0);
}

/// mm, from a place to the line of a profile.
double depth_in(const ToolOutline& outline, const Vector2d& place) {
  double least = std::numeric_limits<double>::infinity();
  for (const OutlineSegment& piece : outline.segments) {
    if (piece.is_arc) {
      for (int i = 0; i <= 2000; ++i) {
        const Vector2d normal =
            (piece.normal_from + i / 2000.0 * (piece.normal_to - piece.normal_from)).normalized();
        least = std::min(least,
                         (piece.from + piece.radius * (normal - piece.normal_from) - place).norm());
      }
      continue;
    }
    const Vector2d way = piece.to - piece.from;
    const double t = std::clamp((place - piece.from).dot(way) / way.squaredNorm(), 0.0, 1.0);
    least = std::min(least, (piece.from + t * way - place).norm());
  }
  return least;
}

TEST(HollowCutter, ItsCoreLiesBetweenOnceAndTwiceTheMarginDeep) {
  using namespace hollow_tools;
  std::vector<Tool> all = tools();
  for (const Tool& tool : tools_of_chords()) all.push_back(tool);
  const int steps = 5 * longer(4);  // places along a piece, its ends among them
  for (const Tool& tool : all) {
    const ToolOutline outline = tool_outline_from_points(tool.points);
    for (const double margin : {0.01, 0.1, 0.5}) {
      const InsetOutline inner = inset_hollow(outline, margin);
      double least = std::numeric_limits<double>::infinity(), most = 0.0;
      for (const OutlineSegment& piece : inner.outline.segments)
        for (int i = 0; i <= steps; ++i) {
          const Vector2d place =
              piece.from + double(i) / steps * (piece.to - piece.from) + Vector2d(0, inner.raised);
          ASSERT_LT(distance(outline, place).value, 0.0) << tool.name;
          const double depth = depth_in(outline, place);
          least = std::min(least, depth);
          if (place.x() > 0.2 * margin) most = std::max(most, depth);
        }
      std::cout << tool.name << ", " << margin << " mm: " << least / margin << " to "
                << most / margin << " times as deep, " << inner.outline.parts.size() << " parts\n";
      EXPECT_GE(least, margin - 1e-6) << tool.name;
      EXPECT_LE(most, 2.0 * margin + outline.height / 500.0) << tool.name;
    }
  }
}

TEST(HollowCutter, ProfilesThatCannotBeAreRefusedAtTheirPoint) {
  using Points = std::vector<OutlinePoint>;
  const auto refused = [](const Points& points, const char* text, const Vector2d& at) {
    try {
      tool_outline_from_points(points);
      ADD_FAILURE() << "taken: " << text;
    } catch (const OutlineError& fault) {
      EXPECT_HAS(fault.what(), text);
      EXPECT_LT((fault.at - at).norm(), 1e-9) << fault.what();
    }
  };
  EXPECT_THROW(tool_outline_from_points({}), std::invalid_argument);
  refused({{{3, 0}}, {{3, 4}}, {{5, 3}}, {{5, 9}}}, "expected a height of at least 4 mm", {5, 3});
  refused({{{3, 1}}, {{3, 4}}}, "the first point at height 0", {3, 1});
  refused({{{3, 0}}, {{0, 4}}, {{5, 9}}}, "a radius above 0", {0, 4});
  refused({{{3, 0}}, {{-1, 4}}, {{5, 9}}}, "of at least 0", {-1, 4});
  refused({{{3, 0}}, {{3, 4}}, {{6, 4}}, {{3, 4}}, {{3, 9}}}, "turn back on itself", {6, 4});
  refused({{{6, 0}}, {{3, 0}}, {{3, 4}}}, "turn back on itself", {6, 0});
  refused({{{3, 0}}, {{3, 4}}, {{6, 4}}}, "turn back on itself", {6, 4});
  refused({{{3, 0}}, {{3, 4}, 1}, {{6, 6}}}, "an arc of radius at least 2", {3, 4});
  refused({{{3, 0}}, {{3, 4}, -1}, {{6, 6}}}, "an inward arc with a radius of -2", {3, 4});
  refused({{{3, 0}}, {{3, 4}}, {{5, 4.1}, 2}, {{5, 9}}}, "between the heights of its ends",
          {5, 4.1});
  refused({{{2, 0}}, {{5, 1}, -2}, {{5, 9}}}, "between the heights of its ends", {5, 1});
  refused({{{2, 0}}, {{2, 4}}, {{5, 3}, -8}, {{5, 9}}}, "height of at least 4 mm", {5, 3});
  refused({{{2, 0}}, {{2, 4}, -2}, {{2, 9}}}, "off the axis", {2, 4});
  refused({{{1, 0}}, {{1, 4}, -2}, {{2, 9}}}, "off the axis", {1, 4});
  refused({{{3, 1}, -8}, {{3, 4}}}, "the first point at height 0", {3, 1});
  EXPECT_EQ(tool_outline_from_points({{{3, 0}}, {{3, 4}}, {{3, 4}, -1}, {{5, 4}}, {{5, 9}}}),
            tool_outline_from_points({{{3, 0}}, {{3, 4}}, {{5, 4}}, {{5, 9}}}));
  EXPECT_THROW(tool_outline_from_points({{{3, 0}}, {{3, NAN}}, {{6, 6}}}), OutlineError);
  refused({{{3, 0}}, {{2000, 3000}, -4000}, {{2000, 4000}}}, "at most 200 chords", {2000, 3000});
}

/// A T-slot cutter takes its slot out of a block, and no more; its shank, in the neck's slot, meets
/// nothing.
TEST(HollowStock, ATSlotIsItsSection) {
  const Cutter cutter = form_cutter(tool_outline_from_points(hollow_tools::t_slot));
  Stock stock = box({-20, -15, -12}, {20, 15, 0}, 0.25);
  const double before = volume(stock);
  const RemovalResult taken =
      remove(stock, cutter, {pose({-40, 0, -10}), pose({40, 0, -10}), 1, false});
  EXPECT_FALSE(taken.crashed);
  EXPECT_NEAR(taken.volume, 40 * (20 * 5 + 8 * 5), 40.0);
  EXPECT_NEAR(before - volume(stock), taken.volume, 1e-6);
  EXPECT_GT(depth(stock, {0, 7, -4}), 0.0);  // the overhang stays
  EXPECT_LT(depth(stock, {0, 7, -6}), 0.0);  // below it is the slot
  EXPECT_LT(depth(stock, {0, 3, -2}), 0.0);  // and the neck's way
  Stock rapid = box({-20, -15, -12}, {20, 15, 0}, 0.5);
  EXPECT_TRUE(remove(rapid, cutter, {pose({-40, 0, -10}), pose({40, 0, -10}), 1, true}).crashed);
}

/// A leaning, turning tool takes out of the stock what it takes at places tried along its way.
TEST(HollowStock, TakesWhatLiesInTheToolOnItsWay) {
  Random random(2206);
  for (const auto& tool : hollow_tools::tools()) {
    const Cutter cutter = hollow_tools::cutter_of(tool);
    Stock stock = box({-12, -12, -12}, {12, 12, 12}, 0.5);
    const Vector3d axis = random.turned(Vector3d::UnitZ(), 0.3);
    const Vector3d target = random.turned(axis, 0.02);
    const Vector3d tip = 4 * random.any(), step = 5 * random.any();
    remove(stock, cutter, {pose(tip, axis), pose(tip + step, target), 1, false});
    int inside = 0;
    for (int i = 0; i < 4000; ++i) {
      const double t = random.in(0, 1);
      const Vector3d u = ((1 - t) * axis + t * target).normalized();
      const Vector3d place = 11 * random.any(), from = place - tip - t * step;
      const double height = from.dot(u), rho = (from - height * u).norm();
      if (distance(*cutter.outline, {rho, height}).value > -0.9) continue;
      ++inside;
      EXPECT_LE(depth(stock, place), 0.0) << tool.name << ", seed 2206";
    }
    EXPECT_GT(inside, 20) << tool.name;
  }
}

TEST(HollowEngagement, SlicesMakeUpTheProfile) {
  const Cutter cutter = form_cutter(tool_outline_from_points(hollow_tools::t_slot));
  double area = 0.0;
  for (const EdgeSlice& slice : slices(cutter)) area += 2 * pi * slice.radius * slice.length;
  EXPECT_NEAR(area, pi * 100 + 2 * pi * 10 * 5 + pi * (100 - 16) + 2 * pi * 4 * 15, 1e-6);
}

/// What is engaged, seen along the feed, times the step is what the move removes.
TEST(HollowEngagement, WhatTheArcsSweepIsWhatTheMoveRemoves) {
  constexpr double step = 1.0, z = -9.0;
  for (const hollow_tools::Tool& tool : hollow_tools::tools()) {
    const Cutter cutter = hollow_tools::cutter_of(tool);
    Stock stock = box({-30, -20, -20}, {30, 1.3, 0.0}, 0.25);
    remove(stock, cutter, {pose({-40, 0, z}), pose({0, 0, z}), 1, false});
    const Engagement met = engagement(stock, cutter, pose({step, 0, z}), Vector3d::UnitX());
    double swept = 0.0;  // mm^2
    for (const EngagedArc& arc : met.arcs) {
      const EdgeSlice& slice = met.slices[std::size_t(arc.slice)];
      swept += slice.length * slice.radius * std::sin(slice.kappa) *
               (std::sin(arc.to) - std::sin(arc.from));
    }
    const double removed =
        remove(stock, cutter, {pose({0, 0, z}), pose({step, 0, z}), 2, false}).volume;
    std::cout << tool.name << ": arcs times step " << swept * step << " mm^3, removed " << removed
              << " mm^3\n";
    EXPECT_NEAR(swept * step, removed, 0.05 * removed) << tool.name;
  }
}

/// Run-out: the sum of the profile with a rectangle, place by place.
TEST(HollowRunOut, HoldsTheProfileMovedAboutAndNoMore) {
  using namespace hollow_tools;
  Random random(2207);
  constexpr double radial = 0.2, axial = 0.1;
  for (const Tool& tool : tools()) {
    const bool has_arcs = std::ranges::any_of(tool.points, [](auto& p) { return p.radius > 0; });
    const Cutter cutter = cutter_of(tool);
    const Cutter across = with_run_out(cutter, radial, 0.0);
    EXPECT_DOUBLE_EQ(across.radius, cutter.radius + radial);
    EXPECT_DOUBLE_EQ(across.flank_length, cutter.flank_length);
    if (has_arcs) continue;
    const Cutter both = with_run_out(cutter, radial, axial);
    EXPECT_NEAR(both.flank_length, cutter.flank_length + 2 * axial, 1e-12);
    for (int i = 0; i < 3000; ++i) {
      const Vector2d place(random.in(0, 1.2) * both.radius, random.in(0, 1) * both.flank_length);
      double most = -1.0;
      for (int k = 0; k <= 400; ++k) {
        const double height = place.y() - 2 * axial * k / 400;
        if (height >= 0 && height <= cutter.flank_length)
          most = std::max(most, radius_at(tool.points, height));
      }
      const double signed_depth = most + radial - place.x();
      if (std::abs(signed_depth) > 2e-3) {
        EXPECT_EQ(distance(*both.outline, place).value<0.0, signed_depth> 0.0)
            << tool.name << " " << place.transpose();
      }
    }
  }
  const Cutter groove = form_cutter(
      tool_outline_from_points({{{5, 0}}, {{5, 3}}, {{4.9, 3.1}}, {{5, 3.2}}, {{5, 8}}}));
  EXPECT_THROW(with_run_out(groove, 0.1, 0.3), std::invalid_argument);
}

TEST(HollowBody, IsClosedAndLiesAroundTheProfile) {
  constexpr double sag = 0.01;
  for (const auto& tool : hollow_tools::tools()) {
    const Cutter cutter = hollow_tools::cutter_of(tool);
    const ClosedMesh mesh = cutter_mesh(cutter, sag);
    std::map<std::pair<int, int>, int> sides;
    for (const auto& t : mesh.triangles.rowwise())
      for (int k = 0; k < 3; ++k) ++sides[{t[k], t[(k + 1) % 3]}];
    for (const auto& [side, count] : sides) {
      EXPECT_EQ(count, 1) << tool.name;
      EXPECT_TRUE(sides.contains({side.second, side.first})) << tool.name;
    }
    for (const auto& v : mesh.vertices.rowwise()) {
      const double out = distance(*cutter.outline, {v.head<2>().norm(), v.z()}).value;
      EXPECT_GT(out, -1e-9) << tool.name;
      EXPECT_LT(out, 1.01 * sag) << tool.name;
    }
    EXPECT_EQ(cutter_meshes(cutter, sag).size(), cutter.outline->parts.size());
    for (const double margin : {1e-3, 0.1, 5.0}) {
      const InsetCutter inner = inset_cutter(cutter, margin);
      for (const OutlineSegment& piece : inner.cutter.outline->segments)
        EXPECT_LT(distance(*cutter.outline, piece.to + Vector2d(0, inner.raised)).value, 0.0);
    }
  }
}

TEST(HollowCutter, WhatAsksForAConvexCutterRefusesIt) {
  const Cutter cutter = form_cutter(tool_outline_from_points(hollow_tools::t_slot));
  CutterMotion motion{Eigen::MatrixX3d(2, 3), Eigen::MatrixX3d(2, 3), Vector2d(0, 1), {1, 1}};
  motion.tip << -30, 0, 0, 30, 0, 0;
  motion.axis << 0, 0, 1, 0, 0, 1;
  Design design;
  design.vertices = Eigen::RowVector3d(0, 7, 5.25);
  design.normals = Eigen::RowVector3d(0, 0, -1);
  EXPECT_THROW(milled_competing_passes(design, cutter, motion, {}), std::invalid_argument);
  EXPECT_THROW(SweepTree(cutter, motion), std::invalid_argument);
  EXPECT_THROW(inset_convex(*cutter.outline, 0.1), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::cutting
