#pragma once

#include <vector>

#include "errors/covariance.h"
#include "errors/element.h"
#include "sim/scene/key.h"
#include "sim/scene/table_reader.h"

/// `covariance` of an errors table: how well its numbers are known.
namespace abbe::sim {

/// @param elements  whose numbers it names
errors::Covariance read_covariance(const Node& table, const std::vector<errors::Element>& elements,
                                   Faults& faults);
Node::Table written_covariance(const errors::Covariance& covariance,
                               const std::vector<errors::Element>& elements);
std::vector<Key> covariance_keys();

}  // namespace abbe::sim
