#include <iostream>
#include <random>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "sim/commands/calibration_commands.h"
#include "sim/readings/readings_file.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/refusal.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using errors::metrology::Readings;

Readings laser_readings(const std::string& scene = "gantry_dome.toml") {
  Scene read = read_scene(packaged(scene));
  InstrumentDescription laser = find_instrument(read, "laser");
  laser.instrument.targets = 5;
  laser.instrument.runs = 2;
  return measure_machine(read, laser);
}

std::string refusal_of_readings(const std::string& text) {
  return refusal_by([&] { read_readings(text, "r.csv"); });
}

TEST(ReadingsFile, WhatIsWrittenReadsBackTheSame) {
  for (const char* scene : {"gantry_dome.toml", "thermal_protocol.toml", "platform_plane.toml"}) {
    const Readings written = laser_readings(scene);
    const std::string text = to_text(written);
    const Readings read = read_readings(text, "r.csv");
    EXPECT_EQ(to_text(read), text);
    EXPECT_EQ(read.value, written.value);
    EXPECT_EQ(read.T_C, written.T_C);
    EXPECT_EQ(read.sensors, written.sensors);
    ASSERT_EQ(read.plan.measurements.size(), written.plan.measurements.size());
    double apart = 0.0;
    for (std::size_t i = 0; i < read.plan.measurements.size(); ++i) {
      const auto &a = read.plan.measurements[i].state, &b = written.plan.measurements[i].state;
      apart = std::max(apart, (a.q - b.q).cwiseAbs().maxCoeff());
      EXPECT_EQ(a.direction, b.direction);
      EXPECT_EQ(a.stroke, b.stroke);
      EXPECT_EQ(a.time_s, b.time_s);
    }
    EXPECT_LT(apart, 1e-15);
    EXPECT_EQ(read.nominal.T_bt_home().matrix(), written.nominal.T_bt_home().matrix());
    ASSERT_EQ(read.plan.set_ups.size(), written.plan.set_ups.size());
  }
}

TEST(ReadingsFile, TellsNothingOfTheTruth) {
  const std::string text = to_text(laser_readings());
  for (const char* element : {"EXX", "EYX", "EC0Y", "EBZ", "legendre"})
    EXPECT_EQ(text.find(element), std::string::npos) << element;
}

TEST(ReadingsFile, BrokenFilesAreRefusedByPlace) {
  const std::string text = to_text(laser_readings());
  EXPECT_NE(refusal_of_readings("x,y\n1,2\n").find("r.csv:1:1: expected readings"),
            std::string::npos);
  EXPECT_NE(refusal_of_readings(with(text, "# kind =", "# kynd =")).find("kynd"),
            std::string::npos);
  EXPECT_NE(
      refusal_of_readings(with(text, "set_up,channel", "setup,channel")).find("set_up,channel,run"),
      std::string::npos);
  EXPECT_NE(refusal_of_readings(with(text, "\n0,0,0,", "\n0,9,0,")).find("an integer from 0 to 0"),
            std::string::npos);
  EXPECT_NE(refusal_of_readings(with(text, ",mm\n", ",um\n")).find("mm, the unit of its channel"),
            std::string::npos);
  EXPECT_NE(refusal_of_readings(with(text, ",mm\n", ",mm,3\n")).find("cells"), std::string::npos);
  EXPECT_NE(refusal_of_readings(with(text, "quantity = \"displacement\"", "quantity = \"weight\""))
                .find("r.csv:"),
            std::string::npos);
  EXPECT_NE(refusal_of_readings(with(text, "direction = [1, 0, 0]", "direction = [2, 0, 0]")), "");
}

TEST(ReadingsFile, AnyMutationIsReadOrRefusedWithAPlace) {
  const unsigned seed = 20261121;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const std::string text = to_text(laser_readings());
  std::mt19937 random(seed);
  const auto below = [&](std::size_t n) { return std::size_t(random() % n); };
  int read = 0, refused = 0;
  for (int i = 0; i < 400; ++i) {
    std::string broken = text;
    for (std::size_t k = 0; k < 1 + below(3); ++k) {
      const std::size_t at = below(broken.size());
      switch (below(4)) {
        case 0:
          broken[at] = char(below(256));
          break;
        case 1:
          broken.erase(at, below(40));
          break;
        case 2:
          broken.insert(at, broken.substr(below(broken.size()), below(40)));
          break;
        default:
          broken.resize(at + 1);
          break;
      }
    }
    try {
      read_readings(broken, "r.csv");
      ++read;
    } catch (const BadInput&) {
      ++refused;
    } catch (const BadScene&) {
      ++refused;
    }
  }
  std::cout << read << " read, " << refused << " refused\n";
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace abbe::sim
