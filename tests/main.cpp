#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <string>

#include <gtest/gtest.h>

namespace {

/// Returns the filter of one part of the test suites: with ABBE_TEST_PART=2/8 every eighth suite
/// from the third on; empty if it is not a part. Suites stay whole, so that what the tests of a
/// suite share is computed once.
std::string filter_of_part(const std::string& part) {
  int number = 0, count = 0;
  if (std::sscanf(part.c_str(), "%d/%d", &number, &count) != 2) return "";
  if (number < 0 || number >= count) return "";
  const testing::UnitTest& all = *testing::UnitTest::GetInstance();
  std::string filter;
  for (int i = 0; i < all.total_test_suite_count(); ++i)
    if (i % count == number) filter += std::string(all.GetTestSuite(i)->name()) + ".*:";
  return filter.empty() ? "-*" : filter;
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (const char* part = std::getenv("ABBE_TEST_PART")) {
    const std::string filter = filter_of_part(part);
    if (filter.empty()) {
      std::cerr << "ABBE_TEST_PART: expected NUMBER/COUNT such as 2/8, seen " << part << "\n";
      return 2;
    }
    testing::GTEST_FLAG(filter) = filter;
  }
  return RUN_ALL_TESTS();
}
