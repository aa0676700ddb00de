#include "sim/compensation/machine_belief.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <Eigen/Dense>
#include <Eigen/Geometry>

#include "errors/element.h"
#include "kinematics/bad_input.h"
#include "kinematics/decompositions.h"
#include "kinematics/text.h"

namespace abbe::sim::compensation {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Returns for every row the mean over the rows up to `length_s` before it; a control knows no
/// later ones.
VectorXd smoothed(const VectorXd& values, const VectorXd& time_s, double length_s) {
  if (!(length_s > 0.0)) return values;
  VectorXd means(values.size());
  double sum = 0.0;
  Index first = 0;
  for (Index i = 0; i < values.size(); ++i) {
    sum += values[i];
    for (; time_s[first] < time_s[i] - length_s; ++first) sum -= values[first];
    means[i] = sum / double(i - first + 1);
  }
  return means;
}

// the median ignores single peaks of the current
double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Returns the currents of the rows before the cut in which the spindle turns as fast as in the
/// cut, i.e. the approach in air.
std::vector<double> air_currents(const ControlLog& log, double cut_begins_s) {
  const VectorXd current = column(log, "current_A"), rpm = column(log, "spindle_rpm");
  const double speed = rpm[row_at(log, cut_begins_s)];
  std::vector<double> air;
  for (Index i = 0; i < current.size() && log.time_s[i] < cut_begins_s; ++i)
    // 0.1 % of the speed: the idle torque depends on it
    if (log.time_s[i] >= 0.0 && std::abs(rpm[i] - speed) <= 1e-3 * std::abs(speed))
      air.push_back(current[i]);
  return air;
}

}  // namespace

errors::Load load_at(const LoadSeries& course, double time_s) {
  const VectorXd& t = course.time_s;
  const Index n = t.size();
  if (n == 0 || !(time_s >= t[0] && time_s <= t[n - 1])) return {};
  const Index after =
      std::min<Index>(n - 1, std::upper_bound(t.data(), t.data() + n, time_s) - t.data());
  const Index before = std::max<Index>(0, after - 1);
  const double length = t[after] - t[before];
  const double u = length > 0.0 ? (time_s - t[before]) / length : 1.0;
  const errors::Load &a = course.loads[std::size_t(before)], &b = course.loads[std::size_t(after)];
  errors::Load load;
  load.on_tool_t = a.on_tool_t + u * (b.on_tool_t - a.on_tool_t);
  load.contact_t = a.contact_t + u * (b.contact_t - a.contact_t);
  return load;
}

LoadSeries load_of_dynamometer(const ControlLog& log, double smoothing_s) {
  LoadSeries course{log.time_s, std::vector<errors::Load>(std::size_t(log.time_s.size()))};
  const char* const names[] = {"FX_dynamometer_N", "FY_dynamometer_N", "FZ_dynamometer_N"};
  for (Index k = 0; k < 3; ++k) {
    const VectorXd force = smoothed(column(log, names[k]), log.time_s, smoothing_s);
    for (Index i = 0; i < force.size(); ++i) course.loads[std::size_t(i)].on_tool_t[k] = force[i];
  }
  return course;
}

CurrentLaw fit_current_law(const ControlLog& log, const CurrentTraining& part, double smoothing_s) {
  const Index n = part.time_s.size();
  if (n < 2 || part.deviation.size() != n)
    throw std::invalid_argument("expected a training part with a deviation at two places or more");
  CurrentLaw law;
  law.smoothing_s = smoothing_s;
  std::vector<double> air = air_currents(log, part.time_s.minCoeff());
  if (air.empty())
    throw std::invalid_argument(
        "expected the current in air before the training cut, at the speed of the cut");
  law.air_A = median(std::move(air));
  const VectorXd current = smoothed(column(log, "current_A"), log.time_s, smoothing_s);
  Eigen::MatrixX2d A(n, 2);
  // d = c1 x + c2 x^2 has no constant term: without cutting force nothing deflects
  for (Index i = 0; i < n; ++i) {
    const double x = current[row_at(log, part.time_s[i])] - law.air_A;
    A.row(i) << x, x * x;
    law.largest_A = std::max(law.largest_A, x);
  }
  const auto fit = least_squares(A, part.deviation);
  if (fit.rank < 2)
    throw std::invalid_argument("expected a training part cut with two depths or more");
  law.c = fit.x;
  law.sigma =
      // two coefficients are fitted, so n - 2 degrees of freedom are left
      std::sqrt((A * law.c - part.deviation).squaredNorm() / double(std::max<Index>(1, n - 2)));
  return law;
}

TimeSeries bending(const CurrentLaw& law, const ControlLog& log) {
  const VectorXd current = smoothed(column(log, "current_A"), log.time_s, law.smoothing_s);
  TimeSeries course{log.time_s, Eigen::MatrixXd(current.size(), 1)};
  for (Index i = 0; i < current.size(); ++i) {
    // held outside the trained range, where a parabola is not reliable
    const double x = std::clamp(current[i] - law.air_A, 0.0, law.largest_A);
    course.value(i, 0) = law.c[0] * x + law.c[1] * x * x;
  }
  return course;
}

namespace {

namespace identification = errors::identification;
using Eigen::MatrixXd;
using identification::ThermalModel;
using kinematics::JointDeviation;

constexpr std::string_view head = "abbe thermal belief 1";
constexpr std::string_view since_start_word = "since_start ";
constexpr std::string_view term_word = "term ";
// limits the memory of a wrong file
constexpr std::size_t max_terms = 1000;

// Text

bool can_have_slope(const errors::ElementName& name) { return !name.location && name.axis != 'S'; }

/// A part of a text, and the number of the line before it.
struct Piece {
  std::string_view text;
  int before = 0;
};

/// Splits a belief file into its header and the text of each term.
class Reader {
 public:
  Reader(std::string_view text, std::string file) : rest_(text), file_(std::move(file)) {}

  std::optional<std::string_view> peek() const {
    std::string_view rest = rest_;
    return rest.empty() ? std::nullopt : std::optional(cut(rest));
  }
  std::string_view next(const std::string& expected) {
    if (rest_.empty()) refuse(expected, "the end");
    ++number_;
    return cut(rest_);
  }
  /// Returns everything up to the next term.
  Piece model() {
    const int before = number_;
    const char* begin = rest_.data();
    while (const auto line = peek()) {
      if (line->starts_with(term_word)) break;
      next("");
    }
    return {{begin, std::size_t(rest_.data() - begin)}, before};
  }
  [[noreturn]] void refuse(const std::string& expected, const std::string& seen) const {
    throw BadInput(file_, std::max(1, number_), 1, expected, seen);
  }
  const std::string& file() const { return file_; }

 private:
  /// Removes the first line and returns it without its line end.
  static std::string_view cut(std::string_view& rest) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(std::min(rest.size(), end + 1));
    if (line.ends_with('\r')) line.remove_suffix(1);
    return line;
  }

  std::string_view rest_;
  std::string file_;
  int number_ = 0;
};

ThermalModel read_model(const Piece& piece, const std::string& file) {
  try {
    return identification::parse_thermal_model(piece.text, file);
  } catch (const BadInput& fault) {
    // line numbers of the model count within its text
    throw BadInput(file, piece.before + std::max(1, fault.line), fault.column, fault.expected,
                   fault.seen);
  }
}

bool holds(const ThermalBelief& belief, const ThermalBelief::Term& term) {
  return std::ranges::any_of(belief.terms, [&](const ThermalBelief::Term& other) {
    return other.name == term.name && other.slope == term.slope;
  });
}

/// Reads "term EXX slope" and the model that follows.
ThermalBelief::Term read_term(Reader& reader, const ThermalBelief& before) {
  const std::string expected = "\"term ELEMENT offset\" or \"term ELEMENT slope\"";
  const std::string_view line = reader.next(expected);
  const std::size_t blank = line.rfind(' ');
  if (!line.starts_with(term_word) || blank < term_word.size())
    reader.refuse(expected, in_quotes(line));
  const std::string_view kind = line.substr(blank + 1);
  ThermalBelief::Term term;
  try {
    term.name = errors::parse_element_name(line.substr(term_word.size(), blank - term_word.size()));
  } catch (const std::invalid_argument& fault) {
    reader.refuse(expected, fault.what());
  }
  term.slope = kind == "slope";
  if (!term.slope && kind != "offset") reader.refuse(expected, in_quotes(line));
  if (term.slope && !can_have_slope(term.name))
    reader.refuse("a slope of an axis that travels", in_quotes(line));
  if (holds(before, term)) reader.refuse("each term once", in_quotes(line));
  term.model = read_model(reader.model(), reader.file());
  return term;
}

// Evaluation over a log

/// The temperatures of a model, a column for each input, limited to its trained range.
struct Inputs {
  MatrixXd T;              ///< (n x m)
  std::vector<char> held;  ///< (n)
};

Inputs inputs_of(const ThermalModel& model, const ControlLog& log, bool since_start) {
  const Index n = log.time_s.size();
  Inputs inputs{MatrixXd(n, Index(model.names.size())), std::vector<char>(std::size_t(n), 0)};
  for (std::size_t k = 0; k < model.names.size(); ++k) {
    VectorXd T = column(log, model.names[k] + "_C");
    if (!T.allFinite())
      throw std::invalid_argument("expected finite readings of " + model.names[k]);
    if (since_start) T.array() -= double(T[0]);
    const auto input = Index(k);
    // The model itself refuses beyond this margin, so the belief ends there too.
    const double room = model.margin * (model.highest[input] - model.lowest[input]);
    const double low = model.lowest[input] - room, high = model.highest[input] + room;
    for (Index i = 0; i < n; ++i)
      if (T[i] < low || T[i] > high) inputs.held[std::size_t(i)] = 1;
    inputs.T.col(input) = T.cwiseMax(low).cwiseMin(high);
  }
  return inputs;
}

ThermalSeries::Term bound(const ThermalBelief::Term& term, const kinematics::Chain& chain) {
  const std::string who = errors::to_string(term.name);
  const int joint = errors::joint_of(term.name.axis, chain, who);
  const kinematics::Joint& axis = chain.joints()[std::size_t(joint)];
  errors::check_meaning(term.name, chain, joint);
  if (term.slope && !can_have_slope(term.name))
    throw std::invalid_argument(who + ": a location or spindle element has no slope");
  return {joint, term.name.component(), term.name.location, term.slope,
          // a slope multiplies the travel of the carriage, which has the opposite sign on the
          // workpiece side
          kinematics::carriage_travel(axis.side, 1.0)};
}

}  // namespace

std::string to_text(const ThermalBelief& belief, const std::vector<std::string>& comments) {
  std::string text;
  for (std::string comment : comments) {
    std::ranges::replace_if(
        comment, [](char c) { return c == '\n' || c == '\r'; }, ' ');
    text += "# " + comment + "\n";
  }
  text += fmt::format("{}\n{}{}\n", head, since_start_word, belief.since_start ? 1 : 0);
  for (const ThermalBelief::Term& term : belief.terms)
    text += fmt::format("{}{} {}\n{}", term_word, errors::to_string(term.name),
                        term.slope ? "slope" : "offset", identification::to_text(term.model));
  return text;
}

ThermalBelief parse_thermal_belief(std::string_view text, const std::string& file) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  Reader reader(text, file);
  const std::string first = "a first line " + in_quotes(head);
  while (reader.peek() && (reader.peek()->empty() || reader.peek()->starts_with('#')))
    reader.next(first);
  if (const std::string_view line = reader.next(first); line != head)
    reader.refuse(first, in_quotes(line));
  const std::string flag = "\"since_start 1\" or \"since_start 0\"";
  const std::string_view line = reader.next(flag);
  if (line != "since_start 0" && line != "since_start 1") reader.refuse(flag, in_quotes(line));
  ThermalBelief belief;
  belief.since_start = line.ends_with('1');
  while (reader.peek()) {
    if (belief.terms.size() == max_terms)
      reader.refuse(fmt::format("at most {} terms", max_terms), "more");
    belief.terms.push_back(read_term(reader, belief));
  }
  return belief;
}

ThermalSeries thermal_series(const ThermalBelief& belief, const ControlLog& log,
                             const kinematics::Chain& chain) {
  if (log.time_s.size() == 0)
    throw std::invalid_argument("expected a log with at least one row of temperatures");
  ThermalSeries course;
  course.time_s = log.time_s;
  course.value.resize(log.time_s.size(), Index(belief.terms.size()));
  std::vector<char> held(std::size_t(log.time_s.size()), 0);
  for (std::size_t k = 0; k < belief.terms.size(); ++k) {
    const ThermalBelief::Term& term = belief.terms[k];
    course.terms.push_back(bound(term, chain));
    const Inputs inputs = inputs_of(term.model, log, belief.since_start);
    course.value.col(Index(k)) = identification::values(term.model, inputs.T);
    for (std::size_t i = 0; i < held.size(); ++i) held[i] |= inputs.held[i];
  }
  course.held = int(std::ranges::count(held, char(1)));
  return course;
}

std::vector<JointDeviation> deviations(const ThermalSeries& course,
                                       const kinematics::AxisState& state) {
  std::vector<JointDeviation> result(std::size_t(state.q.size()));
  if (course.terms.empty()) return result;
  const Index row = row_at(course.time_s, state.time_s);
  for (std::size_t k = 0; k < course.terms.size(); ++k) {
    const ThermalSeries::Term& term = course.terms[k];
    JointDeviation& joint = result[std::size_t(term.joint)];
    // readings are held, not interpolated: a control does not know the next one
    const double travel = term.slope ? term.sign * state.q[term.joint] : 1.0;
    (term.location ? joint.location : joint.motion)[term.component] +=
        travel * course.value(row, Index(k));
  }
  return result;
}

namespace {

using Eigen::MatrixX3d;
using Eigen::Vector3d;

constexpr std::size_t neighbours = 9;  // the last one only limits the weights

struct Neighbour {
  double distance = std::numeric_limits<double>::infinity();
  Index row = -1;
};

std::array<Neighbour, neighbours> nearest_of(const MatrixX3d& read_at, const Vector3d& point) {
  std::array<Neighbour, neighbours> best;
  for (Index i = 0; i < read_at.rows(); ++i) {
    const double d = (read_at.row(i).transpose() - point).norm();
    if (!(d < best.back().distance)) continue;
    auto at = best.end() - 1;
    for (; at != best.begin() && d < (at - 1)->distance; --at) *at = *(at - 1);
    *at = {d, i};
  }
  return best;
}

/// Returns the value at a point of the weighted plane through its neighbours.
double plane_at(const MatrixX3d& read_at, const VectorXd& deviation, const Vector3d& point) {
  const auto near = nearest_of(read_at, point);
  if (near[0].distance == 0.0) return deviation[near[0].row];
  const double beyond = 1.0 / near.back().distance;  // 0 if there are fewer
  Eigen::Matrix<double, Eigen::Dynamic, 4, 0, neighbours, 4> A(Index(neighbours), 4);
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, neighbours, 1> b(Index{neighbours});
  Index n = 0;
  for (const Neighbour& one : near) {
    if (one.row < 0) break;
    const double weight = 1.0 / one.distance - beyond;
    if (!(weight > 0.0)) continue;
    // scaled by the nearest distance, so that the threshold below has no unit
    const Vector3d from = (read_at.row(one.row).transpose() - point) / near[0].distance;
    A.row(n) << weight, weight * from.transpose();
    b[n++] = weight * deviation[one.row];
  }
  // all neighbours are equally far: the nearest one decides
  if (n == 0) return deviation[near[0].row];
  // The solution of least norm: across the surface the readings determine no slope, and none is
  // assumed.
  Eigen::CompleteOrthogonalDecomposition<Eigen::Matrix<double, Eigen::Dynamic, 4, 0, neighbours, 4>>
      plane;
  // 1e-3 of the largest singular value: neighbours on a curved surface leave a small one across it
  plane.setThreshold(1e-3);
  plane.compute(A.topRows(n));
  return plane.solve(b.head(n))[0];
}

/// A range [first, last) of rows that are neighbours in time.
struct Group {
  std::size_t first = 0, last = 0;
};

/// The deviations of a part in the order of time.
struct Sorted {
  MatrixX3d normals;
  VectorXd deviation;
  std::vector<double> time_s;
  std::vector<int> pass;
};

Sorted sorted(const PartDeviations& part) {
  std::vector<Index> order(std::size_t(part.time_s.size()));
  std::iota(order.begin(), order.end(), Index(0));
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return part.time_s[a] < part.time_s[b]; });
  Sorted result{part.normals(order, Eigen::all), part.deviation(order), {}, {}};
  for (const Index i : order) {
    result.time_s.push_back(part.time_s[i]);
    result.pass.push_back(part.pass.size() > 0 ? part.pass[i] : 0);
  }
  return result;
}

std::vector<Group> stretches_of(const Sorted& part, std::size_t together) {
  const std::vector<double>& t = part.time_s;
  std::vector<double> gaps;
  for (std::size_t i = 1; i < t.size(); ++i)
    if (t[i] > t[i - 1]) gaps.push_back(t[i] - t[i - 1]);
  double longest = std::numeric_limits<double>::infinity();
  if (!gaps.empty()) {
    // ten usual intervals of a group: longer gaps separate stretches of the cut
    std::nth_element(gaps.begin(), gaps.begin() + std::ptrdiff_t(gaps.size() / 2), gaps.end());
    longest = 10.0 * double(together) * gaps[gaps.size() / 2];
  }
  std::vector<Group> stretches;
  for (std::size_t i = 0; i < t.size(); ++i) {
    const bool begins = i == 0 || part.pass[i] != part.pass[i - 1] || t[i] - t[i - 1] > longest;
    if (begins) stretches.push_back({i, i});
    stretches.back().last = i + 1;
  }
  return stretches;
}

/// Returns a stretch in groups of about equal size; rows with one time stay together.
std::vector<Group> groups_of(const Group& stretch, const std::vector<double>& time_s,
                             std::size_t together) {
  const std::size_t n = stretch.last - stretch.first;
  const std::size_t count = std::max<std::size_t>(1, n / together);
  std::vector<Group> groups;
  std::size_t at = stretch.first;
  for (std::size_t g = 1; g <= count; ++g) {
    std::size_t end = std::max(at, stretch.first + g * n / count);
    while (end > at && end < stretch.last && time_s[end] == time_s[end - 1]) ++end;
    if (end > at) groups.push_back({at, end});
    at = end;
  }
  return groups;
}

struct Node {
  double time_s = 0.0;
  Vector3d move = Vector3d::Zero();
};

Node node_of(const Sorted& part, const Group& group, double damping) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Vector3d b = Vector3d::Zero();
  Node node;
  for (std::size_t k = group.first; k < group.last; ++k) {
    const Vector3d n = part.normals.row(Index(k)).transpose();
    A += n * n.transpose();
    b += part.deviation[Index(k)] * n;
    node.time_s += part.time_s[k];
  }
  const double count = double(group.last - group.first);
  // damping per row, so that the result does not depend on the size of a group
  A.diagonal().array() += damping * damping * count;
  node.time_s /= count;
  node.move = A.ldlt().solve(b);
  return node;
}

/// Returns the point at another time on the line through two nodes.
Node extrapolate_node(const Node& from, const Node& before, double time_s) {
  const double length = from.time_s - before.time_s;
  const double u = length != 0.0 ? (time_s - from.time_s) / length : 0.0;
  return {time_s, from.move + u * (from.move - before.move)};
}

void append_stretch(std::vector<Node>& course, const Sorted& part, const Group& stretch,
                    const MirrorOptions& options) {
  std::vector<Node> nodes;
  for (const Group& group :
       groups_of(stretch, part.time_s, std::size_t(std::max(1, options.together))))
    nodes.push_back(node_of(part, group, options.damping));
  const std::size_t n = nodes.size();
  // A node stands at the mean time of its group, so both ends of a stretch are extrapolated by half
  // a group.
  const double begin_s = part.time_s[stretch.first], end_s = part.time_s[stretch.last - 1];
  if (begin_s < nodes.front().time_s)
    course.push_back(
        extrapolate_node(nodes.front(), nodes[std::min<std::size_t>(1, n - 1)], begin_s));
  course.insert(course.end(), nodes.begin(), nodes.end());
  if (end_s > nodes.back().time_s)
    course.push_back(extrapolate_node(nodes.back(), nodes[n > 1 ? n - 2 : 0], end_s));
}

}  // namespace

VectorXd interpolate_readings(const MatrixX3d& read_at, const VectorXd& deviation,
                              const MatrixX3d& points, double reach) {
  if (read_at.rows() == 0 || read_at.rows() != deviation.size())
    throw std::invalid_argument("expected readings of a part, seen none");
  VectorXd values(points.rows());
  tbb::parallel_for(Index(0), points.rows(), [&](Index i) {
    const Vector3d point = points.row(i).transpose();
    const bool near = (read_at.rowwise() - point.transpose()).rowwise().norm().minCoeff() <= reach;
    values[i] = near ? plane_at(read_at, deviation, point) : 0.0;
  });
  return values;
}

DisplacementSeries explain_deviation(const PartDeviations& part, const MirrorOptions& options) {
  const Sorted known = sorted(part);
  std::vector<Node> nodes;
  for (const Group& stretch : stretches_of(known, std::size_t(std::max(1, options.together))))
    append_stretch(nodes, known, stretch, options);
  DisplacementSeries course{VectorXd(Index(nodes.size())), MatrixX3d(Index(nodes.size()), 3)};
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    course.time_s[Index(i)] = nodes[i].time_s;
    course.move.row(Index(i)) = nodes[i].move.transpose();
  }
  return course;
}

Vector3d move_at(const DisplacementSeries& course, double time_s) {
  const VectorXd& t = course.time_s;
  const Index n = t.size();
  if (n == 0) return Vector3d::Zero();
  const Index after = std::upper_bound(t.data(), t.data() + n, time_s) - t.data();
  if (after == 0) return course.move.row(0).transpose();
  if (after == n) return course.move.row(n - 1).transpose();
  const double u = (time_s - t[after - 1]) / (t[after] - t[after - 1]);
  return ((1 - u) * course.move.row(after - 1) + u * course.move.row(after)).transpose();
}

namespace {

using kinematics::AxisState;
using kinematics::Pose;

/// Returns a displacement shown by the part, in the workpiece as turned by the spindle.
Vector3d turned(const MachineBelief& belief, const AxisState& state, const Vector3d& move) {
  if (!belief.part_spindle) return move;
  kinematics::AxisVector still = state.q;
  still[*belief.part_spindle] = 0.0;
  const Eigen::Matrix3d R_now = belief.chain.workpiece_in_bed(state.q).linear();
  const Eigen::Matrix3d R_still = belief.chain.workpiece_in_bed(still).linear();
  return R_now.transpose() * (R_still * move);
}

}  // namespace

Pose tool_in_workpiece(const MachineBelief& belief, const AxisState& state) {
  return tool_in_workpiece(
      belief, state, belief.force ? load_at(belief.force->load, state.time_s) : errors::Load{});
}

Pose tool_in_workpiece(const MachineBelief& belief, const AxisState& state,
                       const errors::Load& load) {
  std::vector<JointDeviation> joints(std::size_t(belief.chain.size()));
  if (belief.geometric) joints = errors::deviations(*belief.geometric, state);
  if (belief.thermal)
    joints = kinematics::sum(std::move(joints), deviations(*belief.thermal, state));
  errors::ForceDeviations all;
  if (belief.force) all = errors::deviations(belief.force->compliance, state, load);
  all.joints = belief.force ? kinematics::sum(std::move(joints), all.joints) : std::move(joints);
  Pose T_wt = errors::tool_in_workpiece(belief.chain, state.q, all);
  // the tool yields along its own axis, away from the part
  if (belief.bending)
    T_wt.translation() += value_at(*belief.bending, state.time_s)[0] * T_wt.linear().col(2);
  if (belief.part) T_wt.translation() += turned(belief, state, move_at(*belief.part, state.time_s));
  return T_wt;
}

}  // namespace abbe::sim::compensation
