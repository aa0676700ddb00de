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

// Machine model that a compensator uses (its belief): loads from force or current signals, thermal
// deviations from sensor models, and displacements fitted to measured parts.

namespace abbe::sim::compensation {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Returns the trailing mean: for each row, the mean of all rows of the preceding `length_s`,
/// including itself. Later rows are not used, because a control does not know them.
VectorXd trailing_mean(const VectorXd& values, const VectorXd& time_s, double length_s) {
  if (!(length_s > 0.0)) return values;
  VectorXd means(values.size());
  double sum = 0.0;
  Index oldest = 0;
  for (Index i = 0; i < values.size(); ++i) {
    sum += values[i];
    for (; time_s[oldest] < time_s[i] - length_s; ++oldest) sum -= values[oldest];
    means[i] = sum / double(i - oldest + 1);
  }
  return means;
}

/// Returns the median. Unlike the mean it is insensitive to single peaks of a current.
double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Returns the idle currents, A: those logged before the cut while the spindle runs at the speed of
/// the cut.
std::vector<double> idle_currents(const ControlLog& log, double cut_begins_s) {
  const VectorXd current = column(log, "current_A"), rpm = column(log, "spindle_rpm");
  const double speed = rpm[row_at(log, cut_begins_s)];
  std::vector<double> idle_currents_A;
  for (Index i = 0; i < current.size() && log.time_s[i] < cut_begins_s; ++i)
    // Only speeds within 0.1 % count, because the idle torque depends on the speed.
    if (log.time_s[i] >= 0.0 && std::abs(rpm[i] - speed) <= 1e-3 * std::abs(speed))
      idle_currents_A.push_back(current[i]);
  return idle_currents_A;
}

}  // namespace

errors::Load load_at(const LoadSeries& series, double time_s) {
  const VectorXd& t = series.time_s;
  const Index n = t.size();
  if (n == 0 || !(time_s >= t[0] && time_s <= t[n - 1])) return {};
  const Index next_row =
      std::min<Index>(n - 1, std::upper_bound(t.data(), t.data() + n, time_s) - t.data());
  const Index previous_row = std::max<Index>(0, next_row - 1);
  const double interval_s = t[next_row] - t[previous_row];
  const double u = interval_s > 0.0 ? (time_s - t[previous_row]) / interval_s : 1.0;
  const errors::Load &a = series.loads[std::size_t(previous_row)],
                     &b = series.loads[std::size_t(next_row)];
  errors::Load load;
  load.tool_wrench_t = a.tool_wrench_t + u * (b.tool_wrench_t - a.tool_wrench_t);
  load.contact_t = a.contact_t + u * (b.contact_t - a.contact_t);
  return load;
}

LoadSeries dynamometer_load(const ControlLog& log, double smoothing_s) {
  LoadSeries series{log.time_s, std::vector<errors::Load>(std::size_t(log.time_s.size()))};
  const char* const names[] = {"FX_dynamometer_N", "FY_dynamometer_N", "FZ_dynamometer_N"};
  for (Index k = 0; k < 3; ++k) {
    const VectorXd force = trailing_mean(column(log, names[k]), log.time_s, smoothing_s);
    for (Index i = 0; i < force.size(); ++i)
      series.loads[std::size_t(i)].tool_wrench_t[k] = force[i];
  }
  return series;
}

CurrentLaw fit_current_law(const ControlLog& log, const CurrentTraining& part, double smoothing_s) {
  const Index n = part.time_s.size();
  if (n < 2 || part.deviation.size() != n)
    throw std::invalid_argument("expected a training part with deviations at two or more points");
  CurrentLaw law;
  law.smoothing_s = smoothing_s;
  std::vector<double> idle_currents_A = idle_currents(log, part.time_s.minCoeff());
  if (idle_currents_A.empty())
    throw std::invalid_argument(
        "expected the air-cut current before the training cut, at the same spindle speed");
  law.air_A = median(std::move(idle_currents_A));
  const VectorXd current = trailing_mean(column(log, "current_A"), log.time_s, smoothing_s);
  Eigen::MatrixX2d A(n, 2);
  // d = c1 x + c2 x^2 has no constant term, because nothing deflects without cutting force.
  for (Index i = 0; i < n; ++i) {
    const double x = current[row_at(log, part.time_s[i])] - law.air_A;
    A.row(i) << x, x * x;
    law.max_excess_A = std::max(law.max_excess_A, x);
  }
  const auto fit = least_squares(A, part.deviation);
  if (fit.rank < 2)
    throw std::invalid_argument("expected a training part cut with at least two depths");
  law.c = fit.x;
  law.sigma =
      // With two fitted coefficients n - 2 degrees of freedom remain.
      std::sqrt((A * law.c - part.deviation).squaredNorm() / double(std::max<Index>(1, n - 2)));
  return law;
}

TimeSeries current_deflection(const CurrentLaw& law, const ControlLog& log) {
  const VectorXd current = trailing_mean(column(log, "current_A"), log.time_s, law.smoothing_s);
  TimeSeries series{log.time_s, Eigen::MatrixXd(current.size(), 1)};
  for (Index i = 0; i < current.size(); ++i) {
    // Outside the trained range a parabola is not reliable, so the law is constant there.
    const double x = std::clamp(current[i] - law.air_A, 0.0, law.max_excess_A);
    series.value(i, 0) = law.c[0] * x + law.c[1] * x * x;
  }
  return series;
}

namespace {

namespace identification = errors::identification;
using Eigen::MatrixXd;
using identification::ThermalModel;
using kinematics::JointDeviation;

constexpr std::string_view header = "abbe thermal belief 1";
constexpr std::string_view since_start_prefix = "since_start ";
constexpr std::string_view term_prefix = "term ";
// Bounds the memory for an invalid file.
constexpr std::size_t max_terms = 1000;

// Text format of a thermal belief

/// Returns true for an error motion of an axis that travels; locations and spindles have no travel.
bool can_have_slope(const errors::ElementName& name) { return !name.location && name.axis != 'S'; }

/// The text of a thermal model, and the number of lines before it in the file.
struct ModelText {
  std::string_view text;
  int previous_lines = 0;
};

/// Reads a belief file line by line, and the text of each model as a whole.
class BeliefReader {
 public:
  BeliefReader(std::string_view text, std::string file)
      : remaining_text_(text), file_(std::move(file)) {}

  std::optional<std::string_view> peek() const {
    std::string_view remaining_text = remaining_text_;
    return remaining_text.empty() ? std::nullopt : std::optional(take_line(remaining_text));
  }
  std::string_view next(const std::string& expected) {
    if (remaining_text_.empty()) throw_input_error(expected, "the end");
    ++number_;
    return take_line(remaining_text_);
  }
  /// Reads the lines up to the next term.
  ModelText model() {
    const int previous_lines = number_;
    const char* begin = remaining_text_.data();
    while (const auto line = peek()) {
      if (line->starts_with(term_prefix)) break;
      next("");
    }
    return {{begin, std::size_t(remaining_text_.data() - begin)}, previous_lines};
  }
  [[noreturn]] void throw_input_error(const std::string& expected, const std::string& seen) const {
    throw BadInput(file_, std::max(1, number_), 1, expected, seen);
  }
  const std::string& file() const { return file_; }

 private:
  /// Removes the first line and returns it without its line end.
  static std::string_view take_line(std::string_view& remaining_text) {
    const std::size_t end = std::min(remaining_text.find('\n'), remaining_text.size());
    std::string_view line = remaining_text.substr(0, end);
    remaining_text.remove_prefix(std::min(remaining_text.size(), end + 1));
    if (line.ends_with('\r')) line.remove_suffix(1);
    return line;
  }

  std::string_view remaining_text_;
  std::string file_;
  int number_ = 0;
};

ThermalModel read_model(const ModelText& model_text, const std::string& file) {
  try {
    return identification::parse_thermal_model(model_text.text, file);
  } catch (const BadInput& error) {
    // Line numbers of the model count from the start of its text.
    throw BadInput(file, model_text.previous_lines + std::max(1, error.line), error.column,
                   error.expected, error.seen);
  }
}

bool contains_term(const ThermalBelief& belief, const ThermalBelief::Term& term) {
  return std::ranges::any_of(belief.terms, [&](const ThermalBelief::Term& other) {
    return other.name == term.name && other.slope == term.slope;
  });
}

/// Reads a line such as "term EXX slope" and the model that follows.
ThermalBelief::Term read_term(BeliefReader& reader, const ThermalBelief& belief) {
  const std::string expected = "\"term ELEMENT offset\" or \"term ELEMENT slope\"";
  const std::string_view line = reader.next(expected);
  const std::size_t blank = line.rfind(' ');
  if (!line.starts_with(term_prefix) || blank < term_prefix.size())
    reader.throw_input_error(expected, quoted_excerpt(line));
  const std::string_view kind = line.substr(blank + 1);
  ThermalBelief::Term term;
  try {
    term.name =
        errors::parse_element_name(line.substr(term_prefix.size(), blank - term_prefix.size()));
  } catch (const std::invalid_argument& error) {
    reader.throw_input_error(expected, error.what());
  }
  term.slope = kind == "slope";
  if (!term.slope && kind != "offset") reader.throw_input_error(expected, quoted_excerpt(line));
  if (term.slope && !can_have_slope(term.name))
    reader.throw_input_error("a slope of an axis with travel", quoted_excerpt(line));
  if (contains_term(belief, term))
    reader.throw_input_error("each term only once", quoted_excerpt(line));
  term.model = read_model(reader.model(), reader.file());
  return term;
}

// Evaluation of a thermal belief over a log

/// The temperatures of a model, one column per input, limited to the trained range with its margin,
/// and the rows in which a limit applied.
struct ModelInputs {
  MatrixXd T;                    ///< (n x m)
  std::vector<char> is_limited;  ///< (n)
};

ModelInputs model_inputs(const ThermalModel& model, const ControlLog& log, bool since_start) {
  const Index n = log.time_s.size();
  ModelInputs inputs{MatrixXd(n, Index(model.names.size())), std::vector<char>(std::size_t(n), 0)};
  for (std::size_t k = 0; k < model.names.size(); ++k) {
    VectorXd T = column(log, model.names[k] + "_C");
    if (!T.allFinite())
      throw std::invalid_argument("expected finite readings of " + model.names[k]);
    if (since_start) T.array() -= double(T[0]);
    const auto input = Index(k);
    // The model rejects temperatures beyond this margin, so the belief is limited to it.
    const double margin = model.margin * (model.highest[input] - model.lowest[input]);
    const double low = model.lowest[input] - margin, high = model.highest[input] + margin;
    for (Index i = 0; i < n; ++i)
      if (T[i] < low || T[i] > high) inputs.is_limited[std::size_t(i)] = 1;
    inputs.T.col(input) = T.cwiseMax(low).cwiseMin(high);
  }
  return inputs;
}

/// Returns a term for the joint of its element. Throws std::invalid_argument if the machine has no
/// such element or the element cannot have a slope.
ThermalSeries::Term bind_term(const ThermalBelief::Term& term, const kinematics::Chain& chain) {
  const std::string element_name = errors::to_string(term.name);
  const int joint = errors::axis_joint(term.name.axis, chain, element_name);
  const kinematics::Joint& axis = chain.joints()[std::size_t(joint)];
  errors::check_meaning(term.name, chain, joint);
  if (term.slope && !can_have_slope(term.name))
    throw std::invalid_argument(element_name +
                                ": a location or spindle element cannot have a slope");
  return {joint, term.name.component(), term.name.location, term.slope,
          // A slope multiplies the travel of the carriage, which has the opposite sign on the
          // workpiece side.
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
  text += fmt::format("{}\n{}{}\n", header, since_start_prefix, belief.since_start ? 1 : 0);
  for (const ThermalBelief::Term& term : belief.terms)
    text += fmt::format("{}{} {}\n{}", term_prefix, errors::to_string(term.name),
                        term.slope ? "slope" : "offset", identification::to_text(term.model));
  return text;
}

ThermalBelief parse_thermal_belief(std::string_view text, const std::string& file) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  BeliefReader reader(text, file);
  const std::string first_line = "a first line " + quoted_excerpt(header);
  while (reader.peek() && (reader.peek()->empty() || reader.peek()->starts_with('#')))
    reader.next(first_line);
  if (const std::string_view line = reader.next(first_line); line != header)
    reader.throw_input_error(first_line, quoted_excerpt(line));
  const std::string flag = "\"since_start 1\" or \"since_start 0\"";
  const std::string_view line = reader.next(flag);
  if (line != "since_start 0" && line != "since_start 1")
    reader.throw_input_error(flag, quoted_excerpt(line));
  ThermalBelief belief;
  belief.since_start = line.ends_with('1');
  while (reader.peek()) {
    if (belief.terms.size() == max_terms)
      reader.throw_input_error(fmt::format("at most {} terms", max_terms), "more");
    belief.terms.push_back(read_term(reader, belief));
  }
  return belief;
}

ThermalSeries thermal_series(const ThermalBelief& belief, const ControlLog& log,
                             const kinematics::Chain& chain) {
  if (log.time_s.size() == 0)
    throw std::invalid_argument("expected a log with at least one row of temperatures");
  ThermalSeries series;
  series.time_s = log.time_s;
  series.value.resize(log.time_s.size(), Index(belief.terms.size()));
  std::vector<char> is_limited(std::size_t(log.time_s.size()), 0);
  for (std::size_t k = 0; k < belief.terms.size(); ++k) {
    const ThermalBelief::Term& term = belief.terms[k];
    series.terms.push_back(bind_term(term, chain));
    const ModelInputs inputs = model_inputs(term.model, log, belief.since_start);
    series.value.col(Index(k)) = identification::values(term.model, inputs.T);
    for (std::size_t i = 0; i < is_limited.size(); ++i) is_limited[i] |= inputs.is_limited[i];
  }
  series.limited_rows = int(std::ranges::count(is_limited, char(1)));
  return series;
}

std::vector<JointDeviation> deviations(const ThermalSeries& series,
                                       const kinematics::AxisState& state) {
  std::vector<JointDeviation> result(std::size_t(state.q.size()));
  if (series.terms.empty()) return result;
  const Index row = row_at(series.time_s, state.time_s);
  for (std::size_t k = 0; k < series.terms.size(); ++k) {
    const ThermalSeries::Term& term = series.terms[k];
    JointDeviation& joint = result[std::size_t(term.joint)];
    // Readings are held, not interpolated, because a control does not know the next one.
    const double factor = term.slope ? term.sign * state.q[term.joint] : 1.0;
    (term.location ? joint.location : joint.motion)[term.component] +=
        factor * series.value(row, Index(k));
  }
  return result;
}

namespace {

using Eigen::MatrixX3d;
using Eigen::Vector3d;

// The farthest neighbour only sets the weight that is subtracted from all.
constexpr std::size_t neighbour_count = 9;

struct Neighbour {
  double distance = std::numeric_limits<double>::infinity();
  Index row = -1;
};

/// Returns the readings nearest to a point, in ascending order of distance; `row` is -1 where there
/// are fewer.
std::array<Neighbour, neighbour_count> nearest_readings(const MatrixX3d& reading_points,
                                                        const Vector3d& point) {
  std::array<Neighbour, neighbour_count> nearest;
  for (Index i = 0; i < reading_points.rows(); ++i) {
    const double distance_mm = (reading_points.row(i).transpose() - point).norm();
    if (!(distance_mm < nearest.back().distance)) continue;
    auto slot = nearest.end() - 1;
    for (; slot != nearest.begin() && distance_mm < (slot - 1)->distance; --slot)
      *slot = *(slot - 1);
    *slot = {distance_mm, i};
  }
  return nearest;
}

/// Returns the value at a point by a weighted linear fit to its neighbours.
double value_of_plane(const MatrixX3d& reading_points, const VectorXd& deviation,
                      const Vector3d& point) {
  const auto neighbours = nearest_readings(reading_points, point);
  if (neighbours[0].distance == 0.0) return deviation[neighbours[0].row];
  const double cutoff_weight = 1.0 / neighbours.back().distance;  // 0 if there are fewer
  Eigen::Matrix<double, Eigen::Dynamic, 4, 0, neighbour_count, 4> A(Index(neighbour_count), 4);
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, neighbour_count, 1> b(Index{neighbour_count});
  Index n = 0;
  for (const Neighbour& neighbour : neighbours) {
    if (neighbour.row < 0) break;
    const double weight = 1.0 / neighbour.distance - cutoff_weight;
    if (!(weight > 0.0)) continue;
    // Distances are divided by the nearest one, so that the threshold below has no unit.
    const Vector3d offset =
        (reading_points.row(neighbour.row).transpose() - point) / neighbours[0].distance;
    A.row(n) << weight, weight * offset.transpose();
    b[n++] = weight * deviation[neighbour.row];
  }
  // If all neighbours are equally far, every weight is zero, and the first one decides.
  if (n == 0) return deviation[neighbours[0].row];
  // The minimum-norm solution is used, because the readings determine no slope across the surface.
  Eigen::CompleteOrthogonalDecomposition<
      Eigen::Matrix<double, Eigen::Dynamic, 4, 0, neighbour_count, 4>>
      plane;
  // Neighbours on a curved surface have a small singular value across it, below 1e-3 of the
  // largest.
  plane.setThreshold(1e-3);
  plane.compute(A.topRows(n));
  return plane.solve(b.head(n))[0];
}

/// A range [first, last) of rows in the order of time.
struct RowRange {
  std::size_t first = 0, last = 0;
};

/// The deviations of a part in the order of time.
struct SortedDeviations {
  MatrixX3d normals;
  VectorXd deviation;
  std::vector<double> time_s;
  std::vector<int> pass;
};

SortedDeviations sort_by_time(const PartDeviations& part) {
  std::vector<Index> order(std::size_t(part.time_s.size()));
  std::iota(order.begin(), order.end(), Index(0));
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return part.time_s[a] < part.time_s[b]; });
  SortedDeviations result{part.normals(order, Eigen::all), part.deviation(order), {}, {}};
  for (const Index i : order) {
    result.time_s.push_back(part.time_s[i]);
    result.pass.push_back(part.pass.size() > 0 ? part.pass[i] : 0);
  }
  return result;
}

/// Splits the deviations of a part into segments, at changes of the pass and at gaps in time.
std::vector<RowRange> split_segments(const SortedDeviations& part, std::size_t group_size) {
  const std::vector<double>& t = part.time_s;
  std::vector<double> gaps;
  for (std::size_t i = 1; i < t.size(); ++i)
    if (t[i] > t[i - 1]) gaps.push_back(t[i] - t[i - 1]);
  double max_gap = std::numeric_limits<double>::infinity();
  if (!gaps.empty()) {
    // A gap longer than ten times the median interval of a group separates two segments.
    std::nth_element(gaps.begin(), gaps.begin() + std::ptrdiff_t(gaps.size() / 2), gaps.end());
    max_gap = 10.0 * double(group_size) * gaps[gaps.size() / 2];
  }
  std::vector<RowRange> segments;
  for (std::size_t i = 0; i < t.size(); ++i) {
    const bool is_start = i == 0 || part.pass[i] != part.pass[i - 1] || t[i] - t[i - 1] > max_gap;
    if (is_start) segments.push_back({i, i});
    segments.back().last = i + 1;
  }
  return segments;
}

/// Splits a segment into groups of about equal size. Rows at the same time stay in one group.
std::vector<RowRange> split_groups(const RowRange& segment, const std::vector<double>& time_s,
                                   std::size_t group_size) {
  const std::size_t n = segment.last - segment.first;
  const std::size_t count = std::max<std::size_t>(1, n / group_size);
  std::vector<RowRange> groups;
  std::size_t at = segment.first;
  for (std::size_t g = 1; g <= count; ++g) {
    std::size_t end = std::max(at, segment.first + g * n / count);
    while (end > at && end < segment.last && time_s[end] == time_s[end - 1]) ++end;
    if (end > at) groups.push_back({at, end});
    at = end;
  }
  return groups;
}

/// The displacement that explains a group of deviations, at the mean time of the group.
struct DisplacementNode {
  double time_s = 0.0;
  Vector3d displacement = Vector3d::Zero();
};

/// Returns the displacement that explains the deviations of a group along their normals, by damped
/// least squares.
DisplacementNode fit_node(const SortedDeviations& part, const RowRange& group, double damping) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Vector3d b = Vector3d::Zero();
  DisplacementNode node;
  for (std::size_t k = group.first; k < group.last; ++k) {
    const Vector3d n = part.normals.row(Index(k)).transpose();
    A += n * n.transpose();
    b += part.deviation[Index(k)] * n;
    node.time_s += part.time_s[k];
  }
  const double count = double(group.last - group.first);
  // The damping is proportional to the rows, so that the result does not depend on the group size.
  A.diagonal().array() += damping * damping * count;
  node.time_s /= count;
  node.displacement = A.ldlt().solve(b);
  return node;
}

/// Extrapolates the line through two nodes to another time.
DisplacementNode extrapolate_node(const DisplacementNode& node, const DisplacementNode& neighbour,
                                  double time_s) {
  const double interval_s = node.time_s - neighbour.time_s;
  const double u = interval_s != 0.0 ? (time_s - node.time_s) / interval_s : 0.0;
  return {time_s, node.displacement + u * (node.displacement - neighbour.displacement)};
}

/// Appends the nodes of a segment, extrapolated to both ends of the segment.
void append_segment(std::vector<DisplacementNode>& series, const SortedDeviations& part,
                    const RowRange& segment, const DisplacementOptions& options) {
  std::vector<DisplacementNode> nodes;
  for (const RowRange& group :
       split_groups(segment, part.time_s, std::size_t(std::max(1, options.group_size))))
    nodes.push_back(fit_node(part, group, options.damping));
  const std::size_t n = nodes.size();
  // A node is at the mean time of its group, so both ends of a segment are extrapolated by half a
  // group.
  const double begin_s = part.time_s[segment.first], end_s = part.time_s[segment.last - 1];
  if (begin_s < nodes.front().time_s)
    series.push_back(
        extrapolate_node(nodes.front(), nodes[std::min<std::size_t>(1, n - 1)], begin_s));
  series.insert(series.end(), nodes.begin(), nodes.end());
  if (end_s > nodes.back().time_s)
    series.push_back(extrapolate_node(nodes.back(), nodes[n > 1 ? n - 2 : 0], end_s));
}

}  // namespace

VectorXd interpolate_readings(const MatrixX3d& reading_points, const VectorXd& deviation,
                              const MatrixX3d& points, double reach) {
  if (reading_points.rows() == 0 || reading_points.rows() != deviation.size())
    throw std::invalid_argument("expected readings of a part, seen none");
  VectorXd values(points.rows());
  tbb::parallel_for(Index(0), points.rows(), [&](Index i) {
    const Vector3d point = points.row(i).transpose();
    const bool is_near =
        (reading_points.rowwise() - point.transpose()).rowwise().norm().minCoeff() <= reach;
    values[i] = is_near ? value_of_plane(reading_points, deviation, point) : 0.0;
  });
  return values;
}

DisplacementSeries displacement_from_deviations(const PartDeviations& part,
                                                const DisplacementOptions& options) {
  const SortedDeviations sorted_part = sort_by_time(part);
  std::vector<DisplacementNode> nodes;
  for (const RowRange& segment :
       split_segments(sorted_part, std::size_t(std::max(1, options.group_size))))
    append_segment(nodes, sorted_part, segment, options);
  DisplacementSeries series{VectorXd(Index(nodes.size())), MatrixX3d(Index(nodes.size()), 3)};
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    series.time_s[Index(i)] = nodes[i].time_s;
    series.move.row(Index(i)) = nodes[i].displacement.transpose();
  }
  return series;
}

Vector3d displacement_at(const DisplacementSeries& series, double time_s) {
  const VectorXd& t = series.time_s;
  const Index n = t.size();
  if (n == 0) return Vector3d::Zero();
  const Index next_row = std::upper_bound(t.data(), t.data() + n, time_s) - t.data();
  if (next_row == 0) return series.move.row(0).transpose();
  if (next_row == n) return series.move.row(n - 1).transpose();
  const double u = (time_s - t[next_row - 1]) / (t[next_row] - t[next_row - 1]);
  return ((1 - u) * series.move.row(next_row - 1) + u * series.move.row(next_row)).transpose();
}

namespace {

using kinematics::AxisState;
using kinematics::Pose;

/// Rotates a displacement with the workpiece spindle, from angle zero to its angle in `state`.
Vector3d rotate_with_spindle(const MachineBelief& belief, const AxisState& state,
                             const Vector3d& displacement) {
  if (!belief.part_spindle) return displacement;
  kinematics::AxisVector unrotated = state.q;
  unrotated[*belief.part_spindle] = 0.0;
  const Eigen::Matrix3d R_now = belief.chain.workpiece_in_bed(state.q).linear();
  const Eigen::Matrix3d R_unrotated = belief.chain.workpiece_in_bed(unrotated).linear();
  return R_now.transpose() * (R_unrotated * displacement);
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
  errors::ForceDeviations deviations_of_force;
  if (belief.force) deviations_of_force = errors::deviations(belief.force->compliance, state, load);
  deviations_of_force.joints = belief.force
                                   ? kinematics::sum(std::move(joints), deviations_of_force.joints)
                                   : std::move(joints);
  Pose T_wt = errors::tool_in_workpiece(belief.chain, state.q, deviations_of_force);
  // The tool yields along its axis, away from the part.
  if (belief.current_deflection)
    T_wt.translation() +=
        value_at(*belief.current_deflection, state.time_s)[0] * T_wt.linear().col(2);
  if (belief.part)
    T_wt.translation() +=
        rotate_with_spindle(belief, state, displacement_at(*belief.part, state.time_s));
  return T_wt;
}

}  // namespace abbe::sim::compensation
