#pragma once

#include <string>
#include <utility>
#include <vector>

#include "sim/scene/key.h"
#include "sim/scene/table_reader.h"

/// `unidentified` of an errors table: numbers that the readings behind a belief do not determine.
namespace abbe::sim {

/// A number that stands at 0 because readings could not tell it.
struct UnidentifiedNumber {
  std::string number;  ///< "EY0A", "EAX[1]"
  /// Numbers that took on so much (um or urad) of each unit (um or urad) by which it is not 0.
  std::vector<std::pair<std::string, double>> hidden_by;
};

/// Returns those that an errors table names, of a list of tables all together. What is malformed is
/// left out: it is reported where the table is read.
std::vector<UnidentifiedNumber> unidentified_numbers(const Node& errors);

/// Checks the key where an errors table is read.
void read_unidentified(TableReader& reader);
Key unidentified_key();

/// One line a number, as a belief file has it.
std::string unidentified_text(const std::vector<UnidentifiedNumber>& numbers);

}  // namespace abbe::sim
