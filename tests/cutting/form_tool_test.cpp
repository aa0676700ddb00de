// Form cutters in what is not the surface: stock, engagement, contacts, run-out, bodies.

#include "cutting/stock/body.h"
#include "cutting/stock/engagement.h"
#include "cutting/surface/removal.h"
#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"
#include "tests/cutting/any_form.h"
#include "tests/cutting/brute_pairs.h"
#include "tests/cutting/random.h"
#include "tests/cutting/stock_parts.h"
#include "tests/oracles/brute_surface.h"
#include "tests/test.h"

namespace abbe::cutting {
namespace {

namespace form_tools {

/// A form of the shape of a common cutter.
Cutter as_form(const Cutter& cutter) {
  return form_cutter(
      apt_outline({2 * cutter.radius, cutter.corner_radius, cutter.radius - cutter.corner_radius,
                   cutter.corner_radius, 0, 0, cutter.flank_length}));
}

Cutter any_common(Random& random) {
  const double R = random.in(2, 6), r = random.once_in(3)   ? R
                                        : random.once_in(2) ? 0.0
                                                            : R * random.in(0.05, 0.9);
  return {R, r, r + random.in(3, 12)};
}

/// Returns how far a place lies outside a tool and its shank over a move whose axis stands, in mm;
/// the sign is exact. Outline and shank are convex, so halving finds the least of each.
double sweep_outside_by(const Cutter& form, const Vector3d& tip, const Vector3d& axis,
                        const Vector3d& step, const Vector3d& point) {
  const Matrix3d R = pose(tip, axis).linear();
  const auto least = [&](const auto& value) {
    double low = 0.0, high = 1.0;
    for (int i = 0; i < 80; ++i) {
      const double a = low + 0.382 * (high - low), b = low + 0.618 * (high - low);
      (value(a) < value(b) ? high : low) = value(a) < value(b) ? b : a;
    }
    return std::min({value(0.0), value(1.0), value(0.5 * (low + high))});
  };
  const auto seen = [&](double t) -> Vector3d { return R.transpose() * (point - tip - t * step); };
  const double by_cutter = least([&](double t) {
    const Vector3d p = seen(t);
    return distance(*form.outline, {p.head<2>().norm(), p.z()}).value;
  });
  const double by_shank = least([&](double t) {
    const Vector3d p = seen(t);
    return std::max(p.head<2>().norm() - shank_radius(form), form.flank_length - p.z());
  });
  return std::min(by_cutter, by_shank);
}

struct Deepest {
  double kept = 0.0, taken = 0.0;  // mm, within the sweep and left, outside it and gone
  int ends = 0;
};

Deepest held_against_sweep(const Stock& after, const Cutter& form, const Vector3d& tip,
                           const Vector3d& axis, const Vector3d& step, Random& random) {
  Deepest worst;
  for (const DexelField& field : after.fields)
    for (std::size_t l = 0; l < field.lines.size(); ++l) {
      Vector3d place;
      place[(field.along + 1) % 3] = double(int(l) % field.size[0]) * after.spacing;
      place[(field.along + 2) % 3] = double(int(l) / field.size[0]) * after.spacing;
      const auto look = [&](double at) {
        place[field.along] = at;
        const Vector3d point = after.T_wk * Vector3d(after.origin_k + place);
        const double d = sweep_outside_by(form, tip, axis, step, point);
        if (field.lines[l].signed_depth(at) > 0.0)
          worst.kept = std::max(worst.kept, -d);
        else
          worst.taken = std::max(worst.taken, d);
      };
      if (field.lines[l].empty()) continue;
      const auto runs = field.lines[l].runs();
      look(random.in(runs.front().low, runs.back().high));
      for (const DexelRun& run : runs) {
        if (run.low_line != 0) look(run.low + 2e-9), look(run.low - 2e-9), ++worst.ends;
        if (run.high_line != 0) look(run.high + 2e-9), look(run.high - 2e-9), ++worst.ends;
      }
    }
  return worst;
}

}  // namespace form_tools

TEST(FormStock, IsTheSweepToRounding) {
  using namespace form_tools;
  Deepest worst;
  for (int i = 0; i < 25 * longer(40); ++i) {
    Random random(1810 + std::uint64_t(i));
    const Cutter form = any_form(random, random.in(2, 6));
    Stock stock = make_stock(BoxBlank{Vector3d(-9, -8, -7), Vector3d(9, 8, 7)},
                             pose(0.3 * random.any(), random.direction()), {1.1, true});
    const Vector3d axis = random.once_in(3) ? Vector3d::UnitZ() : random.direction();
    const Vector3d tip = 6 * random.any();
    Vector3d step =
        random.once_in(6) ? Vector3d::Zero() : Vector3d(random.in(0.1, 9) * random.any());
    if (random.once_in(4)) step = step.norm() * axis;
    remove(stock, form, {pose(tip, axis), pose(tip + step, axis), 1, false});
    const Deepest one = held_against_sweep(stock, form, tip, axis, step, random);
    worst.kept = std::max(worst.kept, one.kept);
    worst.taken = std::max(worst.taken, one.taken);
    worst.ends += one.ends;
  }
  std::cout << worst.ends << " ends from seed 1810; left within the sweep by " << worst.kept
            << " mm, taken outside it by " << worst.taken << " mm\n";
  EXPECT_LT(worst.kept, 3e-9);  // places are tried 2e-9 mm from the ends
  EXPECT_LT(worst.taken, 3e-9);
  EXPECT_GT(worst.ends, 1500);
}

/// A form of a common outline takes what the common cutter takes, and crashes where that does.
TEST(FormStock, OfACommonOutlineTakesTheSame) {
  using namespace form_tools;
  double most = 0.0;
  int crashes = 0, form_alone = 0, moves = 0;
  for (int i = 0; i < 80 * longer(20); ++i) {
    Random random(1811 + std::uint64_t(i));
    const Cutter cutter = any_common(random), form = as_form(cutter);
    for (int k = 0; k < 2; ++k) {
      Stock one = make_stock(BoxBlank{Vector3d(-9, -8, -7), Vector3d(9, 8, 7)},
                             Eigen::Isometry3d::Identity(), {0.9, true});
      Stock other = one;
      const Vector3d axis = random.near(Vector3d::UnitZ(), 0.4);
      const Vector3d target =
          random.once_in(2) ? axis : random.turned(axis, random.decades(-6, -1));
      const Vector3d tip(random.in(-9, 9), random.in(-8, 8), random.in(-3, 9));
      const Vector3d step = random.in(0.1, 6) * random.any();
      const StockMove move{pose(tip, axis), pose(tip + step, target), k + 1, random.once_in(4)};
      const RemovalResult a = remove(one, cutter, move), b = remove(other, form, move);
      // two parts, of the flank and of the shank, may each be off by what a turning axis may
      const double may = axis == target ? 1e-6 : 0.03;
      EXPECT_NEAR(a.volume, b.volume, may) << "seed " << 1811 + i;
      most = std::max(most, std::abs(a.volume - b.volume));
      // what comes in beside the first `rubbing` of the shank, the tool falling, is a crash of a
      // form alone
      EXPECT_TRUE(b.crashed || !a.crashed) << "seed " << 1811 + i << ", " << a.volume << " mm^3";
      form_alone += b.crashed && !a.crashed;
      crashes += a.crashed;
      ++moves;
    }
  }
  std::cout << moves << " moves, " << crashes << " crashes and " << form_alone
            << " of the form alone, volumes up to " << most << " mm^3 apart\n";
  EXPECT_LE(form_alone, moves / 100);
  EXPECT_GT(crashes, moves / 10);
  EXPECT_LT(crashes, moves - moves / 10);
}

TEST(FormStock, AShankNarrowerThanTheCutterFollowsItThroughTheSlot) {
  // a disc 2 mm high on a shank of R 2: below the surface it undercuts, and the shank's slot stays
  const Cutter disc = form_cutter(outline_from_points({{{6, 0}}, {{6, 2}}, {{2, 2}}}));
  Stock stock = box({-20, -10, -10}, {20, 10, 0}, 0.5);
  const RemovalResult first =
      remove(stock, disc, {pose({-30, 0, -6}), pose({30, 0, -6}), 1, false});
  EXPECT_TRUE(first.crashed);  // the shank meets what is above the disc
  EXPECT_NEAR(first.volume, 40 * (12 * 2 + 4 * 4), 60.0);
  Stock slotted = box({-20, -10, -10}, {20, 10, 0}, 0.5);
  const Cutter flat{2.5, 0.0, 20.0};
  remove(slotted, flat, {pose({-30, 0, -6}), pose({30, 0, -6}), 1, false});
  const RemovalResult second =
      remove(slotted, disc, {pose({-30, 0, -6}), pose({30, 0, -6}), 2, false});
  EXPECT_FALSE(second.crashed);
  EXPECT_NEAR(second.volume, 40 * 7 * 2, 20.0);
}

TEST(FormEngagement, SlicesMakeUpTheOutline) {
  const double lean = 0.1;
  const Cutter cone = form_cutter(outline_from_points({{{2, 0}}, {{2 + 12 * std::tan(lean), 12}}}));
  const Cutter barrel =
      form_cutter(outline_from_points({{{1, 0}}, {{2.4, 0.5}, 2.4}, {{2.4, 14.5}, 20}}));
  double cone_area = 0.0, turned = 0.0;
  for (const EdgeSlice& slice : slices(cone)) {
    cone_area += 2 * pi * slice.radius * slice.length;
    if (slice.kappa > 0.0) EXPECT_NEAR(slice.kappa, pi / 2 - lean, 1e-12);
  }
  const double top = 2 + 12 * std::tan(lean);
  EXPECT_NEAR(cone_area, pi * 4 + pi * (2 + top) * 12 / std::cos(lean), 1e-9);
  double height = 0.0;
  for (const EdgeSlice& slice : slices(barrel)) {
    EXPECT_GE(slice.height, height);
    height = slice.height;
    turned += slice.length * std::sin(slice.kappa - pi / 2);  // - dr
  }
  // outwards as much as inwards but for the end of the barrel
  EXPECT_NEAR(turned, -2.4, 0.02);
  EXPECT_GT(slices(barrel).back().kappa, pi / 2);
}

TEST(FormEngagement, WhatTheArcsSweepIsWhatTheMoveRemoves) {
  const Cutter cutters[] = {
      form_tools::as_form({5.0, 1.5, 20.0}),
      form_cutter(apt_outline({.diameter = 8, .flank = 10 * units::deg, .height = 15})),
      form_cutter(outline_from_points({{{1, 0}}, {{2.4, 0.5}, 2.4}, {{2.4, 14.5}, 20}})),
      form_cutter(apt_outline({.diameter = 8, .bottom = 31 * units::deg, .height = 15}))};
  for (const Cutter& cutter : cutters) {
    Stock stock = box({-30, -20, -20}, {30, 1.3, 0.0}, 0.25);
    const double step = 1.0, z = -4.0;
    remove(stock, cutter, {pose({-40, 0, z}), pose({0, 0, z}), 1, false});
    const Engagement e = engagement(stock, cutter, pose({step, 0, z}), Vector3d::UnitX());
    double swept = 0.0;  // mm^2, of the engaged surface seen along the feed
    for (const EngagedArc& arc : e.arcs) {
      const EdgeSlice& slice = e.slices[std::size_t(arc.slice)];
      swept += slice.length * slice.radius * std::sin(slice.kappa) *
               (std::sin(arc.to) - std::sin(arc.from));
    }
    const double removed =
        remove(stock, cutter, {pose({0, 0, z}), pose({step, 0, z}), 2, false}).volume;
    std::cout << "arcs times step " << swept * step << " mm^3, removed " << removed << " mm^3\n";
    EXPECT_NEAR(swept * step, removed, 0.05 * removed);
  }
}

/// The gradient of a contact foretells the residual of vertices near by.
TEST(FormContacts, ForetellTheResidualNearBy) {
  constexpr double near = 1e-4, band = 2.0;  // mm
  Random random(1812);
  int compared = 0;
  double most = 0.0;
  for (int i = 0; i < 400 * longer(10); ++i) {
    const Cutter form = any_form(random, random.in(2, 6));
    const Vector3d axis = random.direction();
    const Vector3d step = random.in(3, 6) * random.direction();
    CutterMotion motion{Points(2, 3), Points(2, 3), Vector2d(0, 1), {1, 1}};
    motion.tip.row(0).setZero();
    motion.tip.row(1) = step.transpose();
    motion.axis.row(0) = motion.axis.row(1) = axis.transpose();
    const Vector3d normal = random.direction();
    const double rise = -normal.dot(axis), across = normal.cross(axis).norm();
    const Vector2d touching = support_point(*form.outline, rise, across);
    const Vector3d out = across > 1e-9 ? Vector3d(-(normal - normal.dot(axis) * axis) / across)
                                       : Vector3d(axis.unitOrthogonal());
    const Vector3d contact = 0.5 * step + touching.y() * axis + touching.x() * out;
    Design design;
    design.vertices = Points(2, 3);
    design.normals = Points(2, 3);
    const Vector3d d = near * normal.cross(random.direction());
    design.vertices.row(0) = (contact + random.in(-0.3, 0.3) * normal).transpose();
    design.vertices.row(1) = design.vertices.row(0) + d.transpose();
    design.normals.row(0) = design.normals.row(1) = normal.transpose();
    SurfaceOptions options;
    options.band = band;
    const Surface surface = milled_surface(design, form, motion, options);
    if (surface.status[0] != VertexStatus::Cut || surface.status[1] != VertexStatus::Cut) continue;
    const Vector3d gradient =
        milled_gradients(design, surface, form, motion).gradient.row(0).transpose();
    if (!gradient.allFinite() || gradient.norm() > 3.0) continue;
    EXPECT_NEAR(gradient.dot(normal), 1.0, 1e-9);
    const double foretold = surface.residual[0] - gradient.dot(d);
    const double off = std::abs(surface.residual[1] - foretold);
    // curvature, and a rim whose sides differ
    if (off < 1e-5) ++compared;
    most = std::max(most, off < 1e-5 ? off : 0.0);
  }
  std::cout << compared << " contacts, foretold within " << 1e6 * most << " nm over " << near
            << " mm\n";
  EXPECT_GT(compared, 100);
  EXPECT_LT(most, 2e-7);
}

TEST(FormRunOut, IsTheOutlineMovedToEverySide) {
  Random random(1813);
  double most = 0.0;
  for (int i = 0; i < 300; ++i) {
    const Cutter form = any_form(random, random.in(0.5, 8));
    const double radial = random.some(0.5), axial = random.some(0.3);
    const Cutter larger = with_run_out(form, radial, axial);
    EXPECT_NEAR(larger.radius, form.radius + radial, 1e-9);
    EXPECT_NEAR(larger.flank_length, form.flank_length + 2 * axial, 1e-9);
    for (int k = -90; k <= 90; k += 3) {
      const double rise = std::sin(k * units::deg), across = std::cos(k * units::deg);
      const double wanted = support(*form.outline, rise, across) + radial * across +
                            axial * std::abs(rise) + axial * rise;
      most = std::max(most, std::abs(support(*larger.outline, rise, across) - wanted));
    }
  }
  std::cout << "support off by " << most << " mm at most\n";
  EXPECT_LT(most, 1e-9);
  const Cutter common{5, 1, 20};
  const Cutter one = with_run_out(common, 0.01, 0.003);
  const Cutter other = with_run_out(form_tools::as_form(common), 0.01, 0.003);
  EXPECT_LT(max_separation(*form_tools::as_form(one).outline, *other.outline), 1e-9);
}

TEST(FormCore, LiesInsideByTheMargin) {
  Random random(1814);
  for (int i = 0; i < 300; ++i) {
    const Cutter form = any_form(random, random.in(0.5, 8));
    const double margin =
        0.25 * std::min(form.radius, form.flank_length) * random.decades(-4, -0.1);
    InsetOutline inner;
    try {
      inner = inset_convex(*form.outline, margin);
    } catch (const std::invalid_argument&) {
      EXPECT_GT(margin, 0.1 * std::min(form.radius, form.flank_length));  // a slender one
      continue;
    }
    double largest = 0.0;
    for (const OutlineSegment& piece : form.outline->segments)
      largest = std::max(largest, piece.radius);
    for (const OutlineSegment& piece : inner.outline.segments) {
      const double out = distance(*form.outline, piece.to + Vector2d(0.0, inner.raised)).value;
      EXPECT_LT(out, -margin + 1e-9);
      EXPECT_GT(out, -margin - 4e-4 * largest - 1e-9);
    }
  }
}

TEST(FormBody, IsClosedAndLiesAroundTheOutline) {
  constexpr double sag = 0.01;
  Random random(1815);
  for (int i = 0; i < 40; ++i) {
    const Cutter form = any_form(random, random.in(0.5, 8));
    const ClosedMesh mesh = cutter_mesh(form, sag);
    std::map<std::pair<int, int>, int> sides;
    for (const auto& t : mesh.triangles.rowwise())
      for (int k = 0; k < 3; ++k) ++sides[{t[k], t[(k + 1) % 3]}];
    for (const auto& [side, count] : sides) {
      EXPECT_EQ(count, 1);
      EXPECT_TRUE(sides.contains({side.second, side.first}));
    }
    for (const auto& v : mesh.vertices.rowwise()) {
      const double out = distance(*form.outline, {v.head<2>().norm(), v.z()}).value;
      EXPECT_GT(out, -1e-9);
      EXPECT_LT(out, 1.01 * sag);
    }
  }
}

/// The place that a support function names is touched by its plane.
TEST(FormOutline, TouchesWhereItsSupportSays) {
  Random random(1816);
  for (int i = 0; i < 2000; ++i) {
    const Cutter form = any_form(random, random.in(0.5, 8));
    const double angle = random.in(-0.5 * pi, 0.5 * pi);
    const double rise = std::sin(angle), across = std::cos(angle);
    const Vector2d place = support_point(*form.outline, rise, across);
    EXPECT_NEAR(rise * place.y() + across * place.x(), support(*form.outline, rise, across), 1e-12);
    EXPECT_NEAR(distance(*form.outline, place).value, 0.0, 1e-9);
  }
  EXPECT_NEAR(corner_height(form_tools::as_form({6, 1, 20})), 1.0, 1e-12);
  EXPECT_NEAR(corner_height(form_tools::as_form({5, 5, 20})), 5.0, 1e-12);
  EXPECT_EQ(corner_height(form_tools::as_form({5, 0, 20})), 0.0);
}

/// A ball on a taper is a ball to where its flank begins.
TEST(FormOutline, ABallCornerIsABall) {
  for (const double bottom : {0.0, 10.0})
    for (const double flank : {-5.0, 0.0, 3.0, 20.0}) {
      const ToolOutline outline = apt_outline(with_ball_corner(
          {.corner = 3, .bottom = bottom * units::deg, .flank = flank * units::deg, .height = 20}));
      const double middle = 3 / std::cos(bottom * units::deg);
      for (double lean = bottom + 0.1; lean < 90 - flank; lean += 5.0) {
        const double down = std::cos(lean * units::deg), across = std::sin(lean * units::deg);
        EXPECT_NEAR(support(outline, -down, across), 3 - middle * down, 1e-9)
            << bottom << " " << flank;
      }
    }
}

/// A corner that touches bottom and flank, whatever they lean by.
TEST(FormOutline, ATangentCornerHasNoEdges) {
  for (const double bottom : {0.0, 2.0, 20.0})
    for (const double flank : {-10.0, 0.0, 5.0, 30.0}) {
      const ToolOutline outline = apt_outline(with_tangent_corner({.diameter = 10,
                                                                   .corner = 1.5,
                                                                   .bottom = bottom * units::deg,
                                                                   .flank = flank * units::deg,
                                                                   .height = 12}));
      EXPECT_EQ(outline.is_sharp, bottom > 0.0) << bottom << " " << flank;  // the tip of a cone
      EXPECT_NEAR(support(outline, -std::cos(bottom * units::deg), std::sin(bottom * units::deg)),
                  0.0, 1e-9);
    }
}

namespace form_cases {

/// The same cutter for both.
struct Form {
  const char* name;
  Cutter cutter;
  oracles::BruteForm brute;
};

/// @param points  after the bottom
Form form(const char* name, double bottom, const std::vector<oracles::BruteForm::Point>& points) {
  std::vector<OutlinePoint> outline{{{bottom, 0.0}}};
  for (const auto& p : points) outline.push_back({{p.x, p.z}, p.radius});
  return {name, form_cutter(outline_from_points(outline)), {bottom, points}};
}

Form apt(const char* name, const AptCutter& cutter) {
  Form made{name, form_cutter(apt_outline(cutter)), {0.0, {}}};
  for (const OutlineSegment& piece : made.cutter.outline->segments) {
    if (piece.to.y() <= 0.0) made.brute.bottom = piece.to.x();
    if (piece.to.y() > 0.0 && piece.to.x() > 0.0 && (piece.to - piece.from).norm() > 1e-9)
      made.brute.points.push_back({piece.to.x(), piece.to.y(), piece.is_arc ? piece.radius : 0.0});
  }
  return made;
}

std::vector<Form> forms() {
  const double lean = 5 * units::deg;
  return {
      apt("taper", {.diameter = 8, .bottom = 0.0, .flank = lean, .height = 15}),
      apt("tapered ball", {.diameter = 6 * (1 - std::sin(lean)) / std::cos(lean),
                           .corner = 3,
                           .radial = 0,
                           .axial = 3,
                           .flank = lean,
                           .height = 15}),
      apt("drill point", {.diameter = 8, .bottom = 31 * units::deg, .height = 15}),
      apt("bull nose", {.diameter = 10, .corner = 1, .radial = 4, .axial = 1, .height = 15}),
      apt("dovetail", {.diameter = 10, .flank = -15 * units::deg, .height = 5}),
      form("barrel", 1.0, {{2.4, 0.5, 2.4}, {2.4, 14.5, 20}}),
      form("oval", 0.5, {{2.0, 1.0, 2.0}, {5.0, 13.0, 85}}),
      form("lens", 0.0, {{3.8, 0.36621945085084, 19.8988}, {4.0, 0.6, 0.4}, {4.0, 12.0}}),
      form("chamfer", 1.0, {{5.0, 4.0}, {5.0, 10.0}}),
  };
}

}  // namespace form_cases

TEST(FormCutter, AgreesWithBruteForceToANanometre) {
  for (const form_cases::Form& form : form_cases::forms())
    brute_pairs::hold_against_brute_force(form.name, form.cutter, form.brute,
                                          {.seed = 1803, .pairs = 150 * longer(70), .most = 20000});
}

TEST(PlainCutter, AgreesWithBruteForceToANanometre) {
  const std::pair<const char*, Cutter> cutters[] = {
      {"ball", {5, 5, 20}},        {"flat", {5, 0, 20}},           {"bull nose", {5, 1, 20}},
      {"all corner", {3, 2.9, 4}}, {"sharp corner", {1, 0.01, 8}}, {"half a ball", {5, 5, 5}}};
  for (const auto& [name, cutter] : cutters)
    brute_pairs::hold_against_brute_force(
        name, cutter,
        oracles::BruteCutter{cutter.radius, cutter.corner_radius, cutter.flank_length},
        {.seed = 1806, .pairs = 150 * longer(70), .most = 20000});
}

/// A form with the outline of a ball, a bull nose or a flat end cuts what they cut.
TEST(FormCutter, OfACommonOutlineCutsTheSame) {
  using namespace form_cases;
  Random random(1804);
  double most = 0.0;
  int cut = 0;
  for (int n = 0; n < 3000 * longer(10); ++n) {
    const double R = random.decades(-1, 2), r = R * (n % 3 == 0   ? 1.0
                                                     : n % 3 == 1 ? 0.0
                                                                  : random.in(0, 1));
    const Cutter cutter{R, r, r + R * random.in(0.1, 3)};
    const Cutter form = form_cutter(apt_outline({2 * R, r, R - r, r, 0, 0, cutter.flank_length}));
    const brute_pairs::Pair pair = brute_pairs::any_pair(random, cutter, R);
    const Design design = brute_pairs::design_of(pair.ray);
    SurfaceOptions options;
    options.band = R;
    const Surface one = milled_surface(design, cutter, pair.motion, options);
    const Surface other = milled_surface(design, form, pair.motion, options);
    if (one.status[0] != VertexStatus::Cut && other.status[0] != VertexStatus::Cut) continue;
    ASSERT_EQ(one.status[0], other.status[0]) << "seed 1804, pair " << n;
    ++cut;
    most = std::max(most, std::abs(one.residual[0] - other.residual[0]));
  }
  std::cout << cut << " cut, " << 1e6 * most << " nm apart at most\n";
  EXPECT_LT(most, 5e-8);
  EXPECT_GT(cut, 300);
}

TEST(FormCutter, OutlinesThatAreNoneAreRefused) {
  using Points = std::vector<OutlinePoint>;
  const auto refused = [](const Points& points) {
    EXPECT_THROW(outline_from_points(points), std::invalid_argument);
  };
  refused({});
  refused({{{0, 1}}, {{3, 2}}});                        // begins above the tip
  refused({{{1, 0}}, {{3, 2}}, {{3.5, 6}}, {{6, 7}}});  // hollow
  refused({{{1, 0}}, {{3, 2}}, {{3, 1}}});              // turns back down
  refused({{{1, 0}}, {{1, 5}, 2.0}});                   // an arc too small for its chord
  refused({{{1, 0}}, {{0, 0}}});                        // no height
  refused({{{1, 0}}, {{NAN, 3}}});
  refused({{{1, 0}}, {{3, 0.1}, 3.0}, {{3, 4}}});  // an arc that begins below the tip
  const auto refused_apt = [](const AptCutter& cutter) {
    EXPECT_THROW(apt_outline(cutter), std::invalid_argument);
  };
  refused_apt({.diameter = -1});
  refused_apt({.diameter = 10, .corner = 1, .radial = 7, .axial = 1});  // beside the flank
  refused_apt({.diameter = 10, .flank = -60 * units::deg, .height = 20});
  refused_apt({.diameter = 10, .bottom = 80 * units::deg, .flank = 20 * units::deg});
}

/// The sizes of APT: a corner's tangent points by hand.
TEST(FormCutter, TheCornerOfAptMeetsItsLines) {
  const double b = 10 * units::deg;
  const ToolOutline ball = apt_outline({.diameter = 6 * (1 - std::sin(b)) / std::cos(b),
                                        .corner = 3,
                                        .radial = 0,
                                        .axial = 3,
                                        .flank = b,
                                        .height = 20});
  const auto arc = std::find_if(ball.segments.begin(), ball.segments.end(),
                                [](const OutlineSegment& piece) { return piece.is_arc; });
  EXPECT_NEAR((arc->from - Vector2d(0, 0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR((arc->to - Vector2d(3 * std::cos(b), 3 - 3 * std::sin(b))).norm(), 0.0, 1e-6);
  EXPECT_FALSE(ball.is_sharp);
  EXPECT_DOUBLE_EQ(ball.height, 20.0);
  EXPECT_NEAR(support(ball, -1, 0), 0.0, 1e-12);
  EXPECT_NEAR(support(ball, 1, 0), 20.0, 1e-12);
  EXPECT_TRUE(apt_outline({.diameter = 10, .height = 20}).is_sharp);
}

}  // namespace
}  // namespace abbe::cutting
