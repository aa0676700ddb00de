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
using errors::identification::element_of_number;
using errors::identification::typical_deviation;

bool is_angle(const std::string& number) {
  return errors::parse_element_name(element_of_number(number)).is_angle();
}

/// Returns the elements that an identification may find and the belief lacks, at zero; none for a
/// machine whose slides have no stated travel.
std::vector<errors::Element> lacking_elements(const Scene& scene,
                                              std::vector<std::string>& numbers) {
  errors::GeometricErrors model;
  try {
    model = errors::identification::model_of(compile(scene).nominal,
                                             {.order = 2, .harmonics = 2, .placement = false});
  } catch (const std::invalid_argument&) {
    return {};
  }
  std::vector<errors::Element> lacking;
  for (const errors::Element& element : model.elements)
    if (std::ranges::find(scene.geometric.elements, element.name, &errors::Element::name) ==
        scene.geometric.elements.end())
      lacking.push_back(element);
  const auto is_held = [&](const errors::Coefficient& one) {
    const auto at = std::ranges::find(model.covariance.of, one) - model.covariance.of.begin();
    return at < std::ssize(model.covariance.of) && model.covariance.matrix(at, at) == 0.0;
  };
  for (const errors::Coefficient& one : errors::coefficients(model.elements))
    if (std::ranges::find(lacking, model.elements[std::size_t(one.element)].name,
                          &errors::Element::name) != lacking.end() &&
        !is_held(one))
      numbers.push_back(errors::name_of(one, model.elements));
  return lacking;
}

void check_priors(const Priors& priors, const std::vector<Unidentified>& unidentified) {
  std::set<std::string> elements;
  for (const Unidentified& one : unidentified) elements.insert(element_of_number(one.number));
  for (const auto& [name, spread] : priors.spread)
    if (!elements.contains(name))
      throw std::invalid_argument(fmt::format(
          "{}, which the belief holds or the machine does not have; not identified: {}", name,
          elements.empty() ? "nothing" : fmt::format("{}", fmt::join(elements, ", "))));
}

/// Adds the coefficients that the belief holds: inputs with their covariance.
void add_known(const errors::GeometricErrors& belief, BeliefInputs& result) {
  const errors::Covariance& known = belief.covariance;
  const auto all = errors::coefficients(belief.elements);
  const VectorXd values = errors::values(belief.elements);
  std::vector<Index> rows;
  VectorXd per_unit(Index(known.of.size()));
  for (std::size_t k = 0; k < known.of.size(); ++k) {
    const auto i = Index(k);
    const std::string name = errors::name_of(known.of[k], belief.elements);
    per_unit[i] = 1.0 / errors::identification::shown_unit(name);
    if (!(known.matrix(i, i) > 0.0)) continue;  // fixed to zero by a convention of the model
    Input input;
    input.name = input.number = name;
    input.unit = is_angle(name) ? "urad" : "um";
    const auto at = std::ranges::find(all, known.of[k]) - all.begin();
    input.distribution.centre = values[at] * per_unit[i];
    rows.push_back(i);
    result.inputs.push_back(std::move(input));
  }
  const MatrixXd scaled = per_unit.asDiagonal() * known.matrix * per_unit.asDiagonal();
  result.covariance = scaled(rows, rows);
}

/// Adds one input for every coefficient with a prior. A coefficient that hides it had absorbed part
/// of it, so the covariance moves both in opposite directions.
void add_drawn(BeliefInputs& result) {
  std::vector<const Unidentified*> drawn;
  for (const Unidentified& one : result.unidentified)
    if (one.is_drawn) drawn.push_back(&one);
  const auto known = Index(result.inputs.size()), size = known + Index(drawn.size());
  for (const Unidentified* one : drawn) {
    Input input;
    input.name = input.number = one->number;
    input.unit = one->unit;
    result.inputs.push_back(std::move(input));
  }
  MatrixXd covariance = MatrixXd::Zero(size, size);
  covariance.topLeftCorner(known, known) = result.covariance;
  for (std::size_t k = 0; k < drawn.size(); ++k) {
    VectorXd along = VectorXd::Zero(size);
    along[known + Index(k)] = 1.0;
    for (const auto& [name, amount] : drawn[k]->hidden_by) {
      const auto at =
          std::ranges::find(result.inputs, name, &Input::number) - result.inputs.begin();
      if (at < size) along[at] -= amount;
    }
    covariance += std::pow(drawn[k]->spread, 2) * along * along.transpose();
  }
  result.covariance = std::move(covariance);
}

}  // namespace

BeliefInputs belief_inputs(const Scene& scene, const Priors& priors) {
  BeliefInputs result;
  std::vector<UnidentifiedNumber> numbers;
  if (const Node* errors = scene.tree ? scene.tree->find("errors") : nullptr)
    numbers = unidentified_numbers(*errors);
  std::vector<std::string> lacking;
  result.completion = lacking_elements(scene, lacking);
  for (std::string& number : lacking) numbers.push_back({std::move(number), {}});
  for (const UnidentifiedNumber& one : numbers) {
    const std::string element = element_of_number(one.number);
    const auto stated = priors.spread.find(element);
    Unidentified number{one.number, is_angle(one.number) ? "urad" : "um", 0.0,
                        priors.typical || stated != priors.spread.end(), one.hidden_by};
    number.spread = typical_deviation(one.number) / errors::identification::shown_unit(one.number);
    if (stated != priors.spread.end())
      number.spread = stated->second * typical_deviation(one.number) / typical_deviation(element);
    number.is_drawn = number.is_drawn && number.spread > 0.0;
    result.unidentified.push_back(std::move(number));
  }
  check_priors(priors, result.unidentified);
  add_known(scene.geometric, result);
  add_drawn(result);
  for (std::size_t i = 0; i < result.inputs.size(); ++i)
    result.inputs[i].distribution.spread = std::sqrt(result.covariance(Index(i), Index(i)));
  return result;
}

namespace {

/// Returns the distribution of a coefficient whose parameters are multiples of its value; a
/// negative value swaps the limits.
Distribution scaled(Distribution d, double base) {
  const double size = std::abs(base);
  d.centre *= base;
  d.spread *= d.kind == Distribution::Kind::LogNormal ? 1.0 : size;
  const double low = d.low * base, high = d.high * base;
  d.low = std::min(low, high);
  d.high = std::max(low, high);
  return d;
}

/// Returns the unit at the end of a path's key: "_um" is "um".
std::string unit_of_path(const std::string& path) {
  std::string last = path;
  // An index at the end belongs to the key before it.
  while (true) {
    const std::size_t dot = last.rfind('.');
    const std::string part = last.substr(dot == std::string::npos ? 0 : dot + 1);
    const bool index = !part.empty() && part.find_first_not_of("0123456789") == std::string::npos;
    if (!index || dot == std::string::npos) {
      last = part;
      break;
    }
    last = last.substr(0, dot);
  }
  const std::string_view stem = key_stem(last);
  return stem.size() < last.size() ? last.substr(stem.size() + 1) : "";
}

/// One `[[input]]`; it acts through paths, an element or a coefficient.
struct OneInput {
  std::vector<std::string> paths;
  double factor = 1.0;
  Input input;
};

const Fields<OneInput>& one_input_fields() {
  const auto of_input = [](auto member) {
    return [member](auto& one) -> auto& { return one.input.*member; };
  };
  static const Fields<OneInput> fields =
      Fields<OneInput>()
          .texts(KeyName("path").one_of("acts by"), &OneInput::paths,
                 "a value of the scene as of `--set`, or several that go together: "
                 "`\"setup.EA_urad\"`, `\"thermal.link.3.conductance_W_per_K\"`")
          .text(KeyName("element").one_of("acts by"), of_input(&Input::element),
                "`\"EXX\"`: a factor of that element as the scene has it")
          .text(
              KeyName("number").one_of("acts by"), of_input(&Input::number),
              "`\"EXX[1]\"`, `\"EXX screw pitch cos 1\"`: a number of a curve of the errors, um or "
              "urad, as `[covariance]` of a belief names it")
          .check([](TableReader& reader, OneInput& one) {
            const int ways = int(!one.paths.empty()) + int(!one.input.element.empty()) +
                             int(!one.input.number.empty());
            if (ways != 1)
              reader.refuse("path", "one of path, element (\"EXX\") and number (\"EXX[1]\")",
                            ways == 0 ? "none" : "several");
          })
          .number("factor", &OneInput::factor, any_number,
                  "what stands at the paths is `factor` times the input")
          .check([](TableReader& reader, OneInput& one) {
            if (reader.has("factor") && one.paths.empty())
              reader.refuse("factor", "a path beside it", "none");
          })
          .text(KeyName("name").otherwise("path, element or number"), of_input(&Input::name),
                "in tables and pictures")
          .number("cost", of_input(&Input::cost), positive,
                  "of the present spread; a k-th of the spread costs k times as much "
                  "(`[tolerance]`)");
  return fields;
}

enum class Every { Element, Number, Covariance };

/// One `[[inputs]]`: many inputs that are alike.
struct ManyInputs {
  Every every = Every::Element;
  std::vector<std::string> of;  ///< elements; empty: all of them
  Input like;                   ///< with the distribution and cost of each
};

const Fields<ManyInputs>& many_inputs_fields() {
  static const Fields<ManyInputs> fields =
      Fields<ManyInputs>()
          .word(
              must("every"), &ManyInputs::every,
              {{"element", Every::Element,
                "every element of the scene's errors, a factor: `centre` 0 and `spread` 1 take the "
                "machine as it is for one standard deviation"},
               {"number", Every::Number,
                "every number of their curves that is not zero; `centre`, `spread`, `low` and "
                "`high` in multiples of it"},
               {"covariance", Every::Covariance,
                "every number that a belief is not sure of, as far as its covariance says, "
                "correlations included; the scene's `errors` must be a belief"}},
              "of what inputs are made")
          .number(
              "cost", [](auto& many) -> auto& { return many.like.cost; }, positive,
              "of the present spread of each");
  return fields;
}

const Fields<ManyInputs>& many_alike_fields() {
  static const Fields<ManyInputs> fields =
      Fields<ManyInputs>()
          .texts(KeyName("of").otherwise("all"), &ManyInputs::of, "elements of the scene's errors")
          .all_of(
              [](auto& many) -> auto& { return many.like.distribution; }, distribution_fields());
  return fields;
}

bool matches_element(const ManyInputs& many, const std::string& element) {
  return many.of.empty() || std::find(many.of.begin(), many.of.end(), element) != many.of.end();
}

const Fields<double>& correlation_fields() {
  static const Fields<double> fields = Fields<double>().number(
      must("rho"), [](auto& rho) -> auto& { return rho; }, {-1.0, 1.0, false, false},
      "correlation of the normal scores of the two (a Gaussian copula)");
  return fields;
}

class InputsReader {
 public:
  InputsReader(TableReader& reader, const std::vector<Scene>& scenes)
      : reader_(reader), input_errors_(reader.input_errors()), scenes_(scenes) {}

  DeclaredInputs read();

 private:
  void read_one(const Node& node);
  void read_many(const Node& node);
  /// Returns the number that the scene of the first configuration states.
  std::optional<double> stated_at(const std::string& path) const;
  std::optional<double> nominal_at(const std::string& path) const;
  void add_covariance(const Node& node, double cost, const Priors& priors);
  void add_elements(const ManyInputs& many, const Place& place);
  void add_numbers(const ManyInputs& many, const Place& place);
  void add(Input input, const Place& place);
  void read_correlations();

  TableReader& reader_;
  InputErrors& input_errors_;
  const std::vector<Scene>& scenes_;
  DeclaredInputs stated_;
  std::map<std::string, int> index_;
  std::set<std::string> taken_;               ///< names and paths that inputs set
  std::set<std::pair<int, int>> correlated_;  ///< lower index first
};

std::optional<double> written_number(const Node& node) {
  if (const auto* whole = std::get_if<std::int64_t>(&node.value)) return double(*whole);
  if (const auto* number = std::get_if<double>(&node.value)) return *number;
  return {};
}

/// Returns a centre that no limit excludes, for an input whose centre is missing, so that no
/// further input error is reported for a number that is not in the file.
double valid_centre(const Node& input, const std::optional<double>& nominal) {
  const auto limit = [&](const char* key) {
    const Node* node = input.find(key);
    return node ? written_number(*node) : std::nullopt;
  };
  const auto low = limit("low"), high = limit("high");
  if (nominal && (!low || *nominal >= *low) && (!high || *nominal <= *high)) return *nominal;
  if (low && high) return 0.5 * (*low + *high);
  return low ? *low + 1.0 : high ? *high - 1.0 : 1.0;
}

void InputsReader::add(Input input, const Place& place) {
  if (stated_.inputs.size() == max_inputs)
    input_errors_.add(place, fmt::format("at most {} inputs", max_inputs), "more");
  if (stated_.inputs.size() >= max_inputs) return;
  if (!index_.emplace(input.name, int(stated_.inputs.size())).second)
    input_errors_.add(place, "a name for every input that no other has",
                      "\"" + input.name + "\" again");
  std::vector<std::string> sets{input.element + input.number};  // one of the two, or empty
  for (const Setting& one : input.settings) sets.push_back(one.path);
  for (const std::string& one : sets)
    if (!one.empty() && !taken_.insert(one).second)
      input_errors_.add(place, "an input of its own for " + one,
                        "\"" + input.name + "\" sets it again");
  stated_.places.push_back(place);
  stated_.inputs.push_back(std::move(input));
}

void InputsReader::read_one(const Node& node) {
  TableReader reader(node, "input", input_errors_);
  OneInput one = one_input_fields().read(reader);
  Input& input = one.input;
  const std::vector<std::string>& paths = one.paths;
  for (const std::string& path : paths) input.settings.push_back({path, one.factor});
  if (input.name.empty())
    input.name = !paths.empty() ? paths.front() : input.element + input.number;
  const bool angle = input.number.size() > 1 && input.number[1] >= 'A' && input.number[1] <= 'C';
  input.unit = !paths.empty()          ? unit_of_path(paths.front())
               : !input.number.empty() ? (angle ? "urad" : "um")
                                       : "";
  if (!reader.has("spread")) reader.missing("spread", "a number in the unit of the path's key");
  const std::optional<double> stated = paths.empty() ? std::nullopt : stated_at(paths.front());
  Distribution own;
  const bool lost = !paths.empty() && !stated && !reader.has("centre") &&
                    !paths.front().starts_with("setup.");  // a missing key of `setup` means zero
  const auto nominal =
      lost && one.factor == 1.0 ? nominal_at(paths.front()) : std::optional<double>();
  own.centre = stated && one.factor != 0.0 ? *stated / one.factor
               : lost                      ? valid_centre(node, nominal)
               : input.element.empty()     ? 0.0
                                           : 1.0;
  input.distribution = distribution_fields().read(reader, own);
  if (lost)
    stated_.missing_centres.push_back(
        {int(stated_.inputs.size()), paths.front(),
         one.factor == 1.0 ? nominal_at(paths.front()) : std::nullopt});
  reader.close();
  add(std::move(input), node.place);
}

/// Returns the number at the nominal key that belongs to a path with `actual`, as the scene of the
/// first configuration states it.
std::optional<double> InputsReader::nominal_at(const std::string& path) const {
  const std::string actual = ".actual.";
  const std::size_t at = path.find(actual);
  if (at == std::string::npos) return {};
  return stated_at(path.substr(0, at + 1) + path.substr(at + actual.size()));
}

std::optional<double> InputsReader::stated_at(const std::string& path) const {
  return scenes_.empty() ? std::nullopt : scene_number(scenes_.front(), path);
}

/// Reads the priors of coefficients that a belief does not hold: `{ EY0A_um = 20 }`, or "typical".
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
    reader.refuse("unidentified", expected, shown(*node));
    return priors;
  }
  for (const Node::Entry& entry : *node->table()) {
    const std::optional<double> spread = written_number(entry.node);
    try {
      const std::size_t unit = entry.key.rfind('_');
      const errors::ElementName name = errors::parse_element_name(entry.key.substr(0, unit));
      const bool has_unit = unit != std::string::npos &&
                            entry.key.substr(unit) == (name.is_angle() ? "_urad" : "_um");
      if (!has_unit || !spread || !(*spread >= 0.0 && *spread <= 1e6))
        reader.input_errors().add(entry.place, expected + ", of 0 to 1e6",
                                  entry.key + " = " + shown(entry.node));
      else
        priors.spread[errors::to_string(name)] = *spread;
    } catch (const std::invalid_argument&) {
      reader.input_errors().add(entry.place, expected, entry.key);
    }
  }
  return priors;
}

/// Adds the coefficients of a belief with their standard uncertainties and correlations, and those
/// that it does not hold with their priors.
void InputsReader::add_covariance(const Node& node, double cost, const Priors& priors) {
  if (scenes_.empty()) return;
  if (scenes_.front().geometric.covariance.of.empty()) {
    input_errors_.add(node.place, "errors with a covariance, as `abbe identify` writes them",
                      "errors that are taken as they stand");
    return;
  }
  BeliefInputs belief;
  try {
    belief = belief_inputs(scenes_.front(), priors);
  } catch (const std::invalid_argument& fault) {
    input_errors_.add(node.place, "priors of what was not identified", fault.what());
    return;
  }
  const int before = int(stated_.inputs.size());
  for (Input& input : belief.inputs) {
    input.cost = cost;
    add(std::move(input), node.place);
  }
  const Eigen::MatrixXd& S = belief.covariance;
  for (Eigen::Index a = 0; a < S.rows(); ++a)
    for (Eigen::Index b = 0; b < a; ++b) {
      // Rounding may exceed 1 slightly.
      const double rho = S(a, b) / std::sqrt(S(a, a) * S(b, b));
      if (rho == 0.0) continue;
      stated_.correlations.push_back(
          {before + int(a), before + int(b), std::clamp(rho, -1.0, 1.0)});
      correlated_.emplace(before + int(b), before + int(a));
    }
  stated_.unidentified = std::move(belief.unidentified);
  stated_.completion = std::move(belief.completion);
}

void InputsReader::read_many(const Node& node) {
  TableReader reader(node, "inputs", input_errors_);
  ManyInputs many = many_inputs_fields().read(reader);
  if (many.every == Every::Covariance) {
    const Priors priors = read_priors(reader);
    reader.close();
    add_covariance(node, many.like.cost, priors);
    return;
  }
  many = many_alike_fields().read(reader, std::move(many));
  reader.close();
  if (scenes_.empty()) return;
  std::set<std::string> known;
  for (const errors::Element& element : scenes_.front().geometric.elements)
    known.insert(errors::to_string(element.name));
  for (const std::string& name : many.of)
    if (!known.count(name))
      reader.refuse("of", "elements that the scene has", with_suggestion(name, known));
  if (many.every == Every::Element)
    add_elements(many, node.place);
  else
    add_numbers(many, node.place);
}

void InputsReader::add_elements(const ManyInputs& many, const Place& place) {
  for (const errors::Element& element : scenes_.front().geometric.elements) {
    const std::string name = errors::to_string(element.name);
    if (matches_element(many, name))
      add({name, "", {}, name, "", many.like.distribution, many.like.cost}, place);
  }
}

void InputsReader::add_numbers(const ManyInputs& many, const Place& place) {
  const std::vector<errors::Element>& elements = scenes_.front().geometric.elements;
  const Eigen::VectorXd values = errors::values(elements);
  Eigen::Index at = 0;
  for (const errors::Coefficient& one : errors::coefficients(elements)) {
    const errors::Element& element = elements[std::size_t(one.element)];
    const bool angle = element.name.is_angle();
    const double base = values[at++] / (angle ? units::urad : units::um);
    if (!matches_element(many, errors::to_string(element.name)) || base == 0.0)
      continue;  // mostly fixed to zero by a convention
    const std::string name = errors::name_of(one, elements);
    const Distribution own = scaled(many.like.distribution, base);
    if (const char* fault = distribution_error(own))
      input_errors_.add(place, fmt::format("{}, {} {} being its unit", fault, name, base),
                        fmt::format("centre {}, spread {}, from {} to {}", own.centre, own.spread,
                                    own.low, own.high));
    add({name, angle ? "urad" : "um", {}, "", name, own, many.like.cost}, place);
  }
}

void InputsReader::read_correlations() {
  for (const Node* node : reader_.tables("correlation")) {
    TableReader reader(*node, "correlation", input_errors_);
    const int a = input_named(reader, "first", stated_.inputs);
    const int b = input_named(reader, "second", stated_.inputs);
    const double rho = correlation_fields().read(reader);
    reader.close();
    if (!input_errors_.empty()) continue;
    const auto name = [&](int i) { return stated_.inputs[std::size_t(i)].name; };
    if (a == b) reader.refuse("second", "another input than the first", name(b));
    if (!correlated_.insert(std::minmax(a, b)).second)
      input_errors_.add(node->place, "every pair of inputs once",
                        name(a) + " and " + name(b) + " again");
    stated_.correlations.push_back({a, b, rho});
  }
}

DeclaredInputs InputsReader::read() {
  for (const Node* node : reader_.tables("input")) read_one(*node);
  for (const Node* node : reader_.tables("inputs")) read_many(*node);
  read_correlations();
  return std::move(stated_);
}

}  // namespace

std::optional<double> scene_number(const Scene& scene, const std::string& path) {
  const Node* node = scene.tree.get();
  for (std::size_t from = 0; node && from <= path.size();) {
    const std::size_t dot = std::min(path.find('.', from), path.size());
    const std::string part = path.substr(from, dot - from);
    const Node::Array* list = node->array();
    // Seven digits are more than any list has, and stoi of more could overflow.
    const bool index = !part.empty() && part.find_first_not_of("0123456789") == std::string::npos;
    if (list && index && part.size() < 7 && std::size_t(std::stoi(part)) < list->size())
      node = &(*list)[std::size_t(std::stoi(part))];
    else
      node = list ? nullptr : node->find(part);
    from = dot + 1;
  }
  return node ? written_number(*node) : std::nullopt;
}

DeclaredInputs read_inputs(TableReader& reader, const std::vector<Scene>& scenes) {
  return InputsReader(reader, scenes).read();
}

std::vector<Key> one_input_keys() {
  std::vector<Key> keys = one_input_fields().keys();
  for (Key& key : distribution_fields().keys()) keys.push_back(std::move(key));
  return keys;
}

std::vector<Key> many_inputs_keys() {
  std::vector<Key> keys = many_inputs_fields().keys(), alike = many_alike_fields().keys();
  Key priors =
      make_key("unidentified", Key::Kind::Any,
               "standard deviations of elements that the belief does not hold, "
               "`{ EY0A_um = 20, EAX_urad = 10 }`, or `\"typical\"`: 20 um and 20 urad of "
               "offsets, squareness and parallelism, 5 um and 15 urad of error motions (the "
               "k-th order of a curve a k-th of it), 5 um and 10 urad of the nose. What has "
               "none is left out of every figure, which a warning says");
  for (Word& word : keys.front().words)
    word.keys = word.word == "covariance" ? std::vector<Key>{priors} : alike;
  return keys;
}

std::vector<Key> correlation_keys() {
  return {make_key(must("first"), Key::Kind::Text, "name of an input"),
          make_key(must("second"), Key::Kind::Text, "of another; every pair once"),
          correlation_fields().keys().front()};
}

}  // namespace abbe::sim::study
