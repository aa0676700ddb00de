#pragma once

#include <filesystem>
#include <vector>

#include "sim/files/output.h"
#include "sim/report/verdict.h"

/// Pictures and VTK files of results. Where the program was built without VTK those of a run are
/// not written, and those that are asked for by name are refused.
namespace abbe::sim {

/// Whether this program was built with VTK.
bool draws_pictures();

/// `residual.vtp`, `residual.png` and `histogram.png` of a case.
/// @throws OutputFailure
void write_case_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict);

/// `stock.vtp` of a case whose stock was cut, `temperatures.png` of one with heat and a picture
/// `EXX-temperatures.png` of every element that the scene plots; older ones are removed where the
/// case has none.
void write_source_pictures(const ResultFolder& folder, const Job& job, const Verdict& verdict);

/// All cases on one symmetric colour scale with their figures.
void write_comparison_picture(const ResultFile& file, const Scene& scene,
                              const std::vector<Compared>& cases);

/// Machine, part and path, the errors of the path magnified; what `abbe check --picture` draws.
/// @throws BadInput, OutputFailure
void write_check_picture(const ResultFile& file, const Job& job);

struct RenderOptions {
  std::filesystem::path result;                ///< a residual.vtp, or the folder that has one
  std::optional<std::filesystem::path> minus;  ///< another, taken away vertex by vertex
  std::optional<std::string> line;  ///< profile along "x", "y" or "radius" instead of a map
  std::filesystem::path out;        ///< folder
  Permissions permissions;
};

/// Pictures of a finished result, or of a difference of two.
/// @return the picture
/// @throws BadInput, OutputFailure
std::filesystem::path render_result(const RenderOptions& options);

}  // namespace abbe::sim
