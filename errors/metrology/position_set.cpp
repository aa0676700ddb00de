#include "errors/metrology/position_set.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

#include "kinematics/bad_input.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;

std::string place_of(const PositionReading& r) {
  return fmt::format("run {} {} at target {}", r.run, r.up ? "up" : "down", r.target);
}

/// Sorted readings of one direction as targets x runs; every run must have every target.
Eigen::MatrixXd table(const std::vector<PositionReading>& all, bool up,
                      const Eigen::VectorXd& target, const std::string& file) {
  std::vector<PositionReading> mine;
  std::copy_if(all.begin(), all.end(), std::back_inserter(mine),
               [&](const PositionReading& r) { return r.up == up; });
  const Index m = target.size();
  for (std::size_t i = 0; i < mine.size(); ++i) {
    PositionReading wanted = mine[i - i % std::size_t(m)];
    wanted.target = target[Index(i) % m];
    if (mine[i].order() != wanted.order())
      throw BadInput(file, mine[i].line, 1, place_of(wanted), place_of(mine[i]));
  }
  if (mine.size() % std::size_t(m) != 0)
    throw BadInput(file, mine.back().line, 1,
                   fmt::format("{} targets in run {}", m, mine.back().run),
                   fmt::format("{}", mine.size() % std::size_t(m)));
  Eigen::MatrixXd x(m, Index(mine.size()) / m);
  for (std::size_t i = 0; i < mine.size(); ++i) x(Index(i) % m, Index(i) / m) = mine[i].deviation;
  return x;
}

}  // namespace

PositionRuns assembled(std::vector<PositionReading> all, const std::string& file) {
  std::stable_sort(all.begin(), all.end(), [](const PositionReading& a, const PositionReading& b) {
    return a.order() < b.order();
  });
  std::vector<double> targets;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i > 0 && all[i].order() == all[i - 1].order())
      throw BadInput(file, all[i].line, 1, "every reading once", place_of(all[i]) + " again");
    targets.push_back(all[i].target);
  }
  std::sort(targets.begin(), targets.end());
  targets.erase(std::unique(targets.begin(), targets.end()), targets.end());
  if (targets.size() < 2) throw BadInput(file, all.back().line, 0, "at least 2 targets", "1");
  PositionRuns runs;
  runs.target = Eigen::Map<const Eigen::VectorXd>(targets.data(), Index(targets.size()));
  runs.up = table(all, true, runs.target, file);
  runs.down = table(all, false, runs.target, file);
  return runs;
}

void check_size(std::string_view text, const std::string& file,
                const PositionFileOptions& options) {
  if (text.size() > options.max_bytes)
    throw BadInput(file, 0, 0, fmt::format("at most {} bytes", options.max_bytes),
                   fmt::format("{}", text.size()));
}

}  // namespace abbe::errors::metrology
