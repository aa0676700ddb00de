#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iomanip>
#include <iostream>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <random>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <tuple>
#include <variant>
#include <vector>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"

/// What nearly every test reads: GoogleTest, the parts of the standard library, and short names.
/// The tests are compiled with it as their precompiled header.
namespace abbe {

namespace fs = std::filesystem;
using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using namespace literals;

inline constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Returns what the exception of an action says, if it is one of these; `otherwise` if it throws
/// none. Other exceptions pass.
template <class... Errors, class Action>
std::string thrown_text(const Action& action, const std::string& otherwise = "") {
  try {
    action();
  } catch (const std::exception& error) {
    const std::exception* thrown = &error;
    if ((dynamic_cast<const Errors*>(thrown) || ...)) return error.what();
    throw;
  }
  return otherwise;
}

/// Random numbers of a seed that the failures of its scope name.
struct SeededRandom : std::mt19937 {
  explicit SeededRandom(unsigned seed)
      : std::mt19937(seed), trace(__FILE__, __LINE__, "seed " + std::to_string(seed)) {}

  testing::ScopedTrace trace;
};

/// Success if a text has a part; a failure that shows both otherwise.
inline testing::AssertionResult has_part(std::string_view text, std::string_view part) {
  if (text.find(part) != std::string_view::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "expected: " << part << "\nseen: " << text;
}

}  // namespace abbe

#define EXPECT_HAS(text, part) EXPECT_TRUE(abbe::has_part(text, part))
