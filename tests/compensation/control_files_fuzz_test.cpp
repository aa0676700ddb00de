#include <chrono>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "sim/compensation/control_files.h"
#include "tests/compensation/control_cases.h"
#include "tests/injured.h"

namespace abbe::sim::compensation {
namespace {

using namespace cases;

const std::string fodder = "0159.-+eE,;: \t\n\r\"#[]()=$*XYZAMNR/%";
constexpr std::size_t injuries = 2;

struct Outcome {
  int read = 0;
  int refused = 0;
};

/// Injures one file at a time; what is accepted must be sound.
template <typename Read>
Outcome outcome(const std::vector<ControlFile>& files, std::mt19937& random, const Read& read) {
  Outcome out;
  for (int k = 0; k < 4000; ++k) {
    std::vector<ControlFile> hurt = files;
    ControlFile& victim = hurt[std::size_t(k) % hurt.size()];
    victim.text = injured(victim.text, fodder, injuries, random);
    if (k % 50 == 0) victim.name = injured(victim.name, fodder, injuries, random);
    try {
      read(hurt);
      ++out.read;
    } catch (const BadInput& bad) {
      EXPECT_FALSE(bad.expected.empty() || bad.seen.empty()) << bad.what();
      EXPECT_GE(bad.line, 0);
      EXPECT_GE(bad.column, 0);
      ++out.refused;
    }
  }
  return out;
}

class ControlFilesFuzz : public testing::TestWithParam<ControlFormat> {};

TEST_P(ControlFilesFuzz, InjuredFilesAreReadOrRefused) {
  const unsigned seed = 20250705;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const Chain chain = gantry();
  const ParameterTables tables = any_tables(chain, random, {true, true, true, 6});
  const auto start = std::chrono::steady_clock::now();
  const Outcome out =
      outcome(to_control(tables, chain, GetParam()).files, random,
              [&](const std::vector<ControlFile>& files) {
                const ParameterTables back = read_control_tables(files, chain, GetParam());
                validate(back, chain);
                to_control(back, chain, GetParam());  // whatever was accepted can be written again
              });
  const double s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::cout << to_string(GetParam()) << ": " << out.read << " read, " << out.refused << " refused, "
            << s << " s\n";
  EXPECT_GT(out.read, 100);
  EXPECT_GT(out.refused, 1000);
}

INSTANTIATE_TEST_SUITE_P(Formats, ControlFilesFuzz,
                         testing::Values(ControlFormat::LinuxCnc, ControlFormat::Siemens,
                                         ControlFormat::Heidenhain),
                         [](const auto& format) { return std::string(to_string(format.param)); });

TEST(ControlFiles, InjuredVolumetricFilesAreReadOrRefused) {
  const unsigned seed = 20250706;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  const Chain chain = gantry();
  const std::vector<ControlFile> files = {
      {"X.csv", "// mm\nX EXX EYX EZX EAX EBX ECX\n0 1e-3 0 0 1e-6 0 0\n10 0 1e-3 0 0 0 2e-6\n"},
      {"all.csv", "A\tEAA\tEYA\n-30\t1e-6\t2e-3\n90\t0\t0\n#\nC0Y\tA0Z\tX0C\n1e-5\t0\t2e-3\n"}};
  const Outcome out = outcome(files, random, [&](const std::vector<ControlFile>& hurt) {
    errors::bind(read_volumetric_deviations(hurt, chain), chain);  // accepted is sound
  });
  std::cout << "isg: " << out.read << " read, " << out.refused << " refused\n";
  EXPECT_GT(out.read, 100);
  EXPECT_GT(out.refused, 1000);
}

TEST(ControlFiles, TooMuchIsRefusedBeforeItIsHeld) {
  const std::vector<ControlFile> many(65, ControlFile{"X.comp", ""});
  EXPECT_THROW(read_control_tables(many, gantry(), ControlFormat::LinuxCnc), BadInput);
  EXPECT_THROW(read_volumetric_deviations(many, gantry()), BadInput);
  const std::vector<ControlFile> large{{"X.comp", std::string((std::size_t(1) << 24) + 1, ' ')}};
  for (const ControlFormat format :
       {ControlFormat::LinuxCnc, ControlFormat::Siemens, ControlFormat::Heidenhain})
    EXPECT_THROW(read_control_tables(large, gantry(), format), BadInput);
}

TEST(ControlFiles, NoTablesAreNoFiles) {
  for (const ControlFormat format :
       {ControlFormat::LinuxCnc, ControlFormat::Siemens, ControlFormat::Heidenhain}) {
    EXPECT_TRUE(to_control(none(), gantry(), format).files.empty());
    EXPECT_TRUE(read_control_tables({}, gantry(), format).tables.empty());
  }
}

TEST(ControlFiles, PointsCloserThanTheDigitsAreReadOffAndSaid) {
  ParameterTables tables = none();
  tables.tables = {{X, X, Eigen::Vector4d(0, 1e-9, 5, 10), Eigen::Vector4d(0, 1e-3, 0, 0),
                    Eigen::Vector4d(0, 1e-3, 0, 0)},
                   {Y, Y, Eigen::Vector2d(1, 1 + 1e-12), Eigen::Vector2d(2e-3, 2e-3),
                    Eigen::Vector2d(2e-3, 2e-3)}};
  for (const ControlFormat format :
       {ControlFormat::LinuxCnc, ControlFormat::Siemens, ControlFormat::Heidenhain}) {
    const ControlExport made = to_control(tables, gantry(), format);
    EXPECT_TRUE(says(made.omissions, "they deviate by")) << to_string(format);
    const ParameterTables back = read_control_tables(made.files, gantry(), format);
    AxisState state;
    state.q = AxisVector::Zero(6);
    EXPECT_NEAR(correction(back, state)[Y], 2e-3, 1e-9);
  }
}

}  // namespace
}  // namespace abbe::sim::compensation
