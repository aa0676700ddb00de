#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "errors/element.h"

namespace abbe::errors {

/// Error motions of one axis, sampled together, as a control's table holds them.
struct ElementTable {
  char axis = 'X';
  Eigen::VectorXd q;                  ///< (n) mm or rad, strictly increasing, n >= 2
  std::vector<ElementName> elements;  ///< (m) of that axis, none of them a location error
  Eigen::MatrixXd values;             ///< (n x m) mm or rad
};

struct ElementTableOptions {
  std::size_t max_bytes = std::size_t(64) << 20;  ///< longer texts are refused unread
};

/// Reads the table form of volumetric compensation: a head `X EXX EYX EZX EAX EBX ECX` (any of the
/// six, in any order), then one row a position; cells parted by commas, semicolons, or blanks and
/// tabs, whichever the head has. Positions are mm, of A B C S degrees; values mm and rad. A head
/// may say units: X_mm, C_deg, C_rad, EXX_mm, EXX_um, EAX_rad, EAX_urad. LF or CRLF; a byte order
/// mark, empty lines and lines that begin with # are passed over.
/// Source: ISG kernel / Beckhoff TF5280, volumetric compensation.
/// @param file  what refusals call it
/// @throws BadInput with line and column, for anything else
ElementTable read_element_table(std::string_view text, const std::string& file,
                                const ElementTableOptions& options = {});

/// The same from a file. @throws BadInput also if it is no readable regular file
ElementTable read_element_table_file(const std::filesystem::path& file,
                                     const ElementTableOptions& options = {});

/// Writes that form, units as in a head without them, with the fewest digits that read back the
/// same bits; a rotary position that no number of degrees gives exactly reads back within one ulp.
/// @throws std::invalid_argument if the shapes do not fit each other
std::string write_element_table(const ElementTable& table, char separator = ',');

/// How the columns of a table are taken as elements.
struct TableUse {
  Between between = Between::Linear;
  Outside outside = Outside::Refuse;
  Argument argument = Argument::Command;  ///< what its positions are
  bool negate = false;                    ///< its values count the other way
  std::string name;                       ///< of every curve, for reports
};

/// One element a column, each of one curve. @throws std::invalid_argument as make_table
std::vector<Element> elements_of(const ElementTable& table, const TableUse& use = {});

}  // namespace abbe::errors
