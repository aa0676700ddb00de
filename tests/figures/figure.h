#pragma once

#include <nlohmann/json.hpp>
#include "sim/commands/scene_runs.h"
#include "sim/scene/scene.h"
#include "tests/test.h"

/// The figures of the source papers beside what the shipped scenes give: the rows of
/// scenes/FIGURES.md.
namespace abbe::figures {

/// One row of the table.
struct Figure {
  std::string paper, quantity;  ///< together they name the row
  std::string published;
  std::function<std::string()> computed;  ///< with the digits that are shown
  std::string command;                    ///< that gives it
  std::string why;                        ///< it is not the published one; empty where it is
  bool slow = false;                      ///< computed under ABBE_LONG=1 only
};

/// One case of a scene, as `abbe run` cuts it or, where it belongs to a variant, `abbe compare`.
struct SceneCase {
  std::string scene;  ///< name without ending
  std::vector<sim::Override> set = {};
  std::string case_name = {};  ///< empty: uncompensated
  std::string variant = {};
};

/// What a user types.
std::string command(const SceneCase& one);

/// Returns `summary.json` of a case as `abbe run` and `abbe compare` leave it: sampled where the
/// cut needs it, with the machine's part. Every case is cut once in a run of the tests.
const nlohmann::ordered_json& summary_of(const SceneCase& scene_case);

/// Returns the RMS of the machine's part of its map, um: of the map minus the error-free one.
double machine_um(const SceneCase& scene_case);

/// A packaged scene as it is read, in one of its variants if one is named.
sim::Scene scene_of(const std::string& name, const std::vector<sim::Override>& changes = {},
                    const std::string& variant = {});

/// `thermal.json` of a scene whose sensors are chosen, graded on its variants.
const nlohmann::ordered_json& thermal_choice_of(const std::string& scene,
                                                const std::vector<sim::Override>& changes = {});

/// One of the `choices` of such a `thermal.json`, and by how much its regressions on X, Y and Z
/// miss the day that chose and the other one: "0.26, 0.21, 0.46" um RMS, "1.6, 4.0, 7.0" with the
/// share of the ranges, all together, in percent.
const nlohmann::ordered_json& choice_of(const nlohmann::ordered_json& thermal,
                                        const std::string& name);
std::string missed_on_its_day(const nlohmann::ordered_json& choice);
std::string missed_on_another_day(const nlohmann::ordered_json& choice);
/// By how much Z is missed on the other day, um RMS.
std::string z_missed_on_another_day(const nlohmann::ordered_json& choice);

/// The words of a list with a sign between them.
std::string joined(const std::vector<std::string>& words, const std::string& between);

inline const char* const yang_2012 = "Yang 2012";  ///< as the rows name it

std::vector<Figure> guo();
std::vector<Figure> yang();
std::vector<Figure> yang_readings();
std::vector<Figure> yang_shafts();
std::vector<Figure> peng();
std::vector<Figure> chen();
std::vector<Figure> grey_degrees();

}  // namespace abbe::figures
