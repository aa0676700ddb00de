#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "errors/metrology/position_set.h"

namespace abbe::errors::metrology {

/// Reads a table with a head, cells parted by commas or semicolons, in one of two forms.
/// One reading a row: `target_mm,direction,run,deviation_um`, columns in any order; the target in
/// mm, deg or rad; the reading as deviation_nm, _um, _mm, _urad, _arcsec, _deg, _rad (actual minus
/// target) or position_mm, _deg, _rad; the direction `up`, `down`, `+` or `-`; runs numbered
/// from 1. One row a target and direction: `target_mm,dir,j1,j2,j3`, where j1 .. are positions in
/// the unit of the target, or `j1_um` .. deviations with any unit above. Both may have a column
/// `set` (each set is a result, in the order of the file) and a column `pos` (the number of the
/// target, not looked at). A number has a decimal point. Every run of a set has every target once.
/// Lines that begin with # and empty ones are passed over.
/// @param file  what refusals call it
/// @throws BadInput with line and column for anything else
std::vector<PositionSet> read_position_csv(std::string_view text, const std::string& file,
                                           const PositionFileOptions& options = {});

}  // namespace abbe::errors::metrology
