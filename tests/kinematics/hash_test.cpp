#include "kinematics/hash.h"

#include <gtest/gtest.h>

namespace abbe {
namespace {

// vectors of the authors' test suite, test_fnv.c
TEST(Hash, Fnv1aHasItsPublishedValues) {
  EXPECT_EQ(fnv_1a(""), 0xcbf29ce484222325u);
  EXPECT_EQ(fnv_1a("a"), 0xaf63dc4c8601ec8cu);
  EXPECT_EQ(fnv_1a("b"), 0xaf63df4c8601f1a5u);
  EXPECT_EQ(fnv_1a("foobar"), 0x85944171f73967e8u);
}

TEST(Hash, Fnv1aTakesBytesPieceByPiece) {
  EXPECT_EQ(fnv_1a("bar", fnv_1a("foo")), fnv_1a("foobar"));
  EXPECT_NE(fnv_1a("\xff"), fnv_1a("\x7f")) << "a byte is no signed number";
}

// first values of Vigna's splitmix64.c for the seed 1234567
TEST(Hash, SplitMixHasItsPublishedValues) {
  std::uint64_t state = 1234567;
  for (const std::uint64_t expected :
       {6457827717110365317u, 3203168211198807973u, 9817491932198370423u, 4593380528125082431u,
        16408922859458223821u})
    EXPECT_EQ(split_mix::mixed(state += split_mix::golden), expected);
}

TEST(Hash, StreamsOfASeedDiffer) {
  EXPECT_NE(split_mix::stream(1, 0), split_mix::stream(1, 1));
  EXPECT_NE(split_mix::stream(1, 0), split_mix::stream(2, 0));
}

}  // namespace
}  // namespace abbe
