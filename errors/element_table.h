#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "errors/element.h"

/// Tables of error motions in the format of volumetric compensation, and their conversion to
/// elements.
namespace abbe::errors {

/// Error motions of one axis, sampled at common positions, as in a compensation table of a control.
struct ElementTable {
  char axis = 'X';
  Eigen::VectorXd q;                  ///< (n) mm or rad, strictly increasing, n >= 2
  std::vector<ElementName> elements;  ///< (m) of that axis, error motions only
  Eigen::MatrixXd values;             ///< (n x m) mm or rad
};

/// Default limit of the size of an element table, 64 MiB.
inline constexpr std::size_t max_element_table_bytes = std::size_t(64) << 20;

/// Reads the table format of volumetric compensation: a header `X EXX EYX EZX EAX EBX ECX` (any of
/// the six, in any order), then one row per position; cells separated by commas, semicolons, or
/// blanks and tabs, as in the header. Positions are mm, of A B C S degrees; values mm and rad. The
/// header may state units: X_mm, C_deg, C_rad, EXX_mm, EXX_um, EAX_rad, EAX_urad. LF or CR LF; a
/// byte order mark, empty lines and lines that begin with # are skipped.
/// Source: ISG kernel / Beckhoff TF5280, volumetric compensation.
/// @param file       name in input errors
/// @param max_bytes  longer texts are rejected without being read
/// @throws BadInput with line and column, for anything else
ElementTable read_element_table(std::string_view text, const std::string& file,
                                std::size_t max_bytes = max_element_table_bytes);

/// Reads a table from a file, as `read_element_table`.
/// @throws BadInput also if the file is not a readable regular file
ElementTable read_element_table_file(const std::filesystem::path& file,
                                     std::size_t max_bytes = max_element_table_bytes);

/// Writes the table in the format of `read_element_table` with the default units and the fewest
/// digits that read back to the same bits. A rotary position that no number of degrees represents
/// exactly reads back within one ulp.
/// @throws std::invalid_argument if the shapes do not match
std::string write_element_table(const ElementTable& table, char separator = ',');

/// Options for the conversion of the columns of a table to elements.
struct ElementConversionOptions {
  TableInterpolation between = TableInterpolation::Linear;
  TableExtrapolation outside = TableExtrapolation::Refuse;
  Argument argument = Argument::Command;  ///< quantity of the positions
  bool negate = false;                    ///< true if the values have the opposite sign
  std::string name;                       ///< name of every curve, for reports
};

/// Returns one element per column, each with one curve.
/// @throws std::invalid_argument as make_table
std::vector<Element> to_elements(const ElementTable& table,
                                 const ElementConversionOptions& use = {});

}  // namespace abbe::errors
