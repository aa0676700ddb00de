#include "sim/cut/pose_table.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "kinematics/jacobian.h"
#include "kinematics/units.h"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;
using kinematics::Joint;

constexpr std::size_t poses_a_block = 64, blocks_at_once = 64;
constexpr const char* rows_of_jacobian[] = {"dx", "dy", "dz", "da", "db", "dc"};
constexpr const char* coordinates = "xyz";

void add_heads(std::vector<std::string>& heads, const std::string& what, const char* unit) {
  for (int i = 0; i < 3; ++i) heads.push_back(fmt::format("{}_{}_{}", what, coordinates[i], unit));
}

/// Columns of a Jacobian whose element means something on this chain.
std::vector<int> meaningful(const kinematics::Chain& chain, bool location,
                            std::vector<std::string>& names) {
  std::vector<int> columns;
  for (int i = 0; i < 6 * chain.size(); ++i) {
    const Joint& joint = chain.joints()[std::size_t(i / 6)];
    const char axis = joint.motion == kinematics::Motion::Spindle ? 'S' : joint.name;
    const errors::ElementName name{"XYZABC"[i % 6], axis, location};
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

// ---- lines

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

/// The lines of some poses, or the first of them that cannot be.
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

PoseTable::PoseTable(const IdleMachine& idle, const PoseWishes& wishes)
    : idle_(idle),
      sources_(chosen_sources(error_sources(idle), wishes.elements)),
      has_shares_(!wishes.elements.empty()),
      jacobians_(wishes.jacobians) {
  add_heads(heads_, "tip", "mm");
  add_heads(heads_, "deviation", "um");
  heads_.push_back("deviation_um");
  add_heads(heads_, "direction", "urad");
  heads_.push_back("direction_urad");
  for (const ErrorSource& source : sources_) add_share(source.name);
  if (has_shares_) add_share("rest");
  for (const PoseJacobian one : jacobians_) add_jacobian(one);
}

void PoseTable::add_share(const std::string& source) {
  add_heads(heads_, source, "um");
  add_heads(heads_, source, "urad");
  wished_.push_back({source, false});
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
    wished_.push_back({name, true});
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
  if (has_shares_) {
    const auto all = shares(idle_, sources_, state);
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
  for (std::size_t first = 0; first < n; first += blocks_at_once * poses_a_block) {
    if (progress != nullptr) progress->report("poses", double(first) / double(n));
    stop_if_interrupted();
    const std::size_t count =
        std::min(blocks_at_once, (n - first + poses_a_block - 1) / poses_a_block);
    blocks.assign(count, {});
    tbb::parallel_for(std::size_t(0), count, [&](std::size_t b) {
      const std::size_t from = first + b * poses_a_block;
      blocks[b] = block(table, poses, format, from, std::min(n, from + poses_a_block), deviation_um,
                        direction_urad);
    });
    for (const Block& one : blocks) {
      if (!one.fault.empty()) refuse(poses, one);
      sink(one.text);
    }
  }
  return pose_statistics(deviation_um, direction_urad);
}

}  // namespace abbe::sim
