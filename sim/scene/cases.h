#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "sim/compensation/correct.h"
#include "sim/compensation/plug_in_protocol.h"
#include "sim/scene/document.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

/// A compensator as the three choices of a case name, or one of the user's own.
struct CaseDescription {
  std::string name;  ///< "perfect-iterated-ideal", "mine.py"
  enum class Belief {
    Perfect,     ///< the truth without its random parts
    Identified,  ///< geometric errors, from readings
    Thermal,     ///< what heat adds, from temperatures
    Composite,   ///< both (Yang 2012)
    Force,       ///< what the cut bends, from current, dynamometer or a model of the force
    Part,        ///< what was measured of a part that was cut before
    Fused,       ///< all that the scene gives to believe, with one correction (Guo 2016)
  } belief = Belief::Perfect;
  compensation::Strategy strategy = compensation::Strategy::Iterated;
  enum class Channel {
    Ideal,
    Program,
    Pulses,
    Open,
    Origin,
    Table,
    Piezo
  } channel = Channel::Ideal;
  std::filesystem::path plug_in;  ///< then belief and strategy are its own
  /// Asked instead of the file, whose name then is a name alone.
  std::shared_ptr<const compensation::PlugInFunction> function = {};
};

/// Reads a case name "perfect-iterated-ideal"; one with a dot or slash is a plug-in's file.
/// @throws std::invalid_argument naming the token and what it could be
CaseDescription parse_case(const std::string& name);

/// The case of a plug-in's file, called by its name with extension.
/// @throws std::invalid_argument if that name cannot be a folder's
CaseDescription plug_in_case(const std::filesystem::path& file);

/// Strategy and channel by which a plug-in's corrections are made and brought, "iterated-pulses";
/// and back.
/// @throws std::invalid_argument naming the token and what it could be; for tables
CaseDescription parse_plug_in_method(const std::string& words);
std::string plug_in_method(const CaseDescription& plug_in);

struct Key;
class TableReader;
template <typename T>
class Fields;

/// Whether a name may be that of a file or folder: letters, digits, blanks, _ - .
bool is_folder_name(const std::string& name);

/// `[compare]` and `[[variant]]`
const Fields<std::vector<CaseDescription>>& compare_fields();
std::vector<Variant> read_variants(TableReader& scene);
Node::Table written_variant(const Variant& variant);
std::vector<Key> variant_keys();

// The folders in which `compare` leaves its cases, and the files beside them.

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
  struct VariantCases {
    std::string name;
    std::vector<CaseDescription> cases;
  };
  std::vector<CaseDescription> cases;
  std::vector<VariantCases> variants;
};
/// All folders, without repetition of what is faulty.
std::vector<std::string> case_folders(const ComparedNames& names);

/// Two cases in one folder, or a folder where a file will stand, each at its place in the scene.
void check_case_folders(const Node& scene, const ComparedNames& names, InputErrors& input_errors);

}  // namespace abbe::sim
