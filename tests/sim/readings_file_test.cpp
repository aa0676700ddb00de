#include "sim/readings/readings_file.h"
#include "sim/commands/calibration_commands.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "tests/sim/refusal.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

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
  EXPECT_HAS(refusal_of_readings("x,y\n1,2\n"), "r.csv:1:1: expected readings");
  EXPECT_HAS(refusal_of_readings(with(text, "# kind =", "# kynd =")), "kynd");
  EXPECT_HAS(refusal_of_readings(with(text, "set_up,channel", "setup,channel")),
             "set_up,channel,run");
  EXPECT_HAS(refusal_of_readings(with(text, "\n0,0,0,", "\n0,9,0,")), "an integer from 0 to 0");
  EXPECT_HAS(refusal_of_readings(with(text, ",mm\n", ",um\n")), "mm, the unit of its channel");
  EXPECT_HAS(refusal_of_readings(with(text, ",mm\n", ",mm,3\n")), "cells");
  EXPECT_HAS(
      refusal_of_readings(with(text, "quantity = \"displacement\"", "quantity = \"weight\"")),
      "r.csv:");
  EXPECT_NE(refusal_of_readings(with(text, "direction = [1, 0, 0]", "direction = [2, 0, 0]")), "");
}

PartReadingsFile some_part(unsigned seed, int n) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1, 1);
  PartReadingsFile file{"probe \"1\"", "touch_probe", "a part, perfect-iterated-ideal", {}};
  auto& r = file.readings;
  r.points_w.resize(n, 3);
  r.normals_w.resize(n, 3);
  r.deviation.resize(n);
  r.time_s.resize(n);
  r.sigma = 0.5e-3;
  for (int i = 0; i < n; ++i) {
    r.points_w.row(i) << 100 * any(random), 100 * any(random), 1e-12 * any(random);
    r.normals_w.row(i) = Vector3d(any(random), any(random), any(random)).normalized();
    r.deviation[i] = 0.02 * any(random);
    r.time_s[i] = 2.0 * i - 100.0;
  }
  return file;
}

std::string refusal_of_part_readings(const std::string& text) {
  return refusal_by([&] { read_part_readings(text, "p.csv"); });
}

const std::string head =
    "# abbe_part_readings = 1\n# instrument = \"cmm\"\n# kind = \"cmm\"\n# part = \"p\"\n"
    "# sigma_um = 0.5\nx_mm,y_mm,z_mm,nx,ny,nz,deviation_um,time_s\n";

TEST(PartReadingsFile, WhatIsWrittenReadsBackTheSame) {
  const PartReadingsFile written = some_part(20261125, 500);
  const std::string text = to_text(written);
  ASSERT_TRUE(is_part_readings_text(text));
  const PartReadingsFile read = read_part_readings(text, "p.csv");
  EXPECT_EQ(read.instrument, written.instrument);
  EXPECT_EQ(read.kind, written.kind);
  EXPECT_EQ(read.part, written.part);
  EXPECT_DOUBLE_EQ(read.readings.sigma, written.readings.sigma);
  EXPECT_EQ(read.readings.points_w, written.readings.points_w);
  EXPECT_EQ(read.readings.normals_w, written.readings.normals_w);
  EXPECT_EQ(read.readings.time_s, written.readings.time_s);
  double worst = 0.0;
  for (Index i = 0; i < 500; ++i)
    worst =
        std::max(worst, std::abs(read.readings.deviation[i] / written.readings.deviation[i] - 1));
  std::cout << "deviations within " << worst << " of themselves\n";
  EXPECT_LE(worst, std::numeric_limits<double>::epsilon());
}

TEST(PartReadingsFile, NoPointsAreAFileToo) {
  EXPECT_EQ(read_part_readings(head, "p.csv").readings.deviation.size(), 0);
  EXPECT_EQ(read_part_readings(to_text(some_part(1, 0)), "p.csv").readings.time_s.size(), 0);
}

TEST(PartReadingsFile, CarriageReturnsAndBlankLinesAreAccepted) {
  const std::string crlf = "0,0,0,0,0,1,2.5,1\r\n\r\n \t\r\n1,0,0,0,0,1,-2.5,2\r\n";
  const auto file = read_part_readings(with(head, "time_s\n", "time_s\r\n") + crlf, "p.csv");
  ASSERT_EQ(file.readings.deviation.size(), 2);
  EXPECT_DOUBLE_EQ(file.readings.deviation[1], -2.5e-3);
}

TEST(PartReadingsFile, BrokenFilesAreRefusedByPlace) {
  const std::string row = "0,0,0,0,0,1,2.5,1\n";
  EXPECT_EQ(refusal_of_part_readings(head + row), "");
  EXPECT_HAS(refusal_of_part_readings(""), "p.csv:1:1: expected readings of a part");
  EXPECT_HAS(refusal_of_part_readings("x,y\n"), "p.csv:1:1");
  EXPECT_HAS(refusal_of_part_readings("# abbe_part_readings = 2\n" + head.substr(25)), "p.csv:1");
  EXPECT_HAS(refusal_of_part_readings(head.substr(0, head.find("x_mm"))),
             "p.csv:5:1: expected a header");
  EXPECT_HAS(refusal_of_part_readings(with(head, "x_mm", "u_mm")),
             "p.csv:6:1: expected the column x_mm");
  EXPECT_HAS(refusal_of_part_readings(with(head, "# kind", "# kynd")), "p.csv:3:");
  EXPECT_HAS(refusal_of_part_readings(with(head, "\"cmm\"", "7")), "p.csv:2:");
  EXPECT_HAS(refusal_of_part_readings(with(head, "0.5", "-0.5")), "p.csv:5:");
  EXPECT_HAS(refusal_of_part_readings(head + "0,0,0,0,0,1,1e10,1\n"), "p.csv:7:13");
  EXPECT_HAS(refusal_of_part_readings(head + "0,0,0,0,0,0,1,1\n"),
             "p.csv:7:7: expected a normal of length 1");
  EXPECT_HAS(refusal_of_part_readings(head + "0,0,0,0,0,1.00001,1,1\n"), "a normal of length 1");
}

}  // namespace
}  // namespace abbe::sim
