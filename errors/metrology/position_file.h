#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "errors/metrology/positioning.h"

namespace abbe::errors::metrology {

/// Position readings of one axis, as stored in a file.
struct PositionSet {
  std::string name;     ///< of the set, of the test or of the axis; may be empty
  bool rotary = false;  ///< true: targets and deviations are rad; false: mm
  PositionRuns runs;
};

/// Limits of a position file.
struct PositionFileOptions {
  std::size_t max_bytes = std::size_t(16) << 20;  ///< longer texts are rejected
  std::size_t max_readings = 1000000;             ///< per file
};

/// Reads a table with a header and cells separated by commas or semicolons, in one of two formats.
/// One reading per row: `target_mm,direction,run,deviation_um`, columns in any order. The target is
/// in mm, deg or rad; the reading is deviation_nm, _um, _mm, _urad, _arcsec, _deg, _rad (actual
/// minus target) or position_mm, _deg, _rad; the direction is `up`, `down`, `+` or `-`; runs count
/// from 1.
/// One row per target and direction: `target_mm,dir,j1,j2,j3`, where j1 .. are positions in
/// the unit of the target, or `j1_um` .. deviations in any unit above.
/// Both formats may have a column `set` (each set is a result, in the order of the file) and a
/// column `pos` (the number of the target, ignored). The decimal separator is a point. Every run of
/// a set must contain every target exactly once. Lines that begin with # and empty lines are
/// skipped.
/// @param file  name in input errors
/// @throws BadInput with line and column for anything else
std::vector<PositionSet> read_position_csv(std::string_view text, const std::string& file,
                                           const PositionFileOptions& options = {});

/// Reads a position file of Renishaw's laser software (.rtl), linear measurement. The vendor
/// publishes no layout; the following is common to programs that read or write such files:
///   HEADER::       File type, Owner, Version no; the owner is `Linear`
///   TARGET DATA::  Filetype, Target-count, then `Targets :` followed by that many numbers in mm,
///                  five per line; Flags
///   USER-TEXT::    Machine, Serial No, Date, By, Axis, Location, TITLE
///   RUNS::         Run-count
///   DEVIATIONS::   `Run Target Data:` and a row `run target deviation` for each reading; runs and
///                  targets count from 1, deviations are measured minus target in um
///   EOF::
/// Rows are in the order of measurement, so a run with ascending targets is an approach in the
/// positive direction. Other sections (ENVIRONMENT, EQUIPMENT) are skipped. Owners other than
/// Linear are rejected, since their unit is not documented. Filetype and Flags are not
/// documented and are ignored, with one exception: one program writes a second flag of 1 for runs
/// in one direction and fills the backward runs with zeros. In such a file, backward runs that
/// contain only zeros are removed.
/// @throws BadInput with line and column for anything else
PositionSet read_position_rtl(std::string_view text, const std::string& file,
                              const PositionFileOptions& options = {});

/// Reads either format. A text that begins with HEADER:: is an .rtl file.
/// @throws BadInput as `read_position_csv` and `read_position_rtl`
std::vector<PositionSet> read_positions(std::string_view text, const std::string& file,
                                        const PositionFileOptions& options = {});

}  // namespace abbe::errors::metrology
