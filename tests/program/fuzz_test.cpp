// Readers meet noise and damaged programs: they read or refuse with a place, and nothing else.

#include <gtest/gtest.h>

#include <iostream>
#include <random>

#include "kinematics/bad_input.h"
#include "machines.h"
#include "sim/program/program_writers.h"

namespace abbe::sim::program {
namespace {

constexpr unsigned fuzz_seed = 20250314;

const std::string valid_nc =
    "%\nN10 G21 G90 G94 G54 (head)\nG43.4 H1\nS1000 M3\nG0 X1 Y2 Z30 A5 C10\nG1 X2.5 F600\n"
    "G3 X3.5 Y3 I1 J0\nG2 X2 R5\nG49\nG93 G1 X1 F30\nG4 P.5\nG53 G0 Z0\nM30\n%\n";
const std::string valid_pvt =
    "time_s,X_mm,Z_mm,S_deg,X_mm_per_s,Z_mm_per_s,S_deg_per_s\n0,0,0,0,1,1,1\n1,1e-3,2,30,0,-1e-2,"
    "4\n"
    "2,1,3.25,60,0,0,0\n";

std::string noise(std::mt19937& random, std::string_view letters) {
  std::uniform_int_distribution<int> length(0, 300);
  std::uniform_int_distribution<int> any(0, 255);
  std::string text(std::size_t(length(random)), ' ');
  for (char& c : text)
    c = letters.empty() ? char(any(random)) : letters[std::size_t(any(random)) % letters.size()];
  return text;
}

std::string damaged(std::mt19937& random, std::string text, std::string_view letters) {
  std::uniform_int_distribution<int> any(0, 1 << 20);
  const int edits = 1 + any(random) % 4;
  for (int i = 0; i < edits && !text.empty(); ++i) {
    const std::size_t at = std::size_t(any(random)) % text.size();
    const char c = letters[std::size_t(any(random)) % letters.size()];
    switch (any(random) % 4) {
      case 0:
        text[at] = c;
        break;
      case 1:
        text.insert(at, 1, c);
        break;
      case 2:
        text.erase(at, 1 + std::size_t(any(random)) % 5);
        break;
      default:
        text.resize(at);
    }
  }
  return text;
}

struct Count {
  int read = 0, refused = 0;
};

template <typename Reader>
void try_one(const Reader& reader, const std::string& text, Count& count) {
  try {
    const Path path = reader(text);
    ++count.read;
    double time_s = -1e300;
    for (const Block& block : path.blocks) {
      ASSERT_TRUE(block.start.allFinite() && block.end.allFinite());
      ASSERT_GE(block.start_s, time_s);
      ASSERT_GE(block.end_s, block.start_s) << text;
      ASSERT_TRUE(std::isfinite(block.end_s));
      ASSERT_TRUE(position(path, block, 0.37).allFinite());
      time_s = block.end_s;
    }
  } catch (const BadInput& refusal) {
    ++count.refused;
    ASSERT_GE(refusal.line, 1) << text;
    ASSERT_FALSE(refusal.expected.empty());
    ASSERT_LT(std::string(refusal.what()).size(), 500u);
  }
}

TEST(Fuzz, NcReaderReadsOrRefusesWithAPlace) {
  SCOPED_TRACE(testing::Message() << "seed " << fuzz_seed);
  std::mt19937 random(fuzz_seed);
  const NcOptions options = test::options_for(test::gantry());
  const auto reader = [&](const std::string& text) { return read_nc(text, "fuzz", options); };
  const std::string_view letters = "GMXYZACIJKRFSTHPNO0123456789.-+()%;/#[]= \n\r\te";
  Count count;
  for (int i = 0; i < 60000; ++i) {
    const std::string text = i % 3 == 0   ? noise(random, "")
                             : i % 3 == 1 ? noise(random, letters)
                                          : damaged(random, valid_nc, letters);
    ASSERT_NO_FATAL_FAILURE(try_one(reader, text, count)) << text;
  }
  std::cout << "seed " << fuzz_seed << ": " << count.read << " read, " << count.refused
            << " refused\n";
  EXPECT_GT(count.read, 1000);
  EXPECT_GT(count.refused, 1000);
}

TEST(Fuzz, PvtReaderReadsOrRefusesWithAPlace) {
  SCOPED_TRACE(testing::Message() << "seed " << fuzz_seed);
  std::mt19937 random(fuzz_seed);
  const NcOptions options = test::options_for(test::platform());
  const auto reader = [&](const std::string& text) { return read_pvt(text, "fuzz", options); };
  const std::string_view letters = "time_s,XZS_mm_per_deg0123456789.-+e\n\r#";
  Count count;
  for (int i = 0; i < 90000; ++i) {
    const std::string text = i % 5 == 0   ? noise(random, "")
                             : i % 5 == 1 ? noise(random, letters)
                                          : damaged(random, valid_pvt, "0123456789.-+e ,");
    ASSERT_NO_FATAL_FAILURE(try_one(reader, text, count)) << text;
  }
  std::cout << "seed " << fuzz_seed << ": " << count.read << " read, " << count.refused
            << " refused\n";
  EXPECT_GT(count.read, 1000);
  EXPECT_GT(count.refused, 1000);
}

TEST(Fuzz, LinesWithoutEndTakeNoMemoryOfTheirOwn) {
  const NcOptions nc = test::options_for(test::gantry());
  EXPECT_THROW(read_nc(std::string(5'000'000, 'G'), "t", nc), BadInput);
  EXPECT_THROW(read_nc("X" + std::string(5'000'000, '9'), "t", nc), BadInput);
  EXPECT_NO_THROW(read_nc(std::string(5'000'000, ' '), "t", nc));
  EXPECT_THROW(read_nc("(" + std::string(5'000'000, 'a'), "t", nc), BadInput);
  std::string codes;
  for (int i = 0; i < 1'000'000; ++i) codes += "G1 ";
  EXPECT_THROW(read_nc(codes, "t", nc), BadInput);
  const NcOptions pvt = test::options_for(test::platform());
  EXPECT_THROW(read_pvt(std::string(5'000'000, ','), "t", pvt), BadInput);
}

}  // namespace
}  // namespace abbe::sim::program
