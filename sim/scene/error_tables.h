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

/// Fields of the curves of error elements, some of them shared with other sections of a scene.
namespace abbe::sim {

/// Unit suffixes of the keys of an element: "_um" or "_urad" for its value, "_mm" or "_deg" for the
/// position of its axis.
struct ElementUnits {
  std::string value;
  std::string position;
};

/// A curve, and the method by which a straight line is removed from its table, if any.
struct CurveEntry {
  errors::Curve curve;
  std::optional<errors::Detrend> detrend;
};

/// Returns the fields of a curve.
/// @param name  element; a file has a column of this name
/// @param seed  seed of a random curve that states none
Fields<CurveEntry> curve_fields(const errors::ElementName& name, const ElementUnits& units,
                                std::uint64_t seed);

/// Returns the keys that a curve may have, of all elements together.
std::vector<Key> curve_keys();

/// Reads the table that the key `file` names, in the format of volumetric compensation. Returns
/// nothing if the key is missing or the table has input errors.
std::optional<errors::ElementTable> read_element_csv(TableReader& reader);
Key table_file_key();

/// Returns the fields `between` and `outside`.
template <typename T>
Fields<T> interpolation_fields() {
  return Fields<T>()
      .choice("between", &T::between,
              {{"linear", errors::TableInterpolation::Linear},
               {"spline", errors::TableInterpolation::Spline, "natural cubic"}},
              "interpolation between the rows of the table")
      .choice("outside", &T::outside,
              {{"refuse", errors::TableExtrapolation::Refuse,
                "a program that leaves the table is rejected"},
               {"hold", errors::TableExtrapolation::Hold, "the value of its first or last row"}},
              "values beyond the range of the table");
}

/// Returns the fields `argument` and `negate`.
template <typename T>
Fields<T> argument_fields() {
  return Fields<T>()
      .choice("argument", &T::argument,
              {{"command", errors::Argument::Command},
               {"carriage", errors::Argument::Carriage,
                "the travel of the carriage itself, the negative of the command on a primed axis"}},
              "position of the axis on which the values depend")
      .boolean("negate", &T::negate, "true: the source states the values with the opposite sign");
}

/// Returns the field `detrend`.
template <typename T>
Fields<T> detrend_fields() {
  return Fields<T>().choice(
      "detrend", &T::detrend,
      {{"ends", errors::Detrend::Ends, "the line through the first and the last row"},
       {"lsq", errors::Detrend::LeastSquares, "the fitted line"}},
      "removes the straight line from a straightness of a slide; its slope becomes the squareness "
      "of the two slides, its offset is dropped");
}

// The key `covariance` of an errors table states the uncertainty of its numbers.

/// Reads the key `covariance`.
/// @param elements  elements whose numbers it names
errors::Covariance read_covariance(const Node& table, const std::vector<errors::Element>& elements,
                                   InputErrors& input_errors);
Node::Table covariance_to_table(const errors::Covariance& covariance,
                                const std::vector<errors::Element>& elements);
std::vector<Key> covariance_keys();

// The key `unidentified` of an errors table lists numbers that the readings behind a belief do not
// determine.

/// A number that was set to 0 because the readings could not determine it.
struct UnidentifiedNumber {
  std::string number;  ///< "EY0A", "EAX[1]"
  /// The numbers that absorbed it. The factor is the change of such a number, in um or urad, per um
  /// or urad of the unidentified one.
  std::vector<std::pair<std::string, double>> hidden_by;
};

/// Returns the unidentified numbers of an errors table, or of all tables of a list. Invalid entries
/// are skipped, because read_unidentified() reports them.
std::vector<UnidentifiedNumber> unidentified_numbers(const Node& errors);

/// Reports invalid entries of the key while an errors table is read.
void read_unidentified(TableReader& reader);
Key unidentified_key();

/// Returns the key as text for a belief file, one line per number; empty without numbers.
std::string unidentified_lines(const std::vector<UnidentifiedNumber>& numbers);

}  // namespace abbe::sim
