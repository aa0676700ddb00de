#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "errors/metrology/positioning.h"

namespace abbe::errors::metrology {

/// Readings of one axis as a file holds them.
struct PositionSet {
  std::string name;     ///< of the set, of the test or of the axis; may be empty
  bool rotary = false;  ///< targets and deviations are rad, not mm
  PositionRuns runs;
};

struct PositionFileOptions {
  std::size_t max_bytes = std::size_t(16) << 20;  ///< longer texts are refused unread
  std::size_t max_readings = 1000000;             ///< of one file
};

inline constexpr int max_runs = 10000;

/// One reading as a deviation, and where it stands.
struct PositionReading {
  bool up = true;
  int run = 1;
  double target = 0.0;
  double deviation = 0.0;
  int line = 0;

  auto order() const { return std::tuple(up, run, target); }
};

/// Every run of a direction must have every target once.
/// @throws BadInput where one is missing or comes twice
PositionRuns assemble_runs(std::vector<PositionReading> all, const std::string& file);

/// @throws BadInput if the text is too long
void check_size(std::string_view text, const std::string& file, const PositionFileOptions& options);

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
PositionSet read_position_rtl(std::string_view text, const std::string& file,
                              const PositionFileOptions& options = {});

/// Either form: a text that begins with HEADER:: is an .rtl. @throws BadInput as these
std::vector<PositionSet> read_positions(std::string_view text, const std::string& file,
                                        const PositionFileOptions& options = {});

/// The same from a file.
/// @throws BadInput also if it is no readable regular file
std::vector<PositionSet> read_position_file(const std::filesystem::path& file,
                                            const PositionFileOptions& options = {});

}  // namespace abbe::errors::metrology
