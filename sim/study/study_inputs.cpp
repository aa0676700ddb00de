#include "sim/study/study_inputs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "errors/coefficients.h"
#include "errors/identification/model.h"
#include "kinematics/units.h"
#include "sim/machine/truth.h"
#include "sim/scene/error_tables.h"
#include "sim/scene/scene.h"
#include "sim/study/study_fields.h"

namespace abbe::sim::study {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using errors::identification::coefficient_element;
using errors::identification::typical_deviation;

bool is_angle(const std::string& coefficient_name) {
  return errors::parse_element_name(coefficient_element(coefficient_name)).is_angle();
}

/// Returns the elements that an identification could find but the belief lacks, with all
/// coefficients zero; empty if the travel of a slide is not stated. Appends the names of their free
/// coefficients to `coefficient_names`.
std::vector<errors::Element> missing_elements(const Scene& scene,
                                              std::vector<std::string>& coefficient_names) {
  errors::GeometricErrors model;
  try {
    model = errors::identification::error_model(make_machine(scene).nominal,
                                                {.order = 2, .harmonics = 2, .placement = false});
  } catch (const std::invalid_argument&) {
    return {};
  }
  std::vector<errors::Element> missing;
  for (const errors::Element& element : model.elements)
    if (std::ranges::find(scene.geometric.elements, element.name, &errors::Element::name) ==
        scene.geometric.elements.end())
      missing.push_back(element);
  const auto is_fixed = [&](const errors::Coefficient& coefficient) {
    const auto i =
        std::ranges::find(model.covariance.of, coefficient) - model.covariance.of.begin();
    return i < std::ssize(model.covariance.of) && model.covariance.matrix(i, i) == 0.0;
  };
  for (const errors::Coefficient& coefficient : errors::coefficients(model.elements))
    if (std::ranges::find(missing, model.elements[std::size_t(coefficient.element)].name,
                          &errors::Element::name) != missing.end() &&
        !is_fixed(coefficient))
      coefficient_names.push_back(errors::name_of(coefficient, model.elements));
  return missing;
}

/// Throws std::invalid_argument if a prior does not belong to an unidentified element.
void check_priors(const Priors& priors, const std::vector<UnidentifiedCoefficient>& unidentified) {
  std::set<std::string> elements;
  for (const UnidentifiedCoefficient& coefficient : unidentified)
    elements.insert(coefficient_element(coefficient.number));
  for (const auto& [name, spread] : priors.spread)
    if (!elements.contains(name))
      throw std::invalid_argument(fmt::format(
          "{}, which the belief holds or the machine does not have; not identified: {}", name,
          elements.empty() ? "nothing" : fmt::format("{}", fmt::join(elements, ", "))));
}

/// Adds inputs for the coefficients that the belief contains, with their covariance.
void add_identified(const errors::GeometricErrors& belief, BeliefInputs& result) {
  const errors::Covariance& covariance = belief.covariance;
  const auto coefficients = errors::coefficients(belief.elements);
  const VectorXd values = errors::values(belief.elements);
  std::vector<Index> rows;
  VectorXd per_unit(Index(covariance.of.size()));
  for (std::size_t k = 0; k < covariance.of.size(); ++k) {
    const auto i = Index(k);
    const std::string name = errors::name_of(covariance.of[k], belief.elements);
    per_unit[i] = 1.0 / errors::identification::display_unit(name);
    if (!(covariance.matrix(i, i) > 0.0)) continue;  // zero by convention of the model
    Input input;
    input.name = input.number = name;
    input.unit = is_angle(name) ? "urad" : "um";
    const auto index = std::ranges::find(coefficients, covariance.of[k]) - coefficients.begin();
    input.distribution.centre = values[index] * per_unit[i];
    rows.push_back(i);
    result.inputs.push_back(std::move(input));
  }
  const MatrixXd scaled = per_unit.asDiagonal() * covariance.matrix * per_unit.asDiagonal();
  result.covariance = scaled(rows, rows);
}

/// Adds an input for every coefficient with a prior. Coefficients that hide it have absorbed part
/// of it, so they correlate negatively with it.
void add_unidentified(BeliefInputs& result) {
  std::vector<const UnidentifiedCoefficient*> drawn;
  for (const UnidentifiedCoefficient& coefficient : result.unidentified)
    if (coefficient.is_drawn) drawn.push_back(&coefficient);
  const auto identified = Index(result.inputs.size()), size = identified + Index(drawn.size());
  for (const UnidentifiedCoefficient* coefficient : drawn) {
    Input input;
    input.name = input.number = coefficient->number;
    input.unit = coefficient->unit;
    result.inputs.push_back(std::move(input));
  }
  MatrixXd covariance = MatrixXd::Zero(size, size);
  covariance.topLeftCorner(identified, identified) = result.covariance;
  for (std::size_t k = 0; k < drawn.size(); ++k) {
    VectorXd direction = VectorXd::Zero(size);
    direction[identified + Index(k)] = 1.0;
    for (const auto& [name, amount] : drawn[k]->hidden_by) {
      const auto hiding_index =
          std::ranges::find(result.inputs, name, &Input::number) - result.inputs.begin();
      if (hiding_index < size) direction[hiding_index] -= amount;
    }
    covariance += std::pow(drawn[k]->spread, 2) * direction * direction.transpose();
  }
  result.covariance = std::move(covariance);
}

}  // namespace

BeliefInputs belief_inputs(const Scene& scene, const Priors& priors) {
  BeliefInputs result;
  std::vector<UnidentifiedNumber> entries;
  if (const Node* errors = scene.tree ? scene.tree->find("errors") : nullptr)
    entries = unidentified_numbers(*errors);
  std::vector<std::string> missing_names;
  result.completion = missing_elements(scene, missing_names);
  for (std::string& name : missing_names) entries.push_back({std::move(name), {}});
  for (const UnidentifiedNumber& entry : entries) {
    const std::string element = coefficient_element(entry.number);
    const auto prior = priors.spread.find(element);
    UnidentifiedCoefficient coefficient{entry.number, is_angle(entry.number) ? "urad" : "um", 0.0,
                                        priors.typical || prior != priors.spread.end(),
                                        entry.hidden_by};
    coefficient.spread =
        typical_deviation(entry.number) / errors::identification::display_unit(entry.number);
    if (prior != priors.spread.end())
      coefficient.spread =
          prior->second * typical_deviation(entry.number) / typical_deviation(element);
    coefficient.is_drawn = coefficient.is_drawn && coefficient.spread > 0.0;
    result.unidentified.push_back(std::move(coefficient));
  }
  check_priors(priors, result.unidentified);
  add_identified(scene.geometric, result);
  add_unidentified(result);
  for (std::size_t i = 0; i < result.inputs.size(); ++i)
    result.inputs[i].distribution.spread = std::sqrt(result.covariance(Index(i), Index(i)));
  return result;
}

namespace {

/// Returns the distribution of a coefficient.
/// @param d     with parameters in multiples of the coefficient's value
/// @param base  that value; if it is negative, the limits are swapped
Distribution scaled(Distribution d, double base) {
  const double size = std::abs(base);
  d.centre *= base;
  d.spread *= d.kind == Distribution::Kind::LogNormal ? 1.0 : size;
  const double low = d.low * base, high = d.high * base;
  d.low = std::min(low, high);
  d.high = std::max(low, high);
  return d;
}

/// Returns the unit in the suffix of a path's key: "um" for "..._um".
std::string path_unit(const std::string& path) {
  std::string key = path;
  // An index at the end belongs to the key before it.
  while (true) {
    const std::size_t dot = key.rfind('.');
    const std::string part = key.substr(dot == std::string::npos ? 0 : dot + 1);
    const bool is_index =
        !part.empty() && part.find_first_not_of("0123456789") == std::string::npos;
    if (!is_index || dot == std::string::npos) {
      key = part;
      break;
    }
    key = key.substr(0, dot);
  }
  const std::string_view stem = key_without_unit(key);
  return stem.size() < key.size() ? key.substr(stem.size() + 1) : "";
}

/// Contents of an `[[input]]`, which acts through paths, an element or a coefficient.
struct SingleInput {
  std::vector<std::string> paths;
  double factor = 1.0;
  Input input;
};

const Fields<SingleInput>& single_input_fields() {
  const auto of_input = [](auto member) {
    return [member](auto& single) -> auto& { return single.input.*member; };
  };
  static const Fields<SingleInput> fields =
      Fields<SingleInput>()
          .texts(KeyName("path").in_exclusive_group("acts by"), &SingleInput::paths,
                 "value of the scene, as in `--set`, or several that change together: "
                 "`\"setup.EA_urad\"`, `\"thermal.link.3.conductance_W_per_K\"`")
          .text(KeyName("element").in_exclusive_group("acts by"), of_input(&Input::element),
                "`\"EXX\"`: a factor of that element of the scene")
          .text(KeyName("number").in_exclusive_group("acts by"), of_input(&Input::number),
                "`\"EXX[1]\"`, `\"EXX screw pitch cos 1\"`: a coefficient of an error curve, um or "
                "urad, named as in `[covariance]` of a belief")
          .check([](TableReader& reader, SingleInput& single) {
            const int count = int(!single.paths.empty()) + int(!single.input.element.empty()) +
                              int(!single.input.number.empty());
            if (count != 1)
              reader.report_invalid("path",
                                    "one of path, element (\"EXX\") and number (\"EXX[1]\")",
                                    count == 0 ? "none" : "several");
          })
          .number("factor", &SingleInput::factor, any_number,
                  "the values at the paths are `factor` times the input")
          .check([](TableReader& reader, SingleInput& single) {
            if (reader.has("factor") && single.paths.empty())
              reader.report_invalid("factor", "a path with factor", "none");
          })
          .text(KeyName("name").with_fallback("path, element or number"), of_input(&Input::name),
                "name in tables and pictures")
          .number("cost", of_input(&Input::cost), positive,
                  "cost of the present spread; 1/k of the spread costs k times as much "
                  "(`[tolerance]`)");
  return fields;
}

/// Quantities of the scene's errors that become inputs.
enum class InputSource { Element, Number, Covariance };

/// Contents of an `[[inputs]]`, which declares many inputs of the same kind.
struct InputGroup {
  InputSource every = InputSource::Element;
  std::vector<std::string> of;  ///< elements; empty: all elements
  Input pattern;                ///< with the distribution and cost of each input
};

const Fields<InputGroup>& input_group_fields() {
  static const Fields<InputGroup> fields =
      Fields<InputGroup>()
          .choice(
              required_key("every"), &InputGroup::every,
              {{"element", InputSource::Element,
                "a factor for every element of the scene's errors: `centre` 0 and `spread` 1 "
                "treat the machine as it is as one standard deviation"},
               {"number", InputSource::Number,
                "every nonzero coefficient of their curves; `centre`, `spread`, `low` and `high` "
                "are multiples of it"},
               {"covariance", InputSource::Covariance,
                "every coefficient with an uncertainty in the covariance of a belief, "
                "correlations included; the scene's `errors` must be a belief"}},
              "what the inputs are made from")
          .number(
              "cost", [](auto& group) -> auto& { return group.pattern.cost; }, positive,
              "cost of the present spread of each input");
  return fields;
}

const Fields<InputGroup>& distributed_group_fields() {
  static const Fields<InputGroup> fields =
      Fields<InputGroup>()
          .texts(KeyName("of").with_fallback("all"), &InputGroup::of,
                 "elements of the scene's errors")
          .include_fields(
              [](auto& group) -> auto& { return group.pattern.distribution; },
              distribution_fields());
  return fields;
}

/// Returns true if a group includes an element.
bool has_element(const InputGroup& group, const std::string& element) {
  return group.of.empty() || std::find(group.of.begin(), group.of.end(), element) != group.of.end();
}

const Fields<double>& correlation_fields() {
  static const Fields<double> fields = Fields<double>().number(
      required_key("rho"), [](auto& rho) -> auto& { return rho; }, {-1.0, 1.0, false, false},
      "correlation of the normal scores of the two (a Gaussian copula)");
  return fields;
}

/// Reads the inputs of a study and their correlations.
class InputsReader {
 public:
  InputsReader(TableReader& reader, const std::vector<Scene>& scenes)
      : reader_(reader), input_errors_(reader.input_errors()), scenes_(scenes) {}

  DeclaredInputs read();

 private:
  void read_input(const Node& node);
  void read_group(const Node& node);
  /// Returns the number that the scene of the first configuration states at a path.
  std::optional<double> scene_value(const std::string& path) const;
  std::optional<double> nominal_value(const std::string& path) const;
  void add_covariance(const Node& node, double cost, const Priors& priors);
  void add_elements(const InputGroup& group, const SourcePosition& location);
  void add_coefficients(const InputGroup& group, const SourcePosition& location);
  void add(Input input, const SourcePosition& location);
  void read_correlations();

  TableReader& reader_;
  InputErrors& input_errors_;
  const std::vector<Scene>& scenes_;
  DeclaredInputs declared_;
  std::map<std::string, int> index_;          ///< of the inputs by name
  std::set<std::string> targets_;             ///< elements, coefficients and paths that inputs set
  std::set<std::pair<int, int>> correlated_;  ///< lower index first
};

/// Returns the number in a node; empty if the node holds something else.
std::optional<double> node_number(const Node& node) {
  if (const auto* whole = std::get_if<std::int64_t>(&node.value)) return double(*whole);
  if (const auto* number = std::get_if<double>(&node.value)) return *number;
  return {};
}

/// Returns a centre within the limits for an input whose centre is missing, so that the missing
/// number causes no second input error.
double valid_centre(const Node& input, const std::optional<double>& nominal) {
  const auto limit = [&](const char* key) {
    const Node* node = input.find(key);
    return node ? node_number(*node) : std::nullopt;
  };
  const auto low = limit("low"), high = limit("high");
  if (nominal && (!low || *nominal >= *low) && (!high || *nominal <= *high)) return *nominal;
  if (low && high) return 0.5 * (*low + *high);
  return low ? *low + 1.0 : high ? *high - 1.0 : 1.0;
}

/// Returns the unit of an input: that of its path or coefficient; empty for an element, whose input
/// is a factor.
std::string input_unit(const SingleInput& single) {
  if (!single.paths.empty()) return path_unit(single.paths.front());
  const std::string& number = single.input.number;
  if (number.empty()) return "";
  const bool is_angle = number.size() > 1 && number[1] >= 'A' && number[1] <= 'C';
  return is_angle ? "urad" : "um";
}

/// Adds an input, or an input error if its name or one of its targets is not unique.
void InputsReader::add(Input input, const SourcePosition& location) {
  if (declared_.inputs.size() == max_inputs)
    input_errors_.add(location, fmt::format("at most {} inputs", max_inputs), "more");
  if (declared_.inputs.size() >= max_inputs) return;
  if (!index_.emplace(input.name, int(declared_.inputs.size())).second)
    input_errors_.add(location, "a unique name for every input", "\"" + input.name + "\" again");
  std::vector<std::string> targets{input.element + input.number};  // at most one of the two is set
  for (const Setting& setting : input.settings) targets.push_back(setting.path);
  for (const std::string& target : targets)
    if (!target.empty() && !targets_.insert(target).second)
      input_errors_.add(location, "a single input for " + target,
                        "\"" + input.name + "\" sets it again");
  declared_.locations.push_back(location);
  declared_.inputs.push_back(std::move(input));
}

/// Reads an `[[input]]`.
void InputsReader::read_input(const Node& node) {
  TableReader reader(node, "input", input_errors_);
  SingleInput single = single_input_fields().read(reader);
  Input& input = single.input;
  const std::vector<std::string>& paths = single.paths;
  for (const std::string& path : paths) input.settings.push_back({path, single.factor});
  if (input.name.empty())
    input.name = !paths.empty() ? paths.front() : input.element + input.number;
  input.unit = input_unit(single);
  if (!reader.has("spread"))
    reader.report_missing("spread", "a number in the unit of the path's key");
  const std::optional<double> stated = paths.empty() ? std::nullopt : scene_value(paths.front());
  Distribution initial;
  const bool lacks_centre = !paths.empty() && !stated && !reader.has("centre") &&
                            // a missing key of `setup` means zero
                            !paths.front().starts_with("setup.");
  const auto nominal =
      lacks_centre && single.factor == 1.0 ? nominal_value(paths.front()) : std::optional<double>();
  const auto initial_centre = [&] {
    if (stated && single.factor != 0.0) return *stated / single.factor;
    if (lacks_centre) return valid_centre(node, nominal);
    return input.element.empty() ? 0.0 : 1.0;  // a factor of an element is 1
  };
  initial.centre = initial_centre();
  input.distribution = distribution_fields().read(reader, initial);
  if (lacks_centre)
    declared_.missing_centres.push_back({int(declared_.inputs.size()), paths.front(), nominal});
  reader.close();
  add(std::move(input), node.position);
}

/// Returns the number at the nominal key that corresponds to a path below `actual`, from the scene
/// of the first configuration; empty for any other path.
std::optional<double> InputsReader::nominal_value(const std::string& path) const {
  const std::string actual = ".actual.";
  const std::size_t begin = path.find(actual);
  if (begin == std::string::npos) return {};
  return scene_value(path.substr(0, begin + 1) + path.substr(begin + actual.size()));
}

std::optional<double> InputsReader::scene_value(const std::string& path) const {
  return scenes_.empty() ? std::nullopt : scene_number(scenes_.front(), path);
}

/// Reads the priors of coefficients that a belief does not contain: `{ EY0A_um = 20 }` or
/// "typical".
Priors read_priors(TableReader& reader) {
  Priors priors;
  const Node* node = reader.accept_key("unidentified");
  if (node == nullptr) return priors;
  const std::string expected =
      "a standard deviation of each element, { EY0A_um = 20, EAX_urad = 10 }, or \"typical\"";
  if (node->text() && *node->text() == "typical") {
    priors.typical = true;
    return priors;
  }
  if (!node->table()) {
    reader.report_invalid("unidentified", expected, display_text(*node));
    return priors;
  }
  for (const Node::Entry& entry : *node->table()) {
    const std::optional<double> spread = node_number(entry.node);
    try {
      const std::size_t unit = entry.key.rfind('_');
      const errors::ElementName name = errors::parse_element_name(entry.key.substr(0, unit));
      const bool has_unit = unit != std::string::npos &&
                            entry.key.substr(unit) == (name.is_angle() ? "_urad" : "_um");
      if (!has_unit || !spread || !(*spread >= 0.0 && *spread <= 1e6))
        reader.input_errors().add(entry.position, expected + ", from 0 to 1e6",
                                  entry.key + " = " + display_text(entry.node));
      else
        priors.spread[errors::to_string(name)] = *spread;
    } catch (const std::invalid_argument&) {
      reader.input_errors().add(entry.position, expected, entry.key);
    }
  }
  return priors;
}

/// Adds the coefficients of a belief with their standard uncertainties and correlations, and the
/// coefficients that it does not contain with their priors.
void InputsReader::add_covariance(const Node& node, double cost, const Priors& priors) {
  if (scenes_.empty()) return;
  if (scenes_.front().geometric.covariance.of.empty()) {
    input_errors_.add(node.position, "errors with a covariance, as written by `abbe identify`",
                      "errors without a covariance");
    return;
  }
  BeliefInputs belief;
  try {
    belief = belief_inputs(scenes_.front(), priors);
  } catch (const std::invalid_argument& error) {
    input_errors_.add(node.position, "priors of unidentified coefficients", error.what());
    return;
  }
  const int first = int(declared_.inputs.size());
  for (Input& input : belief.inputs) {
    input.cost = cost;
    add(std::move(input), node.position);
  }
  const Eigen::MatrixXd& S = belief.covariance;
  for (Eigen::Index a = 0; a < S.rows(); ++a)
    for (Eigen::Index b = 0; b < a; ++b) {
      // Rounding may make the magnitude exceed 1 slightly, so it is clamped below.
      const double rho = S(a, b) / std::sqrt(S(a, a) * S(b, b));
      if (rho == 0.0) continue;
      declared_.correlations.push_back(
          {first + int(a), first + int(b), std::clamp(rho, -1.0, 1.0)});
      correlated_.emplace(first + int(b), first + int(a));
    }
  declared_.unidentified = std::move(belief.unidentified);
  declared_.completion = std::move(belief.completion);
}

/// Reads an `[[inputs]]`.
void InputsReader::read_group(const Node& node) {
  TableReader reader(node, "inputs", input_errors_);
  InputGroup group = input_group_fields().read(reader);
  if (group.every == InputSource::Covariance) {
    const Priors priors = read_priors(reader);
    reader.close();
    add_covariance(node, group.pattern.cost, priors);
    return;
  }
  group = distributed_group_fields().read(reader, std::move(group));
  reader.close();
  if (scenes_.empty()) return;
  std::set<std::string> known_names;
  for (const errors::Element& element : scenes_.front().geometric.elements)
    known_names.insert(errors::to_string(element.name));
  for (const std::string& name : group.of)
    if (!known_names.count(name))
      reader.report_invalid("of", "elements that the scene has",
                            with_suggestion(name, known_names));
  if (group.every == InputSource::Element)
    add_elements(group, node.position);
  else
    add_coefficients(group, node.position);
}

/// Adds an input for every element of a group, which scales it.
void InputsReader::add_elements(const InputGroup& group, const SourcePosition& location) {
  for (const errors::Element& element : scenes_.front().geometric.elements) {
    const std::string name = errors::to_string(element.name);
    if (has_element(group, name))
      add({name, "", {}, name, "", group.pattern.distribution, group.pattern.cost}, location);
  }
}

/// Adds an input for every coefficient of the elements of a group.
void InputsReader::add_coefficients(const InputGroup& group, const SourcePosition& location) {
  const std::vector<errors::Element>& elements = scenes_.front().geometric.elements;
  const Eigen::VectorXd values = errors::values(elements);
  Eigen::Index index = 0;
  for (const errors::Coefficient& coefficient : errors::coefficients(elements)) {
    const errors::Element& element = elements[std::size_t(coefficient.element)];
    const bool is_angle = element.name.is_angle();
    const double base = values[index++] / (is_angle ? units::urad : units::um);
    if (!has_element(group, errors::to_string(element.name))) continue;
    // A zero coefficient, usually zero by convention of the model, gives no scale for the spread.
    if (base == 0.0) continue;
    const std::string name = errors::name_of(coefficient, elements);
    const Distribution d = scaled(group.pattern.distribution, base);
    if (const char* error = distribution_error(d))
      input_errors_.add(
          location, fmt::format("{}, in units of {} = {}", error, name, base),
          fmt::format("centre {}, spread {}, from {} to {}", d.centre, d.spread, d.low, d.high));
    add({name, is_angle ? "urad" : "um", {}, "", name, d, group.pattern.cost}, location);
  }
}

/// Reads all `[[correlation]]`.
void InputsReader::read_correlations() {
  for (const Node* node : reader_.tables("correlation")) {
    TableReader reader(*node, "correlation", input_errors_);
    const int a = read_input_index(reader, "first", declared_.inputs);
    const int b = read_input_index(reader, "second", declared_.inputs);
    const double rho = correlation_fields().read(reader);
    reader.close();
    if (!input_errors_.empty()) continue;
    const auto name = [&](int i) { return declared_.inputs[std::size_t(i)].name; };
    if (a == b) reader.report_invalid("second", "an input other than the first", name(b));
    if (!correlated_.insert(std::minmax(a, b)).second)
      input_errors_.add(node->position, "each pair of inputs once",
                        name(a) + " and " + name(b) + " again");
    declared_.correlations.push_back({a, b, rho});
  }
}

DeclaredInputs InputsReader::read() {
  for (const Node* node : reader_.tables("input")) read_input(*node);
  for (const Node* node : reader_.tables("inputs")) read_group(*node);
  read_correlations();
  return std::move(declared_);
}

}  // namespace

std::optional<double> scene_number(const Scene& scene, const std::string& path) {
  const Node* node = scene.tree.get();
  for (std::size_t begin = 0; node && begin <= path.size();) {
    const std::size_t dot = std::min(path.find('.', begin), path.size());
    const std::string part = path.substr(begin, dot - begin);
    const Node::Array* list = node->array();
    // No list has an index of seven digits, and std::stoi would throw for longer numbers.
    const bool is_index =
        !part.empty() && part.find_first_not_of("0123456789") == std::string::npos;
    if (list && is_index && part.size() < 7 && std::size_t(std::stoi(part)) < list->size())
      node = &(*list)[std::size_t(std::stoi(part))];
    else
      node = list ? nullptr : node->find(part);
    begin = dot + 1;
  }
  return node ? node_number(*node) : std::nullopt;
}

DeclaredInputs read_inputs(TableReader& reader, const std::vector<Scene>& scenes) {
  return InputsReader(reader, scenes).read();
}

std::vector<Key> single_input_keys() {
  std::vector<Key> keys = single_input_fields().keys();
  for (Key& key : distribution_fields().keys()) keys.push_back(std::move(key));
  return keys;
}

std::vector<Key> input_group_keys() {
  std::vector<Key> keys = input_group_fields().keys(),
                   distribution_keys = distributed_group_fields().keys();
  Key priors = make_key(
      "unidentified", Key::Kind::Any,
      "standard deviations of elements that the belief does not contain, `{ EY0A_um = 20, EAX_urad "
      "= 10 }`, or `\"typical\"`: 20 um and 20 urad for offsets, squareness and parallelism, 5 um "
      "and 15 urad for error motions (1/k of it for order k of a curve), 5 um and 10 urad for the "
      "nose. Elements without one are left out of every figure, and a warning is given");
  for (EnumChoice& choice : keys.front().choices)
    choice.keys = choice.word == "covariance" ? std::vector<Key>{priors} : distribution_keys;
  return keys;
}

std::vector<Key> correlation_keys() {
  return {
      make_key(required_key("first"), Key::Kind::Text, "name of an input"),
      make_key(required_key("second"), Key::Kind::Text, "name of another input; each pair once"),
      correlation_fields().keys().front()};
}

}  // namespace abbe::sim::study
