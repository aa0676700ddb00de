#pragma once

#include <array>
#include <string>
#include <vector>

#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"

/// The folders in which `compare` leaves its cases, and the files beside them.
namespace abbe::sim {

/// Files that `run` and `compare` may leave in their folder.
inline constexpr std::array result_names{
    "program.ngc",     "program.csv",    "scene.toml",    "summary.json",  "residual.vtp",
    "residual.ply",    "residual.stl",   "residual.csv",  "residual.npz",  "residual.json",
    "track.npz",       "residual.png",   "histogram.png", "signals.csv",   "stock.vtp",
    "stock.png",       "stock.stl",      "rewritten.ngc", "rewritten.csv", "temperatures.png",
    "comparison.json", "comparison.png", "thermal.json",  "thermal.png",   "tolerance.png",
    "report.html"};

/// Folder, and name in tables, of a case of a variant; of the scene itself if `variant` is empty.
std::string case_folder(const std::string& variant, const std::string& case_name);

/// What is compared: the cases of the scene, then those of each variant.
struct ComparedNames {
  struct OfVariant {
    std::string name;
    std::vector<CaseDescription> cases;
  };
  std::vector<CaseDescription> cases;
  std::vector<OfVariant> variants;
};
/// All folders, without repetition of what is faulty.
std::vector<std::string> case_folders(const ComparedNames& names);

/// Two cases in one folder, or a folder where a file will stand, each at its place in the scene.
void check_case_folders(const Node& scene, const ComparedNames& names, Faults& faults);

}  // namespace abbe::sim
