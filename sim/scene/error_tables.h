#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "errors/coefficients.h"
#include "errors/element.h"
#include "errors/element_table.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"

/// The curves of error elements in a scene, and what tables of other sections share with them.
namespace abbe::sim {

/// Units in which an element is written: "_um" or "_urad" of its value, "_mm" or "_deg" of its
/// axis.
struct ElementUnits {
  std::string value;
  std::string position;
};

/// A curve, and the line that is to be taken out of its table.
struct CurveEntry {
  errors::Curve curve;
  std::optional<errors::Detrend> detrend;
};

/// @param name  of the element, which is also the column of a file
/// @param seed  of a random curve that has none of its own
Fields<CurveEntry> curve_fields(const errors::ElementName& name, const ElementUnits& units,
                                std::uint64_t seed);

/// Keys of a curve of any element.
std::vector<Key> curve_keys();

/// `file`, a table in the form of volumetric compensation; none if it is missing or refused.
std::optional<errors::ElementTable> read_table_file(TableReader& reader);
Key table_file_key();

/// `between` and `outside`.
template <typename T>
Fields<T> interpolation_fields() {
  return Fields<T>()
      .word("between", &T::between,
            {{"linear", errors::Between::Linear},
             {"spline", errors::Between::Spline, "natural cubic"}},
            "how the table is read between its rows")
      .word("outside", &T::outside,
            {{"refuse", errors::Outside::Refuse, "a program that leaves the table is refused"},
             {"hold", errors::Outside::Hold, "the value of its first or last row"}},
            "what the table says beyond its range");
}

/// `argument` and `negate`.
template <typename T>
Fields<T> argument_fields() {
  return Fields<T>()
      .word("argument", &T::argument,
            {{"command", errors::Argument::Command},
             {"carriage", errors::Argument::Carriage,
              "its own travel, the negative of the command on a primed axis"}},
            "position of the axis on which the values depend")
      .boolean("negate", &T::negate, "the source counted the values the other way");
}

/// `detrend`.
template <typename T>
Fields<T> detrend_fields() {
  return Fields<T>().word(
      "detrend", &T::detrend,
      {{"ends", errors::Detrend::Ends, "the line through the first and the last row"},
       {"lsq", errors::Detrend::LeastSquares, "the fitted line"}},
      "takes the straight line out of a straightness of a slide; its slope becomes the squareness "
      "of the two slides, its offset is dropped");
}

// `covariance` of an errors table: how well its numbers are known.

/// @param elements  whose numbers it names
errors::Covariance read_covariance(const Node& table, const std::vector<errors::Element>& elements,
                                   InputErrors& input_errors);
Node::Table written_covariance(const errors::Covariance& covariance,
                               const std::vector<errors::Element>& elements);
std::vector<Key> covariance_keys();

// `unidentified` of an errors table: numbers that the readings behind a belief do not determine.

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
std::string unidentified_lines(const std::vector<UnidentifiedNumber>& numbers);

}  // namespace abbe::sim
