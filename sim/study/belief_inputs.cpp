#include "sim/study/belief_inputs.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "errors/coefficients.h"
#include "errors/identification/model.h"
#include "kinematics/units.h"
#include "sim/machine/compile.h"
#include "sim/scene/unidentified.h"

namespace abbe::sim::study {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using errors::identification::typical_deviation;

std::string element_of_number(const std::string& number) {
  return number.substr(0, number.find_first_of(" ["));
}

bool is_angle(const std::string& number) {
  return errors::parse_element_name(element_of_number(number)).is_angle();
}

/// Elements that an identification may find and the belief lacks, at zero. None of a machine whose
/// slides have no stated travel.
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

/// What the belief knows: inputs with their covariance.
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
    if (!(known.matrix(i, i) > 0.0)) continue;  // zero by convention
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

/// What has a prior: an input each, along which the numbers that hide it go back.
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

}  // namespace abbe::sim::study
