// Location elements on the packaged machines: by definition, by the instruments, by `check`.

#include "errors/coefficients.h"
#include "errors/identification/estimate.h"
#include "errors/identification/model.h"
#include "sim/commands/calibration_commands.h"
#include "sim/machine/machine.h"
#include "sim/machine/truth.h"
#include "sim/report/check_report.h"
#include "sim/report/evaluation_report.h"
#include "sim/scene/read_scene.h"
#include "tests/errors/location_net.h"
#include "tests/sim/measured_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using Json = nlohmann::ordered_json;
namespace net = errors::net;

/// A scene on one of the packaged machines, those for turning in scenes of their own.
Scene scene_on(const std::string& machine, const std::string& errors = {}) {
  if (machine == "platform_xz") return read_scene(packaged("platform_perfect.toml"));
  if (machine == "lathe_zx") return read_scene(packaged("stepped_shaft.toml"));
  return scene_of(measured_scene(errors, machine));
}

TEST(LocationMachines, EveryElementOfThePackagedMachinesIsWhatItIsByDefinition) {
  net::Misses misses;
  int machines = 0;
  for (const fs::directory_entry& file : fs::directory_iterator(packaged("machines"))) {
    const std::string machine = file.path().stem().string();
    const kinematics::Chain chain = make_machine(scene_on(machine)).nominal;
    std::cout << machine << " " << net::code_of(chain) << ": "
              << net::location_elements(chain).size() << " location elements\n";
    net::expect_location_elements(chain, misses);
    net::expect_error_motions(chain, misses);
    ++machines;
  }
  net::print("packaged machines", misses);
  EXPECT_GE(machines, 6);
}

struct Squareness {
  const char* plane;
  const char* element;
  double injected;  ///< urad
  double opened;    ///< urad, of the angle between the two axes
};
const Squareness squarenesses[] = {
    {"XY", "EC0Y", 40, 40}, {"XZ", "EB0Z", -30, 30}, {"YZ", "EA0Z", 25, 25}};

const char* const of_three_slides[] = {"gantry_cxyza", "three_axis_table", "trunnion_ca",
                                       "head_head"};

Json evaluated(const Scene& scene, const std::string& instrument) {
  const SceneFolder folder;
  const auto file =
      folder.write("r.csv", to_text(measure_machine(scene, faultless(scene, instrument))));
  return to_json(evaluate(file).evaluation);
}

/// What an evaluation says of the squareness in a plane, urad.
std::map<std::string, double> squareness_by_plane(const Json& evaluation) {
  std::map<std::string, double> result;
  for (const Json& test : evaluation["tests"]) {
    const std::string name = test["name"];
    if (test.contains("causes") && !test["causes"]["squareness_urad"].is_null())
      result[test["plane"]] = test["causes"]["squareness_urad"]["value"];
    if (test.contains("squareness_urad")) result[name.substr(0, 2)] = test["squareness_urad"];
  }
  return result;
}

TEST(LocationMachines, BallBarAndSquareReadEverySquarenessOnEveryMachine) {
  for (const char* machine : of_three_slides)
    for (const Squareness& one : squarenesses) {
      const Scene scene =
          scene_on(machine, fmt::format("[errors]\n{}_urad = {}\n", one.element, one.injected));
      for (const char* instrument : {"ball_bar", "square"}) {
        const auto seen = squareness_by_plane(evaluated(scene, instrument));
        EXPECT_TRUE(seen.count(one.plane)) << machine << " " << instrument;
        for (const auto& [plane, value] : seen) {
          const double expected = plane == one.plane ? one.opened : 0.0;
          EXPECT_NEAR(value, expected, 0.02) << machine << " " << one.element << " " << instrument;
          if (plane == one.plane)
            std::cout << machine << " " << one.element << " by " << instrument << ": " << value
                      << " urad of " << expected << "\n";
        }
      }
    }
}

/// A number found and its standard uncertainty; nothing where the readings did not tell it.
struct Found {
  double value = 0.0;
  double sigma = 0.0;
};

std::map<std::string, Found> identified(const Scene& scene,
                                        const std::vector<std::string>& instruments,
                                        const std::set<std::string>& elements) {
  std::vector<errors::metrology::Readings> readings;
  for (const std::string& name : instruments)
    readings.push_back(measure_machine(scene, find_instrument(scene, name)));
  errors::identification::ModelOptions options;
  options.only.assign(elements.begin(), elements.end());
  const auto estimate = errors::identification::estimate(
      errors::identification::error_model(make_machine(scene).nominal, options), readings);
  const errors::Covariance& covariance = estimate.belief.covariance;
  const auto numbers = errors::coefficients(estimate.belief.elements);
  std::map<std::string, Found> result;
  for (std::size_t i = 0; i < covariance.of.size(); ++i) {
    const auto k = Index(i);
    const auto at = std::find(numbers.begin(), numbers.end(), covariance.of[i]);
    if (covariance.matrix(k, k) > 0.0)
      result[to_string(estimate.belief.elements[std::size_t(at->element)].name)] = {
          estimate.value[at - numbers.begin()], std::sqrt(covariance.matrix(k, k))};
  }
  return result;
}

// The ball bar as it comes, with its noise and its set-up, on the two machines whose Y carries X.
TEST(LocationMachines, ABallBarFindsTheSquarenessWhereYCarriesX) {
  for (const char* machine : {"three_axis_table", "trunnion_ca", "gantry_cxyza"}) {
    const Scene scene = scene_on(machine, "[errors]\nEC0Y_urad = 40\n");
    const auto found = identified(scene, {"ball_bar"}, {"EC0Y", "EB0Z", "EA0Z"});
    ASSERT_EQ(found.size(), 3u) << machine;
    const Found& one = found.at("EC0Y");
    std::cout << machine << ": EC0Y " << one.value / 1.0_urad << " +- " << one.sigma / 1.0_urad
              << " urad of 40\n";
    EXPECT_NEAR(one.value, 40.0_urad, 4.0 * one.sigma) << machine;
    EXPECT_LT(one.sigma, 2.0_urad) << machine;
    EXPECT_NEAR(found.at("EB0Z").value, 0.0, 4.0 * found.at("EB0Z").sigma);
  }
}

// All location elements of machines with two rotary axes at once, by circles, squares and R-tests.
// Those that these instruments tell from each other and from set-ups come back within four standard
// uncertainties; on the gantry EY0A and EY0C read alike, so one of them is left alone.
TEST(LocationMachines, InstrumentsFindTheElementsThatWereInjected) {
  const std::vector<std::string> instruments = {"ball_bar", "square", "r_test"};
  for (const char* machine : {"trunnion_ca", "gantry_cxyza", "head_head"}) {
    std::set<std::string> elements =
        net::location_elements(make_machine(scene_on(machine)).nominal);
    std::erase_if(elements, [](const std::string& name) { return name.back() == 'S'; });
    ASSERT_EQ(elements.size(), 11u);
    std::string truth = "[errors]\n";
    std::map<std::string, double> injected;
    for (const auto& [name, nothing] : identified(scene_on(machine), instruments, elements)) {
      const bool angle = name[1] < 'X';
      const double value = (injected.size() % 2 ? -1 : 1) * (15.0 + 2.0 * double(injected.size()));
      injected[name] = value * (angle ? 1.0_urad : 1.0_um);
      truth += fmt::format("{}_{} = {}\n", name, angle ? "urad" : "um", value);
    }
    const auto found = identified(scene_on(machine, truth), instruments, elements);
    std::cout << machine << ": found";
    for (const auto& [name, one] : found) {
      std::cout << " " << name;
      EXPECT_NEAR(one.value, injected.at(name), 4.0 * one.sigma) << machine << " " << name;
    }
    std::cout << "\n";
    EXPECT_GE(found.size(), 10u) << machine;
  }
}

Json element_in(const Json& description, const std::string& name) {
  for (const Json& element : description["elements"])
    if (element["name"] == name) return element;
  return {};
}

TEST(LocationMachines, CheckSaysWhatALocationElementDoes) {
  const Description description = describe(prepare(
      scene_on("three_axis_table", "[errors]\nEC0Y_urad = 40\nEB0Z_urad = 10\nEXX_um = 1\n")));
  const Json table = to_json(description);
  const Json y = element_in(table, "EC0Y")["location"];
  EXPECT_EQ(y["meaning"], "squareness of Y to X");
  EXPECT_EQ(y["displaces"], "carried");
  EXPECT_EQ(y["bodies"], Json({"X", "workpiece"}));
  EXPECT_EQ(y["turned_urad"], -40.0);
  ASSERT_EQ(y["angle_change_urad"].size(), 1u) << y;
  EXPECT_NEAR(y["angle_change_urad"]["X-Y"].get<double>(), 40.0, 1e-6);
  bool at_end = false;
  for (const Json& tip : y["tip_moved"]) {
    if (tip["at"] != "Y 250 mm") continue;
    at_end = true;
    EXPECT_NEAR(tip["um"][0].get<double>(), -10.0, 1e-6) << "40 urad at 250 mm lean Y to -X";
  }
  EXPECT_TRUE(at_end) << y;
  const Json z = element_in(table, "EB0Z")["location"];
  EXPECT_EQ(z["displaces"], "frame");
  EXPECT_EQ(z["bodies"], Json({"Z", "s", "tool"}));
  EXPECT_NEAR(z["angle_change_urad"]["X-Z"].get<double>(), -10.0, 1e-6);
  EXPECT_FALSE(element_in(table, "EXX").contains("location"));
  const std::string text = to_text(description);
  EXPECT_HAS(text,
             "EC0Y     turns X workpiece, which it carries, by -40 urad about Z; angle "
             "X-Y +40 urad");
}

/// Angles that change by an element of 40 urad alone, as `check` lists them.
std::map<std::string, double> angles_by(const std::string& machine, const std::string& element) {
  const std::string errors = fmt::format("[errors]\n{}_urad = 40\n", element);
  const Json description = to_json(describe(prepare(scene_on(machine, errors))));
  std::map<std::string, double> result;
  const Json location = element_in(description, element)["location"];
  for (const auto& [between, change] : location["angle_change_urad"].items())
    result[between] = std::round(change.get<double>() * 1e6) / 1e6;
  return result;
}

// On the gantry `w C' b X Y Z A s t` what Y carries goes with it, A and the nose as well.
TEST(LocationMachines, CheckListsTheLinesOfRotaryAxesAndOfTheNose) {
  using Angles = std::map<std::string, double>;
  EXPECT_EQ(angles_by("gantry_cxyza", "EC0Y"), (Angles{{"X-Y", 40.0}, {"X-A", 40.0}}));
  EXPECT_EQ(angles_by("gantry_cxyza", "EA0Z"),
            (Angles{{"Y-Z", 40.0}, {"Z-C", 40.0}, {"Y-s", 40.0}, {"C-s", 40.0}}));
  EXPECT_EQ(angles_by("gantry_cxyza", "EA0C"),
            (Angles{{"Y-C", 40.0}, {"Z-C", 40.0}, {"C-s", 40.0}}));
  EXPECT_EQ(angles_by("gantry_cxyza", "EB0S"),
            (Angles{{"X-s", -40.0}, {"Z-s", 40.0}, {"C-s", 40.0}, {"A-s", -40.0}}));
}

TEST(LocationMachines, WhatIsNoElementOfTheMachineIsRefusedWhereItStands) {
  const SceneFolder folder;
  const fs::path file =
      folder.write("s.toml", measured_scene("[errors]\nEXX_um = 1\nEC0X_urad = 5\n"));
  const std::string said = thrown_text<BadScene>([&] { read_scene(file); });
  EXPECT_HAS(said,
             "s.toml:16:1: expected an element that fits the machine, seen EC0X: X is "
             "the reference of Y; state the angle between them as EC0Y");
}

}  // namespace
}  // namespace abbe::sim
