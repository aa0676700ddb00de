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

#include "kinematics/inverse_kinematics.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/cut/idle_machine.h"
#include "sim/cut/part.h"

namespace abbe::sim {

namespace {

using Eigen::Vector3d;
using kinematics::Joint;

// A thread computes a block at a time. 64 blocks (4096 poses) bound the text held in memory.
constexpr std::size_t poses_per_block = 64, blocks_at_once = 64;
constexpr const char* jacobian_rows[] = {"dx", "dy", "dz", "da", "db", "dc"};
constexpr const char* coordinates = "xyz";

void add_heads(std::vector<std::string>& column_names, const std::string& quantity,
               const char* unit) {
  for (int i = 0; i < 3; ++i)
    column_names.push_back(fmt::format("{}_{}_{}", quantity, coordinates[i], unit));
}

/// Returns the columns of a Jacobian whose error element exists on a chain by ISO 230-1, and
/// appends their names.
std::vector<int> existing_elements(const kinematics::Chain& chain, bool is_location,
                                   std::vector<std::string>& names) {
  std::vector<int> columns;
  for (int i = 0; i < 6 * chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i / 6)];
    const char axis = joint.motion == kinematics::Motion::Spindle ? 'S' : joint.name;
    const errors::ElementName name{"XYZABC"[i % 6], axis, is_location};
    // `bind` has the rules of ISO 230-1 for elements.
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

// Appends the components of a vector in a unit. Adding 0.0 turns -0 into 0, so that equal poses
// have equal text.
void append(std::vector<double>& numbers, const Vector3d& v, double unit) {
  for (const double component : v) numbers.push_back(component / unit + 0.0);
}

template <typename Matrix>
void append_columns(std::vector<double>& numbers, const Matrix& J,
                    const std::vector<int>& columns) {
  for (const int k : columns)
    for (int i = 0; i < 6; ++i) numbers.push_back(J(i, k) + 0.0);
}

std::vector<int> positioned_joints(const kinematics::Chain& chain) {
  std::vector<int> joints;
  for (int j = 0; j < chain.size(); ++j)
    if (is_positioned(chain.joints()[std::size_t(j)])) joints.push_back(j);
  return joints;
}

// Lines of the table.

void append_csv(std::string& text, const PoseList& poses, std::size_t i,
                const std::vector<double>& numbers) {
  text += fmt::format("{}", i + 1);
  const std::size_t width = poses.columns.size();
  for (std::size_t k = 0; k < width; ++k) text += fmt::format(",{}", poses.numbers[i * width + k]);
  for (const double x : numbers) text += fmt::format(",{}", x);
  text += '\n';
}

void append_json(std::string& text, const PoseList& poses, std::size_t i,
                 const std::vector<double>& numbers, const std::vector<std::string>& column_names) {
  text += fmt::format("{}    {{\"pose\": {}", i > 0 ? ",\n" : "", i + 1);
  const std::size_t width = poses.columns.size();
  for (std::size_t k = 0; k < width; ++k)
    text += fmt::format(", \"{}\": {}", poses.columns[k].head, poses.numbers[i * width + k]);
  for (std::size_t k = 0; k < numbers.size(); ++k)
    text += fmt::format(", \"{}\": {}", column_names[k], numbers[k]);
  text += '}';
}

std::string csv_head(const PoseTable& table, const PoseList& poses) {
  std::string text = "pose";
  for (const PoseList::Column& column : poses.columns) text += "," + column.head;
  for (const std::string& head : table.column_names()) text += "," + head;
  return text + "\n";
}

/// The text of a block of poses, or the first error among them.
struct PoseBlock {
  std::string text;
  std::size_t error_pose = 0;  ///< number of the pose
  std::string error;           ///< empty if every pose was computed
};

PoseBlock compute_block(const PoseTable& table, const PoseList& poses, TableFormat format,
                        std::size_t first, std::size_t last, Eigen::VectorXd& deviation_um,
                        Eigen::VectorXd& direction_urad) {
  PoseBlock result;
  for (std::size_t i = first; i < last; ++i) {
    try {
      const PoseTable::Row row = table.row(poses.state(i));
      deviation_um[Eigen::Index(i)] = row.deviation.norm() / units::um;
      direction_urad[Eigen::Index(i)] = row.direction.norm() / units::urad;
      if (format == TableFormat::Csv)
        append_csv(result.text, poses, i, row.numbers);
      else
        append_json(result.text, poses, i, row.numbers, table.column_names());
    } catch (const std::out_of_range& range_error) {
      result.error_pose = i;
      result.error = range_error.what();
      return result;
    }
  }
  return result;
}

[[noreturn]] void throw_pose_error(const PoseList& poses, const PoseBlock& block) {
  const int line = poses.line.empty() ? 0 : poses.line[block.error_pose];
  throw BadInput(poses.file, line, 0, "positions within the error tables",
                 poses.text(block.error_pose) + ": " + block.error);
}

}  // namespace

PoseTable::PoseTable(const IdleMachine& idle, const PoseRequest& request)
    : idle_(idle),
      sources_(select_sources(error_sources(idle), request.elements)),
      has_contributions_(!request.elements.empty()),
      jacobians_(request.jacobians) {
  add_heads(heads_, "tip", "mm");
  add_heads(heads_, "deviation", "um");
  heads_.push_back("deviation_um");
  add_heads(heads_, "direction", "urad");
  heads_.push_back("direction_urad");
  for (const ErrorSource& source : sources_) add_contribution(source.name);
  if (has_contributions_) add_contribution("rest");
  for (const PoseJacobian jacobian : jacobians_) add_jacobian(jacobian);
}

void PoseTable::add_contribution(const std::string& source) {
  add_heads(heads_, source, "um");
  add_heads(heads_, source, "urad");
  requested_columns_.push_back({source, false});
}

void PoseTable::add_jacobian(PoseJacobian jacobian) {
  const kinematics::Chain& chain = idle_.machine.nominal;
  std::vector<std::string> names;
  if (jacobian == PoseJacobian::Motion) motions_ = existing_elements(chain, false, names);
  if (jacobian == PoseJacobian::Location) locations_ = existing_elements(chain, true, names);
  if (jacobian == PoseJacobian::Axis)
    for (const int j : positioned_joints(chain))
      names.push_back(std::string(1, chain.joints()[std::size_t(j)].name));
  for (const std::string& name : names) {
    for (const char* row : jacobian_rows) heads_.push_back(fmt::format("{}_d{}", row, name));
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
    const auto contributions = source_contributions(idle_, sources_, state);
    Eigen::Matrix<double, 6, 1> remainder;
    remainder << row.deviation, row.direction;
    remainder -= contributions.rowwise().sum();
    for (Eigen::Index k = 0; k <= contributions.cols(); ++k) {
      const Eigen::Matrix<double, 6, 1> contribution =
          k < contributions.cols() ? contributions.col(k).eval() : remainder;
      append(numbers, contribution.head<3>(), units::um);
      append(numbers, contribution.tail<3>(), units::urad);
    }
  }
  const kinematics::Chain& nominal = idle_.machine.nominal;
  for (const PoseJacobian jacobian : jacobians_) {
    if (jacobian == PoseJacobian::Axis)
      append_columns(numbers, kinematics::axis_jacobian(nominal, state.q),
                     positioned_joints(nominal));
    if (jacobian == PoseJacobian::Motion)
      append_columns(numbers, kinematics::motion_jacobian(nominal, state.q), motions_);
    if (jacobian == PoseJacobian::Location)
      append_columns(numbers, kinematics::location_jacobian(nominal, state.q), locations_);
  }
  // JSON has no text for infinity. Only errors in a wrong unit make deviations overflow.
  if (!std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); }))
    throw std::out_of_range("its deviation is not finite");
  return row;
}

PoseStatistics pose_statistics(const Eigen::VectorXd& deviation_um,
                               const Eigen::VectorXd& direction_urad) {
  PoseStatistics statistics;
  statistics.poses = std::size_t(deviation_um.size());
  if (statistics.poses == 0) return statistics;
  Eigen::Index worst = 0, direction_worst = 0;
  statistics.max_um = deviation_um.maxCoeff(&worst);
  statistics.direction_max_urad = direction_urad.maxCoeff(&direction_worst);
  statistics.worst = std::size_t(worst);
  statistics.direction_worst = std::size_t(direction_worst);
  double squared_sum = 0.0;
  for (const double deviation : deviation_um) squared_sum += deviation * deviation;
  statistics.rms_um = std::sqrt(squared_sum / double(statistics.poses));
  std::vector<double> deviations(deviation_um.begin(), deviation_um.end());
  // The nearest rank gives a percentile that is the deviation of a pose.
  const auto rank = std::ptrdiff_t(std::ceil(0.95 * double(statistics.poses))) - 1;
  std::nth_element(deviations.begin(), deviations.begin() + rank, deviations.end());
  statistics.p95_um = deviations[std::size_t(rank)];
  return statistics;
}

PoseStatistics write_poses(const PoseTable& table, const PoseList& poses, TableFormat format,
                           const std::function<void(std::string_view)>& sink,
                           ProgressLine* progress) {
  const std::size_t pose_count = poses.size();
  Eigen::VectorXd deviation_um = Eigen::VectorXd::Zero(Eigen::Index(pose_count));
  Eigen::VectorXd direction_urad = deviation_um;
  if (format == TableFormat::Csv) sink(csv_head(table, poses));
  std::vector<PoseBlock> blocks;
  for (std::size_t first = 0; first < pose_count; first += blocks_at_once * poses_per_block) {
    if (progress != nullptr) progress->report("poses", double(first) / double(pose_count));
    stop_if_interrupted();
    const std::size_t count =
        std::min(blocks_at_once, (pose_count - first + poses_per_block - 1) / poses_per_block);
    blocks.assign(count, {});
    tbb::parallel_for(std::size_t(0), count, [&](std::size_t b) {
      const std::size_t from = first + b * poses_per_block;
      blocks[b] =
          compute_block(table, poses, format, from, std::min(pose_count, from + poses_per_block),
                        deviation_um, direction_urad);
    });
    // In order, so that the first invalid pose is reported for any number of threads.
    for (const PoseBlock& block : blocks) {
      if (!block.error.empty()) throw_pose_error(poses, block);
      sink(block.text);
    }
  }
  return pose_statistics(deviation_um, direction_urad);
}

kinematics::AxisVector parse_positions(const std::string& text, const kinematics::Chain& chain,
                                       const std::string& option, Within within) {
  const auto throw_error = [&](std::size_t column, const std::string& expected,
                               const std::string& named_axes) {
    throw BadInput(option, 1, int(column) + 1, expected, named_axes);
  };
  kinematics::AxisVector q = kinematics::AxisVector::Zero(chain.size());
  std::set<char> named_axes;
  std::size_t i = 0;
  while (true) {
    while (i < text.size() && (text[i] == ' ' || text[i] == ',')) ++i;
    if (i == text.size()) return q;
    const auto joint = chain.find(text[i]);
    if (!joint || !is_positioned(chain.joints()[std::size_t(*joint)]))
      throw_error(i, "an axis of this machine (" + axis_names(chain) + ")",
                  "'" + std::string(1, text[i]) + "'");
    if (!named_axes.insert(text[i]).second)
      throw_error(i, "each axis only once", "'" + std::string(1, text[i]) + "' again");
    const std::size_t start = i++;
    if (i < text.size() && text[i] == '=') ++i;
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data() + i, text.data() + text.size(), value);
    if (error != std::errc() || !std::isfinite(value))
      throw_error(i, "a number in mm or degrees",
                  "'" + text.substr(i, text.find(' ', i) - i) + "'");
    i = std::size_t(end - text.data());
    const kinematics::Joint& axis = chain.joints()[std::size_t(*joint)];
    q[*joint] = value * position_unit(axis);
    if (within == Within::Travel && (q[*joint] < axis.min || q[*joint] > axis.max))
      throw_error(start, travel_text(axis), fmt::format("{:.9g}", value));
  }
}

PoseResult pose_at(const Scene& scene, const std::string& positions, const PoseRequest& request) {
  const IdleMachine idle = idle_machine(scene);
  const PoseTable table(idle, request);
  kinematics::AxisState state;
  state.q = parse_positions(positions, idle.machine.nominal, "--at", Within::Travel);
  const auto requested_part = [](const auto& columns) {
    return std::vector(columns.begin() + std::ptrdiff_t(PoseTable::fixed_column_count),
                       columns.end());
  };
  try {
    return {tip_pose(idle, state), table.requested_columns(), requested_part(table.column_names()),
            requested_part(table.row(state).numbers), pose_warnings(idle, state.q, state.q)};
  } catch (const std::out_of_range& range_error) {
    throw BadInput("--at", 1, 0, "positions within the error tables", range_error.what());
  }
}

namespace {

using kinematics::Chain;

// Points along each of one, two or three runs: 101, 441 and 1331 poses.
constexpr int default_counts[] = {101, 21, 11};

[[noreturn]] void throw_grid_error(std::size_t column, const std::string& expected,
                                   const std::string& seen) {
  throw BadInput("--grid", 1, int(column) + 1, expected, seen);
}

/// The range of an axis in a grid, or its fixed position, mm or degrees.
struct AxisRange {
  bool runs = true;                ///< false: the axis stays at `from`
  std::optional<double> from, to;  ///< none: the end of the travel
  int count = 0;                   ///< 0: the default
  std::size_t column = 0;          ///< of the text in the option, for messages
};

double number_at(const Cell& cell) {
  const auto number = number_of(cell.text);
  if (!number)
    throw_grid_error(std::size_t(cell.column) - 1, "a number in mm or degrees",
                     quoted_excerpt(cell.text));
  return *number;
}

int count_at(const Cell& cell) {
  const auto number = number_of(cell.text);
  if (!number || *number != std::floor(*number) || *number < 2 || *number > max_grid_poses)
    throw_grid_error(std::size_t(cell.column) - 1,
                     fmt::format("a count from 2 to {} points", max_grid_poses),
                     quoted_excerpt(cell.text));
  return int(*number);
}

/// Reads a range such as "0:400:9" or a position such as "10".
/// @param column  of `text` in the option
AxisRange parse_range(std::string_view text, std::size_t column) {
  AxisRange range;
  range.column = column;
  std::vector<Cell> cells = split_cells(text, ':', 3);
  for (Cell& cell : cells) cell.column += int(column);
  if (cells.size() > 3) throw_grid_error(std::size_t(cells[3].column) - 1, "from:to:count", "more");
  if (cells.size() == 1) {
    range.runs = false;
    range.from = number_at(cells[0]);
    return range;
  }
  if (!cells[0].text.empty()) range.from = number_at(cells[0]);
  if (!cells[1].text.empty()) range.to = number_at(cells[1]);
  if (cells.size() > 2 && !cells[2].text.empty()) range.count = count_at(cells[2]);
  return range;
}

/// Returns (joints) the ranges in a text; none for a joint that it does not name.
std::vector<std::optional<AxisRange>> parse_grid(const Chain& chain, const std::string& text) {
  std::vector<std::optional<AxisRange>> ranges(std::size_t(chain.size()));
  std::size_t i = 0;
  const auto is_gap = [&](std::size_t k) { return text[k] == ' ' || text[k] == ','; };
  while (true) {
    while (i < text.size() && is_gap(i)) ++i;
    if (i == text.size()) return ranges;
    const auto joint = chain.find(text[i]);
    if (!joint || !is_positioned(chain.joints()[std::size_t(*joint)]))
      throw_grid_error(i, "an axis of this machine (" + axis_names(chain) + ")",
                       quoted_excerpt(std::string(1, text[i])));
    auto& range = ranges[std::size_t(*joint)];
    if (range)
      throw_grid_error(i, "each axis only once", quoted_excerpt(text.substr(i, 1)) + " again");
    if (i + 1 == text.size() || text[i + 1] != '=')
      throw_grid_error(i + 1, "= after the axis, such as X=0:400:9",
                       i + 1 == text.size() ? "nothing" : quoted_excerpt(text.substr(i + 1, 1)));
    const std::size_t start = i + 2;
    for (i = start; i < text.size() && !is_gap(i);) ++i;
    range = parse_range(std::string_view(text).substr(start, i - start), start);
  }
}

bool is_limited(const Joint& joint) {
  const double unlimited = 1e9;  // mm or rad, limit of a joint that states none
  return joint.min > -unlimited && joint.max < unlimited;
}

void check_position(const Joint& joint, double position, std::size_t column) {
  const double q = position * position_unit(joint);
  if (q < joint.min || q > joint.max)
    throw_grid_error(column, travel_text(joint), fmt::format("{}", position));
}

PoseGrid::Run grid_run(const Joint& joint, int j, const AxisRange& range, int default_count) {
  const double unit = position_unit(joint);
  if ((!range.from || !range.to) && !is_limited(joint))
    throw_grid_error(range.column,
                     fmt::format("{0}=from:to for an axis without travel limits", joint.name),
                     "a missing end");
  const PoseGrid::Run run{j, range.from.value_or(joint.min / unit),
                          range.to.value_or(joint.max / unit),
                          range.count > 0 ? range.count : default_count};
  if (range.from) check_position(joint, run.from, range.column);
  if (range.to) check_position(joint, run.to, range.column);
  if (!(run.from < run.to))
    throw_grid_error(range.column, "a start below the end",
                     fmt::format("{} and {}", run.from, run.to));
  return run;
}

/// Returns position i of a run. Unlike from + i * step it is exact at both ends and at round
/// numbers between them.
double grid_position(const PoseGrid::Run& run, int i) {
  const int last = run.count - 1;
  return (run.from * (last - i) + run.to * i) / last;
}

void fill_poses(PoseGrid& grid, const Chain& chain, const std::vector<double>& fixed_positions) {
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
        const std::array<int, 3> grid_index{i, l, k};
        for (std::size_t c = 0; c < run_of_column.size(); ++c) {
          const int run = run_of_column[c];
          grid.poses.numbers.push_back(
              run < 0 ? fixed_positions[std::size_t(grid.poses.columns[c].joint)]
                      : grid_position(grid.runs[std::size_t(run)], grid_index[std::size_t(run)]));
        }
      }
}

}  // namespace

PoseGrid pose_grid(const IdleMachine& idle, const std::string& text) {
  const Chain& chain = idle.machine.nominal;
  auto ranges = parse_grid(chain, text);
  std::size_t running_count = 0;
  std::vector<double> fixed_positions(std::size_t(chain.size()), 0.0);
  for (int j = 0; j < chain.size(); ++j) {
    const Joint& joint = chain.joints()[std::size_t(j)];
    auto& axis_range = ranges[std::size_t(j)];
    // A slide that is not named runs over its travel. Messages about it point to the end of the
    // text.
    if (!axis_range && joint.motion == kinematics::Motion::Linear)
      axis_range = AxisRange{true, {}, {}, 0, text.size()};
    if (axis_range && axis_range->runs) ++running_count;
    if (axis_range && !axis_range->runs) {
      check_position(joint, *axis_range->from, axis_range->column);
      fixed_positions[std::size_t(j)] = *axis_range->from;
    }
    if (!axis_range && is_positioned(joint))
      fixed_positions[std::size_t(j)] = idle.scene.machine.home[j] / position_unit(joint);
  }
  if (running_count == 0 || running_count > 3)
    throw_grid_error(
        0,
        "one to three axes with a range; give the others a position such as Y=0, or use --at-file",
        fmt::format("{}", running_count));
  PoseGrid grid;
  for (int j = 0; j < chain.size(); ++j)
    if (const auto& axis_range = ranges[std::size_t(j)]; axis_range && axis_range->runs)
      grid.runs.push_back(grid_run(chain.joints()[std::size_t(j)], j, *axis_range,
                                   default_counts[running_count - 1]));
  double poses = 1.0;
  for (std::size_t r = 0; r < grid.runs.size(); ++r) {
    grid.size[r] = grid.runs[r].count;
    poses *= grid.runs[r].count;
  }
  if (poses > double(max_grid_poses))
    throw_grid_error(0, fmt::format("at most {} poses in total", max_grid_poses),
                     fmt::format("{}", poses));
  grid.poses.file = "--grid";
  grid.poses.others = kinematics::AxisVector::Zero(chain.size());
  fill_poses(grid, chain, fixed_positions);
  return grid;
}

VolumetricMap volumetric_map(const IdleMachine& idle, PoseGrid grid) {
  const auto n = Eigen::Index(grid.poses.size());
  VolumetricMap map{std::move(grid), cutting::Points(n, 3), cutting::Points(n, 3),
                    cutting::Points(n, 3), cutting::Points(n, 3)};
  std::vector<std::string> error_texts{std::size_t(n), std::string()};
  tbb::parallel_for(Eigen::Index(0), n, [&](Eigen::Index i) {
    try {
      const TipPose pose = tip_pose(idle, map.grid.poses.state(std::size_t(i)));
      map.nominal.row(i) = pose.nominal.translation();
      map.deviation.row(i) = pose.deviation();
      map.direction.row(i) = pose.direction();
      map.rotation.row(i) =
          // of the actual relative to the nominal tool, about axes of the workpiece
          kinematics::rotation_vector(pose.actual.linear() * pose.nominal.linear().transpose());
      if (!map.deviation.row(i).allFinite())
        error_texts[std::size_t(i)] = "its deviation is not finite";
    } catch (const std::out_of_range& range_error) {
      error_texts[std::size_t(i)] = range_error.what();
    }
  });
  for (std::size_t i = 0; i < error_texts.size(); ++i)
    if (!error_texts[i].empty())
      throw BadInput("--grid", 0, 0, "positions within the error tables, such as X=-100:100",
                     map.grid.poses.text(i) + ": " + error_texts[i]);
  return map;
}

FarthestPair farthest_pair(const cutting::Points& points) {
  // Two points are at most as far apart as the sum of their radii about the middle. Points are
  // visited in falling order of radius, so that both loops end early.
  const Eigen::RowVector3d lower = points.colwise().minCoeff(), upper = points.colwise().maxCoeff();
  const Eigen::RowVector3d middle = 0.5 * (lower + upper);
  const Eigen::VectorXd radius = (points.rowwise() - middle).rowwise().norm();
  std::vector<std::size_t> order(std::size_t(points.rows()));
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return radius[Eigen::Index(a)] > radius[Eigen::Index(b)];
  });
  FarthestPair farthest;
  for (std::size_t i = 1; i < order.size(); ++i) {
    const auto outer = Eigen::Index(order[i]);
    if (radius[outer] + radius[Eigen::Index(order[0])] < farthest.distance) break;
    for (std::size_t k = 0; k < i; ++k) {
      const auto inner = Eigen::Index(order[k]);
      if (radius[outer] + radius[inner] < farthest.distance) break;
      const double distance = (points.row(outer) - points.row(inner)).norm();
      if (distance > farthest.distance)
        farthest = {std::min(order[i], order[k]), std::max(order[i], order[k]), distance};
    }
  }
  return farthest;
}

VolumetricSummary summary(const VolumetricMap& map) {
  VolumetricSummary result;
  result.all = pose_statistics(map.deviation.rowwise().norm() / units::um,
                               map.direction.rowwise().norm() / units::urad);
  result.mean_um = map.deviation.colwise().mean().transpose() / units::um;
  result.range_um = extents(map.deviation) / units::um;
  result.range_urad = extents(map.rotation) / units::urad;
  const FarthestPair pair = farthest_pair(map.deviation);
  result.worst_pair = {pair.a, pair.b};
  result.worst_pair_um = pair.distance / units::um;
  return result;
}

}  // namespace abbe::sim
