#pragma once

#include <filesystem>
#include <vector>

#include "sim/cut/program_inspection.h"
#include "sim/files/output.h"
#include "sim/report/verdict.h"

/// Pictures and VTK files of results. Where the program was built without VTK those of a run are
/// not written, and those that are asked for by name are refused.
namespace abbe::sim {

/// Whether this program was built with VTK.
bool can_draw_pictures();

/// What is missing to draw a text as it is; empty where nothing is, or nothing is drawn.
std::string font_warning(const std::string& text);

/// `residual.png` and `histogram.png` of a case, `tolerance.png` of one with a tolerance.
/// @param progress  shows one stage, "draw"
/// @throws OutputFailure, Interrupted
void write_case_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                         const Progress& progress = {});

/// A PNG file of the map of a case, small in bytes; empty where the program was built without VTK.
/// @param width  px
std::string map_png(const Job& job, const Verdict& verdict, int width);

/// `stock.vtp` and `stock.png` of a case whose stock was cut, coloured by its deviation,
/// `temperatures.png` of one with heat and a picture `EXX-temperatures.png` of every element that
/// the scene plots; older ones are removed where the case has none.
void write_source_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict);

/// All cases on one symmetric colour scale with their figures.
/// @param progress  shows one stage, "compare"
void write_comparison_picture(const ResultFile& file, const Scene& scene,
                              const std::vector<Compared>& cases, const Progress& progress = {});

/// Machine, part and path, the errors of the path magnified; what `abbe check --picture` draws.
/// @throws BadInput, OutputFailure
void write_check_picture(const ResultFile& file, const Job& job);

/// `collision.png`, the machine at the first collision, or else where two bodies are nearest, the
/// two in red, and `clearance.png`, the smallest clearance over the program; what there is not is
/// removed.
/// @throws OutputFailure; BadInput where pictures are not built
void write_collision_pictures(const ResultFolder& folder, const Job& job,
                              const Collisions& collisions);

/// Machine and path of a program alone; what `abbe program --picture` draws.
/// @throws BadInput, OutputFailure
void write_program_picture(const ResultFile& file, const ProgramInspection& alone);

}  // namespace abbe::sim
