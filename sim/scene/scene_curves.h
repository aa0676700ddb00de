#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "errors/element_table.h"
#include "sim/scene/fields.h"

/// The curves of error elements in a scene, and what tables of other sections share with them.
namespace abbe::sim {

/// Units in which an element is written: "_um" or "_urad" of its value, "_mm" or "_deg" of its
/// axis.
struct ElementUnits {
  std::string value;
  std::string position;
};

/// A curve, and the line that is to be taken out of its table.
struct CurveAsWritten {
  errors::Curve curve;
  std::optional<errors::Detrend> detrend;
};

/// @param name  of the element, which is also the column of a file
/// @param seed  of a random curve that has none of its own
Fields<CurveAsWritten> curve_fields(const errors::ElementName& name, const ElementUnits& units,
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

}  // namespace abbe::sim
