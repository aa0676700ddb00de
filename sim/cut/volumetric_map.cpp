#include "sim/cut/volumetric_map.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/cut/pose.h"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;
using kinematics::Chain;
using kinematics::Joint;

constexpr int usual_counts[] = {101, 21, 11};  // of one, two, three runs

[[noreturn]] void refuse(std::size_t column, const std::string& expected, const std::string& seen) {
  throw BadInput("--grid", 1, int(column) + 1, expected, seen);
}

/// What is said of one axis, in mm or degrees.
struct Said {
  bool runs = true;
  std::optional<double> from, to;  ///< where it stands: from
  int count = 0;                   ///< 0: the usual one
  std::size_t column = 0;
};

double number_at(const Cell& cell) {
  const auto number = number_of(cell.text);
  if (!number)
    refuse(std::size_t(cell.column) - 1, "a number in mm or degrees", in_quotes(cell.text));
  return *number;
}

int count_at(const Cell& cell) {
  const auto number = number_of(cell.text);
  if (!number || *number != std::floor(*number) || *number < 2 || *number > most_grid_poses)
    refuse(std::size_t(cell.column) - 1, fmt::format("a count of 2 .. {} points", most_grid_poses),
           in_quotes(cell.text));
  return int(*number);
}

/// "0:400:9" or "10", which begins at `column` of the whole.
Said said_of(std::string_view text, std::size_t column) {
  Said said;
  said.column = column;
  std::vector<Cell> cells = cells_of(text, ':', 3);
  for (Cell& cell : cells) cell.column += int(column);
  if (cells.size() > 3) refuse(std::size_t(cells[3].column) - 1, "from:to:count", "more");
  if (cells.size() == 1) {
    said.runs = false;
    said.from = number_at(cells[0]);
    return said;
  }
  if (!cells[0].text.empty()) said.from = number_at(cells[0]);
  if (!cells[1].text.empty()) said.to = number_at(cells[1]);
  if (cells.size() > 2 && !cells[2].text.empty()) said.count = count_at(cells[2]);
  return said;
}

/// One a joint; empty where nothing is said.
std::vector<std::optional<Said>> parsed(const Chain& chain, const std::string& text) {
  std::vector<std::optional<Said>> all(std::size_t(chain.size()));
  std::size_t i = 0;
  const auto is_gap = [&](std::size_t k) { return text[k] == ' ' || text[k] == ','; };
  while (true) {
    while (i < text.size() && is_gap(i)) ++i;
    if (i == text.size()) return all;
    const auto joint = chain.find(text[i]);
    if (!joint || !is_positioned(chain.joints()[std::size_t(*joint)]))
      refuse(i, "an axis of this machine (" + axis_names(chain) + ")",
             in_quotes(std::string(1, text[i])));
    auto& said = all[std::size_t(*joint)];
    if (said) refuse(i, "every axis once", in_quotes(text.substr(i, 1)) + " again");
    if (i + 1 == text.size() || text[i + 1] != '=')
      refuse(i + 1, "= after the axis, such as X=0:400:9",
             i + 1 == text.size() ? "nothing" : in_quotes(text.substr(i + 1, 1)));
    const std::size_t start = i + 2;
    for (i = start; i < text.size() && !is_gap(i);) ++i;
    said = said_of(std::string_view(text).substr(start, i - start), start);
  }
}

bool is_limited(const Joint& joint) {
  const double unlimited = 1e9;  // what a joint has that says nothing
  return joint.min > -unlimited && joint.max < unlimited;
}

void check_place(const Joint& joint, double place, std::size_t column) {
  const double q = place * position_unit(joint);
  if (q < joint.min || q > joint.max) refuse(column, travel_text(joint), fmt::format("{}", place));
}

PoseGrid::Run run_of(const Joint& joint, int j, const Said& said, int usual) {
  const double unit = position_unit(joint);
  if ((!said.from || !said.to) && !is_limited(joint))
    refuse(said.column, fmt::format("{0}=from:to for an axis without limits of travel", joint.name),
           "an end left out");
  const PoseGrid::Run run{j, said.from.value_or(joint.min / unit),
                          said.to.value_or(joint.max / unit), said.count > 0 ? said.count : usual};
  if (said.from) check_place(joint, run.from, said.column);
  if (said.to) check_place(joint, run.to, said.column);
  if (!(run.from < run.to))
    refuse(said.column, "from below to", fmt::format("{} and {}", run.from, run.to));
  return run;
}

/// Exact at both ends, and at round numbers between them.
double place_of(const PoseGrid::Run& run, int i) {
  const int last = run.count - 1;
  return (run.from * (last - i) + run.to * i) / last;
}

void fill(PoseGrid& grid, const Chain& chain, const std::vector<double>& standing) {
  std::vector<int> run_of_column;
  for (int j = 0; j < chain.size(); ++j) {
    const Joint& joint = chain.joints()[std::size_t(j)];
    if (!is_positioned(joint)) continue;
    grid.poses.columns.push_back(
        {fmt::format("{}_{}", joint.name, position_word(joint)), j, position_unit(joint)});
    int run = -1;
    for (std::size_t r = 0; r < grid.runs.size(); ++r)
      if (grid.runs[r].joint == j) run = int(r);
    run_of_column.push_back(run);
  }
  const auto [nx, ny, nz] = grid.size;
  grid.poses.numbers.reserve(std::size_t(nx) * ny * nz * run_of_column.size());
  for (int k = 0; k < nz; ++k)
    for (int l = 0; l < ny; ++l)
      for (int i = 0; i < nx; ++i) {
        const std::array<int, 3> at{i, l, k};
        for (std::size_t c = 0; c < run_of_column.size(); ++c) {
          const int run = run_of_column[c];
          grid.poses.numbers.push_back(
              run < 0 ? standing[std::size_t(grid.poses.columns[c].joint)]
                      : place_of(grid.runs[std::size_t(run)], at[std::size_t(run)]));
        }
      }
}

}  // namespace

PoseGrid pose_grid(const IdleMachine& idle, const std::string& text) {
  const Chain& chain = idle.machine.nominal;
  auto said = parsed(chain, text);
  std::size_t running = 0;
  std::vector<double> standing(std::size_t(chain.size()), 0.0);
  for (int j = 0; j < chain.size(); ++j) {
    const Joint& joint = chain.joints()[std::size_t(j)];
    auto& one = said[std::size_t(j)];
    if (!one && joint.motion == kinematics::Motion::Linear)
      one = Said{true, {}, {}, 0, text.size()};
    if (one && one->runs) ++running;
    if (one && !one->runs) {
      check_place(joint, *one->from, one->column);
      standing[std::size_t(j)] = *one->from;
    }
    if (!one && is_positioned(joint))
      standing[std::size_t(j)] = idle.scene.machine.home[j] / position_unit(joint);
  }
  if (running == 0 || running > 3)
    refuse(0, "one to three axes that run; give the others a place such as Y=0, or use --at-file",
           fmt::format("{}", running));
  PoseGrid grid;
  for (int j = 0; j < chain.size(); ++j)
    if (const auto& one = said[std::size_t(j)]; one && one->runs)
      grid.runs.push_back(
          run_of(chain.joints()[std::size_t(j)], j, *one, usual_counts[running - 1]));
  double poses = 1.0;
  for (std::size_t r = 0; r < grid.runs.size(); ++r) {
    grid.size[r] = grid.runs[r].count;
    poses *= grid.runs[r].count;
  }
  if (poses > double(most_grid_poses))
    refuse(0, fmt::format("at most {} poses in all", most_grid_poses), fmt::format("{}", poses));
  grid.poses.file = "--grid";
  grid.poses.others = kinematics::AxisVector::Zero(chain.size());
  fill(grid, chain, standing);
  return grid;
}

VolumetricMap volumetric_map(const IdleMachine& idle, PoseGrid grid) {
  const auto n = Eigen::Index(grid.poses.size());
  VolumetricMap map{std::move(grid), cutting::Points(n, 3), cutting::Points(n, 3),
                    cutting::Points(n, 3), cutting::Points(n, 3)};
  std::vector<std::string> fault{std::size_t(n), std::string()};
  tbb::parallel_for(Eigen::Index(0), n, [&](Eigen::Index i) {
    try {
      const TipPose pose = tip_pose(idle, map.grid.poses.state(std::size_t(i)));
      map.nominal.row(i) = pose.nominal.translation();
      map.deviation.row(i) = pose.deviation();
      map.direction.row(i) = pose.direction();
      map.rotation.row(i) =
          kinematics::rotation_vector(pose.actual.linear() * pose.nominal.linear().transpose());
      if (!map.deviation.row(i).allFinite()) fault[std::size_t(i)] = "its deviation is not finite";
    } catch (const std::out_of_range& left) {
      fault[std::size_t(i)] = left.what();
    }
  });
  for (std::size_t i = 0; i < fault.size(); ++i)
    if (!fault[i].empty())
      throw BadInput("--grid", 0, 0,
                     "positions inside the tables of the errors, such as X=-100:100",
                     map.grid.poses.text(i) + ": " + fault[i]);
  return map;
}

FarthestPair farthest_pair(const cutting::Points& points) {
  // from the outside in: no pair of two inner points is farther apart than their radii allow
  const Eigen::RowVector3d lower = points.colwise().minCoeff(), upper = points.colwise().maxCoeff();
  const Eigen::RowVector3d middle = 0.5 * (lower + upper);
  const Eigen::VectorXd radius = (points.rowwise() - middle).rowwise().norm();
  std::vector<std::size_t> order(std::size_t(points.rows()));
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return radius[Eigen::Index(a)] > radius[Eigen::Index(b)];
  });
  FarthestPair best;
  for (std::size_t i = 1; i < order.size(); ++i) {
    const auto p = Eigen::Index(order[i]);
    if (radius[p] + radius[Eigen::Index(order[0])] < best.distance) break;
    for (std::size_t k = 0; k < i; ++k) {
      const auto q = Eigen::Index(order[k]);
      if (radius[p] + radius[q] < best.distance) break;
      const double distance = (points.row(p) - points.row(q)).norm();
      if (distance > best.distance)
        best = {std::min(order[i], order[k]), std::max(order[i], order[k]), distance};
    }
  }
  return best;
}

VolumetricSummary summary(const VolumetricMap& map) {
  VolumetricSummary s;
  s.all = pose_statistics(map.deviation.rowwise().norm() / units::um,
                          map.direction.rowwise().norm() / units::urad);
  const auto range = [](const cutting::Points& points) {
    return Vector3d((points.colwise().maxCoeff() - points.colwise().minCoeff()).transpose());
  };
  s.mean_um = map.deviation.colwise().mean().transpose() / units::um;
  s.range_um = range(map.deviation) / units::um;
  s.range_urad = range(map.rotation) / units::urad;
  const FarthestPair pair = farthest_pair(map.deviation);
  s.worst_pair = {pair.a, pair.b};
  s.worst_pair_um = pair.distance / units::um;
  return s;
}

}  // namespace abbe::sim
