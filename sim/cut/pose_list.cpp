#include "sim/cut/pose_list.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/cut/pose.h"
#include "sim/scene/bad_scene.h"

namespace abbe::sim {
namespace {

using kinematics::Chain;
using kinematics::Joint;

constexpr std::size_t most_faults = 20;

struct TimeUnit {
  const char* head;
  double seconds;
};
constexpr TimeUnit time_units[] = {{"time_s", 1.0}, {"time_min", 60.0}, {"time_h", 3600.0}};

class Reader {
 public:
  Reader(std::string_view text, const std::string& file, const Chain& chain)
      : lines_(text, file), chain_(chain) {
    list_.file = file;
    list_.others = kinematics::AxisVector::Zero(chain.size());
  }

  PoseList read() {
    const auto head = lines_.next();
    if (!head)
      throw BadInput(list_.file, 1, 1, "a head such as " + known_columns(), "an empty file");
    read_head(*head);
    for (bool more = true; more;) {
      try {
        more = read_row();
      } catch (const BadInput& fault) {
        faults_.push_back(fault);
        if (faults_.size() == most_faults) break;
      }
    }
    if (!faults_.empty()) throw BadScene(faults_);
    if (list_.size() == 0) lines_.refuse(0, "at least one pose", "none");
    return std::move(list_);
  }

 private:
  std::string known_columns() const {
    std::string names;
    for (const Joint& joint : chain_.joints())
      if (is_positioned(joint)) names += fmt::format("{}_{},", joint.name, position_word(joint));
    return names + "time_s";
  }

  PoseList::Column column(const Cell& cell) const {
    for (const auto& [head, seconds] : time_units)
      if (cell.text == head) return {head, -1, seconds};
    const auto joint =
        cell.text.size() > 2 && cell.text[1] == '_' ? chain_.find(cell.text[0]) : std::nullopt;
    if (joint && is_positioned(chain_.joints()[std::size_t(*joint)])) {
      const Joint& axis = chain_.joints()[std::size_t(*joint)];
      const std::string_view unit = cell.text.substr(2);
      if (unit == position_word(axis)) return {std::string(cell.text), *joint, position_unit(axis)};
      if (unit == "rad" && axis.motion == kinematics::Motion::Rotary)
        return {std::string(cell.text), *joint, 1.0};
    }
    lines_.refuse(cell, "a column of " + known_columns());
  }

  void read_head(const Line& line) {
    separator_ = separator_of(line.text);
    const std::size_t most = std::size_t(chain_.size()) + 1;
    const std::vector<Cell> cells = cells_of(line.text, separator_, most);
    for (const Cell& cell : cells) {
      PoseList::Column one = column(cell);
      for (const PoseList::Column& other : list_.columns)
        if (other.joint == one.joint)
          lines_.refuse(cell, one.joint < 0 ? "one column of time" : "every axis once");
      list_.columns.push_back(std::move(one));
    }
    if (std::all_of(list_.columns.begin(), list_.columns.end(),
                    [](const auto& one) { return one.joint < 0; }))
      lines_.refuse(cells.front(), "a column of at least one axis");
  }

  /// @return whether there was one
  bool read_row() {
    const auto line = lines_.next();
    if (!line) return false;
    const std::size_t width = list_.columns.size();
    const std::vector<Cell> cells = cells_of(line->text, separator_, width);
    const auto wanted = [&] { return fmt::format("{} cells, as the head has", width); };
    if (cells.size() < width)
      lines_.refuse(int(line->text.size()) + 1, wanted(), fmt::format("{}", cells.size()));
    if (cells.size() > width) lines_.refuse(cells[width].column, wanted(), "more");
    if (list_.size() == most_poses)
      lines_.refuse(0, fmt::format("at most {} poses", most_poses), "more");
    row_.clear();
    for (std::size_t i = 0; i < width; ++i) row_.push_back(number(cells[i], list_.columns[i]));
    if (!faults_.empty()) return true;  // nothing of it will be used
    list_.numbers.insert(list_.numbers.end(), row_.begin(), row_.end());
    list_.line.push_back(line->number);
    return true;
  }

  double number(const Cell& cell, const PoseList::Column& column) const {
    const double value = lines_.number_in(cell);
    if (column.joint < 0) return value;
    const Joint& axis = chain_.joints()[std::size_t(column.joint)];
    const double q = value * column.unit;
    if (q < axis.min || q > axis.max) lines_.refuse(cell, travel_text(axis));
    return value;
  }

  TableLines lines_;
  const Chain& chain_;
  PoseList list_;
  char separator_ = ',';
  std::vector<double> row_;
  std::vector<BadInput> faults_;
};

}  // namespace

bool PoseList::is_timed() const {
  return std::any_of(columns.begin(), columns.end(), [](const auto& one) { return one.joint < 0; });
}

kinematics::AxisState PoseList::state(std::size_t pose) const {
  kinematics::AxisState state;
  state.q = others;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const double value = numbers[pose * columns.size() + i] * columns[i].unit;
    (columns[i].joint < 0 ? state.time_s : state.q[columns[i].joint]) = value;
  }
  return state;
}

std::string PoseList::text(std::size_t pose) const {
  std::string text;
  for (std::size_t i = 0; i < columns.size(); ++i)
    text += fmt::format("{}{} = {:.9g}", i > 0 ? ", " : "", columns[i].head,
                        numbers[pose * columns.size() + i]);
  return text;
}

PoseList read_poses(std::string_view text, const std::string& file, const Chain& chain) {
  return Reader(text, file, chain).read();
}

PoseList read_poses_file(const std::filesystem::path& file, const Chain& chain) {
  return read_poses(read_text(file, most_pose_bytes), file.string(), chain);
}

}  // namespace abbe::sim
