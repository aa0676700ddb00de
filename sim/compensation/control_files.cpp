#include "sim/compensation/control_files.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/compensation/control_file_format.h"

namespace abbe::sim::compensation {
namespace control {

using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

namespace {

constexpr double same_position = 1e-9;  // mm or rad

bool is_slide(const Chain& chain, int joint) {
  return chain.joints()[std::size_t(joint)].motion == Motion::Linear;
}

/// "0.12 um" or "3.4 urad".
std::string small(double value, const Chain& chain, int joint) {
  return is_slide(chain, joint) ? fmt::format("{:.4g} um", value / units::um)
                                : fmt::format("{:.4g} urad", value / units::urad);
}

/// How far a table misses another at its points.
double missed(const AxisTable& table, const AxisTable& by) {
  const AxisTable there = at_positions(by, table.position);
  return std::max((there.upward - table.upward).cwiseAbs().maxCoeff(),
                  (there.downward - table.downward).cwiseAbs().maxCoeff());
}

/// All positions of some tables; those that differ in their last bits only are one.
Eigen::VectorXd positions_of(const std::vector<const AxisTable*>& tables) {
  std::vector<double> all;
  for (const AxisTable* table : tables)
    all.insert(all.end(), table->position.begin(), table->position.end());
  std::sort(all.begin(), all.end());
  const auto is_same = [](double a, double b) { return b - a <= same_position; };
  all.erase(std::unique(all.begin(), all.end(), is_same), all.end());
  return Eigen::Map<const Eigen::VectorXd>(all.data(), Eigen::Index(all.size()));
}

AxisTable at_equidistant(const AxisTable& table, Eigen::Index points) {
  return at_positions(table, Eigen::VectorXd::LinSpaced(points, table.position[0],
                                                        table.position[table.position.size() - 1]));
}

}  // namespace

char letter(const Chain& chain, int joint) { return chain.joints()[std::size_t(joint)].name; }

double unit_of(const Chain& chain, int joint) { return is_slide(chain, joint) ? 1.0 : units::deg; }

const char* unit_name(const Chain& chain, int joint) {
  return is_slide(chain, joint) ? "mm" : "deg";
}

std::string decimal(double value, int decimals) {
  std::string text = fmt::format("{:.{}f}", value, decimals);
  if (text.front() == '-' && text.find_first_not_of("-0.") == std::string::npos) text.erase(0, 1);
  return text;
}

std::string relation(const AxisTable& table, const Chain& chain) {
  if (table.of == table.moves) return std::string(1, letter(chain, table.of));
  return fmt::format("{} over {}", letter(chain, table.moves), letter(chain, table.of));
}

std::vector<AxisTable> summed(const std::vector<AxisTable>& tables) {
  std::vector<AxisTable> sums;
  std::vector<char> is_done(tables.size(), 0);
  for (std::size_t i = 0; i < tables.size(); ++i) {
    if (is_done[i]) continue;
    std::vector<const AxisTable*> alike;
    for (std::size_t k = i; k < tables.size(); ++k) {
      if (tables[k].of != tables[i].of || tables[k].moves != tables[i].moves) continue;
      is_done[k] = 1;
      alike.push_back(&tables[k]);
    }
    AxisTable sum = alike.size() == 1 ? tables[i] : at_positions(tables[i], positions_of(alike));
    for (std::size_t k = 1; k < alike.size(); ++k) {
      const AxisTable part = at_positions(*alike[k], sum.position);
      sum.upward += part.upward;
      sum.downward += part.downward;
    }
    sums.push_back(std::move(sum));
  }
  return sums;
}

AxisTable at_positions(const AxisTable& table, const Eigen::VectorXd& positions) {
  AxisTable out{table.of, table.moves, positions, Eigen::VectorXd(positions.size()),
                Eigen::VectorXd(positions.size())};
  for (Eigen::Index k = 0; k < positions.size(); ++k) {
    out.upward[k] = correction(table, positions[k], 1);
    out.downward[k] = correction(table, positions[k], -1);
  }
  return out;
}

Shortened shortened(const AxisTable& table, const Chain& chain, const Capacity& capacity) {
  const Eigen::Index n = table.position.size();
  const auto gaps = table.position.tail(n - 1) - table.position.head(n - 1);
  const double least = capacity.least_spacing * unit_of(chain, table.of);
  if (n <= capacity.most_points && gaps.minCoeff() >= least) return {table, std::nullopt};
  const double width = table.position[n - 1] - table.position[0];
  const double room = std::min(double(capacity.most_points), std::floor(width / least) + 1.0);
  // a table narrower than its digits is a constant, which any two points hold
  AxisTable out = at_equidistant(table, Eigen::Index(std::max(room, 2.0)));
  if (width < least) out.position[1] = out.position[0] + least;
  std::string words = fmt::format("{}: {} points, of which the control holds {}; misses them by {}",
                                  relation(table, chain), n, out.position.size(),
                                  small(missed(table, out), chain, table.moves));
  return {std::move(out), std::move(words)};
}

Shortened equidistant(const AxisTable& table, const Chain& chain) {
  AxisTable out = at_equidistant(table, table.position.size());
  const double step = out.position[1] - out.position[0];
  if ((out.position - table.position).cwiseAbs().maxCoeff() <= 1e-9 * step) {
    out.upward = table.upward;
    out.downward = table.downward;
    return {std::move(out), std::nullopt};
  }
  std::string words = fmt::format(
      "{}: {} points that are not equidistant; equidistant ones miss them by {}",
      relation(table, chain), table.position.size(), small(missed(table, out), chain, table.moves));
  return {std::move(out), std::move(words)};
}

std::vector<std::string> offsets_left_out(const ParameterTables& tables, const Chain& chain) {
  std::vector<std::string> words;
  for (int i = 0; i < chain.size(); ++i)
    if (tables.offset[i] != 0.0)
      words.push_back(fmt::format("offset of {}, {}: set it as an origin or tool offset",
                                  letter(chain, i), small(tables.offset[i], chain, i)));
  return words;
}

bool same_both_ways(const AxisTable& table) { return table.upward == table.downward; }

void check_files(std::span<const ControlFile> files) {
  if (files.size() > most_files)
    throw BadInput("", 0, 0, fmt::format("at most {} files", most_files),
                   fmt::format("{}", files.size()));
  std::set<std::string> names;
  for (const ControlFile& file : files) {
    if (file.text.size() > most_bytes)
      throw BadInput(file.name, 0, 0, fmt::format("at most {} bytes", most_bytes),
                     fmt::format("{}", file.text.size()));
    if (!names.insert(base_name(file.name)).second)
      throw BadInput(file.name, 0, 0, "every file once", "the second of that name");
  }
}

std::optional<int> movable(char letter, const Chain& chain) {
  const auto joint = chain.find(letter);
  if (!joint || chain.joints()[std::size_t(*joint)].motion == Motion::Spindle) return std::nullopt;
  return joint;
}

std::string movable_letters(const Chain& chain) {
  std::string letters;
  for (const Joint& joint : chain.joints())
    if (joint.motion != Motion::Spindle)
      letters += std::string(letters.empty() ? "" : " ") + joint.name;
  return letters;
}

std::string base_name(const std::string& name) {
  std::string base = name.substr(name.find_last_of("/\\") + 1);
  for (char& c : base)
    if (c >= 'a' && c <= 'z') c = char(c - 'a' + 'A');
  return base;
}

}  // namespace control

namespace {

[[noreturn]] void refuse_isg() {
  throw std::invalid_argument(
      "control files: the ISG format holds deviations of carriages, not corrections of axes");
}

}  // namespace

const char* to_string(ControlFormat format) {
  switch (format) {
    case ControlFormat::LinuxCnc:
      return "linuxcnc";
    case ControlFormat::Isg:
      return "isg";
    case ControlFormat::Siemens:
      return "siemens";
    case ControlFormat::Heidenhain:
      return "heidenhain";
  }
  return "?";
}

Export to_control(const ParameterTables& tables, const kinematics::Chain& chain,
                  ControlFormat format) {
  validate(tables, chain);
  switch (format) {
    case ControlFormat::LinuxCnc:
      return control::to_linuxcnc(tables, chain);
    case ControlFormat::Siemens:
      return control::to_siemens(tables, chain);
    case ControlFormat::Heidenhain:
      return control::to_heidenhain(tables, chain);
    case ControlFormat::Isg:
      break;
  }
  refuse_isg();
}

ParameterTables tables_of_control(std::span<const ControlFile> files,
                                  const kinematics::Chain& chain, ControlFormat format) {
  control::check_files(files);
  switch (format) {
    case ControlFormat::LinuxCnc:
      return control::tables_of_linuxcnc(files, chain);
    case ControlFormat::Siemens:
      return control::tables_of_siemens(files, chain);
    case ControlFormat::Heidenhain:
      return control::tables_of_heidenhain(files, chain);
    case ControlFormat::Isg:
      break;
  }
  refuse_isg();
}

}  // namespace abbe::sim::compensation
