#include <string>

#include <gtest/gtest.h>

#include "sim/scene/errors.h"
#include "sim/scene/fields.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "tests/sim/gantry.h"
#include "tests/sim/listed_keys.h"
#include "tests/sim/scene_folder.h"

namespace abbe::sim {
namespace {

/// What is written of the errors that a text gives.
std::string errors_again(const std::string& text) {
  InputErrors input_errors;
  const Node table = parse_toml(text, "e");
  const Node* list = table.find("list");
  const ErrorsSection section = read_errors(list ? *list : table, gantry(), 7, input_errors);
  for (const BadInput& fault : input_errors.list()) ADD_FAILURE() << fault.what();
  const Node::Table again = errors_to_table(section, gantry());
  EXPECT_EQ(unlisted(again, errors_keys()), "");
  EXPECT_EQ(unlisted(*table.table(), errors_keys()), list ? "list\n" : "");
  return to_toml(Node{{}, again});
}

TEST(SceneErrors, WhatIsWrittenReadsBackTheSame) {
  const std::string once = errors_again(R"(name = "all"
scale = 2.0
EXX_um = 5.0
C0Y_urad = 30.0
EYX = [
  { name = "all", kind = "constant", value_um = 1 },
  { kind = "polynomial", coefficients_um = [1, 2, 3], centre_mm = 10, half_range_mm = 300 },
  { name = "l", kind = "legendre", coefficients_um = [1, 2], half_range_mm = 300, argument = "carriage", negate = true },
  { name = "pitch", kind = "fourier", period_mm = 16, a_um = [0.5], b_um = [0.25, 0.125], scale = 2.0 },
  { name = "t", kind = "table", q_mm = [-300, 0, 300], value_um = [1, 0, 2], between = "spline", outside = "hold" },
  { kind = "backlash", half_um = 1.5 },
  { kind = "up_down", up = { q_mm = [0, 1], value_um = [0, 1] }, down = { q_mm = [0, 1], value_um = [2, 1] } },
  { kind = "repeatability", sigma_um = 0.25, seed = 7 },
]
EXY = { kind = "table", q_mm = [0, 50, 100], value_um = [1, 6, 11], detrend = "lsq" }
EAC = { kind = "asynchronous", rms_urad = 1, lowest_order = 0.5 }
EBC = { kind = "fourier", period_deg = 360, b_urad = [10] }
[measured]
X = { at_mm = [1, 2, 3], by = "tool" }
Z = { at_mm = [4, 5, 6], by = "carriage" }
[covariance]
of = ["EXX", "EYX pitch sin 2", "EC0Y"]
standard_uncertainty_um_urad = [1, 2, 4]
correlation = [0.5, 0, -0.25]
)");
  EXPECT_EQ(errors_again(once), once);
  for (const char* part :
       {"scale = 2.0", "EXX_um = 5.0", "name = \"slope of EXY\"", "kind = \"legendre\"",
        "a_um = [0.5, 0.0]", "between = \"spline\"", "sigma_um = 0.25", "seed = 7",
        "correlation = [0.5, 0.0, -0.25]", "by = \"carriage\""}) {
    EXPECT_NE(once.find(part), std::string::npos) << part << " in\n" << once;
  }
}

TEST(SceneErrors, TablesFromFilesAreWrittenAsTheirElements) {
  const SceneFolder folder;
  const auto file = folder.write("run.csv", "X EXX EYX\n-300 0 0\n0 0.001 0.002\n300 0 0\n");
  const std::string once = errors_again("list = [{ tables = { file = \"" + file.string() +
                                        "\", name = \"run 3\", scale = 2.0 } }, { EXX_um = 3.0 }]");
  EXPECT_EQ(errors_again(once), once);
  EXPECT_NE(once.find("value_um = [0.0, 2.0, 0.0]"), std::string::npos) << once;
}

TEST(SceneErrors, KeysOfACurveAreListedInEitherUnit) {
  const std::vector<Key> keys = errors_keys();
  const Key* curve = listed("EAC", keys);
  ASSERT_TRUE(curve);
  for (const char* name : {"value_um", "value_urad", "centre_deg", "coefficients_urad", "detrend"})
    EXPECT_TRUE(listed(name, curve->keys)) << name;
  EXPECT_FALSE(listed("value_mm", curve->keys));
  EXPECT_FALSE(listed("EQX", keys));
  EXPECT_FALSE(listed("EXX_urad", keys));
}

}  // namespace
}  // namespace abbe::sim
