// What is said of a map whose places within triangles do not stand in their middles.

#include "sim/report/verdict.h"
#include "sim/cut/judged_surface.h"
#include "sim/cut/part_regions.h"
#include "sim/report/summary.h"
#include "tests/cutting/map_over.h"
#include "tests/oracles/areal_oracle.h"
#include "tests/sim/packaged_remarks.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using cutting::VertexStatus;

/// A cut that leaves a residual of the place, sampled at a place of each triangle at random.
template <class F>
Cut cut_at_random(const Job& job, const F& residual) {
  const cutting::Design& design = job.design_w;
  Cut cut;
  cut.surface =
      cutting::map_over(design, [&](const Vector3d& p, const Vector3d&) { return residual(p); });
  cutting::Surface& surface = cut.surface;
  surface.interior_sample = cutting::Surface::InteriorSample::Random;
  surface.within.resize(design.triangles.rows());
  for (Index t = 0; t < surface.within.size(); ++t)
    surface.within[t] = residual(
        cutting::value_at_sample(surface.interior_sample, design.vertices, design.triangles, t));
  return cut;
}

/// In a corner a quarter of the values carry the form; with 4000 vertices that is more than ten of
/// them.
TEST(Verdict, ASlopeHasNoTexture) {
  const Job job = job_of(
      BallRaster{"surface = \"rectangle\"\nlength_x_mm = 20\nlength_y_mm = 20\nat_mm = [0, 0, 80]\n"
                 "vertices = 4000\nsampling = \"vertices\"\n"});
  const auto slope = [](const Vector3d& p) { return 1e-3 * p.x() - 2e-3 * p.y(); };
  const Verdict verdict = judge(job, cut_at_random(job, slope), nullptr);
  ASSERT_TRUE(verdict.texture);
  std::cout << "texture of a slope: Sq " << 1e6 * verdict.texture->Sq << " nm of "
            << 1e6 * *verdict.residual.pv << " nm PV\n";
  EXPECT_LT(verdict.texture->Sq, 1e-6 * *verdict.residual.pv);
}

TEST(Verdict, ThePlaceFurthestOutOfToleranceMayLieWithinATriangle) {
  const Job job = job_of(
      BallRaster{"surface = \"rectangle\"\nlength_x_mm = 4\nlength_y_mm = 4\nat_mm = [3, 0, 80]\n"
                 "vertices = 500\nsampling = \"vertices\"\ntolerance_um = 10\n"});
  Cut cut = cut_at_random(job, [](const Vector3d&) { return 0.0; });
  cut.surface.within[50] = 0.013;
  const Verdict verdict = judge(job, std::move(cut), nullptr);
  const Vector3d p_w = cutting::value_at_sample(cutting::Surface::InteriorSample::Random,
                                                job.design_w.vertices, job.design_w.triangles, 50);
  ASSERT_TRUE(verdict.worst);
  EXPECT_EQ(verdict.worst->residual, 0.013);
  EXPECT_NEAR((verdict.worst->position_m - (p_w - Vector3d(3, 0, 80))).norm(), 0.0, 1e-12);
  EXPECT_EQ(verdict.worst->line, 1);
  EXPECT_TRUE(tolerance_verdict(verdict.residual.conformance, verdict.worst)
                  .starts_with("FAIL by 3 um at"));
}

TEST(Verdict, ARingOfAConeHasItsRadiusAtTheMiddle) {
  const Job job = job_of(
      BallRaster{"surface = \"cone\"\nbase_radius_mm = 10\nheight_mm = 4\nhalf_apex_deg = 45\n"
                 "at_mm = [0, 0, 80]\nvertices = 300\nsampling = \"vertices\"\n"
                 "[[part.ring]]\nname = \"middle\"\nalong_mm = 2\nwidth_mm = 0.5\n"});
  const Verdict verdict =
      judge(job, cut_at_random(job, [](const Vector3d&) { return 0.0; }), nullptr);
  ASSERT_EQ(verdict.rings.size(), 1u);
  ASSERT_TRUE(verdict.rings[0].radius);
  std::cout << "ring at half height: radius " << *verdict.rings[0].radius << " mm of 8\n";
  // a quarter of the width at most, by where the places of few triangles happen to lie
  EXPECT_NEAR(*verdict.rings[0].radius, 8.0, 0.1);
}

// Figures of one map fit together, on every packaged scene.

/// By how much the form leaves the range of the values within reach of the filter, at most, mm.
double beyond_range(const Job& job, const Verdict& verdict) {
  const cutting::Design& design = job.design_w;
  const cutting::Surface& surface = verdict.alignment.surface;
  const double cutoff = job.scene.part.form_cutoff;
  double worst = 0.0;
  test::ArealValues values;
  const auto add = [&](const Vector3d& point, double value) {
    values.point.push_back(point);
    values.value.push_back(value);
    values.area.push_back(1.0);
  };
  for (Index v = 0; v < design.vertices.rows(); ++v)
    if (std::isfinite(surface.residual[v])) add(design.vertices.row(v), surface.residual[v]);
  for (Index t = 0; t < surface.within.size(); ++t)
    if (std::isfinite(surface.within[t]))
      add(cutting::value_at_sample(surface.interior_sample, design.vertices, design.triangles, t),
          surface.within[t]);
  const Index step = 1 + design.vertices.rows() / 100;
  for (Index i = 0; i < design.vertices.rows(); i += step) {
    if (!std::isfinite(verdict.form_map[i])) continue;
    const test::BruteFilter brute =
        test::brute_filter(values, design.vertices.row(i), design.normals.row(i), cutoff, cutoff);
    worst = std::max({worst, brute.low - verdict.form_map[i], verdict.form_map[i] - brute.high});
  }
  return worst;
}

void expect_of_one_row(const cutting::Statistics& s, const std::string& name) {
  if (!s.pv || !s.rms) return;
  const double rounding = 1e-12;
  EXPECT_NEAR(*s.pv, *s.max - *s.min, rounding) << name;
  EXPECT_LE(*s.rms, std::max(std::abs(*s.min), std::abs(*s.max)) + rounding) << name;
  EXPECT_LE(*s.std_dev, 0.5 * *s.pv + rounding) << name;
  EXPECT_GE(*s.mean, *s.min - rounding) << name;
  EXPECT_LE(*s.mean, *s.max + rounding) << name;
  EXPECT_LE(*s.p95_abs, std::max(std::abs(*s.min), std::abs(*s.max)) + rounding) << name;
}

/// That vertices are few is this test's doing.
void expect_only_remarks(const std::string& scene, const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings)
    EXPECT_TRUE(is_remark(scene, warning) ||
                warning.find("too coarse for the machined surface") != std::string::npos ||
                warning.find("neighbouring judged vertices") != std::string::npos)
        << scene << " warns of itself: " << warning;
}

/// The case of a scene with so many vertices; false for one that makes no map.
bool expect_figures_of(const std::string& name, int vertices) {
  const Scene as_is = read_scene(packaged(name));
  if (std::holds_alternative<MeshFile>(as_is.part.shape) && vertices != 500) return false;
  std::vector<Override> few{{"part.sampling", "\"vertices\""}};
  if (!std::holds_alternative<MeshFile>(as_is.part.shape))
    few.push_back({"part.vertices", std::to_string(vertices)});
  const Job job = sampled(prepare(read_scene(packaged(name), few)));
  const Verdict verdict = judge(job, cut_error_free(job), nullptr);
  const std::string what = fmt::format("{}, {} vertices", name, job.design_w.vertices.rows());
  expect_of_one_row(verdict.residual, what);
  if (verdict.form_statistics) expect_of_one_row(*verdict.form_statistics, what + ", form");
  const Summary all = summary(job, verdict);
  if (all.figures.without_triangle_samples)
    expect_of_one_row(*all.figures.without_triangle_samples, what + ", vertices");
  expect_only_remarks(name.substr(0, name.find('.')), all.warnings);
  if (!verdict.residual.pv || !verdict.texture || !verdict.form_statistics) return true;
  const double beyond = beyond_range(job, verdict);
  std::cout << what << ": PV " << 1e3 * *verdict.residual.pv << " um, form "
            << 1e3 * *verdict.form_statistics->pv << ", Sz " << 1e3 * verdict.texture->Sz
            << ", form beyond its values by " << 1e3 * beyond << "\n";
  EXPECT_LE(*verdict.form_statistics->pv, *verdict.residual.pv + 1e-9) << what;
  // A map less its form has at most both their ranges. It comes near: where places at random carry
  // the form, its chance is in the texture.
  EXPECT_LE(verdict.texture->Sz, *verdict.residual.pv + *verdict.form_statistics->pv + 1e-9)
      << what;
  EXPECT_LE(beyond, 1e-9) << what;
  return true;
}

TEST(MapFigures, FormAndTextureLieWithinTheMapOnEveryScene) {
  const bool is_long = std::getenv("ABBE_LONG") != nullptr;
  int maps = 0;
  for (const std::string& name : packaged_scenes())
    for (const int vertices : is_long ? std::vector{500, 3000, 20000, 100000} : std::vector{500})
      maps += expect_figures_of(name, vertices);
  EXPECT_GT(maps, 15);
}

constexpr double ball = 3.0, depth = 6.0;
const std::array<Vector3d, 4> outer = {
    Vector3d{-20, -15, 0}, {20, -15, 0}, {20, 15, 0}, {-20, 15, 0}};
const std::array<Vector3d, 4> inner = {Vector3d{-14, -9, 0}, {14, -9, 0}, {14, 9, 0}, {-14, 9, 0}};

/// A block with a pocket, sharp all around, two triangles a face as a CAD writes it.
std::string pocket_stl() {
  std::string text = "solid pocket\n";
  const auto triangle = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const Vector3d& p : {a, b, c})
      text += fmt::format("vertex {} {} {}\n", p.x(), p.y(), p.z());
    text += "endloop\nendfacet\n";
  };
  const auto face = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c,
                        const Vector3d& d) {
    triangle(a, b, c);
    triangle(a, c, d);
  };
  const auto at = [](const Vector3d& p, double z) { return Vector3d(p.x(), p.y(), z); };
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t j = (i + 1) % 4;
    face(outer[i], outer[j], inner[j], inner[i]);
    face(at(outer[i], -12), at(outer[j], -12), outer[j], outer[i]);
    face(at(inner[j], -depth), at(inner[i], -depth), inner[i], inner[j]);
  }
  face(at(inner[0], -depth), at(inner[1], -depth), at(inner[2], -depth), at(inner[3], -depth));
  face(at(outer[3], -12), at(outer[2], -12), at(outer[1], -12), at(outer[0], -12));
  return text + "endsolid pocket\n";
}

/// Passes of the ball over the floor, 0.25 mm apart, as near to the walls as they let it.
std::string pocket_program(double z) {
  std::string text = fmt::format("G21 G90 G94\nG43 H1\nG0 X0 Y0 Z30\nF1000\nG1 Z{}\n", z);
  for (int i = 0; i <= 48; ++i) {
    const double x = i % 2 == 0 ? 11.0 : -11.0;
    text += fmt::format("G1 X{} Y{}\nG1 X{}\n", -x, -6.0 + 0.25 * i, x);
  }
  return text + "G0 Z30\nM30\n";
}

class Pocket : public testing::Test {
 protected:
  Job job(double z, const std::string& keys = "") {
    folder_.write("pocket.stl", pocket_stl());
    folder_.write("p.nc", pocket_program(z));
    folder_.write("ball.toml",
                  "name = \"ball R3\"\nkind = \"ball\"\nradius_mm = 3\nflank_length_mm = 12\n"
                  "length_mm = 50\n");
    return prepare(read_scene(
        folder_.write("s.toml", "machine = \"" + packaged("machines/gantry_cxyza.toml").string() +
                                    "\"\ntool = \"ball.toml\"\n"
                                    "[program]\nfile = \"p.nc\"\n"
                                    "work_offset.G54 = { X_mm = 40, Y_mm = 25, Z_mm = 80 }\n"
                                    "[part]\nfile = \"pocket.stl\"\nat_mm = [40, 25, 80]\n" +
                                    keys)));
  }
  SceneFolder folder_;
};

/// What the ball can make of the part by closed form: the floor under its passes, and the walls
/// above the round of its end. PV is the cusp.
TEST_F(Pocket, ThePartThatTheBallFitsIntoIsJudged) {
  const Job meant = sampled(job(-depth, "edge_margin_mm = 0\n"));
  const Verdict free = judge(meant, cut_error_free(meant), nullptr);
  const double floor_area = 22.0 * 12.0, walls = 2.0 * (22.0 + 12.0) * (depth - ball);
  const ExcludedArea& excluded_area = meant.sampled->excluded_area;
  const double cusp = ball - std::sqrt(ball * ball - 0.125 * 0.125);
  std::cout << "judged " << meant.sampled->judged_area << " of " << floor_area + walls
            << " mm^2; PV " << *free.residual.pv / units::um << " um of " << cusp / units::um
            << "; unreached " << excluded_area.unreached << ", corner " << excluded_area.corner
            << ", run-out " << excluded_area.lead_out_area << " mm^2\n";
  EXPECT_NEAR(meant.sampled->judged_area, floor_area + walls, 0.2 * (floor_area + walls));
  EXPECT_NEAR(meant.sampled->judged_area + excluded_area.area(), meant.design_w.area.sum(), 1e-9);
  EXPECT_GE(*free.residual.pv, 0.98 * cusp);
  EXPECT_LE(*free.residual.pv, cusp + 2e-4 * ball);
  EXPECT_GT(excluded_area.corner,
            300.0);  // floor within R of the walls, walls within R of the floor
  EXPECT_GT(excluded_area.max_remaining_height, 1.0);
  EXPECT_HAS(exclusion_text(*meant.sampled), "where the tool's corner radius of 3 mm does not fit");
  const auto wide = sampled(job(-depth, "edge_margin_mm = 0\njudged = \"all\"\n"));
  EXPECT_EQ(wide.sampled->excluded_area.area(), 0.0);
  EXPECT_GT(*judge(wide, cut_error_free(wide), nullptr).residual.pv, 1.0);
}

/// The floor is cut too deep from above: it is the floor's gouge, of no wall around it.
TEST_F(Pocket, AGougeOfTheFloorIsNoneOfTheWallsAround) {
  const Job deep = sampled(job(-depth - 2.5, "judged = \"all\"\n"));
  const cutting::Surface surface = cut_error_free(deep).surface;
  int of_floor = 0, of_others = 0;
  for (const cutting::Gouge& gouge : surface.gouges) {
    const double z = deep.design_w.vertices(gouge.vertex, 2) - 80.0;
    (std::abs(z + depth) < 1e-9 ? of_floor : of_others) += 1;
  }
  std::cout << of_floor << " vertices of the floor gouged, " << of_others << " of others\n";
  EXPECT_GT(of_floor, 20);
  EXPECT_EQ(of_others, 0);
}

TEST_F(Pocket, ALaterRegionWithoutAToleranceHasThatOfThePart) {
  const Job made = job(-depth,
                       "tolerance_um = 50\n[[part.region]]\nname = \"pocket\"\ntolerance_um = 5\n"
                       "box_mm = [-14, -9, -6, 14, 9, 0]\n[[part.region]]\nname = \"left half\"\n"
                       "box_mm = [-20, -15, -12, 0, 15, 0]\n");
  const auto bands = tolerance_bands(made.scene.part, made.face_groups, made.design_w);
  int right = 0, left = 0;
  for (Index i = 0; i < bands.rows(); ++i) {
    const Vector3d p = made.design_w.vertices.row(i).transpose() - Vector3d(40, 25, 80);
    const bool in_pocket =
        std::abs(p.x()) < 14.000001 && std::abs(p.y()) < 9.000001 && p.z() > -6.000001;
    const bool is_left = p.x() < 1e-6;
    EXPECT_EQ(bands(i, 1), in_pocket && !is_left ? 5e-3 : 50e-3) << p.transpose();
    (is_left ? left : right) += in_pocket;
  }
  EXPECT_GT(left, 4);
  EXPECT_GT(right, 4);
}

}  // namespace
}  // namespace abbe::sim
