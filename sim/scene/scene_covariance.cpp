#include "sim/scene/scene_covariance.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "errors/coefficients.h"
#include "kinematics/symmetric.h"
#include "kinematics/units.h"
#include "sim/scene/fields.h"

namespace abbe::sim {

namespace {

using Eigen::Index;
using Eigen::VectorXd;
using errors::Element;

/// The matrix as a file has it.
struct Uncertainties {
  std::vector<errors::Coefficient> of;  ///< (m)
  VectorXd sigma;                       ///< (m) um or urad
  std::optional<VectorXd> correlation;  ///< (m (m - 1) / 2) lower triangle, row by row
};

double unit_of_number(const errors::Coefficient& number, const std::vector<Element>& elements) {
  return elements[std::size_t(number.element)].name.is_angle() ? units::urad : units::um;
}

std::vector<errors::Coefficient> known_numbers(TableReader& reader, const Node& of,
                                               const std::vector<Element>& elements) {
  std::map<std::string, errors::Coefficient> known;
  std::set<std::string> names;
  for (const errors::Coefficient& one : errors::coefficients(elements)) {
    known.emplace(errors::name_of(one, elements), one);
    names.insert(errors::name_of(one, elements));
  }
  std::vector<errors::Coefficient> numbers;
  if (!of.array()) reader.refuse("of", "a list of names such as \"EXX[1]\"", shown(of));
  for (const Node& name : of.array() ? *of.array() : Node::Array{}) {
    const auto found = name.text() ? known.find(*name.text()) : known.end();
    if (found == known.end()) {
      const auto meant = name.text() ? nearest(*name.text(), names) : std::nullopt;
      reader.faults().add(name.place, "a number of this file's curves such as \"EXX[1]\"",
                          shown(name) + (meant ? " (did you mean " + *meant + "?)" : ""));
      continue;
    }
    if (std::find(numbers.begin(), numbers.end(), found->second) != numbers.end())
      reader.faults().add(name.place, "each number once", shown(name) + " again");
    numbers.push_back(found->second);
  }
  return numbers;
}

Fields<Uncertainties> covariance_fields(const std::vector<Element>& elements) {
  const auto read_of = [elements](TableReader& reader, Uncertainties& to) {
    const Node* of = reader.know("of");
    if (!of) reader.missing("of", "a list of names such as \"EXX[1]\"");
    if (of) to.of = known_numbers(reader, *of, elements);
  };
  const auto write_of = [elements](const Uncertainties& from, Node::Table& to) {
    Node::Array names;
    for (const errors::Coefficient& one : from.of)
      names.push_back(Node{{}, errors::name_of(one, elements)});
    put(to, "of", std::move(names));
  };
  const auto read_matrix = [](TableReader& reader, Uncertainties& to) {
    const int m = int(to.of.size());
    to.sigma = reader.numbers("standard_uncertainty_um_urad", m);
    if (m > 1) to.correlation = reader.maybe_numbers("correlation", m * (m - 1) / 2);
  };
  const auto write_matrix = [](const Uncertainties& from, Node::Table& to) {
    put_numbers(to, "standard_uncertainty_um_urad", from.sigma, 1.0);
    if (from.correlation) put_numbers(to, "correlation", *from.correlation, 1.0);
  };
  return Fields<Uncertainties>()
      .custom({key_of(must("of"), Key::Kind::Texts,
                      "numbers of the file's curves: `EXX[2]` (order, or row of a table), `EXC cos "
                      "1`, `EXX backlash`, `EC0Y`; of a named curve among several `EXX screw pitch "
                      "cos 1`")},
              read_of, write_of)
      .custom({key_of(must("standard_uncertainty_um_urad"), Key::Kind::Numbers,
                      "one for each, >= 0, in um or urad as its element is; 0: zero by convention"),
               key_of(KeyName("correlation").otherwise("none"), Key::Kind::Numbers,
                      "lower triangle without the diagonal, row by row, m (m - 1)/2 numbers; a "
                      "negative variance is refused")},
              read_matrix, write_matrix);
}

}  // namespace

errors::Covariance read_covariance(const Node& table, const std::vector<Element>& elements,
                                   Faults& faults) {
  TableReader reader(table, "errors.covariance", faults);
  const std::size_t before = faults.list().size();
  auto [of, sigma, correlation] = covariance_fields(elements).read(reader);
  reader.close();
  if (faults.list().size() != before) return {};
  if ((sigma.array() < 0.0).any())
    reader.refuse("standard_uncertainty_um_urad", "numbers >= 0", "a negative one");
  const auto m = Index(of.size());
  for (Index i = 0; i < m; ++i) sigma[i] *= unit_of_number(of[std::size_t(i)], elements);
  Eigen::MatrixXd R = Eigen::MatrixXd::Identity(m, m);
  Index at = 0;
  for (Index i = 0; i < m && correlation; ++i)
    for (Index k = 0; k < i; ++k) R(i, k) = R(k, i) = (*correlation)[at++];
  if (eigenvalues(R)[0] < -1e-9 * double(m))
    reader.refuse("correlation", "a correlation that can be (no negative variance)", "another");
  return {std::move(of), sigma.asDiagonal() * R * sigma.asDiagonal()};
}

Node::Table written_covariance(const errors::Covariance& covariance,
                               const std::vector<Element>& elements) {
  const auto m = Index(covariance.of.size());
  const VectorXd sigma = covariance.matrix.diagonal().cwiseSqrt();
  Uncertainties written{covariance.of, sigma, std::nullopt};
  for (Index i = 0; i < m; ++i)
    written.sigma[i] /= unit_of_number(covariance.of[std::size_t(i)], elements);
  VectorXd correlation = VectorXd::Zero(m * (m - 1) / 2);
  Index at = 0;
  for (Index i = 0; i < m; ++i) {
    for (Index k = 0; k < i; ++k, ++at) {
      const double most = sigma[i] * sigma[k];
      if (most > 0.0) correlation[at] = covariance.matrix(i, k) / most;
    }
  }
  if (!correlation.isZero(0.0)) written.correlation = std::move(correlation);
  return covariance_fields(elements).written(written);
}

std::vector<Key> covariance_keys() { return covariance_fields({}).keys(); }

}  // namespace abbe::sim
