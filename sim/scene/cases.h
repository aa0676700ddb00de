#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "sim/compensation/correct.h"
#include "sim/compensation/plug_in.h"
#include "sim/scene/document.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

/// A compensator, described by the three choices of a case name or by a plug-in of the user.
struct CaseDescription {
  std::string name;  ///< "perfect-iterated-ideal", "mine.py"
  enum class Belief {
    Perfect,     ///< the true errors without their random parts
    Identified,  ///< geometric errors estimated from readings
    Thermal,     ///< thermal errors predicted from temperatures
    Composite,   ///< geometric and thermal errors together (Yang 2012)
    Force,       ///< deflection under the cutting force, known by current, dynamometer or force
                 ///< model
    Part,        ///< deviations measured on a part that was cut before
    Fused,       ///< all beliefs that the scene states, with one correction (Guo 2016)
  } belief = Belief::Perfect;
  compensation::Strategy strategy = compensation::Strategy::Iterated;
  enum class Channel {
    Ideal,
    Program,
    PulseInsertion,
    Open,
    Origin,
    Table,
    Piezo
  } channel = Channel::Ideal;
  std::filesystem::path plug_in;  ///< if set, the file supplies belief and strategy itself
  /// If set, called instead of the plug-in file, whose name is then only a label.
  std::shared_ptr<const compensation::PlugInFunction> function = {};
};

/// Returns the case of a name such as "perfect-iterated-ideal"; a name with a dot or slash is the
/// file of a plug-in.
/// @throws std::invalid_argument naming the token and the values it may take
CaseDescription parse_case(const std::string& name);

/// Returns the case of a plug-in file, named after the file with its extension.
/// @throws std::invalid_argument if that name cannot be a folder name
CaseDescription plug_in_case(const std::filesystem::path& file);

/// Converts the strategy and channel of a plug-in's corrections, such as "iterated-pulses", from
/// and to text.
/// @throws std::invalid_argument naming the token and the values it may take; also for tables
CaseDescription parse_plug_in_method(const std::string& text);
std::string plug_in_method(const CaseDescription& plug_in);

struct Key;
class TableReader;
template <typename T>
class Fields;

/// Returns true if a name can be that of a file or folder: letters, digits, blanks, _ - .
bool is_folder_name(const std::string& name);

/// Fields and readers of `[compare]` and `[[variant]]`.
const Fields<std::vector<CaseDescription>>& compare_fields();
std::vector<Variant> read_variants(TableReader& scene);
Node::Table variant_to_table(const Variant& variant);
std::vector<Key> variant_keys();

// Names of the folders in which `compare` stores its cases, and of the files next to them.

/// Files that `run` and `compare` may write to their folder.
inline constexpr std::array result_names{
    "program.ngc",     "program.csv",    "scene.toml",    "summary.json",  "residual.vtp",
    "residual.ply",    "residual.stl",   "residual.csv",  "residual.npz",  "residual.json",
    "track.npz",       "residual.png",   "histogram.png", "signals.csv",   "stock.vtp",
    "stock.png",       "stock.stl",      "rewritten.ngc", "rewritten.csv", "temperatures.png",
    "comparison.json", "comparison.png", "thermal.json",  "thermal.png",   "tolerance.png",
    "report.html"};

/// Returns the folder name of a case of a variant, which is also its label in tables. An empty
/// `variant` stands for the scene itself.
std::string case_folder(const std::string& variant, const std::string& case_name);

/// The compared cases: those of the scene, then those of each variant.
struct ComparedNames {
  struct VariantCases {
    std::string name;
    std::vector<CaseDescription> cases;
  };
  std::vector<CaseDescription> cases;
  std::vector<VariantCases> variants;
};
/// Returns the folder names of all cases and variants, duplicates included.
std::vector<std::string> case_folders(const ComparedNames& names);

/// Reports every folder name that two cases share or that is also the name of a result file, at the
/// position of the case in the scene.
void check_case_folders(const Node& scene, const ComparedNames& names, InputErrors& input_errors);

}  // namespace abbe::sim
