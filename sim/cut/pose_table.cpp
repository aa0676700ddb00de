#include "sim/cut/pose_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "kinematics/jacobian.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/cut/idle_machine.h"

namespace abbe::sim {

namespace {

using Eigen::Vector3d;
using kinematics::Joint;

// Blocks are what a thread computes in one go; 64 of them (4096 poses) bound the text held in
// memory.
constexpr std::size_t poses_per_block = 64, blocks_at_once = 64;
constexpr const char* rows_of_jacobian[] = {"dx", "dy", "dz", "da", "db", "dc"};
constexpr const char* coordinates = "xyz";

void add_heads(std::vector<std::string>& heads, const std::string& what, const char* unit) {
  for (int i = 0; i < 3; ++i) heads.push_back(fmt::format("{}_{}_{}", what, coordinates[i], unit));
}

/// Returns the columns of a Jacobian whose error element exists on this chain by ISO 230-1.
std::vector<int> meaningful(const kinematics::Chain& chain, bool location,
                            std::vector<std::string>& names) {
  std::vector<int> columns;
  for (int i = 0; i < 6 * chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i / 6)];
    const char axis = joint.motion == kinematics::Motion::Spindle ? 'S' : joint.name;
    const errors::ElementName name{"XYZABC"[i % 6], axis, location};
    // `bind` has the rules of ISO 230-1 for elements, so it decides instead of a second list here.
    try {
      errors::bind({{{name, {{errors::Constant{0.0}}}}}, {}}, chain);
    } catch (const std::invalid_argument&) {
      continue;
    }
    columns.push_back(i);
    names.push_back(to_string(name));
  }
  return columns;
}

// Appends the three components in a unit. Adding 0.0 turns -0 into 0, so that equal poses print
// equally.
void append(std::vector<double>& numbers, const Vector3d& v, double unit) {
  for (const double x : v) numbers.push_back(x / unit + 0.0);  // no -0
}

template <typename Matrix>
void append_columns(std::vector<double>& numbers, const Matrix& J,
                    const std::vector<int>& columns) {
  for (const int k : columns)
    for (int i = 0; i < 6; ++i) numbers.push_back(J(i, k) + 0.0);
}

std::vector<int> positioned(const kinematics::Chain& chain) {
  std::vector<int> joints;
  for (int j = 0; j < chain.size(); ++j)
    if (is_positioned(chain.joints()[std::size_t(j)])) joints.push_back(j);
  return joints;
}

// Lines of the table

void append_csv(std::string& text, const PoseList& poses, std::size_t i,
                const std::vector<double>& numbers) {
  text += fmt::format("{}", i + 1);
  const std::size_t width = poses.columns.size();
  for (std::size_t k = 0; k < width; ++k) text += fmt::format(",{}", poses.numbers[i * width + k]);
  for (const double x : numbers) text += fmt::format(",{}", x);
  text += '\n';
}

void append_json(std::string& text, const PoseList& poses, std::size_t i,
                 const std::vector<double>& numbers, const std::vector<std::string>& heads) {
  text += fmt::format("{}    {{\"pose\": {}", i > 0 ? ",\n" : "", i + 1);
  const std::size_t width = poses.columns.size();
  for (std::size_t k = 0; k < width; ++k)
    text += fmt::format(", \"{}\": {}", poses.columns[k].head, poses.numbers[i * width + k]);
  for (std::size_t k = 0; k < numbers.size(); ++k)
    text += fmt::format(", \"{}\": {}", heads[k], numbers[k]);
  text += '}';
}

std::string csv_head(const PoseTable& table, const PoseList& poses) {
  std::string text = "pose";
  for (const PoseList::Column& column : poses.columns) text += "," + column.head;
  for (const std::string& head : table.heads()) text += "," + head;
  return text + "\n";
}

/// The text of a block of poses, or the first pose that cannot be computed.
struct Block {
  std::string text;
  std::size_t fault_at = 0;
  std::string fault;
};

Block block(const PoseTable& table, const PoseList& poses, TableFormat format, std::size_t first,
            std::size_t last, Eigen::VectorXd& deviation_um, Eigen::VectorXd& direction_urad) {
  Block result;
  for (std::size_t i = first; i < last; ++i) {
    try {
      const PoseTable::Row row = table.row(poses.state(i));
      deviation_um[Eigen::Index(i)] = row.deviation.norm() / units::um;
      direction_urad[Eigen::Index(i)] = row.direction.norm() / units::urad;
      if (format == TableFormat::Csv)
        append_csv(result.text, poses, i, row.numbers);
      else
        append_json(result.text, poses, i, row.numbers, table.heads());
    } catch (const std::out_of_range& left) {
      result.fault_at = i;
      result.fault = left.what();
      return result;
    }
  }
  return result;
}

[[noreturn]] void refuse(const PoseList& poses, const Block& block) {
  const int line = poses.line.empty() ? 0 : poses.line[block.fault_at];
  throw BadInput(poses.file, line, 0, "positions inside the tables of the errors",
                 poses.text(block.fault_at) + ": " + block.fault);
}

}  // namespace

PoseTable::PoseTable(const IdleMachine& idle, const PoseRequest& wishes)
    : idle_(idle),
      sources_(select_sources(error_sources(idle), wishes.elements)),
      has_contributions_(!wishes.elements.empty()),
      jacobians_(wishes.jacobians) {
  add_heads(heads_, "tip", "mm");
  add_heads(heads_, "deviation", "um");
  heads_.push_back("deviation_um");
  add_heads(heads_, "direction", "urad");
  heads_.push_back("direction_urad");
  for (const ErrorSource& source : sources_) add_contribution(source.name);
  if (has_contributions_) add_contribution("rest");
  for (const PoseJacobian one : jacobians_) add_jacobian(one);
}

void PoseTable::add_contribution(const std::string& source) {
  add_heads(heads_, source, "um");
  add_heads(heads_, source, "urad");
  requested_columns_.push_back({source, false});
}

void PoseTable::add_jacobian(PoseJacobian which) {
  const kinematics::Chain& chain = idle_.machine.nominal;
  std::vector<std::string> names;
  if (which == PoseJacobian::Motion) motions_ = meaningful(chain, false, names);
  if (which == PoseJacobian::Location) locations_ = meaningful(chain, true, names);
  if (which == PoseJacobian::Axis)
    for (const int j : positioned(chain))
      names.push_back(std::string(1, chain.joints()[std::size_t(j)].name));
  for (const std::string& name : names) {
    for (const char* row : rows_of_jacobian) heads_.push_back(fmt::format("{}_d{}", row, name));
    requested_columns_.push_back({name, true});
  }
}

PoseTable::Row PoseTable::row(const kinematics::AxisState& state) const {
  const TipPose pose = tip_pose(idle_, state);
  Row row{pose.deviation(), pose.direction(), {}};
  std::vector<double>& numbers = row.numbers;
  numbers.reserve(heads_.size());
  append(numbers, pose.nominal.translation(), 1.0);
  append(numbers, row.deviation, units::um);
  numbers.push_back(row.deviation.norm() / units::um);
  append(numbers, row.direction, units::urad);
  numbers.push_back(row.direction.norm() / units::urad);
  if (has_contributions_) {
    const auto all = source_contributions(idle_, sources_, state);
    Eigen::Matrix<double, 6, 1> rest;
    rest << row.deviation, row.direction;
    rest -= all.rowwise().sum();
    for (Eigen::Index k = 0; k <= all.cols(); ++k) {
      const Eigen::Matrix<double, 6, 1> one = k < all.cols() ? all.col(k).eval() : rest;
      append(numbers, one.head<3>(), units::um);
      append(numbers, one.tail<3>(), units::urad);
    }
  }
  const kinematics::Chain& nominal = idle_.machine.nominal;
  for (const PoseJacobian one : jacobians_) {
    if (one == PoseJacobian::Axis)
      append_columns(numbers, kinematics::axis_jacobian(nominal, state.q), positioned(nominal));
    if (one == PoseJacobian::Motion)
      append_columns(numbers, kinematics::motion_jacobian(nominal, state.q), motions_);
    if (one == PoseJacobian::Location)
      append_columns(numbers, kinematics::location_jacobian(nominal, state.q), locations_);
  }
  // Deviations overflow only with errors in an absurd unit; JSON has no text for infinity.
  if (!std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); }))
    throw std::out_of_range("its deviation is not finite");
  return row;
}

PoseStatistics pose_statistics(const Eigen::VectorXd& deviation_um,
                               const Eigen::VectorXd& direction_urad) {
  PoseStatistics s;
  s.poses = std::size_t(deviation_um.size());
  if (s.poses == 0) return s;
  Eigen::Index worst = 0, direction_worst = 0;
  s.max_um = deviation_um.maxCoeff(&worst);
  s.direction_max_urad = direction_urad.maxCoeff(&direction_worst);
  s.worst = std::size_t(worst);
  s.direction_worst = std::size_t(direction_worst);
  double squares = 0.0;
  for (const double d : deviation_um) squares += d * d;
  s.rms_um = std::sqrt(squares / double(s.poses));
  std::vector<double> sorted(deviation_um.begin(), deviation_um.end());
  // 95th percentile by nearest rank, so that it is the deviation of a pose
  const auto rank = std::ptrdiff_t(std::ceil(0.95 * double(s.poses))) - 1;
  std::nth_element(sorted.begin(), sorted.begin() + rank, sorted.end());
  s.p95_um = sorted[std::size_t(rank)];
  return s;
}

PoseStatistics write_poses(const PoseTable& table, const PoseList& poses, TableFormat format,
                           const std::function<void(std::string_view)>& sink,
                           ProgressLine* progress) {
  const std::size_t n = poses.size();
  Eigen::VectorXd deviation_um = Eigen::VectorXd::Zero(Eigen::Index(n));
  Eigen::VectorXd direction_urad = deviation_um;
  if (format == TableFormat::Csv) sink(csv_head(table, poses));
  std::vector<Block> blocks;
  for (std::size_t first = 0; first < n; first += blocks_at_once * poses_per_block) {
    if (progress != nullptr) progress->report("poses", double(first) / double(n));
    stop_if_interrupted();
    const std::size_t count =
        std::min(blocks_at_once, (n - first + poses_per_block - 1) / poses_per_block);
    blocks.assign(count, {});
    tbb::parallel_for(std::size_t(0), count, [&](std::size_t b) {
      const std::size_t from = first + b * poses_per_block;
      blocks[b] = block(table, poses, format, from, std::min(n, from + poses_per_block),
                        deviation_um, direction_urad);
    });
    // in order, so that the first invalid pose is reported for any number of threads
    for (const Block& one : blocks) {
      if (!one.fault.empty()) refuse(poses, one);
      sink(one.text);
    }
  }
  return pose_statistics(deviation_um, direction_urad);
}

kinematics::AxisVector positions_in(const std::string& at, const kinematics::Chain& chain,
                                    const std::string& option, Within within) {
  const auto refuse = [&](std::size_t column, const std::string& expected,
                          const std::string& seen) {
    throw BadInput(option, 1, int(column) + 1, expected, seen);
  };
  kinematics::AxisVector q = kinematics::AxisVector::Zero(chain.size());
  std::set<char> seen;
  std::size_t i = 0;
  while (true) {
    while (i < at.size() && (at[i] == ' ' || at[i] == ',')) ++i;
    if (i == at.size()) return q;
    const auto joint = chain.find(at[i]);
    if (!joint || !is_positioned(chain.joints()[std::size_t(*joint)]))
      refuse(i, "an axis of this machine (" + axis_names(chain) + ")",
             "'" + std::string(1, at[i]) + "'");
    if (!seen.insert(at[i]).second)
      refuse(i, "every axis once", "'" + std::string(1, at[i]) + "' again");
    const std::size_t start = i++;
    if (i < at.size() && at[i] == '=') ++i;
    double value = 0.0;
    const auto [end, error] = std::from_chars(at.data() + i, at.data() + at.size(), value);
    if (error != std::errc() || !std::isfinite(value))
      refuse(i, "a number in mm or degrees", "'" + at.substr(i, at.find(' ', i) - i) + "'");
    i = std::size_t(end - at.data());
    const kinematics::Joint& axis = chain.joints()[std::size_t(*joint)];
    q[*joint] = value * position_unit(axis);
    if (within == Within::Travel && (q[*joint] < axis.min || q[*joint] > axis.max))
      refuse(start, travel_text(axis), fmt::format("{:.9g}", value));
  }
}

PoseResult pose_at(const Scene& scene, const std::string& at, const PoseRequest& wishes) {
  const IdleMachine idle = idle_machine(scene);
  const PoseTable table(idle, wishes);
  kinematics::AxisState state;
  state.q = positions_in(at, idle.machine.nominal, "--at", Within::Travel);
  const auto requested_columns = [](const auto& all) {
    return std::vector(all.begin() + std::ptrdiff_t(PoseTable::always), all.end());
  };
  try {
    return {tip_pose(idle, state), table.requested_columns(), requested_columns(table.heads()),
            requested_columns(table.row(state).numbers), pose_warnings(idle, state.q, state.q)};
  } catch (const std::out_of_range& left) {
    throw BadInput("--at", 1, 0, "positions inside the tables of the errors", left.what());
  }
}

namespace {

using kinematics::Chain;

// Counts when none is given, for one, two and three runs: 101, 441 and 1331 poses.
constexpr int usual_counts[] = {101, 21, 11};  // of one, two, three runs

[[noreturn]] void refuse(std::size_t column, const std::string& expected, const std::string& seen) {
  throw BadInput("--grid", 1, int(column) + 1, expected, seen);
}

/// Positions given for one axis, in mm or degrees.
struct Said {
  bool runs = true;
  std::optional<double> from, to;  ///< a fixed position is in `from`
  int count = 0;                   ///< 0: the usual count
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
  if (!number || *number != std::floor(*number) || *number < 2 || *number > max_grid_poses)
    refuse(std::size_t(cell.column) - 1, fmt::format("a count of 2 .. {} points", max_grid_poses),
           in_quotes(cell.text));
  return int(*number);
}

/// Reads "0:400:9" or "10".
/// @param column  of `text` in the whole option
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

/// Returns the positions given for each joint; none for a joint that is not named.
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
  const double unlimited = 1e9;  // limit of a joint that states none
  return joint.min > -unlimited && joint.max < unlimited;
}

void check_place(const Joint& joint, double place, std::size_t column) {
  const double q = place * position_unit(joint);
  if (q < joint.min || q > joint.max) refuse(column, travel_text(joint), fmt::format("{}", place));
}

PoseGrid::Run grid_run(const Joint& joint, int j, const Said& said, int usual) {
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

/// Returns position i of a run; exact at both ends, and at round numbers between them, which from +
/// i * step is not.
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
        {fmt::format("{}_{}", joint.name, position_unit_label(joint)), j, position_unit(joint)});
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
    // a slide that is not named runs over its travel; a message about it points to the end of the
    // text
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
          grid_run(chain.joints()[std::size_t(j)], j, *one, usual_counts[running - 1]));
  double poses = 1.0;
  for (std::size_t r = 0; r < grid.runs.size(); ++r) {
    grid.size[r] = grid.runs[r].count;
    poses *= grid.runs[r].count;
  }
  if (poses > double(max_grid_poses))
    refuse(0, fmt::format("at most {} poses in all", max_grid_poses), fmt::format("{}", poses));
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
          // rotation of the actual tool relative to the nominal one, in workpiece axes
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
  // Points are visited from the outside inwards: two points can be no farther apart than the sum of
  // their radii, so both loops end early.
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
