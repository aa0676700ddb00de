#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <nlohmann/json.hpp>

#include "sim/report.h"

namespace abbe::sim {
namespace {

using Radii = std::array<double, 3>;  // um from the wanted radius

double spread(const Radii& r) {
  return *std::max_element(r.begin(), r.end()) - *std::min_element(r.begin(), r.end());
}

Radii radii(const Job& job, const std::optional<CaseDescription>& compensator) {
  const nlohmann::ordered_json json = summary(job, judge(job, cut(job, compensator), nullptr));
  Radii r{};
  std::size_t i = 0;
  for (const auto& [name, value] : json["radii_um"].items())
    r.at(i++) = value.get<double>() - 12500.0;
  EXPECT_EQ(i, 3u);
  return r;
}

/// Deciles of the reductions over 50 seeded trials, percent, every radius off by sigma.
struct Band {
  double low = 0.0, middle = 0.0, high = 0.0;
  bool holds(double percent) const { return percent >= low && percent <= high; }
};

Band band_of(const Radii& before, const Radii& after, double sigma, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> scatter(0.0, sigma);
  std::vector<double> percent;
  for (int trial = 0; trial < 50; ++trial) {
    Radii b = before, a = after;
    for (std::size_t i = 0; i < 3; ++i) {
      b[i] += scatter(random);
      a[i] += scatter(random);
    }
    percent.push_back(100.0 * (1.0 - spread(a) / spread(b)));
  }
  std::sort(percent.begin(), percent.end());
  return {percent[5], 0.5 * (percent[24] + percent[25]), percent[44]};
}

/// What Yang 2012, table 1, prints of a shaft.
struct Printed {
  const char* scene;
  Radii before;  // um, from 12.48 mm, in the order of the scene's rings
  std::array<double, 3> reduction_percent;
};

/// Scatter of printed radii about the shape that the machine gives them, offset and size free: one
/// degree of freedom is left.
double scatter_before(const Printed& printed, const Radii& shape) {
  Eigen::Matrix<double, 3, 2> A;
  Eigen::Vector3d b;
  for (int i = 0; i < 3; ++i) {
    A.row(i) << 1.0, shape[std::size_t(i)];
    b[i] = printed.before[std::size_t(i)];
  }
  const Eigen::Vector2d fit = A.colPivHouseholderQr().solve(b);
  return (A * fit - b).norm();
}

const Printed shafts[] = {{"stepped_shaft", {4.7, 1.6, -1.8}, {42, 49, 48}},
                          {"cone_shaft", {8.7, 5.3, 2.6}, {38, 36, 43}}};

struct Shaft {
  Radii before, after;
};

Shaft cut_shaft(const char* scene) {
  const Job job = prepare(
      read_scene(std::filesystem::path(ABBE_SOURCE_DIR) / "scenes" / (std::string(scene) + ".toml"),
                 {{"part.vertices", "6000"}, {"signals.current.noise_A", "0"}}));
  return {radii(job, std::nullopt), radii(job, parse_case("force-position-open"))};
}

// The paper's radii after compensation spread over 3.3 to 3.9 um, the range of three readings that
// scatter by 2.1 um; its radii before lie so near a smooth course that they scatter by less.
TEST(ShaftTrials,
     CurrentMendsNineTenthsAndThePublishedReductionsAskForMoreScatterThanThereIsBefore) {
  constexpr double expected_range = 1.6926;  // of three normal deviates, in sigmas
  constexpr double mean_range_after = (3.8 + 3.3 + 3.4 + 3.8 + 3.9 + 3.5) / 6;
  std::vector<Shaft> cut;
  double sum = 0.0;
  for (const Printed& printed : shafts) {
    cut.push_back(cut_shaft(printed.scene));
    const Shaft& shaft = cut.back();
    const double reduction = 100.0 * (1.0 - spread(shaft.after) / spread(shaft.before));
    std::cout << printed.scene << " without noise: spread " << spread(shaft.before) << " -> "
              << spread(shaft.after) << " um, " << reduction << " % less\n";
    EXPECT_GT(reduction, 90.0);
    sum += std::pow(scatter_before(printed, cut.back().before), 2);
  }
  const double before = std::sqrt(sum / 2), after = mean_range_after / expected_range;
  std::cout << "scatter of the radii: before " << before << " um, after " << after << " um\n";
  int held_before = 0, held_after = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    for (const double sigma : {before, after}) {
      const Band band = band_of(cut[i].before, cut[i].after, sigma, 20261121 + i);
      std::cout << shafts[i].scene << ", sigma " << sigma << " um, 50 trials, seed " << 20261121 + i
                << ": " << band.low << " .. " << band.middle << " .. " << band.high << " % less\n";
      for (const double printed : shafts[i].reduction_percent)
        (sigma == before ? held_before : held_after) += band.holds(printed);
    }
  }
  std::cout << "of the six published reductions " << held_before
            << " lie in the band of the scatter before, " << held_after
            << " in that of the scatter after\n";
  EXPECT_EQ(held_after, 6);
  EXPECT_EQ(held_before, 0) << "the paper's radii agree among themselves after all";
}

}  // namespace
}  // namespace abbe::sim
