// LinuxCNC's own five-axis samples, from its programs to what is left of a block. The samples come
// with LinuxCNC.

#include <algorithm>
#include <cmath>
#include <iostream>
#include <numbers>

#include <gtest/gtest.h>

#include "sim/cut/cut.h"
#include "sim/dialects/linuxcnc/rs274.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

const std::string samples =
    "usr/share/doc/linuxcnc/examples/sample-configs/sim/axis/vismach/5axis/table-rotary-tilting/"
    "demos/";

/// Where the samples are, if they are.
std::optional<fs::path> demos() {
  const std::optional<fs::path> packages = dialects::find_linuxcnc();
  if (!packages || !fs::is_directory(*packages / samples)) return std::nullopt;
  return *packages / samples;
}

Cut cut_of(const std::string& scene, const std::string& program,
           const std::vector<Override>& changes) {
  std::vector<Override> all{{"program.file", "\"" + (*demos() / program).string() + "\""}};
  all.insert(all.end(), changes.begin(), changes.end());
  return cut(job_of("linuxcnc/" + scene, all));
}

TEST(LinuxCncSamples, BoatStandsOnAFlatFloor) {
  if (!demos()) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const Cut boat = cut_of("boat.toml", "boat-xyzac.ngc",
                          {{"part.vertices", "2000"}, {"cutting.spacing_mm", "1"}});
  std::vector<double> off;
  for (Eigen::Index i = 0; i < boat.surface.residual.size(); ++i)
    if (boat.surface.status[std::size_t(i)] == cutting::VertexStatus::Cut)
      off.push_back(std::abs(boat.surface.residual[i]));
  ASSERT_GT(off.size(), 500u);
  std::sort(off.begin(), off.end());
  std::cout << off.size() << " places of the floor, nine in ten within " << off[off.size() * 9 / 10]
            << " mm\n";
  EXPECT_LT(off[off.size() * 9 / 10], 1e-9);

  ASSERT_TRUE(boat.process.stock);
  const cutting::Stock& left = *boat.process.stock;
  const double block = 97.0 * 54.0 * 20.0, removed = totals(boat.process).removed;
  EXPECT_NEAR(volume(left), block - removed, 0.01 * block);
  EXPECT_GT(depth(left, {0, 0, -5}), 0.0) << "below the keel";
  EXPECT_LT(depth(left, {0, 0, -1}), 0.0) << "above the keel";
  EXPECT_LT(depth(left, {0, 24, -12}), 0.0) << "beside the hull";
  EXPECT_LT(depth(left, {0, -24, -12}), 0.0) << "beside the hull";
  EXPECT_LT(depth(left, {-30, -20, -3}), 0.0) << "before the shoulder";
  EXPECT_TRUE(boat.process.crash_lines.empty());
}

TEST(LinuxCncSamples, ImpellerHasSevenBladesAllAlike) {
  if (!demos()) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  const Cut impeller = cut_of("impeller.toml", "impeller-7bl-xyzac.ngc",
                              {{"part.vertices", "2000"}, {"cutting.spacing_mm", "0.5"}});
  ASSERT_TRUE(impeller.process.stock);
  const cutting::Stock& left = *impeller.process.stock;
  for (const auto& [radius, z] : {std::pair{32.0, 8.5}, {25.5, 14.0}, {20.5, 20.0}}) {
    constexpr int places = 3600;
    const auto material = [&, radius = radius, z = z](int k) {
      const double angle = 2.0 * std::numbers::pi * k / places;
      return depth(left, {radius * std::cos(angle), radius * std::sin(angle), z}) > 0.0;
    };
    int edges = 0;
    double alike = 0.0;
    for (int k = 0; k < places; ++k) {
      edges += material(k) != material(k + 1);
      alike += material(k) == material(k + int(std::lround(places / 7.0)));
    }
    std::cout << "at radius " << radius << ", z " << z << ": " << edges << " edges, "
              << 100.0 * alike / places << " % as one blade further\n";
    EXPECT_EQ(edges, 14);
    EXPECT_GT(alike, 0.97 * places);
  }
}

}  // namespace
}  // namespace abbe::sim
