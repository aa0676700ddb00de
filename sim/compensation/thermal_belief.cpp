#include "sim/compensation/thermal_belief.h"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "errors/bound_element.h"
#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::sim::compensation {
namespace {

namespace identification = errors::identification;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using identification::ThermalModel;
using kinematics::JointDeviation;

constexpr std::string_view head = "abbe thermal belief 1";
constexpr std::string_view since_start_word = "since_start ";
constexpr std::string_view term_word = "term ";
constexpr std::size_t most_terms = 1000;

// ---- text

bool may_slope(const errors::ElementName& name) { return !name.location && name.axis != 'S'; }

/// A piece of a text and the number of the line before it.
struct Piece {
  std::string_view text;
  int before = 0;
};

/// The lines of a belief file: its head, then a piece a term.
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
  /// Everything up to the next term.
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
  /// Takes a line off, without its end.
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
    return identification::thermal_model_of_text(piece.text, file);
  } catch (const BadInput& fault) {
    throw BadInput(file, piece.before + std::max(1, fault.line), fault.column, fault.expected,
                   fault.seen);
  }
}

bool holds(const ThermalBelief& belief, const ThermalBelief::Term& term) {
  return std::ranges::any_of(belief.terms, [&](const ThermalBelief::Term& other) {
    return other.name == term.name && other.slope == term.slope;
  });
}

/// "term EXX slope" and the model that follows.
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
  if (term.slope && !may_slope(term.name))
    reader.refuse("a slope of an axis that travels", in_quotes(line));
  if (holds(before, term)) reader.refuse("each term once", in_quotes(line));
  term.model = read_model(reader.model(), reader.file());
  return term;
}

// ---- over a day

/// Temperatures that a model asks for, one column an input, held where it was not trained.
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
    const double room = model.margin * (model.highest[input] - model.lowest[input]);
    const double low = model.lowest[input] - room, high = model.highest[input] + room;
    for (Index i = 0; i < n; ++i)
      if (T[i] < low || T[i] > high) inputs.held[std::size_t(i)] = 1;
    inputs.T.col(input) = T.cwiseMax(low).cwiseMin(high);
  }
  return inputs;
}

ThermalCourse::Term bound(const ThermalBelief::Term& term, const kinematics::Chain& chain) {
  const std::string who = errors::to_string(term.name);
  const int joint = errors::joint_of(term.name.axis, chain, who);
  const kinematics::Joint& axis = chain.joints()[std::size_t(joint)];
  errors::check_meaning(term.name, chain, joint);
  if (term.slope && !may_slope(term.name))
    throw std::invalid_argument(who + ": a location or spindle element has no slope");
  return {joint, term.name.component(), term.name.location, term.slope,
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

ThermalBelief thermal_belief_of_text(std::string_view text, const std::string& file) {
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
    if (belief.terms.size() == most_terms)
      reader.refuse(fmt::format("at most {} terms", most_terms), "more");
    belief.terms.push_back(read_term(reader, belief));
  }
  return belief;
}

ThermalCourse course_of(const ThermalBelief& belief, const ControlLog& log,
                        const kinematics::Chain& chain) {
  if (log.time_s.size() == 0)
    throw std::invalid_argument("expected a log with at least one row of temperatures");
  ThermalCourse course;
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

std::vector<JointDeviation> deviations(const ThermalCourse& course,
                                       const kinematics::AxisState& state) {
  std::vector<JointDeviation> result(std::size_t(state.q.size()));
  if (course.terms.empty()) return result;
  const Index row = row_at(course.time_s, state.time_s);
  for (std::size_t k = 0; k < course.terms.size(); ++k) {
    const ThermalCourse::Term& term = course.terms[k];
    JointDeviation& joint = result[std::size_t(term.joint)];
    const double travel = term.slope ? term.sign * state.q[term.joint] : 1.0;
    (term.location ? joint.location : joint.motion)[term.component] +=
        travel * course.value(row, Index(k));
  }
  return result;
}

}  // namespace abbe::sim::compensation
