#pragma once

#include <string>
#include <string_view>

#include "errors/metrology/position_set.h"

namespace abbe::errors::metrology {

/// Reads a position file of Renishaw's laser software (.rtl), linear measurement. Its maker
/// publishes no layout; this is what programs that read or write such files agree on:
///   HEADER::       File type, Owner, Version no; the owner is `Linear`
///   TARGET DATA::  Filetype, Target-count, then `Targets :` and as many numbers, mm, five a line;
///                  Flags
///   USER-TEXT::    Machine, Serial No, Date, By, Axis, Location, TITLE
///   RUNS::         Run-count
///   DEVIATIONS::   `Run Target Data:` and a row `run target deviation` for each reading; runs and
///                  targets count from 1, deviations are measured minus target in um
///   EOF::
/// Rows stand in the order in which they were read, so a run whose targets go up is an approach in
/// the positive direction. Sections of other names (ENVIRONMENT, EQUIPMENT) are passed over. Not
/// known and therefore refused: owners other than Linear, whose unit nobody states. Not known and
/// not looked at: what Filetype and Flags mean; one program writes a second flag of 1 for runs
/// in one direction and fills the runs back with zeros, so such runs of nothing but zeros are left
/// out there.
/// @throws BadInput with line and column for anything else
PositionSet read_rtl(std::string_view text, const std::string& file,
                     const PositionFileOptions& options = {});

}  // namespace abbe::errors::metrology
