#pragma once

#include "tests/test.h"

namespace abbe::sim::study::oracle {

/// Numbers that a Python script prints with OpenTURNS at hand (as `ot`, arguments as `numbers`);
/// empty where the package is not installed. A test skips then.
inline std::optional<std::vector<double>> openturns(const std::string& script,
                                                    const std::vector<double>& numbers = {}) {
  const std::string python = "/usr/bin/python3";
  if (std::system((python + " -c 'import openturns' 2>/dev/null").c_str()) != 0)
    return std::nullopt;
  const fs::path name =
      fs::path(testing::TempDir()) /
      (std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + ".py");
  {
    std::ofstream out(name);
    out.precision(17);
    out << "import openturns as ot\nnumbers = [";
    for (const double number : numbers) out << number << ",\n";
    out << "]\n" << script;
  }
  std::FILE* pipe = ::popen((python + " '" + name.string() + "'").c_str(), "r");
  std::string text;
  for (char part[4096]; const auto n = std::fread(part, 1, sizeof part, pipe);)
    text.append(part, n);
  EXPECT_EQ(::pclose(pipe), 0) << "the script for OpenTURNS failed";
  fs::remove(name);
  std::vector<double> result;
  std::istringstream in(text);
  for (double number = 0.0; in >> number;) result.push_back(number);
  return result;
}

}  // namespace abbe::sim::study::oracle
