#pragma once

#include <filesystem>
#include <vector>

#include "sim/cut/program_inspection.h"
#include "sim/files/output.h"
#include "sim/report/verdict.h"

/// Pictures and VTK files of results. If the program was built without VTK, the pictures of a run
/// are skipped, and pictures requested by name are input errors.
namespace abbe::sim {

/// Returns true if this program was built with VTK.
bool can_draw_pictures();

/// Returns a warning if a font is missing to draw a text; empty if none is, or nothing is drawn.
std::string font_warning(const std::string& text);

/// Writes `residual.png` and `histogram.png` of a case, and `tolerance.png` if it has a tolerance.
/// @param progress  shows one stage, "draw"
/// @throws OutputFailure, Interrupted
void write_case_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                         const Progress& progress = {});

/// Returns a PNG file of the map of a case, small in bytes; empty if the program was built without
/// VTK.
/// @param width  px
std::string map_png(const Job& job, const Verdict& verdict, int width);

/// Writes `stock.vtp` and `stock.png` of a case whose stock was cut, coloured by its deviation,
/// `temperatures.png` of a case with heat, and a picture `EXX-temperatures.png` of every element
/// that the scene plots; older ones are removed if the case has none.
void write_source_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict);

/// Draws all cases on one symmetric colour scale with their figures.
/// @param progress  shows one stage, "compare"
void write_comparison_picture(const ResultFile& file, const Scene& scene,
                              const std::vector<Compared>& cases, const Progress& progress = {});

/// Draws machine, part and path with magnified errors, for `abbe check --picture`.
/// @throws BadInput, OutputFailure
void write_check_picture(const ResultFile& file, const Job& job);

/// Writes `collision.png`, the machine at the first collision, or else at the smallest distance of
/// two bodies, the two in red, and `clearance.png`, the smallest clearance over the program; a
/// picture without data is removed.
/// @throws OutputFailure; BadInput if the program was built without pictures
void write_collision_pictures(const ResultFolder& folder, const Job& job,
                              const Collisions& collisions);

/// Draws machine and path of a program alone, for `abbe program --picture`.
/// @throws BadInput, OutputFailure
void write_program_picture(const ResultFile& file, const ProgramInspection& alone);

}  // namespace abbe::sim
