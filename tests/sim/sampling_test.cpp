#include <complex>
#include "cutting/map/areal_filter.h"
#include "sim/cut/judged_surface.h"
#include "sim/cut/sweep.h"
#include "sim/report/verdict.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

const char* const small_dome =
    "surface = \"sphere_cap\"\nradius_mm = 100\nrim_radius_mm = 9\nat_mm = [40, 25, 80]\n";

Verdict uncompensated(const Job& job) { return judge(job, cut(job), nullptr); }

TEST(Sampling, FormDoesNotDependOnTheVerticesThatAPartBeginsWith) {
  std::vector<double> pv, rms, raw;
  const bool is_long = std::getenv("ABBE_LONG") != nullptr;
  for (const int vertices : is_long ? std::vector{300, 2000, 12000} : std::vector{300, 12000}) {
    const std::string part =
        small_dome +
        fmt::format("vertices = {}\nsampling = \"adaptive\"\nresolution_um = 0.1\n", vertices);
    const Job given =
        job_of(BallRaster{.part = part, .more = "[errors]\nEYX_um = 6\nEC0Y_urad = 60\n"});
    const Verdict verdict = uncompensated(sampled(given));
    pv.push_back(*verdict.form_statistics->pv);
    rms.push_back(*verdict.form_statistics->rms);
    raw.push_back(*uncompensated(given).residual.pv);
    std::cout << vertices << " vertices: " << verdict.cut.surface.residual.size() << ", form PV "
              << pv.back() / units::um << " um, RMS " << rms.back() / units::um
              << " um; interpolation off by " << verdict.cut.interpolation->worst / units::um
              << " um; PV at the vertices alone " << raw.back() / units::um << "\n";
  }
  for (std::size_t i = 1; i < pv.size(); ++i) {
    EXPECT_NEAR(pv[i] / pv[0], 1.0, 0.01);
    EXPECT_NEAR(rms[i] / rms[0], 1.0, 0.01);
  }
}

/// The residual on a line of the design, by interpolation between its vertices; NaN off it.
std::vector<double> along_y(const cutting::Design& design, const VectorXd& residual, double x,
                            double from, double to, int count) {
  std::vector<double> values(std::size_t(count), std::nan(""));
  for (const auto& t : design.triangles.rowwise()) {
    const Vector3d a = design.vertices.row(t[0]), b = design.vertices.row(t[1]),
                   c = design.vertices.row(t[2]);
    if (std::max({a.x(), b.x(), c.x()}) < x || std::min({a.x(), b.x(), c.x()}) > x) continue;
    const double det = (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
    if (!(det > 0.0)) continue;
    const double step = (to - from) / (count - 1);
    const double low = std::min({a.y(), b.y(), c.y()}), high = std::max({a.y(), b.y(), c.y()});
    for (int i = std::max(0, int(std::ceil((low - from) / step)));
         i < count && from + i * step <= high; ++i) {
      const Vector3d p(x, from + i * step, 0.0), d = p - a;
      const double v = (d.x() * (c - a).y() - d.y() * (c - a).x()) / det;
      const double w = ((b - a).x() * d.y() - (b - a).y() * d.x()) / det;
      if (v < -1e-9 || w < -1e-9 || v + w > 1.0 + 1e-9) continue;
      values[std::size_t(i)] =
          (1.0 - v - w) * residual[t[0]] + v * residual[t[1]] + w * residual[t[2]];
    }
  }
  return values;
}

/// Amplitude of a wave of so many periods over equally spaced values, seen through a Hann window.
double amplitude(const std::vector<double>& values, double periods) {
  std::complex<double> sum = 0.0;
  const double n = double(values.size());
  double mean = 0.0;
  for (const double v : values) mean += v / n;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double window = 1.0 - std::cos(2 * pi * (double(i) + 0.5) / n);
    sum += window * (values[i] - mean) * std::polar(1.0, -2 * pi * periods * double(i) / n);
  }
  return 2.0 * std::abs(sum) / n;
}

/// A closed body of a wavy top, its facets `spacing` apart, with walls down to z = -8.
std::string wavy_stl(double side, double spacing) {
  const int n = int(std::lround(side / spacing));
  const auto top = [](double x, double y) { return 1.5 * std::sin(x / 9.0) * std::cos(y / 11.0); };
  const auto at = [&](int i, int j) {
    const double x = side * (double(i) / n - 0.5), y = side * (double(j) / n - 0.5);
    return Vector3d(x, y, top(x, y));
  };
  std::string text = "solid wavy\n";
  const auto add = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const Vector3d& p : {a, b, c})
      text += fmt::format("vertex {:.9g} {:.9g} {:.9g}\n", p.x(), p.y(), p.z());
    text += "endloop\nendfacet\n";
  };
  const auto low = [](const Vector3d& p) { return Vector3d(p.x(), p.y(), -8.0); };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const Vector3d a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
      add(a, b, c);
      add(a, c, d);
      add(low(a), low(c), low(b));
      add(low(a), low(d), low(c));
    }
  for (int i = 0; i < n; ++i)
    for (const auto& [p, q] : {std::pair(at(i, 0), at(i + 1, 0)),
                               {at(n, i), at(n, i + 1)},
                               {at(i + 1, n), at(i, n)},
                               {at(0, i + 1), at(0, i)}}) {
      add(p, low(p), q);
      add(q, low(p), low(q));
    }
  return text + "endsolid\n";
}

/// Range of the error-free cut over its vertices as given and at so many places at random of every
/// triangle whose corners are cut.
double range_of_many_places(const Job& job, const cutting::Surface& surface, int a_triangle) {
  const Sweep sweep = make_sweep(error_free_sweeps(job), surface_options(job, {}));
  const cutting::SurfaceInterpolator between = surface_interpolator(job);
  std::mt19937_64 random(71);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<cutting::Contact> places;
  for (const auto& t : job.design_w.triangles.rowwise()) {
    std::array<cutting::Contact, 3> corners;
    bool is_cut = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const int v = t[Index(k)];
      corners[k] = {job.design_w.vertices.row(v), job.design_w.normals.row(v)};
      is_cut = is_cut && surface.status[std::size_t(v)] == cutting::VertexStatus::Cut;
    }
    for (int i = 0; is_cut && i < a_triangle; ++i) {
      const double root = std::sqrt(unit(random)), share = unit(random);
      const std::array<double, 3> weights = {1.0 - root, root * share, root * (1.0 - share)};
      places.push_back(between(corners, weights));
    }
  }
  double low = 1.0, high = -1.0;
  for (const double r : sweep.surface(cutting::design_from_points(places)).residual) {
    low = std::fmin(low, r);
    high = std::fmax(high, r);
  }
  return high - low;
}

TEST(Sampling, TheMapOfAForeignMeshShowsItsPassesAndNothingElse) {
  const SceneFolder folder;
  folder.write("wavy.stl", wavy_stl(14.0, 0.444));
  const BallRaster raster{.part = "file = \"wavy.stl\"\nat_mm = [40, 25, 80]\n", .step_over = 0.5};
  const Scene scene = read_scene(folder.write("wavy.toml", to_toml(raster)));
  const Job job = sampled(prepare(scene));
  const Cut free = cut_error_free(job);
  const cutting::Design design_m = cutting::transformed(job.design_w, scene.part.T_wm.inverse());
  std::cout << job.sampled->given << " vertices given, " << design_m.vertices.rows()
            << " sampled to " << job.sampled->resolution / units::um << " um; off by "
            << free.interpolation->worst / units::um << " um at most, "
            << 100 * free.interpolation->unresolved << " % beyond\n";
  EXPECT_LT(free.interpolation->unresolved, 0.01);
  const double pv = *cutting::statistics(free.surface, job.design_w).pv;
  const double brute = range_of_many_places(job, free.surface, 10);
  std::cout << "PV " << pv / units::um << " um, of many places " << brute / units::um << " um\n";
  EXPECT_NEAR(pv / brute, 1.0, 0.02);
  constexpr double length = 8.0;  // mm, 16 passes
  const std::vector<double> line =
      along_y(design_m, free.surface.residual, 0.3, -0.5 * length, 0.5 * length, 1601);
  for (const double value : line) ASSERT_TRUE(std::isfinite(value));
  double cusp = 0.0, other = 0.0, other_at = 0.0;
  for (double periods = 3.0; periods < 400.0; periods += 0.5) {
    const double seen = amplitude(line, periods), order = periods * 0.5 / length;
    // passes, their harmonics, and the width of a line of the window
    if (std::abs(order - std::round(order)) * length / 0.5 < 2.6 && order > 0.5) {
      cusp = std::max(cusp, seen);
    } else if (seen > other) {
      other = seen;
      other_at = length / periods;
    }
  }
  std::cout << "waves of the passes " << cusp / units::um << " um, all others below "
            << other / units::um << " um (at " << other_at << " mm)\n";
  EXPECT_GT(cusp, 1.0 * units::um);
  EXPECT_LT(other, 0.05 * cusp);
}

TEST(Sampling, PVOfTheErrorFreeCutIsThatOfManyPlaces) {
  const Job job = sampled(job_of(
      BallRaster{.part = std::string(small_dome) + "vertices = 500\nsampling = \"adaptive\"\n"}));
  const Verdict verdict = judge(job, cut_error_free(job), nullptr);
  const Sweep sweep = make_sweep(error_free_sweeps(job), surface_options(job, {}));
  cutting::Primitive cap = cutting::SphereCap{100.0, 9.0};
  const cutting::Design many =
      cutting::transformed(cutting::tessellate(cap, {200000}), job.scene.part.T_wm);
  const cutting::Surface brute = sweep.surface(many);
  double low = 1.0, high = -1.0;
  for (const double r : brute.residual) {
    low = std::min(low, r);
    high = std::max(high, r);
  }
  std::cout << "PV " << *verdict.residual.pv / units::um << " um of " << many.vertices.rows()
            << " places " << (high - low) / units::um << " um\n";
  EXPECT_NEAR(*verdict.residual.pv / (high - low), 1.0, 0.02);
}

TEST(Sampling, MeanAndRmsOfTheErrorFreeCutAreThoseOfManyPlaces) {
  // at every bound, though straight lines between vertices on crests fill the hollows
  const Job fine = job_of(BallRaster{.part = small_dome, .more = "[errors]\nEYX_um = 6\n"});
  const Sweep sweep = make_sweep(error_free_sweeps(fine), surface_options(fine, {}));
  cutting::Primitive cap = cutting::SphereCap{100.0, 9.0};
  const cutting::Design many =
      cutting::transformed(cutting::tessellate(cap, {200000}), fine.scene.part.T_wm);
  const cutting::Statistics exact = cutting::statistics(sweep.surface(many), many);
  for (const double resolution_um : {0.1, 0.3, 1.0}) {
    const Job job = sampled(job_of(BallRaster{
        .part = fmt::format("{}sampling = \"adaptive\"\nvertices = 500\nresolution_um = {}\n",
                            small_dome, resolution_um)}));
    Cut free = cut_error_free(job);
    const cutting::Statistics seen = cutting::statistics(free.surface, job.design_w);
    free.surface.within.resize(0);
    const cutting::Statistics straight = cutting::statistics(free.surface, job.design_w);
    std::cout << resolution_um << " um, " << seen.vertices << " vertices: mean "
              << *seen.mean / *exact.mean << ", rms " << *seen.rms / *exact.rms
              << " of that of many places; straight lines " << *straight.mean / *exact.mean << ", "
              << *straight.rms / *exact.rms << "\n";
    EXPECT_NEAR(*seen.mean / *exact.mean, 1.0, 0.01 + 0.03 * resolution_um);
    EXPECT_NEAR(*seen.rms / *exact.rms, 1.0, 0.01 + 0.03 * resolution_um);
  }
}

/// The scenes of the README, and a mesh.
TEST(Sampling, TenThousandPlacesOfTheFirstScenesAreWithinTheirBound) {
  if (std::getenv("ABBE_LONG") == nullptr) GTEST_SKIP() << "ABBE_LONG=1 cuts whole scenes";
  for (const auto& [name, allowed] :
       {std::pair("gantry_dome", 0.0), {"gantry_calibration", 0.0}, {"gantry_mesh", 0.001}}) {
    const Job job = sampled(job_of(std::string(name) + ".toml"));
    const Sweep sweep = make_sweep(error_free_sweeps(job), surface_options(job, {}));
    const auto error = cutting::interpolation_error(
        job.design_w, sweep.surface(job.design_w), surface_interpolator(job), sweep.surface,
        {.places = 10000, .seed = 77, .resolution = job.sampled->resolution});
    std::cout << name << ": " << job.design_w.vertices.rows() << " vertices, bound "
              << error.resolution / units::um << " um; of " << error.places << " places the worst "
              << error.worst / units::um << " um off, " << 100.0 * error.unresolved
              << " % beyond\n";
    EXPECT_GT(error.places, 9900) << name;
    EXPECT_LE(error.unresolved, allowed) << name;
    EXPECT_LE(error.worst, 1.25 * error.resolution) << name;
  }
}

TEST(Sampling, JudgesWhatTheProgramMeansToCut) {
  const SceneFolder folder;
  folder.write("wavy.stl", wavy_stl(10.0, 1.0));
  const BallRaster raster{.part =
                              "file = \"wavy.stl\"\nat_mm = [40, 25, 80]\nsampling = "
                              "\"vertices\"\nedge_margin_mm = 0\n"};
  const auto file = folder.write("wavy.toml", to_toml(raster));
  const Job meant = sampled(prepare(read_scene(file)));
  const Job all = sampled(prepare(read_scene(file, {{"part.judged", "\"all\""}})));
  const Verdict of_meant = uncompensated(meant), of_all = uncompensated(all);
  EXPECT_EQ(of_meant.residual.uncut_vertices, 0);
  EXPECT_GT(of_all.residual.uncut_vertices, 100);
  EXPECT_NEAR(*of_meant.residual.pv, *of_all.residual.pv, 1e-12);
  const cutting::Surface &left = of_meant.cut.surface, &whole = of_all.cut.surface;
  for (std::size_t i = 0; i < left.status.size(); ++i) {
    if (left.status[i] != cutting::VertexStatus::Cut) continue;
    EXPECT_EQ(left.residual[Index(i)], whole.residual[Index(i)]);
  }
  EXPECT_GT(meant.sampled->excluded_area.unreached, 0.0);
  EXPECT_NEAR(meant.sampled->judged_area + meant.sampled->excluded_area.area(),
              meant.design_w.area.sum(), 1e-9);
  EXPECT_GT(meant.sampled->judged_area, 90.0);
  EXPECT_LT(meant.sampled->judged_area, 0.8 * all.sampled->judged_area);
  EXPECT_HAS(warnings_of(meant, of_meant.cut).front(), "is intended to cut");
}

TEST(Sampling, ACaseWithErrorsIsCutOnTheSameVertices) {
  const std::string part =
      std::string(small_dome) + "vertices = 300\nsampling = \"adaptive\"\npoints = 3000\n";
  const Job free = sampled(job_of(BallRaster{.part = part}));
  const Job wrong = sampled(job_of(BallRaster{.part = part, .more = "[errors]\nEXX_um = 9\n"}));
  EXPECT_EQ(free.design_w.vertices, wrong.design_w.vertices);
  EXPECT_LE(free.design_w.vertices.rows(), 3000);
  const Cut cut_wrong = cut(wrong);
  const auto warned = [&](const char* text) {
    return std::any_of(cut_wrong.warnings.begin(), cut_wrong.warnings.end(),
                       [&](const auto& one) { return one.find(text) != std::string::npos; });
  };
  EXPECT_EQ(warned("the map is too coarse"), cut_wrong.interpolation->unresolved > 0.02);
}

/// Equal to the bit, where one is not a number the other is none either.
void expect_same(const VectorXd& a, const VectorXd& b) {
  ASSERT_EQ(a.size(), b.size());
  for (Index i = 0; i < a.size(); ++i)
    ASSERT_TRUE(a[i] == b[i] || (std::isnan(a[i]) && std::isnan(b[i]))) << a[i] << " " << b[i];
}

TEST(Sampling, TheErrorFreeSurfaceThatIsKeptIsThatOfTheCut) {
  // blocks of 3 mm cut 11 um into the dome, and a band of 4 um leaves crests of 25 um uncut
  for (const std::string kind : {"adaptive", "spacing", "vertices"}) {
    const Job job = sampled(job_of(BallRaster{
        .part = fmt::format("{}vertices = 600\nsampling = \"{}\"\njudged = \"all\"\n{}", small_dome,
                            kind, kind == "spacing" ? "spacing_mm = 0.5\n" : ""),
        .step_over = 1.0,
        .step = 3.0,
        .more = "[search]\nband_mm = 0.004\n"}));
    const cutting::Surface& kept = *job.sampled->error_free;
    const cutting::Surface fresh =
        machined_surface(job.design_w, error_free_sweeps(job), surface_options(job, {}));
    std::cout << kind << ": " << kept.residual.size() << " vertices, " << kept.gouges.size()
              << " gouges\n";
    const auto count = [&](cutting::VertexStatus status) {
      return std::count(kept.status.begin(), kept.status.end(), status);
    };
    EXPECT_GT(count(cutting::VertexStatus::Uncut), 10);
    EXPECT_GT(count(cutting::VertexStatus::Gouged), 10);
    expect_same(kept.residual, fresh.residual);
    expect_same(kept.cut_time_s, fresh.cut_time_s);
    EXPECT_EQ(kept.cut_line, fresh.cut_line);
    EXPECT_EQ(kept.status, fresh.status);
    ASSERT_EQ(kept.gouges.size(), fresh.gouges.size());
    for (std::size_t i = 0; i < fresh.gouges.size(); ++i) {
      EXPECT_EQ(kept.gouges[i].vertex, fresh.gouges[i].vertex);
      EXPECT_EQ(kept.gouges[i].depth, fresh.gouges[i].depth);
      EXPECT_EQ(kept.gouges[i].continues_deeper, fresh.gouges[i].continues_deeper);
    }
  }
}

TEST(Sampling, BySpacingAndByVertices) {
  const std::string part = std::string(small_dome) + "vertices = 300\n";
  const Job spaced =
      sampled(job_of(BallRaster{.part = part + "sampling = \"spacing\"\nspacing_mm = 0.5\n"}));
  double longest = 0.0;
  for (const auto& t : spaced.design_w.triangles.rowwise())
    for (int k = 0; k < 3; ++k)
      longest = std::max(longest, (spaced.design_w.vertices.row(t[k]) -
                                   spaced.design_w.vertices.row(t[(k + 1) % 3]))
                                      .norm());
  EXPECT_LE(longest, 0.5);
  const Job given = job_of(BallRaster{.part = part + "sampling = \"vertices\"\n"});
  EXPECT_EQ(sampled(given).design_w.vertices, given.design_w.vertices);
}

TEST(Sampling, ACoarseMapIsJudgedByItsFormWhereThatIsFineEnough) {
  const auto said = [](const char* cutoff, const char* text) {
    const Job job = sampled(job_of(BallRaster{.part = std::string(small_dome) +
                                                      "vertices = 300\nsampling = \"vertices\"\n" +
                                                      "form_cutoff_mm = " + cutoff + "\n"}));
    const Cut made = cut(job);
    return std::ranges::any_of(made.warnings, [&](const std::string& warning) {
      return warning.find("the map is too coarse") != std::string::npos &&
             warning.find(text) != std::string::npos;
    });
  };
  EXPECT_TRUE(said("8", "judge by form_um, or raise"));
  EXPECT_TRUE(said("0.1", "form_um is no better, with "));
}

}  // namespace
}  // namespace abbe::sim
