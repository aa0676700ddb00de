#include <tbb/global_control.h>
#include "cutting/surface/machined_surface.h"
#include "tests/cutting/milled_parts.h"
#include "tests/cutting/random.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

CutterMotion stretch_of(const CutterMotion& motion, Index first, Index last) {
  const Index n = last - first + 1;
  return {motion.tip.middleRows(first, n),
          motion.axis.middleRows(first, n),
          motion.time_s.segment(first, n),
          {motion.line.begin() + first, motion.line.begin() + last + 1}};
}

/// So many moves a block; `begun` counts how often the motion was begun.
std::function<MotionBlocks()> in_blocks(const CutterMotion& motion, int moves, int* begun) {
  return [&motion, moves, begun] {
    ++*begun;
    return [&motion, moves, next = Index(0)]() mutable -> std::optional<MotionBlock> {
      const Index last = motion.tip.rows() - 1;
      if (next > last || (next == last && next > 0)) return std::nullopt;
      const Index first = next;
      next = std::min(first + moves, last);
      MotionBlock block{stretch_of(motion, first, next), double(next + 1) / double(last + 1)};
      if (last == 0) next = 1;
      return block;
    };
  };
}

/// A tool that wanders over a square, turns, and jumps now and then.
CutterMotion wandering(Random& random, int moves, double step, double turn) {
  std::vector<Stop> stops{{Vector3d(0, 0, 0), random.near(Vector3d::UnitZ(), 0.3)}};
  std::vector<int> jumps;
  while (int(stops.size()) <= moves) {
    Stop next = stops.back();
    next.tip += step * random.any();
    if (random.once_in(20)) {
      next.tip = Vector3d(random.in(-8, 8), random.in(-8, 8), random.in(-3, 1));
      jumps.push_back(int(stops.size()));
    }
    next.tip = next.tip.cwiseMax(Vector3d(-8, -8, -6)).cwiseMin(Vector3d(8, 8, 2));
    next.axis = random.near(next.axis, turn);
    stops.push_back(next);
  }
  CutterMotion motion = motion_of(stops);
  for (const int i : jumps) motion.time_s.tail(motion.time_s.size() - i).array() -= 1.0;
  return motion;
}

/// A closed box, 20 x 20 mm, with vertices `thickness` apart above and below, some of them leaning.
Design box_of(Random& random, double thickness) {
  constexpr int n = 31;
  Design design;
  design.vertices.resize(2 * n * n, 3);
  design.normals.resize(2 * n * n, 3);
  design.triangles.resize(4 * (n - 1) * (n - 1), 3);
  Index t = 0;
  for (int side = 0; side < 2; ++side)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const int v = side * n * n + j * n + i;
        const Vector3d up = side == 0 ? Vector3d::UnitZ() : Vector3d(-Vector3d::UnitZ());
        design.vertices.row(v) << 20.0 * i / (n - 1) - 10, 20.0 * j / (n - 1) - 10,
            side == 0 ? 0.0 : -thickness;
        design.normals.row(v) = random.near(up, random.once_in(3) ? 0.3 : 0.0);
        if (i + 1 == n || j + 1 == n) continue;
        const int b = v + 1, c = v + n + 1, d = v + n;
        design.triangles.row(t++) << v, (side == 0 ? b : c), (side == 0 ? c : b);
        design.triangles.row(t++) << v, (side == 0 ? c : d), (side == 0 ? d : c);
      }
  design.area = vertex_area(design.vertices, design.triangles);
  return design;
}

/// The same bits everywhere, the instants and lines of gouges without a floor left out.
void expect_same(const Surface& whole, Surface streamed) {
  ASSERT_EQ(streamed.gouges.size(), whole.gouges.size());
  for (std::size_t k = 0; k < whole.gouges.size(); ++k) {
    const Gouge &a = whole.gouges[k], &b = streamed.gouges[k];
    EXPECT_TRUE(a.vertex == b.vertex && a.depth == b.depth &&
                a.continues_deeper == b.continues_deeper)
        << a.vertex;
    if (!a.continues_deeper) continue;
    streamed.cut_time_s[a.vertex] = whole.cut_time_s[a.vertex];
    streamed.cut_line[std::size_t(a.vertex)] = whole.cut_line[std::size_t(a.vertex)];
  }
  EXPECT_TRUE(same_bits(whole, streamed));
}

int count_of(const Surface& surface, VertexStatus status) {
  return int(std::ranges::count(surface.status, status));
}

TEST(StreamedSurface, IsToTheBitThatOfTheWholeMotion) {
  const std::uint64_t seed = 20261126;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Random random(seed);
  const Cutter tools[] = {{2, 2, 8}, {2, 0.5, 8}, {2, 0, 8}};
  const struct { double step, turn; } motions[] = {{0.5, 0.01}, {4.0, 0.3}, {0.02, 0.0}};
  int cut = 0, uncut = 0, gouged = 0, endless = 0;
  for (const Cutter& tool : tools)
    for (const auto& [step, turn] : motions)
      for (const double band : {2.0, 0.3}) {
        const Design design = box_of(random, random.in(0.5, 12.0));
        const CutterMotion motion = wandering(random, 120 + random.below(20), step, turn);
        const SurfaceOptions options{.band = band, .progress = {}};
        const Surface whole = milled_surface(design, tool, motion, options);
        cut += count_of(whole, VertexStatus::Cut);
        uncut += count_of(whole, VertexStatus::Uncut);
        gouged += count_of(whole, VertexStatus::Gouged);
        endless += int(std::ranges::count(whole.gouges, true, &Gouge::continues_deeper));
        for (const int moves : {1, 2, 7, 1000}) {
          SCOPED_TRACE(testing::Message() << moves << " moves a block, step " << step);
          int begun = 0;
          expect_same(whole,
                      streamed_surface(design, tool, in_blocks(motion, moves, &begun), options));
          EXPECT_LE(begun, 2);
        }
      }
  std::cout << "  " << cut << " cut, " << uncut << " uncut, " << gouged << " gouged, of them "
            << endless << " without a floor\n";
  EXPECT_GT(std::min({cut, uncut, gouged, endless}), 100);
}

TEST(StreamedSurface, DoesNotDependOnTheNumberOfThreads) {
  Random random(5);
  const Design design = box_of(random, 6.0);
  const CutterMotion motion = wandering(random, 300, 1.0, 0.05);
  const auto found_by = [&](std::size_t threads) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    int begun = 0;
    return streamed_surface(design, {2, 0.5, 8}, in_blocks(motion, 7, &begun));
  };
  const Surface one = found_by(1);
  for (const std::size_t threads : {2, 8}) EXPECT_TRUE(same_bits(one, found_by(threads)));
}

TEST(StreamedSurface, BeginsAgainOnlyForVerticesThatAreNotCut) {
  const CutterMotion motion =
      motion_of({{Vector3d(-20, 0, 0)}, {Vector3d(0, 0, 0)}, {Vector3d(20, 0, 0)}});
  int begun = 0;
  streamed_surface(design_of({{Vector3d(1, 0, 0)}}), ball_mill, in_blocks(motion, 1, &begun));
  EXPECT_EQ(begun, 1);
  streamed_surface(design_of({{Vector3d(1, 0, 0)}, {Vector3d(0, 90, 0)}}), ball_mill,
                   in_blocks(motion, 1, &begun));
  EXPECT_EQ(begun, 3);
}

TEST(StreamedSurface, ALoneSampleCutsAndNoMotionCutsNothing) {
  const Design design = design_of({{Vector3d(0, 0, 0)}, {Vector3d(30, 0, 0)}});
  const CutterMotion pose = motion_of({{Vector3d(0, 0, 0.1)}});
  int begun = 0;
  const Surface one = streamed_surface(design, ball_mill, in_blocks(pose, 1, &begun));
  expect_same(milled_surface(design, ball_mill, pose), one);
  EXPECT_EQ(one.status[0], VertexStatus::Cut);
  const Surface none = streamed_surface(design, ball_mill,
                                        [] { return [] { return std::optional<MotionBlock>(); }; });
  EXPECT_EQ(count_of(none, VertexStatus::Uncut), 2);
}

/// The blocks as they stand.
std::function<MotionBlocks()> given(const std::vector<CutterMotion>& blocks) {
  return [&blocks] {
    return [&blocks, next = std::size_t(0)]() mutable -> std::optional<MotionBlock> {
      if (next == blocks.size()) return std::nullopt;
      return MotionBlock{blocks[next++], 0.5};
    };
  };
}

TEST(StreamedSurface, ALoneSampleBeforeOthersIsNoMoveOfItsOwn) {
  const CutterMotion motion = motion_of({{Vector3d(0, 0, 0)}, {Vector3d(9, 0, 0)}});
  const Design design = design_of({{Vector3d(0, 0, 0)}, {Vector3d(4, 0.1, 0)}});
  const std::vector<CutterMotion> blocks{stretch_of(motion, 0, 0), motion,
                                         stretch_of(motion, 1, 1)};
  expect_same(milled_surface(design, ball_mill, motion),
              streamed_surface(design, ball_mill, given(blocks)));
}

TEST(StreamedSurface, RefusesBlocksThatDoNotFollowEachOther) {
  const CutterMotion motion =
      motion_of({{Vector3d(0, 0, 0)}, {Vector3d(9, 0, 0)}, {Vector3d(9, 9, 0)}});
  const Design design = design_of({{Vector3d(0, 0, 0)}});
  const auto refused = [&](const std::vector<CutterMotion>& blocks) -> std::string {
    return thrown_text<std::invalid_argument>(
        [&] { streamed_surface(design, ball_mill, given(blocks)); });
  };
  EXPECT_EQ(refused({stretch_of(motion, 0, 1), stretch_of(motion, 1, 2)}), "");
  EXPECT_EQ(refused({stretch_of(motion, 0, 1), stretch_of(motion, 2, 2)}),
            "milled surface: the first sample is not the last sample of the previous block, in "
            "block 2 of the motion");
  EXPECT_EQ(refused({CutterMotion{}}),
            "milled surface: the motion has no samples, in block 1 of the motion");
  CutterMotion odd = motion;
  odd.axis.row(1) *= 2.0;
  EXPECT_EQ(refused({odd}),
            "milled surface: axis of sample 1 is not a unit vector, in block 1 of the motion");
}

TEST(StreamedSurface, TellsOfItsProgressByTheBlocks) {
  Random random(2);
  const CutterMotion motion = wandering(random, 40, 1.0, 0.0);
  std::vector<double> told;
  int begun = 0;
  streamed_surface(box_of(random, 3.0), ball_mill, in_blocks(motion, 10, &begun),
                   {.band = 2.0, .progress = [&](double share) { told.push_back(share); }});
  ASSERT_EQ(told.size(), 4u);
  EXPECT_TRUE(std::ranges::is_sorted(told));
  EXPECT_EQ(told.back(), 1.0);
}

}  // namespace
}  // namespace abbe::cutting
