// The composite law from readings to a correction: what `identify --method composite` writes is
// what [belief] reads, and the cold slope counts once.

#include <cmath>
#include <iostream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "errors/element.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/commands/calibration_commands.h"
#include "sim/compensation/machine_belief.h"
#include "sim/files/output.h"
#include "sim/machine/truth.h"
#include "sim/report/identification_report.h"
#include "sim/report/verdict.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/measured_scene.h"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;
using namespace abbe::literals;
using Json = nlohmann::ordered_json;

/// A machine whose X stretches with one node, which the work of X warms; read at five times.
std::string stretching(const std::string& errors) {
  return errors +
         "[[history]]\nduration_h = 1\n"
         "[[history]]\nduration_h = 2\naxis_speed_mm_per_min = { X = 12000 }\n"
         "[thermal]\nreference_C = 15\n"
         "[[thermal.node]]\nname = \"nut\"\ncapacity_J_per_K = 2000\n"
         "[[thermal.link]]\nbetween = [\"nut\", \"room\"]\nconductance_W_per_K = 3\n"
         "[[thermal.source]]\nnode = \"nut\"\nkind = \"axis\"\naxis = \"X\"\ncoulomb_N = 200\n"
         "[[thermal.element]]\nname = \"EXX\"\nslope = { node = \"nut\", um_per_m_K = 3 }\n"
         "[[thermal.sensor]]\nname = \"T\"\nnode = \"nut\"\noffset_K = 0.3\n"
         "[[instrument]]\nkind = \"laser\"\naxes = [\"X\"]\nscatter = 0\nruns = 1\n"
         "speed_mm_per_min = 60000\ndwell_s = 0\nset_up_min = 0\nnoise_um = 0\nresolution_um = 0\n"
         "alignment_urad = 0\nscale_um_per_m = 0\nposition_um = 0\n"
         "start_h = [-2.5, -1.9, -1.5, -1, -0.1]\n";
}

const char* curved =
    "[errors.EXX]\nkind = \"polynomial\"\ncoefficients_um = [2, 30, 5, -4]\nhalf_range_mm = 300\n";

struct Beliefs {
  std::filesystem::path cold, thermal;
  IdentificationResult found;
  Json report;
};

Beliefs separated(const Scene& scene, const SceneFolder& folder,
                  const std::vector<std::string>& sensors, double margin = 0.1) {
  const auto readings =
      folder.write("laser.csv", to_text(measure_machine(scene, find_instrument(scene, "laser"))));
  IdentificationOptions options;
  options.method = IdentificationOptions::Method::Composite;
  options.sensors = sensors;
  options.margin = margin;
  options.out = folder.path() / "b.toml";
  Beliefs beliefs{options.out, folder.path() / "b_thermal.txt", identify({readings}, options), {}};
  beliefs.report = to_json(beliefs.found);
  return beliefs;
}

double polynomial(const std::initializer_list<double>& c, double t) {
  double value = 0.0, power = 1.0;
  for (const double one : c) {
    value += one * power;
    power *= t;
  }
  return value;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + 1))
    text.replace(at, from.size(), to);
  return text;
}

/// The gantry with a slide U where X was, which is all that is said of it.
fs::path gantry_of_u(const SceneFolder& folder) {
  const std::string gantry = read_text(packaged("machines/gantry_cxyza.toml"), 1 << 20);
  return folder.write("gantry_u.toml", replaced(replaced(replaced(gantry, " X Y Z A", " U Y Z A"),
                                                         "axis.X", "axis.U"),
                                                "carried_by = \"X\"", "carried_by = \"U\""));
}

// Of a tool-side X, of a table X', whose carriage goes the other way, and of a U along X.
TEST(CompositeBelief, BothHalvesAreThoseOfTheCarriageOnEitherSide) {
  for (const std::string machine : {"gantry_cxyza", "three_axis_table", "gantry_u"}) {
    const SceneFolder folder;
    const bool is_u = machine == "gantry_u";
    const fs::path file = is_u ? gantry_of_u(folder) : packaged("machines/" + machine + ".toml");
    std::string text = stretching(curved);
    if (is_u)
      text = replaced(replaced(replaced(text, "EXX", "EXU"), "\"X\"", "\"U\""), "{ X", "{ U");
    const std::vector<Override> on_it{{"machine", "\"" + file.string() + "\""}};
    const Scene scene = scene_of(measured_scene(text), on_it);
    const Beliefs beliefs = separated(scene, folder, {"T"});
    const auto chain = make_machine(scene).nominal;
    const int x = *chain.find(is_u ? 'U' : 'X');
    const auto cold =
        errors::bind(read_scene(packaged("gantry_perfect.toml"),
                                {on_it[0], {"errors", "\"" + beliefs.cold.string() + "\""}})
                         .geometric,
                     chain);
    const auto thermal = compensation::parse_thermal_belief(read_text(beliefs.thermal, 1 << 20),
                                                            beliefs.thermal.string());
    ASSERT_EQ(thermal.terms.size(), 1u);
    EXPECT_FALSE(thermal.since_start) << "its temperatures are absolute";
    // the sensor says 0.3 K more, cold and warm
    const double cold_C = beliefs.report["composite"][0]["zero_of_dT_C"]["T"];
    EXPECT_NEAR(cold_C, 20.3, 1e-9);
    EXPECT_EQ(beliefs.report["composite"][0]["zero_of_dT"], "start 1");
    for (const double T_C : {20.3, 25.0, 33.3}) {
      compensation::ControlLog log;
      log.time_s = Eigen::VectorXd::Zero(1);
      log.names = {"T_C"};
      log.values = Eigen::MatrixXd::Constant(1, 1, T_C);
      const auto course = compensation::thermal_series(thermal, log, chain);
      for (const double p : {-250.0, 0.0, 100.0, 280.0}) {
        kinematics::AxisState state;
        state.q = kinematics::AxisVector::Zero(chain.size());
        state.q[x] = p;
        state.direction.fill(1);
        const auto joint = std::size_t(x);
        const double believed = errors::deviations(cold, state)[joint].motion[0] +
                                compensation::deviations(course, state)[joint].motion[0];
        // by hand: the curve, 15 um/m at 20 C against the reference of 15, 3 um/m/K from there; the
        // zero of a laser lies at the target nearest to 0
        const double slope = 3e-6 * (T_C - 0.3 - 15.0);
        const double truth = polynomial({0.0, 30e-3, 5e-3, -4e-3}, p / 300.0) + slope * p;
        EXPECT_NEAR(believed, truth, 0.1_um) << machine << ", " << p << " mm at " << T_C << " C";
      }
    }
  }
}

/// The packaged scene, coarse, on one of its days, believing in the files given.
Job packaged_day(const std::string& day, const Beliefs& beliefs) {
  std::vector<Override> changes{{"part.vertices", "400"},
                                {"program.step_over_mm", "2"},
                                {"program.step_mm", "4"},
                                {"belief.identified", "\"" + beliefs.cold.string() + "\""},
                                {"belief.thermal.file", "\"" + beliefs.thermal.string() + "\""}};
  const Scene scene = read_scene(packaged("yang_composite.toml"), changes);
  for (const Variant& variant : scene.variants)
    if (variant.name == day) changes.insert(changes.end(), variant.set.begin(), variant.set.end());
  return job_of("yang_composite.toml", changes);
}

TEST(CompositeBelief, YangsAxisIsSeparatedAndCorrectedOnDaysThatNobodyMeasured) {
  const SceneFolder folder;
  const Scene scene = read_scene(packaged("yang_composite.toml"));
  const Beliefs beliefs = separated(scene, folder, {"T7_screw", "T8_nut"}, 0.5);
  const Json& axis = beliefs.report["composite"][0];
  std::cout << "per K: screw " << axis["slope_um_per_m_K"]["T7_screw"] << ", nut "
            << axis["slope_um_per_m_K"]["T8_nut"] << " um/m (Yang -0.496, 3.360)\n";
  EXPECT_NEAR(axis["slope_um_per_m_K"]["T7_screw"].get<double>(), -0.496, 0.15);
  EXPECT_NEAR(axis["slope_um_per_m_K"]["T8_nut"].get<double>(), 3.3601, 0.1);
  // the shipped files are these
  const auto text = [](const std::filesystem::path& file) {
    std::string all = read_text(file, 1 << 20), bare;
    for (std::size_t at = 0; at < all.size();) {
      const std::size_t end = std::min(all.find('\n', at), all.size());
      if (all[at] != '#') bare += all.substr(at, end - at) + "\n";
      at = end + 1;
    }
    return bare;
  };
  EXPECT_EQ(text(beliefs.cold), text(packaged("beliefs/yang_composite.toml")));
  EXPECT_EQ(text(beliefs.thermal), text(packaged("beliefs/yang_composite_thermal.txt")));
  for (const char* day : {"cold", "3 h", "another day"}) {
    const Job job = packaged_day(day, beliefs);
    const double before = machine_um(job),
                 cold = machine_um(job, parse_case("identified-position-ideal")),
                 both = machine_um(job, parse_case("composite-position-ideal"));
    std::cout << fmt::format("{:12} {:.3f} um RMS, cold curve alone {:.3f}, composite {:.3f}\n",
                             day, before, cold, both);
    EXPECT_LT(both, 0.7) << day;
    if (std::string(day) == "cold")
      EXPECT_LT(cold, 0.7) << "the cold slope is in the curve, once";
    else
      EXPECT_LT(both, 0.1 * cold) << day;
  }
}

TEST(CompositeBelief, AThermalHalfThatMayNotBeWrittenIsRefusedBeforeTheWork) {
  const SceneFolder folder;
  folder.write("b_thermal.txt", "somebody's own");
  const Scene scene = scene_of(measured_scene(stretching(curved)));
  EXPECT_THROW(separated(scene, folder, {"no such sensor"}), OutputFailure);
  EXPECT_FALSE(fs::exists(folder.path() / "b.toml"));
  EXPECT_EQ(read_text(folder.path() / "b_thermal.txt", 100), "somebody's own");
}

TEST(CompositeBelief, SaysWhereTheLaterStartsDoNotMeetTheColdOne) {
  const SceneFolder folder;
  // the first start is not cold: a node that no sensor sees has warmed by then and cools
  std::string hidden = stretching(curved);
  const auto swap = [&](const std::string& from, const std::string& to) {
    const std::size_t at = hidden.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    hidden.replace(at, from.size(), to);
  };
  swap("[[thermal.source]]",
       "[[thermal.node]]\nname = \"screw\"\ncapacity_J_per_K = 1000\nstart_C = 40\n"
       "[[thermal.link]]\nbetween = [\"screw\", \"room\"]\nconductance_W_per_K = 1.5\n"
       "[[thermal.source]]");
  swap("slope = { node = \"nut\", um_per_m_K = 3 }",
       "slope = [{ node = \"nut\", um_per_m_K = 3 }, { node = \"screw\", um_per_m_K = 5 }]");
  swap("-2.5, -1.9", "-3, -1.9");
  const Scene scene = scene_of(measured_scene(hidden));
  const Beliefs beliefs = separated(scene, folder, {"T"});
  ASSERT_FALSE(beliefs.report["warnings"].empty());
  EXPECT_NE(beliefs.report["warnings"].dump().find("start 1"), std::string::npos)
      << beliefs.report["warnings"];
  EXPECT_NE(identification_text(beliefs.found).find("dT = 0"), std::string::npos);
}

}  // namespace
}  // namespace abbe::sim
