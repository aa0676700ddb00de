#pragma once

#include <filesystem>
#include <vector>

#include "sim/cut/program_inspection.h"
#include "sim/files/output.h"
#include "sim/report/verdict.h"

/// Pictures and VTK files of results. In a program built without VTK the pictures of a run are
/// skipped; a picture requested on the command line is an input error.
namespace abbe::sim {

/// Returns true if this program was built with VTK.
bool can_draw_pictures();

/// Returns a warning if the font that a text needs is not installed; empty otherwise, or without
/// VTK.
std::string font_warning(const std::string& text);

/// Writes `residual.png` and `histogram.png` of a case, and `tolerance.png` if it has a tolerance.
/// @param progress  shows one stage, "draw"
/// @throws OutputFailure, Interrupted
void write_case_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                         const Progress& progress = {});

/// Returns a PNG file of the map of a case, compressed for small size; empty if the program was
/// built without VTK.
/// @param width  px
std::string map_png(const Job& job, const Verdict& verdict, int width);

/// Writes `stock.vtp` and `stock.png` of a case with stock, coloured by its deviation,
/// `temperatures.png` of a case with heat, and `EXX-temperatures.png` of every element that the
/// scene plots. Files of an earlier run that this case does not have are removed.
void write_source_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict);

/// Draws the maps of all cases with their figures on a common symmetric colour scale.
/// @param progress  shows one stage, "compare"
void write_comparison_picture(const ResultFile& file, const Scene& scene,
                              const std::vector<ComparedCase>& cases,
                              const Progress& progress = {});

/// Writes the picture of `abbe check --picture`: machine, part and path with magnified errors.
/// @throws BadInput, OutputFailure
void write_check_picture(const ResultFile& file, const Job& job);

/// Writes `collision.png`, the machine at the first collision or, without collisions, at the
/// smallest distance of two bodies, with these two in red, and `clearance.png`, the smallest
/// clearance over the program. A picture without data is removed.
/// @throws OutputFailure; BadInput if the program was built without pictures
void write_collision_pictures(const ResultFolder& folder, const Job& job,
                              const Collisions& collisions);

/// Writes the picture of `abbe program --picture`: machine and path of a program.
/// @throws BadInput, OutputFailure
void write_program_picture(const ResultFile& file, const ProgramInspection& inspection);

}  // namespace abbe::sim
